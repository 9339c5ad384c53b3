// SPDX-License-Identifier: Apache-2.0
//! The host's view of the paths: the counters, segments and demand that a step left behind. Pure.

use super::segments;
use oocpt_abi::{PathSegment, RouletteStats, UnitDemand, WavefrontCounters};
use oocpt_core::residency::UnitId;

/// The sizes of the parts of a step's results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StepExtents {
    /// Number of segments.
    pub(crate) segments: usize,
    /// Most entries of the list of demand.
    pub(crate) listed: usize,
    /// Number of units.
    pub(crate) units: usize,
    /// Number of chunks and meshes whose rays are counted.
    pub(crate) visited: usize,
}

impl StepExtents {
    /// Bytes of the counts and the list of demand.
    pub(crate) fn demand_bytes(listed: usize) -> usize {
        2 * size_of::<u32>() + listed * size_of::<UnitDemand>()
    }
}

/// The results of the newest step. Reading a step costs time in proportion to what was requested, not to the scene.
#[derive(Debug, Default)]
pub(crate) struct StepObservation {
    /// The step that left the results; 0 = none yet.
    pub(crate) step: u64,
    pub(crate) counters: WavefrontCounters,
    /// Paths that are alive or have begun, by segment.
    pub(crate) segments: Vec<PathSegment>,
    /// Rays that wait for each unit first.
    pub(crate) waiting: Vec<u32>,
    /// Rays that have each unit further down their list.
    pub(crate) next: Vec<u32>,
    /// 1 + a unit that rays need at the same time as this one; 0 = none.
    pub(crate) partners: Vec<u32>,
    /// The units of which one of `waiting` and `next` is not 0, ascending.
    pub(crate) requested: Vec<UnitId>,
    /// Rays that entered each chunk and mesh since the stage began, modulo 2^32; empty if they are not counted.
    pub(crate) visited: Vec<u32>,
    /// The statistics of roulette on loads.
    pub(crate) roulette: RouletteStats,
    /// With roulette on loads: the possible contribution of the rays that wait for each chunk and mesh first, in `1 /
    /// WORTH_ONE`; empty if it was not measured.
    pub(crate) worth: Vec<u32>,
}

impl StepObservation {
    /// Returns true if all paths of a segment are known to be dead; `begun`: the step of each segment's beginning.
    pub(crate) fn is_finished(&self, begun: &[u64], segment: &segments::LiveSegment) -> bool {
        let since = begun.get(segment.index as usize).copied().unwrap_or(u64::MAX);
        since <= self.step && self.alive(segment.index) == Some(0)
    }

    /// Reads the bytes that [`super::StreamBuffers::copy_out`] wrote.
    pub(crate) fn read(&mut self, step: u64, bytes: &[u8], extents: StepExtents) {
        let (counters, rest) = bytes.split_at(size_of::<WavefrontCounters>());
        let (table, rest) = rest.split_at(extents.segments * size_of::<PathSegment>());
        let (demand, rest) = rest.split_at(StepExtents::demand_bytes(extents.listed));
        let (visited, played) = rest.split_at(4 * extents.visited);
        let (roulette, worth) = played.split_at(size_of::<RouletteStats>().min(played.len()));
        self.step = step;
        self.counters = bytemuck::pod_read_unaligned(counters);
        self.segments.clear();
        self.segments
            .extend(table.chunks_exact(size_of::<PathSegment>()).map(bytemuck::pod_read_unaligned::<PathSegment>));
        self.read_demand(demand, extents.units);
        self.visited.clear();
        self.visited.extend(visited.chunks_exact(4).map(bytemuck::pod_read_unaligned::<u32>));
        self.roulette =
            if roulette.is_empty() { RouletteStats::default() } else { bytemuck::pod_read_unaligned(roulette) };
        self.worth.clear();
        self.worth.extend(worth.chunks_exact(4).map(bytemuck::pod_read_unaligned::<u32>));
    }

    fn read_demand(&mut self, bytes: &[u8], units: usize) {
        for unit in self.requested.drain(..) {
            for of_unit in [&mut self.waiting, &mut self.next, &mut self.partners] {
                of_unit.get_mut(unit as usize).into_iter().for_each(|rays| *rays = 0);
            }
        }
        self.waiting.resize(units, 0);
        self.next.resize(units, 0);
        self.partners.resize(units, 0);
        let (counts, entries) = bytes.split_at(2 * size_of::<u32>());
        let [_, count] = bytemuck::pod_read_unaligned::<[u32; 2]>(counts).map(|count| count as usize);
        for entry in entries.chunks_exact(size_of::<UnitDemand>()).take(count) {
            let UnitDemand { unit, waiting, next, partner } = bytemuck::pod_read_unaligned(entry);
            let at = unit as usize;
            let of = (self.waiting.get_mut(at), self.next.get_mut(at), self.partners.get_mut(at));
            if let (Some(waits), Some(follows), Some(with)) = of {
                (*waits, *follows, *with) = (waiting, next, partner);
                self.requested.push(unit);
            }
        }
        self.requested.sort_unstable();
    }

    /// Rays that can be traced, given the parity of the next round.
    pub(crate) fn active(&self) -> u64 {
        let rays: u32 = self.counters.ray_count.iter().sum();
        u64::from(rays) + u64::from(self.counters.shadow_count)
    }

    /// Rays that wait for a chunk.
    pub(crate) fn waiting(&self) -> u64 {
        let parity = usize::from(self.counters.deferred_parity & 1 == 1);
        u64::from(self.counters.deferred_count[parity])
    }

    /// Paths that are not finished.
    pub(crate) fn paths_alive(&self) -> u64 {
        self.segments.iter().map(|segment| u64::from(segment.alive)).sum()
    }

    /// Paths of a segment that are not finished.
    pub(crate) fn alive(&self, segment: u32) -> Option<u32> {
        self.segments.get(segment as usize).map(|segment| segment.alive)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXTENTS: StepExtents = StepExtents { segments: 2, listed: 3, units: 9, visited: 0 };

    fn bytes(list: &[[u32; 4]], count: u32) -> Vec<u8> {
        let mut counters = WavefrontCounters { shadow_count: 7, deferred_parity: 1, ..WavefrontCounters::default() };
        counters.ray_count = [5, 0];
        counters.deferred_count = [1, 9];
        let segments =
            [PathSegment { alive: 3, ..PathSegment::default() }, PathSegment { alive: 4, ..PathSegment::default() }];
        let mut entries = [[0xdddd_dddd_u32; 4]; 3];
        entries[..list.len()].copy_from_slice(list);
        let list = [bytemuck::bytes_of(&[99, count]), bytemuck::cast_slice(&entries)].concat();
        [bytemuck::bytes_of(&counters), bytemuck::cast_slice(&segments), &list].concat()
    }

    #[test]
    fn feedback_sections_are_read_from_their_offsets() {
        let mut seen = StepObservation::default();
        seen.read(3, &bytes(&[[6, 10, 20, 3], [2, 0, 21, 0]], 2), EXTENTS);
        assert!(seen.worth.is_empty(), "nobody plays");
        assert_eq!((seen.step, seen.active(), seen.waiting(), seen.paths_alive()), (3, 12, 9, 7), "counters, segments");
        assert_eq!(seen.waiting, [0, 0, 0, 0, 0, 0, 10, 0, 0], "waiting");
        assert_eq!((&*seen.next, &*seen.requested), (&[0, 0, 21, 0, 0, 0, 20, 0, 0][..], &[2, 6][..]), "next");
        assert_eq!(seen.partners, [0, 0, 0, 0, 0, 0, 3, 0, 0], "partners");
        let known = RouletteStats { mean: 0.5, ended_paths: 6, ..RouletteStats::default() };
        let played = [&*bytes(&[], 0), bytemuck::bytes_of(&known), bytemuck::cast_slice(&[30_u32, 31])].concat();
        seen.read(4, &played, EXTENTS);
        assert_eq!((seen.worth, seen.roulette), (vec![30, 31], known), "what is behind the demand");
    }

    #[test]
    fn demand_comes_from_the_last_step_only() {
        let mut seen = StepObservation::default();
        seen.read(1, &bytes(&[[6, 10, 20, 9], [2, 1, 0, 0], [8, 1, 1, 0]], 3), EXTENTS);
        seen.read(2, &bytes(&[[2, 0, 4, 0]], 1), EXTENTS);
        assert_eq!((&*seen.waiting, &*seen.requested), (&[0; 9][..], &[2][..]), "the others ask no more");
        assert_eq!((&*seen.next, &*seen.partners), (&[0, 0, 4, 0, 0, 0, 0, 0, 0][..], &[0; 9][..]), "next, partners");
    }

    #[test]
    fn out_of_range_feedback_is_ignored() {
        let mut seen = StepObservation::default();
        seen.read(1, &bytes(&[[0, 1, 2, 0], [9, 3, 3, 0], [5, 1, 0, 77]], 4_000_000_000), EXTENTS);
        assert_eq!(seen.requested, [0, 5], "unit 9 of 9 is none, a fourth entry was not kept");
    }
}
