// SPDX-License-Identifier: Apache-2.0
//! Materials as text: known networks, formulas worked out against the program, texts of strangers.

use oocpt_core::material::{MAX_TEXT_CHARS, MaterialText, describe};
use oocpt_core::{NodeDesc, ParamValue};

use crate::material::preview_surface::{file, network, node, text};

const SURFACE: &str = "ND_open_pbr_surface_surfaceshader";

fn of(nodes: Vec<NodeDesc>) -> MaterialText {
    describe(&network("/m", nodes))
}

fn input<'a>(material: &'a MaterialText, name: &str) -> &'a str {
    let found = material.inputs.iter().find(|(known, _)| known == name);
    found.map_or_else(|| panic!("no {name} in {:?}", material.inputs), |(_, value)| value)
}

#[test]
fn constant_subgraphs_are_described_as_numbers() {
    let mix = [
        ("fg", ParamValue::Vec3([1.0, 0.0, 0.5])),
        ("bg", ParamValue::Vec3([0.0, 1.0, 0.5])),
        ("mix", ParamValue::Float(0.25)),
    ];
    let weight = [("base_weight", ParamValue::Float(1.0))];
    let material = of(vec![node(SURFACE, &weight, &[("base_color", 1, "out")]), node("ND_mix_color3", &mix, &[])]);
    assert_eq!(input(&material, "diffuse color"), "(0.25, 0.75, 0.5)");
    assert!(material.is_understood && material.program.instructions.is_empty() && material.values.is_empty());
    assert_eq!(material.surface, SURFACE);
    assert_eq!(material.nodes[0].inputs, ["base_weight = 1", &format!("base_color <- {}.out", material.nodes[1].path)]);
    assert_eq!(material.nodes[1].inputs, ["fg = (1, 0, 0.5)", "bg = (0, 1, 0.5)", "mix = 0.25"]);
    assert!(material.warnings.is_empty() && material.lookups == 0, "{material:?}");
}

/// The same value is read twice, so it has a name; a value that is read once is written in its reader.
#[test]
fn a_program_is_described_as_formulas_and_instructions() {
    let weight = [("base_weight", ParamValue::Float(1.0))];
    let material = of(vec![
        node(SURFACE, &weight, &[("base_color", 1, "out"), ("specular_roughness", 2, "out")]),
        node("ND_combine3_color3", &[], &[("in1", 2, "out"), ("in2", 3, "out")]),
        node("ND_noise2d_float", &[("amplitude", ParamValue::Float(0.5))], &[]),
        node("ND_sin_float", &[], &[("in", 4, "out")]),
        node("ND_geompropvalue_float", &[("geomprop", text("heat"))], &[]),
    ]);
    assert_eq!(material.values, ["v1 = multiply(noise2(uv \"st\"), 0.5)"], "read by two inputs");
    assert_eq!(input(&material, "roughness"), "v1");
    let color = input(&material, "diffuse color");
    assert!(color.contains("v1") && color.contains("sin(swizzle(primvar \"heat\", x))"), "{color}");
    let program = &material.program;
    assert_eq!((program.noises, program.lookups), (1, 0));
    let written: Vec<&str> = program.instructions.iter().filter_map(|line| line.split(" = ").next()).collect();
    let most = written.iter().filter_map(|name| name[1..].parse::<usize>().ok()).max();
    assert_eq!(most.map(|most| most + 1), Some(program.registers), "{written:?}");
    assert_eq!(program.instructions.iter().filter(|line| line.contains(" = noise2(r")).count(), 1, "{program:?}");
    assert!(material.needs.contains(&"PATTERNS".to_owned()), "{:?}", material.needs);
}

/// A register that is written again has another value.
#[test]
fn formulas_follow_reused_registers() {
    let weight = [("base_weight", ParamValue::Float(1.0))];
    let mut nodes = vec![node(SURFACE, &weight, &[("base_color", 1, "out")])];
    let kinds = ["ND_floor_color3", "ND_absval_color3", "ND_ceil_color3", "ND_sign_color3"];
    for (at, kind) in kinds.iter().enumerate() {
        nodes.push(node(kind, &[], &[("in", at + 2, "out")]));
    }
    nodes.push(node("ND_geompropvalue_color3", &[("geomprop", text("c"))], &[]));
    let material = of(nodes);
    assert_eq!(input(&material, "diffuse color"), "floor(absolute(ceil(sign(primvar \"c\"))))");
    assert_eq!(material.program.registers, 1, "one register is enough: {:?}", material.program);
}

#[test]
fn textures_and_omitted_inputs_are_described() {
    let weight = [("base_weight", ParamValue::Float(0.5))];
    let nodes = |kind: &str| {
        vec![
            node(SURFACE, &weight, &[("base_color", 1, "out"), ("specular_roughness", 2, "out")]),
            node("ND_image_color3", &[("file", file("a/wood.png"))], &[]),
            node(kind, &[], &[]),
        ]
    };
    let material = of(nodes("ND_no_such_node"));
    assert_eq!(input(&material, "diffuse color"), "texture \"wood.png\" * 0.5 at uv \"st\"");
    assert_eq!((material.lookups, material.textures.len()), (1, 1));
    assert!(material.textures[0].starts_with("\"a/wood.png\" of "), "{:?}", material.textures);
    assert_eq!(material.warnings.len(), 1, "{:?}", material.warnings);
    let named = &material.nodes[2].path;
    assert!(material.warnings[0].contains("no_such_node") && material.warnings[0].contains(named.as_str()));
    // Opacity has a program and formulas of its own.
    let by_noise = of(vec![node(SURFACE, &[], &[("geometry_opacity", 1, "out")]), node("ND_noise2d_float", &[], &[])]);
    assert!(by_noise.program.instructions.is_empty() && !by_noise.opacity_program.instructions.is_empty());
    assert!(input(&by_noise, "opacity").contains("noise2(uv \"st\")"), "{by_noise:?}");
}

/// Emission that is a program has one more of its own, with its own cost.
#[test]
fn the_emission_program_is_described() {
    let values = [("emission_luminance", ParamValue::Float(1.0))];
    let inputs = [("emission_color", 1, "out"), ("specular_roughness", 2, "out")];
    let nodes = |read: &str, space: &[(&str, ParamValue)]| {
        vec![
            node(SURFACE, &values, &inputs),
            node("ND_noise2d_color3", &[], &[("texcoord", 3, "out")]),
            node("ND_sin_float", &[], &[("in", 3, "out")]),
            node(read, space, &[]),
        ]
    };
    let material = of(nodes("ND_texcoord_vector2", &[]));
    let (all, own) = (&material.program, &material.emission_program);
    assert!(own.noises == 1 && own.instructions.len() < all.instructions.len(), "{material:?}");
    assert!(own.instructions.iter().any(|line| line.contains(" = noise2")), "{own:?}");
    assert!(!own.instructions.iter().any(|line| line.contains(" = sin(")), "roughness is none of it: {own:?}");
    // A normal is not known at a point of a light.
    let by_normal = of(nodes("ND_normal_vector3", &[("space", text("world"))]));
    assert!(!by_normal.program.instructions.is_empty() && by_normal.emission_program.instructions.is_empty());
}

/// A random choice is described with the number that chooses.
#[test]
fn mixtures_are_described() {
    let metal = |roughness: f32| node("ND_conductor_bsdf", &[("roughness", ParamValue::Vec2([roughness; 2]))], &[]);
    let share = [("mix", ParamValue::Float(0.25))];
    let material = of(vec![
        node("ND_surface", &[], &[("bsdf", 1, "out")]),
        node("ND_mix_bsdf", &share, &[("bg", 2, "out"), ("fg", 3, "out")]),
        metal(0.25),
        metal(0.0625),
    ]);
    assert_eq!(input(&material, "roughness"), "select(0.25, 0.5, greater(0.25, random 0))");
    assert!(material.needs.contains(&"MIXTURE".to_owned()), "{:?}", material.needs);
}

#[test]
fn a_preview_surface_with_displacement_is_described() {
    let params = [("diffuseColor", ParamValue::Vec3([0.5; 3])), ("displacement", ParamValue::Float(0.25))];
    let mut desc = network("/m", vec![node("UsdPreviewSurface", &params, &[])]);
    desc.displacement = desc.surface;
    let material = describe(&desc);
    assert_eq!(input(&material, "diffuse color"), "0.5");
    assert_eq!((material.displacement.as_str(), material.surface.as_str()), ("0.25", "UsdPreviewSurface"));
    let unknown = of(vec![node("Lambert", &[], &[])]);
    assert!(!unknown.is_understood && unknown.inputs.is_empty());
    assert!(
        unknown.warnings[0].contains("`Lambert`") && unknown.warnings[0].contains("(/Lambert)"),
        "{:?}",
        unknown.warnings
    );
    assert_eq!(describe(&network("/m", Vec::new())).surface, "", "there is none");
}

#[test]
fn a_node_displacement_is_described() {
    let surface = node(SURFACE, &[], &[]);
    let mut desc = network(
        "/m",
        vec![
            surface,
            node("ND_displacement_float", &[("scale", ParamValue::Float(0.5))], &[("displacement", 2, "out")]),
            node("ND_add_float", &[], &[("in1", 3, "out"), ("in2", 4, "out")]),
            node("ND_image_float", &[("file", file("a/bark.png"))], &[]),
            node("ND_geompropvalue_float", &[("geomprop", text("heat"))], &[]),
        ],
    );
    desc.displacement = Some(1);
    let material = describe(&desc);
    assert_eq!(material.displacement, "multiply(v1, 0.5)");
    let [value] = &material.displacement_values[..] else { panic!("{material:?}") };
    assert!(value.starts_with("v1 = add(swizzle(") && value.contains("bark.png"), "{value}");
    assert!(value.contains("primvar \"heat\"") && material.values.is_empty(), "{value}");
    let program = &material.displacement_program;
    assert_eq!((program.lookups, program.noises), (1, 0));
    assert_eq!((program.instructions.len(), material.lookups), (6, 0), "{program:?}: none for a hit");
    assert!(material.textures.len() == 1 && material.textures[0].starts_with("\"a/bark.png\""), "{material:?}");
    desc.nodes[1] = node("ND_displacement_vector3", &[("displacement", ParamValue::Vec3([1.0, 0.0, -2.0]))], &[]);
    let material = describe(&desc);
    assert_eq!(material.displacement, "(1, 0, -2) along tangent, bitangent and normal");
    assert!(material.displacement_program.instructions.is_empty() && material.warnings.is_empty());
}

/// Texts of a scene cannot move a terminal's cursor, and are shown up to a length.
#[test]
fn scene_text_is_escaped_and_bounded() {
    let evil = "\u{1b}[2J".repeat(100_000);
    let name: &str = Box::leak(evil.clone().into_boxed_str());
    let material = of(vec![node(SURFACE, &[(name, text(&evil))], &[("base_color", 1, "out")]), node(name, &[], &[])]);
    let all = format!("{material:?}");
    assert!(!all.contains("u{1b}") && !all.contains('\u{1b}'), "no escape is left");
    let longest = material.nodes.iter().flat_map(|node| node.inputs.iter().chain([&node.kind])).map(String::len).max();
    assert!(longest.is_some_and(|longest| longest < 3 * MAX_TEXT_CHARS), "{longest:?}");
    assert!(material.warnings.iter().all(|warning| warning.len() < 5 * MAX_TEXT_CHARS), "{:?}", material.warnings);
}
