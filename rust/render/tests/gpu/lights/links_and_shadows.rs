// SPDX-License-Identifier: Apache-2.0
//! Switches of lights: multipliers, shadows and their colour, visibility to the camera, features that are left out.

use super::{downwards, expect, irradiances, light, rect, sphere};
use crate::scenes::{dome, prim, square, sun};
use crate::support::{perspective, read, render, request, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::LightDesc;
use oocpt_render::AovKind;
use std::f64::consts::PI;

const HALF_SPHERE: f64 = PI / 16.0;

fn lamp() -> LightDesc {
    light(sphere(0.5), DMat4::from_translation(DVec3::Y * 2.0))
}

#[test]
fn the_diffuse_multiplier_scales_lambert_and_the_specular_one_does_not() {
    for (diffuse, specular) in [(0.5, 1.0), (1.0, 0.0), (2.0, 2.0)] {
        let light = LightDesc { diffuse, specular, ..lamp() };
        expect("sphere", 128, f64::from(diffuse) * HALF_SPHERE, 5e-3, &|db| db.upsert_light(light.clone()));
        let sky = LightDesc { diffuse, specular, camera_visible: false, ..dome([0.5; 3]) };
        expect("dome", 128, f64::from(diffuse) * 0.5 * PI, 5e-3, &|db| db.upsert_light(sky.clone()));
    }
}

#[test]
fn shadows_can_be_off_or_coloured() {
    // Large enough for the lights, too small to hide the floor from the camera.
    let roof =
        || square(prim("/roof", DMat4::from_translation(DVec3::Y) * DMat4::from_scale(DVec3::splat(0.4))), 2, 0.0);
    let blocked = |light: &LightDesc| {
        irradiances(128, &|db| {
            db.upsert_light(light.clone());
            db.upsert_mesh(roof());
        })
    };
    #[expect(clippy::cast_possible_truncation, reason = "a small number")]
    let sun = sun(HALF_SPHERE as f32, 10.0, DMat4::from_rotation_x(-PI / 2.0));
    for light in [lamp(), sun] {
        for given in blocked(&light) {
            assert!(given[0].abs() < 1e-9, "a roof shadows: {given:?}");
        }
        for given in blocked(&LightDesc { shadow_enable: false, ..light.clone() }) {
            assert!((given[0] / HALF_SPHERE - 1.0).abs() < 5e-3, "no shadow: {given:?}");
        }
        for given in blocked(&LightDesc { shadow_color: [1.0, 0.5, 0.0], ..light.clone() }) {
            assert!(
                (given[0] / HALF_SPHERE - 1.0).abs() < 5e-3 && (given[1] / HALF_SPHERE - 0.5).abs() < 5e-3,
                "{given:?}"
            );
            assert!(given[2].abs() < 1e-9, "{given:?}");
        }
    }
    // Without an occluder, the shadow colour changes nothing.
    let tinted = LightDesc { shadow_color: [1.0, 0.5, 0.0], ..lamp() };
    expect("unblocked", 128, HALF_SPHERE, 5e-3, &|db| db.upsert_light(tinted.clone()));
    let sky = LightDesc { camera_visible: false, ..dome([0.5; 3]) };
    for (shadow_enable, shadow_color) in [(false, [0.0; 3]), (true, [0.3; 3])] {
        let sky = LightDesc { shadow_enable, shadow_color, ..sky.clone() };
        expect("sky", 128, 0.5 * PI, 5e-3, &|db| db.upsert_light(sky.clone()));
    }
}

/// Light linking: a light shines on the prims of its collection only, by shadow rays and by BSDF rays.
#[test]
fn linked_lights_shine_on_their_collections_only() {
    let category: std::sync::Arc<str> = "linked".into();
    for (kind, full) in [("sphere", HALF_SPHERE), ("sun", HALF_SPHERE), ("sky", 0.5 * PI)] {
        for (on_floor, on_other, share) in [(true, false, 1.0), (false, true, 0.0), (false, false, 0.0)] {
            let build = |db: &mut oocpt_core::scene::SceneDb| {
                let with = |is_in: bool| if is_in { vec![category.clone()] } else { vec!["unknown".into()] };
                let mut floor = square(prim("/floor", DMat4::IDENTITY), 1, super::ALBEDO);
                floor.categories = with(on_floor);
                db.upsert_mesh(floor);
                let mut other = square(prim("/other", DMat4::from_translation(DVec3::X * 30.0)), 2, 0.5);
                other.categories = with(on_other);
                db.upsert_mesh(other);
                #[expect(clippy::cast_possible_truncation, reason = "a small number")]
                let light = match kind {
                    "sphere" => lamp(),
                    "sun" => sun(HALF_SPHERE as f32, 10.0, DMat4::from_rotation_x(-PI / 2.0)),
                    _ => LightDesc { camera_visible: false, ..dome([0.5; 3]) },
                };
                db.upsert_light(LightDesc { light_link: Some(category.clone()), ..light });
            };
            expect(&format!("{kind} {on_floor} {on_other}"), 128, full * share, 5e-3, &build);
        }
    }
}

/// Shadow linking: only the prims of the collection are in the light's way.
#[test]
fn shadow_links_limit_shadow_casters() {
    let category: std::sync::Arc<str> = "casters".into();
    for (is_caster, share) in [(true, 0.0), (false, 1.0)] {
        #[expect(clippy::cast_possible_truncation, reason = "a small number")]
        for light in [lamp(), sun(HALF_SPHERE as f32, 10.0, DMat4::from_rotation_x(-PI / 2.0))] {
            let build = |db: &mut oocpt_core::scene::SceneDb| {
                let place = DMat4::from_translation(DVec3::Y) * DMat4::from_scale(DVec3::splat(0.4));
                let mut roof = square(prim("/roof", place), 2, 0.0);
                roof.categories = if is_caster { vec![category.clone()] } else { Vec::new() };
                db.upsert_mesh(roof);
                // The collection is never empty.
                let mut other = square(prim("/other", DMat4::from_translation(DVec3::X * 30.0)), 3, 0.0);
                other.categories = vec![category.clone()];
                db.upsert_mesh(other);
                db.upsert_light(LightDesc { shadow_link: Some(category.clone()), ..light.clone() });
            };
            expect(&format!("caster {is_caster}"), 128, HALF_SPHERE * share, 5e-3, &build);
        }
    }
}

#[test]
fn camera_visibility_of_lights_is_respected() {
    for camera_visible in [true, false] {
        let session = session(settings(8, 1));
        session.with_scene(|db| {
            db.upsert_light(LightDesc { camera_visible, color: [3.0; 3], ..lamp() });
            let board = prim("/board", downwards(DVec3::new(4.0, 2.0, 0.0)));
            db.upsert_light(LightDesc {
                prim: board,
                camera_visible,
                color: [5.0; 3],
                ..light(rect(1.0, 1.0), DMat4::IDENTITY)
            });
            let ground = DMat4::from_translation(DVec3::Y * -20.0) * DMat4::from_scale(DVec3::splat(0.01));
            db.upsert_mesh(square(prim("/mesh", ground), 1, 0.0));
        });
        for (eye, target, radiance) in [
            (DVec3::new(0.0, 2.0, 5.0), DVec3::Y * 2.0, 3.0_f32),
            (DVec3::new(4.0, 0.0, 0.1), DVec3::new(4.0, 2.0, 0.0), 5.0),
            (DVec3::new(4.0, 4.0, 0.1), DVec3::new(4.0, 2.0, 0.0), 0.0),
        ] {
            let request = request(perspective(eye, target, 0.02, [4, 4]));
            render(&session, &request);
            let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
            let expected = if camera_visible { radiance } else { 0.0 };
            let alpha = if expected > 0.0 { 1.0 } else { 0.0 };
            let worst = colors.iter().map(|c| (c[0] - expected).abs().max((c[3] - alpha).abs())).fold(0.0, f32::max);
            assert!(worst < 1e-5, "{eye}: {:?} instead of {expected}", colors[0]);
        }
    }
}

#[test]
fn unused_light_features_are_omitted() {
    let left_out = |lights: Vec<LightDesc>| {
        let session = session(settings(1, 0));
        session.with_scene(|db| {
            db.upsert_mesh(square(prim("/floor", DMat4::IDENTITY), 1, 0.5));
            lights.into_iter().for_each(|light| db.upsert_light(light));
        });
        render(&session, &request(perspective(DVec3::ONE, DVec3::ZERO, 0.5, [4, 4])));
        session.stats().features_left_out
    };
    let parts = ["local lights", "shaping", "IES", "dome textures", "rect lights", "linking"];
    let names = |list: &[String]| parts.iter().filter(|part| list.iter().any(|name| name.contains(*part))).count();
    assert_eq!(names(&left_out(vec![dome([1.0; 3])])), parts.len(), "constant domes need none of it");
    let lamp = left_out(vec![lamp()]);
    assert_eq!(names(&lamp), parts.len() - 1, "a sphere needs the tree: {lamp:?}");
}
