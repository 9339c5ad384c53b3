// SPDX-License-Identifier: Apache-2.0
//! Networks that nobody means: random ones, circles, long chains, wrong types.

use oocpt_materialx::eval::run;
use oocpt_materialx::network::{Network, NetworkNode};
use oocpt_materialx::program::{Geometry, MAX_CONSTANTS, MAX_INSTRUCTIONS, MAX_LOOKUPS, Operand, REGISTERS};
use oocpt_materialx::surface::Input;
use oocpt_materialx::value::PortValue;
use oocpt_materialx::{InputSource, translate};
use proptest::prelude::*;

use crate::support::{file, library, node, number, text, translated};

/// Networks of random nodes, inputs and connections; all seeds with `cargo xtask test --full`.
pub(crate) fn networks() -> u32 {
    match std::env::var_os("OOCPT_TEST_FULL") {
        Some(_) => 10_000,
        None if cfg!(debug_assertions) => 100,
        None => 400,
    }
}

fn any_value() -> impl Strategy<Value = PortValue> {
    prop_oneof![
        any::<[f32; 4]>().prop_map(|v| PortValue::Numbers(v.map(|v| if v.is_finite() { v } else { 0.0 }))),
        (-2.0_f32..3.0).prop_map(number),
        "[a-z]{0,6}".prop_map(|word| text(&word)),
        Just(file("a.png")),
    ]
}

/// Ids that the libraries do not define: those of `MaterialX` 1.38, and what nobody defines.
const OTHER_IDS: &[&str] = &[
    "ND_normalmap",
    "ND_swizzle_color3_float",
    "ND_swizzle_vector2_color4",
    "ND_swizzle",
    "ND_thin_film_bsdf",
    "ND_thin_surface",
    "ND_disney_brdf_2012_surface",
    "ND_disney_bsdf_2015_surface",
    "ND_curveadjust_color3",
    "ND_arrayappend_floatarray_floatarray",
    "ND_add_surfaceshader",
    "mine:ND_none",
    "ND_",
    "",
];
/// Inputs of those.
const OTHER_INPUTS: &[&str] =
    &["in", "space", "channels", "normal", "tangent", "scale", "thickness", "front_bsdf", "back_bsdf", "top", "file"];

prop_compose! {
    /// A node of an id that the libraries do not define.
    fn older_node(count: usize)(
        kind in prop::sample::select(OTHER_IDS),
        inputs in prop::collection::vec(
            (prop::sample::select(OTHER_INPUTS), 0..count + 1, any_value(), any::<bool>()), 0..6),
        space in prop::sample::select(&["object", "tangent", "world", "", "rgx1"][..]),
    ) -> NetworkNode {
        let mut made = node(kind, &[("space", text(space)), ("channels", text(space))], &[]);
        for (name, upstream, value, is_connected) in inputs {
            if is_connected {
                made.connections.push((name.into(), upstream, "out".into()));
            } else {
                made.values.push((name.into(), value));
            }
        }
        made
    }
}

prop_compose! {
    pub(crate) fn any_node(count: usize)(
        kind in any::<prop::sample::Index>(),
        inputs in prop::collection::vec((any::<prop::sample::Index>(), 0..count + 1, any_value(), any::<bool>()), 0..6),
    ) -> NetworkNode {
        let names: Vec<_> = library().names();
        let kind = names[kind.index(names.len())];
        let definition = library().definition(kind).expect("it is listed");
        let mut made = node(kind, &[], &[]);
        for (input, upstream, value, is_connected) in inputs {
            let Some(input) = definition.inputs.get(input.index(definition.inputs.len().max(1))) else { continue };
            if is_connected {
                made.connections.push((input.name.clone(), upstream, "out".into()));
            } else {
                made.values.push((input.name.clone(), value));
            }
        }
        made
    }
}

/// Everything that a translation promises.
fn check(network: &Network) {
    let translation = translate(network, library());
    let program = &translation.program;
    assert!(program.instructions.len() <= MAX_INSTRUCTIONS && program.constants.len() <= MAX_CONSTANTS);
    assert!(program.lookups.len() <= MAX_LOOKUPS);
    for instruction in &program.instructions {
        assert!(usize::from(instruction.to) < REGISTERS);
        for operand in instruction.operands {
            match operand {
                Operand::Register(at) => assert!(usize::from(at) < REGISTERS),
                Operand::Constant(at) => assert!(usize::from(at) < program.constants.len()),
            }
        }
    }
    assert!(!translation.opacity_program.is_random(), "traversal knows no random number of the hit");
    assert!(translation.emission.as_ref().is_none_or(|emission| !emission.program.is_random()));
    let textures = translation.uses.textures.len();
    assert!(program.lookups.iter().all(|lookup| (lookup.texture as usize) < textures));
    let Some(inputs) = translation.inputs else {
        assert!(!translation.problems.is_empty(), "a surface that is none says why");
        return;
    };
    for (input, name) in inputs.into_iter().zip(Input::ALL) {
        let program = if name == Input::Opacity { &translation.opacity_program } else { program };
        match input {
            InputSource::Constant(value) => assert!(value.iter().all(|v| v.is_finite()), "{value:?}"),
            InputSource::Texture(lookup, _) => assert!((lookup.texture as usize) < textures),
            InputSource::Primvar(slot) => assert!(usize::from(slot) < translation.uses.primvars.len()),
            InputSource::Register(at) => assert!(usize::from(at) < REGISTERS && !program.instructions.is_empty()),
        }
    }
    let plain = ([0.3, -0.7, 1.9, 0.0], [0.2, 0.4, 0.6, 1.0]);
    for (surface, texel) in [plain, ([0.0; 4], [0.0; 4]), ([3.0e38, -3.0e38, 1.0e-38, 0.0], [65504.0, -1.0, 0.0, 1.0])]
    {
        let emission = translation.emission.as_ref().map_or(program, |emission| &emission.program);
        for program in [program, &translation.opacity_program, emission] {
            let registers = run(program, |_| surface, |_, _| texel);
            assert!(registers.as_flattened().iter().all(|v| v.is_finite()), "{registers:?}");
        }
        if let InputSource::Register(at) = inputs[Input::EmissiveColor as usize] {
            let [first, last] = [0.0, 0.9].map(|random| {
                let given = |what| if Geometry::RANDOM.contains(&what) { [random; 4] } else { surface };
                run(program, given, |_, _| texel)[usize::from(at)]
            });
            assert_eq!(first, last, "emission is never chosen by chance");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: networks(), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_networks_of_other_ids_are_translated_or_refused(
        nodes in (2..12_usize).prop_flat_map(|count| {
            prop::collection::vec(prop_oneof![older_node(count), any_node(count)], count)
        }),
        input in prop::sample::select(&["base_color", "geometry_normal", "geometry_opacity", "emission_color"][..]),
        is_closure in any::<bool>(),
    ) {
        let mut nodes = nodes;
        nodes[0] = if is_closure {
            node("ND_surface", &[], &[("bsdf", 1)])
        } else {
            node("ND_open_pbr_surface_surfaceshader", &[("emission_luminance", number(1.0))], &[(input, 1)])
        };
        check(&Network { nodes, ..Network::default() });
    }

    #[test]
    fn random_networks_are_translated_or_refused(
        nodes in (2..12_usize).prop_flat_map(|count| prop::collection::vec(any_node(count), count)),
        surface in 0..6_u8,
        shares in prop::array::uniform4(0.0_f32..1.0),
    ) {
        let mut nodes = nodes;
        if surface < 2 {
            nodes[0] =
                node("ND_open_pbr_surface_surfaceshader", &[], &[("base_color", 1), ("specular_roughness", 1)]);
            if surface == 1 {
                // Whatever is random is a height.
                let last = nodes.len();
                nodes[0].connections.push(("geometry_normal".into(), last, "out".into()));
                nodes.push(node("ND_bump_vector3", &[], &[("height", 1)]));
            }
        } else if surface == 2 {
            // A fibre, whatever else is random.
            let inputs = ["absorption_coefficient", "roughness_TT", "tint_R", "cuticle_angle"];
            let last = nodes.len();
            nodes.push(node("ND_chiang_hair_bsdf", &[], &inputs.map(|name| (name, 1))));
            nodes[0] = node("ND_surface", &[], &[("bsdf", last)]);
        } else if surface == 4 {
            // Closures mixed, added and multiplied, whatever is random in them.
            let kinds = ["ND_mix_bsdf", "ND_add_bsdf", "ND_mix_bsdf", "ND_layer_bsdf"];
            let names = [["bg", "fg"], ["in1", "in2"], ["bg", "fg"], ["base", "top"]];
            let lobes = ["dielectric", "conductor", "oren_nayar_diffuse", "dielectric", "sheen"];
            let first = nodes.len();
            nodes[0] = node("ND_surface", &[], &[("bsdf", first), ("edf", first + 9)]);
            for (at, (kind, [a, b])) in kinds.iter().zip(names).enumerate() {
                let inputs = [(a, first + 4 + at), (b, if at < 3 { first + at + 1 } else { first + 8 })];
                nodes.push(node(kind, &[("mix", number(shares[at]))], &inputs));
            }
            for (at, kind) in lobes.iter().enumerate() {
                let values = [("weight", number(shares[at % 4])), ("roughness", number(shares[(at + 1) % 4]))];
                nodes.push(node(&format!("ND_{kind}_bsdf"), &values, &[("tint", 1), ("color", 1)]));
            }
            nodes.push(node("ND_uniform_edf", &[], &[("color", 1)]));
        } else if surface == 5 {
            // Surfaces mixed by what is random.
            let first = nodes.len();
            nodes[0] = node("ND_mix_surfaceshader", &[], &[("bg", first), ("fg", first + 1), ("mix", 1)]);
            nodes.push(node(
                "ND_mix_surfaceshader",
                &[("mix", number(shares[0]))],
                &[("bg", first + 2), ("fg", first + 3)],
            ));
            for at in 0..3_usize {
                let values = [
                    ("coat_weight", number(shares[at])),
                    ("base_metalness", number(shares[at + 1])),
                    ("specular_roughness", number(shares[at] * 0.5)),
                    ("emission_luminance", number(1.0)),
                ];
                let inputs = [("coat_color", 1), ("geometry_opacity", 1), ("emission_color", 1)];
                nodes.push(node("ND_open_pbr_surface_surfaceshader", &values, &inputs));
            }
        }
        check(&Network { nodes, ..Network::default() });
    }
}

#[test]
fn a_cyclic_network_is_one_problem() {
    let translation = translated(vec![
        node("ND_open_pbr_surface_surfaceshader", &[], &[("base_color", 1)]),
        node("ND_add_color3", &[], &[("in1", 2)]),
        node("ND_multiply_color3", &[], &[("in1", 1)]),
    ]);
    assert_eq!(translation.problems.len(), 1, "{:?}", translation.problems);
    assert!(translation.problems[0].contains("in a circle"), "{:?}", translation.problems);
}

#[test]
fn a_chain_that_is_too_long_is_a_problem() {
    let mut nodes = vec![node("ND_open_pbr_surface_surfaceshader", &[], &[("base_color", 1)])];
    for at in 1..4000_usize {
        nodes.push(node("ND_add_color3", &[("in2", number(0.001))], &[("in1", at + 1)]));
    }
    let translation = translated(nodes);
    assert!(translation.problems.iter().any(|problem| problem.contains("too large")), "{:?}", translation.problems);
}

/// More values at a time than there are registers: their middles stand for them.
#[test]
fn exceeding_program_limits_is_a_problem() {
    let mut nodes =
        vec![node("ND_open_pbr_surface_surfaceshader", &[("base_weight", number(1.0))], &[("base_color", 1)])];
    for at in 0..40_usize {
        let sum = nodes.len();
        nodes.push(node("ND_add_color3", &[], &[("in1", sum + 1), ("in2", sum + 2)]));
        nodes.push(node("ND_image_color3", &[("file", file(&format!("{at}.png")))], &[]));
    }
    nodes.push(node("ND_image_color3", &[("file", file("last.png"))], &[]));
    check(&Network { nodes: nodes.clone(), ..Network::default() });
    let translation = translated(nodes);
    assert!(
        translation.problems.iter().any(|problem| problem.contains("texture lookups")),
        "{:?}",
        translation.problems
    );
}

/// A path keeps a bit for each lookup of a material: textures of inputs and of the program are fifteen together.
#[test]
fn input_textures_count_against_the_program_limit() {
    let inputs = ["specular_roughness", "base_metalness", "coat_weight", "coat_roughness", "fuzz_roughness"];
    let mut connections = vec![("base_color", 1)];
    connections.extend(inputs.iter().enumerate().map(|(k, name)| (*name, 2 + k)));
    let mut nodes = vec![node("ND_open_pbr_surface_surfaceshader", &[("base_weight", number(1.0))], &connections)];
    nodes.push(node("ND_add_color3", &[], &[("in1", 7), ("in2", 8)]));
    for name in inputs {
        nodes.push(node("ND_image_float", &[("file", file(name))], &[]));
    }
    // Eleven of the program: the sum of images, each but the last two with the rest.
    for at in 0..11_usize {
        let next = nodes.len();
        nodes.push(node("ND_image_color3", &[("file", file(&format!("{at}.png")))], &[]));
        let rest = if at < 10 { next + 3 } else { next };
        nodes.push(node("ND_multiply_color3", &[], &[("in1", next), ("in2", rest)]));
    }
    let translation = translated(nodes);
    let inputs = translation.inputs.expect("a surface");
    let textures = inputs.iter().filter(|input| matches!(input, InputSource::Texture(..))).count();
    assert!(textures == 5 && textures + translation.program.lookups.len() <= 15, "{translation:?}");
}

/// Nodes whose inputs both read the next node: work that doubles with each would never end.
#[test]
fn shared_nodes_are_translated_once() {
    let emission = |kind| ("ND_surface", kind, "edf", ["bg", "fg"], "ND_uniform_edf");
    let reflection = |kind, inputs| ("ND_surface", kind, "bsdf", inputs, "ND_oren_nayar_diffuse_bsdf");
    for (surface, kind, input, [a, b], last) in [
        reflection("ND_mix_bsdf", ["bg", "fg"]),
        reflection("ND_layer_bsdf", ["base", "top"]),
        reflection("ND_add_bsdf", ["in1", "in2"]),
        emission("ND_mix_edf"),
    ] {
        let mut nodes = vec![node(surface, &[], &[(input, 1)])];
        for at in 1..31_usize {
            nodes.push(node(kind, &[("mix", number(0.5))], &[(a, at + 1), (b, at + 1)]));
        }
        nodes.push(node(last, &[], &[]));
        check(&Network { nodes: nodes.clone(), ..Network::default() });
        assert_eq!(translated(nodes.clone()).problems, Vec::<String>::new(), "{kind}: deep, and understood");
        // The last one reads the first: a circle, met along both ways at each node.
        nodes[30] = node(kind, &[], &[(a, 1), (b, 1)]);
        let translation = translated(nodes);
        assert_eq!(translation.problems.len(), 1, "{kind}: {:?}", translation.problems);
        assert!(translation.problems[0].contains("in a circle"), "{:?}", translation.problems);
    }
    let mut nodes = Vec::new();
    for at in 0..15_usize {
        nodes.push(node("ND_mix_surfaceshader", &[("mix", number(0.5))], &[("bg", at + 1), ("fg", at + 1)]));
    }
    nodes.push(node("ND_open_pbr_surface_surfaceshader", &[], &[]));
    check(&Network { nodes, ..Network::default() });
}

/// Thousands of nodes that all count, and as many inputs of one.
#[test]
fn thousands_of_nodes_are_translated_or_refused() {
    let mut nodes =
        vec![node("ND_open_pbr_surface_surfaceshader", &[("base_weight", number(1.0))], &[("base_color", 1)])];
    for at in 1..4000_usize {
        let [a, b] = [2 * at, 2 * at + 1].map(|below| below.min(3999));
        let kind = if at < 2000 { "ND_add_color3" } else { "ND_noise2d_color3" };
        let inputs: &[(&str, usize)] = if at < 2000 { &[("in1", a), ("in2", b)] } else { &[] };
        nodes.push(node(kind, &[("pivot", number(at as f32))], inputs));
    }
    check(&Network { nodes: nodes.clone(), ..Network::default() });
    let [problem] = &translated(nodes.clone()).problems[..] else { panic!("one line") };
    assert!(problem.starts_with("the patterns have more"), "{problem}");
    nodes[0].connections = (0..100_000).map(|at| (format!("input_{at}").into(), at % 4000, "out".into())).collect();
    check(&Network { nodes: nodes.clone(), ..Network::default() });
    nodes.extend(vec![node("ND_add_color3", &[], &[]); 200]);
    let [problem] = &translated(nodes).problems[..] else { panic!("one line") };
    assert!(problem.contains("too many nodes"), "{problem}");
}

/// What is wrong with thousands of nodes is told in a bounded number of lines.
#[test]
fn many_problems_are_few_lines() {
    let mut nodes = vec![node("ND_open_pbr_surface_surfaceshader", &[], &[("base_color", 1)])];
    for at in 1..3000_usize {
        let [a, b] = [2 * at, 2 * at + 1].map(|below| below.min(2999));
        let mut wrong = node(if at < 1500 { "ND_add_color3" } else { "ND_nothing" }, &[], &[("in1", a), ("in2", b)]);
        wrong.path = format!("/m/n{at}").into();
        nodes.push(wrong);
    }
    let problems = translated(nodes).problems;
    assert!((1..=64).contains(&problems.len()), "{} lines", problems.len());
}

#[test]
fn no_surface_is_a_problem() {
    for network in [Network::default(), Network { nodes: vec![node("ND_add_float", &[], &[])], ..Network::default() }] {
        let translation = translate(&network, library());
        assert!(translation.inputs.is_none() && translation.problems.len() == 1, "{translation:?}");
    }
}
