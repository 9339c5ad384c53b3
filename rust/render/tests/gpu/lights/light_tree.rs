// SPDX-License-Identifier: Apache-2.0
//! Many lights: the light tree against sums over all of them in f64; lights of extreme power and size.

use super::mesh::{corners, glow, quad};
use super::shapes::polygon;
use super::{disk, downwards, expect, irradiances, light, sphere};
use crate::scenes::{instanced, instancer, prim};
use glam::{DMat4, DQuat, DVec3};
use oocpt_core::{LightDesc, LightKind};
use std::f64::consts::PI;

/// Numbers between 0 and 1 that only depend on `i`.
fn scattered(i: u32) -> DVec3 {
    let i = f64::from(i);
    DVec3::new(0.754_877_666_246_7 * i, 0.569_840_290_998 * i, 0.381_966_011_250_1 * i).fract()
}

fn place(i: u32) -> DVec3 {
    DVec3::new(-8.0, 0.5, -8.0) + scattered(i) * DVec3::new(16.0, 4.0, 16.0)
}

/// Small spheres of changing power in a room, some below the floor.
#[test]
fn the_tree_agrees_with_the_sum_over_all_lights() {
    for count in [1_u32, 2, 100] {
        let radius = 0.05;
        let lights: Vec<LightDesc> = (1..=count)
            .map(|i| LightDesc {
                prim: prim(&format!("/light_{i}"), DMat4::from_translation(place(i))),
                intensity: f32::from(u8::try_from(1 + i % 9).expect("small")).powi(2),
                ..light(sphere(radius), DMat4::IDENTITY)
            })
            .collect();
        let sum: f64 = (1..=count)
            .map(|i| {
                let (at, d) = (place(i), place(i).length());
                let power = f64::from(1 + i % 9).powi(2);
                power * PI * f64::from(radius).powi(2) / (d * d) * at.y / d
            })
            .sum();
        for given in irradiances(1024, &|db| lights.iter().for_each(|light| db.upsert_light(light.clone()))) {
            assert!((given[0] / sum - 1.0).abs() < 1e-2, "{count} lights: {}, not {sum}", given[0]);
        }
    }
}

/// A hundred thousand disks that look down, half of them up, by an instancer: the core multiplies them out.
#[test]
fn a_hundred_thousand_instanced_lights_agree_with_their_sum() {
    const COUNT: u32 = 100_000;
    let radius = 0.01;
    let down = |i: u32| i.is_multiple_of(2);
    let sum: f64 = (0..COUNT)
        .filter(|&i| down(i))
        .map(|i| {
            let (at, d) = (place(i), place(i).length());
            let cosine = at.y / d;
            PI * f64::from(radius).powi(2) * cosine * cosine / (d * d)
        })
        .sum();
    let build = |db: &mut oocpt_core::scene::SceneDb| {
        let turn = |i: u32| DQuat::from_rotation_x(if down(i) { -PI / 2.0 } else { PI / 2.0 });
        let places: Vec<_> = (0..COUNT).map(|i| (place(i), turn(i), DVec3::ONE)).collect();
        db.upsert_instancer(instancer(prim("/lamps", DMat4::IDENTITY), "/lamps/lamp", &places));
        let lamp = LightDesc {
            prim: instanced(prim("/lamps/lamp", DMat4::IDENTITY), "/lamps"),
            ..light(disk(radius), DMat4::IDENTITY)
        };
        db.upsert_light(lamp);
    };
    for given in irradiances(1024, &build) {
        assert!((given[0] / sum - 1.0).abs() < 1e-2, "{}, not {sum}", given[0]);
    }
}

/// Finite lights, a sun and a dome at once: each has its share.
#[test]
fn lights_of_all_kinds_add_up() {
    let build = |db: &mut oocpt_core::scene::SceneDb| {
        db.upsert_light(LightDesc { camera_visible: false, ..crate::scenes::dome([0.25; 3]) });
        db.upsert_light(crate::scenes::sun(0.5, 10.0, DMat4::from_rotation_x(-PI / 2.0)));
        db.upsert_light(LightDesc {
            prim: prim("/sphere", DMat4::from_translation(DVec3::Y * 2.0)),
            ..light(sphere(0.5), DMat4::IDENTITY)
        });
        let point = LightKind::Sphere { radius: 0.5, treat_as_point: true };
        db.upsert_light(LightDesc {
            prim: prim("/point", DMat4::from_translation(DVec3::Y * 4.0)),
            ..light(point, DMat4::IDENTITY)
        });
        let rect = LightDesc { prim: prim("/disk", downwards(DVec3::Y * 1.0)), ..light(disk(0.25), DMat4::IDENTITY) };
        db.upsert_light(rect);
    };
    let expected = 0.25 * PI + 0.5 + PI / 16.0 + PI * 0.25 / 16.0 + PI * 0.0625 / 1.0625;
    for given in irradiances(2048, &build) {
        assert!((given[0] / expected - 1.0).abs() < 1e-2, "{}, not {expected}", given[0]);
    }
}

/// No NaN for any numbers; `irradiance_with` looks for them, and the stats for samples that were dropped.
#[test]
fn extreme_lights_stay_finite() {
    for intensity in [1e-30_f32, 1.0, 1e30] {
        let build = |db: &mut oocpt_core::scene::SceneDb| {
            let kinds = [
                sphere(0.0),
                sphere(1e-3),
                sphere(0.5),
                disk(0.0),
                super::rect(0.0, 1.0),
                super::rect(1e-3, 1e-3),
                super::cylinder(0.0, 1.0),
                super::cylinder(1.0, 0.0),
                LightKind::Sphere { radius: 0.0, treat_as_point: true },
            ];
            for (k, kind) in kinds.into_iter().enumerate() {
                for normalize in [false, true] {
                    let at = downwards(DVec3::new(0.1 * f64::from(u8::try_from(k).expect("small")), 1.0, 0.0));
                    let prim = prim(&format!("/l{k}{normalize}"), at);
                    let size = if normalize { 1e-3 } else { 1.0 };
                    db.upsert_light(LightDesc {
                        prim,
                        normalize,
                        intensity: intensity * size,
                        ..light(kind.clone(), DMat4::IDENTITY)
                    });
                }
            }
        };
        for given in irradiances(32, &build) {
            assert!(given.iter().all(|v| v.is_finite() && *v > 0.0), "{intensity}: {given:?}");
        }
    }
}

/// Lights that contribute nothing take no light away, however bright: one that shines away from the floor counts for
/// the trees by its power, and the dim one beside it keeps its share, among local lights, and beside a mesh.
#[test]
fn a_dim_light_is_sampled_beside_a_bright_one_facing_away() {
    let away = LightDesc {
        prim: prim("/away", DMat4::from_translation(DVec3::Y * 3.0) * DMat4::from_rotation_x(PI / 2.0)),
        intensity: 1e30,
        ..light(disk(1.0), DMat4::IDENTITY)
    };
    let dim = |intensity: f32| LightDesc {
        prim: prim("/dim", DMat4::from_translation(DVec3::Y * 2.0)),
        intensity,
        ..light(sphere(0.5), DMat4::IDENTITY)
    };
    let above = downwards(DVec3::new(0.0, 1.0, -0.5));
    for intensity in [1.0_f32, 1e-15] {
        let brightness = f64::from(intensity);
        expect("a dim light", 256, brightness * PI / 16.0, 1e-2, &|db| {
            db.upsert_light(away.clone());
            db.upsert_light(dim(intensity));
        });
        expect("a dim mesh", 1024, brightness * polygon(&corners(above)), 1e-2, &|db| {
            db.upsert_light(away.clone());
            db.upsert_material(glow("/glow", [intensity; 3]));
            db.upsert_mesh(quad("/quad", 2, above));
        });
    }
}

/// Two lights on either side of the receiver are a group around it: it counts for no more than its size allows, and
/// leaves the share of a light far away.
#[test]
fn a_light_cluster_around_the_receiver_does_not_starve_others() {
    let at = [DVec3::new(2.0, 1.0, 0.0), DVec3::new(-2.0, -1.0, 0.0), DVec3::new(0.0, 20.0, 0.0)];
    let intensity = [1.0, 1.0, 20.0_f32];
    let sum: f64 =
        [0, 2].map(|i: usize| f64::from(intensity[i]) * PI * 0.01 * at[i].y / at[i].length().powi(3)).iter().sum();
    expect("a group and another", 1024, sum, 1e-2, &|db| {
        for (i, (at, intensity)) in at.into_iter().zip(intensity).enumerate() {
            let prim = prim(&format!("/light_{i}"), DMat4::from_translation(at));
            db.upsert_light(LightDesc { prim, intensity, ..light(sphere(0.1), DMat4::IDENTITY) });
        }
    });
}
