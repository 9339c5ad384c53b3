// SPDX-License-Identifier: Apache-2.0
//! What was found out about one surface. Pure.

use glam::{DAffine3, DVec3};

use super::{BoundingSphere, DicingCamera, stretch};
use crate::mesh::{CameraEye, DicingRate};

/// Places of the camera that are kept for a surface; what more there are count by their density.
const MOST_EYES: usize = 8;
/// Smallest distance from an edge that counts, as a share of the surface's radius.
const NEAREST_EDGE: f64 = 1e-3;

/// A near placement, in the surface's own frame.
#[derive(Debug)]
struct NearSurface {
    /// The camera's distance from the middle.
    distance: f64,
    eye: CameraEye,
    /// Pixels of a unit of length, for the surface as a whole.
    density: f64,
}

/// How the placements of one surface are seen, in its own frame.
#[derive(Debug, Default)]
pub(super) struct SurfaceDensity {
    density: f64,
    /// Nearest first.
    near: Vec<NearSurface>,
}

impl SurfaceDensity {
    /// It covers so many pixels a unit, at least.
    pub(super) fn cover(&mut self, density: f64) {
        self.density = self.density.max(density);
    }

    /// A placement: `ball` in the world, `radius` in its own frame.
    pub(super) fn see(&mut self, camera: &DicingCamera, ball: &BoundingSphere, radius: f64, map: &DAffine3) {
        let density = camera.density_in(ball.center, ball.radius, ball.distance(camera.position)) * stretch(map);
        let inverse = map.inverse();
        let is_far = !ball.is_near(camera.position) || !camera.is_in_picture(ball.center, ball.radius);
        let nearest = power_below(NEAREST_EDGE * radius);
        if is_far || camera.focal == 0.0 || nearest == 0.0 || !inverse.is_finite() {
            self.cover(density);
            return;
        }
        let distance = ball.center.distance(camera.position) / stretch(map);
        let step = power_below(f64::max((distance - radius) / 4.0, nearest));
        let snap = |v: f64| (v / step).round() * step;
        let position = inverse.transform_point3(camera.position);
        let position = DVec3::new(snap(position.x), snap(position.y), snap(position.z));
        self.near.push(NearSurface { distance, eye: CameraEye { position, nearest }, density });
        self.forget();
    }

    /// Adds what was found of a surface with the same content.
    pub(super) fn add(&mut self, other: Self) {
        self.cover(other.density);
        self.near.extend(other.near);
        self.forget();
    }

    fn forget(&mut self) {
        self.near.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        let rest = self.near.iter().skip(MOST_EYES).map(|near| near.density).fold(0.0, f64::max);
        self.near.truncate(MOST_EYES);
        self.cover(rest);
    }

    /// How finely the surface is cut.
    pub(super) fn dicing(&self, camera: &DicingCamera) -> DicingRate {
        let eyes = self.near.iter().map(|near| near.eye).collect();
        DicingRate { pixels: camera.pixels, density: half_power_above(self.density), focal: camera.focal, eyes }
    }
}

/// The next half power of two.
fn half_power_above(density: f64) -> f64 {
    if density > 0.0 && density.is_finite() { ((density.log2() * 2.0).ceil() / 2.0).exp2() } else { 0.0 }
}

/// The power of two below; 0 where there is none.
fn power_below(length: f64) -> f64 {
    if length > 0.0 && length.is_finite() { length.log2().floor().exp2() } else { 0.0 }
}
