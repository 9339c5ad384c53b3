// SPDX-License-Identifier: Apache-2.0
//! Light through glass: the light that enters a clear block leaves it again.

use crate::scenes::{dome, mesh, prim};
use crate::support::{color_request, orthographic, read, render, session, settings};
use glam::{DMat4, DQuat, DVec3, EulerRot};
use oocpt_core::LightDesc;
use oocpt_core::scene::{MaterialDesc, NodeDesc, ParamDesc, ParamValue};
use oocpt_render::AovKind;

fn glass(roughness: f32) -> MaterialDesc {
    let param = |name: &str, value| ParamDesc { name: name.into(), value };
    let params = vec![
        param("opacity", ParamValue::Float(0.0)),
        param("ior", ParamValue::Float(1.5)),
        param("roughness", ParamValue::Float(roughness)),
        param("diffuseColor", ParamValue::Vec3([1.0; 3])),
    ];
    let node =
        NodeDesc { path: "/glass/surface".into(), kind: "UsdPreviewSurface".into(), params, connections: vec![] };
    MaterialDesc { path: "/glass".into(), nodes: vec![node], surface: Some(0), ..MaterialDesc::default() }
}

/// The picture of a tilted block of glass of this roughness under `light`.
fn block_in(light: LightDesc, roughness: f32) -> Vec<[f32; 4]> {
    let session = session(settings(64, 24));
    session.with_scene(|db| {
        let corner = |i: u8| [0, 1, 2].map(|k| f32::from(i >> k & 1) - 0.5);
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let turned = DMat4::from_quat(DQuat::from_euler(EulerRot::XYZ, 0.6, 0.4, 0.2));
        let block = mesh(prim("/block", turned), 1, (0..8).map(corner).collect(), &faces.map(Vec::from), 0.5);
        db.upsert_mesh(oocpt_core::MeshDesc { material: Some("/glass".into()), ..block });
        db.upsert_material(glass(roughness));
        db.upsert_light(light);
    });
    let request = color_request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 2.0, [32, 32]));
    render(&session, &request);
    read(&session, &request, AovKind::Color)
}

/// Shadow rays take part in this: those that go through must start beyond the surface.
#[test]
fn a_clear_glass_block_in_a_white_furnace_disappears() {
    let pixels = block_in(dome([1.0; 3]), 0.0);
    let mean = pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / 1024.0;
    assert!((mean - 1.0).abs() < 3e-3, "{mean}, not 1");
    let middle: Vec<f32> = (12..20).flat_map(|y| pixels[y * 32 + 12..y * 32 + 20].iter().map(|p| p[0])).collect();
    let mean = middle.iter().sum::<f32>() / 64.0;
    assert!((mean - 1.0).abs() < 1e-2, "{mean} in the middle, not 1");
}

/// The furnace for a frosted block, within the error of its table of multiple scattering: it tests the whole way of a
/// scene with rough glass.
#[test]
fn a_rough_glass_block_in_a_white_furnace_nearly_disappears() {
    let pixels = block_in(dome([1.0; 3]), 0.4);
    let mean = pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / 1024.0;
    assert!((mean - 1.0).abs() < 5e-3, "{mean}, not 1");
    let middle: Vec<f32> = (12..20).flat_map(|y| pixels[y * 32 + 12..y * 32 + 20].iter().map(|p| p[0])).collect();
    let mean = middle.iter().sum::<f32>() / 64.0;
    assert!((mean - 1.0).abs() < 1e-2, "{mean} in the middle, not 1");
}
