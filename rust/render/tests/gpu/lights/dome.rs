// SPDX-License-Identifier: Apache-2.0
//! Domes with pictures: sums, directions, rotation; pictures of rectangles.

use super::{TestFiles, downwards, expect, irradiances, light};
use crate::support::{perspective, read, render, render_with_messages, request, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::{DomeFormat, LightDesc, LightKind};
use oocpt_render::AovKind;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

fn dome(name: &str, transform: DMat4) -> LightDesc {
    light(LightKind::Dome { texture: Some(TestFiles::asset(name)), format: DomeFormat::Latlong }, transform)
}

/// Direction of the middle of texel (x, y) of 64 x 32 as `OpenEXR` has it: +z in the middle, +x a quarter from the
/// left, +y up.
fn direction(x: u32, y: u32) -> DVec3 {
    let longitude = (0.5 - (f64::from(x) + 0.5) / 64.0) * TAU;
    let latitude = (0.5 - (f64::from(y) + 0.5) / 32.0) * PI;
    DVec3::new(latitude.cos() * longitude.sin(), latitude.sin(), latitude.cos() * longitude.cos())
}

#[test]
fn a_uniform_dome_picture_equals_a_constant_dome() {
    for place in [DMat4::IDENTITY, DMat4::from_rotation_x(0.7) * DMat4::from_scale(DVec3::splat(3.0))] {
        expect("even picture", 256, 0.5 * PI, 3e-3, &|db| db.upsert_light(dome("grey", place)));
    }
}

/// Bilinear interpolation spreads a texel over a tent whose area is that of the texel: its solid angle is about
/// `cos(latitude)` times the area in radians.
#[test]
fn one_bright_texel_lights_from_its_direction() {
    let solid = |y: u32| (TAU / 64.0) * (PI / 32.0) * ((0.5 - (f64::from(y) + 0.5) / 32.0) * PI).cos();
    let turn = DMat4::from_rotation_z(0.9) * DMat4::from_rotation_x(0.4);
    for (x, y, place) in [(31, 8, DMat4::IDENTITY), (10, 12, DMat4::IDENTITY), (0, 10, DMat4::IDENTITY), (20, 14, turn)]
    {
        let w = place.transform_vector3(direction(x, y));
        let expected = 100.0 * solid(y) * w.y.max(0.0);
        assert!(w.y > 0.1, "above the floor");
        expect(&format!("texel {x}, {y}"), 1024, expected, 1e-2, &|db| {
            db.upsert_light(dome(&format!("texel {x} {y}"), place))
        });
        // A wall that hides that direction leaves nothing of it.
        let side = w.cross(DVec3::Y).normalize();
        let wall = DMat4::from_cols(side.extend(0.0), w.extend(0.0), side.cross(w).extend(0.0), (w * 0.1).extend(1.0));
        for given in irradiances(64, &|db| {
            db.upsert_light(dome(&format!("texel {x} {y}"), place));
            db.upsert_mesh(crate::scenes::square(
                crate::scenes::prim("/wall", wall * DMat4::from_scale(DVec3::splat(0.05))),
                2,
                0.0,
            ));
        }) {
            assert!(given[0] < 1e-3 * expected, "{} comes from elsewhere", given[0]);
        }
    }
}

#[test]
fn the_camera_sees_the_picture_the_right_way_round() {
    let session = session(settings(16, 0));
    session.set_light_files(Arc::new(TestFiles));
    let w = direction(10, 12);
    session.with_scene(|db| {
        db.upsert_light(LightDesc { camera_visible: true, ..dome("texel 10 12", DMat4::IDENTITY) });
        db.upsert_mesh(crate::scenes::square(
            crate::scenes::prim("/m", DMat4::from_translation(DVec3::Y * -9.0)),
            1,
            0.0,
        ));
    });
    let request = request(perspective(DVec3::ZERO, w, 0.01, [4, 4]));
    render(&session, &request);
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    assert!(colors.iter().all(|c| c[0] > 85.0 && (c[3] - 1.0).abs() < 1e-6), "the texel is straight ahead: {colors:?}");
}

#[test]
fn a_picture_that_cannot_be_read_is_one_warning() {
    let session = session(settings(4, 1));
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(|db| {
        db.upsert_light(dome("missing", DMat4::IDENTITY));
        db.upsert_mesh(crate::scenes::square(crate::scenes::prim("/floor", DMat4::IDENTITY), 1, 0.5));
    });
    let request = request(perspective(DVec3::new(0.0, 2.0, 2.0), DVec3::ZERO, 0.5, [4, 4]));
    let messages = render_with_messages(&session, &request);
    assert_eq!(messages.len(), 1, "{messages:?}");
    assert!(messages[0].text.contains("/light") && messages[0].text.contains("missing"), "{messages:?}");
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    assert!((colors[5][0] - 0.5).abs() < 0.05, "the dome is constant: {:?}", colors[5]);
}

/// Half of the picture of a rectangle, by u and by v: (0, 0) is at +x, +y.
#[test]
fn a_rect_shows_its_picture() {
    let kind = LightKind::Rect { width: 0.2, height: 0.2, texture: Some(TestFiles::asset("halves")) };
    // Only the half of the light that is at x > 0 (u < 1/2), or at the light's y > 0 (v < 1/2), is red or green: half
    // each.
    let small = light(kind.clone(), downwards(DVec3::Y * 2.0));
    for given in irradiances(256, &|db| db.upsert_light(small.clone())) {
        let whole = 0.04 / 4.0;
        for (value, share) in given.into_iter().zip([0.5, 0.5, 0.25]) {
            assert!((value / (whole * share) - 1.0).abs() < 2e-2, "{value} of {whole}");
        }
    }
    // A blind over world x < 0 leaves red whole: the light's +x is the world's +x.
    let blind = DMat4::from_translation(DVec3::new(-0.5, 1.9, 0.0)) * DMat4::from_scale(DVec3::splat(0.5));
    for given in irradiances(256, &|db| {
        db.upsert_light(small.clone());
        db.upsert_mesh(crate::scenes::square(crate::scenes::prim("/blind", blind), 2, 0.0));
    }) {
        let whole = 0.04 / 4.0;
        assert!((given[0] / (0.5 * whole) - 1.0).abs() < 3e-2, "red is at +x: {given:?}");
        assert!((given[1] / (0.25 * whole) - 1.0).abs() < 3e-2, "green is half hidden: {given:?}");
    }
    // A blind over the light's y < 0 (world z > 0: -z of the light is down, so its y is the world's -z) leaves green
    // whole.
    let blind = DMat4::from_translation(DVec3::new(0.0, 1.9, 0.5)) * DMat4::from_scale(DVec3::splat(0.5));
    for given in irradiances(256, &|db| {
        db.upsert_light(small.clone());
        db.upsert_mesh(crate::scenes::square(crate::scenes::prim("/blind", blind), 2, 0.0));
    }) {
        assert!((given[1] / 0.005 - 1.0).abs() < 3e-2 && (given[0] / 0.0025 - 1.0).abs() < 3e-2, "{given:?}");
    }
}
