// SPDX-License-Identifier: Apache-2.0
//! Every definition of `MaterialX`'s libraries, and nodes with known values.

use oocpt_materialx::library::NodeLibrary;
use oocpt_materialx::surface::Input;
use oocpt_materialx::value::{PortType, PortValue};

use crate::support::{library, node, number, of_node, source, text, translated, vector};

/// Patterns of the libraries that are not supported: what they read is not known at a hit, or they are matrices.
const UNSUPPORTED: &[&str] =
    &["chiang_hair_absorption_from_color", "chiang_hair_roughness", "deon_hair_absorption_from_melanin", "determinant"];

#[test]
fn all_patterns_of_the_libraries_are_known() {
    let mut unknown = Vec::new();
    let mut count = 0;
    for definition in library().definitions() {
        let is_number = definition.outputs.first().is_some_and(|(_, ty, _)| ty.width() > 0);
        let takes_closures = definition.inputs.iter().any(|input| input.ty == PortType::Other);
        if !is_number || takes_closures {
            continue;
        }
        count += 1;
        let surface = node("ND_open_pbr_surface_surfaceshader", &[], &[("base_color", 1)]);
        let pattern = node(&definition.name, &[("file", crate::support::file("a.png")), ("geomprop", text("p"))], &[]);
        let translation = translated(vec![surface, pattern]);
        let fails = translation.inputs.is_none()
            || translation.problems.iter().any(|problem| problem.contains("is not supported"));
        if fails && !UNSUPPORTED.contains(&&*definition.category) {
            unknown.push(format!("{}: {:?}", definition.name, translation.problems));
        }
    }
    assert!(count > 500, "only {count} patterns");
    assert!(unknown.is_empty(), "{unknown:#?}");
}

#[test]
fn definitions_inherit_inputs_and_outputs() {
    let of = |name: &str| library().definition(name).expect("defined");
    let surface = of("ND_standard_surface_surfaceshader");
    assert!(surface.input("metalness").is_some() && !surface.outputs.is_empty(), "of its parent: {surface:?}");
    assert_eq!(surface.inputs.iter().filter(|input| &*input.name == "base").count(), 1, "its own wins");
}

#[test]
fn each_malformed_library_file_is_a_problem() {
    let files = [
        ("a", "<materialx"),
        ("b", "no"),
        ("c", "<materialx><nodedef/><nodegraph name='g'><add/></nodegraph></materialx>"),
    ];
    let library = NodeLibrary::parse(&files.map(|(name, text)| (name.to_owned(), text.to_owned())));
    assert_eq!(library.problems().len(), 2, "{:?}", library.problems());
    assert!(library.definitions().next().is_none_or(|definition| definition.name.is_empty()), "nothing is defined");
}

fn near(value: [f32; 4], expected: &[f32]) -> bool {
    value.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 2e-6 * (1.0 + b.abs()))
}

/// What nodes give by the specification, worked out by hand at (u, v) = (0.3, 0.6).
#[test]
fn nodes_give_the_values_of_the_specification() {
    type Case<'a> = (&'a str, &'a [(&'a str, PortValue)], &'a [f32]);
    let cases: &[Case<'_>] = &[
        ("ND_add_color3FA", &[("in1", vector(0.1, 0.2, 0.3)), ("in2", number(0.5))], &[0.6, 0.7, 0.8]),
        ("ND_modulo_float", &[("in1", number(-0.25)), ("in2", number(1.0))], &[0.75]),
        ("ND_invert_color3", &[("in", vector(0.25, 0.5, 1.0)), ("amount", vector(1.0, 1.0, 1.0))], &[0.75, 0.5, 0.0]),
        ("ND_remap_float", &[("in", number(0.25)), ("outlow", number(2.0)), ("outhigh", number(4.0))], &[2.5]),
        ("ND_dotproduct_vector3", &[("in1", vector(1.0, 2.0, 3.0)), ("in2", vector(4.0, 5.0, 6.0))], &[32.0]),
        (
            "ND_crossproduct_vector3",
            &[("in1", vector(1.0, 0.0, 0.0)), ("in2", vector(0.0, 1.0, 0.0))],
            &[0.0, 0.0, 1.0],
        ),
        // The specification's sense of rotation: (1, 0) by 90 degrees is (0, -1).
        ("ND_rotate2d_vector2", &[("in", vector(1.0, 0.0, 0.0)), ("amount", number(90.0))], &[0.0, -1.0]),
        (
            "ND_rotate3d_vector3",
            &[("in", vector(1.0, 0.0, 0.0)), ("amount", number(90.0)), ("axis", vector(0.0, 0.0, 1.0))],
            &[0.0, -1.0, 0.0],
        ),
        ("ND_ramplr_float", &[("valuel", number(1.0)), ("valuer", number(3.0))], &[1.6]),
        ("ND_splittb_float", &[("valuet", number(1.0)), ("valueb", number(3.0))], &[3.0]),
        ("ND_ifgreater_float", &[("value1", number(2.0)), ("value2", number(1.0)), ("in1", number(5.0))], &[5.0]),
        (
            "ND_switch_float",
            &[("in1", number(5.0)), ("in2", number(6.0)), ("in3", number(7.0)), ("which", number(1.4))],
            &[6.0],
        ),
        ("ND_switch_float", &[("in1", number(5.0)), ("which", number(40.0))], &[0.0]),
        ("ND_luminance_color3", &[("in", vector(1.0, 0.0, 0.0))], &[0.272_228_7, 0.272_228_7, 0.272_228_7]),
        ("ND_saturate_color3", &[("in", vector(1.0, 0.0, 0.0)), ("amount", number(0.0))], &[0.272_228_7; 3]),
        ("ND_extract_color3", &[("in", vector(0.1, 0.2, 0.3)), ("index", number(2.0))], &[0.3]),
        ("ND_combine3_color3", &[("in1", number(0.1)), ("in2", number(0.2)), ("in3", number(0.3))], &[0.1, 0.2, 0.3]),
        ("ND_convert_float_color3", &[("in", number(0.4))], &[0.4, 0.4, 0.4]),
        (
            "ND_mix_color3",
            &[("fg", vector(1.0, 0.0, 0.0)), ("bg", vector(0.0, 1.0, 0.0)), ("mix", number(0.25))],
            &[0.25, 0.75, 0.0],
        ),
        ("ND_screen_float", &[("fg", number(0.5)), ("bg", number(0.5))], &[0.75]),
        ("ND_burn_float", &[("fg", number(0.0)), ("bg", number(0.5))], &[0.0]),
        ("ND_contrast_float", &[("in", number(0.75)), ("amount", number(2.0)), ("pivot", number(0.5))], &[1.0]),
        (
            "ND_transformmatrix_vector3",
            &[
                ("in", vector(1.0, 2.0, 3.0)),
                (
                    "mat",
                    PortValue::Matrix([[1.0, 4.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0; 4]]),
                ),
            ],
            &[1.0, 6.0, 3.0],
        ),
        ("ND_roughness_anisotropy", &[("roughness", number(0.5)), ("anisotropy", number(0.75))], &[0.5, 0.125]),
        ("ND_smoothstep_float", &[("in", number(0.5))], &[0.5]),
    ];
    for (kind, values, expected) in cases {
        let value = of_node(kind, values);
        assert!(near(value, expected), "{kind} {values:?}: {value:?}, expected {expected:?}");
    }
}

#[test]
fn nodes_of_materialx_1_38_are_known() {
    let from = || ("in", PortValue::Numbers([0.1, 0.2, 0.3, 0.4]));
    let cases: &[(&str, &str, &[f32])] = &[
        ("ND_swizzle_color3_float", "b", &[0.3; 4]),
        ("ND_swizzle_color4_float", "a", &[0.4; 4]),
        ("ND_swizzle_color4_color3", "bgr", &[0.3, 0.2, 0.1]),
        ("ND_swizzle_vector3_vector2", "zx", &[0.3, 0.1]),
        ("ND_swizzle_color3_color4", "g01r", &[0.2, 0.0, 1.0, 0.1]),
        ("ND_swizzle_float_color3", "r1r", &[0.1, 1.0, 0.1]),
    ];
    for (kind, channels, expected) in cases {
        let value = of_node(kind, &[from(), ("channels", text(channels))]);
        assert!(near(value, expected), "{kind} {channels}: {value:?}, expected {expected:?}");
    }
    let value = of_node("ND_atan2_float", &[("in1", number(1.0)), ("in2", number(0.0))]);
    assert!(near(value, &[std::f32::consts::FRAC_PI_2]), "in1 was y: {value:?}");
}

#[test]
fn unknown_channels_are_a_problem() {
    for (channels, says) in [("01q", true), ("a", true), ("rgbr", true), ("", true), ("rgb", false)] {
        let surface = node("ND_open_pbr_surface_surfaceshader", &[], &[("base_color", 1)]);
        let swizzle = node("ND_swizzle_color3_color3", &[("channels", text(channels))], &[]);
        let translation = translated(vec![surface, swizzle]);
        let said = translation.problems.iter().any(|problem| problem.contains("channels of `swizzle`"));
        assert!(translation.inputs.is_some() && said == says, "{channels}: {:?}", translation.problems);
    }
}

#[test]
fn a_dangling_connection_gives_the_default() {
    let surface = node("ND_open_pbr_surface_surfaceshader", &[], &[("base_metalness", 7)]);
    let translation = translated(vec![surface]);
    assert_eq!(source(&translation, Input::Metallic), oocpt_materialx::InputSource::Constant([0.0; 4]));
}

/// Red, warm, nearly white; by the splines in f64.
#[test]
fn blackbody_nodes_give_the_planckian_colour() {
    for (kelvin, known) in [
        (1000.0, [2.96425, 0.52125, 0.00000]),
        (2000.0, [2.52230, 0.64648, 0.02005]),
        (3000.0, [1.76676, 0.84557, 0.27263]),
        (6500.0, [1.04263, 0.98386, 1.03490]),
    ] {
        let found = of_node("ND_blackbody", &[("temperature", number(kelvin))]);
        let off = found.iter().zip(known).map(|(a, b): (&f32, f32)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-4, "{kelvin}: {found:?}, not {known:?}");
    }
}
