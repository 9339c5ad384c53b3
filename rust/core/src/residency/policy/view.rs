// SPDX-License-Identifier: Apache-2.0
//! What a policy may look at during a step.

use super::super::entry::Entry;
use super::super::holdings::Holdings;
use super::super::{Catalog, ChunkId, Demand, at};

/// The planner's state as a policy sees it. Ids are valid chunks.
#[derive(Debug)]
pub struct View<'a> {
    pub(in super::super) catalog: &'a Catalog,
    pub(in super::super) demand: Demand<'a>,
    pub(in super::super) entries: &'a [Entry],
    pub(in super::super) holdings: &'a Holdings,
    pub(in super::super) step: u32,
}

impl View<'_> {
    /// The catalog.
    pub fn catalog(&self) -> &Catalog {
        self.catalog
    }

    /// Rays that wait for the chunk.
    pub fn waiting(&self, chunk: ChunkId) -> u32 {
        at(self.demand.waiting, chunk)
    }

    /// No ray can be traced: the device waits for loads.
    pub fn is_idle(&self) -> bool {
        self.demand.active == 0
    }

    /// Rays that have the chunk further down their list.
    pub fn next(&self, chunk: ChunkId) -> u32 {
        at(self.demand.next, chunk)
    }

    /// Rays that visited the chunk since the last step, if the caller counts them.
    pub fn visits(&self, chunk: ChunkId) -> u32 {
        at(self.demand.visits, chunk)
    }

    /// Rays that needed the chunk lately, halved every 16 steps.
    pub fn heat(&self, chunk: ChunkId) -> f64 {
        f64::from(self.entries[chunk as usize].heat_at(self.step))
    }

    /// Steps for which rays have waited for the chunk without a gap.
    pub fn waited_steps(&self, chunk: ChunkId) -> u32 {
        self.step.wrapping_sub(self.entries[chunk as usize].since)
    }

    /// Steps since the chunk was last waited for, visited or loaded.
    pub fn idle_steps(&self, chunk: ChunkId) -> u32 {
        self.step.wrapping_sub(self.entries[chunk as usize].used)
    }

    /// Steps since the chunk became usable; for resident chunks.
    pub fn resident_steps(&self, chunk: ChunkId) -> u32 {
        self.step.wrapping_sub(self.entries[chunk as usize].usable)
    }

    /// Bytes a load would bring, `None` while one of its assets is on its way for another chunk. Costs its assets.
    pub fn missing_bytes(&self, chunk: ChunkId) -> Option<u64> {
        self.holdings.missing(self.catalog, chunk)
    }

    /// Bytes an eviction would free.
    pub fn exclusive_bytes(&self, chunk: ChunkId) -> u64 {
        self.holdings.exclusive(chunk)
    }
}
