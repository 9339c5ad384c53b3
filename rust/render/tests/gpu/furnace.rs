// SPDX-License-Identifier: Apache-2.0
//! Closed forms: a white sphere in a white dome disappears; Lambert's cosine; energy at any albedo.

use crate::scenes::{dome, prim, sphere, square, sun};
use crate::support::{orthographic, perspective, read, render, request, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::camera::Camera;
use oocpt_render::{AovKind, RenderRequest, Session};
use std::f32::consts::FRAC_1_PI;

const SIZE: [u32; 2] = [24, 16];

fn cameras() -> Vec<(&'static str, Camera)> {
    let (eye, target) = (DVec3::new(0.5, 1.0, 5.0), DVec3::ZERO);
    let mut lens = perspective(eye, target, 0.8, SIZE);
    lens.lens_radius = 0.2;
    lens.focus_distance = 4.0;
    vec![
        ("perspective", perspective(eye, target, 0.8, SIZE)),
        ("orthographic", orthographic(eye, target, 3.0, SIZE)),
        ("lens", lens),
    ]
}

fn mean(colors: &[[f32; 4]]) -> f64 {
    let sum: f64 = colors.iter().map(|color| f64::from(color[0])).sum();
    #[expect(clippy::cast_precision_loss, reason = "a few hundred pixels")]
    let mean = sum / colors.len() as f64;
    mean
}

fn colors(session: &Session, request: &RenderRequest) -> Vec<[f32; 4]> {
    read(session, request, AovKind::Color)
}

#[test]
fn a_white_sphere_in_a_white_furnace_disappears() {
    let session = session(settings(64, 100));
    session.with_scene(|db| {
        db.upsert_mesh(sphere(prim("/ball", DMat4::IDENTITY), 1, 12, 1.0));
        db.upsert_light(dome([1.0; 3]));
    });
    for (name, camera) in cameras() {
        let request = request(camera);
        render(&session, &request);
        let colors = colors(&session, &request);
        let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
        assert!(ids.contains(&1) && ids.contains(&-1), "{name}: the sphere must cover a part of the image");
        let mean = mean(&colors);
        assert!((mean - 1.0).abs() < 1e-3, "{name}: mean radiance {mean}, not 1");
        // A convex white body: every path escapes after one bounce, so each sample is exact up to MIS noise.
        let worst = colors.iter().map(|color| (color[0] - 1.0).abs()).fold(0.0, f32::max);
        assert!(worst < 0.1, "{name}: a pixel is off by {worst}");
    }
}

#[test]
fn a_grey_sphere_in_a_white_dome_shows_its_albedo() {
    let session = session(settings(64, 4));
    session.with_scene(|db| {
        db.upsert_mesh(sphere(prim("/ball", DMat4::from_scale(DVec3::splat(4.0))), 1, 32, 0.5));
        db.upsert_light(dome([2.0; 3]));
    });
    // Only the sphere is in view; it is convex but for its facets, so radiance = albedo * dome.
    let request = request(perspective(DVec3::Z * 6.0, DVec3::ZERO, 0.2, SIZE));
    render(&session, &request);
    let mean = mean(&colors(&session, &request));
    assert!((mean - 1.0).abs() < 2e-3, "mean radiance {mean}, not 0.5 * 2");
}

#[test]
fn lambert_under_a_distant_light_is_albedo_over_pi_times_cosine() {
    for degrees in [0.0_f64, 30.0, 60.0, 80.0] {
        let session = session(settings(4, 2));
        session.with_scene(|db| {
            db.upsert_mesh(square(prim("/floor", DMat4::from_scale(DVec3::splat(10.0))), 1, 0.8));
            let turn =
                DMat4::from_rotation_z(degrees.to_radians()) * DMat4::from_rotation_x(-std::f64::consts::FRAC_PI_2);
            db.upsert_light(sun(3.0, 0.0, turn));
        });
        let request = request(perspective(DVec3::new(0.0, 4.0, 1.0), DVec3::ZERO, 0.5, SIZE));
        render(&session, &request);
        #[expect(clippy::cast_possible_truncation, reason = "a cosine")]
        let expected = 0.8 * FRAC_1_PI * 3.0 * degrees.to_radians().cos() as f32;
        for color in colors(&session, &request) {
            assert!((color[0] - expected).abs() < 2e-6, "{degrees} degrees: {} instead of {expected}", color[0]);
        }
    }
}

#[test]
fn a_sun_of_finite_angle_gives_its_irradiance() {
    let session = session(settings(256, 1));
    session.with_scene(|db| {
        db.upsert_mesh(square(prim("/floor", DMat4::from_scale(DVec3::splat(10.0))), 1, 0.5));
        db.upsert_light(sun(2.0, 20.0, DMat4::from_rotation_x(-1.0)));
    });
    let request = request(perspective(DVec3::new(0.0, 4.0, 1.0), DVec3::ZERO, 0.5, SIZE));
    render(&session, &request);
    // Uniform cone about an axis at angle a to the normal, wholly above the horizon: E cos(a) (1 + cos(h)) / 2, where
    // normalize divides by pi sin^2(h) and the cone's projected solid angle is pi sin^2(h) cos(a).
    let expected = 0.5 / std::f64::consts::PI * 2.0 * 1.0_f64.sin();
    let mean = mean(&colors(&session, &request));
    assert!((mean - expected).abs() < 1e-3 * expected, "{mean} instead of {expected}");
}

#[test]
fn an_empty_scene_shows_the_clear_colour_or_the_dome() {
    let session = session(settings(2, 1));
    let mut request = request(perspective(DVec3::Z * 5.0, DVec3::ZERO, 0.8, SIZE));
    request.aovs[0].clear = [0.25, 0.5, 0.75, 1.0];
    render(&session, &request);
    assert!(colors(&session, &request).iter().all(|c| *c == [0.25, 0.5, 0.75, 1.0]), "no dome: the clear colour");
    session.with_scene(|db| db.upsert_light(dome([0.5, 0.25, 2.0])));
    render(&session, &request);
    assert!(colors(&session, &request).iter().all(|c| *c == [0.5, 0.25, 2.0, 1.0]), "the dome covers it");
}
