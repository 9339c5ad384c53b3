// SPDX-License-Identifier: Apache-2.0
//! What was found out about one surface. Pure.
//!
//! In a live view a surface keeps its rates as long as they are what the view needs or finer, and not much finer. New
//! ones are powers of two with some room above what is needed, places of the camera on a grid. What decides that a
//! place still serves: where a camera has moved by `d` and no part of the surface is nearer to it than `gap`, distances
//! from the old place are at most `1 + d / gap` times those from the new one, so a focal length that is larger by as
//! much makes up for it.

use glam::{DAffine3, DVec3, DVec4};

use super::DicingCamera;
use super::camera::DicingDensity;
use crate::mesh::{CameraEye, DicingRate};
use crate::scene::mesh_outline::{BoundingSphere, stretch};

/// Places of the camera that are kept for a surface; what more there are count by their density.
const MAX_EYES: usize = 8;
/// Smallest distance from an edge that counts, as a share of the surface's radius.
const NEAREST_EDGE: f64 = 1e-3;
/// The same in a live view, where each rebuilds the surface when the camera has moved by about as much.
const NEAREST_LIVE_EDGE: f64 = 1.0 / 32.0;
/// By how much a new focal length of a live view is larger than what is needed, at least.
const ROOM: f64 = 1.25;
/// Rates of a live view are at most so many times as fine as needed.
const MAX_FINENESS: f64 = 4.0;
/// Where the camera has come closer than the place that is kept, rates of a live view may be coarser by as much.
const COARSER_CLOSE: f64 = 2.0;
/// A place of a live view goes when the camera is so many gaps away.
const MAX_GAPS: f64 = 4.0;
/// Cells of the grid of places in a gap, at least; [`ROOM`] makes up for what rounding moves.
const GRID: f64 = 8.0;
/// What [`ROOM`] is for surfaces, for patches, whose edges have the nearest power of two: half a step less than wanted,
/// at most.
const PATCH_ROOM: f64 = std::f64::consts::SQRT_2;
/// A patch is measured edge by edge up to so many of its radii: as a whole, its far side were cut as its near side is.
const NEAR_PATCH: f64 = 8.0;
/// Smallest distance from an edge of a patch that counts in a live view, as a share of the patch's radius.
const NEAREST_LIVE_PATCH: f64 = 1.0 / 8.0;
/// By how much the focal length of a final view is larger than it is, for patches: a place on the grid is at most half
/// the diagonal of a cell away.
const GRID_ROOM: f64 = 1.0 + 0.8661 / GRID;

/// A near placement, in the surface's own frame.
#[derive(Clone, Copy, Debug)]
struct NearSurface {
    /// The camera's distance from the middle.
    distance: f64,
    eye: CameraEye,
    /// No part that counts is nearer to the camera.
    gap: f64,
    /// Pixels of a unit of length, for the surface as a whole.
    density: DicingDensity,
    is_in_picture: bool,
    /// Sides of the picture, for a patch in a final view.
    sides: Option<[DVec4; 5]>,
}

/// How the placements of one surface are seen, in its own frame.
#[derive(Clone, Debug, Default)]
pub(super) struct SurfaceDensity {
    density: DicingDensity,
    /// Nearest first. In a live view those that are out of the picture too.
    near: Vec<NearSurface>,
}

impl SurfaceDensity {
    /// It covers so many pixels a unit, at least.
    pub(super) fn cover(&mut self, density: DicingDensity) {
        self.density = self.density.max(density);
    }

    /// A placement: `ball` in the world, `radius` in its own frame.
    pub(super) fn see(&mut self, camera: &DicingCamera, ball: &BoundingSphere, radius: f64, map: &DAffine3) {
        let density =
            camera.density_in(ball.center, ball.radius, ball.distance(camera.position)).stretched(stretch(map));
        let inverse = map.inverse();
        let is_in_picture = camera.is_in_picture(ball.center, ball.radius);
        let is_far = !ball.is_near(camera.position) || (!is_in_picture && !camera.is_live);
        let nearest = power_below(if camera.is_live { NEAREST_LIVE_EDGE } else { NEAREST_EDGE } * radius);
        if is_far || camera.focal == 0.0 || nearest == 0.0 || !inverse.is_finite() {
            self.cover(density);
            return;
        }
        let distance = ball.center.distance(camera.position) / stretch(map);
        let gap = f64::max(distance - radius, nearest);
        let step = if camera.is_live { 0.0 } else { power_below(f64::max((distance - radius) / 4.0, nearest)) };
        let position = snapped(inverse.transform_point3(camera.position), step);
        let eye = CameraEye { position, nearest };
        self.near.push(NearSurface { distance, eye, gap, density, is_in_picture, sides: None });
        self.forget();
    }

    /// A placement of a patch: `ball` in the world, `radius` in the surface's own frame; `whole` is the radius of all
    /// of the surface.
    pub(super) fn see_patch(
        &mut self,
        camera: &DicingCamera,
        ball: &BoundingSphere,
        [radius, whole]: [f64; 2],
        map: &DAffine3,
    ) {
        let from = ball.center.distance(camera.position);
        let density =
            camera.density_in(ball.center, ball.radius, ball.distance(camera.position)).stretched(stretch(map));
        let inverse = map.inverse();
        let is_in_picture = camera.is_in_picture(ball.center, ball.radius);
        let is_far = from > NEAR_PATCH * ball.radius || (!is_in_picture && !camera.is_live);
        let share = if camera.is_live { NEAREST_LIVE_PATCH * radius } else { 0.0 };
        let nearest = power_below(f64::max(share, NEAREST_EDGE * whole));
        if is_far || camera.focal == 0.0 || nearest == 0.0 || !inverse.is_finite() {
            self.cover(density);
            return;
        }
        let distance = from / stretch(map);
        let gap = f64::max(distance - radius, nearest);
        let step = if camera.is_live { 0.0 } else { power_below(gap / GRID) };
        let eye = CameraEye { position: snapped(inverse.transform_point3(camera.position), step), nearest };
        let sides = if camera.is_live { None } else { camera.sides_in(map) };
        self.near.push(NearSurface { distance, eye, gap, density, is_in_picture, sides });
        self.forget();
    }

    /// Adds what was found of a surface with the same content.
    pub(super) fn add(&mut self, other: Self) {
        self.cover(other.density);
        self.near.extend(other.near);
        self.forget();
    }

    fn forget(&mut self) {
        self.near.sort_by(|a, b| b.is_in_picture.cmp(&a.is_in_picture).then(a.distance.total_cmp(&b.distance)));
        let rest = self.near.iter().skip(MAX_EYES).map(|near| near.density);
        let rest = rest.fold(DicingDensity::default(), DicingDensity::max);
        self.near.truncate(MAX_EYES);
        self.cover(rest);
    }

    /// How finely the surface is cut.
    pub(super) fn dicing(&self, camera: &DicingCamera) -> DicingRate {
        let eyes = self.near.iter().map(|near| near.eye).collect();
        let density = half_power_above(self.density.needed);
        DicingRate { pixels: camera.pixels, density, focal: camera.focal, eyes, views: Vec::new() }
    }

    /// How finely a patch is cut.
    pub(super) fn patch_dicing(&self, camera: &DicingCamera) -> DicingRate {
        let views: Option<Vec<[DVec4; 5]>> = self.near.iter().map(|near| near.sides).collect();
        DicingRate { focal: GRID_ROOM * camera.focal, views: views.unwrap_or_default(), ..self.dicing(camera) }
    }

    /// How finely a patch is cut in a live view, where it was cut as `kept`.
    pub(super) fn live_patch_dicing(&self, camera: &DicingCamera, kept: Option<&DicingRate>) -> DicingRate {
        self.live_dicing_with(camera, kept, PATCH_ROOM)
    }

    /// How finely the surface is cut in a live view, where it was cut as `kept`.
    pub(super) fn live_dicing(&self, camera: &DicingCamera, kept: Option<&DicingRate>) -> DicingRate {
        self.live_dicing_with(camera, kept, ROOM)
    }

    fn live_dicing_with(&self, camera: &DicingCamera, kept: Option<&DicingRate>, room: f64) -> DicingRate {
        let is_kept = |kept: &&DicingRate| {
            kept.pixels == camera.pixels && self.is_served(camera, kept) && !self.is_wasted(camera, kept)
        };
        kept.filter(is_kept).cloned().unwrap_or_else(|| self.new_live_dicing(camera, room))
    }

    /// Whether it has what is needed everywhere.
    fn is_served(&self, camera: &DicingCamera, kept: &DicingRate) -> bool {
        let serves = |near: &NearSurface| {
            let makes_up = |eye: &CameraEye| {
                let moved = eye.position.distance(near.eye.position);
                let makes_up = COARSER_CLOSE * kept.focal >= camera.focal * (1.0 + moved / near.gap);
                eye.nearest <= near.eye.nearest && kept.focal >= camera.focal && makes_up
            };
            kept.density * near.gap >= camera.focal || kept.eyes.iter().any(makes_up)
        };
        let out_of_picture = |near: &NearSurface| kept.density >= near.density.needed || serves(near);
        kept.density >= self.density.needed
            && self.near.iter().all(|near| if near.is_in_picture { serves(near) } else { out_of_picture(near) })
    }

    /// Whether it is much finer than the view needs it, were all of it in the picture.
    fn is_wasted(&self, camera: &DicingCamera, kept: &DicingRate) -> bool {
        let closest = self.near.iter().map(|near| camera.focal / near.gap).fold(0.0, f64::max);
        let is_of_use = |eye: &CameraEye| {
            let is_close = |near: &NearSurface| eye.position.distance(near.eye.position) <= MAX_GAPS * near.gap;
            self.near.iter().any(is_close)
        };
        kept.density > MAX_FINENESS * self.density.in_picture.max(closest)
            || (!kept.eyes.is_empty() && kept.focal > MAX_FINENESS * camera.focal)
            || !kept.eyes.iter().all(is_of_use)
    }

    fn new_live_dicing(&self, camera: &DicingCamera, room: f64) -> DicingRate {
        let (seen, unseen): (Vec<&NearSurface>, Vec<&NearSurface>) =
            self.near.iter().partition(|near| near.is_in_picture);
        let density = unseen.iter().map(|near| near.density.needed).fold(self.density.needed, f64::max);
        let mut eyes: Vec<CameraEye> = Vec::new();
        for near in &seen {
            let position = snapped(near.eye.position, power_below(near.gap / GRID));
            let eye = CameraEye { position, ..near.eye };
            if !eyes.contains(&eye) {
                eyes.push(eye);
            }
        }
        eyes.sort_by(|a, b| {
            a.position.to_array().partial_cmp(&b.position.to_array()).unwrap_or(std::cmp::Ordering::Equal)
        });
        let focal = if eyes.is_empty() { 0.0 } else { power_above(room * camera.focal) };
        DicingRate { pixels: camera.pixels, density: power_above(density), focal, eyes, views: Vec::new() }
    }
}

/// The nearest place on a grid; the place itself for a step of 0.
fn snapped(place: DVec3, step: f64) -> DVec3 {
    if step > 0.0 { (place / step).round() * step } else { place }
}

/// The next half power of two.
fn half_power_above(density: f64) -> f64 {
    if density > 0.0 && density.is_finite() { ((density.log2() * 2.0).ceil() / 2.0).exp2() } else { 0.0 }
}

/// The next power of two.
fn power_above(number: f64) -> f64 {
    if number > 0.0 && number.is_finite() { number.log2().ceil().exp2() } else { 0.0 }
}

/// The power of two below; 0 where there is none.
fn power_below(length: f64) -> f64 {
    if length > 0.0 && length.is_finite() { length.log2().floor().exp2() } else { 0.0 }
}
