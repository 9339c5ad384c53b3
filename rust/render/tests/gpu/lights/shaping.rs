// SPDX-License-Identifier: Apache-2.0
//! Cone, softness, focus, tint, profiles, temperature: small lights, so that one angle is seen.

use super::{TestFiles, downwards, expect, irradiances, light, rect, sphere};
use glam::{DMat4, DVec3};
use oocpt_core::scene::blackbody;
use oocpt_core::{LightDesc, ShapingCone};
use std::f64::consts::PI;

const RADIUS: f32 = 0.01;

/// A small sphere at distance 2, `degrees` away from straight above the floor, that points straight down: the floor
/// sees it under that angle to its axis. And its irradiance without shaping.
fn leaning(degrees: f64, shaping: ShapingCone) -> (LightDesc, f64) {
    let angle = degrees.to_radians();
    let at = DVec3::new(2.0 * angle.sin(), 2.0 * angle.cos(), 0.0);
    let plain = PI * f64::from(RADIUS).powi(2) / 4.0 * angle.cos();
    (LightDesc { shaping: Some(shaping), ..light(sphere(RADIUS), downwards(at)) }, plain)
}

fn cone(degrees: f32, softness: f32) -> ShapingCone {
    ShapingCone { cone_angle_degrees: degrees, cone_softness: softness, ..ShapingCone::default() }
}

#[test]
fn a_cone_ends_at_its_angle_and_fades_by_its_softness() {
    // smoothStep from 30 degrees, half of the cone, to 60.
    let fade = |degrees: f64| {
        let x = ((degrees - 30.0) / 30.0).clamp(0.0, 1.0);
        1.0 - x * x * (3.0 - 2.0 * x)
    };
    for (degrees, shaping, share) in [
        (29.0, cone(30.0, 0.0), 1.0),
        (31.0, cone(30.0, 0.0), 0.0),
        (20.0, cone(60.0, 0.5), 1.0),
        (40.0, cone(60.0, 0.5), fade(40.0)),
        (50.0, cone(60.0, 0.5), fade(50.0)),
        (62.0, cone(60.0, 0.5), 0.0),
        (80.0, cone(180.0, 0.0), 1.0),
    ] {
        let (light, plain) = leaning(degrees, shaping.clone());
        let what = format!("{degrees} degrees in {shaping:?}");
        expect(&what, 64, plain * share, 6e-3, &|db| db.upsert_light(light.clone()));
    }
}

#[test]
fn focus_is_a_power_of_the_cosine_and_tints_what_it_takes() {
    let shaping = ShapingCone { focus: 3.0, focus_tint: [1.0, 0.5, 0.0], ..cone(180.0, 0.0) };
    let (light, plain) = leaning(40.0, shaping);
    let factor = 40.0_f64.to_radians().cos().powi(3);
    for given in irradiances(64, &|db| db.upsert_light(light.clone())) {
        for (value, tint) in given.into_iter().zip([1.0, 0.5, 0.0]) {
            let expected = plain * (tint + (1.0 - tint) * factor);
            assert!((value / expected - 1.0).abs() < 5e-3, "{value}, not {expected}");
        }
    }
}

/// Irradiance from a small profiled light: the candelas scale its radiance, over their mean if it is to be normalised.
#[test]
fn profiles_scale_radiance_by_candelas() {
    let profile = |degrees: f64, normalize: bool, scale: f32| {
        let ies = Some(TestFiles::asset("cosine.ies"));
        let shaping = ShapingCone { ies, ies_normalize: normalize, ies_angle_scale: scale, ..cone(180.0, 0.0) };
        leaning(degrees, shaping)
    };
    for degrees in [0.0_f64, 30.0, 60.0] {
        let expected = 2.0 * degrees.to_radians().cos();
        let (light, plain) = profile(degrees, false, 0.0);
        expect("profile", 64, plain * expected, 5e-3, &|db| db.upsert_light(light.clone()));
        // It says something of all angles: the mean of 2 cos(theta) over the sphere, half of which is 0, is 1 / 2.
        let (light, plain) = profile(degrees, true, 0.0);
        expect("normalised", 64, plain * expected / 0.5, 5e-3, &|db| db.upsert_light(light.clone()));
    }
    // Straight down stays.
    let (light, plain) = profile(40.0, false, 2.0);
    expect("scaled", 64, plain * 2.0 * 20.0_f64.to_radians().cos(), 5e-3, &|db| db.upsert_light(light.clone()));
    // Straight up stays: 180 - (180 - 40) / 1.25 = 68.
    let (light, plain) = profile(40.0, false, -1.25);
    expect("scaled about up", 64, plain * 2.0 * 68.0_f64.to_radians().cos(), 5e-3, &|db| {
        db.upsert_light(light.clone());
    });
}

/// The cone is not the profile's, and a focus goes backwards as it goes forwards.
#[test]
fn lamps_that_point_up_shine_down_by_profile_and_focus() {
    let upwards = |shaping: ShapingCone| {
        let up = DMat4::from_translation(DVec3::Y * 2.0) * DMat4::from_rotation_x(PI / 2.0);
        LightDesc { shaping: Some(shaping), ..light(sphere(RADIUS), up) }
    };
    let plain = PI * f64::from(RADIUS).powi(2) / 4.0;
    let even = ShapingCone { ies: Some(TestFiles::asset("even.ies")), ..ShapingCone::default() };
    expect("even profile", 64, 3.0 * plain, 5e-3, &|db| db.upsert_light(upwards(even.clone())));
    let focus = ShapingCone { focus: 2.0, ..cone(180.0, 0.0) };
    expect("focus", 64, plain, 5e-3, &|db| db.upsert_light(upwards(focus.clone())));
    expect("cone", 64, 0.0, 0.0, &|db| db.upsert_light(upwards(cone(120.0, 0.0))));
}

#[test]
fn a_shaped_rect_is_cut_off_too() {
    for (angle, share) in [(60.0, 1.0), (20.0, 0.0)] {
        let place = downwards(DVec3::new(2.0, 2.0, 0.0));
        let light = LightDesc { shaping: Some(cone(angle, 0.0)), ..light(rect(0.02, 0.02), place) };
        let expected = share * 0.0004 * 0.5 / 8.0;
        expect("rect", 64, expected, 2e-2, &|db| db.upsert_light(light.clone()));
    }
}

#[test]
fn colour_temperature_exposure_and_colour_multiply() {
    let tint = blackbody(3000.0).expect("a temperature");
    let plain = light(sphere(0.5), DMat4::from_translation(DVec3::Y * 2.0));
    let light =
        LightDesc { color_temperature: Some(3000.0), exposure: 1.0, color: [1.0, 0.5, 0.25], intensity: 3.0, ..plain };
    for given in irradiances(128, &|db| db.upsert_light(light.clone())) {
        for k in 0..3 {
            let expected = PI / 16.0 * 6.0 * tint[k] * [1.0, 0.5, 0.25][k];
            assert!((given[k] / expected - 1.0).abs() < 5e-3, "{} is not {expected}", given[k]);
        }
    }
}
