// SPDX-License-Identifier: Apache-2.0
//! Lights with a place beside lights at infinity: which are asked depends on what they bring, and what comes of it does
//! not.

use super::mesh::{corners, glow, quad};
use super::shapes::polygon;
use super::{ALBEDO, TestFiles, downwards, expect, light, rect, sphere};
use crate::scenes::{prim, square};
use crate::support::{color_request, orthographic, read, render, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::scene::SceneDb;
use oocpt_core::{LightDesc, LightKind, ShapingCone};
use oocpt_render::AovKind;
use std::f64::consts::PI;
use std::sync::Arc;

/// A single direction of irradiance `value` on what faces it, `degrees` from straight above.
fn sun(value: f32, degrees: f64) -> LightDesc {
    let turn = DMat4::from_rotation_z(degrees.to_radians()) * downwards(DVec3::ZERO);
    let kind = LightKind::Distant { angle_degrees: 0.0 };
    LightDesc { prim: prim("/sun", turn), intensity: value, normalize: true, ..light(kind, turn) }
}

fn dome(radiance: f32) -> LightDesc {
    let kind = LightKind::PLAIN_DOME;
    LightDesc { prim: prim("/dome", DMat4::IDENTITY), intensity: radiance, ..light(kind, DMat4::IDENTITY) }
}

fn ball(path: &str, at: DVec3, radius: f32, radiance: f32) -> LightDesc {
    LightDesc {
        prim: prim(path, DMat4::from_translation(at)),
        intensity: radiance,
        ..light(sphere(radius), DMat4::IDENTITY)
    }
}

fn of_ball(at: DVec3, radius: f64, radiance: f64) -> f64 {
    PI * radiance * (radius / at.length()).powi(2) * at.y / at.length()
}

#[test]
fn local_and_infinite_lights_add_up() {
    let (near, far) = (DVec3::new(0.2, 0.4, 0.1), DVec3::new(-3.0, 5.0, 2.0));
    expect("a candle beside a sun", 1024, of_ball(near, 0.02, 0.5) + 3.0 * 0.5, 6e-3, &|db| {
        db.upsert_light(sun(3.0, 60.0));
        db.upsert_light(ball("/candle", near, 0.02, 0.5));
    });
    expect("a lamp in moonlight", 1024, of_ball(near, 0.05, 40.0) + 0.01 * PI + 0.02, 6e-3, &|db| {
        db.upsert_light(sun(0.02, 0.0));
        db.upsert_light(dome(0.01));
        db.upsert_light(ball("/lamp", near, 0.05, 40.0));
    });
    let both = of_ball(near, 0.05, 20.0) + of_ball(far, 0.5, 8.0) + 0.3 * PI;
    expect("two lamps under a sky", 2048, both, 1e-2, &|db| {
        db.upsert_light(dome(0.3));
        db.upsert_light(ball("/lamp", near, 0.05, 20.0));
        db.upsert_light(ball("/moon", far, 0.5, 8.0));
    });
    // Nothing comes of a lamp that looks the other way, and then nobody asks it.
    let up = DMat4::from_translation(DVec3::Y) * DMat4::from_rotation_x(PI / 2.0);
    expect("a panel that looks up", 256, 2.0, 2e-3, &|db| {
        db.upsert_light(sun(2.0, 0.0));
        db.upsert_light(LightDesc { intensity: 100.0, ..light(rect(1.0, 1.0), up) });
    });
}

#[test]
fn mesh_dome_and_lamp_light_adds_up() {
    let transform = downwards(DVec3::new(0.0, 1.0, -0.5)) * DMat4::from_scale(DVec3::splat(0.2));
    let at = DVec3::new(1.0, 1.0, 1.0);
    // The mesh hides its part of the sky.
    let share = polygon(&corners(transform));
    let sum = 5.0 * share + of_ball(at, 0.1, 4.0) + 0.2 * (PI - share);
    expect("a mesh", 2048, sum, 1e-2, &|db| {
        db.upsert_material(glow("/glow", [5.0; 3]));
        db.upsert_mesh(quad("/quad", 2, transform));
        db.upsert_light(dome(0.2));
        db.upsert_light(ball("/lamp", at, 0.1, 4.0));
    });
}

/// The share of pixels, of one sample and of direct light, whose value is as `counts` says.
fn asked(counts: impl Fn(f32) -> bool, build: &dyn Fn(&mut SceneDb)) -> f64 {
    let session = session(settings(1, 0));
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(|db| {
        db.upsert_mesh(square(prim("/floor", DMat4::IDENTITY), 1, ALBEDO));
        build(db);
    });
    let request = color_request(orthographic(DVec3::new(0.0, 5.0, 3.0), DVec3::ZERO, 0.01, [64, 64]));
    render(&session, &request);
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let count = u32::try_from(colors.iter().filter(|color| counts(color[0])).count()).expect("few");
    f64::from(count) / f64::from(64_u32 * 64)
}

/// Shares of shadow rays by what is brought, and a tenth at least.
#[test]
fn brighter_groups_get_a_larger_share_of_shadow_rays() {
    let at = DVec3::new(0.0, 1.0, 0.0);
    // A ball's irradiance here is that of its power: pi (r / d)^2 L.
    let lit = |sun_value: f32, ball_value: f32| {
        move |db: &mut SceneDb| {
            db.upsert_light(sun(sun_value, 0.0));
            db.upsert_light(ball("/ball", at, 0.02, ball_value / (0.0004 * std::f32::consts::PI)));
        }
    };
    let reflected = |value: f32| ALBEDO / std::f32::consts::PI * value;
    for (sun_value, ball_value, expected) in [(1.0, 1e-3, 0.9), (1e-3, 1.0, 0.1), (1.0, 3.0, 0.3)] {
        // What a ray to the sun brings is all of its light over the share of rays that ask it.
        let is_sun = |value: f32| (value / (reflected(sun_value) / expected) - 1.0).abs() < 0.05;
        let share = asked(is_sun, &lit(sun_value, ball_value));
        assert!((share - f64::from(expected)).abs() < 0.02, "{sun_value} and {ball_value}: {share}, not {expected}");
    }
    // A spot is bright where it shines, and nobody asks it elsewhere.
    let spot = |degrees: f64| {
        move |db: &mut SceneDb| {
            db.upsert_light(sun(1.0, 0.0));
            let shaping = Some(ShapingCone { cone_angle_degrees: 10.0, ..ShapingCone::default() });
            let turn = downwards(at) * DMat4::from_rotation_x(degrees.to_radians());
            let value = 100.0 / (0.0004 * std::f32::consts::PI);
            db.upsert_light(LightDesc { shaping, intensity: value, ..light(sphere(0.02), turn) });
        }
    };
    let bright = asked(|value| value > reflected(20.0), &spot(0.0));
    assert!(bright > 0.85, "{bright} of the rays to a spot a hundred times as bright as the sun");
    let alone = asked(|value| (value / reflected(1.0) - 1.0).abs() < 1e-3, &spot(90.0));
    assert!((alone - 1.0).abs() < 1e-9, "{alone} of the rays to the sun alone");
}

/// As a lamp, by the power of its faces.
#[test]
fn brighter_mesh_lights_get_a_larger_share_of_shadow_rays() {
    // Beside the way of the sun.
    let transform = downwards(DVec3::new(0.5, 1.0, 0.0)) * DMat4::from_scale(DVec3::splat(0.02));
    #[expect(clippy::cast_possible_truncation, reason = "a small number")]
    let value_of_one = (1.0 / polygon(&corners(transform))) as f32;
    for (sun_value, mesh_value, expected) in [(1.0, 1e-3, 0.9), (1e-3, 1.0, 0.1)] {
        let lit = move |db: &mut SceneDb| {
            db.upsert_light(sun(sun_value, 0.0));
            db.upsert_material(glow("/glow", [mesh_value * value_of_one; 3]));
            db.upsert_mesh(quad("/quad", 2, transform));
        };
        let of_the_sun = ALBEDO / std::f32::consts::PI * sun_value / expected;
        let share = asked(|value| (value / of_the_sun - 1.0).abs() < 0.05, &lit);
        assert!((share - f64::from(expected)).abs() < 0.02, "{sun_value} and {mesh_value}: {share}, not {expected}");
    }
}
