// SPDX-License-Identifier: Apache-2.0
//! Chunks: consecutive records of an assembly in Morton order, in a frame of their own.
//!
//! A chunk stores no record: it lists its placements (4 to 6 bytes each, 8 of more than 65 536 members) and computes
//! the records on demand from the borrowed arrays. It is immutable to its users; any thread.

use std::ops::Range;
use std::sync::{Arc, OnceLock, PoisonError, RwLock};

use glam::DVec3;

use super::blocks::RecordBlock;
use super::chunk_members::ChunkMembers;
use super::lattice::MortonLattice;
use super::peaks::RecordPeaks;
use super::which::IndexSet;
use crate::instancing::affine::{MATRIX_ERROR, round_down, round_up};
use crate::instancing::assembly::{Assembly, AssemblyMember, InstanceRecord, InstanceTarget, RecordVisitor};
use crate::instancing::instance_primvars::{ColumnReader, InstanceColumn, MemberPrimvar, write_value};
use crate::instancing::item::PlacementItem;
use crate::instancing::motion::MotionKey;
use crate::instancing::placement::PlacedInstance;
use crate::instancing::run::RunReader;
use crate::mesh::Aabb;

/// Cells with more members are not tested for small parts in a large box: patches may keep them as they are.
pub(crate) const SCATTERED: usize = 64;

/// Rounding of f64 frames, relative to the distance of the origin.
const FRAME_ERROR: f64 = 1.0 / (1_u64 << 50) as f64;
/// Factor that makes room for the rounding of the bounds' own computation.
const SLACK: f64 = 1.0 + 1.0 / 65_536.0;

/// Number of records whose data is touched before they are computed.
const BATCH: usize = 64;
/// Number of members whose readers are kept during an encode.
const KEPT_READERS: usize = 256;

/// Instance records that are loaded and evicted together.
#[derive(Debug)]
pub struct Chunk {
    pub(crate) key: u64,
    origin: DVec3,
    bounds: Aabb,
    /// For a chunk that is measured later: its bounds then, in place of those that it had.
    late: Option<OnceLock<Aabb>>,
    targets: Vec<InstanceTarget>,
    columns: Vec<InstanceColumn>,
    /// True if some record has keys.
    moves: bool,
    /// Morton codes of the first and the last record.
    pub(crate) codes: [u64; 2],
    /// Members that have records in the chunk, in the order of the assembly: lasting ids, and the number of records.
    pub(crate) ids: Arc<Vec<u32>>,
    pub(crate) counts: Arc<Vec<u32>>,
    /// Members of the records. Replaced when the assembly is, if that changes no record of the chunk.
    members: RwLock<ChunkMembers>,
    /// Rank of each record.
    pub(crate) ranks: Arc<Vec<u32>>,
    /// Index into `ids` of each record; empty if there is only one id.
    pub(crate) which: Arc<IndexSet>,
    /// Boxes of consecutive records; of a held chunk, those before its records moved.
    pub(crate) blocks: Arc<Vec<RecordBlock>>,
    /// What it was before its records moved, if they did.
    pub(crate) held: Option<HeldChunk>,
}

/// The past of a chunk whose records have moved within it ([`super::hold`]): its cell and its order are those of the
/// chunk that it was cut as.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeldChunk {
    /// Key of that chunk.
    pub(crate) shape: u64,
    /// Half the surface of that chunk's box.
    pub(crate) area: f64,
}

/// The inputs of a chunk.
#[derive(Debug)]
pub(crate) struct ChunkContent {
    /// Codes, as [`Chunk::codes`].
    pub(crate) codes: [u64; 2],
    /// Numbers of the members that have records here, in order.
    pub(crate) present: Vec<u32>,
    /// Number of records of each member.
    pub(crate) counts: Vec<u32>,
    /// Ranks, as [`Chunk::ranks`].
    pub(crate) ranks: Vec<u32>,
    /// Indices, as [`Chunk::which`].
    pub(crate) which: IndexSet,
    /// Blocks of all records.
    pub(crate) blocks: Vec<RecordBlock>,
}

/// The members of an assembly while it is partitioned.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AssemblyMembers<'a> {
    pub(crate) assembly: &'a Arc<Assembly>,
    /// Lasting id of each member.
    pub(crate) ids: &'a [u32],
    /// True if all chunks keep the assembly's frame.
    pub(crate) keeps_frame: bool,
}

impl Chunk {
    /// Makes a chunk of sorted items; its key is set later.
    pub(crate) fn new(items: &[&[PlacementItem]], roster: AssemblyMembers<'_>, lattice: &MortonLattice) -> Self {
        let all = || items.iter().copied().flatten();
        let mut present: Vec<u32> = Vec::new();
        for item in all() {
            if present.last() != Some(&item.member()) {
                present.push(item.member());
            }
        }
        present.sort_unstable();
        present.dedup();
        let mut counts = vec![0_u32; present.len()];
        let len: usize = items.iter().map(|items| items.len()).sum();
        let mut which = IndexSet::NONE;
        if let [_] = present[..] {
            counts[0] = u32::try_from(len).unwrap_or(u32::MAX);
        } else {
            which = IndexSet::of(all().map(|item| local(&present, item.member())), present.len());
            for w in which.range(0..len) {
                if let Some(count) = counts.get_mut(w as usize) {
                    *count += 1;
                }
            }
        }
        let mut ranks = Vec::with_capacity(len);
        ranks.extend(all().map(PlacementItem::rank));
        let ends = [items.first().and_then(|s| s.first()), items.last().and_then(|s| s.last())];
        let content = ChunkContent {
            codes: ends.map(|item| item.map_or(0, PlacementItem::code)),
            present,
            counts,
            ranks,
            which,
            blocks: RecordBlock::of(all(), lattice),
        };
        Self::of(content, roster, lattice)
    }

    /// Makes a chunk; its key is set later.
    pub(crate) fn of(content: ChunkContent, roster: AssemblyMembers<'_>, lattice: &MortonLattice) -> Self {
        let ChunkContent { codes, present, counts, ranks, which, blocks } = content;
        let ids = Arc::new(present.iter().filter_map(|&m| roster.ids.get(m as usize).copied()).collect());
        let members = ChunkMembers::new(roster.assembly, present.into());
        let measured = if roster.keeps_frame { None } else { measured_box(&members, &ranks, &which) };
        let around = measured.unwrap_or_else(|| {
            lattice.box_of(blocks.iter().fold(RecordPeaks::NONE, |peaks, block| peaks.max(block.peaks())))
        });
        let (origin, bounds) = frame(around, roster.keeps_frame);
        let mut targets: Vec<InstanceTarget> = members.iter().map(|m| m.target).collect();
        targets.sort_unstable();
        targets.dedup();
        let columns = MemberPrimvar::columns(members.iter().map(|m| &m.primvars[..]));
        let moves = members.iter().any(|member| member.run.key_count() > 0);
        let members = RwLock::new(members);
        let (counts, ranks, which, blocks) = (Arc::new(counts), Arc::new(ranks), Arc::new(which), Arc::new(blocks));
        Self {
            key: 0,
            origin,
            bounds,
            late: None,
            targets,
            columns,
            moves,
            codes,
            ids,
            counts,
            members,
            ranks,
            which,
            blocks,
            held: None,
        }
    }

    /// A stamp, unique in its [`crate::scene::SceneDb`]: chunks of equal keys have the same records bit for bit, and a
    /// chunk that an edit did not touch keeps its key.
    #[must_use]
    pub fn key(&self) -> u64 {
        self.key
    }

    /// Chunks of equal shapes have the same records in the same order, elsewhere: the key of the chunk that this one
    /// was before its records moved, or its own.
    #[must_use]
    pub fn shape(&self) -> u64 {
        self.held.map_or(self.key, |held| held.shape)
    }

    /// Whether its records have moved since it was cut.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.held.is_some()
    }

    /// The point of the assembly's frame that is (0, 0, 0) in the chunk's.
    #[must_use]
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Box of all records in the chunk's frame; contains the boxes that [`Chunk::encode`] gives. Of a chunk that waits
    /// to be measured ([`Chunk::is_late`]) a guess: those that it was measured with last.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.late.as_ref().and_then(|late| late.get().copied()).unwrap_or(self.bounds)
    }

    /// Whether its bounds are not known: its records have moved and were not looked at. Then some may not be usable,
    /// too.
    #[must_use]
    pub fn is_late(&self) -> bool {
        self.late.as_ref().is_some_and(|late| late.get().is_none())
    }

    /// Whether its bounds were not known when it was made.
    pub(crate) fn was_late(&self) -> bool {
        self.late.is_some()
    }

    /// Sets the bounds of a chunk that [is late](Chunk::is_late): the box of all records that are usable, empty if none
    /// is. Does nothing for others.
    pub fn set_bounds(&self, bounds: Aabb) {
        if let Some(late) = &self.late {
            // Whoever was faster has measured the same records.
            late.get_or_init(|| bounds);
        }
    }

    /// Measures the chunk if it [is late](Chunk::is_late).
    pub(crate) fn measure(&self) {
        if self.is_late() {
            let mut bounds = Aabb::EMPTY;
            self.encode_each(0..self.len(), |_, record| {
                bounds = bounds.union(&Aabb { min: record.bounds[0], max: record.bounds[1] });
            });
            self.set_bounds(bounds);
        }
    }

    /// Number of records, at least 1.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ranks.len()
    }

    /// Returns false: a chunk has at least one record.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ranks.is_empty()
    }

    /// Targets of the records; sorted, each once.
    #[must_use]
    pub fn targets(&self) -> &[InstanceTarget] {
        &self.targets
    }

    /// The cell: the part of the Morton code that all records share, and its number of bits (64 if all are equal).
    #[must_use]
    pub fn cell(&self) -> (u64, u32) {
        let [first, last] = self.codes;
        let bits = (first ^ last).leading_zeros();
        (if bits == 0 { 0 } else { first & (u64::MAX << (64 - bits)) }, bits)
    }

    /// Bytes of host memory held, without the arrays that records are computed from.
    #[must_use]
    pub fn host_bytes(&self) -> u64 {
        let members = self.ids.len() * 3 * size_of::<u32>();
        let records = self.ranks.len() * size_of::<u32>() + self.which.host_bytes();
        let records = records + size_of_val(&self.blocks[..]);
        (size_of::<Self>() + members + records + size_of_val(&self.targets[..])) as u64
    }

    /// Computes records `range`, in Morton order, with maps and boxes in the chunk's frame, into `out`: record
    /// `range.start + k` goes to `out[k]`. Pure; call it from many threads with disjoint outputs. Stops at the end of
    /// `out`, of `range` or of the chunk, whichever comes first.
    pub fn encode(&self, range: Range<usize>, out: &mut [InstanceRecord]) {
        let end = range.end.min(range.start.saturating_add(out.len()));
        self.encode_each(range.start..end, |at, record| {
            if let Some(slot) = out.get_mut(at - range.start) {
                *slot = *record;
            }
        });
    }

    /// As [`Chunk::encode`], but gives each record with its number to `visit`, which may put it where it likes.
    pub fn encode_each(&self, range: Range<usize>, mut visit: impl FnMut(usize, &InstanceRecord)) {
        let members = self.members();
        let mut plain = self.was_late().then(|| MemberReaders::new(&members, None));
        let mut readers = MemberReaders::new(&members, Some(self.origin));
        self.each(range, &mut readers, |at, member, rank, reader| {
            // All placements of a chunk are usable, unless they were not looked at; what is, is decided in the
            // assembly's frame.
            let is_usable = plain.as_mut().is_none_or(|plain| {
                let item = self.place(at).and_then(|(which, rank)| plain.item(which, rank));
                item.is_some()
            });
            let placed = reader.place(rank).filter(|_| is_usable).unwrap_or(PlacedInstance::NOWHERE);
            visit(at, &member.record(rank, &placed));
        });
    }

    /// Number of keys before a record, as [`crate::scene::Assembly::keys_before`].
    #[must_use]
    pub fn keys_before(&self, record: usize) -> usize {
        if !self.moves {
            return 0;
        }
        let members = self.members();
        let keys: Vec<usize> = members.iter().map(|member| member.run.key_count()).collect();
        let of = |at: usize| self.place(at).and_then(|(which, _)| keys.get(which as usize)).copied().unwrap_or(0);
        (0..record.min(self.len())).map(of).sum()
    }

    /// As [`crate::scene::Assembly::encode_keys`], in the chunk's frame.
    pub fn encode_keys(&self, range: Range<usize>, mut visit: impl FnMut(&[MotionKey])) {
        if !self.moves {
            return;
        }
        let members = self.members();
        let mut readers = MemberReaders::new(&members, Some(self.origin));
        for (which, rank) in (range.start..range.end.min(self.len())).filter_map(|at| self.place(at)) {
            if let Some(keys) = readers.get(which).and_then(|(_, reader)| reader.keys(rank)) {
                visit(keys.as_slice());
            }
        }
    }

    /// Primvars that records have values of.
    #[must_use]
    pub fn columns(&self) -> &[InstanceColumn] {
        &self.columns
    }

    /// As [`crate::scene::Assembly::encode_values`], in the order of the chunk's records.
    pub fn encode_values(&self, column: InstanceColumn, range: Range<usize>, out: &mut [f32]) {
        let members = self.members();
        let mut last: Option<(u32, Option<ColumnReader<'_>>)> = None;
        for (at, slot) in
            (range.start..range.end.min(self.len())).zip(out.chunks_exact_mut(column.width.max(1) as usize))
        {
            let Some((which, rank)) = self.place(at) else { return };
            if last.as_ref().is_none_or(|(known, _)| *known != which) {
                let member = members.get(which);
                last = Some((which, member.and_then(|m| ColumnReader::new(&m.run, &m.primvars, column))));
            }
            let reader = last.as_ref().and_then(|(_, reader)| reader.as_ref());
            write_value(slot, reader.map(|reader| reader.at(rank)));
        }
    }

    /// Calls `visit` with the records whose target and prim id are `wanted`, with member, rank and, if they move, keys;
    /// at most `most`, as [`Chunk::encode`] and [`Chunk::encode_keys`] compute them. Returns if these were all.
    pub(crate) fn encode_where(
        &self,
        wanted: &dyn Fn(InstanceTarget, i32) -> bool,
        most: usize,
        visit: RecordVisitor<'_>,
    ) -> bool {
        let members = self.members();
        let is_wanted: Vec<bool> = members.iter().map(|member| wanted(member.target, member.prim_id)).collect();
        if !is_wanted.contains(&true) {
            return true;
        }
        let mut readers = MemberReaders::new(&members, Some(self.origin));
        let mut count = 0;
        for (which, rank) in (0..self.len()).filter_map(|at| self.place(at)) {
            if !is_wanted.get(which as usize).copied().unwrap_or(false) {
                continue;
            }
            if count >= most {
                return false;
            }
            count += 1;
            if let Some((member, reader)) = readers.get(which)
                && let Some(placed) = reader.place(rank)
            {
                visit(member.record(rank, &placed), member, rank, reader.keys(rank));
            }
        }
        true
    }

    /// Calls `visit` with number, member, rank and reader of each record of `range`, in order. The records are in
    /// random order in memory: those of a batch are touched first, so that the waits for them overlap.
    pub(crate) fn each<'a>(
        &self,
        range: Range<usize>,
        readers: &mut MemberReaders<'a>,
        mut visit: impl FnMut(usize, &'a AssemblyMember, u32, &RunReader<'a>),
    ) {
        let end = range.end.min(self.len());
        for start in range.start.min(end)..end {
            if (start - range.start).is_multiple_of(BATCH) && readers.are_kept() {
                let batch = start..(start + BATCH).min(end);
                let touched = batch.fold(0, |sum, at| {
                    let place = self.place(at);
                    sum ^ place.and_then(|(w, rank)| Some(readers.get(w)?.1.touch(rank))).unwrap_or(0)
                });
                std::hint::black_box(touched);
            }
            let Some((which, rank)) = self.place(start) else { return };
            if let Some((member, reader)) = readers.get(which) {
                visit(start, member, rank, reader);
            }
        }
    }

    /// Index into [`Chunk::ids`] of a record, and its rank.
    pub(crate) fn place(&self, at: usize) -> Option<(u32, u32)> {
        Some((self.which.get(at).unwrap_or(0), *self.ranks.get(at)?))
    }

    /// The chunk whose records, which `members` place now, fill `bounds`, or, if it is late, may do so; without key.
    pub(crate) fn moved(&self, members: ChunkMembers, bounds: Aabb, is_late: bool) -> Self {
        let held = self.held.unwrap_or_else(|| HeldChunk { shape: self.key, area: self.bounds.half_area() });
        Self {
            key: 0,
            origin: self.origin,
            bounds,
            late: is_late.then(OnceLock::new),
            targets: self.targets.clone(),
            columns: self.columns.clone(),
            moves: self.moves,
            codes: self.codes,
            ids: Arc::clone(&self.ids),
            counts: Arc::clone(&self.counts),
            members: RwLock::new(members),
            ranks: Arc::clone(&self.ranks),
            which: Arc::clone(&self.which),
            blocks: Arc::clone(&self.blocks),
            held: Some(held),
        }
    }

    /// The box in the chunk's frame of records that fill a box of the assembly's frame, with their largest spread.
    pub(crate) fn bounds_of(&self, around: [DVec3; 2], spread: f64) -> Aabb {
        bounds_about(self.origin, around, spread)
    }

    /// Returns true if both have the same records of members, in the same order, with equal boxes.
    pub(crate) fn has_places_of(&self, other: &Self) -> bool {
        self.codes == other.codes
            && self.ids == other.ids
            && self.ranks == other.ranks
            && self.which == other.which
            && self.blocks == other.blocks
            && (self.origin, self.bounds) == (other.origin, other.bounds)
            && self.targets == other.targets
    }

    /// Replaces the members of the records by others that give the same records.
    pub(crate) fn set_members(&self, members: ChunkMembers) {
        *self.members.write().unwrap_or_else(PoisonError::into_inner) = members;
    }

    /// Members of the records, in the order of [`Chunk::ids`].
    pub(crate) fn members(&self) -> ChunkMembers {
        self.members.read().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Readers of a chunk's members, made when first needed.
pub(crate) struct MemberReaders<'a> {
    members: &'a ChunkMembers,
    origin: Option<DVec3>,
    known: Vec<Option<RunReader<'a>>>,
    /// The reader used last, if there are too many members to keep all.
    last: Option<(u32, RunReader<'a>)>,
}

impl<'a> MemberReaders<'a> {
    /// Readers of placements relative to `origin`, or to the assembly's.
    pub(crate) fn new(members: &'a ChunkMembers, origin: Option<DVec3>) -> Self {
        let known = if members.len() <= KEPT_READERS { vec![None; members.len()] } else { Vec::new() };
        Self { members, origin, known, last: None }
    }

    /// The item of a record, not on a lattice yet.
    pub(crate) fn item(&mut self, which: u32, rank: u32) -> Option<PlacementItem> {
        self.get(which)?.1.item(rank)
    }

    fn are_kept(&self) -> bool {
        self.known.len() == self.members.len()
    }

    #[inline]
    fn get(&mut self, which: u32) -> Option<(&'a AssemblyMember, &RunReader<'a>)> {
        let member = self.members.get(which)?;
        let make = || member.run.reader(self.origin);
        if let Some(slot) = self.known.get_mut(which as usize) {
            return Some((member, slot.get_or_insert_with(make)));
        }
        if self.last.as_ref().is_none_or(|(known, _)| *known != which) {
            self.last = Some((which, make()));
        }
        self.last.as_ref().map(|(_, reader)| (member, reader))
    }
}

/// Place of a member among those present.
fn local(present: &[u32], member: u32) -> u32 {
    let at = present.binary_search(&member).unwrap_or_else(|at| at);
    u32::try_from(at).unwrap_or(u32::MAX)
}

/// Box of a few records in the assembly's frame, and the largest
/// [`InstanceFootprint::spread`](crate::instancing::placement::InstanceFootprint), measured exactly: a chunk that is
/// much smaller than a step of the lattice gets a frame about its own middle. `None` for many records.
fn measured_box(members: &ChunkMembers, ranks: &[u32], which: &IndexSet) -> Option<([DVec3; 2], f64)> {
    if ranks.len() > SCATTERED {
        return None;
    }
    let mut readers = MemberReaders::new(members, None);
    let (mut around, mut spread) = ([DVec3::INFINITY, DVec3::NEG_INFINITY], 0.0_f64);
    for (at, &rank) in ranks.iter().enumerate() {
        let (_, reader) = readers.get(which.get(at).unwrap_or(0))?;
        let footprint = reader.footprint(rank)?;
        let half = footprint.half + footprint.spread * footprint.lever * MATRIX_ERROR;
        around = [around[0].min(footprint.center - half), around[1].max(footprint.center + half)];
        spread = spread.max(footprint.spread);
    }
    Some((around, spread))
}

/// Origin, and box in the chunk's frame, of records in a box with a spread.
fn frame(([min, max], spread): ([DVec3; 2], f64), keeps_frame: bool) -> (DVec3, Aabb) {
    let origin = if keeps_frame { DVec3::ZERO } else { 0.5 * (min + max) };
    (origin, bounds_about(origin, [min, max], spread))
}

/// Box about `origin` of records in a box with a spread.
fn bounds_about(origin: DVec3, [min, max]: [DVec3; 2], spread: f64) -> Aabb {
    let reach = (min - origin).abs().max((max - origin).abs()).max_element();
    // The map of a record has an error of its spread times the distance between the origin and the record, twice: for
    // the map's offset and for its evaluation.
    let error = SLACK * (2.0 * spread * reach * MATRIX_ERROR) + FRAME_ERROR * (origin.abs().max_element() + reach);
    Aabb {
        min: (min - origin - error).to_array().map(round_down),
        max: (max - origin + error).to_array().map(round_up),
    }
}
