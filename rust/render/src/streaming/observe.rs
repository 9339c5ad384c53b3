// SPDX-License-Identifier: Apache-2.0
//! What the host knows of the paths: the counters, segments and demand that a step left behind. Pure.

use oocpt_shader_abi::{Counters, Roulette, Segment};

/// See the module.
#[derive(Debug, Default)]
pub(crate) struct Observation {
    /// The step that left it; 0 = none yet.
    pub(crate) step: u64,
    pub(crate) counters: Counters,
    /// By segment.
    pub(crate) segments: Vec<Segment>,
    /// Rays that wait for each chunk first.
    pub(crate) waiting: Vec<u32>,
    /// Rays that have each chunk further down their list.
    pub(crate) next: Vec<u32>,
    /// With roulette on loads: what it knows and counts.
    pub(crate) roulette: Roulette,
    /// With it: what the rays that wait for each chunk first may bring, in `1 / WORTH_ONE`; empty when nobody looked.
    pub(crate) worth: Vec<u32>,
}

impl Observation {
    /// Reads what [`super::StreamBuffers::copy_out`] wrote for `segments` segments and `units` units.
    pub(crate) fn read(step: u64, bytes: &[u8], segments: usize, units: usize) -> Self {
        let (counters, rest) = bytes.split_at(size_of::<Counters>());
        let (table, rest) = rest.split_at(segments * size_of::<Segment>());
        let (demand, played) = rest.split_at(8 * units);
        let (waiting, next) = demand.split_at(4 * units);
        let (roulette, worth) = played.split_at(size_of::<Roulette>().min(played.len()));
        let words = |bytes: &[u8]| bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
        Self {
            step,
            counters: bytemuck::pod_read_unaligned(counters),
            segments: table.chunks_exact(size_of::<Segment>()).map(bytemuck::pod_read_unaligned).collect(),
            waiting: words(waiting),
            next: words(next),
            roulette: if roulette.is_empty() { Roulette::default() } else { bytemuck::pod_read_unaligned(roulette) },
            worth: words(worth),
        }
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

    #[test]
    fn every_part_is_read_from_its_place() {
        let mut counters = Counters { shadow_count: 7, deferred_parity: 1, ..Counters::default() };
        counters.ray_count = [5, 0];
        counters.deferred_count = [1, 9];
        let segments = [Segment { alive: 3, ..Segment::default() }, Segment { alive: 4, ..Segment::default() }];
        let demand = [10_u32, 11, 12, 20, 21, 22];
        let bytes =
            [bytemuck::bytes_of(&counters), bytemuck::cast_slice(&segments), bytemuck::cast_slice(&demand)].concat();
        let seen = Observation::read(3, &bytes, 2, 3);
        assert!(seen.worth.is_empty(), "nobody plays");
        assert_eq!((seen.step, seen.active(), seen.waiting(), seen.paths_alive()), (3, 12, 9, 7), "counters, segments");
        assert_eq!((seen.waiting, seen.next), (vec![10, 11, 12], vec![20, 21, 22]), "demand");
        let known = Roulette { mean: 0.5, ended_paths: 6, ..Roulette::default() };
        let played = [bytes.as_slice(), bytemuck::bytes_of(&known), bytemuck::cast_slice(&[30_u32, 31])].concat();
        let seen = Observation::read(3, &played, 2, 3);
        assert_eq!((seen.next, seen.worth), (vec![20, 21, 22], vec![30, 31]), "what is behind it");
        assert_eq!(seen.roulette, known, "and before that");
    }
}
