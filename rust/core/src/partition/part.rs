// SPDX-License-Identifier: Apache-2.0
//! The partition of one opened assembly, brought up to date by what changed.
//!
//! Chunks in which nothing changed are kept; those in which little did are patched; the members of the others, and new
//! ones, are sorted anew and cut together. The result equals that of cutting everything anew. It costs a few steps per
//! chunk, a copy of the touched chunks, and some measuring per edited record.

use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::buckets::OrderBuckets;
use super::cells::{ChunkCutter, OrderPiece};
use super::changes::MemberChanges;
use super::chunk::{AssemblyMembers, Chunk};
use super::chunk_members::ChunkMembers;
use super::cost::{AssetCosts, CutRule};
use super::gather::sorted;
use super::lattice::MortonLattice;
use super::patch::{ChunkEdits, SHARE};
use super::stretches::RankStretches;
use super::{RECORD_BYTES, at_once, cuts_in_stretches};
use crate::instancing::assembly::InstanceTarget;
use crate::instancing::assembly::{Assembly, AssemblyMember};
use crate::instancing::instance_primvars::{MemberPrimvar, value_bytes};
use crate::instancing::item::PlacementItem;
use crate::mesh::Aabb;

/// Where no more than one chunk in so many changes, threads take several at once.
const SPARSE: usize = 8;
/// Number of items that a task puts on the lattice.
const PLACED: usize = 1 << 12;

/// The partition of one opened assembly.
#[derive(Debug, Default)]
pub(crate) struct AssemblyPart {
    lattice: Option<MortonLattice>,
    /// Members with records in chunks, in order.
    members: Vec<KnownMember>,
    /// Chunks in Morton order.
    pub(crate) chunks: Vec<Arc<Chunk>>,
    next_id: u32,
    /// The rule that they were cut by.
    rule: Option<CutRule>,
}

/// A member and its lasting id.
#[derive(Clone, Debug)]
struct KnownMember {
    id: u32,
    /// Its number in the assembly.
    number: u32,
    member: AssemblyMember,
}

/// The effect of an update on a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ChunkUpdate {
    /// The chunk is kept.
    Keep,
    /// The chunk is copied with new values.
    Revalue,
    /// The chunk is copied with the edits.
    Patch,
    /// The chunk is dissolved, and all of its records are sorted anew.
    Melt,
}

/// A chunk after an update.
#[derive(Debug)]
enum UpdatedChunk {
    /// The chunk stays in its place, with the same records up to values.
    Kept(Arc<Chunk>),
    Patched(Arc<Chunk>),
    Melted(Vec<PlacementItem>),
}

/// The inputs of a partition.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PartitionJob<'a> {
    pub(crate) assembly: &'a Arc<Assembly>,
    pub(crate) costs: &'a Arc<AssetCosts>,
    pub(crate) chunk_bytes: u64,
    /// By assembly: true if it is opened.
    pub(crate) opened: &'a [bool],
    /// Bytes of items held at once.
    pub(crate) item_bytes: u64,
    /// Buckets that the scans of this commit used.
    pub(crate) buckets: Option<&'a OrderBuckets>,
    /// True if chunks whose records move are held.
    pub(crate) holds: bool,
}

impl<'a> PartitionJob<'a> {
    /// Members with records in chunks, with their numbers.
    pub(crate) fn inside(&self) -> impl Iterator<Item = (u32, &'a AssemblyMember)> {
        let opened = self.opened;
        let is_opened =
            move |t: InstanceTarget| matches!(t, InstanceTarget::Assembly(a) if opened.get(a as usize) == Some(&true));
        (0..).zip(self.assembly.members()).filter(move |(_, m)| m.run.len() > 0 && !is_opened(m.target))
    }

    /// The lattice of these members.
    pub(crate) fn lattice(&self) -> MortonLattice {
        MortonLattice::around(&self.inside().fold(Aabb::EMPTY, |b, (_, m)| b.union(&m.run.bounds())))
    }

    /// The rule by which cells are cut.
    pub(crate) fn rule(&self) -> CutRule {
        let mut totals: FxHashMap<InstanceTarget, u64> = FxHashMap::default();
        self.inside().for_each(|(_, m)| *totals.entry(m.target).or_default() += m.run.len() as u64);
        let record_bytes = RECORD_BYTES + value_bytes(self.assembly.columns());
        CutRule { costs: Arc::clone(self.costs), chunk_bytes: self.chunk_bytes, record_bytes, totals }
    }
}

impl AssemblyPart {
    /// Returns true if its chunks were cut for this size.
    pub(super) fn is_cut_for(&self, chunk_bytes: u64) -> bool {
        self.rule.as_ref().is_some_and(|rule| rule.chunk_bytes == chunk_bytes)
    }

    /// Lasting ids and members of the last partition, in order.
    pub(super) fn known_members(&self) -> impl ExactSizeIterator<Item = (u32, &AssemblyMember)> {
        self.members.iter().map(|known| (known.id, &known.member))
    }

    /// Brings the partition up to date; `held`: its chunks, where it is known that all are held. New ones have key 0.
    pub(crate) fn update(&mut self, job: PartitionJob<'_>, held: Option<Vec<Arc<Chunk>>>) {
        if let Some(chunks) = held.or_else(|| self.hold(job)) {
            self.chunks = chunks;
            let members = self.members.iter_mut().zip(job.inside());
            members.for_each(|(known, (number, member))| (known.number, known.member) = (number, member.clone()));
            return;
        }
        let lattice = job.lattice();
        if self.lattice != Some(lattice) || self.next_id > u32::MAX / 2 {
            *self = Self { lattice: Some(lattice), ..Self::default() };
        }
        let changes = self.changes(job);
        let rule = job.rule();
        let roster =
            AssemblyMembers { assembly: job.assembly, ids: &changes.ids, keeps_frame: job.assembly.is_split_mesh() };
        let is_known = self.rule.as_ref() == Some(&rule);
        let cutter = ChunkCutter { rule: &rule, roster, lattice: &lattice, member_of: &changes.member_of, is_known };
        let chunks =
            self.cut_anew(&cutter, &changes, job).unwrap_or_else(|| self.cut_again(&cutter, &changes, job.item_bytes));
        let known = job.inside().map(|(number, member)| KnownMember {
            id: changes.ids.get(number as usize).copied().unwrap_or(u32::MAX),
            number,
            member: member.clone(),
        });
        self.members = known.collect();
        self.chunks = chunks;
        self.next_id = changes.next_id;
        self.rule = Some(rule);
    }

    /// All chunks, cut in stretches, if there are too many new items to hold them at once.
    fn cut_anew(
        &self,
        cutter: &ChunkCutter<'_>,
        changes: &MemberChanges,
        job: PartitionJob<'_>,
    ) -> Option<Vec<Arc<Chunk>>> {
        let members: Vec<(u32, &AssemblyMember)> = job.inside().collect();
        let records: u64 = members.iter().map(|(_, member)| member.run.len() as u64).sum();
        // A cell with more items is always cut.
        let most = at_once(job.item_bytes, records).max(cutter.rule.most_records());
        let held: u64 = self.chunks.iter().filter(|chunk| chunk.is_held()).map(|chunk| chunk.len() as u64).sum();
        if !cuts_in_stretches(changes.fresh(job.assembly.members()) + held, records, most) {
            return None;
        }
        let known = job.buckets.filter(|buckets| buckets.lattice() == *cutter.lattice);
        let made;
        let buckets = if let Some(known) = known {
            known
        } else {
            let stride = OrderBuckets::stride(records);
            let samples: Vec<_> = members.par_iter().flat_map_iter(|(_, m)| m.run.spec().samples(stride)).collect();
            made = OrderBuckets::on(*cutter.lattice, &samples, records, most);
            &made
        };
        let chunks = RankStretches { cutter, buckets, most }.cut(&members, known.is_none());
        Some(self.with_known(chunks, changes, cutter.roster.assembly))
    }

    /// The chunks, with earlier ones in place of new ones that are the same.
    fn with_known(
        &self,
        mut chunks: Vec<Arc<Chunk>>,
        changes: &MemberChanges,
        assembly: &Arc<Assembly>,
    ) -> Vec<Arc<Chunk>> {
        let name = |chunk: &Chunk| (chunk.codes, chunk.ids.first().copied(), chunk.ranks.first().copied());
        let cut = self.chunks.iter().filter(|chunk| !chunk.is_held());
        let old: FxHashMap<_, &Arc<Chunk>> = cut.map(|chunk| (name(chunk), chunk)).collect();
        let edited = changes.edited_ranks();
        chunks.par_iter_mut().for_each(|chunk| {
            let known = old.get(&name(chunk)).filter(|old| old.has_places_of(chunk));
            if let Some(known) = known.filter(|old| !changes.revalues(old) && !changes.edits(&edited, old)) {
                rebind(known, changes, assembly);
                *chunk = Arc::clone(known);
            }
        });
        chunks
    }

    /// Chunks made from the earlier ones, with all new items sorted at once.
    fn cut_again(&self, cutter: &ChunkCutter<'_>, changes: &MemberChanges, item_bytes: u64) -> Vec<Arc<Chunk>> {
        let (roster, lattice) = (cutter.roster, cutter.lattice);
        // Held chunks are dissolved, wherever their records are by now.
        let (held, chunks): (Vec<_>, Vec<_>) = self.chunks.iter().cloned().partition(|chunk| chunk.is_held());
        let mut new = new_items(roster.assembly.members(), changes, lattice);
        let places = OnceLock::new();
        let melt = |chunk: &Chunk| {
            let changed: &FxHashSet<_> = places.get_or_init(|| changes.places());
            let mut items = cutter.melt(chunk);
            items.retain(|i| !changed.contains(&(i.member(), i.rank())));
            items
        };
        new.par_extend(held.par_iter().map(|chunk| melt(chunk)));
        let gained = sorted(new, item_bytes);
        let lost = self.lost_items(changes, lattice);
        let edits = ChunkEdits::of_chunks(&chunks, &lost, &gained);
        let fates = fates(&chunks, changes, &edits);
        // Chunks that are kept cost next to nothing: of many, a task takes several.
        let is_sparse = fates.iter().filter(|fate| **fate != ChunkUpdate::Keep).count() * SPARSE < fates.len();
        let done: Vec<UpdatedChunk> = (&chunks, &edits, &fates)
            .into_par_iter()
            .with_max_len(if is_sparse { usize::MAX } else { 1 })
            .map(|(chunk, edits, fate)| match fate {
                ChunkUpdate::Keep => {
                    rebind(chunk, changes, roster.assembly);
                    UpdatedChunk::Kept(chunk.clone())
                }
                ChunkUpdate::Revalue => UpdatedChunk::Kept(Arc::new(cutter.revalued(chunk))),
                ChunkUpdate::Patch => {
                    let lost = lost.get(edits.lost.clone()).unwrap_or_default();
                    let gained = gained.get(edits.gained.clone()).unwrap_or_default();
                    let patched = cutter.patch(chunk, lost, gained);
                    patched.map_or_else(
                        || UpdatedChunk::Melted(melt(chunk)),
                        |chunk| UpdatedChunk::Patched(Arc::new(chunk)),
                    )
                }
                ChunkUpdate::Melt => UpdatedChunk::Melted(melt(chunk)),
            })
            .collect();
        let items = loose(gained, &edits, &done);
        // What is left of a cell from which a whole chunk is gone may be fewer chunks than before.
        let lost_none = held.is_empty() && done.iter().all(UpdatedChunk::is_there);
        let cutter = ChunkCutter { is_known: cutter.is_known && lost_none, ..*cutter };
        cutter.cut(&pieces(done.iter().filter_map(UpdatedChunk::chunk), &items))
    }

    /// The removed records as they were, with lasting ids in place of members; sorted. Records of removed members are
    /// left out if they are many.
    fn lost_items(&self, changes: &MemberChanges, lattice: &MortonLattice) -> Vec<PlacementItem> {
        let mut lost: Vec<PlacementItem> = Vec::new();
        let mut add = |known: &KnownMember, ranks: &[u32]| {
            let reader = known.member.run.reader(None);
            lost.par_extend(ranks.par_iter().filter_map(|&rank| {
                let mut item = reader.item(rank)?;
                lattice.place(&mut item, known.id);
                Some(item)
            }));
        };
        for (_, at, ranks) in &changes.edited {
            self.members.get(*at).into_iter().for_each(|known| add(known, ranks));
        }
        if changes.takes_gone_records {
            let gone = self.members.iter().filter(|known| !changes.member_of.contains_key(&known.id));
            gone.for_each(|known| add(known, &(0..known.member.run.ranks()).collect::<Vec<u32>>()));
        }
        lost.par_sort_unstable_by_key(PlacementItem::key);
        lost
    }

    /// Compares the members with those of the last partition; both are in the order of paths and slots.
    fn changes(&self, job: PartitionJob<'_>) -> MemberChanges {
        let mut changes = MemberChanges {
            ids: vec![u32::MAX; job.assembly.members().len()],
            next_id: self.next_id,
            ..MemberChanges::default()
        };
        let mut old = self.members.iter().enumerate().peekable();
        for (number, member) in job.inside() {
            while old.next_if(|(_, known)| known.member.name() < member.name()).is_some() {}
            let known = old.next_if(|(_, known)| known.member.name() == member.name());
            let edit = known.and_then(|(_, known)| known.member.edit_to(member));
            let id = match (known, edit) {
                (Some((at, known)), Some(edited)) => {
                    changes.is_renumbered |= known.number != number;
                    if !MemberPrimvar::are_same(&known.member.primvars, &member.primvars) {
                        let numbers = MemberPrimvar::changes(&known.member.primvars, &member.primvars);
                        changes.revalued.insert(known.id, numbers);
                    }
                    if let Some(ranks) = edited {
                        changes.edited.push((number, at, ranks));
                    }
                    known.id
                }
                _ => {
                    changes.added.push(number);
                    changes.next_id += 1;
                    changes.next_id - 1
                }
            };
            if let Some(slot) = changes.ids.get_mut(number as usize) {
                *slot = id;
            }
            changes.member_of.insert(id, number);
        }
        let gone = self.members.iter().filter(|known| !changes.member_of.contains_key(&known.id));
        let gone: usize = gone.map(|known| known.member.run.len()).sum();
        changes.takes_gone_records = gone * SHARE <= self.chunks.iter().map(|chunk| chunk.len()).sum();
        changes
    }
}

impl UpdatedChunk {
    /// Whether some of its records are where they were.
    fn is_there(&self) -> bool {
        !matches!(self, Self::Melted(items) if items.is_empty())
    }

    fn chunk(&self) -> Option<&Arc<Chunk>> {
        match self {
            Self::Kept(chunk) | Self::Patched(chunk) => Some(chunk),
            Self::Melted(_) => None,
        }
    }
}

/// The update of each chunk. Chunks of equal codes have the same update.
fn fates(chunks: &[Arc<Chunk>], changes: &MemberChanges, edits: &[ChunkEdits]) -> Vec<ChunkUpdate> {
    let is_gone = |id: &u32| !changes.member_of.contains_key(id);
    let fate = |(chunk, edits): (&Arc<Chunk>, &ChunkEdits)| match edits.len() {
        _ if !changes.takes_gone_records && chunk.ids.iter().any(is_gone) => ChunkUpdate::Melt,
        0 if changes.revalues(chunk) => ChunkUpdate::Revalue,
        0 => ChunkUpdate::Keep,
        _ if edits.are_few(chunk) => ChunkUpdate::Patch,
        _ => ChunkUpdate::Melt,
    };
    let mut fates: Vec<ChunkUpdate> = chunks.par_iter().zip(edits).map(fate).collect();
    let mut start = 0;
    for stretch in chunks.chunk_by(|a, b| a.codes[1] == b.codes[0]) {
        let part = fates.get_mut(start..start + stretch.len()).unwrap_or_default();
        if part.len() > 1 && part.iter().any(|fate| matches!(fate, ChunkUpdate::Patch | ChunkUpdate::Melt)) {
            part.fill(ChunkUpdate::Melt);
        }
        start += stretch.len();
    }
    fates
}

/// Sorted items that are in no chunk: those of dissolved chunks, and gained items that are in no patched chunk.
fn loose(gained: Vec<PlacementItem>, edits: &[ChunkEdits], done: &[UpdatedChunk]) -> Vec<PlacementItem> {
    let adds_none = |done: &UpdatedChunk| match done {
        UpdatedChunk::Kept(_) => true,
        UpdatedChunk::Patched(_) => false,
        UpdatedChunk::Melted(items) => items.is_empty(),
    };
    if done.iter().all(adds_none) {
        return gained;
    }
    let mut items: Vec<PlacementItem> = Vec::new();
    let mut at = 0;
    for (edits, done) in edits.iter().zip(done) {
        match done {
            UpdatedChunk::Kept(_) => {}
            UpdatedChunk::Patched(_) => {
                items.extend_from_slice(gained.get(at..edits.gained.start).unwrap_or_default());
                at = edits.gained.end;
            }
            UpdatedChunk::Melted(melted) => items.extend_from_slice(melted),
        }
    }
    items.extend_from_slice(gained.get(at..).unwrap_or_default());
    items.par_sort_unstable_by_key(PlacementItem::key);
    items
}

/// The items of added members and of edited records, in unsorted parts.
fn new_items(members: &[AssemblyMember], changes: &MemberChanges, lattice: &MortonLattice) -> Vec<Vec<PlacementItem>> {
    let of = |number: u32| members.get(number as usize);
    let (single, many): (Vec<u32>, Vec<u32>) =
        changes.added.iter().partition(|&&number| of(number).is_none_or(|m| m.run.len() == 1));
    let mut items: Vec<PlacementItem> = Vec::new();
    items.par_extend(single.par_iter().filter_map(|&number| {
        let reader = of(number)?.run.reader(None);
        let mut item = reader.first_item()?;
        lattice.place(&mut item, number);
        Some(item)
    }));
    for (number, _, ranks) in &changes.edited {
        let Some(member) = of(*number) else { continue };
        let reader = member.run.reader(None);
        items.par_extend(ranks.par_iter().filter_map(|&rank| {
            let mut item = reader.item(rank)?;
            lattice.place(&mut item, *number);
            Some(item)
        }));
    }
    let mut parts: Vec<(u32, Vec<PlacementItem>)> =
        many.iter().filter_map(|&number| Some((number, of(number)?.run.take_items()))).collect();
    let stretches = parts.par_iter_mut().flat_map(|(number, part)| {
        let number = *number;
        part.par_chunks_mut(PLACED).map(move |stretch| (number, stretch))
    });
    stretches.for_each(|(number, stretch)| stretch.iter_mut().for_each(|item| lattice.place(item, number)));
    parts.into_iter().map(|(_, part)| part).chain([items]).filter(|part| !part.is_empty()).collect()
}

/// Makes a kept chunk read the present arrays, so that old ones can be freed. It changes no record.
fn rebind(chunk: &Chunk, changes: &MemberChanges, assembly: &Arc<Assembly>) {
    let members = chunk.members();
    if members.is_in(assembly) {
        return;
    }
    chunk.set_members(if changes.is_renumbered {
        ChunkMembers::new(assembly, chunk.ids.iter().filter_map(|id| changes.member_of.get(id).copied()).collect())
    } else {
        members.in_assembly(assembly)
    });
}

/// Kept chunks and sorted items between them, in order.
fn pieces<'a>(kept: impl Iterator<Item = &'a Arc<Chunk>>, mut items: &'a [PlacementItem]) -> Vec<OrderPiece<'a>> {
    let mut pieces = Vec::new();
    for chunk in kept {
        let (before, after) = items.split_at(items.partition_point(|item| item.code() < chunk.codes[0]));
        if !before.is_empty() {
            pieces.push(OrderPiece::Loose(before));
        }
        pieces.push(OrderPiece::Kept(chunk));
        items = after;
    }
    if !items.is_empty() {
        pieces.push(OrderPiece::Loose(items));
    }
    pieces
}
