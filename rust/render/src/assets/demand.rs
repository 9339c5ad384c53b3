// SPDX-License-Identifier: Apache-2.0
//! Loads the tiles of textures that waves lacked, in core. Render thread only.

use super::cache::DeviceScene;
use super::source::AssetKey;
use super::store::MemoryWait;
use crate::device::Device;
use crate::error::RenderError;
use crate::job::shared::FrameGate;
use crate::job::timings::RenderTimings;
use oocpt_core::residency::AssetId;
use oocpt_gpu::CommandList;
use rustc_hash::FxHashMap;
use std::time::{Duration, Instant};

/// Bytes of tiles that may be in transit at the same time.
const IN_FLIGHT_BYTES: u64 = 256 << 20;
/// The longest time that a copy on the device may take.
const COPY_TIMEOUT: Duration = Duration::from_secs(120);

/// The outcome of loading tiles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum TilesOutcome {
    /// All tiles are resident; their entries are to be written.
    All(Vec<AssetId>),
    /// There is no memory for them.
    NoRoom,
    /// The gate stopped it.
    GivenUp,
}

impl DeviceScene {
    /// Loads tiles, numbered over the scene, so that all tiles and geometry take at most `cap` bytes.
    pub(crate) fn bring_tiles(
        &mut self,
        device: &Device,
        tiles: &[u32],
        cap: Option<u64>,
        gate: &FrameGate<'_>,
        timings: &mut RenderTimings,
    ) -> Result<TilesOutcome, RenderError> {
        let started = Instant::now();
        let wanted = self.missing_tiles(tiles);
        let bytes: u64 = wanted.iter().map(|asset| self.assets.catalog.bytes(*asset)).sum();
        if cap.is_some_and(|cap| self.store.bytes() + bytes > cap) {
            return Ok(TilesOutcome::NoRoom);
        }
        let mut queue = wanted.iter().copied().peekable();
        let mut on_the_way = 0_u64;
        let mut patience = gate.patience();
        while queue.peek().is_some() || self.store.in_flight() + self.store.mapping() > 0 {
            if !gate.proceed() {
                self.store.forget_arriving();
                return Ok(TilesOutcome::GivenUp);
            }
            while let Some(&asset) = queue.peek() {
                let cost = self.assets.catalog.bytes(asset);
                if on_the_way > 0 && on_the_way + cost > IN_FLIGHT_BYTES {
                    break;
                }
                if !(self.store.begin(device, &self.assets, asset, MemoryWait::Now)?
                    || self.maps_tile(device, asset)?)
                {
                    self.store.forget_arriving();
                    return Ok(TilesOutcome::NoRoom);
                }
                on_the_way += cost;
                queue.next();
            }
            self.store.send(device)?;
            let arrived = self.store.advance(&self.assets, Duration::from_millis(50))?;
            timings.uploaded_bytes += arrived.bytes;
            for copy in &arrived.copies {
                if !copy.wait(COPY_TIMEOUT)? {
                    return Err(RenderError::Internal("a copy to the device did not finish".into()));
                }
            }
            for asset in arrived.ready.iter().chain(&arrived.mapped) {
                on_the_way = on_the_way.saturating_sub(self.assets.catalog.bytes(*asset));
                patience.came(Instant::now());
            }
            gate.shared().wait_for_loads(
                &mut patience,
                "texture tile",
                self.store.in_flight() + self.store.mapping(),
                device.loader()?.lives(),
            )?;
        }
        let mut shown = wanted;
        shown.sort_unstable();
        for &asset in &shown {
            self.show(asset);
        }
        timings.tile_secs += started.elapsed().as_secs_f64();
        timings.tiles += shown.len() as u64;
        timings.tile_bytes += bytes;
        Ok(TilesOutcome::All(shown))
    }

    /// Begins to load a tile into host memory, if that is allowed.
    fn maps_tile(&mut self, device: &Device, asset: AssetId) -> Result<bool, RenderError> {
        match self.assets.source(asset) {
            Some(source) if self.maps_tiles => self.store.map_now(device, (asset, source)),
            _ => Ok(false),
        }
    }

    /// Drops tiles that other frames have loaded if the scene takes more than `cap` bytes.
    pub(crate) fn keep_within(&mut self, cap: u64) {
        if self.store.bytes() <= cap {
            return;
        }
        let textures = &self.assets.textures;
        let tiles: Vec<(u64, u32)> = self.store.tiles().filter(|(image, _)| textures.has(*image)).collect();
        for (image, tile) in tiles {
            self.store.evict(&AssetKey::Tile(image, tile));
        }
        self.forget_tables();
    }

    /// The absent ones of `tiles`, in the order of loading: the first of each image, then the second of each, so that
    /// several files are decoded at a time.
    fn missing_tiles(&self, tiles: &[u32]) -> Vec<AssetId> {
        let mut seen: FxHashMap<u64, u32> = FxHashMap::default();
        let mut wanted: Vec<(u32, AssetId)> = Vec::with_capacity(tiles.len());
        for &tile in tiles {
            let Some((image, number)) = self.assets.textures.locate(tile) else { continue };
            let asset = self.assets.first_tile() + tile;
            if self.assets.key(asset).is_none_or(|key| self.store.reached(&key).is_some()) {
                continue;
            }
            image.expect(number);
            let turn = seen.entry(image.id()).or_default();
            wanted.push((*turn, asset));
            *turn += 1;
        }
        wanted.sort_unstable();
        wanted.into_iter().map(|(_, asset)| asset).collect()
    }

    /// Bytes of the resident tiles.
    pub(crate) fn tile_bytes_held(&self) -> u64 {
        let textures = &self.assets.textures;
        let tiles = self.store.tiles().filter_map(|(image, tile)| textures.number_of(image, tile));
        tiles.map(|tile| self.assets.catalog.bytes(self.assets.first_tile() + tile)).sum()
    }

    /// Records the table entries of assets that have arrived.
    pub(crate) fn write_entries(&self, commands: &mut CommandList, assets: &[AssetId]) {
        if let Some(tables) = self.tables() {
            commands.concurrent(|c| {
                tables.update(c, &self.assets, self.entries(), assets);
            });
        }
    }
}
