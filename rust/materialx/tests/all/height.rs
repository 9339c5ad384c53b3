// SPDX-License-Identifier: Apache-2.0
//! Heights made into normals, against fields whose slopes are known: as programs, as textures, of points; and through
//! the nodes that read them.

use oocpt_materialx::network::NetworkNode;
use oocpt_materialx::program::Geometry;
use oocpt_materialx::surface::Input;
use oocpt_materialx::{InputSource, TranslatedNetwork};

use crate::support::{file, node, number, sound, source, value};

const OPEN_PBR: &str = "ND_open_pbr_surface_surfaceshader";

/// The unit vector of a normal whose height rises by these along u and v: scale / 16 of them.
fn leaning([du, dv]: [f64; 2], scale: f64) -> [f64; 3] {
    let [x, y] = [du, dv].map(|slope| -slope * scale / 16.0);
    let length = (x * x + y * y + 1.0).sqrt();
    [x / length, y / length, 1.0 / length]
}

fn unit(v: [f32; 4]) -> [f64; 3] {
    let [x, y, z, _] = v.map(f64::from);
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

fn near(found: [f64; 3], known: [f64; 3], bound: f64, what: &str) {
    let off = found.iter().zip(known).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < bound, "{what}: {found:?}, not {known:?}");
}

/// sin(9 u) + v * v * 5 of texture coordinates, from node `at` on.
fn field(at: usize) -> Vec<NetworkNode> {
    vec![
        node("ND_add_float", &[], &[("in1", at + 1), ("in2", at + 2)]),
        node("ND_sin_float", &[], &[("in", at + 3)]),
        node("ND_multiply_float", &[], &[("in1", at + 4), ("in2", at + 5)]),
        node("ND_multiply_float", &[("in2", number(9.0))], &[("in1", at + 6)]),
        node("ND_multiply_float", &[("in2", number(5.0))], &[("in1", at + 5)]),
        node("ND_extract_vector2", &[("index", number(1.0))], &[("in", at + 7)]),
        node("ND_extract_vector2", &[("index", number(0.0))], &[("in", at + 7)]),
        node("ND_texcoord_vector2", &[], &[]),
    ]
}

fn places() -> impl Iterator<Item = [f32; 2]> {
    (0..50_u8).map(|k| [0.37 * f32::from(k) % 1.0, 0.61 * f32::from(k) % 1.0])
}

fn normal_at(translation: &TranslatedNetwork, [u, v]: [f32; 2]) -> [f32; 4] {
    let surface = |what| if what == Geometry::Uv0 { [u, v, 0.0, 0.0] } else { [0.0; 4] };
    value(translation, Input::Normal, surface, |_, [s, t]| [s.sin() * 0.5 + s * t, 0.1, 0.9, 1.0])
}

#[test]
fn bump_normals_follow_the_height_gradient() {
    let surface = || node(OPEN_PBR, &[], &[("geometry_normal", 1)]);
    let bump = sound(
        [vec![surface(), node("ND_bump_vector3", &[("scale", number(3.0))], &[("height", 2)])], field(2)].concat(),
    );
    let mapped = [
        vec![
            surface(),
            node("ND_normalmap_float", &[], &[("in", 2)]),
            node("ND_heighttonormal_vector3", &[("scale", number(3.0))], &[("in", 3)]),
        ],
        field(3),
    ];
    let mapped = sound(mapped.concat());
    for [u, v] in places() {
        let known = leaning([9.0 * (9.0 * f64::from(u)).cos(), 10.0 * f64::from(v)], 3.0);
        near(unit(normal_at(&bump, [u, v])), known, 5e-4, "bump");
        near(unit(normal_at(&mapped, [u, v])), known, 5e-4, "heighttonormal through normalmap");
    }
}

/// A file is looked up at four places, through the map of its coordinates; its red counts.
#[test]
fn a_height_texture_gives_normals_by_finite_differences() {
    let translation = sound(vec![
        node(OPEN_PBR, &[], &[("geometry_normal", 1)]),
        node("ND_bump_vector3", &[("scale", number(8.0))], &[("height", 2)]),
        node("ND_image_float", &[("file", file("height.exr"))], &[("texcoord", 3)]),
        node("ND_multiply_vector2FA", &[("in2", number(2.0))], &[("in1", 4)]),
        node("ND_texcoord_vector2", &[], &[]),
    ]);
    assert_eq!((translation.program.lookups.len(), translation.uses.textures.len()), (4, 1), "{translation:?}");
    // A map of its own for each, so that no place has to be worked out and the filter is that of the file.
    assert!(translation.program.lookups.iter().all(|lookup| lookup.uv == Some(0) && lookup.transform[0][0] == 2.0));
    let at = |[u, v]: [f32; 2]| {
        let InputSource::Register(register) = source(&translation, Input::Normal) else { panic!("{translation:?}") };
        // Lookups know their places: they are handed to them by their maps.
        let registers = oocpt_materialx::eval::run(
            &translation.program,
            |_| [u, v, 0.0, 0.0],
            |lookup, _| {
                let [s, t] = lookup.transform.map(|[a, b, c]| a * u + b * v + c);
                [0.5 * s.sin() + s * t, 0.1, 0.9, 1.0]
            },
        );
        registers[usize::from(register)]
    };
    for [u, v] in places() {
        let (s, t) = (2.0 * f64::from(u), 2.0 * f64::from(v));
        let known = leaning([2.0 * (0.5 * s.cos() + t), 2.0 * s], 8.0);
        near(unit(at([u, v])), known, 1e-3, "a file");
    }
}

/// Along tangent and bitangent, by lengths.
#[test]
fn a_height_of_position_gives_normals_in_the_tangent_frame() {
    let translation = sound(vec![
        node(OPEN_PBR, &[], &[("geometry_normal", 1)]),
        node("ND_bump_vector3", &[("scale", number(4.0))], &[("height", 2)]),
        node("ND_dotproduct_vector3", &[], &[("in1", 3), ("in2", 3)]),
        node("ND_position_vector3", &[], &[]),
    ]);
    let tangent = [0.6_f32, 0.8, 0.0, 0.0];
    let bitangent = [0.0_f32, 0.0, 1.0, 0.0];
    let point = [0.3_f32, -0.7, 1.1, 0.0];
    let surface = |what| match what {
        Geometry::Tangent => tangent,
        Geometry::Bitangent => bitangent,
        _ => point,
    };
    let found = value(&translation, Input::Normal, surface, |_, _| [0.0; 4]);
    let slope = |axis: [f32; 4]| 2.0 * axis.iter().zip(point).map(|(a, b)| f64::from(a * b)).sum::<f64>();
    near(unit(found), leaning([slope(tangent), slope(bitangent)], 4.0), 1e-3, "a height of points");
}

/// What is the same everywhere is flat and costs nothing; as a colour a slope is that of a normal map.
#[test]
fn a_constant_height_adds_no_instructions() {
    let flat = sound(vec![
        node(OPEN_PBR, &[], &[("geometry_normal", 1)]),
        node("ND_bump_vector3", &[("height", number(0.7))], &[]),
    ]);
    assert_eq!(source(&flat, Input::Normal), InputSource::Constant([0.0, 0.0, 1.0, 1.0]));
    assert!(flat.program.instructions.is_empty(), "{flat:?}");
    let surface = node(OPEN_PBR, &[("base_weight", number(1.0))], &[("base_color", 1)]);
    let shown = sound([vec![surface, node("ND_heighttonormal_vector3", &[], &[("in", 2)])], field(2)].concat());
    let at = |what| if what == Geometry::Uv0 { [0.25, 0.5, 0.0, 0.0] } else { [0.0; 4] };
    let [x, y, z, _] = value(&shown, Input::DiffuseColor, at, |_, _| [0.0; 4]).map(|c| 2.0 * f64::from(c) - 1.0);
    near([x, y, z], leaning([9.0 * 2.25_f64.cos(), 5.0], 1.0), 1e-3, "as a colour");
}
