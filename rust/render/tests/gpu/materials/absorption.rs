// SPDX-License-Identifier: Apache-2.0
//! The interior of glass: absorption along the way, thin walls; and tangents of anisotropic lobes in pictures.

use super::*;

const OPEN_PBR: &str = "ND_open_pbr_surface_surfaceshader";

fn float(value: f32) -> ParamValue {
    ParamValue::Float(value)
}

/// Clear glass in a colour, and one input more.
pub(crate) fn clear(name: &str, value: ParamValue) -> [(&str, ParamValue); 4] {
    [
        ("specular_roughness", ParamValue::Float(0.0)),
        ("transmission_weight", ParamValue::Float(1.0)),
        ("transmission_color", ParamValue::Vec3([0.5; 3])),
        (name, value),
    ]
}

/// A slab of glass of index 1, `thickness` thick and across the whole view: two boards, one the other way round.
fn slab(params: &[(&str, ParamValue)], thickness: f64, streams: bool) -> Vec<[f32; 4]> {
    let own = [("specular_roughness", float(0.0)), ("specular_ior", float(1.0)), ("transmission_weight", float(1.0))];
    let params: Vec<(&str, ParamValue)> = [&own[..], params].concat();
    let options = SessionOptions { validation: true, force_streaming: streams, ..SessionOptions::default() };
    let session = Session::with_options(settings(4, 3), options);
    session.with_scene(|db| {
        db.upsert_material(material("/m", vec![node(OPEN_PBR, &params, &[])]));
        db.upsert_mesh(board("/front", 1, "/m"));
        let mut back = board("/back", 2, "/m");
        back.prim.transform =
            DMat4::from_translation(DVec3::Z * -thickness) * DMat4::from_rotation_y(std::f64::consts::PI);
        db.upsert_mesh(back);
        db.upsert_light(dome([1.0; 3]));
    });
    let request = front();
    render(&session, &request);
    read(&session, &request, AovKind::Color)
}

/// Half a depth gives the root of the colour, whatever the interface.
#[test]
fn glass_absorbs_along_the_path_length() {
    let params = [("transmission_color", color([0.25, 0.5, 0.81])), ("transmission_depth", float(2.0))];
    for (thickness, power) in [(1.0, 0.5), (4.0, 2.0)] {
        let [inside, streamed] = [false, true].map(|streams| slab(&params, thickness, streams));
        assert!(inside == streamed, "streaming changed the picture");
        for pixel in &inside {
            for (found, color) in pixel.iter().zip([0.25_f32, 0.5, 0.81]) {
                let known = color.powf(power);
                assert!((found - known).abs() < 2e-3, "{thickness}: {pixel:?}, {known} of {color}");
            }
        }
    }
}

/// A sheet tints once and bends nothing, though its index is that of glass; its reflection is the part that it does not
/// transmit.
#[test]
fn a_thin_wall_is_tinted_once() {
    let params = [
        ("specular_roughness", float(0.0)),
        ("transmission_weight", float(1.0)),
        ("transmission_color", color([0.25, 0.5, 1.0])),
        ("geometry_thin_walled", ParamValue::Bool(true)),
    ];
    let (session, request) = shown(
        |db| {
            db.upsert_material(material("/m", vec![node(OPEN_PBR, &params, &[])]));
            db.upsert_mesh(board("/a", 1, "/m"));
            db.upsert_light(dome([1.0; 3]));
        },
        256,
    );
    let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    // Both interfaces head on: 2 R / (1 + R), R = 0.04.
    let reflected = 0.08 / 1.04;
    for (channel, tint) in [0.25, 0.5, 1.0].into_iter().enumerate() {
        let mean = pixels.iter().map(|p| f64::from(p[channel])).sum::<f64>() / 1024.0;
        let known = reflected + (1.0 - reflected) * tint;
        assert!((mean - known).abs() < 2e-3, "{mean}, not {known}");
    }
}

/// A brushed metal under a light to the side of u shines where its lobe is wide: turned by a quarter it does not.
#[test]
fn lobes_follow_the_tangent() {
    let seen = |rotation: f32, mirrored: bool| {
        let params = [
            ("base", float(1.0)),
            ("metalness", float(1.0)),
            ("specular_roughness", float(0.3)),
            ("specular_anisotropy", float(0.9)),
            ("specular_rotation", float(rotation)),
        ];
        let (session, request) = shown(
            |db| {
                db.upsert_material(material("/m", vec![node("ND_standard_surface_surfaceshader", &params, &[])]));
                let st = coordinates(|[s, t]| if mirrored { [-s, t] } else { [s, t] });
                db.upsert_mesh(with(board("/a", 1, "/m"), "st", Interpolation::Vertex, st));
                // From the side: half vectors are 0.35 away from the normal, along x.
                db.upsert_light(crate::scenes::sun(1.0, 5.0, DMat4::from_rotation_y(0.7)));
            },
            64,
        );
        let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
        pixels.iter().map(|p| f64::from(p[0])).sum::<f64>() / 1024.0
    };
    let (along, across) = (seen(0.0, false), seen(0.25, false));
    assert!(along > 4.0 * across, "{along} along u, {across} across it");
    // An eighth to either side is the same; so is an eighth of the mirrored set.
    let (left, right, mirrored) = (seen(0.125, false), seen(-0.125, false), seen(0.125, true));
    assert!((left / right - 1.0).abs() < 0.05 && (mirrored / right - 1.0).abs() < 0.05, "{left} {right} {mirrored}");
}
