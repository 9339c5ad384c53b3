// SPDX-License-Identifier: Apache-2.0
//! Opacity, normals in tangent space, textures.

use super::*;

#[test]
fn thresholds_cut_out_and_presence_is_a_probability() {
    let opacity: Vec<f32> = [-1.0, 0.0, 1.0_f32].iter().flat_map(|_| [0.0, 0.5, 1.0]).collect();
    let (session, request) = shown(
        |db| {
            let threshold = [("opacityThreshold", ParamValue::Float(0.25))];
            db.upsert_material(reading("/leaf", "opacity", "float", "alpha", &threshold));
            let leaf = with(board("/a", 5, "/leaf"), "alpha", Interpolation::Vertex, opacity);
            // displayOpacity does not apply to surfaces with a material.
            db.upsert_mesh(MeshDesc { display_opacity: constant(0.5_f32), ..leaf });
        },
        4,
    );
    // Opacity is (x + 1) / 2: left of x = -0.5 the surface is cut out, the rest is opaque.
    let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
    for (pixel, id) in ids.iter().enumerate() {
        assert_eq!(*id, if place(pixel)[0] < -0.5 { -1 } else { 5 }, "pixel {pixel}");
    }
    // The same for paths, apart from the column of pixels that the edge runs beside.
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    for (pixel, color) in colors.iter().enumerate().filter(|(k, _)| (place(*k)[0] + 0.5).abs() > 0.05) {
        assert_eq!(color[3], if place(pixel)[0] < -0.5 { 0.0 } else { 1.0 }, "pixel {pixel}");
    }

    let (session, request) = shown(
        |db| {
            let params = [("opacity", ParamValue::Float(0.25)), ("opacityMode", ParamValue::Text("presence".into()))];
            db.upsert_material(plain("/veil", &params));
            db.upsert_mesh(board("/a", 5, "/veil"));
        },
        256,
    );
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let mean: f32 = colors.iter().map(|c| c[3]).sum::<f32>() / 1024.0;
    // 262144 trials: the standard deviation is 0.00085.
    assert!((mean - 0.25).abs() < 0.004, "{mean} of the rays met it, not a quarter");
}

/// `UsdPreviewSurface` cuts out opacities below the threshold: at the threshold the surface is opaque, wherever the
/// opacity comes from.
#[test]
fn opacity_at_the_threshold_is_opaque() {
    let threshold = |value: f32| ("opacityThreshold", ParamValue::Float(value));
    for (limit, id) in [(0.25, 5), (0.25_f32.next_up(), -1)] {
        let (session, request) = shown(
            |db| {
                db.upsert_material(plain("/m", &[("opacity", ParamValue::Float(0.25)), threshold(limit)]));
                db.upsert_mesh(board("/a", 5, "/m"));
            },
            1,
        );
        let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
        assert!(ids.iter().all(|seen| *seen == id), "a constant against {limit}: {ids:?}");
        let (session, request) = shown(
            |db| {
                db.upsert_material(reading("/m", "opacity", "float", "alpha", &[threshold(limit)]));
                db.upsert_mesh(with(board("/a", 5, "/m"), "alpha", Interpolation::Constant, vec![0.25_f32]));
            },
            1,
        );
        let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
        assert!(ids.iter().all(|seen| *seen == id), "a primvar against {limit}: {ids:?}");
    }
}

#[test]
fn normals_are_in_tangent_space() {
    // (u, v) to the board's plane: as it is, mirrored, turned by a quarter.
    type Map = fn([f32; 2]) -> [f32; 2];
    let maps: [(&str, Map, [f32; 3]); 3] = [
        ("plain", |[x, y]| [0.5 * x, 0.5 * y], [0.48, 0.6, 0.64]),
        ("mirrored", |[x, y]| [-0.5 * x, 2.0 * y], [-0.48, 0.6, 0.64]),
        ("turned", |[x, y]| [y, -x], [-0.6, 0.48, 0.64]),
    ];
    for (name, map, expected) in maps {
        let st = coordinates(map);
        let (session, request) = shown(
            |db| {
                db.upsert_material(textured("/bent", "metallic", "r", &[("normal", color([0.48, 0.6, 0.64]))]));
                db.upsert_mesh(with(board("/a", 5, "/bent"), "st", Interpolation::Vertex, st));
            },
            1,
        );
        let normals: Vec<[f32; 3]> = read(&session, &request, AovKind::Normal);
        for normal in normals {
            let off = (Vec3::from(normal) - Vec3::from(expected)).abs().max_element();
            assert!(off < 1e-6, "{name}: {normal:?}, not {expected:?}");
        }
    }
}

#[test]
fn texels_lie_at_their_texture_coordinates() {
    let (session, request) = shown(
        |db| {
            db.upsert_material(textured("/t", "diffuseColor", "rgb", &[]));
            db.upsert_mesh(with(board("/a", 5, "/t"), "st", Interpolation::Vertex, coordinates(|st| st)));
        },
        1,
    );
    let albedo: Vec<[f32; 3]> = read(&session, &request, AovKind::Albedo);
    // Bilinear between the texels' centres at a quarter and three quarters of the side.
    let ramp = |x: f32| 0.2 + 0.8 * (2.0 * (0.5 * x + 0.5) - 0.5).clamp(0.0, 1.0);
    for (pixel, albedo) in albedo.iter().enumerate() {
        let [x, y] = place(pixel);
        let off = (Vec3::from(*albedo) - Vec3::new(ramp(x), ramp(y), 0.0)).abs().max_element();
        assert!(off < 1e-5, "pixel {pixel}: {albedo:?}");
    }
}

#[test]
fn a_texture_cuts_out() {
    let (session, request) = shown(
        |db| {
            let threshold = [("opacityThreshold", ParamValue::Float(0.6))];
            db.upsert_material(textured("/leaf", "opacity", "r", &threshold));
            db.upsert_mesh(with(board("/a", 5, "/leaf"), "st", Interpolation::Vertex, coordinates(|st| st)));
        },
        1,
    );
    // Red is 0.2 to 1 over the middle half, 0.6 in the middle.
    let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
    for (pixel, id) in ids.iter().enumerate() {
        assert_eq!(*id, if place(pixel)[0] < 0.0 { -1 } else { 5 }, "pixel {pixel}");
    }
}
