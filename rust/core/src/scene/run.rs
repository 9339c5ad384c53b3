// SPDX-License-Identifier: Apache-2.0
//! Runs: the placements that one prim contributes to an assembly. A run knows which of its instances are shown and
//! usable; their matrices stay in the borrowed arrays. Immutable once scanned.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::placement::{InstanceArrays, Placed, Placer};
use super::report::DroppedData;
use crate::array::{ArrayView, ElementType, TypedArray};
use crate::mesh::Aabb;
use crate::partition::Item;

/// Instances scanned by one task: a whole number of blocks.
const TASK: usize = 1 << 14;
/// Instances whose box is kept, so that a few edits do not make all others be placed again.
const BLOCK: usize = 1 << 10;

/// The instances of one prototype.
#[derive(Clone, Debug)]
pub(crate) struct Instances {
    /// Where they are.
    pub(crate) arrays: Arc<InstanceArrays>,
    /// Which of them show this prototype.
    pub(crate) indices: TypedArray,
}

/// What determines a run.
#[derive(Clone, Debug)]
pub(crate) struct RunSpec {
    /// Assembly frame from the prim's frame.
    pub(crate) before: DAffine3,
    /// Instance frame from the target's frame.
    pub(crate) after: DAffine3,
    /// `None`: placed once.
    pub(crate) instances: Option<Instances>,
    /// Box of the target, not empty.
    pub(crate) target_bounds: Aabb,
}

impl RunSpec {
    /// True when both give the same run, told without looking at elements.
    fn is_same(&self, other: &Self) -> bool {
        let instances = match (&self.instances, &other.instances) {
            (None, None) => true,
            (Some(a), Some(b)) => {
                Arc::ptr_eq(&a.arrays, &b.arrays)
                    && a.indices.identity() == b.indices.identity()
                    && a.indices.element() == b.indices.element()
            }
            _ => false,
        };
        instances
            && self.before == other.before
            && self.after == other.after
            && self.target_bounds == other.target_bounds
    }

    fn placer(&self) -> Placer<'_> {
        let arrays = self.instances.as_ref().map(|i| &*i.arrays);
        Placer::new(self.before, self.after, arrays, &self.target_bounds)
    }
}

/// A scanned run.
#[derive(Debug)]
pub(crate) struct Run {
    spec: RunSpec,
    /// Instance numbers left by the mask, by rank; `None` = all indices.
    unmasked: Option<Arc<Vec<u32>>>,
    /// Ranks that are not usable, in order.
    bad: Vec<u32>,
    /// Number of ranks: instances left by the mask.
    ranks: u32,
    /// Box of each stretch of [`BLOCK`] ranks.
    blocks: Vec<Aabb>,
    bounds: Aabb,
    dropped: DroppedData,
    /// The run that this one was made from, and the ranks that may differ from it.
    edits: Option<(Weak<Run>, Arc<Vec<u32>>)>,
    /// Items of all usable ranks, if the scan was asked for them and nobody took them yet.
    items: Mutex<Option<Vec<Item>>>,
}

/// What a stretch of ranks gives.
#[derive(Default)]
struct Scan {
    blocks: Vec<Aabb>,
    bad: Vec<u32>,
    out_of_range: u64,
}

impl Run {
    /// `old` again if it is of the same spec, else a new run. `collect`: keep what the partition will ask for.
    pub(crate) fn reuse_or_scan(old: Option<&Arc<Self>>, spec: RunSpec, collect: bool) -> Arc<Self> {
        match old {
            Some(old) if old.spec.is_same(&spec) => old.clone(),
            Some(old) => Arc::new(Self::edited(old, &spec).unwrap_or_else(|| Self::scan(spec, collect))),
            None => Arc::new(Self::scan(spec, collect)),
        }
    }

    fn scan(spec: RunSpec, collect: bool) -> Self {
        let mut run = Self {
            spec,
            unmasked: None,
            bad: Vec::new(),
            ranks: 0,
            blocks: Vec::new(),
            bounds: Aabb::EMPTY,
            dropped: DroppedData::default(),
            edits: None,
            items: Mutex::new(None),
        };
        if run.spec.target_bounds.is_empty() {
            // Nothing was left of the target: nothing to place, and nothing bad here.
            return run;
        }
        match run.spec.instances.clone() {
            Some(instances) => run.scan_instances(&instances, collect),
            None => {
                run.ranks = 1;
                match run.spec.placer().place(None) {
                    Some(placed) => run.bounds = placed.bounds,
                    None => {
                        run.bad.push(0);
                        run.dropped.prim_transforms += 1;
                    }
                }
            }
        }
        run
    }

    /// The run of `spec` made from `old` by looking at changed instances only; `None` when that is not possible or not
    /// worth it.
    fn edited(old: &Arc<Self>, spec: &RunSpec) -> Option<Self> {
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

    fn scan_instances(&mut self, instances: &Instances, collect: bool) {
        let indices = instances.indices.view();
        if !indices.is_empty() && indices.element() != ElementType::I32 {
            self.dropped.wrong_array_types += 1;
            return;
        }
        if let Some(mask) = &instances.arrays.mask {
            self.unmasked = apply_mask(&indices, &mask.view(), &mut self.dropped).map(Arc::new);
        }
        let ranks = self.unmasked.as_ref().map_or(indices.len(), |n| n.len());
        let Ok(count) = u32::try_from(ranks) else {
            // More than the 32 bits of an instance number can tell apart.
            self.dropped.instance_indices += ranks as u64;
            return;
        };
        self.ranks = count;
        let mut items: Vec<Item> = if collect { bytemuck::zeroed_vec(ranks) } else { Vec::new() };
        let scans = self.scan_tasks(&mut items);
        self.bad = scans.iter().flat_map(|s| s.bad.iter().copied()).collect();
        let out_of_range: u64 = scans.iter().map(|s| s.out_of_range).sum();
        self.blocks = scans.into_iter().flat_map(|s| s.blocks).collect();
        self.bounds = self.blocks.iter().fold(Aabb::EMPTY, |a, b| a.union(b));
        self.dropped.instance_indices += out_of_range;
        self.dropped.instance_transforms += self.bad.len() as u64 - out_of_range;
        if collect {
            let mut at = 0_u32;
            let mut bad = self.bad.iter().copied().peekable();
            if bad.peek().is_some() {
                items.retain(|_| {
                    at += 1;
                    bad.next_if_eq(&(at - 1)).is_none()
                });
            }
            self.items = Mutex::new(Some(items));
        }
    }

    /// Scans all ranks in parallel; `items` is empty or has room for each.
    fn scan_tasks(&self, items: &mut [Item]) -> Vec<Scan> {
        let ranks = self.ranks as usize;
        let numbers = self.numbers();
        let placer = self.spec.placer();
        let task = |first: usize, items: &mut [Item]| {
            let mut scan = Scan::default();
            for start in (first..(first + TASK).min(ranks)).step_by(BLOCK) {
                scan.add_block(&numbers, &placer, start..(start + BLOCK).min(ranks), (first, &mut *items));
            }
            scan
        };
        if items.is_empty() {
            (0..ranks.div_ceil(TASK)).into_par_iter().map(|k| task(k * TASK, &mut [])).collect()
        } else {
            items.par_chunks_mut(TASK).enumerate().map(|(k, items)| task(k * TASK, items)).collect()
        }
    }

    fn numbers(&self) -> Numbers<'_> {
        let instances = self.spec.instances.as_ref();
        Numbers {
            unmasked: self.unmasked.as_ref().map(|n| &n[..]),
            indices: instances.map(|i| i.indices.view()),
            limit: instances.map_or(0, |i| i.arrays.len()),
        }
    }

    /// Number of usable placements.
    pub(crate) fn len(&self) -> usize {
        self.ranks as usize - self.bad.len()
    }

    /// Box of all of them.
    pub(crate) fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// What was dropped here.
    pub(crate) fn dropped(&self) -> &DroppedData {
        &self.dropped
    }

    /// True when an instancer makes the placements.
    pub(crate) fn is_instanced(&self) -> bool {
        self.spec.instances.is_some()
    }

    /// Calls `write` with the position in `places`, the rank and the placement of each of the run's placements `places`.
    /// No allocation.
    pub(crate) fn encode(&self, places: std::ops::Range<usize>, mut write: impl FnMut(usize, u32, &Placed)) {
        let placer = self.spec.placer();
        let numbers = self.numbers();
        // Bad ranks before a place: those whose own place would not be after it.
        let (mut low, mut high) = (0, self.bad.len());
        while low < high {
            let middle = usize::midpoint(low, high);
            if self.bad.get(middle).is_some_and(|&bad| bad as usize - middle <= places.start) {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        let mut bad = self.bad.get(low..).unwrap_or_default().iter().copied().peekable();
        let mut rank = places.start + low;
        for place in places.start..places.end.min(self.len()) {
            while bad.next_if(|&b| b as usize == rank).is_some() {
                rank += 1;
            }
            let Ok(this) = u32::try_from(rank) else { return };
            if let Some(placed) = numbers.of(this).and_then(|number| placer.place(number)) {
                write(place - places.start, this, &placed);
            }
            rank += 1;
        }
    }

    /// Number of ranks, for instance ids.
    pub(crate) fn ranks(&self) -> u32 {
        self.ranks
    }

    /// A reader of single placements as seen from `origin` (given in the assembly's frame).
    pub(crate) fn reader(&self, origin: Option<DVec3>) -> Reader<'_> {
        let placer = self.spec.placer();
        let placer = match origin {
            Some(origin) => placer.seen_from(origin),
            None => placer,
        };
        Reader { numbers: self.numbers(), placer, bad: &self.bad, ranks: self.ranks }
    }

    /// The items of all usable ranks, in order: those kept by the scan, else measured now.
    pub(crate) fn take_items(&self) -> Vec<Item> {
        let kept = self.items.lock().unwrap_or_else(PoisonError::into_inner).take();
        kept.unwrap_or_else(|| {
            let reader = self.reader(None);
            (0..self.ranks).into_par_iter().with_min_len(BLOCK).filter_map(|rank| reader.item(rank)).collect()
        })
    }

    /// Forgets what nobody took.
    pub(crate) fn drop_items(&self) {
        *self.items.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

impl Scan {
    /// Scans one stretch of ranks. `items` begin at the given rank, or are empty.
    fn add_block(
        &mut self,
        numbers: &Numbers<'_>,
        placer: &Placer<'_>,
        ranks: std::ops::Range<usize>,
        (first, items): (usize, &mut [Item]),
    ) {
        let mut bounds = Aabb::EMPTY;
        for at in ranks {
            let Ok(rank) = u32::try_from(at) else { return };
            let number = numbers.of(rank);
            match number.and_then(|n| placer.measure(n)) {
                Some((placed, footprint)) => {
                    bounds = bounds.union(&placed);
                    if let Some(slot) = items.get_mut(at - first) {
                        *slot = Item::new(&footprint, rank);
                    }
                }
                None => {
                    self.out_of_range += u64::from(number.is_none());
                    self.bad.push(rank);
                }
            }
        }
        self.blocks.push(bounds);
    }
}

/// Instance numbers by rank.
#[derive(Clone, Copy, Debug)]
struct Numbers<'a> {
    unmasked: Option<&'a [u32]>,
    /// `None`: placed once, without a number.
    indices: Option<ArrayView<'a>>,
    limit: usize,
}

impl Numbers<'_> {
    /// Number of a rank; `None` when it is out of range.
    #[inline]
    fn of(&self, rank: u32) -> Option<Option<usize>> {
        let Some(indices) = &self.indices else {
            return Some(None);
        };
        number(self.unmasked, indices, rank as usize).filter(|&n| n < self.limit).map(Some)
    }
}

/// Single placements of a run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reader<'a> {
    numbers: Numbers<'a>,
    placer: Placer<'a>,
    bad: &'a [u32],
    ranks: u32,
}

impl Reader<'_> {
    fn is_usable(&self, rank: u32) -> bool {
        rank < self.ranks && (self.bad.is_empty() || self.bad.binary_search(&rank).is_err())
    }

    /// What the partition needs to know of a placement; `None` when it is not usable.
    #[inline]
    pub(crate) fn item(&self, rank: u32) -> Option<Item> {
        let number = self.numbers.of(rank).filter(|_| self.is_usable(rank))?;
        self.placer.measure(number).map(|(_, footprint)| Item::new(&footprint, rank))
    }

    /// As [`Reader::item`], for the first usable rank.
    pub(crate) fn first_item(&self) -> Option<Item> {
        // The first rank that is no bad one.
        let first = (0_u32..).zip(self.bad).take_while(|(rank, bad)| rank == *bad).count();
        self.item(u32::try_from(first).ok()?)
    }

    /// The placement of a usable rank.
    #[inline]
    pub(crate) fn place(&self, rank: u32) -> Option<Placed> {
        self.numbers.of(rank).and_then(|number| self.placer.place(number))
    }

    /// Matrix of a usable rank from the target's frame, f64.
    pub(crate) fn matrix(&self, rank: u32) -> Option<DAffine3> {
        self.numbers.of(rank).and_then(|number| self.placer.matrix(number))
    }

    /// All usable placements as f64 matrices from the target's frame, with their ranks.
    pub(crate) fn matrices(&self) -> impl Iterator<Item = (u32, DAffine3)> {
        (0..self.ranks).filter(|&rank| self.is_usable(rank)).filter_map(|rank| {
            let number = self.numbers.of(rank)?;
            Some((rank, self.placer.matrix(number)?))
        })
    }
}

/// Instance number of a rank; `None` when it is negative.
#[inline]
fn number(unmasked: Option<&[u32]>, indices: &ArrayView<'_>, rank: usize) -> Option<usize> {
    match unmasked {
        Some(numbers) => numbers.get(rank).map(|&n| n as usize).filter(|&n| i32::try_from(n).is_ok()),
        None => indices.index(rank).and_then(|n| usize::try_from(n).ok()),
    }
}

/// The instance numbers that the mask leaves, or `None` when it hides none. Numbers beyond the mask are shown; negative
/// ones are kept (as bit patterns) to be counted as out of range later.
fn apply_mask(indices: &ArrayView<'_>, mask: &ArrayView<'_>, dropped: &mut DroppedData) -> Option<Vec<u32>> {
    let mut beyond = false;
    let numbers = (0..indices.len()).filter_map(|i| indices.index(i));
    let shown = |n: &i32| {
        let entry = usize::try_from(*n).ok().and_then(|n| mask.boolean(n));
        beyond |= entry.is_none();
        entry.unwrap_or(true)
    };
    let left: Vec<u32> = numbers.filter(shown).map(i32::cast_unsigned).collect();
    dropped.short_masks += u64::from(beyond);
    (left.len() != indices.len()).then_some(left)
}
