// SPDX-License-Identifier: Apache-2.0
//! Light at the last surface of a path: shadow rays give what lobes with a density reflect, and the ray of a delta lobe
//! all that it meets.

use crate::scenes::{dome, mesh, prim, square, sun};
use crate::support::{color_request, orthographic, read, render, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::scene::{MaterialDesc, NodeDesc, ParamDesc, ParamValue, SceneDb};
use oocpt_core::{LightDesc, LightKind, MeshDesc};
use oocpt_render::AovKind;
use std::f64::consts::PI;

/// Adds something to a scene.
type Build<'a> = &'a dyn Fn(&mut SceneDb);

pub(crate) fn surface(path: &str, params: &[(&str, ParamValue)]) -> MaterialDesc {
    let param = |(name, value): &(&str, ParamValue)| ParamDesc { name: (*name).into(), value: value.clone() };
    let node = NodeDesc {
        path: format!("{path}/surface").into(),
        kind: "UsdPreviewSurface".into(),
        params: params.iter().map(param).collect(),
        connections: vec![],
    };
    MaterialDesc { path: path.into(), nodes: vec![node], surface: Some(0), ..MaterialDesc::default() }
}

/// A floor that reflects all, sharply or not.
pub(crate) fn floor(db: &mut SceneDb, roughness: f32) {
    let floor = square(prim("/floor", DMat4::IDENTITY), 1, 0.5);
    db.upsert_mesh(MeshDesc { material: Some("/mirror".into()), ..floor });
    let params = [("metallic", 1.0), ("roughness", roughness)].map(|(name, value)| (name, ParamValue::Float(value)));
    db.upsert_material(surface("/mirror", &[&params[..], &[("diffuseColor", ParamValue::Vec3([1.0; 3]))]].concat()));
}

/// The mean red of the floor, seen by a camera at an angle with so many bounces.
fn shown(bounces: u32, samples: u32, build: Build<'_>) -> f64 {
    let session = session(settings(samples, bounces));
    session.with_scene(build);
    let request = color_request(orthographic(DVec3::new(0.0, 5.0, 5.0), DVec3::ZERO, 0.01, [8, 8]));
    render(&session, &request);
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    colors.iter().map(|color| f64::from(color[0])).sum::<f64>() / 64.0
}

/// Mirrors of the camera's directions go to (0, 1, -1).
fn ahead() -> DMat4 {
    DMat4::from_translation(DVec3::new(0.0, 5.0, -5.0)) * DMat4::from_rotation_x(PI / 4.0)
}

fn lamp() -> LightDesc {
    let kind = LightKind::Sphere { radius: 1.0, treat_as_point: false };
    LightDesc { prim: prim("/lamp", ahead()), kind, camera_visible: false, color: [2.0; 3], ..LightDesc::default() }
}

#[test]
fn a_mirror_at_the_last_bounce_shows_every_light() {
    let glowing = |db: &mut SceneDb| {
        let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
        let board = mesh(prim("/board", ahead()), 2, corners.to_vec(), &[vec![0, 1, 2, 3]], 0.5);
        db.upsert_mesh(MeshDesc { material: Some("/glow".into()), ..board });
        db.upsert_material(surface("/glow", &[("emissiveColor", ParamValue::Vec3([2.0; 3]))]));
    };
    let sky = || LightDesc { camera_visible: false, ..dome([2.0; 3]) };
    // A sun of radiance 2, five degrees wide.
    let shares = PI * 2.5_f64.to_radians().sin().powi(2);
    #[expect(clippy::cast_possible_truncation, reason = "a small number")]
    let wide = || sun((2.0 * shares) as f32, 5.0, DMat4::from_rotation_x(PI / 4.0) * DMat4::from_rotation_y(PI));
    let kinds: [(&str, Build<'_>); 6] = [
        ("a lamp", &|db| db.upsert_light(lamp())),
        ("a lamp without shadows", &|db| db.upsert_light(LightDesc { shadow_enable: false, ..lamp() })),
        ("the sky", &|db| db.upsert_light(sky())),
        ("a sky without shadows", &|db| db.upsert_light(LightDesc { shadow_enable: false, ..sky() })),
        ("a wide sun", &|db| db.upsert_light(wide())),
        ("a glowing board", &glowing),
    ];
    for bounces in [0, 1] {
        for (what, light) in kinds {
            let given = shown(bounces, 16, &|db| {
                floor(db, 0.0);
                light(db);
            });
            assert!((given - 2.0).abs() < 1e-3, "{what} with {bounces} bounces: {given}, not 2");
        }
    }
}

/// Shadow rays alone, and the balance heuristic with a bounce: as much.
#[test]
fn a_rough_metal_gets_the_same_lamp_light_at_the_last_bounce() {
    let given = [0, 1].map(|bounces| {
        shown(bounces, 1024, &|db| {
            floor(db, 0.4);
            db.upsert_light(lamp());
        })
    });
    assert!(given[0] > 0.1 && (given[0] / given[1] - 1.0).abs() < 1e-2, "{given:?}");
}
