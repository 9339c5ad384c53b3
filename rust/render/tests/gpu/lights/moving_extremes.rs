// SPDX-License-Identifier: Apache-2.0
//! Mesh lights whose motion strains precision: far away, on long arms, and with absurd keys.

use super::mesh::{corners, glow, quad};
use super::moving::mean;
use super::moving_meshes::{Map, at, going, passing, samples, scaled, sheared};
use super::shapes::polygon;
use super::{ALBEDO, downwards};
use crate::scenes::{instanced, instancer, prim, square};
use crate::support::{color_request, orthographic, read, render, render_with_messages, session, settings};
use glam::{DMat4, DQuat, DVec3, DVec4};
use oocpt_core::scene::{SceneDb, TransformSample};
use oocpt_render::AovKind;
use std::f64::consts::PI;

/// Transforms at times.
type Keys<'a> = &'a [(f64, DMat4)];

/// The irradiance about `from`, with and without a bounce, in a scene as wide as that is far.
fn far_off(from: DVec3, samples: u32, build: &dyn Fn(&mut SceneDb)) -> [f64; 2] {
    [0, 1].map(|bounces| {
        let session = session(settings(samples, bounces));
        session.with_scene(|db| {
            db.upsert_mesh(square(prim("/floor", DMat4::from_translation(from)), 1, ALBEDO));
            db.upsert_mesh(square(prim("/other", DMat4::IDENTITY), 3, ALBEDO));
            db.upsert_material(glow("/glow", [1.0; 3]));
            build(db);
        });
        let request = color_request(orthographic(from + DVec3::new(0.0, 5.0, 3.0), from, 0.01, [8, 8]));
        render(&session, &request);
        let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
        colors.iter().map(|color| f64::from(color[0])).sum::<f64>() / 64.0 * PI / f64::from(ALBEDO)
    })
}

/// Shadow rays end before the mesh, wherever rounding puts a moving one: far away, sheared, at the end of a long arm.
#[test]
fn far_away_emitters_that_move_do_not_shadow_themselves() {
    let far = DVec3::new(3.0e3, 2.0e3, -1.0e3);
    let flat = DMat4::from_rotation_x(-PI / 2.0);
    let ways: [(&str, Map<'_>); 3] = [
        ("it goes", &|time| at(time - 0.5, 1.0, -0.8) * flat * scaled(0.3, 0.3)),
        ("sheared", &|time| passing(time) * flat * sheared() * DMat4::from_scale(DVec3::new(0.3, 0.05, 2.0))),
        ("it turns", &|time| at(0.0, 1.2, -1.0) * DMat4::from_rotation_x(time - 2.0) * scaled(0.3, 0.3)),
    ];
    for (what, map) in ways {
        let known = mean(|time| polygon(&corners(map(time))));
        let given = far_off(far, 2048, &|db| {
            db.upsert_mesh(going(2, &[0.0, 1.0], &|time| DMat4::from_translation(far) * map(time)));
        });
        for given in given {
            assert!((given / known - 1.0).abs() < 0.012, "{what}: {given}, not {known}");
        }
    }
    // The way is so long that single precision is off by more than a shadow ray's end, along the normal.
    let leaves = |time: f64| at(0.2 * time, 1.0 + 6e4 * (time - 0.9).max(0.0), -0.8) * flat * scaled(0.3, 0.3);
    let known = mean(|time| polygon(&corners(leaves(time))));
    for given in far_off(far, 2048, &|db| {
        db.upsert_mesh(going(2, &[0.0, 0.9, 1.0], &|time| DMat4::from_translation(far) * leaves(time)));
    }) {
        assert!((given / known - 1.0).abs() < 0.012, "it leaves: {given}, not {known}");
    }
    // A quarter of a milliradian, two thousand away.
    let hub = far - DVec3::new(0.0, 2.0e3, 0.0);
    let spin = |time: f64| DMat4::from_translation(hub) * DMat4::from_rotation_x(2.5e-4 * (time - 0.5));
    let arm = [(far - hub + DVec3::new(0.0, 1.0, -0.8), DQuat::from_rotation_x(-PI / 2.0), DVec3::splat(0.2))];
    let lamp = |time: f64| {
        let (at, turn, size) = arm[0];
        spin(time) * DMat4::from_scale_rotation_translation(size, turn, at)
    };
    let known = mean(|time| polygon(&corners(DMat4::from_translation(-far) * lamp(time))));
    let given = far_off(far, 2048, &|db| {
        let mut row = instancer(prim("/row", spin(0.5)), "/row/lamp", &arm);
        row.prim.motion = samples(&[0.0, 1.0], &spin);
        db.upsert_instancer(row);
        let mut lamp = quad("/row/lamp", 2, DMat4::IDENTITY);
        lamp.prim = instanced(lamp.prim, "/row");
        db.upsert_mesh(lamp);
    });
    for given in given {
        assert!((given / known - 1.0).abs() < 0.012, "an arm: {given}, not {known}");
    }
}

/// Neither NaN nor a lost device for any keys; and light where there should be some, except from meshes that get so
/// small or large that they are not sampled, or so far away.
#[test]
fn extreme_light_motion_stays_finite() {
    let base = downwards(DVec3::new(0.0, 1.0, -0.8)) * scaled(0.3, 0.3);
    let moved = |x: f64| at(x, 0.0, 0.0) * base;
    let nan = DMat4::from_cols(DVec4::NAN, DVec4::Y, DVec4::Z, DVec4::W);
    let singular = base * DMat4::from_scale(DVec3::new(0.0, 1.0, 1.0));
    let tiny = base * DMat4::from_scale(DVec3::splat(1e-14));
    let huge = base * DMat4::from_scale(DVec3::splat(1e14));
    let inside_out = base * DMat4::from_scale(DVec3::splat(-1.0));
    let cases: [(&str, Keys<'_>, bool); 14] = [
        ("no time", &[(0.5, base), (0.5, moved(1.0))], true),
        ("back in time", &[(1.0, base), (0.0, moved(1.0))], true),
        ("no time at all", &[(f64::NAN, base), (f64::INFINITY, moved(1.0))], true),
        ("before the shutter", &[(-9.0, base), (-8.0, moved(0.1))], true),
        ("not finite", &[(0.0, base), (1.0, nan)], true),
        ("singular", &[(0.0, base), (1.0, singular)], true),
        ("both singular", &[(0.0, singular), (1.0, moved(1.0) * singular)], true),
        ("very fast", &[(0.0, moved(-5e8)), (1.0, moved(5e8))], false),
        ("beyond what single precision holds", &[(0.0, moved(-1e30)), (1.0, moved(1e30))], true),
        ("mirrored", &[(0.0, inside_out), (1.0, moved(0.2) * DMat4::from_scale(DVec3::splat(-1.0)))], true),
        ("through nothing", &[(0.0, base), (1.0, inside_out)], true),
        ("to next to nothing", &[(0.0, base), (1.0, tiny)], false),
        ("from next to nothing", &[(0.0, tiny), (1.0, moved(0.1) * tiny)], false),
        ("to all there is", &[(0.0, base), (1.0, huge)], false),
    ];
    for (what, maps, shines) in cases {
        for (bounces, others) in [(0, false), (2, true)] {
            let session = session(settings(16, bounces));
            session.with_scene(|db| {
                db.upsert_mesh(square(prim("/floor", DMat4::IDENTITY), 1, ALBEDO));
                db.upsert_material(glow("/glow", [1.0; 3]));
                let mut desc = quad("/quad", 2, base);
                let sample = |&(time, transform): &(f64, DMat4)| TransformSample { time, transform };
                desc.prim.motion = maps.iter().map(sample).collect();
                db.upsert_mesh(desc);
                if others {
                    let place = |time: f64| moved(-2.0 + time);
                    db.upsert_mesh(going(5, &[0.0, 1.0], &place));
                    db.upsert_mesh(quad("/still", 6, moved(1.5)));
                }
            });
            let request = color_request(orthographic(DVec3::new(0.0, 5.0, 3.0), DVec3::ZERO, 0.5, [16, 16]));
            let messages = render_with_messages(&session, &request);
            let errors = messages.iter().filter(|message| message.severity == oocpt_render::Severity::Error).count();
            assert_eq!(errors, 0, "{what}: {messages:?}");
            let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
            assert!(colors.iter().flatten().all(|c| c.is_finite() && *c >= 0.0), "{what}: NaN, infinite or negative");
            assert_eq!(session.stats().nonfinite_samples, 0, "{what}: contributions that are no numbers");
            let sum: f64 = colors.iter().map(|color| f64::from(color[0])).sum();
            assert!(sum > 0.0 || !(shines || others), "{what}: nothing shines");
        }
    }
}
