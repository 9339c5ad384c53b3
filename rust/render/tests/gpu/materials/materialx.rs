// SPDX-License-Identifier: Apache-2.0
//! `MaterialX` networks on the device: programs against their twin on the host, models against the same surface of
//! `UsdPreviewSurface`, the same bits when the scene streams.

use super::*;
use crate::scenes::sun;
use oocpt_abi::MaterialInput;
use oocpt_core::material::{InputValue, compile};
use oocpt_core::materialx::eval::run;
use oocpt_core::materialx::program::{Geometry, ProgramLookup};

const OPEN_PBR: &str = "ND_open_pbr_surface_surfaceshader";

fn float(value: f32) -> ParamValue {
    ParamValue::Float(value)
}

fn file(name: &str) -> ParamValue {
    ParamValue::Asset(AssetRef { authored: name.into(), resolved: name.into() })
}

/// A board of noise: mixed colours, a fractal in the board's own frame, cells.
pub(crate) fn noisy(path: &str) -> MaterialDesc {
    let nodes = vec![
        node(OPEN_PBR, &[("base_weight", float(1.0)), ("specular_weight", float(0.0))], &[("base_color", 1)]),
        node("ND_mix_color3", &[("fg", color([0.9, 0.4, 0.1])), ("bg", color([0.1, 0.3, 0.8]))], &[("mix", 2)]),
        node("ND_add_float", &[], &[("in1", 3), ("in2", 6)]),
        node("ND_noise2d_float", &[("amplitude", float(0.25)), ("pivot", float(0.25))], &[("texcoord", 4)]),
        node("ND_multiply_vector2FA", &[("in2", float(7.0))], &[("in1", 5)]),
        node("ND_texcoord_vector2", &[], &[]),
        node("ND_multiply_float", &[("in2", float(0.5))], &[("in1", 7)]),
        node("ND_clamp_float", &[], &[("in", 8)]),
        node("ND_add_float", &[], &[("in1", 9), ("in2", 10)]),
        node("ND_fractal3d_float", &[], &[("position", 11)]),
        node("ND_cellnoise3d_float", &[], &[("position", 11)]),
        node("ND_multiply_vector3FA", &[("in2", float(4.0))], &[("in1", 12)]),
        node("ND_position_vector3", &[], &[]),
    ];
    material(path, nodes)
}

/// Two lookups multiplied, the second at the place that the first gives.
pub(crate) fn distorted(path: &str) -> MaterialDesc {
    let nodes = vec![
        node(OPEN_PBR, &[("base_weight", float(1.0)), ("specular_weight", float(0.0))], &[("base_color", 1)]),
        node("ND_multiply_color3", &[], &[("in1", 2), ("in2", 3)]),
        node("ND_image_color3", &[("file", file("ramps")), ("uaddressmode", ParamValue::Text("clamp".into()))], &[]),
        node("ND_image_color3", &[("file", file("ramps"))], &[("texcoord", 4)]),
        node("ND_image_vector2", &[("file", file("ramps"))], &[]),
    ];
    material(path, nodes)
}

fn st(desc: MeshDesc) -> MeshDesc {
    with(desc, "st", Interpolation::Vertex, coordinates(|st| st))
}

/// The albedo at each pixel is the result of the program on the host, at the pixel's coordinates and point.
#[test]
fn device_programs_match_the_host_evaluator() {
    let desc = noisy("/noise");
    let (session, request) = shown(
        |db| {
            db.upsert_material(desc.clone());
            db.upsert_mesh(st(board("/a", 1, "/noise")));
        },
        1,
    );
    let compiled = compile(&desc);
    assert_eq!(compiled.problem(), None);
    let material = compiled.material.expect("a surface");
    let InputValue::Register(register) = *material.input(MaterialInput::DiffuseColor) else { panic!("{material:?}") };
    let albedo: Vec<[f32; 3]> = read(&session, &request, AovKind::Albedo);
    let mut seen = Vec::new();
    for (pixel, got) in albedo.iter().enumerate() {
        let [x, y] = place(pixel);
        let surface = |what| match what {
            Geometry::Uv0 => [0.5 + 0.5 * x, 0.5 + 0.5 * y, 0.0, 0.0],
            _ => [x, y, 0.0, 0.0],
        };
        let expected = run(&material.program, surface, |_, _| [0.0; 4])[usize::from(register)];
        let off = got.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        // A ray's point rounds; noise turns that into as much at most.
        assert!(off < 2e-5, "pixel {pixel}: {got:?}, not {expected:?}");
        seen.push(got.map(f32::to_bits));
    }
    seen.sort_unstable();
    seen.dedup();
    assert!(seen.len() > 500, "only {} colours: no noise", seen.len());
}

#[test]
fn dependent_texture_lookups_use_the_computed_coordinates() {
    let (session, request) = shown(
        |db| {
            db.upsert_material(distorted("/m"));
            db.upsert_mesh(st(board("/a", 1, "/m")));
        },
        1,
    );
    let material = compile(&distorted("/m")).material.expect("a surface");
    let InputValue::Register(register) = *material.input(MaterialInput::DiffuseColor) else { panic!("{material:?}") };
    let albedo: Vec<[f32; 3]> = read(&session, &request, AovKind::Albedo);
    // Bilinear over the two by two texels that Ramps has, clamped or repeated.
    let texel = |column: usize, row: usize| {
        let mut bytes = [0; 16];
        Ramps.read(0, [0, 0], [2, 2], &mut bytes).expect("an image");
        let at = 4 * (2 * row + column);
        [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]].map(|byte| f32::from(byte) / 255.0)
    };
    let lookup = |_: &ProgramLookup, [s, t]: [f32; 2], clamps: bool| {
        let along = |s: f32, clamps: bool| {
            let x = 2.0 * s - 0.5;
            let (low, share) = (x.floor(), x - x.floor());
            let wrap = |x: f32| usize::from(if clamps { x > 0.0 } else { x.rem_euclid(2.0) > 0.5 });
            (wrap(low), wrap(low + 1.0), share)
        };
        let (x0, x1, u) = along(s, clamps);
        let (y0, y1, v) = along(t, false);
        std::array::from_fn(|k| {
            let row = |y| texel(x0, y)[k] * (1.0 - u) + texel(x1, y)[k] * u;
            row(y0) * (1.0 - v) + row(y1) * v
        })
    };
    for (pixel, got) in albedo.iter().enumerate() {
        let [x, y] = place(pixel).map(|x| 0.5 + 0.5 * x);
        let uv = [x, y];
        let expected = run(
            &material.program,
            |_| [x, y, 0.0, 0.0],
            |found, at| lookup(found, at.unwrap_or(uv), found.texture == 0),
        )[usize::from(register)];
        let off = got.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-4, "pixel {pixel}: {got:?}, not {expected:?}");
    }
}

/// An `open_pbr_surface` and an equivalent `UsdPreviewSurface` give the same picture, bit for bit.
#[test]
fn equal_surfaces_in_two_models_give_equal_pictures() {
    let pictures = [
        material(
            "/m",
            vec![node(
                OPEN_PBR,
                &[
                    ("base_weight", float(1.0)),
                    ("base_color", color([0.7, 0.5, 0.3])),
                    ("base_metalness", float(0.5)),
                    ("specular_roughness", float(0.4)),
                    ("coat_weight", float(0.5)),
                    ("coat_roughness", float(0.1)),
                    ("coat_ior", float(1.5)),
                ],
                &[],
            )],
        ),
        plain(
            "/m",
            &[
                ("diffuseColor", color([0.7, 0.5, 0.3])),
                ("metallic", float(0.5)),
                ("roughness", float(0.4)),
                ("clearcoat", float(0.5)),
                ("clearcoatRoughness", float(0.1)),
            ],
        ),
    ]
    .map(|desc| {
        let (session, request) = shown(
            |db| {
                db.upsert_material(desc);
                db.upsert_mesh(board("/a", 1, "/m"));
                db.upsert_light(dome([0.5, 0.6, 0.7]));
                db.upsert_light(sun(2.0, 10.0, DMat4::from_rotation_y(0.5)));
            },
            4,
        );
        read::<[f32; 4]>(&session, &request, AovKind::Color)
    });
    assert!(pictures[0] == pictures[1], "{:?} and {:?}", pictures[0][0], pictures[1][0]);
}

/// Materials that absorb nothing are white under a white sky: clear glass, white fuzz over white.
#[test]
fn materialx_glass_and_fuzz_in_a_white_furnace_stay_white() {
    let cases = [
        ("glass", vec![("transmission_weight", float(1.0)), ("specular_roughness", float(0.5))], 0.01),
        (
            "fuzz",
            vec![("base_color", color([1.0; 3])), ("fuzz_weight", float(1.0)), ("fuzz_color", color([1.0; 3]))],
            0.04,
        ),
    ];
    for (what, params, most) in cases {
        let params: Vec<(&str, ParamValue)> = [vec![("base_weight", float(1.0))], params].concat();
        let (session, request) = shown(
            |db| {
                db.upsert_material(material("/m", vec![node(OPEN_PBR, &params, &[])]));
                db.upsert_mesh(board("/a", 1, "/m"));
                db.upsert_light(dome([1.0; 3]));
            },
            64,
        );
        let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
        let mean = pixels.iter().map(|p| f64::from(p[0])).sum::<f64>() / 1024.0;
        assert!((mean - 1.0).abs() < most, "{what}: {mean}");
    }
}

/// Over black only the fuzz is seen, in its colour. Seen from the front it reflects 4 %, which the bound of white fuzz
/// over white would not notice.
#[test]
fn fuzz_color_tints_the_fuzz_lobe() {
    let params = [
        ("base_weight", float(0.0)),
        ("specular_weight", float(0.0)),
        ("fuzz_weight", float(1.0)),
        ("fuzz_color", color([0.5, 0.25, 1.0])),
    ];
    let (session, request) = shown(
        |db| {
            db.upsert_material(material("/m", vec![node(OPEN_PBR, &params, &[])]));
            db.upsert_mesh(board("/a", 1, "/m"));
            db.upsert_light(dome([1.0; 3]));
        },
        16,
    );
    let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let [red, green, blue] = [0, 1, 2].map(|k| pixels.iter().map(|pixel| f64::from(pixel[k])).sum::<f64>() / 1024.0);
    assert!(blue > 0.01, "there is fuzz: {blue}");
    assert!((red / blue - 0.5).abs() < 1e-3 && (green / blue - 0.25).abs() < 1e-3, "{red} {green} {blue}");
}

/// Light through a sharp interface of tinted glass is tinted once.
#[test]
fn glass_tints_transmitted_light() {
    let params = [
        ("base_weight", float(0.0)),
        ("specular_roughness", float(0.0)),
        ("specular_ior", float(1.0)),
        ("transmission_weight", float(1.0)),
        ("transmission_color", color([0.75, 0.5, 0.25])),
    ];
    let (session, request) = shown(
        |db| {
            db.upsert_material(material("/m", vec![node(OPEN_PBR, &params, &[])]));
            db.upsert_mesh(board("/a", 1, "/m"));
            db.upsert_light(dome([1.0; 3]));
        },
        4,
    );
    let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    for pixel in &pixels {
        let off = pixel.iter().zip([0.75, 0.5, 0.25]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-3, "{pixel:?}");
    }
}

#[test]
fn materialx_materials_stream_with_the_same_bits() {
    let request = front();
    let images = [false, true].map(|force_streaming| {
        let options = SessionOptions { validation: true, force_streaming, ..SessionOptions::default() };
        let session =
            Session::with_options(crate::support::filtering(settings(8, 3)), options).with_images(Arc::new(Ramps));
        session.with_scene(|db| {
            db.upsert_material(noisy("/noise"));
            db.upsert_material(distorted("/distorted"));
            let glass = [
                ("transmission_weight", float(0.75)),
                ("transmission_color", color([0.9, 1.0, 0.8])),
                ("fuzz_weight", float(0.5)),
            ];
            db.upsert_material(material("/glass", vec![node(OPEN_PBR, &glass, &[])]));
            let turn = DQuat::from_rotation_y(0.5);
            for (k, name) in [(0, "/noise"), (1, "/distorted"), (2, "/glass")] {
                let mut desc = st(board(&format!("/board{k}"), k + 1, name));
                let z = f64::from(k);
                desc.prim.transform =
                    DMat4::from_scale_rotation_translation(DVec3::splat(0.7), turn, DVec3::new(0.4 * z - 0.4, 0.0, z));
                db.upsert_mesh(desc);
            }
            db.upsert_light(dome([0.5, 0.6, 0.7]));
        });
        render(&session, &request);
        assert_eq!(session.stats().streaming.in_core, !force_streaming, "it streams when it is told to");
        read_all(&session, &request)
    });
    assert!(images[0] == images[1], "streaming changed a picture");
}
