// SPDX-License-Identifier: Apache-2.0
//! Cameras at the limits: angles, apertures, planes, shapes of pictures.

use glam::{DMat4, DVec3};

use super::scale::{onlooker, still_life};
use crate::build::World;
use crate::lab::{Found, Lab};
use crate::shot::Way;
use crate::tracer::camera::{Eye, View};

/// Error of window depth near 1: a few steps of a float there.
const DEPTH: f64 = 2.5e-7;

pub(crate) fn run(lab: &mut Lab<'_>) {
    let world = still_life();
    let base = onlooker(1.0, DVec3::ZERO, [48, 32]);
    let angle = |degrees: f64, size| Eye { view: View::Angle(degrees.to_radians()), size, ..base };
    let ball = |eye: Eye| Eye { target: DVec3::new(-0.7, 1.79, 0.0), ..eye };
    lab.case("camera/0.01 degrees", |lab, case| look(lab, case, &world, &ball(angle(0.01, [32, 32])), 4.0));
    lab.case("camera/0.01 degrees over 512 pixels", |lab, case| {
        look(lab, case, &world, &ball(angle(0.01, [512, 512])), 4.0)
    });
    lab.case("camera/179 degrees", |lab, case| {
        // Just above the ground, looking down: what is seen is hundreds of times as wide as the eye is high.
        let close = Eye {
            eye: DVec3::new(0.5, 0.02, 1.5),
            target: DVec3::new(0.5, -1.0, 1.4),
            planes: [1e-3, 1e3],
            ..angle(179.0, [64, 64])
        };
        // Single precision about the middle of the scene, 3 units wide to each side.
        look(lab, case, &world, &close, 4.0 + 3.0 / 0.02);
    });
    lab.case("camera/1 x 1", |lab, case| look(lab, case, &world, &angle(40.0, [1, 1]), 4.0));
    let wide = Eye { aspect: Some(3.0), ..angle(20.0, [16384, 1]) };
    lab.case("camera/16384 x 1", |lab, case| look(lab, case, &world, &wide, 4.0));
    lab.case("camera/planes at 1e-6 and 1e12", |lab, case| {
        look(lab, case, &world, &Eye { planes: [1e-6, 1e12], ..base }, 4.0)
    });
    lab.case("camera/planes at 1 and 1e30", |lab, case| {
        look(lab, case, &world, &Eye { planes: [1.0, 1e30], ..base }, 4.0)
    });
    // Two components of each direction are next to zero, and boxes far from the rays along both.
    for exponent in [-6, 3, 9] {
        let scale = 10.0_f64.powi(exponent);
        let place = |x: f64, y: f64, z: f64| DVec3::new(x, y, z) * scale;
        let along = Eye::parallel(place(0.3, 1.2, 5.0), place(0.3, 1.2, 0.0), 3.0 * scale, [48, 32]);
        let along = Eye { planes: [0.1 * scale, 1000.0 * scale], ..along };
        let scaled = world.mapped(&DMat4::from_scale(DVec3::splat(scale)));
        lab.case(&format!("camera/parallel to an axis, scale 1e{exponent}"), |lab, case| {
            look(lab, case, &scaled, &along, 4.0);
        });
    }
    lab.case("camera/aperture of 1e-12", |lab, case| {
        let stage = lab.bench.stage(|db| world.author(db));
        let mut camera = base.camera();
        camera.lens_radius = 1e-12;
        camera.focus_distance = 5.0;
        let way = Way { samples: 16, bounces: 2, ..Way::default() };
        let shot = lab.shoot(case, &stage, &camera, &way);
        let reference = world.tracer().render(&base, 256, 2, true);
        lab.light(case, &reference, &base, &shot, &way, None);
    });
}

/// Distances of the world against the f64 tracer; and window depths against what the distances make them.
fn look(lab: &mut Lab<'_>, case: &str, world: &World, eye: &Eye, ulps: f64) {
    let tracer = world.tracer();
    let stage = lab.bench.stage(|db| world.author(db));
    let shot = lab.shoot(case, &stage, &eye.camera(), &Way { samples: 1, planes: true, ..Way::default() });
    lab.distances(case, &tracer, eye, &shot, ulps, None);
    let [near, far] = eye.planes;
    let mut worst = 0.0_f64;
    for (depth, distance) in shot.depth.iter().zip(&shot.distance).filter(|(_, distance)| **distance > 0.0) {
        let t = f64::from(*distance);
        let window = match eye.view {
            View::Angle(_) => 0.5 * ((far + near) / (far - near) - 2.0 * far * near / ((far - near) * t)) + 0.5,
            View::Height(_) => (t - near) / (far - near),
        };
        worst = worst.max((f64::from(*depth) - window).abs());
    }
    let found = Found { quantity: "window depth", reference: 0.0, got: worst, error: worst, bound: DEPTH };
    lab.row(case, &found, None);
}
