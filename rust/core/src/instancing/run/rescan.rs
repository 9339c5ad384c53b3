// SPDX-License-Identifier: Apache-2.0
//! Makes runs from older ones: if arrays change in a few elements, only those instances are measured again, and those
//! that share a block of boxes with them. The result equals that of a scan.

use std::sync::{Arc, Mutex};

use rayon::prelude::*;

use super::reader::{InstanceNumbers, number};
use super::scan::{BLOCK, RankScan, ScanSlots, TASK};
use super::{InstanceRun, PrototypeInstances, RunSpec};
use crate::instancing::arrays::InstanceArrays;
use crate::instancing::diff::ChangedNumbers;
use crate::instancing::placement::InstancePlacer;
use crate::mesh::Aabb;

impl InstanceRun {
    /// The run of `spec` made from `old` by measuring only changed instances; `None` if that is not possible or not
    /// worth it.
    pub(super) fn edited(old: &Arc<Self>, spec: &RunSpec) -> Option<Self> {
        let ranks = old.changed_ranks(spec)?;
        let mut run = Self {
            spec: spec.clone(),
            unmasked: old.unmasked.clone(),
            among_all: old.among_all.clone(),
            bad: old.bad.clone(),
            ranks: old.ranks,
            is_ascending: old.is_ascending.clone(),
            blocks: old.blocks.clone(),
            bounds: Aabb::EMPTY,
            dropped: old.dropped,
            is_measured: true,
            edits: None,
            moves: None,
            kept: Mutex::default(),
        };
        let touched: Vec<&[u32]> = ranks.chunk_by(|a, b| *a as usize / BLOCK == *b as usize / BLOCK).collect();
        let scans: Vec<(usize, RankScan)> = touched.par_iter().filter_map(|ranks| run.rescan(old, ranks)).collect();
        let (numbers, is_edited) = (run.numbers(), |rank: &u32| ranks.binary_search(rank).is_ok());
        let outside =
            |numbers: InstanceNumbers<'_>| ranks.par_iter().filter(|&&rank| numbers.of(rank).is_none()).count() as u64;
        let (was_outside, is_outside) = (outside(old.numbers()), outside(numbers));
        let mut bad: Vec<u32> = old.bad.iter().copied().filter(|rank| !is_edited(rank)).collect();
        bad.extend(scans.iter().flat_map(|(_, scan)| scan.bad.iter().copied().filter(is_edited)));
        bad.sort_unstable();
        for (block, scan) in &scans {
            if let (Some(slot), Some(bounds)) = (run.blocks.get_mut(*block), scan.blocks.first()) {
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

    /// The run of `spec`, of whose placements is only known that they are those of `old` elsewhere; `None` if more can
    /// differ than where they are and which are usable.
    pub(super) fn moved(old: &Arc<Self>, spec: &RunSpec) -> Option<Self> {
        let (before, now) = (old.spec.instances.as_ref()?, spec.instances.as_ref()?);
        // What was not usable may be so now, and is in no chunk.
        let is_elsewhere = old.ranks > 0
            && old.bad.is_empty()
            && old.key_count() == 0
            && spec.key_count() == 0
            && old.spec.target_bounds == spec.target_bounds
            && before.same_indices(now)
            && before.arrays.is_shaped_as(&now.arrays);
        is_elsewhere.then(|| Self {
            spec: spec.clone(),
            unmasked: old.unmasked.clone(),
            among_all: old.among_all.clone(),
            bad: old.bad.clone(),
            ranks: old.ranks,
            is_ascending: old.is_ascending.clone(),
            blocks: Vec::new(),
            bounds: old.bounds,
            dropped: old.dropped,
            is_measured: false,
            edits: None,
            moves: old.changed_numbers(spec).map(|changed| (Arc::downgrade(old), changed)),
            kept: Mutex::default(),
        })
    }

    /// Number and new content of the block of the given ranks, which are all of its ranks that differ from `old`. Bad
    /// ranks that are not among them may be left out.
    fn rescan(&self, old: &Self, ranks: &[u32]) -> Option<(usize, RankScan)> {
        let block = *ranks.first()? as usize / BLOCK;
        let end = ((block + 1) * BLOCK).min(self.ranks as usize);
        let mut scan = RankScan::default();
        let bounds = if ranks.len() > BLOCK / 4 { None } else { self.grown_box(old, ranks, block, &mut scan.bad) };
        match bounds {
            Some(bounds) => scan.blocks.push(bounds),
            None => {
                scan = RankScan::default();
                scan.add_block(&self.numbers(), &self.spec.placer(), block * BLOCK..end, (0, &mut ScanSlots::Nothing));
            }
        }
        Some((block, scan))
    }

    /// The box of a block after edits that removed nothing that reached its sides; `None` after others.
    fn grown_box(&self, old: &Self, ranks: &[u32], block: usize, bad: &mut Vec<u32>) -> Option<Aabb> {
        let was = *old.blocks.get(block)?;
        let mut bounds = was;
        let (before, now) = ((old.numbers(), old.spec.placer()), (self.numbers(), self.spec.placer()));
        let place = |(numbers, placer): &(InstanceNumbers<'_>, InstancePlacer<'_>), rank| {
            numbers.of(rank).and_then(|number| placer.place(number)).map(|placed| placed.bounds)
        };
        for &rank in ranks {
            let is_inside = |b: &Aabb| (0..3).all(|k| was.min[k] < b.min[k] && b.max[k] < was.max[k]);
            if place(&before, rank).is_some_and(|b| !is_inside(&b)) {
                return None;
            }
            match place(&now, rank) {
                Some(placed) => bounds = bounds.union(&placed),
                None => bad.push(rank),
            }
        }
        Some(bounds)
    }

    /// Finds the changes in the arrays that `new` instances read, unless they are known.
    pub(crate) fn compare_arrays(&self, new: &PrototypeInstances) {
        if let Some(old) = self.spec.instances.as_ref().filter(|old| !Arc::ptr_eq(&old.arrays, &new.arrays)) {
            InstanceArrays::changes(&old.arrays, &new.arrays);
        }
    }

    /// Instances whose elements differ from those under `spec`, if everything else is the same.
    pub(super) fn changed_numbers(&self, spec: &RunSpec) -> Option<Arc<ChangedNumbers>> {
        let (old, new) = (self.spec.instances.as_ref()?, spec.instances.as_ref()?);
        let is_same_frame = self.spec.before == spec.before && self.spec.after == spec.after;
        if is_same_frame { InstanceArrays::changes(&old.arrays, &new.arrays) } else { None }
    }

    /// The instances that may be elsewhere than in `old`, if this run was made from it without being measured.
    pub(crate) fn moves_of(&self, old: &Arc<Self>) -> Option<Arc<ChangedNumbers>> {
        let (from, numbers) = self.moves.as_ref()?;
        std::ptr::eq(from.as_ptr(), Arc::as_ptr(old)).then(|| numbers.clone())
    }

    /// Ranks whose placement may differ under `spec`, in order, if everything else is the same and they are few.
    fn changed_ranks(&self, spec: &RunSpec) -> Option<Vec<u32>> {
        let (old, new) = (self.spec.instances.as_ref()?, spec.instances.as_ref()?);
        let same_frame = self.spec.before == spec.before
            && self.spec.after == spec.after
            && self.spec.target_bounds == spec.target_bounds
            && !spec.target_bounds.is_empty();
        let moves = self.key_count() != 0 || spec.key_count() != 0;
        if moves || !same_frame || self.ranks == 0 || !old.same_indices(new) {
            return None;
        }
        let changed = InstanceArrays::changes(&old.arrays, &new.arrays)?;
        if changed.is_most_of(self.ranks) {
            return None;
        }
        let (unmasked, indices) = (self.unmasked.as_ref().map(|n| &n[..]), old.indices.view());
        let number_of = |rank: u32| number(unmasked, &indices, rank as usize);
        if let Some(numbers) = changed.few().filter(|_| self.is_ascending()) {
            let rank_of = |wanted: usize| {
                let (mut low, mut high) = (0, self.ranks);
                while low < high {
                    let middle = low.midpoint(high);
                    if number_of(middle).is_none_or(|n| n < wanted) { low = middle + 1 } else { high = middle }
                }
                (low < self.ranks && number_of(low) == Some(wanted)).then_some(low)
            };
            return Some(numbers.into_iter().filter_map(rank_of).collect());
        }
        let is_changed = |rank: u32| number_of(rank).is_some_and(|n| changed.contains(n));
        Some((0..self.ranks).into_par_iter().with_min_len(TASK).filter(|&rank| is_changed(rank)).collect())
    }

    /// Whether ranks are in the order of their instances, none of them without one. Looks at all ranks once.
    fn is_ascending(&self) -> bool {
        *self.is_ascending.get_or_init(|| {
            let Some(instances) = &self.spec.instances else { return false };
            let (unmasked, indices) = (self.unmasked.as_ref().map(|n| &n[..]), instances.indices.view());
            let number_of = |rank: u32| number(unmasked, &indices, rank as usize);
            let follows = |rank: u32| number_of(rank).is_some_and(|n| rank == 0 || number_of(rank - 1) < Some(n));
            (0..self.ranks).into_par_iter().with_min_len(TASK).all(follows)
        })
    }

    /// Ranks that may differ from those of `old`, if this run was made from it.
    pub(crate) fn edits_of(&self, old: &Arc<Self>) -> Option<Arc<Vec<u32>>> {
        let (from, ranks) = self.edits.as_ref()?;
        std::ptr::eq(from.as_ptr(), Arc::as_ptr(old)).then(|| ranks.clone())
    }
}
