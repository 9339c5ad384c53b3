// SPDX-License-Identifier: Apache-2.0
//! Displacement terminals translated: constants, programs against their fields, mixtures, what is refused; and networks
//! that nobody means.

use oocpt_materialx::eval::{run, run_numbered};
use oocpt_materialx::network::{Network, NetworkNode};
use oocpt_materialx::program::{Geometry, MAX_CONSTANTS, MAX_INSTRUCTIONS, MAX_LOOKUPS, ProgramLookup, REGISTERS};
use oocpt_materialx::uses::MaterialUses;
use oocpt_materialx::{DisplacementOffset, DisplacementProgram, channels, translate_displacement};
use proptest::prelude::*;

use crate::hostile::{any_node, networks};
use crate::support::{file, library, node, number, text, vector};

const FLOAT: &str = "ND_displacement_float";
const VECTOR: &str = "ND_displacement_vector3";
const MIX: &str = "ND_mix_displacementshader";
const DOT: &str = "ND_dot_displacementshader";

/// Of the network's first node.
fn translated(nodes: Vec<NetworkNode>) -> (Option<DisplacementProgram>, Vec<String>) {
    translate_displacement(&Network { nodes, surface: usize::MAX, displacement: Some(0) }, library())
}

fn sound(nodes: Vec<NetworkNode>) -> DisplacementProgram {
    let (found, problems) = translated(nodes);
    assert_eq!(problems, Vec::<String>::new(), "a sound network has no problem");
    found.expect("it moves something")
}

fn value(found: &DisplacementProgram, surface: impl Fn(Geometry) -> [f32; 4]) -> [f32; 4] {
    match found.offset {
        DisplacementOffset::Constant(value) => value,
        DisplacementOffset::Register(register) => run(&found.program, surface, |_, _| [0.5; 4])[usize::from(register)],
    }
}

#[test]
fn constant_displacement_is_folded() {
    for (nodes, expected) in [
        (vec![node(FLOAT, &[("displacement", number(0.5)), ("scale", number(3.0))], &[])], 1.5),
        (
            vec![node(FLOAT, &[("scale", number(3.0))], &[("displacement", 1)]), node("ND_constant_float", &[], &[])],
            0.0,
        ),
        (vec![node(FLOAT, &[("displacement", number(0.5))], &[])], 0.5),
        (vec![node(FLOAT, &[], &[])], 0.0),
    ] {
        let (found, problems) = translated(nodes);
        assert!(problems.is_empty(), "{problems:?}");
        let offset = found.as_ref().map(|found| found.offset);
        assert_eq!(
            offset,
            (expected != 0.0).then_some(DisplacementOffset::Constant([expected; 4])),
            "what is 0 moves nothing"
        );
        assert!(
            found
                .is_none_or(|found| !found.is_vector && found.uses == MaterialUses::default() && !found.has_tangents())
        );
    }
    let found = sound(vec![node(VECTOR, &[("displacement", vector(1.0, -2.0, 3.0)), ("scale", number(0.5))], &[])]);
    let DisplacementOffset::Constant([x, y, z, _]) = found.offset else { panic!("{found:?}") };
    assert_eq!(([x, y, z], found.is_vector, found.program.instructions.len()), ([0.5, -1.0, 1.5], true, 0));
    assert_eq!(found.uses.uv_sets, ["st".into()], "tangents follow the first set");
}

/// A field of everything that a vertex has, times a scale that varies, too.
#[test]
fn displacement_programs_match_their_fields() {
    let found = sound(vec![
        node(FLOAT, &[], &[("displacement", 1), ("scale", 2)]),
        node("ND_dotproduct_vector3", &[], &[("in1", 3), ("in2", 4)]),
        node("ND_geompropvalue_float", &[("geomprop", text("heat"))], &[]),
        node("ND_position_vector3", &[], &[]),
        node("ND_normal_vector3", &[], &[]),
    ]);
    let at = |what: Geometry| match what {
        Geometry::Position => [1.0, 2.0, 3.0, 0.0],
        Geometry::Normal => [0.5, -1.0, 2.0, 0.0],
        Geometry::Primvar0 => [3.0; 4],
        other => panic!("{other:?} is not read"),
    };
    assert_eq!(value(&found, at)[0], 13.5);
    // Points and normals take no place of a primvar.
    assert_eq!(found.uses.primvars.iter().map(|primvar| &*primvar.name).collect::<Vec<_>>(), ["heat"]);
    assert!(!found.has_tangents() && found.uses.uv_sets.is_empty());
}

#[test]
fn mixed_displacements_interpolate_and_scalars_follow_the_normal() {
    let [a, b] = [("displacement", number(4.0)), ("displacement", number(8.0))];
    let sides = [("fg", 1), ("bg", 2)];
    let mix = |share: f32| node(MIX, &[("mix", number(share))], &sides);
    let found =
        sound(vec![mix(0.25), node(FLOAT, std::slice::from_ref(&a), &[]), node(FLOAT, std::slice::from_ref(&b), &[])]);
    assert_eq!(found.offset, DisplacementOffset::Constant([7.0; 4]));
    let across = ("displacement", vector(1.0, 2.0, 4.0));
    let found = sound(vec![mix(0.25), node(VECTOR, &[across], &[]), node(FLOAT, std::slice::from_ref(&b), &[])]);
    let DisplacementOffset::Constant([x, y, z, _]) = found.offset else { panic!("{found:?}") };
    assert_eq!(([x, y, z], found.is_vector), ([0.25, 0.5, 7.0], true));
    // What is not connected moves nothing; `dot` hands on.
    let found = sound(vec![
        node(DOT, &[], &[("in", 1)]),
        node(MIX, &[("mix", number(0.25))], &[("fg", 2)]),
        node(FLOAT, &[a], &[]),
    ]);
    assert_eq!(found.offset, DisplacementOffset::Constant([1.0; 4]));
    // By a share that varies.
    let found = sound(vec![
        node(MIX, &[], &[("fg", 1), ("bg", 2), ("mix", 3)]),
        node(FLOAT, &[("displacement", number(4.0))], &[]),
        node(FLOAT, &[b], &[]),
        node("ND_extract_vector2", &[("index", number(1.0))], &[("in", 4)]),
        node("ND_texcoord_vector2", &[], &[]),
    ]);
    assert_eq!(value(&found, |_| [0.0, 0.75, 0.0, 0.0])[0], 5.0);
}

#[test]
fn inputs_unknown_at_vertices_give_a_warning() {
    for (kind, values) in [
        ("ND_position_vector3", vec![("space", text("world"))]),
        ("ND_normal_vector3", vec![("space", text("world"))]),
        ("ND_tangent_vector3", vec![("space", text("world"))]),
    ] {
        let (found, problems) = translated(vec![node(VECTOR, &[], &[("displacement", 1)]), node(kind, &values, &[])]);
        let [problem] = &problems[..] else { panic!("one line: {problems:?}") };
        assert!(problem.contains(&format!("(/m/{kind})")) && problem.contains("it is the object's space"), "{problem}");
        assert_eq!(value(&found.expect("all the same"), |_| [1.0, 2.0, 3.0, 0.0])[..3], [1.0, 2.0, 3.0]);
        sound(vec![node(VECTOR, &[], &[("displacement", 1)]), node(kind, &[("space", text("object"))], &[])]);
    }
    for kind in ["ND_viewdirection_vector3", "ND_facingratio_float"] {
        let shader = if kind.ends_with("float") { FLOAT } else { VECTOR };
        let (found, problems) = translated(vec![node(shader, &[], &[("displacement", 1)]), node(kind, &[], &[])]);
        assert_eq!(found, None, "{kind} is refused");
        let is_it =
            |problem: &String| problem.contains(&format!("(/m/{kind})")) && problem.contains("displaces nothing");
        assert_eq!(problems.iter().filter(|problem| is_it(problem)).count(), 1, "{problems:?}");
    }
    // Of a branch that is not taken nothing is lost.
    let (found, _) = translated(vec![
        node(VECTOR, &[], &[("displacement", 1)]),
        node("ND_mix_vector3", &[("bg", vector(1.0, 2.0, 3.0)), ("mix", number(0.0))], &[("fg", 2)]),
        node("ND_viewdirection_vector3", &[], &[]),
    ]);
    assert!(found.is_some());
}

#[test]
fn an_invalid_displacement_is_one_problem() {
    for (nodes, wanted) in [
        (vec![node("ND_noise3d_float", &[], &[])], "displacement by nodes of kind `noise3d`"),
        (vec![node("ND_open_pbr_surface_surfaceshader", &[], &[])], "of kind `open_pbr_surface`"),
        (vec![node("ND_nothing", &[], &[])], "of kind `nothing`"),
        (vec![node(DOT, &[], &[("in", 1)]), node(MIX, &[], &[("fg", 0)])], "in a circle"),
        (vec![node(DOT, &[], &[("in", 1)]), node("ND_image_color3", &[], &[])], "of kind `image`"),
        (vec![node(FLOAT, &[], &[("displacement", 1)]), node("ND_sin_float", &[], &[("in", 1)])], "in a circle"),
    ] {
        let (found, problems) = translated(nodes);
        assert!(problems.len() == 1 && problems[0].contains(wanted), "{wanted}: {problems:?}");
        assert_eq!(found, None, "{wanted}");
    }
    let out_of_range = Network { displacement: Some(7), ..Network::default() };
    let (found, problems) = translate_displacement(&out_of_range, library());
    assert!(found.is_none() && problems.len() == 1, "{problems:?}");
    assert_eq!(translate_displacement(&Network::default(), library()), (None, Vec::new()), "no terminal, no line");
}

/// Each node is worked out once: a ladder of mixtures that all read the next one twice.
#[test]
fn shared_displacement_nodes_are_evaluated_once() {
    let mut nodes: Vec<NetworkNode> =
        (0..15).map(|at| node(MIX, &[("mix", number(0.5))], &[("fg", at + 1), ("bg", at + 1)])).collect();
    nodes.push(node(FLOAT, &[("displacement", number(2.0))], &[]));
    assert_eq!(sound(nodes.clone()).offset, DisplacementOffset::Constant([2.0; 4]));
    nodes[14] = node(MIX, &[], &[("fg", 0), ("bg", 0)]);
    let (found, problems) = translated(nodes);
    assert!(found.is_none() && problems.len() == 1 && problems[0].contains("in a circle"), "{problems:?}");
    let mut deep: Vec<NetworkNode> = (0..400).map(|at| node(DOT, &[], &[("in", at + 1)])).collect();
    deep.push(node(FLOAT, &[("displacement", number(2.0))], &[]));
    let (found, problems) = translated(deep);
    assert!(found.is_none() && problems.len() == 1 && problems[0].contains("too deep"), "{problems:?}");
}

/// Surfaces and displacements do not share what they may read.
#[test]
fn surface_and_displacement_have_separate_limits() {
    let names = ["a", "b"];
    let mut nodes =
        vec![node(FLOAT, &[], &[("displacement", 1)]), node("ND_add_float", &[], &[("in1", 2), ("in2", 3)])];
    nodes.extend(names.map(|name| node("ND_geompropvalue_float", &[("geomprop", text(name))], &[])));
    nodes.push(node("ND_open_pbr_surface_surfaceshader", &[], &[("specular_roughness", 5), ("base_color", 6)]));
    nodes.push(node("ND_geompropvalue_float", &[("geomprop", text("c"))], &[]));
    nodes.push(node("ND_geompropvalue_color3", &[("geomprop", text("d"))], &[]));
    let network = Network { nodes, surface: 4, displacement: Some(0) };
    let (found, problems) = translate_displacement(&network, library());
    let translation = oocpt_materialx::translate(&network, library());
    assert!(problems.is_empty() && translation.problems.is_empty(), "{problems:?} {:?}", translation.problems);
    let named = |uses: &MaterialUses| uses.primvars.iter().map(|primvar| primvar.name.to_string()).collect::<Vec<_>>();
    assert_eq!(named(&found.expect("a program").uses), names);
    assert_eq!(named(&translation.uses).len(), 2);
}

#[test]
fn only_read_channels_of_displacement_textures_are_kept() {
    let image = |kind: &str| node(kind, &[("file", file("a.png"))], &[]);
    for (nodes, expected) in [
        (vec![node(FLOAT, &[], &[("displacement", 1)]), image("ND_image_float")], vec![1]),
        (vec![node(VECTOR, &[], &[("displacement", 1)]), image("ND_image_vector3")], vec![7]),
        (
            vec![
                node(FLOAT, &[], &[("displacement", 1)]),
                node("ND_extract_color4", &[("index", number(3.0))], &[("in", 2)]),
                image("ND_image_color4"),
            ],
            vec![8],
        ),
        (
            vec![
                node(FLOAT, &[], &[("displacement", 1)]),
                node("ND_dotproduct_vector3", &[("in2", vector(1.0, 2.0, 3.0))], &[("in1", 2)]),
                image("ND_image_vector3"),
            ],
            vec![7],
        ),
    ] {
        let found = sound(nodes);
        let DisplacementOffset::Register(register) = found.offset else { panic!("{found:?}") };
        assert_eq!(channels(&found.program, register, if found.is_vector { 3 } else { 1 }), expected);
    }
}

/// Everything that a displacement of strangers promises.
fn check(network: &Network) {
    let (found, problems) = translate_displacement(network, library());
    assert!(problems.len() <= 65, "{} lines", problems.len());
    let Some(found) = found else { return };
    let (program, width) = (&found.program, if found.is_vector { 3 } else { 1 });
    assert!(program.instructions.len() <= MAX_INSTRUCTIONS && program.constants.len() <= MAX_CONSTANTS);
    assert!(program.lookups.len() <= MAX_LOOKUPS && !program.is_random());
    let textures = found.uses.textures.len();
    assert!(program.lookups.iter().all(|lookup| (lookup.texture as usize) < textures));
    assert!(!found.has_tangents() || !found.uses.uv_sets.is_empty(), "tangents follow some set");
    let register = match found.offset {
        DisplacementOffset::Constant(value) => {
            assert!(value.iter().all(|v| v.is_finite()) && program.instructions.is_empty(), "{value:?}");
            return;
        }
        DisplacementOffset::Register(register) => register,
    };
    assert!(usize::from(register) < REGISTERS && !program.instructions.is_empty());
    let read = channels(program, register, width);
    let given = |what: Geometry| {
        assert!(what != Geometry::ViewDirection && !Geometry::RANDOM.contains(&what), "{what:?} is not known");
        [0.3, -0.7, 1.9, 0.4]
    };
    // Channels that do not count may be anything.
    let texel = |number: usize, other: f32| {
        let channel = |k: u8| if read[number] >> k & 1 == 1 { 0.2 + 0.2 * f32::from(k) } else { other };
        [0, 1, 2, 3].map(channel)
    };
    let results = [0.0, 0.75, -3.0].map(|other| {
        let lookup = |number: usize, _: &ProgramLookup, _: Option<[f32; 2]>| texel(number, other);
        let registers = run_numbered(program, given, lookup);
        registers[usize::from(register)][..width].to_vec()
    });
    assert!(results.iter().flatten().all(|v| v.is_finite()), "{results:?}");
    assert!(results[0] == results[1] && results[1] == results[2], "channels {read:?} of {program:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: networks(), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_networks_are_displacements_or_refused(
        nodes in (3..12_usize).prop_flat_map(|count| prop::collection::vec(any_node(count), count)),
        kind in 0..5_u8,
        share in 0.0_f32..1.0,
    ) {
        let mut nodes = nodes;
        let last = nodes.len();
        match kind {
            0 => {}
            1 => nodes[0] = node(FLOAT, &[("scale", number(share))], &[("displacement", 1)]),
            2 => nodes[0] = node(VECTOR, &[], &[("displacement", 1), ("scale", 2)]),
            _ => {
                nodes[0] = node(MIX, &[("mix", number(share))], &[("fg", last), ("bg", last + 1)]);
                nodes.push(node(FLOAT, &[], &[("displacement", 1)]));
                nodes.push(node(VECTOR, &[("scale", number(share))], &[("displacement", 2)]));
            }
        }
        if kind == 4 {
            nodes[0].connections.push(("mix".into(), 2, "out".into()));
        }
        check(&Network { nodes, surface: 0, displacement: Some(0) });
    }
}
