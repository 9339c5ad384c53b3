// SPDX-License-Identifier: Apache-2.0
//! Assemblies: lists of instance records that are computed on demand from borrowed arrays, never stored.

use std::ops::Range;
use std::sync::Arc;

use super::diff::ChangedNumbers;
use super::instance_primvars::{ColumnReader, InstanceColumn, MemberPrimvar, value_bytes, write_value};
use super::motion::{MotionKey, PlacementKeys};
use super::placement::PlacedInstance;
use super::run::InstanceRun;
use crate::mesh::Aabb;

/// Bytes that an instance record counts as when chunks are sized. On the device it takes 64, and a third of a node of
/// 64 (`mesh::level`); a whole node is counted for each, so that scenes keep the chunks and the bits that they had.
pub const RECORD_BYTES: u64 = 128;
/// Device bytes of a key of a placement that moves.
pub const KEY_BYTES: u64 = size_of::<oocpt_abi::GpuMotionKey>() as u64;

/// The target of an instance record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum InstanceTarget {
    /// Index into [`crate::scene::Snapshot::meshes`].
    Mesh(u32),
    /// Index into [`crate::scene::Snapshot::assemblies`].
    Assembly(u32),
}

/// One placement of a mesh or an assembly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceRecord {
    /// Rows of the affine matrix from the assembly's frame to the target's.
    pub object_from_parent: [[f32; 4]; 3],
    /// The mesh or assembly that is placed.
    pub target: InstanceTarget,
    /// Prim id of the mesh prim; -1 if the target is an assembly.
    pub prim_id: i32,
    /// Rank of the instance among the unmasked instances of its prototype; 0 if no instancer places it.
    pub index_in_prototype: u32,
    /// Number of unmasked instances of the prototype; 1 if no instancer places it. The instance id of a hit is 0, then
    /// for every record from the outermost in: `id = id * prototype_count + index_in_prototype`.
    pub prototype_count: u32,
    /// Box of the placed target in the assembly's frame: min, max. Conservative for the f32 matrix above.
    pub bounds: [[f32; 3]; 2],
    /// True if the transform has a negative determinant.
    pub flips_handedness: bool,
    /// Number of keys of a moving record, of which `object_from_parent` is none (it is at the frame's own time);
    /// else 0.
    pub keys: u32,
}

impl Default for InstanceRecord {
    fn default() -> Self {
        Self {
            object_from_parent: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            target: InstanceTarget::Mesh(0),
            prim_id: -1,
            index_in_prototype: 0,
            prototype_count: 1,
            bounds: [[0.0; 3]; 2],
            flips_handedness: false,
            keys: 0,
        }
    }
}

/// A run with its target.
#[derive(Clone, Debug)]
pub(crate) struct AssemblyMember {
    /// Placements of the member.
    pub(crate) run: Arc<InstanceRun>,
    /// Target of the placements.
    pub(crate) target: InstanceTarget,
    /// Prim id of the mesh prim, -1 for assemblies.
    pub(crate) prim_id: i32,
    /// Path of the mesh or the instancer.
    pub(crate) path: Arc<str>,
    /// Index of the prototype of the instancer and of its set of collections, or of the cluster of the mesh; else 0.
    pub(crate) slot: usize,
    /// Primvars of the instancer that something below reads.
    pub(crate) primvars: Vec<MemberPrimvar>,
}

impl AssemblyMember {
    fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.run, &other.run)
            && self.target == other.target
            && self.prim_id == other.prim_id
            && MemberPrimvar::are_same(&self.primvars, &other.primvars)
    }
}

/// The content of the world or of a prototype. It stores no records: they are computed from the borrowed arrays.
#[derive(Debug)]
pub struct Assembly {
    key: u64,
    /// True if the members are the clusters of one mesh.
    is_split_mesh: bool,
    bounds: Aabb,
    members: Vec<AssemblyMember>,
    /// First record of each member, then the number of records.
    starts: Vec<usize>,
    columns: Vec<InstanceColumn>,
    /// True if some record has keys.
    moves: bool,
}

impl Assembly {
    pub(crate) fn new(key: u64, members: Vec<AssemblyMember>, is_split_mesh: bool) -> Self {
        let mut starts = Vec::with_capacity(members.len() + 1);
        let mut len = 0_usize;
        starts.push(0);
        for member in &members {
            len += member.run.len();
            starts.push(len);
        }
        let bounds = members.iter().fold(Aabb::EMPTY, |b, m| b.union(&m.run.bounds()));
        let placed = members.iter().filter(|m| m.run.len() > 0);
        let columns = MemberPrimvar::columns(placed.map(|m| &m.primvars[..]));
        let moves = members.iter().any(|member| member.run.key_count() > 0);
        Self { key, is_split_mesh, bounds, members, starts, columns, moves }
    }

    pub(crate) fn members(&self) -> &[AssemblyMember] {
        &self.members
    }

    /// Returns true if the members are the clusters of one mesh, which users see as one.
    #[must_use]
    pub fn is_split_mesh(&self) -> bool {
        self.is_split_mesh
    }

    /// Returns true if `members` would give the same records.
    pub(crate) fn is_made_of(&self, members: &[AssemblyMember]) -> bool {
        self.members.len() == members.len() && self.members.iter().zip(members).all(|(a, b)| a.is_same(b))
    }

    /// A stamp, unique in its [`crate::scene::SceneDb`]: an assembly whose records differ in any bit has another key,
    /// and one that an edit did not touch keeps it. An edit that undoes an earlier one may give a new key.
    #[must_use]
    pub fn key(&self) -> u64 {
        self.key
    }

    /// Number of instance records.
    #[must_use]
    pub fn len(&self) -> usize {
        self.starts.last().copied().unwrap_or(0)
    }

    /// Targets of the records, sorted, each once.
    #[must_use]
    pub fn targets(&self) -> Vec<InstanceTarget> {
        let placed = self.members.iter().filter(|member| member.run.len() > 0);
        let mut targets: Vec<InstanceTarget> = placed.map(|member| member.target).collect();
        targets.sort_unstable();
        targets.dedup();
        targets
    }

    /// Returns true if nothing is placed.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes that its records, their hierarchy and their values count as when chunks are sized: at least those that
    /// they take on the device.
    #[must_use]
    pub fn device_bytes(&self) -> u64 {
        let records = (RECORD_BYTES + value_bytes(&self.columns)).saturating_mul(self.len() as u64);
        records.saturating_add(KEY_BYTES.saturating_mul(self.keys_before(self.len()) as u64))
    }

    /// Box of all records, in this assembly's frame; empty if there is none. Of the root of a live scene it may be that
    /// of before they moved ([`crate::scene::SceneDb::set_late`]).
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Whether it is known where all records are.
    pub(crate) fn is_measured(&self) -> bool {
        self.members.iter().all(|member| member.run.is_measured())
    }

    /// Primvars that records have values of.
    #[must_use]
    pub fn columns(&self) -> &[InstanceColumn] {
        &self.columns
    }

    /// Writes the values of records `range` in `column`, one after the other, [`InstanceColumn::width`] floats each;
    /// all are [`NO_VALUE`](oocpt_abi::NO_VALUE) for a record without a value. Otherwise as [`Assembly::encode`].
    pub fn encode_values(&self, column: InstanceColumn, range: Range<usize>, out: &mut [f32]) {
        let width = column.width.max(1) as usize;
        let end = range.end.min(self.len()).min(range.start.saturating_add(out.len() / width));
        let mut at = range.start;
        while at < end {
            let index = self.starts.partition_point(|&start| start <= at).saturating_sub(1);
            let (Some(member), Some(&start)) = (self.members.get(index), self.starts.get(index)) else { return };
            let stop = end.min(start + member.run.len());
            let slots = (at - range.start) * width..(stop - range.start) * width;
            let Some(slots) = out.get_mut(slots) else { return };
            let reader = ColumnReader::new(&member.run, &member.primvars, column);
            member.run.each_rank(at - start..stop - start, |k, rank| {
                if let Some(slot) = slots.get_mut(k * width..(k + 1) * width) {
                    write_value(slot, reader.as_ref().map(|reader| reader.at(rank)));
                }
            });
            at = stop;
        }
    }

    /// Computes records `range` into `out`: record `range.start + k` goes to `out[k]`. Pure; call it from many threads
    /// with disjoint outputs. Stops at the end of `out`, of `range` or of the assembly, whichever comes first. About
    /// 100 ns per record, no allocation.
    pub fn encode(&self, range: Range<usize>, out: &mut [InstanceRecord]) {
        let end = range.end.min(self.len()).min(range.start.saturating_add(out.len()));
        let mut at = range.start;
        while at < end {
            // The last member that begins at or before `at`; members may be empty.
            let index = self.starts.partition_point(|&start| start <= at).saturating_sub(1);
            let (Some(member), Some(&start)) = (self.members.get(index), self.starts.get(index)) else {
                return;
            };
            let stop = end.min(start + member.run.len());
            let Some(slots) = out.get_mut(at - range.start..stop - range.start) else {
                return;
            };
            member.encode(at - start..stop - start, slots);
            at = stop;
        }
    }

    /// Number of keys of the records before `record`, which may be the number of records.
    #[must_use]
    pub fn keys_before(&self, record: usize) -> usize {
        if !self.moves {
            return 0;
        }
        let keys = |(member, start): (&AssemblyMember, &usize)| {
            record.saturating_sub(*start).min(member.run.len()) * member.run.key_count()
        };
        self.members.iter().zip(&self.starts).map(keys).sum()
    }

    /// Calls `visit` with the keys of the moving ones of the records `range`, in order.
    pub fn encode_keys(&self, range: Range<usize>, mut visit: impl FnMut(&[MotionKey])) {
        if !self.moves {
            return;
        }
        for (member, &start) in self.members.iter().zip(&self.starts) {
            let [first, end] = [range.start, range.end].map(|at| at.saturating_sub(start).min(member.run.len()));
            if member.run.key_count() == 0 || first >= end {
                continue;
            }
            let reader = member.run.reader(None);
            member.run.each_rank(first..end, |_, rank| {
                if let Some(keys) = reader.keys(rank) {
                    visit(keys.as_slice());
                }
            });
        }
    }

    /// Calls `visit` with the records whose target and prim id are `wanted`, with member, rank and, if they move, keys;
    /// at most `most`, in order. Returns if these were all.
    pub(crate) fn encode_where(
        &self,
        wanted: &dyn Fn(InstanceTarget, i32) -> bool,
        most: usize,
        visit: RecordVisitor<'_>,
    ) -> bool {
        let mut room = most;
        for member in self.members.iter().filter(|member| wanted(member.target, member.prim_id)) {
            let count = member.run.len();
            let reader = (member.key_count() != 0).then(|| member.run.reader(None));
            let keys = |rank: u32| reader.as_ref().and_then(|reader| reader.keys(rank));
            let places = 0..count.min(room);
            member.run.encode(places, |_, rank, placed| visit(member.record(rank, placed), member, rank, keys(rank)));
            if count > room {
                return false;
            }
            room -= count;
        }
        true
    }
}

/// Ranks of a member that are placed elsewhere.
#[derive(Clone, Debug)]
pub(crate) enum MovedRanks {
    Nothing,
    /// These, in order.
    Ranks(Arc<Vec<u32>>),
    /// Those of these instances, which were not measured.
    Numbers(Arc<ChangedNumbers>),
    All,
}

/// Takes a record, its member, its rank and, if it moves, its keys.
pub(crate) type RecordVisitor<'a> = &'a mut dyn FnMut(InstanceRecord, &AssemblyMember, u32, Option<PlacementKeys>);

impl AssemblyMember {
    /// Path and number that identify a member of an assembly and order it.
    pub(crate) fn name(&self) -> (&str, usize) {
        (&self.path, self.slot)
    }

    /// The difference to `next`, if they differ in nothing but some usable placements: the ranks of those, or `None`
    /// inside for no rank.
    #[expect(clippy::option_option, reason = "no small difference; none at all; some ranks")]
    pub(crate) fn edit_to(&self, next: &Self) -> Option<Option<Arc<Vec<u32>>>> {
        let comparable = self.target == next.target
            && self.prim_id == next.prim_id
            && self.prototype_count() == next.prototype_count();
        if !comparable {
            return None;
        }
        if Arc::ptr_eq(&self.run, &next.run) { Some(None) } else { next.run.edits_of(&self.run).map(Some) }
    }

    /// The ranks that other arrays may place elsewhere in `next`; `None` if anything else differs.
    pub(crate) fn moved_ranks(&self, next: &Self) -> Option<MovedRanks> {
        let is_alike = self.name() == next.name()
            && self.target == next.target
            && self.prim_id == next.prim_id
            && MemberPrimvar::are_same(&self.primvars, &next.primvars);
        if !is_alike {
            return None;
        }
        if Arc::ptr_eq(&self.run, &next.run) {
            return Some(MovedRanks::Nothing);
        }
        let ranks = next.run.edits_of(&self.run).map(MovedRanks::Ranks);
        let moved = ranks.or_else(|| next.run.moves_of(&self.run).map(MovedRanks::Numbers));
        next.run.has_ranks_of(&self.run).then(|| moved.unwrap_or(MovedRanks::All))
    }

    /// Number of records of an instancer's prototype, for instance ids.
    pub(crate) fn prototype_count(&self) -> u32 {
        if self.run.is_instanced() { self.run.prototype_count() } else { 1 }
    }

    /// Number of keys of each placement; 0 if they do not move.
    pub(crate) fn key_count(&self) -> u32 {
        u32::try_from(self.run.key_count()).unwrap_or(0)
    }

    /// The record of a placement.
    pub(crate) fn record(&self, rank: u32, placed: &PlacedInstance) -> InstanceRecord {
        InstanceRecord {
            object_from_parent: placed.object_from_parent,
            target: self.target,
            prim_id: self.prim_id,
            index_in_prototype: self.run.index_in_prototype(rank),
            prototype_count: self.prototype_count(),
            bounds: [placed.bounds.min, placed.bounds.max],
            flips_handedness: placed.flips_handedness,
            keys: self.key_count(),
        }
    }

    fn encode(&self, places: Range<usize>, out: &mut [InstanceRecord]) {
        self.run.encode(places, |k, rank, placed| {
            if let Some(slot) = out.get_mut(k) {
                *slot = self.record(rank, placed);
            }
        });
    }
}
