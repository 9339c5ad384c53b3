// SPDX-License-Identifier: Apache-2.0
//! Scans measure every instance of a run once: they compute its box, find unusable instances, and keep what the
//! partition asked for.

use std::sync::{Arc, PoisonError};

use glam::DVec3;
use rayon::prelude::*;

use super::{InstanceNumbers, InstanceRun, PrototypeInstances, RunSpec};
use crate::array::{ArrayView, ElementType, TypedArray};
use crate::desc::DroppedData;
use crate::instancing::affine::{round_down, round_up};
use crate::instancing::item::PlacementItem;
use crate::instancing::placement::{InstanceFootprint, InstancePlacer};
use crate::mesh::Aabb;

/// Number of instances scanned by one task: a whole number of blocks.
pub(super) const TASK: usize = 1 << 14;
/// Number of instances with one box, so that a few edits do not make all others be placed again.
pub(super) const BLOCK: usize = 1 << 10;
/// Runs of fewer instances are sampled completely.
const FEW: usize = 64;

/// The assignment of items to the buckets of their assembly's order.
pub(crate) trait ItemBucketing: std::fmt::Debug + Sync {
    /// A number below [`UNUSABLE`] for an item that is not on a lattice yet.
    fn bucket(&self, item: PlacementItem) -> u8;
}

/// Stands in place of a bucket if the rank is not usable.
pub(crate) const UNUSABLE: u8 = u8::MAX;

/// The results that a scan keeps.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ScanOutput<'a> {
    /// It keeps nothing.
    Nothing,
    /// It keeps the items, 24 bytes each.
    Items,
    /// It keeps the bucket of each rank, a byte.
    Buckets(&'a dyn ItemBucketing),
}

/// The results of a scan, until they are taken.
#[derive(Debug, Default)]
pub(super) enum ScannedRanks {
    #[default]
    Nothing,
    /// Items of all usable ranks.
    Items(Vec<PlacementItem>),
    /// Buckets of all ranks.
    Buckets(Vec<u8>),
}

/// The part of the results that a task of a scan writes, beginning at its first rank.
pub(super) enum ScanSlots<'a> {
    Nothing,
    Items(&'a mut [PlacementItem]),
    Buckets(&'a mut [u8], &'a dyn ItemBucketing),
}

/// The result of scanning consecutive ranks.
#[derive(Default)]
pub(super) struct RankScan {
    pub(super) blocks: Vec<Aabb>,
    pub(super) bad: Vec<u32>,
    pub(super) out_of_range: u64,
    pub(super) stuck: u64,
}

impl ScanSlots<'_> {
    #[inline]
    fn put(&mut self, at: usize, footprint: &InstanceFootprint, rank: u32) {
        match self {
            Self::Nothing => {}
            Self::Items(items) => {
                if let Some(slot) = items.get_mut(at) {
                    *slot = PlacementItem::new(footprint, rank);
                }
            }
            Self::Buckets(buckets, by) => {
                if let Some(slot) = buckets.get_mut(at) {
                    *slot = by.bucket(PlacementItem::new(footprint, rank));
                }
            }
        }
    }
}

impl RunSpec {
    /// Largest number of placements that an instancer makes; 1 without an instancer.
    pub(crate) fn most_ranks(&self) -> u64 {
        self.instances.as_ref().map_or(1, |instances| instances.len() as u64)
    }

    /// Boxes and items of every `stride`-th instance, or of all if they are few, ignoring masks.
    pub(crate) fn samples(&self, stride: usize) -> Vec<(Aabb, PlacementItem)> {
        if self.target_bounds.is_empty() {
            return Vec::new();
        }
        let placer = self.placer();
        let sample = |number: Option<usize>| {
            let ([min, max], footprint) = placer.measure(number)?;
            let bounds = Aabb { min: min.to_array().map(round_down), max: max.to_array().map(round_up) };
            Some((bounds, PlacementItem::new(&footprint, 0)))
        };
        let Some(instances) = &self.instances else { return sample(None).into_iter().collect() };
        let (indices, count) = (instances.indices.view(), instances.len());
        let limit = instances.arrays.len();
        let stride = if count <= FEW { 1 } else { stride.max(1) };
        let place = |k: usize| instances.chosen.as_ref().map_or(Some(k), |chosen| chosen.get(k).map(|&k| k as usize));
        let number = |k: usize| indices.index(place(k)?).and_then(|n| usize::try_from(n).ok()).filter(|&n| n < limit);
        (stride / 2..count).step_by(stride).filter_map(|k| sample(Some(number(k)?))).collect()
    }
}

impl InstanceRun {
    pub(super) fn scan_instances(&mut self, instances: &PrototypeInstances, keep: ScanOutput<'_>) {
        let indices = instances.indices.view();
        if !indices.is_empty() && indices.element() != ElementType::I32 {
            self.dropped.wrong_array_types += 1;
            return;
        }
        let mask = instances.arrays.mask.as_ref().map(TypedArray::view);
        if let Some(chosen) = &instances.chosen {
            let (numbers, among_all, count) = choose(&indices, mask.as_ref(), chosen, &mut self.dropped);
            self.unmasked = Some(Arc::new(numbers));
            self.among_all = Some((Arc::new(among_all), count));
        } else if let Some(mask) = &mask {
            self.unmasked = apply_mask(&indices, mask, &mut self.dropped).map(Arc::new);
        }
        let ranks = self.unmasked.as_ref().map_or(indices.len(), |n| n.len());
        let Ok(count) = u32::try_from(ranks) else {
            // More ranks than the 32 bits of an instance number can distinguish.
            self.dropped.instance_indices += ranks as u64;
            return;
        };
        self.ranks = count;
        let (mut items, mut buckets) = (Vec::new(), Vec::new());
        let scans = match keep {
            ScanOutput::Nothing => {
                self.scan_tasks((0..ranks.div_ceil(TASK)).into_par_iter().map(|_| ScanSlots::Nothing))
            }
            ScanOutput::Items => {
                items = bytemuck::zeroed_vec(ranks);
                self.scan_tasks(items.par_chunks_mut(TASK).map(ScanSlots::Items))
            }
            ScanOutput::Buckets(by) => {
                buckets = vec![UNUSABLE; ranks];
                self.scan_tasks(buckets.par_chunks_mut(TASK).map(|buckets| ScanSlots::Buckets(buckets, by)))
            }
        };
        self.bad = scans.iter().flat_map(|s| s.bad.iter().copied()).collect();
        let out_of_range: u64 = scans.iter().map(|s| s.out_of_range).sum();
        self.dropped.instance_motions += scans.iter().map(|s| s.stuck).sum::<u64>();
        self.blocks = scans.into_iter().flat_map(|s| s.blocks).collect();
        self.bounds = self.blocks.iter().fold(Aabb::EMPTY, |a, b| a.union(b));
        self.dropped.instance_indices += out_of_range;
        self.dropped.instance_transforms += self.bad.len() as u64 - out_of_range;
        let kept = match keep {
            ScanOutput::Nothing => ScannedRanks::Nothing,
            ScanOutput::Items => ScannedRanks::Items(self.usable(items)),
            ScanOutput::Buckets(_) => ScannedRanks::Buckets(buckets),
        };
        self.kept = kept.into();
    }

    /// Items of all ranks without those of bad ones.
    fn usable(&self, mut items: Vec<PlacementItem>) -> Vec<PlacementItem> {
        let mut at = 0_u32;
        let mut bad = self.bad.iter().copied().peekable();
        if bad.peek().is_some() {
            items.retain(|_| {
                at += 1;
                bad.next_if_eq(&(at - 1)).is_none()
            });
        }
        items
    }

    /// Scans all ranks in parallel; each task has slots for [`TASK`] ranks.
    fn scan_tasks<'a>(&self, slots: impl IndexedParallelIterator<Item = ScanSlots<'a>>) -> Vec<RankScan> {
        let ranks = self.ranks as usize;
        let numbers = self.numbers();
        let placer = self.spec.placer();
        let task = |(task, mut slots): (usize, ScanSlots<'a>)| {
            let first = task * TASK;
            let mut scan = RankScan::default();
            for start in (first..(first + TASK).min(ranks)).step_by(BLOCK) {
                scan.add_block(&numbers, &placer, start..(start + BLOCK).min(ranks), (first, &mut slots));
            }
            scan
        };
        slots.enumerate().map(task).collect()
    }

    /// The items of all usable ranks, in order: those kept by the scan, else measured now.
    pub(crate) fn take_items(&self) -> Vec<PlacementItem> {
        let kept = std::mem::take(&mut *self.kept.lock().unwrap_or_else(PoisonError::into_inner));
        if let ScannedRanks::Items(items) = kept {
            return items;
        }
        let reader = self.reader(None);
        (0..self.ranks).into_par_iter().with_min_len(BLOCK).filter_map(|rank| reader.item(rank)).collect()
    }

    /// Keeps the items of all usable ranks again.
    pub(crate) fn keep_items(&self, items: Vec<PlacementItem>) {
        *self.kept.lock().unwrap_or_else(PoisonError::into_inner) = ScannedRanks::Items(items);
    }

    /// The bucket of each rank: as kept by the scan, or computed now if it kept none or `anew` is set.
    pub(crate) fn take_buckets(&self, by: &dyn ItemBucketing, anew: bool) -> Vec<u8> {
        let kept = std::mem::take(&mut *self.kept.lock().unwrap_or_else(PoisonError::into_inner));
        if let ScannedRanks::Buckets(buckets) = kept
            && !anew
        {
            return buckets;
        }
        let reader = self.reader(None);
        let bucket = |rank| reader.item(rank).map_or(UNUSABLE, |item| by.bucket(item));
        (0..self.ranks).into_par_iter().with_min_len(BLOCK).map(bucket).collect()
    }

    /// Frees the results that were not taken.
    pub(crate) fn drop_kept(&self) {
        *self.kept.lock().unwrap_or_else(PoisonError::into_inner) = ScannedRanks::Nothing;
    }
}

impl RankScan {
    /// Scans consecutive ranks. `slots` begin at the given rank.
    pub(super) fn add_block(
        &mut self,
        numbers: &InstanceNumbers<'_>,
        placer: &InstancePlacer<'_>,
        ranks: std::ops::Range<usize>,
        (first, slots): (usize, &mut ScanSlots<'_>),
    ) {
        // Rounding outward keeps the order: done once for all.
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for at in ranks {
            let Ok(rank) = u32::try_from(at) else { return };
            let number = numbers.of(rank);
            match number.and_then(|n| placer.measure(n)) {
                Some(([low, high], footprint)) => {
                    self.stuck += number.map_or(0, |n| u64::from(placer.is_stuck(n)));
                    (min, max) = (min.min(low), max.max(high));
                    slots.put(at - first, &footprint, rank);
                }
                None => {
                    self.out_of_range += u64::from(number.is_none());
                    self.bad.push(rank);
                }
            }
        }
        self.blocks.push(Aabb { min: min.to_array().map(round_down), max: max.to_array().map(round_up) });
    }
}

/// The instance numbers that the mask leaves, or `None` if it hides none. Numbers beyond the mask are shown; negative
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

/// The numbers of the chosen instances that the mask leaves, their ranks among all that it leaves, and the number of
/// these. Numbers are kept as by [`apply_mask`].
fn choose(
    indices: &ArrayView<'_>,
    mask: Option<&ArrayView<'_>>,
    chosen: &[u32],
    dropped: &mut DroppedData,
) -> (Vec<u32>, Vec<u32>, u32) {
    let (mut numbers, mut among_all) = (Vec::with_capacity(chosen.len()), Vec::with_capacity(chosen.len()));
    let (mut next, mut left, mut beyond) = (chosen.iter().copied().peekable(), 0_u32, false);
    for (place, number) in (0..indices.len()).filter_map(|place| Some((place, indices.index(place)?))) {
        let is_chosen = next.next_if(|&chosen| chosen as usize == place).is_some();
        let shown = mask.is_none_or(|mask| {
            let entry = usize::try_from(number).ok().and_then(|number| mask.boolean(number));
            beyond |= entry.is_none() && is_chosen;
            entry.unwrap_or(true)
        });
        if shown && is_chosen {
            numbers.push(number.cast_unsigned());
            among_all.push(left);
        }
        left = left.saturating_add(u32::from(shown));
    }
    dropped.short_masks += u64::from(beyond);
    (numbers, among_all, left)
}
