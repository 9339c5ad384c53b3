// SPDX-License-Identifier: Apache-2.0
//! The exact AOVs of a picture: the nearest hit of the pinhole ray through each pixel centre.

use glam::{DVec2, DVec3};
use oocpt_core::camera::Camera;
use oocpt_core::scene::snapshot::Snapshot;
use rayon::prelude::*;

use crate::JudgeError;
use crate::camera::PixelRays;
use crate::world::World;

/// Rays this far beside the centre (in pixels) must see the same triangle for a pixel to be unambiguous.
const PROBE_PX: f64 = 2e-3;
/// Another surface within this fraction of the depth makes the pixel ambiguous.
const TIE: f64 = 1e-5;

/// What one pixel centre sees.
#[derive(Debug, Clone, Copy)]
pub struct FirstHit {
    /// Window depth in `[0, 1]`.
    pub depth: f64,
    /// Positive distance along the view axis.
    pub camera_depth: f64,
    /// Prim, flattened instance and authored face.
    pub ids: [i32; 3],
    /// Shading normal on the authored outer side, world space.
    pub normal: DVec3,
    /// The same in view space.
    pub view_normal: DVec3,
    /// `displayColor`, if there is one.
    pub color: Option<DVec3>,
}

/// One entry per pixel, bottom-up: what it sees, and whether f32 arithmetic may honestly see another thing there.
///
/// # Errors
/// [`JudgeError::Singular`] for a camera without inverse.
pub fn first_hits(
    world: &World,
    snapshot: &Snapshot,
    camera: &Camera,
) -> Result<Vec<(Option<FirstHit>, bool)>, JudgeError> {
    let rays = PixelRays::new(camera, snapshot.origin)?;
    let (width, height) = rays.size();
    let pixels = (0..width * height).into_par_iter().map(|index| {
        let centre = DVec2::new((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
        let hit = pixel(world, &rays, centre);
        let ids = |hit: &Option<(FirstHit, bool)>| hit.map(|(hit, _)| hit.ids);
        let offsets = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y].map(|side| centre + side * PROBE_PX);
        let disputed = offsets.iter().any(|&near| ids(&pixel(world, &rays, near)) != ids(&hit));
        (hit.map(|(hit, _)| hit), disputed || hit.is_some_and(|(_, tie)| tie))
    });
    Ok(pixels.collect())
}

fn pixel(world: &World, rays: &PixelRays, position: DVec2) -> Option<(FirstHit, bool)> {
    let ray = rays.pinhole(position);
    let hit = world.nearest(&ray)?;
    let surface = world.surface(&ray, &hit);
    let first = FirstHit {
        depth: rays.window_depth(surface.position),
        camera_depth: rays.camera_depth(surface.position),
        ids: [surface.prim_id, surface.instance_id, surface.element_id],
        normal: surface.shading_normal,
        view_normal: rays.view_normal(surface.shading_normal),
        color: surface.color,
    };
    Some((first, hit.runner_up - hit.t <= TIE * hit.t))
}
