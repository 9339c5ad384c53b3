// SPDX-License-Identifier: Apache-2.0
//! Synthetic scenes: a square of units with blocks of uneven size and meshes they share.

use super::random::Random;
use oocpt_core::residency::{AssetId, CatalogError, UnitCatalog, UnitId};
use std::sync::Arc;

/// What a scene and its paths are like.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SceneOptions {
    /// Seed of everything.
    pub(crate) seed: u64,
    /// Units along a side of the square.
    pub(crate) side: u32,
    /// Mean bytes of a unit's own block; blocks vary by a factor of 16.
    pub(crate) block_bytes: u64,
    /// Meshes in the scene.
    pub(crate) meshes: u32,
    /// Mean bytes of a mesh.
    pub(crate) mesh_bytes: u64,
    /// Meshes a unit uses, popular ones more often.
    pub(crate) meshes_per_unit: u32,
    /// Paths to trace.
    pub(crate) paths: u32,
    /// Rays of a path.
    pub(crate) bounces: u8,
    /// Mean number of units a ray crosses up to its hit.
    pub(crate) crossed: u32,
    /// Share of the rays after the first that begin nowhere near where the last one ended (0 = all near).
    pub(crate) scattered: f64,
    /// Units of a scattered ray are popular ones (else any).
    pub(crate) popular: bool,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            side: 32,
            block_bytes: 2 << 20,
            meshes: 512,
            mesh_bytes: 1 << 20,
            meshes_per_unit: 6,
            paths: 32_768,
            bounces: 4,
            crossed: 3,
            scattered: 0.1,
            popular: true,
        }
    }
}

/// A scene to be traced.
#[derive(Clone, Debug)]
pub(crate) struct Workload {
    /// How it was made.
    pub(crate) options: SceneOptions,
    /// Its units and assets.
    pub(crate) catalog: Arc<UnitCatalog>,
}

impl Workload {
    /// Makes the scene.
    pub(crate) fn new(options: SceneOptions) -> Result<Self, CatalogError> {
        let units = options.side.saturating_mul(options.side);
        let mut bytes = Vec::new();
        for asset in 0..units.saturating_add(options.meshes) {
            let mean = if asset < units { options.block_bytes } else { options.mesh_bytes };
            let mut random = Random::of([options.seed, 1, u64::from(asset)]);
            // 1/4 to 4 times, mean about 1.1.
            let scale = random.below(5);
            bytes.push((mean / 4).max(1) << scale.min(random.below(5)));
        }
        let row = |unit: UnitId| {
            let mut random = Random::of([options.seed, 2, u64::from(unit)]);
            let mut row: Vec<AssetId> = vec![unit];
            for _ in 0..options.meshes_per_unit {
                if options.meshes > 0 {
                    row.push(units + random.zipf(options.meshes));
                }
            }
            row
        };
        let catalog = UnitCatalog::new(bytes, (0..units).map(row))?;
        Ok(Self { options, catalog: Arc::new(catalog) })
    }

    /// The budget that is this percentage of all bytes, or the smallest possible one.
    pub(crate) fn budget(&self, percent: u64) -> u64 {
        (self.catalog.total_bytes() / 100).saturating_mul(percent).max(self.catalog.least_budget())
    }
}
