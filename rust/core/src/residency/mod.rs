// SPDX-License-Identifier: Apache-2.0
//! Decides which units live on the device.
//!
//! Pure: [`ResidencyPlanner::step`] takes what the rays ask for and returns commands; it performs none of them. No
//! clock (time is the number of steps), no thread, no I/O; equal calls give equal commands.
//!
//! States of a unit: `Absent -> Requested -> Loading -> Resident -> Absent`. An eviction is one command, after which
//! the planner holds the unit no more: the caller takes it out of the unit table of its next submission and frees the
//! listed assets when earlier submissions are done, *before* it allocates the loads that follow in the list.
//!
//! Guarantees, for every policy:
//! - The bytes of all assets of units that are loading or resident never exceed the budget, at any place in the
//!   command list. (After [`ResidencyPlanner::set_budget`] to less than is held: from the next step on, loads in flight
//!   excepted.)
//! - A load lists all its unit still needs; it relies on no other load in flight.
//! - A unit is not evicted before [`PlannerOptions::pin_steps`] steps have seen it usable.
//! - No starvation: a unit with waiting rays is loaded after at most a bounded number of loads and steps, also when
//!   the budget holds a single unit. Where rays need a base of the catalog with it ([`RayDemand::partners`]), the two
//!   are usable together for as many steps, also when the budget holds no more than the two.
//! - Prefetches take no room from a unit with waiting rays and keep room for the largest unit free of themselves.
//!
//! Units: bytes, rays, steps. Called by one thread. Sources: GPU-Motunui's loop over partitions (`sweep`), the schedule
//! of L. Berchtold's thesis, 2022 (`priority`); `benefit` is ours.

mod ahead;
mod catalog;
mod entry;
mod holdings;
mod mapped;
mod pairs;
mod planner;
pub mod policy;
pub mod roulette;
mod stats;
mod step;
mod victims;

pub use catalog::{CatalogError, UnitCatalog};
pub use entry::UnitState;
pub use planner::{PlanError, PlannerOptions, ResidencyPlanner};
pub use policy::{LoadPolicy, PolicyKind, PolicyView, UnknownPolicy};
pub use stats::ResidencyStats;
pub use step::LoadProposal;

/// Index of an asset in the [`UnitCatalog`].
pub type AssetId = u32;

/// Index of a unit in the [`UnitCatalog`].
pub type UnitId = u32;

/// Demand of the rays, per unit. Slices shorter than the catalog read as 0 past their end.
#[derive(Clone, Copy, Debug, Default)]
pub struct RayDemand<'a> {
    /// Rays that wait for this unit first.
    pub waiting: &'a [u32],
    /// Rays that wait for another unit first and have this one further down their list.
    pub next: &'a [u32],
    /// 1 + a unit that the rays which wait for this one need at the same time; 0: none. Rays that need two units wait
    /// for both, whether the other one is resident or not.
    pub partners: &'a [u32],
    /// Rays that visited this unit since the last step because it was resident or `mapped`. May be empty if visits are
    /// not counted; then resident units are judged by the demand that was seen before their load.
    pub visits: &'a [u32],
    /// Units that rays can read in host memory while they are absent, so that none waits for them. They are loaded for
    /// their visits alone, if the policy has a measure for it.
    pub mapped: &'a [bool],
    /// Resident units below this one are evicted only if they are `mapped`, and none is loaded for its visits.
    pub keep_below: UnitId,
    /// Rays that can be traced now.
    pub active: u64,
    /// The units of which `waiting` or `next` is not 0, ascending, each once; others may be among them. `None`: the
    /// planner scans all units.
    pub requested: Option<&'a [UnitId]>,
}

/// An action for the caller, to be performed in the order of the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ResidencyCommand {
    /// Copy `assets` to the device, then call [`ResidencyPlanner::loaded`] or [`ResidencyPlanner::failed`].
    Load {
        /// The unit that becomes usable.
        unit: UnitId,
        /// Assets of the unit that the device does not hold.
        assets: Vec<AssetId>,
    },
    /// Make the unit unusable (it may be so already after a failure) and free `assets`.
    Evict {
        /// The unit that is evicted.
        unit: UnitId,
        /// Assets that no other unit needs.
        assets: Vec<AssetId>,
    },
}

/// `values[index]`, 0 past the end.
fn at(values: &[u32], unit: UnitId) -> u32 {
    values.get(unit as usize).copied().unwrap_or(0)
}
