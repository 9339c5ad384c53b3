// SPDX-License-Identifier: Apache-2.0
//! Loads chunks, meshes and tiles into host memory where rays read them (`reach`): those that rays wait for and the
//! device has no room for. Render thread only.

use super::reach::MappedUnits;
use super::residency::SceneResidency;
use crate::assets::HostHeapFiller;
use crate::error::RenderError;
use crate::job::shared::FrameGate;
use oocpt_core::residency::{AssetId, RayDemand, UnitId, UnitState};
use rustc_hash::FxHashSet;
use std::time::{Duration, Instant};

/// Units that are begun in a step, those that most rays wait for first.
const MAPPED_A_STEP: usize = 4096;
/// Units that no ray has asked for that are begun in a step.
const REST_A_STEP: usize = 1024;
/// Most assets in transit when such units are begun.
const REST_ON_THE_WAY: usize = 4096;
/// Most bytes of such units in transit while rays wait for others, which would be loaded after them.
const REST_BYTES_BEFORE_WANTED: u64 = 64 << 20;
/// The time of one wait for an asset.
const WAIT: Duration = Duration::from_millis(20);
/// Longest wait without an asset, after which rays are traced, whose own assets are loaded first.
const MAX_WAIT: Duration = Duration::from_secs(1);
/// The most visited units count as resident when less than one part in so many of the device's geometry is in transit,
/// after [`SETTLING_RAYS`].
const SETTLED_SHARE: u64 = 32;
/// Rays after which the most visited units are known.
const SETTLING_RAYS: u64 = 1 << 22;

impl SceneResidency<'_> {
    /// Shows the assets of earlier frames that are in host memory and not on the device.
    pub(super) fn take_over_mapped(&mut self) {
        if !self.store.maps_any() {
            return;
        }
        let Some(mut reach) = self.reach.take() else { return };
        let tiles = self.store.mapped_tiles().filter_map(|(image, tile)| self.assets.textures.number_of(image, tile));
        let mut tiles: Vec<UnitId> = tiles.map(|tile| self.assets.tile_unit(tile)).collect();
        tiles.sort_unstable();
        let geometry: Vec<UnitId> = self.assets.geometry_units().collect();
        for unit in geometry.into_iter().chain(tiles) {
            if self.unmapped(unit).is_empty() {
                reach.expect(unit, &[]);
                if !self.planner.is_resident(unit) {
                    self.show_all(unit);
                }
            }
        }
        self.reach = Some(reach);
    }

    /// Assets of a unit that are not in host memory.
    fn unmapped(&self, unit: UnitId) -> Vec<AssetId> {
        let is_mapped = |asset: &AssetId| self.assets.key(*asset).is_some_and(|key| self.store.mapped(&key).is_some());
        self.assets.catalog.assets(unit).iter().copied().filter(|asset| !is_mapped(asset)).collect()
    }

    /// Begins to load the units that rays wait for into host memory, except those for which the device has room beside
    /// all it holds.
    pub(super) fn map_demanded(&mut self, demand: &RayDemand<'_>) -> Result<(), RenderError> {
        let Some(mut reach) = self.reach.take() else { return Ok(()) };
        let begun = self.map_most_wanted(&mut reach, demand);
        self.reach = Some(reach);
        self.filler.iter().for_each(HostHeapFiller::note_use);
        begun
    }

    fn map_most_wanted(&mut self, reach: &mut MappedUnits, demand: &RayDemand<'_>) -> Result<(), RenderError> {
        let waiting = |unit: UnitId| demand.waiting.get(unit as usize).copied().unwrap_or(0);
        let requested = demand.requested.unwrap_or_default().iter().copied();
        let mut wanted: Vec<UnitId> = requested.filter(|unit| waiting(*unit) > 0 && reach.is_absent(*unit)).collect();
        // Units that the planner has begun are loaded to the device.
        wanted.retain(|unit| self.planner.state(*unit) != UnitState::Loading);
        let nothing_wanted = wanted.is_empty();
        wanted.sort_unstable_by_key(|unit| (std::cmp::Reverse(waiting(*unit)), *unit));
        let mut free = self.planner.budget().saturating_sub(self.planner.stats().bytes_held);
        let mut free_for_tiles = self.planner.room_for_tiles();
        for unit in wanted.into_iter().take(MAPPED_A_STEP) {
            let bytes = self.assets.catalog.closure_bytes(unit);
            if self.assets.is_tile(unit) && bytes <= free_for_tiles {
                free_for_tiles -= bytes;
                continue;
            }
            if bytes <= free {
                free -= bytes;
                continue;
            }
            if !self.map(unit, reach)? {
                return Ok(());
            }
        }
        if self.brings_rest { self.map_rest(reach, nothing_wanted) } else { Ok(()) }
    }

    /// Loads all geometry into host memory before any ray waits for it, one unit after the other. Stops if the gate
    /// says so, or if nothing arrives.
    pub(super) fn map_all(&mut self, gate: &FrameGate<'_>) -> Result<(), RenderError> {
        let (mut came, mut count) = (Instant::now(), 0);
        while !self.is_all_there() && came.elapsed() < MAX_WAIT && gate.proceed() {
            self.map_demanded(&RayDemand::default())?;
            self.advance(WAIT)?;
            if self.store.mapped_count() != count {
                (came, count) = (Instant::now(), self.store.mapped_count());
            }
        }
        Ok(())
    }

    /// Returns true if the most visited units are on the device, as far as there is room, after so many rays.
    pub(super) fn is_settled(&self, rays: u64) -> bool {
        is_settled(rays, self.planner.stats().bytes_in_flight, self.planner.budget())
    }

    /// Begins to load units that no ray has asked for. A few rays may wait for something in every step, so this goes on
    /// beside them.
    fn map_rest(&mut self, reach: &mut MappedUnits, nothing_wanted: bool) -> Result<(), RenderError> {
        if self.store.mapping() >= REST_ON_THE_WAY {
            return Ok(());
        }
        let most_bytes = if nothing_wanted { u64::MAX } else { REST_BYTES_BEFORE_WANTED };
        let mut bytes = self.store.mapping_bytes();
        let rest: Vec<UnitId> = self.rest(reach).filter(|unit| reach.is_absent(*unit)).take(REST_A_STEP).collect();
        for unit in rest {
            let more = bytes + self.assets.catalog.closure_bytes(unit);
            if (bytes > 0 && more > most_bytes) || !self.map(unit, reach)? {
                break;
            }
            bytes = more;
        }
        Ok(())
    }

    /// Begins to load a unit into host memory; returns false if no memory is allocated for it yet.
    fn map(&mut self, unit: UnitId, reach: &mut MappedUnits) -> Result<bool, RenderError> {
        let missing = self.unmapped(unit);
        for &asset in &missing {
            if !self.store.is_mapping(asset) && !self.store.map(self.device, &self.assets, asset)? {
                self.filler.iter().for_each(HostHeapFiller::enable);
                return Ok(false);
            }
        }
        reach.expect(unit, &missing);
        if missing.is_empty() {
            self.show_all(unit);
        }
        Ok(true)
    }

    /// Chunks and meshes that rays can use neither on the device nor in host memory.
    fn rest(&self, reach: &MappedUnits) -> impl Iterator<Item = UnitId> {
        self.assets.geometry_units().filter(|unit| !reach.is_there(*unit) && !self.planner.is_resident(*unit))
    }

    /// Returns true if rays can use all geometry.
    pub(super) fn is_all_there(&self) -> bool {
        self.reach.as_ref().is_some_and(|reach| self.rest(reach).next().is_none())
    }

    /// Bytes that tiles of textures have or may take without evicting geometry.
    pub(super) fn room_for_tiles(&self) -> u64 {
        self.budget.saturating_sub(self.planner.stats().bytes_held) + self.textures.bytes_held
    }

    /// Evicts geometry until tiles have so much room, as far as the budget has so much; the evicted units are read in
    /// host memory, or loaded there.
    pub(super) fn make_room_for_tiles(&mut self, bytes: u64) {
        let geometry = beside_tiles(self.budget, self.textures.bytes_held, bytes);
        if geometry < self.planner.budget() && self.planner.set_budget(geometry).is_err() {
            tracing::debug!(geometry, "no room for tiles");
        }
    }

    /// Bytes of the units that rays cannot use.
    pub(super) fn rest_bytes(&self) -> u64 {
        let Some(reach) = &self.reach else { return 0 };
        let on_device = |asset: &AssetId| self.assets.key(*asset).is_some_and(|key| self.store.get(&key).is_some());
        let assets: FxHashSet<AssetId> = self.rest(reach).flat_map(|unit| self.unmapped(unit)).collect();
        let missing = assets.iter().filter(|asset| !on_device(asset));
        missing.filter_map(|asset| self.assets.source(*asset)).map(|source| source.bytes()).sum()
    }

    /// Takes in an asset that has arrived in host memory.
    pub(super) fn mapped(&mut self, asset: AssetId) {
        let units = self.reach.as_mut().map(|reach| reach.arrived(asset)).unwrap_or_default();
        for unit in units {
            if !self.planner.is_resident(unit) {
                self.show_all(unit);
            }
        }
    }

    /// Shows a unit at the addresses of its assets.
    fn show_all(&mut self, unit: UnitId) {
        let closure: Vec<AssetId> = self.assets.catalog.assets(unit).to_vec();
        for asset in closure {
            self.show(asset);
        }
        self.grow_stack(unit);
        self.arrived.push(unit);
    }
}

/// True after enough rays, when little geometry is in flight.
fn is_settled(rays: u64, bytes_in_flight: u64, budget: u64) -> bool {
    rays >= SETTLING_RAYS && bytes_in_flight <= budget / SETTLED_SHARE
}

/// Bytes of the budget for geometry and the tiles that are `held`, where all tiles are to have `bytes`.
fn beside_tiles(budget: u64, held: u64, bytes: u64) -> u64 {
    budget.saturating_sub(bytes.saturating_sub(held))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streaming_is_settled_after_some_rays_when_little_is_in_flight() {
        let budget = 320 << 20;
        assert!(is_settled(SETTLING_RAYS, 10 << 20, budget));
        assert!(!is_settled(SETTLING_RAYS - 1, 0, budget), "too few rays tell what is visited most");
        assert!(!is_settled(u64::MAX, (10 << 20) + 1, budget), "much is still on its way");
        assert!(is_settled(SETTLING_RAYS, 0, 0), "nothing can come");
    }

    #[test]
    fn tiles_get_what_they_lack_of_the_budget() {
        assert_eq!(beside_tiles(100, 0, 8), 92);
        assert_eq!(beside_tiles(100, 5, 8), 97, "tiles that are held count in the planner's bytes");
        assert_eq!(beside_tiles(100, 9, 8), 100);
        assert_eq!(beside_tiles(4, 0, 8), 0);
    }
}
