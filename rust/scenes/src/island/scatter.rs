// SPDX-License-Identifier: Apache-2.0
//! Where instances stand: drawn from a species' density, put on the terrain's mesh, written into instance arrays.
//!
//! Placement i depends on the seed, the species and i only; arrays are filled in parallel.

use glam::{DQuat, DVec3};
use half::f16;
use rayon::prelude::*;

use super::land::{Habitat, Land};
use super::plants::{Place, Species};
use super::random::Random;

/// Placements filled by one task.
const TASK: usize = 1 << 12;
/// Prime and above every instance count: a stride that visits all of `0..n` in a mixed order.
const STRIDE: u64 = 4_294_967_291;

/// The terrain as its mesh has it, so that things stand on what is drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ground<'a> {
    /// Of a square grid of `side * side` quads, rows along z.
    pub(crate) points: &'a [[f32; 3]],
    /// Quads along one side.
    pub(crate) side: u32,
    /// Half the side's length, metres.
    pub(crate) half: f64,
}

impl Ground<'_> {
    /// Height and unit normal.
    pub(crate) fn at(&self, x: f64, z: f64) -> (f64, DVec3) {
        let cells = f64::from(self.side);
        let cell = 2.0 * self.half / cells;
        let along = |v: f64| ((v + self.half) / cell).clamp(0.0, cells - 1e-6);
        let (u, v) = (along(x), along(z));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the grid")]
        let (column, row) = (u as usize, v as usize);
        let first = row * (self.side as usize + 1) + column;
        let height = |k: usize| self.points.get(k).map_or(0.0, |p| f64::from(p[1]));
        let below = first + self.side as usize + 1;
        let corners = [height(first), height(first + 1), height(below), height(below + 1)];
        let (fx, fz) = (u.fract(), v.fract());
        let [a, b, c, d] = corners;
        let (near, far) = (a + (b - a) * fx, c + (d - c) * fx);
        let (west, east) = (a + (c - a) * fz, b + (d - b) * fz);
        (near + (far - near) * fz, DVec3::new(west - east, cell, near - far).normalize())
    }
}

/// Draws places in proportion to a density that is constant in each cell of a grid.
#[derive(Debug)]
pub(crate) struct Sampler {
    side: u32,
    half: f64,
    /// Sum of the densities of all cells up to and with this one.
    sums: Vec<f64>,
}

impl Sampler {
    /// `stream` tells the species' patches from others'; nothing comes within `clearing` metres of `eye`.
    pub(crate) fn new(land: &Land, habitat: Habitat, stream: u64, side: u32, eye: DVec3, clearing: f64) -> Self {
        let cell = 2.0 * land.half / f64::from(side);
        let rows = 0..side;
        let mut sums: Vec<f64> = rows
            .into_par_iter()
            .flat_map_iter(|row| (0..side).map(move |column| (row, column)))
            .map(|(row, column)| {
                let middle = |k: u32| (f64::from(k) + 0.5) * cell - land.half;
                let (x, z) = (middle(column), middle(row));
                // A cell's diagonal keeps the clearing clear up to its corners.
                let is_near = DVec3::new(x - eye.x, 0.0, z - eye.z).length() < clearing + 0.71 * cell;
                if is_near { 0.0 } else { land.density(habitat, x, z, stream) }
            })
            .collect();
        let mut sum = 0.0;
        for value in &mut sums {
            sum += *value;
            *value = sum;
        }
        Self { side, half: land.half, sums }
    }

    /// The place that `at` in [0, 1) of the density lies before, anywhere in its cell.
    pub(crate) fn draw(&self, at: f64, random: &mut Random) -> (f64, f64) {
        let wanted = at * self.sums.last().copied().unwrap_or(0.0);
        let index = self.sums.partition_point(|&sum| sum <= wanted).min(self.sums.len().saturating_sub(1));
        let (row, column) = (index / self.side as usize, index % self.side as usize);
        let cell = 2.0 * self.half / f64::from(self.side);
        #[expect(clippy::cast_precision_loss, reason = "cells of a grid")]
        let mut spread = |k: usize| (k as f64 + random.unit()) * cell - self.half;
        (spread(column), spread(row))
    }
}

/// Everything that places one species.
#[derive(Debug)]
pub(crate) struct Scatter<'a> {
    pub(crate) species: &'a Species,
    pub(crate) ground: Ground<'a>,
    pub(crate) sampler: Sampler,
    /// Placements in all.
    pub(crate) count: u64,
    /// Seed and species.
    pub(crate) key: [u64; 2],
}

impl Scatter<'_> {
    /// Placement `i`.
    pub(crate) fn place(&self, i: u64) -> Place {
        let mut random = Random::new(&[self.key[0], self.key[1], i]);
        #[expect(clippy::cast_precision_loss, reason = "a fraction of the density")]
        let at = ((i * STRIDE % self.count.max(1)) as f64 + random.unit()) / self.count as f64;
        let (x, z) = self.sampler.draw(at, &mut random);
        let [low, high] = self.species.scale;
        let scale = match self.species.is_log {
            // Squared towards the small ones.
            true => low * (high / low).powf(random.unit().powf(1.6)),
            false => random.range(low, high),
        };
        let (height, normal) = self.ground.at(x, z);
        let up = DVec3::Y.lerp(normal, self.species.lean).normalize();
        let turn = DQuat::from_rotation_arc(DVec3::Y, up) * DQuat::from_rotation_y(random.angle());
        Place { at: DVec3::new(x, height - self.species.sink * scale, z), turn, scale }
    }
}

/// Instance arrays, ready to be borrowed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    pub(crate) translations: Vec<[f32; 3]>,
    /// i, j, k, real.
    pub(crate) rotations: Vec<[f16; 4]>,
    pub(crate) scales: Vec<[f32; 3]>,
}

impl Places {
    /// `each` instances for each of the placements `0..count`: `fill(i, put)` puts those of placement i, in order.
    pub(crate) fn new(count: usize, each: usize, fill: impl Fn(u64, &mut dyn FnMut(Place)) + Sync) -> Self {
        let total = count * each;
        let mut places = Self {
            translations: vec![[0.0; 3]; total],
            rotations: vec![[f16::ZERO; 4]; total],
            scales: vec![[0.0; 3]; total],
        };
        let task = TASK * each.max(1);
        places
            .translations
            .par_chunks_mut(task)
            .zip(places.rotations.par_chunks_mut(task))
            .zip(places.scales.par_chunks_mut(task))
            .enumerate()
            .for_each(|(chunk, ((translations, rotations), scales))| {
                let mut slots = translations.iter_mut().zip(rotations).zip(scales);
                let first = chunk * TASK;
                for i in first..(first + TASK).min(count) {
                    fill(i as u64, &mut |place| {
                        if let Some(((translation, rotation), scale)) = slots.next() {
                            *translation = place.at.as_vec3().to_array();
                            *rotation = place.turn.to_array().map(f16::from_f64);
                            *scale = DVec3::splat(place.scale).as_vec3().to_array();
                        }
                    });
                }
            });
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_are_filled_in_order() {
        let places = Places::new(TASK + 3, 2, |i, put| {
            for part in 0..2 {
                #[expect(clippy::cast_precision_loss, reason = "small numbers")]
                let at = DVec3::new(i as f64, f64::from(part), 0.0);
                put(Place { at, turn: DQuat::IDENTITY, scale: 2.0 });
            }
        });
        assert_eq!(places.translations.len(), 2 * TASK + 6, "two each");
        assert_eq!(places.translations[2 * TASK + 5], [4098.0, 1.0, 0.0], "the last one");
        assert_eq!(places.scales[7], [2.0; 3], "all are written");
    }

    #[test]
    fn draws_follow_the_density() {
        let sampler = Sampler { side: 2, half: 1.0, sums: vec![0.0, 3.0, 3.0, 4.0] };
        let mut random = Random::new(&[5]);
        let draws: Vec<(f64, f64)> = (0..400).map(|i| sampler.draw(f64::from(i) / 400.0, &mut random)).collect();
        let dense = draws.iter().filter(|(x, z)| *x >= 0.0 && *z < 0.0).count();
        assert_eq!(dense, 300, "three quarters go to the cell of three quarters");
        assert!(draws.iter().all(|(x, _)| *x >= 0.0), "nothing where the density is zero");
    }

    #[test]
    fn ground_is_the_plane_through_its_points() {
        let height = |x: f32, z: f32| 0.5 * x - 0.25 * z + 1.0;
        let line = [-2.0_f32, 0.0, 2.0];
        let points: Vec<[f32; 3]> = line.iter().flat_map(|&z| line.map(|x| [x, height(x, z), z])).collect();
        let ground = Ground { points: &points, side: 2, half: 2.0 };
        let (y, normal) = ground.at(1.3, -0.7);
        assert!((y - f64::from(height(1.3, -0.7))).abs() < 1e-6, "{y}");
        assert!(normal.angle_between(DVec3::new(-0.5, 1.0, 0.25)) < 1e-6, "{normal}");
    }
}
