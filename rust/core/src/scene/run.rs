// SPDX-License-Identifier: Apache-2.0
//! Runs: the placements that one prim contributes to an assembly. A run knows which of its instances are shown and
//! usable; their matrices stay in the borrowed arrays. Immutable once scanned.

use std::sync::Arc;

use glam::DAffine3;
use rayon::prelude::*;

use super::placement::{InstanceArrays, Placed, Placer};
use super::report::DroppedData;
use crate::array::{ArrayView, ElementType, TypedArray};
use crate::mesh::Aabb;

/// Instances scanned by one task.
const TASK: usize = 1 << 14;

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
    unmasked: Option<Vec<u32>>,
    /// Ranks that are usable; `None` = all.
    kept: Option<Vec<u32>>,
    /// Number of ranks: instances left by the mask.
    ranks: u32,
    len: usize,
    bounds: Aabb,
    dropped: DroppedData,
}

/// What a stretch of ranks gives.
#[derive(Default)]
struct Scan {
    bounds: Option<Aabb>,
    bad: Vec<u32>,
    out_of_range: u64,
}

impl Run {
    /// `old` again if it is of the same spec, else a new run.
    pub(crate) fn reuse_or_scan(old: Option<&Arc<Self>>, spec: RunSpec) -> Arc<Self> {
        match old {
            Some(old) if old.spec.is_same(&spec) => old.clone(),
            _ => Arc::new(Self::scan(spec)),
        }
    }

    fn scan(spec: RunSpec) -> Self {
        let mut run = Self {
            spec,
            unmasked: None,
            kept: None,
            ranks: 1,
            len: 0,
            bounds: Aabb::EMPTY,
            dropped: DroppedData::default(),
        };
        if run.spec.target_bounds.is_empty() {
            // Nothing was left of the target: nothing to place, and nothing bad here.
            return run;
        }
        match run.spec.instances.clone() {
            Some(instances) => run.scan_instances(&instances),
            None => match run.spec.placer().place_single() {
                Some(placed) => (run.len, run.bounds) = (1, placed.bounds),
                None => run.dropped.prim_transforms += 1,
            },
        }
        run
    }

    fn scan_instances(&mut self, instances: &Instances) {
        let indices = instances.indices.view();
        if !indices.is_empty() && indices.element() != ElementType::I32 {
            self.dropped.wrong_array_types += 1;
            return;
        }
        if let Some(mask) = &instances.arrays.mask {
            self.unmasked = apply_mask(&indices, &mask.view(), &mut self.dropped);
        }
        let ranks = self.unmasked.as_ref().map_or(indices.len(), Vec::len);
        let Ok(count) = u32::try_from(ranks) else {
            // More than the 32 bits of an instance number can tell apart.
            self.dropped.instance_indices += ranks as u64;
            return;
        };
        self.ranks = count;
        let limit = instances.arrays.len();
        let placer = self.spec.placer();
        let unmasked = self.unmasked.as_deref();
        let tasks = (0..ranks.div_ceil(TASK)).into_par_iter();
        let scans: Vec<Scan> = tasks
            .map(|task| {
                let mut scan = Scan::default();
                for rank in task * TASK..((task + 1) * TASK).min(ranks) {
                    scan.add(rank, number(unmasked, &indices, rank).filter(|&n| n < limit), &placer);
                }
                scan
            })
            .collect();
        let bad: Vec<u32> = scans.iter().flat_map(|s| s.bad.iter().copied()).collect();
        let out_of_range: u64 = scans.iter().map(|s| s.out_of_range).sum();
        self.bounds = scans.iter().filter_map(|s| s.bounds).fold(Aabb::EMPTY, |a, b| a.union(&b));
        self.len = ranks - bad.len();
        self.dropped.instance_indices += out_of_range;
        self.dropped.instance_transforms += bad.len() as u64 - out_of_range;
        if !bad.is_empty() {
            let mut bad = bad.into_iter().peekable();
            self.kept = Some((0..count).filter(|rank| bad.next_if_eq(rank).is_none()).collect());
        }
    }

    /// Number of usable placements.
    pub(crate) fn len(&self) -> usize {
        self.len
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
        let Some(instances) = &self.spec.instances else {
            if let Some(placed) = placer.place_single().filter(|_| places.contains(&0)) {
                write(0, 0, &placed);
            }
            return;
        };
        let indices = instances.indices.view();
        for place in places.start..places.end.min(self.len) {
            let rank = match &self.kept {
                Some(kept) => kept.get(place).copied(),
                None => u32::try_from(place).ok(),
            };
            let Some(rank) = rank else { return };
            let number = number(self.unmasked.as_deref(), &indices, rank as usize);
            if let Some(placed) = number.and_then(|n| placer.place(n)) {
                write(place - places.start, rank, &placed);
            }
        }
    }

    /// Number of ranks, for instance ids.
    pub(crate) fn ranks(&self) -> u32 {
        self.ranks
    }
}

impl Scan {
    fn add(&mut self, rank: usize, number: Option<usize>, placer: &Placer<'_>) {
        match number.map(|n| placer.place(n)) {
            Some(Some(placed)) => {
                self.bounds = Some(self.bounds.map_or(placed.bounds, |b| b.union(&placed.bounds)));
            }
            unusable => {
                self.out_of_range += u64::from(unusable.is_none());
                self.bad.extend(u32::try_from(rank).ok());
            }
        }
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
