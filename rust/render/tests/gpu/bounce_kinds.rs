// SPDX-License-Identifier: Apache-2.0
//! Limits of bounces by kind: where a scene has one kind alone, its limit is that of all bounces, bit for bit; other
//! kinds do not count; the same bits while streaming.

use crate::last_bounce::{floor, surface};
use crate::scenes::{self, mesh, prim, square, sun};
use crate::support::{color_request, orthographic, perspective, read, render, settings};
use glam::{DMat4, DVec3};
use oocpt_core::MeshDesc;
use oocpt_core::scene::{ParamValue, SceneDb};
use oocpt_core::settings::Settings;
use oocpt_render::{AovKind, RenderRequest, Session, SessionOptions};
use std::f64::consts::{FRAC_PI_2, PI};

/// Settings of so many bounces, of each kind and in all.
fn limited(bounces: u32, [diffuse, specular, transmission]: [u32; 3]) -> Settings {
    let limits = Settings { max_diffuse_bounces: diffuse, max_specular_bounces: specular, ..settings(4, bounces) };
    Settings { max_transmission_bounces: transmission, ..limits }
}

const ANY: u32 = 1024;

fn picture(settings: Settings, request: &RenderRequest, streams: bool, build: &dyn Fn(&mut SceneDb)) -> Vec<[f32; 4]> {
    let options = SessionOptions { validation: true, force_streaming: streams, ..SessionOptions::default() };
    let session = Session::with_options(settings, options);
    session.with_scene(build);
    render(&session, request);
    read(&session, request, AovKind::Color)
}

fn bits(picture: &[[f32; 4]]) -> Vec<u32> {
    picture.iter().flatten().map(|value| value.to_bits()).collect()
}

fn mean(picture: &[[f32; 4]]) -> f64 {
    picture.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / f64::from(u32::try_from(picture.len()).expect("few"))
}

/// Two boards that see each other, of a material or of none.
fn corner(db: &mut SceneDb, material: Option<(f32, f32)>) {
    let parts = [("/board_0", DMat4::IDENTITY), ("/board_1", DMat4::from_rotation_x(FRAC_PI_2))];
    for (number, (path, transform)) in (41..).zip(parts) {
        let board = square(prim(path, transform), number, 0.8);
        db.upsert_mesh(MeshDesc { material: material.map(|_| "/stuff".into()), ..board });
    }
    if let Some((metallic, roughness)) = material {
        let numbers = [("metallic", metallic), ("roughness", roughness)].map(|(k, v)| (k, ParamValue::Float(v)));
        let color = ("diffuseColor", ParamValue::Vec3([0.8; 3]));
        db.upsert_material(surface("/stuff", &[&numbers[..], &[color]].concat()));
    }
    db.upsert_light(scenes::dome([1.0; 3]));
}

fn into_the_corner() -> RenderRequest {
    color_request(perspective(DVec3::new(0.0, 2.0, 2.0), DVec3::ZERO, 0.7, [12, 12]))
}

#[test]
fn the_limit_of_the_only_kind_is_the_limit_of_all() {
    let view = into_the_corner();
    type Case = (&'static str, Option<(f32, f32)>, fn(u32) -> [u32; 3]);
    let cases: [Case; 2] = [
        ("boards without materials", None, |limit| [limit, ANY, ANY]),
        ("rough metal", Some((1.0, 0.3)), |limit| [ANY, limit, ANY]),
    ];
    for (what, material, kinds) in cases {
        let build = |db: &mut SceneDb| corner(db, material);
        let shown = [0, 1, 2, 4].map(|limit| {
            let by_kind = bits(&picture(limited(4, kinds(limit)), &view, false, &build));
            let of_all = bits(&picture(limited(limit, [ANY; 3]), &view, false, &build));
            assert_eq!(by_kind, of_all, "{what}, {limit} bounces");
            by_kind
        });
        assert!(shown[0] != shown[1] && shown[1] != shown[2], "{what}: bounces show");
    }
}

/// A mirror that shows a board in the sun.
#[test]
fn kinds_are_counted_apart() {
    let build = |db: &mut SceneDb| {
        floor(db, 0.0);
        let facing = DMat4::from_translation(DVec3::new(0.0, 5.0, -5.0)) * DMat4::from_rotation_x(PI / 4.0);
        let corners = [[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [9.0, 9.0, 0.0], [-9.0, 9.0, 0.0]];
        db.upsert_mesh(mesh(prim("/board", facing), 2, corners.to_vec(), &[vec![0, 1, 2, 3]], 0.5));
        // Straight on it; the floor's mirror image of the sun is elsewhere.
        db.upsert_light(sun(3.0, 1.0, DMat4::from_rotation_x(PI / 8.0)));
    };
    let view = color_request(orthographic(DVec3::new(0.0, 5.0, 5.0), DVec3::ZERO, 0.01, [8, 8]));
    let shown = |bounces, kinds| picture(limited(bounces, kinds), &view, false, &build);
    let direct = shown(1, [ANY; 3]);
    assert!(mean(&direct) > 0.1, "the mirror shows the board: {}", mean(&direct));
    assert_eq!(bits(&shown(3, [0, ANY, ANY])), bits(&direct), "the mirror is no diffuse bounce");
    assert_eq!(bits(&shown(1, [ANY, 1, 0])), bits(&direct), "one specular bounce is enough, nothing is transmitted");
    assert!(mean(&shown(3, [ANY, 0, ANY])).abs() < 1e-12, "a mirror without bounces shows lights alone");
}

/// Two interfaces before a board in the sun.
#[test]
fn what_is_behind_glass_takes_a_transmission_for_each_interface() {
    let build = |db: &mut SceneDb| {
        for (number, (path, z)) in (1..).zip([("/front", 2.0), ("/back", 1.0)]) {
            let turned = if number == 1 { 0.0 } else { PI };
            let transform = DMat4::from_translation(DVec3::Z * z) * DMat4::from_rotation_x(turned);
            let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
            let pane = mesh(prim(path, transform), number, corners.to_vec(), &[vec![0, 1, 2, 3]], 0.5);
            db.upsert_mesh(MeshDesc { material: Some("/glass".into()), ..pane });
        }
        let clear = [("opacity", 0.0), ("ior", 1.5), ("roughness", 0.0)].map(|(k, v)| (k, ParamValue::Float(v)));
        db.upsert_material(surface("/glass", &clear));
        let corners = [[-50.0, -50.0, 0.0], [50.0, -50.0, 0.0], [50.0, 50.0, 0.0], [-50.0, 50.0, 0.0]];
        db.upsert_mesh(mesh(prim("/board", DMat4::IDENTITY), 3, corners.to_vec(), &[vec![0, 1, 2, 3]], 0.5));
        // Past the panes.
        db.upsert_light(sun(3.0, 1.0, DMat4::from_rotation_x(-1.2)));
    };
    let view = color_request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 0.01, [16, 16]));
    let shown = |limit| mean(&picture(Settings { samples_per_pixel: 16, ..limited(6, limit) }, &view, false, &build));
    let [none, one, two, all] = [0, 1, 2, ANY].map(|limit| shown([0, ANY, limit]));
    assert!(none.abs() < 1e-12 && one.abs() < 1e-12, "one interface is not enough: {none}, {one}");
    assert!(two > 0.05 && (two / all - 1.0).abs() < 1e-6, "two are: {two}, all {all}");
    assert!(shown([0, 0, 2]) < two, "reflections between the panes are specular");
}

#[test]
fn limits_by_kind_give_the_same_bits_while_streaming() {
    let view = color_request(perspective(DVec3::new(0.0, 3.0, 6.0), DVec3::ZERO, 0.8, [16, 16]));
    let build = |db: &mut SceneDb| {
        scenes::features(db);
        corner(db, Some((0.5, 0.4)));
    };
    let [in_core, streamed, other] = [(false, [1, 0, 1]), (true, [1, 0, 1]), (false, [ANY; 3])]
        .map(|(streams, kinds)| bits(&picture(limited(3, kinds), &view, streams, &build)));
    assert_eq!(in_core, streamed, "the same bits");
    assert_ne!(in_core, other, "the limits show");
}
