// SPDX-License-Identifier: Apache-2.0
//! Inputs that come from primvars of the mesh.

use super::*;

#[test]
fn primvars_of_every_rate_reach_the_surface() {
    let corners = |f: fn([f32; 2]) -> [f32; 3]| {
        let at = [-1.0, 0.0, 1.0_f32];
        at.iter().flat_map(|&y| at.map(|x| f([x, y]))).collect::<Vec<_>>()
    };
    let ramp = |[x, y]: [f32; 2]| [0.5 + 0.25 * x, 0.5 + 0.25 * y, 0.125];
    let by_face = [[0.0, 0.25, 0.5], [0.25; 3], [0.5; 3], [1.0; 3]];
    // A ramp of its own on each face, so that every corner counts.
    let by_corner = |face: usize, at: [f32; 2]| ramp(at).map(|x| x * [1.0, 0.5, 0.25, 0.75][face]);
    let of_corners: Vec<[f32; 3]> = [[-1.0, -1.0], [0.0, -1.0], [-1.0, 0.0], [0.0, 0.0_f32]]
        .into_iter()
        .enumerate()
        .flat_map(|(face, [x, y])| {
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[u, v]| by_corner(face, [x + u, y + v]))
        })
        .collect();
    let cases: Vec<(Interpolation, Vec<[f32; 3]>)> = vec![
        (Interpolation::Constant, vec![[0.5, 0.25, 0.75]]),
        (Interpolation::Uniform, by_face.to_vec()),
        (Interpolation::FaceVarying, of_corners),
        (Interpolation::Vertex, corners(ramp)),
        (Interpolation::Varying, corners(ramp)),
    ];
    for (interpolation, values) in cases {
        let first = values[0];
        let (session, request) = shown(
            |db| {
                db.upsert_material(reading("/m", "diffuseColor", "float3", "tint", &[]));
                db.upsert_mesh(with(board("/a", 5, "/m"), "tint", interpolation, values));
            },
            1,
        );
        let albedo: Vec<[f32; 3]> = read(&session, &request, AovKind::Albedo);
        let faces: Vec<i32> = read(&session, &request, AovKind::ElementId);
        for (pixel, (albedo, face)) in albedo.iter().zip(faces).enumerate() {
            let expected = match interpolation {
                Interpolation::Constant => first,
                Interpolation::Uniform => by_face[usize::try_from(face).expect("a hit")],
                Interpolation::FaceVarying => by_corner(usize::try_from(face).expect("a hit"), place(pixel)),
                _ => ramp(place(pixel)),
            };
            let off = (Vec3::from(*albedo) - Vec3::from(expected)).abs().max_element();
            assert!(off < 1e-5, "{interpolation:?}, pixel {pixel}: {albedo:?}, not {expected:?}");
        }
    }
}

#[test]
fn a_missing_primvar_is_the_readers_fallback() {
    let (session, request) = shown(
        |db| {
            let fallback = ("fallback", color([0.5, 0.25, 0.125]));
            let name = ("varname", ParamValue::Text("nowhere".into()));
            let reader = node("UsdPrimvarReader_float3", &[fallback, name], &[]);
            db.upsert_material(material("/m", vec![node("UsdPreviewSurface", &[], &[("diffuseColor", 1)]), reader]));
            db.upsert_mesh(board("/a", 5, "/m"));
        },
        1,
    );
    let albedo: Vec<[f32; 3]> = read(&session, &request, AovKind::Albedo);
    assert!(albedo.iter().all(|a| *a == [0.5, 0.25, 0.125]), "{:?}", albedo[0]);
}

/// A float input sets all three components of a colour.
#[test]
fn a_float_makes_a_grey_colour() {
    let (session, request) = shown(
        |db| {
            db.upsert_material(reading("/m", "diffuseColor", "float", "tint", &[]));
            db.upsert_mesh(with(board("/a", 5, "/m"), "tint", Interpolation::Constant, vec![0.375_f32]));
        },
        1,
    );
    let albedo: Vec<[f32; 3]> = read(&session, &request, AovKind::Albedo);
    assert!(albedo.iter().all(|a| *a == [0.375; 3]), "{:?}", albedo[0]);
}
