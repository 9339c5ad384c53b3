// SPDX-License-Identifier: Apache-2.0
//! Runs: the placements that one prim contributes to an assembly. A run lists which of its instances are shown and
//! usable; their matrices stay in the borrowed arrays. Immutable once scanned.

mod reader;
mod rescan;
mod scan;

use std::sync::{Arc, Mutex, OnceLock, Weak};

use glam::{DAffine3, DVec3};

pub(crate) use reader::{InstanceNumbers, RunReader};
use scan::ScannedRanks;
pub(crate) use scan::{ItemBucketing, ScanOutput, UNUSABLE};

use super::arrays::InstanceArrays;
use super::diff::ChangedNumbers;
use super::placement::{InstancePlacer, KeyPlacer, PlacedInstance};
use crate::array::TypedArray;
use crate::desc::DroppedData;
use crate::mesh::Aabb;

/// Number of instances that moved from which on they are not measured, if they need not be.
const MEASURED: usize = 1 << 10;

/// The instances of one prototype.
#[derive(Clone, Debug)]
pub(crate) struct PrototypeInstances {
    /// Arrays with the transforms of the instances.
    pub(crate) arrays: Arc<InstanceArrays>,
    /// Numbers of the instances that show this prototype.
    pub(crate) indices: TypedArray,
    /// Positions in `indices` that are used, in order; `None`: all of them.
    pub(crate) chosen: Option<Arc<Vec<u32>>>,
}

impl PrototypeInstances {
    /// Largest number of instances.
    pub(crate) fn len(&self) -> usize {
        self.chosen.as_ref().map_or(self.indices.len(), |chosen| chosen.len())
    }

    /// Returns true if both have the same elements of the same array, by address.
    fn same_indices(&self, other: &Self) -> bool {
        let chosen = match (&self.chosen, &other.chosen) {
            (None, None) => true,
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            _ => false,
        };
        chosen
            && self.indices.identity() == other.indices.identity()
            && self.indices.element() == other.indices.element()
    }
}

/// The inputs that determine a run.
#[derive(Clone, Debug)]
pub(crate) struct RunSpec {
    /// Assembly frame from the prim's frame.
    pub(crate) before: DAffine3,
    /// Instance frame from the target's frame.
    pub(crate) after: DAffine3,
    /// Instances; `None`: placed once.
    pub(crate) instances: Option<PrototypeInstances>,
    /// Box of the target, not empty.
    pub(crate) target_bounds: Aabb,
    /// For a moving prim that is placed once: `before` at times of the shutter, two or more.
    pub(crate) motion: Option<Arc<Vec<TransformKey>>>,
}

/// Transform of a prim at a time of the shutter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TransformKey {
    pub(crate) time: f32,
    /// Assembly frame from the prim's frame, as [`RunSpec::before`].
    pub(crate) before: DAffine3,
}

impl RunSpec {
    /// Returns true if both give the same run, without looking at elements.
    fn is_same(&self, other: &Self) -> bool {
        let instances = match (&self.instances, &other.instances) {
            (None, None) => true,
            (Some(a), Some(b)) => Arc::ptr_eq(&a.arrays, &b.arrays) && a.same_indices(b),
            _ => false,
        };
        instances
            && self.before == other.before
            && self.after == other.after
            && self.target_bounds == other.target_bounds
            && self.motion == other.motion
    }

    /// Number of keys of each placement; 0 if they do not move.
    fn key_count(&self) -> usize {
        let arrays = self.instances.as_ref().and_then(|instances| instances.arrays.motion.as_ref());
        self.motion.as_ref().map_or_else(|| arrays.map_or(0, |motion| motion.key_count()), |motion| motion.len())
    }

    fn placer(&self) -> InstancePlacer<'_> {
        let arrays = self.instances.as_ref().map(|i| &*i.arrays);
        let placer = InstancePlacer::new(self.before, self.after, arrays, &self.target_bounds);
        let keys = match (&self.motion, arrays) {
            (Some(motion), _) => {
                motion.iter().map(|key| KeyPlacer { time: key.time, placer: placer.framed(key.before) }).collect()
            }
            (None, Some(arrays)) => match &arrays.motion {
                Some(motion) => placer.at_keys(motion, arrays),
                None => return placer,
            },
            (None, None) => return placer,
        };
        placer.moving(keys)
    }
}

/// A scanned run.
#[derive(Debug)]
pub(crate) struct InstanceRun {
    spec: RunSpec,
    /// Instance numbers left by the mask, by rank; `None` = all indices.
    unmasked: Option<Arc<Vec<u32>>>,
    /// For chosen instances, by rank: the rank that each would have if all were chosen; and the number of ranks then.
    among_all: Option<(Arc<Vec<u32>>, u32)>,
    /// Ranks that are not usable, in order.
    bad: Vec<u32>,
    /// Number of ranks: instances left by the mask.
    ranks: u32,
    /// Whether ranks are in the order of their instances, once it was asked for.
    is_ascending: OnceLock<bool>,
    /// Box of each stretch of `scan::BLOCK` ranks.
    blocks: Vec<Aabb>,
    bounds: Aabb,
    dropped: DroppedData,
    /// False if it was not looked at where its placements are now: bounds, boxes of blocks and what is unusable are
    /// those of before.
    is_measured: bool,
    /// The run that this one was made from, and the ranks that may differ from it.
    edits: Option<(Weak<Self>, Arc<Vec<u32>>)>,
    /// The same for a run that is not measured: the instances that may be elsewhere.
    moves: Option<(Weak<Self>, Arc<ChangedNumbers>)>,
    /// Results of the scan that the partition takes.
    kept: Mutex<ScannedRanks>,
}

impl InstanceRun {
    /// Returns `old` again if it is of the same spec, or a run made from it if little changed, or, if runs may be
    /// `late`, one that is not measured; `None` if everything has to be scanned.
    pub(crate) fn reuse(old: Option<&Arc<Self>>, spec: &RunSpec, late: bool) -> Option<Arc<Self>> {
        let old = old.filter(|old| old.is_measured || late)?;
        if old.spec.is_same(spec) {
            return Some(old.clone());
        }
        let edited = || if old.is_measured { Self::edited(old, spec) } else { None };
        if !late {
            return edited().map(Arc::new);
        }
        let moved = || Self::moved(old, spec);
        let many = old.changed_numbers(spec).is_none_or(|changed| changed.len() >= MEASURED);
        if many { moved().or_else(edited) } else { edited().or_else(moved) }.map(Arc::new)
    }

    /// Whether it is known where its placements are, and which are usable.
    pub(crate) fn is_measured(&self) -> bool {
        self.is_measured
    }

    /// Scans a whole run. `keep`: the results that the partition will ask for.
    pub(crate) fn scan(spec: RunSpec, keep: ScanOutput<'_>) -> Self {
        let mut run = Self {
            spec,
            unmasked: None,
            among_all: None,
            bad: Vec::new(),
            ranks: 0,
            is_ascending: OnceLock::new(),
            blocks: Vec::new(),
            bounds: Aabb::EMPTY,
            dropped: DroppedData::default(),
            is_measured: true,
            edits: None,
            moves: None,
            kept: Mutex::default(),
        };
        if run.spec.target_bounds.is_empty() {
            // The target is empty: there is nothing to place, and nothing is bad here.
            return run;
        }
        match run.spec.instances.clone() {
            Some(instances) => run.scan_instances(&instances, keep),
            None => {
                run.ranks = 1;
                match run.spec.placer().place(None) {
                    Some(placed) => {
                        run.bounds = placed.bounds;
                        run.dropped.instance_motions += u64::from(run.spec.placer().is_stuck(None));
                    }
                    None => {
                        run.bad.push(0);
                        run.dropped.prim_transforms += 1;
                    }
                }
            }
        }
        run
    }

    pub(crate) fn numbers(&self) -> InstanceNumbers<'_> {
        let instances = self.spec.instances.as_ref();
        InstanceNumbers {
            unmasked: self.unmasked.as_ref().map(|n| &n[..]),
            indices: instances.map(|i| i.indices.view()),
            limit: instances.map_or(0, |i| i.arrays.len()),
        }
    }

    /// The inputs that determine it.
    pub(crate) fn spec(&self) -> &RunSpec {
        &self.spec
    }

    /// Number of usable placements.
    pub(crate) fn len(&self) -> usize {
        self.ranks as usize - self.bad.len()
    }

    /// Box of all usable placements.
    pub(crate) fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Data dropped by the scan.
    pub(crate) fn dropped(&self) -> &DroppedData {
        &self.dropped
    }

    /// Returns true if an instancer makes the placements.
    pub(crate) fn is_instanced(&self) -> bool {
        self.spec.instances.is_some()
    }

    /// Calls `write` with the position in `places`, the rank and the placement of each of the run's placements
    /// `places`. It does not allocate.
    pub(crate) fn encode(&self, places: std::ops::Range<usize>, mut write: impl FnMut(usize, u32, &PlacedInstance)) {
        let placer = self.spec.placer();
        let numbers = self.numbers();
        self.each_rank(places, |at, rank| {
            if let Some(placed) = numbers.of(rank).and_then(|number| placer.place(number)) {
                write(at, rank, &placed);
            }
        });
    }

    /// Calls `visit` with the position in `places` and the rank of each of the run's placements `places`.
    pub(crate) fn each_rank(&self, places: std::ops::Range<usize>, mut visit: impl FnMut(usize, u32)) {
        // Bad ranks before a place are those whose own place would not be after it.
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
            visit(place - places.start, this);
            rank += 1;
        }
    }

    /// Number of keys of each placement; 0 if they do not move.
    pub(crate) fn key_count(&self) -> usize {
        self.spec.key_count()
    }

    /// Returns true if each rank is that of the same instance in `other`, the same ranks are usable, and placements
    /// have as many keys: what differs is where they are.
    pub(crate) fn has_ranks_of(&self, other: &Self) -> bool {
        let has_same_instances = match (&self.spec.instances, &other.spec.instances) {
            (None, None) => true,
            (Some(a), Some(b)) => a.same_indices(b),
            _ => false,
        };
        has_same_instances
            && self.ranks == other.ranks
            && self.key_count() == other.key_count()
            && self.bad == other.bad
            && self.unmasked == other.unmasked
            && self.among_all == other.among_all
    }

    /// Number of usable ranks before a rank.
    #[inline]
    pub(crate) fn usable_before(&self, rank: u32) -> usize {
        let bad = if self.bad.is_empty() { 0 } else { self.bad.partition_point(|bad| *bad < rank) };
        (rank as usize).saturating_sub(bad)
    }

    /// Number of ranks.
    pub(crate) fn ranks(&self) -> u32 {
        self.ranks
    }

    /// Number of instances that show the prototype, for instance ids.
    pub(crate) fn prototype_count(&self) -> u32 {
        self.among_all.as_ref().map_or(self.ranks, |(_, count)| *count)
    }

    /// Index of a rank among the instances of the prototype.
    pub(crate) fn index_in_prototype(&self, rank: u32) -> u32 {
        self.among_all.as_ref().map_or(rank, |(of, _)| of.get(rank as usize).copied().unwrap_or(rank))
    }

    /// A reader of single placements relative to `origin` (given in the assembly's frame).
    pub(crate) fn reader(&self, origin: Option<DVec3>) -> RunReader<'_> {
        let placer = self.spec.placer();
        let placer = match origin {
            Some(origin) => placer.seen_from(origin),
            None => placer,
        };
        RunReader { numbers: self.numbers(), placer, bad: &self.bad, ranks: self.ranks }
    }
}
