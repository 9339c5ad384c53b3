// SPDX-License-Identifier: Apache-2.0
//! The changes of an opened assembly's members since its last partition, and their consequences for a chunk. Pure.

use std::sync::Arc;

use rustc_hash::{FxHashMap, FxHashSet};

use super::chunk::Chunk;
use crate::instancing::assembly::AssemblyMember;
use crate::instancing::diff::ChangedNumbers;

/// The changes of the members since the last partition.
#[derive(Debug, Default)]
pub(super) struct MemberChanges {
    /// Lasting id of each present member, in the order of the assembly; unused for those without records in chunks.
    pub(super) ids: Vec<u32>,
    /// Number of the member of each lasting id that still exists.
    pub(super) member_of: FxHashMap<u32, u32>,
    /// Members all of whose records are new, by number.
    pub(super) added: Vec<u32>,
    /// Members with some changed records: number, old index among the known ones, ranks.
    pub(super) edited: Vec<(u32, usize, Arc<Vec<u32>>)>,
    /// Whether some member has another number than in the last partition.
    pub(super) is_renumbered: bool,
    /// Ids whose instances have other values of primvars: which ones, or `None` for all.
    pub(super) revalued: FxHashMap<u32, Option<ChangedNumbers>>,
    /// True if the records of removed members are removed one by one.
    pub(super) takes_gone_records: bool,
    pub(super) next_id: u32,
}

impl MemberChanges {
    /// Returns true if some record of a chunk has another value of a primvar.
    pub(super) fn revalues(&self, chunk: &Chunk) -> bool {
        if self.revalued.is_empty() {
            return false;
        }
        let revalued: Vec<_> = chunk.ids.iter().map(|id| self.revalued.get(id)).collect();
        if revalued.iter().all(Option::is_none) {
            return false;
        }
        let members = chunk.members();
        let numbers: Vec<_> = members.iter().map(|member| member.run.numbers()).collect();
        let is_revalued = |at: usize| {
            let (which, rank) = chunk.place(at)?;
            match revalued.get(which as usize).copied().flatten()? {
                None => Some(true),
                Some(changed) => Some(changed.contains(numbers.get(which as usize)?.of(rank).flatten()?)),
            }
        };
        (0..chunk.len()).any(|at| is_revalued(at) == Some(true))
    }

    /// Number of placements that changed.
    pub(super) fn fresh(&self, members: &[AssemblyMember]) -> u64 {
        let added = self.added.iter().filter_map(|&number| members.get(number as usize));
        let edited = self.edited.iter().map(|(.., ranks)| ranks.len() as u64);
        added.map(|member| member.run.len() as u64).chain(edited).sum()
    }

    /// Ranks that changed, in order, by the lasting id of the member.
    pub(super) fn edited_ranks(&self) -> FxHashMap<u32, &[u32]> {
        let id = |number: u32| self.ids.get(number as usize).copied().unwrap_or(u32::MAX);
        self.edited.iter().map(|(number, _, ranks)| (id(*number), &ranks[..])).collect()
    }

    /// Returns true if some record of a chunk is among the edited ones.
    pub(super) fn edits(&self, edited: &FxHashMap<u32, &[u32]>, chunk: &Chunk) -> bool {
        let edited: Vec<_> = chunk.ids.iter().map(|id| edited.get(id)).collect();
        let is_edited = |at: usize| {
            let (which, rank) = chunk.place(at)?;
            Some(edited.get(which as usize).copied().flatten()?.binary_search(&rank).is_ok())
        };
        edited.iter().any(Option::is_some) && (0..chunk.len()).any(|at| is_edited(at) == Some(true))
    }

    /// Records that changed, by number of the member and rank.
    pub(super) fn places(&self) -> FxHashSet<(u32, u32)> {
        self.edited.iter().flat_map(|(number, _, ranks)| ranks.iter().map(|&rank| (*number, rank))).collect()
    }
}
