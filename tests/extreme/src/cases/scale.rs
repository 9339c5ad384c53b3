// SPDX-License-Identifier: Apache-2.0
//! The same scene at other sizes and places, camera and scene moved together.

use glam::{DMat4, DQuat, DVec3};

use crate::build::{Body, Placed, SunLight, World};
use crate::lab::{Found, Lab, Miss};
use crate::shot::{Shot, Way};
use crate::tracer::Estimate;
use crate::tracer::camera::Eye;

const SIZE: [u32; 2] = [48, 32];
/// Size of the scene at scale 1.
const EXTENT: f64 = 6.0;
const BEYOND: Miss = Miss {
    ulps: 0.0,
    wrong_pixels: 1536.0,
    sigmas: 200.0,
    why: "6e18 from the origin: placements beyond 1e18 are dropped, with a warning, so that squares and sums of them \
    stay below the 3.4e38 of single precision",
};

/// Ground, ball and box under sky and sun.
pub(crate) fn still_life() -> World {
    let turn = DQuat::from_rotation_y(0.6) * DQuat::from_rotation_x(0.3);
    let bodies = vec![
        Placed { body: Body::square(0.5), place: DMat4::from_scale(DVec3::splat(3.0)) },
        Placed { body: Body::sphere(12, 0.8), place: DMat4::from_translation(DVec3::new(-0.7, 1.0, 0.0)) },
        Placed {
            body: Body::cube(0.3),
            place: DMat4::from_scale_rotation_translation(DVec3::splat(0.5), turn, DVec3::new(1.0, 0.8, 0.6)),
        },
    ];
    let sun = SunLight { direction: DVec3::new(0.4, 1.0, 0.3), irradiance: 2.0, degrees: 4.0 };
    World { bodies, dome: 0.6, sun: Some(sun) }
}

/// The camera of [`still_life`], at a scale and place.
pub(crate) fn onlooker(scale: f64, at: DVec3, size: [u32; 2]) -> Eye {
    let place = |p: DVec3| p * scale + at;
    let eye = Eye::at(place(DVec3::new(3.0, 3.0, 5.0)), place(DVec3::new(0.0, 0.6, 0.0)), 0.7, size);
    Eye { planes: [0.1 * scale, 1000.0 * scale], ..eye }
}

fn way() -> Way {
    Way { samples: 16, bounces: 3, planes: true, ..Way::default() }
}

pub(crate) fn run(lab: &mut Lab<'_>) {
    let world = still_life();
    let eye = onlooker(1.0, DVec3::ZERO, SIZE);
    let wanted = lab.wants("scale/") || lab.wants("place/");
    if !wanted {
        return;
    }
    let reference = world.tracer().render(&eye, 512, 3, true);
    let stage = lab.bench.stage(|db| world.author(db));
    let base = lab.shoot("scale/1", &stage, &eye.camera(), &way());
    lab.case("scale/1", |lab, case| {
        lab.light(case, &reference, &eye, &base, &way(), None);
        lab.distances(case, &world.tracer(), &eye, &base, 4.0, None);
    });
    for exponent in [-6, -3, 3, 6, 9] {
        let scale = 10.0_f64.powi(exponent);
        lab.case(&format!("scale/1e{exponent}"), |lab, case| {
            look(lab, case, &world, scale, DVec3::ZERO, None, (&reference, &base), None);
        });
    }
    // A direction that no axis is along; components are not round numbers.
    let direction = DVec3::new(0.61, 0.37, -0.7).normalize();
    for exponent in [-6, 0, 9] {
        for far in [3, 5, 7, 9] {
            let scale = 10.0_f64.powi(exponent);
            let at = direction * (scale * EXTENT * 10.0_f64.powi(far));
            let miss = (exponent == 9 && far == 9).then_some(BEYOND);
            lab.case(&format!("place/scale 1e{exponent}, 1e{far} away"), |lab, case| {
                look(lab, case, &world, scale, at, None, (&reference, &base), miss);
            });
        }
    }
    // Something stays at the origin of the world, so that moving the world's frame along is no way out.
    for far in [3, 5, 7, 9] {
        let at = direction * (EXTENT * 10.0_f64.powi(far));
        let anchor = Placed { body: Body::cube(0.5), place: DMat4::IDENTITY };
        lab.case(&format!("place/anchored, 1e{far} away"), |lab, case| {
            look(lab, case, &world, 1.0, at, Some(anchor.clone()), (&reference, &base), None);
        });
    }
}

/// Renders the world at a scale and a place and compares distances with f64, light with f64 and with the picture at
/// scale 1.
#[expect(clippy::too_many_arguments, reason = "one case")]
fn look(
    lab: &mut Lab<'_>,
    case: &str,
    world: &World,
    scale: f64,
    at: DVec3,
    anchor: Option<Placed>,
    (reference, base): (&Estimate, &Shot),
    miss: Option<Miss>,
) {
    let moved = world.mapped(&(DMat4::from_translation(at) * DMat4::from_scale(DVec3::splat(scale))));
    let eye = onlooker(scale, at, SIZE);
    // The f64 tracer stays near the origin, where it is exact.
    let near = world.mapped(&DMat4::from_scale(DVec3::splat(scale))).tracer();
    let stage = lab.bench.stage(|db| {
        moved.author(db);
        if let Some(placed) = &anchor {
            db.upsert_mesh(placed.body.mesh(crate::build::prim("/anchor", placed.place), 9));
        }
    });
    let shot = if miss.is_some() { Lab::shoot_warned } else { Lab::shoot }(lab, case, &stage, &eye.camera(), &way());
    let near_eye = onlooker(scale, DVec3::ZERO, SIZE);
    // f64 itself rounds the places as they are authored: of the bodies, the eye and what it looks at.
    let authored = 4.0 * at.length() * 2.0_f64.powi(-52) / (scale * EXTENT);
    // What two floats keep of a place (`shaders/math/double.glsl`).
    let stored = if anchor.is_some() { at.length() * 2.0_f64.powi(-46) / (scale * EXTENT) } else { 0.0 };
    lab.distances(case, &near, &near_eye, &shot, 4.0 + (authored + stored) / crate::lab::ULP, miss);
    lab.light(case, reference, &eye, &shot, &way(), miss);
    let difference = rms_difference(base, &shot);
    let found = Found {
        quantity: "light against scale 1, rms",
        reference: 0.0,
        got: difference,
        error: difference,
        bound: 0.02,
    };
    lab.row(case, &found, miss.filter(|_| difference > 0.02).map(|miss| (1.0, miss.why)));
}

/// Root mean square of the difference over the mean.
fn rms_difference(a: &Shot, b: &Shot) -> f64 {
    let (mut squares, mut sum, mut count) = (0.0, 0.0, 0.0);
    for (a, b) in a.color.iter().zip(&b.color) {
        let (a, b) = (f64::from(a[0]), f64::from(b[0]));
        squares += (a - b) * (a - b);
        sum += a;
        count += 1.0;
    }
    (squares / count).sqrt() / (sum / count)
}
