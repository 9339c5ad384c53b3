// SPDX-License-Identifier: Apache-2.0
//! The large meshes that appear once: terrain, reefs, big trees; and the ocean. Pure; any thread.

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use super::land::{Habitat, Land};
use super::plants::Place;
use super::random::Random;
use super::scatter::{Ground, Sampler};
use super::soup::{Soup, lump, side_of, tree};
use super::view;

/// Quads of the ocean.
pub(crate) const OCEAN_QUADS: u64 = 64;
/// Reefs.
const REEFS: u64 = 3;
/// Part of the unique quads that is terrain, and reefs together.
const TERRAIN_PART: f64 = 0.22;
const REEF_PART: f64 = 0.10;
/// Quads of a tree of the full-size island.
const TREE_QUADS: u64 = 2_500_000;

/// A mesh that appears once on an island.
#[derive(Debug)]
pub(crate) struct Unique {
    pub(crate) name: String,
    pub(crate) soup: Soup,
    pub(crate) place: Place,
}

/// Trees of an island with so many unique quads.
pub(crate) fn tree_count(unique_quads: u64) -> u64 {
    (unique_quads / TREE_QUADS).clamp(7, 400)
}

/// Unique meshes in all.
pub(crate) fn count(trees: u64) -> u64 {
    1 + REEFS + trees
}

/// The terrain first, then reefs, then trees: exactly `quads` quads in all.
pub(crate) fn make(land: &Land, quads: u64, trees: u64, seed: u64) -> Vec<Unique> {
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share; the trees take the exact rest"
    )]
    let part = |share: f64| (quads as f64 * share) as u64;
    let side = side_of(part(TERRAIN_PART), 1);
    let identity = Place { at: DVec3::ZERO, turn: DQuat::IDENTITY, scale: 1.0 };
    let terrain = terrain(land, side);
    let mut uniques: Vec<Unique> =
        (0..REEFS).into_par_iter().map(|k| reef(land, k, part(REEF_PART) / REEFS, seed)).collect();
    uniques.insert(0, Unique { name: "Terrain".into(), soup: terrain, place: identity });
    let used: u64 = uniques.iter().map(|unique| unique.soup.quads.len() as u64).sum();
    let left = quads.saturating_sub(used);
    let ground = Ground { points: &uniques[0].soup.points, side, half: land.half };
    let spots = tree_spots(land, ground, trees, seed);
    let made: Vec<Unique> = spots
        .into_par_iter()
        .enumerate()
        .with_max_len(1)
        .map(|(k, place)| {
            let k = k as u64;
            let mut random = Random::new(&[seed, 0x7e, k]);
            let share = left * (k + 1) / trees - left * k / trees;
            let height = random.range(0.7, 1.25) * (5.0 + 0.09 * land.half).min(21.0);
            Unique { name: format!("Tree_{k}"), soup: tree(share, height, &mut random), place }
        })
        .collect();
    uniques.extend(made);
    uniques
}

/// The ground: a grid of `side * side` quads over the island's square.
fn terrain(land: &Land, side: u32) -> Soup {
    let cell = 2.0 * land.half / f64::from(side);
    let at = |k: u32| f64::from(k) * cell - land.half;
    let rows: Vec<Vec<[[f32; 3]; 3]>> = (0..=side)
        .into_par_iter()
        .map(|row| {
            let vertex = |column: u32| {
                let (x, z) = (at(column), at(row));
                let normal = land.normal(x, z);
                let point = DVec3::new(x, land.height(x, z), z);
                [point, normal, land.color(x, z, normal)].map(|v| v.as_vec3().to_array())
            };
            (0..=side).map(vertex).collect()
        })
        .collect();
    let all = |k: usize| rows.iter().flatten().map(move |vertex| vertex[k]).collect();
    let mut soup = Soup { points: all(0), normals: all(1), colors: all(2), ..Soup::default() };
    soup.quads.reserve(side as usize * side as usize);
    for row in 0..i64::from(side) {
        for column in 0..i64::from(side) {
            let first = row * i64::from(side + 1) + column;
            let below = first + i64::from(side) + 1;
            // Below 2^31 for sides below 46 000; 4 G quads at 22 % stay below that.
            soup.quads.push([first, below, below + 1, first + 1].map(|k| i32::try_from(k).unwrap_or(i32::MAX)));
        }
    }
    soup
}

/// A coral rock that stands out of the shallows in front of the beach.
fn reef(land: &Land, k: u64, quads: u64, seed: u64) -> Unique {
    let mut random = Random::new(&[seed, 0x4e, k]);
    #[expect(clippy::cast_precision_loss, reason = "a few")]
    let angle = 1.15 + 0.55 * k as f64 + random.range(-0.1, 0.1);
    let radius = random.range(0.80, 0.86) * land.half;
    let size = random.range(0.035, 0.06) * land.half;
    let extent = DVec3::new(1.0, random.range(0.35, 0.6), random.range(0.6, 1.0)) * size;
    let color = DVec3::new(0.27, 0.20, 0.17) * random.range(0.7, 1.2);
    let soup = lump(quads, DVec3::ZERO, extent, 0.35, color, &mut random);
    let at = DVec3::new(angle.cos() * radius, -0.1 * size, angle.sin() * radius);
    Unique {
        name: format!("Reef_{k}"),
        soup,
        place: Place { at, turn: DQuat::from_rotation_y(random.angle()), scale: 1.0 },
    }
}

/// Where the trees stand.
fn tree_spots(land: &Land, ground: Ground<'_>, trees: u64, seed: u64) -> Vec<Place> {
    let sampler = Sampler::new(land, Habitat::Hills, 0, 96, view::eye(land), 0.12 * land.half);
    let spot = |k: u64| {
        let mut random = Random::new(&[seed, 0x5b, k]);
        let (x, z) = sampler.draw(random.unit(), &mut random);
        let (height, _) = ground.at(x, z);
        Place { at: DVec3::new(x, height - 0.1, z), turn: DQuat::from_rotation_y(random.angle()), scale: 1.0 }
    };
    (0..trees).map(spot).collect()
}

/// The sea, far beyond all islands: level, so that a few quads do.
pub(crate) fn ocean(half: f64) -> Soup {
    let mut soup = Soup::of_color(DVec3::new(0.025, 0.13, 0.17));
    let side = 8_i32;
    for row in 0..=side {
        for column in 0..=side {
            let at = |k: i32| half * (2.0 * f64::from(k) / f64::from(side) - 1.0);
            soup.points.push(DVec3::new(at(column), 0.0, at(row)).as_vec3().to_array());
        }
    }
    for first in (0..side).flat_map(|row| (0..side).map(move |column| row * (side + 1) + column)) {
        let below = first + side + 1;
        soup.quads.push([first, below, below + 1, first + 1]);
    }
    soup
}
