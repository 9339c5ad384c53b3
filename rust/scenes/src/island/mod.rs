// SPDX-License-Identifier: Apache-2.0
//! The island: a generated stand-in for Disney's Moana island, with its statistics at full size (39.3 M instances
//! flattened, 261 M unique quads): few large unique meshes, many small plants in nested clumps, a beach full of
//! pebbles, sizes over three orders of magnitude and density over more.
//!
//! A pure function of [`Parameters`], made on the rayon pool. The result is a list of prims ([`Prims`]), which goes
//! into a [`SceneDb`] or to a USD file.

mod land;
mod plants;
mod prims;
mod random;
mod scatter;
mod soup;
mod species;
mod uniques;
mod view;

use anyhow::{Result, ensure};
use oocpt_core::scene::SceneDb;

use land::Land;
use plants::Plants;
pub use prims::Prims;
pub(crate) use random::Random;
use scatter::{Ground, Sampler, Scatter};
use uniques::Unique;
pub use view::{StageCamera, camera, stage_camera};

/// Quads of an instanced mesh, mean over all instances, of the full-size island (82.4 G / 39.3 M).
const QUADS_PER_INSTANCE: f64 = 2097.0;
/// Largest part of the unique quads that goes to instanced meshes.
const INSTANCED_PART: f64 = 0.35;

/// What determines an island.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::Args, serde::Serialize)]
pub struct Parameters {
    /// Placements of meshes on one island, nesting multiplied out.
    #[arg(long, default_value_t = 1_000_000)]
    pub instances: u64,
    /// Quads of all unique meshes together.
    #[arg(long, default_value_t = 1_000_000)]
    pub unique_quads: u64,
    /// Islands.
    #[arg(long, default_value_t = 1)]
    pub copies: u32,
    /// No nesting: every placement is an instance of the world. Copies share their arrays all the same.
    #[arg(long)]
    pub flatten: bool,
    /// With `--flatten`: plants of each island stand elsewhere, so that no array is shared.
    #[arg(long, requires = "flatten")]
    pub distinct: bool,
    /// Another seed, another island.
    #[arg(long, default_value_t = 7)]
    pub seed: u64,
}

impl Parameters {
    fn check(&self) -> Result<()> {
        ensure!((10_000..=4_000_000_000).contains(&self.instances), "--instances: 10 000 to 4 000 000 000");
        ensure!((10_000..=4_000_000_000).contains(&self.unique_quads), "--unique-quads: 10 000 to 4 000 000 000");
        ensure!((1..=10_000).contains(&self.copies), "--copies: 1 to 10 000");
        Ok(())
    }

    /// Placements of meshes in the scene: the islands' and the ocean.
    pub fn total_instances(&self) -> u64 {
        self.instances * u64::from(self.copies) + 1
    }
}

/// One island, made.
#[derive(Debug)]
struct Island {
    land: Land,
    uniques: Vec<Unique>,
    plants: Plants,
    /// Placements of each species.
    counts: Vec<u64>,
    seed: u64,
}

impl Island {
    fn new(parameters: &Parameters) -> Self {
        let Parameters { instances, unique_quads, seed, .. } = *parameters;
        let land = Land::new(instances, seed);
        let mut plants = Plants::new(seed);
        let trees = uniques::tree_count(unique_quads);
        let counts = counts(&plants, instances - uniques::count(trees));
        plants.make_shapes(unit(&plants, &counts, instances, unique_quads), seed);
        let instanced: u64 = plants.shapes.iter().map(|shape| shape.soup.quads.len() as u64).sum();
        let left = unique_quads.saturating_sub(instanced + uniques::OCEAN_QUADS);
        let uniques = uniques::make(&land, left, trees, seed);
        Self { land, uniques, plants, counts, seed }
    }

    fn ground(&self) -> Ground<'_> {
        let terrain = &self.uniques[0].soup;
        let side = soup::side_of(terrain.quads.len() as u64, 1);
        Ground { points: &terrain.points, side, half: self.land.half }
    }

    /// What places species number `k` of an island that is distinct from those of other numbers.
    fn scatter(&self, k: usize, island: u32) -> Scatter<'_> {
        let species = &self.plants.species[k];
        let stream = k as u64 + 1;
        // Fine enough for the smallest patches, coarse enough to be cheap for small islands.
        let side = soup::side_of(self.counts.iter().sum::<u64>().clamp(1 << 12, 1 << 18), 1);
        let eye = view::eye(&self.land);
        let sampler = Sampler::new(&self.land, species.habitat, stream, side, eye, species.clearing);
        Scatter {
            species,
            ground: self.ground(),
            sampler,
            count: self.counts[k],
            key: [self.seed.wrapping_add(u64::from(island) << 32), stream],
        }
    }
}

/// Placements of each species, such that the meshes they place are exactly `instances`.
fn counts(plants: &Plants, instances: u64) -> Vec<u64> {
    let sizes: Vec<u64> = plants.species.iter().map(|s| plants.flat(s.variants[0]).len() as u64).collect();
    let mut counts: Vec<u64> = plants
        .species
        .iter()
        .zip(&sizes)
        .map(|(species, &size)| {
            #[expect(
                clippy::cast_precision_loss,
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a share; the rest is counted exactly"
            )]
            let count = (species.share * instances as f64) as u64 / size;
            count
        })
        .collect();
    let placed: u64 = counts.iter().zip(&sizes).map(|(count, size)| count * size).sum();
    // The last species are single meshes: they take up what is left over.
    if let Some(last) = counts.last_mut() {
        *last += instances - placed;
    }
    counts
}

/// Quads of a shape of weight 1: as many as make the mean instance as heavy as Moana's, if the unique quads allow it.
#[expect(clippy::cast_precision_loss, reason = "a target, not a count")]
fn unit(plants: &Plants, counts: &[u64], instances: u64, unique_quads: u64) -> f64 {
    let weights = plants::weights();
    let mut placed = 0.0;
    for (species, &count) in plants.species.iter().zip(counts) {
        for variant in &species.variants {
            let flat: f64 = plants.flat(*variant).iter().map(|(shape, _)| weights[*shape]).sum();
            placed += flat * count as f64 / species.variants.len() as f64;
        }
    }
    let wanted = QUADS_PER_INSTANCE * instances as f64 / placed;
    wanted.min(INSTANCED_PART * unique_quads as f64 / weights.iter().sum::<f64>())
}

/// Fills `db` with the scene; gives what was put in.
pub fn build(db: &mut SceneDb, parameters: &Parameters) -> Result<Prims> {
    let prims = Prims::new(parameters)?;
    prims.insert(db);
    Ok(prims)
}

#[cfg(test)]
mod tests;
