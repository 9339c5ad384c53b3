// SPDX-License-Identifier: Apache-2.0
//! Synthetic scenes: a square of units with blocks of uneven size, and meshes that they share.

use super::super::{AssetId, CatalogError, UnitCatalog, UnitId};
use super::random::SplitMix;
use std::sync::Arc;

/// Parameters of a scene and its paths.
#[derive(Clone, Copy, Debug)]
pub struct SceneOptions {
    /// Seed of all random choices.
    pub seed: u64,
    /// Number of units along a side of the square.
    pub side: u32,
    /// Mean bytes of a unit's own block; blocks vary by a factor of 16.
    pub block_bytes: u64,
    /// Number of meshes in the scene.
    pub meshes: u32,
    /// Mean bytes of a mesh.
    pub mesh_bytes: u64,
    /// Number of meshes that a unit uses, popular ones more often.
    pub meshes_per_unit: u32,
    /// Number of paths.
    pub paths: u32,
    /// Number of rays of a path.
    pub bounces: u8,
    /// Mean number of units a ray crosses up to its hit.
    pub crossed: u32,
    /// Share of the rays after the first that begin far from the end of the last one (0 = all near).
    pub scattered: f64,
    /// True if scattered rays prefer popular units.
    pub popular: bool,
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

/// A synthetic scene.
#[derive(Clone, Debug)]
pub struct SimulatedScene {
    /// Parameters of the scene.
    pub options: SceneOptions,
    /// Units and assets of the scene.
    pub catalog: Arc<UnitCatalog>,
}

impl SimulatedScene {
    /// Makes the scene.
    pub fn new(options: SceneOptions) -> Result<Self, CatalogError> {
        let units = options.side.saturating_mul(options.side);
        let mut bytes = Vec::new();
        for asset in 0..units.saturating_add(options.meshes) {
            let mean = if asset < units { options.block_bytes } else { options.mesh_bytes };
            let mut random = SplitMix::of([options.seed, 1, u64::from(asset)]);
            // 1/4 to 4 times, mean about 1.1.
            let scale = random.below(5);
            bytes.push((mean / 4).max(1) << scale.min(random.below(5)));
        }
        let row = |unit: UnitId| {
            let mut random = SplitMix::of([options.seed, 2, u64::from(unit)]);
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
    pub fn budget(&self, percent: u64) -> u64 {
        (self.catalog.total_bytes() / 100).saturating_mul(percent).max(self.catalog.least_budget())
    }
}
