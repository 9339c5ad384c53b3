// SPDX-License-Identifier: Apache-2.0
//! Scales far apart in one picture.

use glam::{DMat4, DVec3};

use crate::build::{Body, Placed, SunLight, World};
use crate::lab::{Lab, Miss};
use crate::shot::Way;
use crate::tracer::bvh::Ray;
use crate::tracer::camera::Eye;

pub(crate) fn run(lab: &mut Lab<'_>) {
    lab.case("place/beads of 1e-3 on a planet of 6.4e6", beads_on_a_planet);
    lab.case("place/beads of 1e-3 beside a planet of 6.4e6", beads_before_a_planet);
}

const PLANET: f64 = 6.4e6;
const SIZE: [u32; 2] = [48, 32];
/// The eye is 0.005 above the ground, far below what single precision makes of the planet.
const MESH_FRAME: Miss = Miss {
    ulps: 1e16,
    wrong_pixels: 100.0,
    sigmas: 1e4,
    why: "rays come into a mesh's own frame in single precision (into its chunk's in 48 bits): there the ground is at \
    0.998 to 1, steps are \
          2^-24, which are 0.38 units of the planet, 76 times the eye's height of 0.005",
};

/// What beads in space before a planet are known to miss.
const FAR_PLANET: Miss = Miss {
    ulps: 64.0,
    wrong_pixels: 0.0,
    sigmas: 5.0,
    why: "the planet is met to steps of 2^-24 of its frame, 0.38 units, 2e5 away: 16 ulps of the distance each",
};

fn planet() -> Placed {
    Placed {
        body: Body::sphere(48, 0.5),
        place: DMat4::from_scale_rotation_translation(
            DVec3::splat(PLANET),
            glam::DQuat::from_rotation_z(0.3) * glam::DQuat::from_rotation_x(0.2),
            DVec3::Y * -PLANET,
        ),
    }
}

fn sun() -> SunLight {
    SunLight { direction: DVec3::new(0.4, 1.0, 0.3), irradiance: 2.0, degrees: 2.0 }
}

/// Beads around a point, one radius above it.
fn beads(world: &mut World, at: DVec3) {
    for (i, (x, z)) in [(0.0, 0.0), (2.5, 0.4), (-2.2, -1.0), (0.6, -2.6)].into_iter().enumerate() {
        let centre = at + DVec3::new(x, 1.0 + 0.1 * i as f64, z) * 1e-3;
        let place = DMat4::from_translation(centre) * DMat4::from_scale(DVec3::splat(1e-3));
        world.bodies.push(Placed { body: Body::sphere(10, 0.7), place });
    }
}

fn compare(lab: &mut Lab<'_>, case: &str, world: &World, at: DVec3, miss: Option<Miss>) {
    let eye = Eye::at(at + DVec3::new(6.0, 5.0, 9.0) * 1e-3, at + DVec3::Y * 5e-4, 0.7, SIZE);
    let eye = Eye { planes: [1e-4, 1e8], ..eye };
    let way = Way { samples: 16, bounces: 2, planes: true, ..Way::default() };
    let stage = lab.bench.stage(|db| world.author(db));
    let shot = lab.shoot(case, &stage, &eye.camera(), &way);
    let tracer = world.tracer();
    lab.distances(case, &tracer, &eye, &shot, 16.0, miss);
    let reference = tracer.render(&eye, 256, 2, true);
    lab.light(case, &reference, &eye, &shot, &way, miss);
}

fn beads_on_a_planet(lab: &mut Lab<'_>, case: &str) {
    let mut world = World { bodies: vec![planet()], dome: 0.6, sun: Some(sun()) };
    let down = Ray { o: DVec3::new(0.0, 1e6, 0.0), d: DVec3::NEG_Y };
    let ground = world.tracer().first(&down).map_or(0.0, |met| 1e6 - met.t);
    let at = DVec3::Y * ground;
    beads(&mut world, at);
    compare(lab, case, &world, at, Some(MESH_FRAME));
}

/// Beads in space, the planet far below.
fn beads_before_a_planet(lab: &mut Lab<'_>, case: &str) {
    let mut world = World { bodies: vec![planet()], dome: 0.6, sun: Some(sun()) };
    let at = DVec3::new(1.0, 2.0e5, -3.0);
    beads(&mut world, at);
    compare(lab, case, &world, at, Some(FAR_PLANET));
}
