// SPDX-License-Identifier: Apache-2.0
//! Light at the limits, on surfaces without materials: intensities, tiny and huge sources, many bounces, grazing views,
//! long sums.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DMat4, DVec3};
use oocpt_core::scene::{AssetRef, DomeFormat, LightDesc, LightKind};
use oocpt_render::{LightFiles, LightPicture};

use crate::build::{Body, Placed, SunLight, World, dome, prim};
use crate::lab::{Found, Lab, mean};
use crate::shot::{Stage, Way};
use crate::tracer::camera::Eye;

pub(crate) fn run(lab: &mut Lab<'_>) {
    lab.case("light/a pixel of 1e9 in a dome of 1e-3", sun_pixel);
    for exponent in [-30, 30] {
        lab.case(&format!("light/intensity 1e{exponent}"), |lab, case| intensity(lab, case, exponent));
    }
    lab.case("light/sphere of radius 1e-6", point_like);
    for (name, rings) in [("25 %", 8), ("1.9 %", 2)] {
        lab.case(&format!("light/albedo 1, 1000 bounces, hole of {name}"), |lab, case| cavity(lab, case, rings));
    }
    lab.case("light/grazing view", grazing);
    lab.case("light/sum of 1e30 in one pixel", long_sum);
}

fn floor(albedo: f32) -> Placed {
    Placed { body: Body::square(albedo), place: DMat4::from_scale(DVec3::splat(100.0)) }
}

/// Looks down on a floor.
fn above(size: [u32; 2]) -> Eye {
    Eye::at(DVec3::new(0.0, 4.0, 1.0), DVec3::ZERO, 0.2, size)
}

fn floor_under(lab: &Lab<'_>, albedo: f32, light: LightDesc) -> Stage {
    lab.bench.stage(|db| {
        db.upsert_mesh(floor(albedo).body.mesh(prim("/floor", floor(albedo).place), 1));
        db.upsert_light(light);
    })
}

const WIDTH: u32 = 64;
const HEIGHT: u32 = 32;
/// The sun's texel.
const SUN: (u32, u32) = (20, 9);

#[derive(Debug)]
struct Sky;

impl LightFiles for Sky {
    fn picture(&self, _: &AssetRef) -> Result<LightPicture, String> {
        let texel = |i: u32| if i == SUN.1 * WIDTH + SUN.0 { [1e9; 3] } else { [1e-3; 3] };
        Ok(LightPicture { width: WIDTH, height: HEIGHT, texels: (0..WIDTH * HEIGHT).map(texel).collect() })
    }

    fn bytes(&self, _: &AssetRef, _: u64) -> Result<Vec<u8>, String> {
        Err("there are none".into())
    }
}

/// Irradiance from above of a latlong picture with bilinear texels, by midpoints; up is y.
fn sky_irradiance() -> f64 {
    let (fine, base) = (64_u32, 1e-3);
    let mut sum = PI * base;
    // The sun's tent: two texels on each side.
    for j in 0..2 * fine {
        for i in 0..2 * fine {
            let at = |k: u32| (f64::from(k) + 0.5) / f64::from(fine) - 1.0;
            let (x, y) = (at(i), at(j));
            let weight = (1.0 - x.abs()) * (1.0 - y.abs());
            let theta = PI * (f64::from(SUN.1) + 0.5 + y) / f64::from(HEIGHT);
            let area = TAU / f64::from(WIDTH * fine) * PI / f64::from(HEIGHT * fine);
            sum += (1e9 - base) * weight * theta.sin() * theta.cos().max(0.0) * area;
        }
    }
    sum
}

fn sun_pixel(lab: &mut Lab<'_>, case: &str) {
    let asset = AssetRef { authored: "sky".into(), resolved: "sky".into() };
    let kind = LightKind::Dome { texture: Some(asset), format: DomeFormat::Latlong };
    let stage = floor_under(lab, 0.5, LightDesc { kind, ..dome(1.0) });
    stage.set_files(Arc::new(Sky));
    let way = Way { samples: lab.amount(256, 4096), bounces: 1, ..Way::default() };
    let shot = lab.shoot(case, &stage, &above([16, 16]).camera(), &way);
    lab.mean(case, "radiance of a floor, relative", 0.5 / PI * sky_irradiance(), &shot, 5e-3, None);
}

fn intensity(lab: &mut Lab<'_>, case: &str, exponent: i32) {
    let power = 10.0_f64.powi(exponent);
    #[expect(clippy::cast_possible_truncation, reason = "a float")]
    let radiance = power as f32;
    let world = World { bodies: vec![floor(0.5)], dome: radiance, sun: None };
    let stage = lab.bench.stage(|db| world.author(db));
    let way = Way { samples: 64, bounces: 4, ..Way::default() };
    let shot = lab.shoot(case, &stage, &above([16, 16]).camera(), &way);
    lab.mean(case, "floor under a dome, relative", 0.5 * f64::from(radiance), &shot, 1e-6, None);
    let sun = Some(SunLight { direction: DVec3::new(0.0, 0.8, 0.6), irradiance: radiance, degrees: 1.0 });
    let world = World { bodies: vec![floor(0.5)], dome: 0.0, sun };
    let stage = lab.bench.stage(|db| world.author(db));
    let shot = lab.shoot(case, &stage, &above([16, 16]).camera(), &way);
    lab.mean(case, "floor under a sun, relative", 0.5 / PI * 0.8 * f64::from(radiance), &shot, 1e-4, None);
    let kind = LightKind::Sphere { radius: 0.5, treat_as_point: false };
    let prim = prim("/lamp", DMat4::from_translation(DVec3::Y * 10.0));
    let stage = floor_under(lab, 0.5, LightDesc { prim, kind, intensity: radiance, ..LightDesc::default() });
    let eye = Eye::at(DVec3::new(0.0, 4.0, 1.0), DVec3::ZERO, 0.002, [16, 16]);
    let shot = lab.shoot(case, &stage, &eye.camera(), &way);
    lab.mean(case, "floor under a sphere, relative", 0.5 * 0.0025 * f64::from(radiance), &shot, 2e-3, None);
}

/// Normalised: irradiance I / (4 d^2) below, whatever the radius.
fn point_like(lab: &mut Lab<'_>, case: &str) {
    for (name, treat_as_point) in [("", false), (", as a point", true)] {
        let kind = LightKind::Sphere { radius: 1e-6, treat_as_point };
        let prim = prim("/lamp", DMat4::from_translation(DVec3::Y * 2.0));
        let lamp = LightDesc { prim, kind, intensity: 40.0, normalize: true, ..LightDesc::default() };
        let stage = floor_under(lab, 0.5, lamp);
        let eye = Eye::at(DVec3::new(0.0, 4.0, 1.0), DVec3::ZERO, 2e-4, [8, 8]);
        let way = Way { samples: 64, bounces: 1, ..Way::default() };
        let shot = lab.shoot(case, &stage, &eye.camera(), &way);
        lab.mean(case, &format!("radiance below, relative{name}"), 0.5 / PI * 40.0 / 16.0, &shot, 1e-4, None);
    }
}

/// A white hollow ball with a hole, in a white world: white inside, however long it takes to get out.
fn cavity(lab: &mut Lab<'_>, case: &str, rings: usize) {
    let mut body = Body::sphere(16, 1.0);
    let top = (rings as f64 * PI / 16.0).cos() + 1e-6;
    let cap = |face: &Vec<i32>| {
        let height =
            |i: &i32| usize::try_from(*i).ok().and_then(|i| body.points.get(i)).map_or(0.0, |p| f64::from(p[1]));
        face.iter().all(|i| height(i) >= top - 2e-6)
    };
    let faces: Vec<Vec<i32>> = body.faces.iter().filter(|face| !cap(face)).cloned().collect();
    body.faces = faces;
    let world = World { bodies: vec![Placed { body, place: DMat4::IDENTITY }], dome: 1.0, sun: None };
    let stage = lab.bench.stage(|db| world.author(db));
    let eye = Eye::at(DVec3::new(0.2, 0.1, 0.1), DVec3::new(0.1, -1.0, 0.3), 0.8, [16, 16]);
    let samples = lab.amount(64, 1 << 15);
    let way = Way { samples, bounces: 1000, ..Way::default() };
    let shot = lab.shoot(case, &stage, &eye.camera(), &way);
    // A path brings 0 to 2 as MIS splits its way out. What 256 pixels scatter tells how much that leaves in their mean,
    // and in a pixel.
    let squares: f64 = shot.color.iter().map(|c| (f64::from(c[0]) - mean(&shot)).powi(2)).sum();
    let pixel = (squares / 255.0).sqrt();
    let (off, sigma) = ((mean(&shot) - 1.0).abs(), pixel / 16.0);
    let why = format!(
        "noise: {samples} paths a pixel leave {pixel:.1e} in a pixel and {sigma:.1e} in the mean (standard \
        deviations); `--full` takes 32768"
    );
    lab.mean(case, "radiance inside, relative", 1.0, &shot, 1e-3, Some((0.01, &why)));
    let found = Found {
        quantity: "the same in standard errors",
        reference: 0.0,
        got: off / sigma,
        error: off / sigma,
        bound: 4.0,
    };
    lab.row(case, &found, None);
    let worst = shot.color.iter().map(|c| f64::from((c[0] - 1.0).abs())).fold(0.0, f64::max);
    let found = Found { quantity: "worst pixel", reference: 0.0, got: worst, error: worst, bound: 0.1 };
    lab.row(case, &found, (worst > 0.1).then_some((5.0 * pixel, &why)));
}

fn grazing(lab: &mut Lab<'_>, case: &str) {
    let world = World { bodies: vec![floor(0.5)], dome: 1.0, sun: None };
    let stage = lab.bench.stage(|db| world.author(db));
    for degrees in [1.0_f64, 0.01] {
        let up = degrees.to_radians().tan();
        let eye = Eye { planes: [1e-3, 1e3], ..Eye::at(DVec3::Y * up * 10.0, DVec3::Z * -10.0, up * 0.2, [32, 8]) };
        let way = Way { samples: 16, bounces: 4, planes: true, ..Way::default() };
        let shot = lab.shoot(case, &stage, &eye.camera(), &way);
        lab.mean(case, &format!("radiance at {degrees} degrees, relative"), 0.5, &shot, 1e-6, None);
        lab.distances(&format!("{case}, {degrees} degrees"), &world.tracer(), &eye, &shot, 8.0, None);
    }
}

/// Samples of 1e30, and of 1e-30, summed up in one pixel: no overflow, no loss.
fn long_sum(lab: &mut Lab<'_>, case: &str) {
    let samples = lab.amount(1 << 16, 1 << 24);
    for radiance in [1e30_f32, 1e-30] {
        let world = World { bodies: vec![floor(0.5)], dome: radiance, sun: None };
        let stage = lab.bench.stage(|db| world.author(db));
        let shot = lab.shoot(case, &stage, &above([1, 1]).camera(), &Way { samples, ..Way::default() });
        let quantity = format!("mean of {samples} samples of {radiance:e}, relative");
        lab.mean(case, &quantity, 0.5 * f64::from(radiance), &shot, 2e-7, None);
    }
}
