// SPDX-License-Identifier: Apache-2.0
//! A small path tracer in f64: triangles, Lambert, constant domes, distant lights. It shares no code with the renderer:
//! own scene, tree, intersection, random numbers, cameras and estimator (no next event estimation for domes, no
//! roulette).
//!
//! A path that leaves a triangle does not meet this triangle again; neighbours are met from 1e-14 of the scene's size
//! on.

pub(crate) mod bvh;
pub(crate) mod camera;
mod random;

#[cfg(test)]
mod tests;

use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

use bvh::{Bvh, Ray};
use camera::Eye;
use random::Random;

/// Light from a cone of directions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sun {
    /// Unit, towards the light.
    pub(crate) direction: DVec3,
    /// On a surface that faces it.
    pub(crate) irradiance: f64,
    /// Of half its angle; 0: one direction.
    pub(crate) one_minus_cos: f64,
}

/// Triangles with an albedo each, and lights.
pub(crate) struct Tracer {
    bvh: Bvh,
    albedo: Vec<f64>,
    /// Radiance from everywhere.
    pub(crate) dome: f64,
    pub(crate) suns: Vec<Sun>,
    least: f64,
}

/// A picture: mean and variance of one sample, pixel by pixel, bottom row first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Estimate {
    pub(crate) mean: Vec<f64>,
    pub(crate) variance: Vec<f64>,
    pub(crate) samples: u32,
}

/// What a ray meets first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Met {
    /// Distance in units of the ray's direction.
    pub(crate) t: f64,
    /// Unit; either side.
    pub(crate) normal: DVec3,
    /// Cosine between the ray and the triangle's normal.
    pub(crate) cosine: f64,
}

impl Tracer {
    /// A scene without light.
    pub(crate) fn new(triangles: Vec<([DVec3; 3], f64)>) -> Self {
        let (corners, albedo): (Vec<_>, Vec<_>) = triangles.into_iter().unzip();
        let all = || corners.iter().flatten().copied();
        let size = all().fold(DVec3::NEG_INFINITY, DVec3::max) - all().fold(DVec3::INFINITY, DVec3::min);
        let least = if corners.is_empty() { 0.0 } else { size.max_element() * 1e-14 };
        Self { bvh: Bvh::new(corners), albedo, dome: 0.0, suns: Vec::new(), least }
    }

    /// The first triangle on a ray.
    pub(crate) fn first(&self, ray: &Ray) -> Option<Met> {
        let hit = self.bvh.nearest(ray, f64::INFINITY, None)?;
        let normal = self.normal(hit.triangle);
        Some(Met { t: hit.t, normal, cosine: normal.dot(ray.d.normalize()).abs() })
    }

    fn normal(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.bvh.corners(triangle);
        // Lengths first: products of tiny or huge edges leave f64's range later than squares of them.
        let (e, f) = (b - a, c - a);
        e.normalize_or_zero().cross(f.normalize_or_zero()).normalize_or_zero()
    }

    /// Radiance along a ray; surfaces reflect up to `bounces` more times after the first. The dome is seen by camera
    /// rays if `sees_dome`.
    fn radiance(&self, mut ray: Ray, bounces: u32, sees_dome: bool, random: &mut Random) -> f64 {
        let mut sum = 0.0;
        let mut throughput = 1.0;
        let mut last = None;
        for bounce in 0.. {
            let Some(hit) = self.bvh.nearest(&ray, f64::INFINITY, last) else {
                let seen = if bounce > 0 || sees_dome { self.dome } else { 0.0 };
                return sum + throughput * seen;
            };
            if bounce > bounces {
                return sum;
            }
            let n = self.normal(hit.triangle);
            let n = if n.dot(ray.d) > 0.0 { -n } else { n };
            let p = ray.o + ray.d * hit.t + n * self.least;
            throughput *= self.albedo[hit.triangle];
            sum += throughput * self.suns_at(p, n, hit.triangle, random);
            ray = Ray { o: p, d: random.cosine(n) };
            last = Some(hit.triangle);
        }
        sum
    }

    /// Reflected radiance of a white surface.
    fn suns_at(&self, p: DVec3, n: DVec3, triangle: usize, random: &mut Random) -> f64 {
        let mut sum = 0.0;
        for sun in &self.suns {
            let one = sun.one_minus_cos <= 0.0;
            let d = if one { sun.direction } else { random.cone(sun.direction, sun.one_minus_cos) };
            // Radiance times solid angle; a cone's irradiance is its radiance times pi sin^2.
            let (h, tau) = (sun.one_minus_cos, 2.0 * PI);
            let power = if one { sun.irradiance } else { sun.irradiance * tau * h / (PI * h * (2.0 - h)) };
            if n.dot(d) > 0.0 && !self.bvh.is_blocked(&Ray { o: p, d }, f64::INFINITY, Some(triangle)) {
                sum += power * n.dot(d) / PI;
            }
        }
        sum
    }

    /// Renders what `eye` sees.
    pub(crate) fn render(&self, eye: &Eye, samples: u32, bounces: u32, sees_dome: bool) -> Estimate {
        let [width, height] = eye.size;
        let pixels: Vec<(f64, f64)> = (0..width * height)
            .into_par_iter()
            .map(|pixel| {
                let mut random = Random::new(0x5eed, u64::from(pixel));
                let (x, y) = (f64::from(pixel % width), f64::from(pixel / width));
                let (mut mean, mut squares) = (0.0, 0.0);
                for sample in 1..=samples {
                    let ray = eye.ray(x + random.uniform(), y + random.uniform());
                    let value = self.radiance(ray, bounces, sees_dome, &mut random);
                    let difference = value - mean;
                    mean += difference / f64::from(sample);
                    squares += difference * (value - mean);
                }
                (mean, squares / f64::from(samples.max(2) - 1))
            })
            .collect();
        let (mean, variance) = pixels.into_iter().unzip();
        Estimate { mean, variance, samples }
    }
}
