// SPDX-License-Identifier: Apache-2.0
//! Round robin over all chunks that have demand, in the order of their ids, as GPU-Motunui (C. Hellmuth, 2020) passes
//! over all its partitions again and again. What was loaded the longest time ago goes first.

use super::super::ChunkId;
use super::{Policy, View};

/// Round robin.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sweep {
    /// The chunk after the one loaded last.
    cursor: ChunkId,
}

impl Policy for Sweep {
    fn order(&mut self, _view: &View<'_>, demanded: &[ChunkId], limit: usize) -> Vec<(f64, ChunkId)> {
        let mut ids: Vec<(ChunkId, ChunkId)> =
            demanded.iter().map(|&chunk| (chunk.wrapping_sub(self.cursor), chunk)).collect();
        if ids.len() > limit {
            ids.select_nth_unstable(limit);
            ids.truncate(limit);
        }
        ids.sort_unstable();
        ids.into_iter().map(|(distance, chunk)| (-f64::from(distance), chunk)).collect()
    }

    fn loss(&self, view: &View<'_>, chunk: ChunkId) -> f64 {
        -f64::from(view.resident_steps(chunk))
    }

    fn displaces(&self, _value: f64, _loss: f64) -> bool {
        true
    }

    fn issued(&mut self, chunk: ChunkId) {
        self.cursor = chunk.wrapping_add(1);
    }
}
