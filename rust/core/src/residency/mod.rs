// SPDX-License-Identifier: Apache-2.0
//! Decides which chunks live on the device.
//!
//! Pure: [`Planner::step`] takes what the rays ask for and returns commands; it performs none of them. No clock (time
//! is the number of steps), no thread, no I/O; equal calls give equal commands.
//!
//! States of a chunk: `Absent -> Requested -> Loading -> Resident -> Absent`. An eviction is one command, after which
//! the planner holds the chunk no more: the caller takes it out of the chunk table of its next submission and frees the
//! listed assets when earlier submissions are done, *before* it allocates the loads that follow in the list.
//!
//! Guarantees, for every policy:
//! - The bytes of all assets of chunks that are loading or resident never exceed the budget, at any place in the
//!   command list. (After [`Planner::set_budget`] to less than is held: from the next step on, loads in flight
//!   excepted.)
//! - A load lists all its chunk still needs; it relies on no other load in flight.
//! - A chunk is not evicted before [`PlannerOptions::pin_steps`] steps have seen it usable.
//! - No starvation: a chunk with waiting rays is loaded after at most a bounded number of loads and steps, also when
//!   the budget holds a single chunk.
//! - Prefetches take no room from a chunk with waiting rays and keep room for the largest chunk free of themselves.
//!
//! Units: bytes, rays, steps. Called by one thread. Sources: GPU-Motunui's loop over partitions (`sweep`), the schedule
//! of L. Berchtold's thesis, 2022 (`priority`); `benefit` is ours.

mod catalog;
mod entry;
mod holdings;
mod planner;
pub mod policy;
pub mod roulette;
pub mod simulate;
mod stats;
mod step;
mod victims;

pub use catalog::{Catalog, CatalogError};
pub use entry::ChunkState;
pub use planner::{PlanError, Planner, PlannerOptions};
pub use policy::{Policy, PolicyKind, UnknownPolicy, View};
pub use stats::ResidencyStats;
pub use step::Proposal;

/// Index of an asset in the [`Catalog`].
pub type AssetId = u32;

/// Index of a chunk in the [`Catalog`].
pub type ChunkId = u32;

/// What the rays ask for, per chunk. Slices shorter than the catalog read as 0 past their end.
#[derive(Clone, Copy, Debug, Default)]
pub struct Demand<'a> {
    /// Rays that wait for this chunk first.
    pub waiting: &'a [u32],
    /// Rays that wait for another chunk first and have this one further down their list.
    pub next: &'a [u32],
    /// Rays that visited this chunk since the last step because it was resident. May be empty when nobody counts; then
    /// what stays resident is judged by the demand that was seen before its load.
    pub visits: &'a [u32],
    /// Rays that can be traced now.
    pub active: u64,
    /// The chunks of which `waiting` or `next` is not 0, ascending, each once; others may be among them. `None`: the
    /// planner looks at all.
    pub asked: Option<&'a [ChunkId]>,
}

/// What the caller is to do, in the order of the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Command {
    /// Bring `assets` to the device, then say [`Planner::loaded`] or [`Planner::failed`].
    Load {
        /// The chunk that becomes usable.
        chunk: ChunkId,
        /// What it needs and the device does not hold.
        assets: Vec<AssetId>,
    },
    /// Make the chunk unusable (it may be so already after a failure) and free `assets`.
    Evict {
        /// The chunk that goes.
        chunk: ChunkId,
        /// What no other chunk needs.
        assets: Vec<AssetId>,
    },
}

/// `values[index]`, 0 past the end.
fn at(values: &[u32], chunk: ChunkId) -> u32 {
    values.get(chunk as usize).copied().unwrap_or(0)
}
