// SPDX-License-Identifier: Apache-2.0
//! Runs made from older ones: when arrays change in a few elements, only those instances are placed again, and what shares
//! a block of boxes with them. Gives what a scan gives.

use std::sync::{Arc, Mutex};

use rayon::prelude::*;

use super::placement::InstanceArrays;
use super::reader::{Numbers, number};
use super::run::{BLOCK, Run, RunSpec, Scan, TASK};
use crate::mesh::Aabb;

impl Run {
    /// The run of `spec` made from `old` by looking at changed instances only; `None` when that is not possible or not
    /// worth it.
    pub(super) fn edited(old: &Arc<Self>, spec: &RunSpec) -> Option<Self> {
        let ranks = old.changed_ranks(spec)?;
        let mut run = Self {
            spec: spec.clone(),
            unmasked: old.unmasked.clone(),
            bad: old.bad.clone(),
            ranks: old.ranks,
            blocks: old.blocks.clone(),
            bounds: Aabb::EMPTY,
            dropped: old.dropped,
            edits: None,
            items: Mutex::new(None),
        };
        let mut touched: Vec<usize> = ranks.iter().map(|&rank| rank as usize / BLOCK).collect();
        touched.dedup();
        let (numbers, placer) = (run.numbers(), run.spec.placer());
        let scans: Vec<Scan> = touched
            .par_iter()
            .map(|&block| {
                let mut scan = Scan::default();
                let end = ((block + 1) * BLOCK).min(old.ranks as usize);
                scan.add_block(&numbers, &placer, block * BLOCK..end, (0, &mut []));
                scan
            })
            .collect();
        let outside =
            |numbers: Numbers<'_>| ranks.par_iter().filter(|&&rank| numbers.of(rank).is_none()).count() as u64;
        let (was_outside, is_outside) = (outside(old.numbers()), outside(numbers));
        let is_touched = |rank: &u32| touched.binary_search(&(*rank as usize / BLOCK)).is_ok();
        let mut bad: Vec<u32> = old.bad.iter().copied().filter(|rank| !is_touched(rank)).collect();
        bad.extend(scans.iter().flat_map(|s| s.bad.iter().copied()));
        bad.sort_unstable();
        for (&block, scan) in touched.iter().zip(&scans) {
            if let (Some(slot), Some(bounds)) = (run.blocks.get_mut(block), scan.blocks.first()) {
                *slot = *bounds;
            }
        }
        run.bounds = run.blocks.iter().fold(Aabb::EMPTY, |a, b| a.union(b));
        let outside = (run.dropped.instance_indices + is_outside).saturating_sub(was_outside);
        run.dropped.instance_indices = outside;
        run.dropped.instance_transforms = (bad.len() as u64).saturating_sub(outside);
        run.bad = bad;
        run.edits = Some((Arc::downgrade(old), Arc::new(ranks)));
        Some(run)
    }

    /// Ranks whose placement may differ under `spec`, in order, if all else is the same and they are few.
    fn changed_ranks(&self, spec: &RunSpec) -> Option<Vec<u32>> {
        let (old, new) = (self.spec.instances.as_ref()?, spec.instances.as_ref()?);
        let same_frame = self.spec.before == spec.before
            && self.spec.after == spec.after
            && self.spec.target_bounds == spec.target_bounds
            && !spec.target_bounds.is_empty();
        if !same_frame || self.ranks == 0 || old.indices.identity() != new.indices.identity() {
            return None;
        }
        let changed = InstanceArrays::changes(&old.arrays, &new.arrays)?;
        if changed.is_most_of(self.ranks) {
            return None;
        }
        let (unmasked, indices) = (self.unmasked.as_ref().map(|n| &n[..]), old.indices.view());
        let is_changed = |rank: u32| number(unmasked, &indices, rank as usize).is_some_and(|n| changed.contains(n));
        Some((0..self.ranks).into_par_iter().with_min_len(TASK).filter(|&rank| is_changed(rank)).collect())
    }

    /// Ranks that may differ from those of `old`, when this run was made from it.
    pub(crate) fn edits_of(&self, old: &Arc<Self>) -> Option<Arc<Vec<u32>>> {
        let (from, ranks) = self.edits.as_ref()?;
        std::ptr::eq(from.as_ptr(), Arc::as_ptr(old)).then(|| ranks.clone())
    }
}
