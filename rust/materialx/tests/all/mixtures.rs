// SPDX-License-Identifier: Apache-2.0
//! Mixtures: one slab where its mixed parameters are what is asked for, else one of two by a random number of the hit.

use oocpt_materialx::network::NetworkNode;
use oocpt_materialx::program::Geometry;
use oocpt_materialx::surface::Input;
use oocpt_materialx::value::PortValue;
use oocpt_materialx::{InputSource, TranslatedNetwork};

use crate::support::{file, node, number, sound, source, translated, value, vector};

const OPEN_PBR: &str = "ND_open_pbr_surface_surfaceshader";

/// An input where the random numbers of the hit are these.
fn chosen(translation: &TranslatedNetwork, input: Input, random: [f32; 3]) -> [f32; 4] {
    let surface = |what| match Geometry::RANDOM.iter().position(|known| *known == what) {
        Some(which) => [random[which]; 4],
        None => [0.0; 4],
    };
    value(translation, input, surface, |_, _| [0.25; 4])
}

/// `surface(mix(bg, fg))`.
fn mixed(share: f32, back: NetworkNode, front: NetworkNode) -> Vec<NetworkNode> {
    vec![
        node("ND_surface", &[], &[("bsdf", 1)]),
        node("ND_mix_bsdf", &[("mix", number(share))], &[("bg", 2), ("fg", 3)]),
        back,
        front,
    ]
}

/// Of a roughness, which is the root of its alpha.
fn metal(roughness: f32, color: [f32; 3]) -> NetworkNode {
    let alpha = roughness * roughness;
    let values = [("color0", vector(color[0], color[1], color[2])), ("roughness", vector(alpha, alpha, 0.0))];
    node("ND_generalized_schlick_bsdf", &values, &[])
}

fn diffuse(color: [f32; 3]) -> NetworkNode {
    node("ND_oren_nayar_diffuse_bsdf", &[("color", vector(color[0], color[1], color[2]))], &[])
}

fn near(found: &[f32], known: &[f32]) {
    assert!(found.iter().zip(known).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?}, not {known:?}");
}

/// No program, so nothing by chance.
fn is_plain(translation: &TranslatedNetwork) -> bool {
    translation.program.instructions.is_empty()
}

#[test]
fn metals_of_two_roughnesses_are_chosen_by_their_share() {
    let translation = sound(mixed(0.25, metal(0.6, [0.8, 0.4, 0.2]), metal(0.1, [0.1, 0.2, 0.3])));
    assert!(translation.program.is_random() && !translation.specular_workflow, "{translation:?}");
    for (random, roughness, color) in [
        (0.0, 0.1, [0.1, 0.2, 0.3]),
        (0.249, 0.1, [0.1, 0.2, 0.3]),
        (0.25, 0.6, [0.8, 0.4, 0.2]),
        (0.999, 0.6, [0.8, 0.4, 0.2]),
    ] {
        let of = |input| chosen(&translation, input, [random; 3]);
        near(&[of(Input::Roughness)[0]], &[roughness]);
        near(&of(Input::DiffuseColor)[..3], &color);
        assert_eq!(of(Input::Metallic)[0], 1.0);
    }
}

/// Colours and shares are what a slab is linear in: bits of such materials stay what they are.
#[test]
fn linearly_mixable_slabs_are_not_chosen_stochastically() {
    let of = |translation: &_, input| match source(translation, input) {
        InputSource::Constant(value) => value,
        other => panic!("{input:?} is {other:?}"),
    };
    // Two metals of one roughness; two diffuse lobes.
    let metals = sound(mixed(0.25, metal(0.3, [0.8; 3]), metal(0.3, [0.4; 3])));
    near(&of(&metals, Input::DiffuseColor)[..3], &[0.7; 3]);
    let dull = sound(mixed(0.25, diffuse([0.8; 3]), diffuse([0.4; 3])));
    near(&of(&dull, Input::DiffuseColor)[..3], &[0.7; 3]);
    // Diffuse and a reflection: the reflection's own roughness and index.
    let gloss = node("ND_dielectric_bsdf", &[("ior", number(1.5)), ("roughness", vector(0.04, 0.04, 0.0))], &[]);
    let plastic = sound(mixed(0.5, diffuse([0.8; 3]), gloss));
    near(&[of(&plastic, Input::Roughness)[0], of(&plastic, Input::DiffuseColor)[0]], &[0.2, 0.4]);
    // Diffuse and glass: glass takes nothing from the colour, diffuse nothing from the tint.
    let values = [("scatter_mode", crate::support::text("RT")), ("tint", vector(0.5, 0.25, 1.0))];
    let glass = node("ND_dielectric_bsdf", &values, &[]);
    let glazed = sound(mixed(0.25, diffuse([0.8; 3]), glass.clone()));
    near(&of(&glazed, Input::DiffuseColor)[..3], &[0.8; 3]);
    near(&of(&glazed, Input::TransmissionColor)[..3], &[0.5, 0.25, 1.0]);
    near(&[of(&glazed, Input::Transmission)[0]], &[0.25]);
    // Glass and metal of one roughness: what is no metal is glass, nothing is diffuse.
    let alpha = 0.05_f32.sqrt();
    let both = sound(mixed(0.25, metal(alpha, [0.9; 3]), glass));
    near(&[of(&both, Input::Metallic)[0]], &[0.75]);
    near(&[of(&both, Input::Transmission)[0]], &[1.0]);
    for translation in [metals, dull, plastic, glazed, both] {
        assert!(is_plain(&translation), "{translation:?}");
    }
}

#[test]
fn mix_weights_of_zero_or_one_and_equal_slabs_need_no_choice() {
    let of = |translation: &TranslatedNetwork| match source(translation, Input::Roughness) {
        InputSource::Constant(value) => value[0],
        other => panic!("{other:?}"),
    };
    let parts = || (metal(0.6, [0.8; 3]), metal(0.1, [0.2; 3]));
    for (share, roughness) in [(0.0, 0.6), (1.0, 0.1)] {
        let (back, front) = parts();
        let translation = sound(mixed(share, back, front));
        near(&[of(&translation)], &[roughness]);
        assert!(is_plain(&translation));
    }
    // What is alone takes nothing from the other: no roughness of it.
    let back = metal(0.6, [0.8; 3]);
    let rough = node("ND_oren_nayar_diffuse_bsdf", &[("roughness", number(0.5))], &[]);
    let translation = sound(mixed(0.0, back, rough));
    assert_eq!(source(&translation, Input::DiffuseRoughness), InputSource::Constant([0.0; 4]));
    // A mask between equal slabs.
    let mut nodes = mixed(0.0, metal(0.6, [0.8; 3]), metal(0.6, [0.8; 3]));
    nodes[1] = node("ND_mix_bsdf", &[], &[("bg", 2), ("fg", 3), ("mix", 4)]);
    nodes.push(node("ND_image_float", &[("file", file("mask.png"))], &[]));
    let translation = sound(nodes);
    assert!(is_plain(&translation) && (of(&translation) - 0.6).abs() < 1e-6, "{translation:?}");
}

/// A mask of 0.25, from a texture: the front below it. Diffuse and metal share a colour, so they cannot be one slab.
#[test]
fn a_mix_mask_is_the_selection_probability() {
    let mut nodes = mixed(0.0, diffuse([0.8, 0.1, 0.1]), metal(0.3, [0.9, 0.7, 0.2]));
    nodes[1] = node("ND_mix_bsdf", &[], &[("bg", 2), ("fg", 3), ("mix", 4)]);
    nodes.push(node("ND_image_float", &[("file", file("mask.png"))], &[]));
    let translation = sound(nodes);
    for (random, metallic, color) in [(0.2, 1.0, [0.9, 0.7, 0.2]), (0.3, 0.0, [0.8, 0.1, 0.1])] {
        near(&[chosen(&translation, Input::Metallic, [random; 3])[0]], &[metallic]);
        near(&chosen(&translation, Input::DiffuseColor, [random; 3])[..3], &color);
    }
    assert_eq!(translation.program.lookups.len(), 1, "the mask is looked up once");
}

/// The means of what is chosen are those of the mixture, however deep; each choice has a random number of its own.
#[test]
fn nested_mixtures_use_independent_random_numbers() {
    let mut nodes = mixed(0.25, metal(0.1, [0.1; 3]), metal(0.2, [0.2; 3]));
    nodes[1] = node("ND_mix_bsdf", &[("mix", number(0.5))], &[("bg", 4), ("fg", 5)]);
    nodes.push(node("ND_mix_bsdf", &[("mix", number(0.25))], &[("bg", 2), ("fg", 3)]));
    nodes.push(node("ND_mix_bsdf", &[("mix", number(0.75))], &[("bg", 6), ("fg", 7)]));
    nodes.push(metal(0.3, [0.4; 3]));
    nodes.push(metal(0.4, [0.8; 3]));
    let translation = sound(nodes);
    let mut sum = 0.0;
    for at in 0..64_u8 {
        let random = [at % 4, at / 4 % 4, at / 16].map(|k| (f32::from(k) + 0.5) / 4.0);
        sum += chosen(&translation, Input::DiffuseColor, random)[0] / 64.0;
    }
    near(&[sum], &[0.5 * (0.75 * 0.1 + 0.25 * 0.2) + 0.5 * (0.25 * 0.4 + 0.75 * 0.8)]);
}

#[test]
fn more_than_four_slabs_give_one_warning() {
    let mut nodes = vec![node("ND_surface", &[], &[("bsdf", 1)])];
    for at in 0..5_usize {
        let next = if at < 4 { 2 * at + 3 } else { 2 * at + 2 };
        nodes.push(node("ND_mix_bsdf", &[("mix", number(0.5))], &[("bg", 2 * at + 2), ("fg", next)]));
        nodes.push(metal(0.1 + 0.1 * at as f32, [0.5; 3]));
    }
    let problems = translated(nodes).problems;
    let [problem] = &problems[..] else { panic!("one line: {problems:?}") };
    assert!(problem.contains("/m/ND_mix_bsdf: more than 4 sets of lobes are mixed"), "{problem}");
}

fn surfaces(share: f32, back: &[(&str, PortValue)], front: &[(&str, PortValue)]) -> TranslatedNetwork {
    sound(vec![
        node("ND_mix_surfaceshader", &[("mix", number(share))], &[("bg", 1), ("fg", 2)]),
        node(OPEN_PBR, back, &[]),
        node(OPEN_PBR, front, &[]),
    ])
}

/// Emission and opacity are mixed, also under coats that tint them and are chosen.
#[test]
fn emission_and_opacity_are_not_chosen() {
    let translation = surfaces(
        0.25,
        &[("emission_luminance", number(2.0)), ("coat_weight", number(0.0)), ("geometry_opacity", number(0.5))],
        &[
            ("emission_luminance", number(4.0)),
            ("coat_weight", number(1.0)),
            ("coat_color", vector(0.5, 0.5, 0.5)),
            ("coat_roughness", number(0.2)),
            ("specular_roughness", number(0.7)),
            ("geometry_opacity", number(0.5)),
        ],
    );
    assert!(translation.program.is_random());
    let InputSource::Constant(emission) = source(&translation, Input::EmissiveColor) else { panic!() };
    near(&emission[..3], &[0.75 * 2.0 + 0.25 * 4.0 * 0.5; 3]);
    let InputSource::Constant(opacity) = source(&translation, Input::Opacity) else { panic!() };
    near(&opacity[..1], &[0.5]);
    // The coat is there, or it is not; its tint is in the base below it.
    let of = |input, random| chosen(&translation, input, [random; 3]);
    near(&[of(Input::Clearcoat, 0.0)[0], of(Input::Clearcoat, 0.5)[0]], &[1.0, 0.0]);
    near(&[of(Input::DiffuseColor, 0.0)[0], of(Input::DiffuseColor, 0.5)[0]], &[0.4, 0.8]);
}

/// What is there of the front is its share times its opacity: where a surface is met, that of what is there.
#[test]
fn selection_weights_include_opacity() {
    let rough = |roughness: f32, opacity: f32, light: f32| {
        [
            ("specular_roughness", number(roughness)),
            ("geometry_opacity", number(opacity)),
            ("emission_luminance", number(light)),
        ]
    };
    let translation = surfaces(0.5, &rough(0.7, 1.0, 1.0), &rough(0.2, 0.25, 3.0));
    let opacity = 0.5 + 0.5 * 0.25;
    let InputSource::Constant(found) = source(&translation, Input::Opacity) else { panic!() };
    near(&found[..1], &[opacity]);
    let share = 0.5 * 0.25 / opacity;
    let of = |random| chosen(&translation, Input::Roughness, [random; 3])[0];
    near(&[of(share - 0.001), of(share + 0.001)], &[0.2, 0.7]);
    let InputSource::Constant(emission) = source(&translation, Input::EmissiveColor) else { panic!() };
    near(&emission[..1], &[(0.5 * 0.25 * 3.0 + 0.5 * 1.0) / opacity]);
    let gone = surfaces(0.5, &rough(0.7, 1.0, 1.0), &rough(0.2, 0.0, 3.0));
    assert!(is_plain(&gone), "the front is nowhere: {gone:?}");
}

/// a + b: each by its part of the weights, and so much brighter.
#[test]
fn added_slabs_are_selected_by_weight() {
    let weighed = |weights: [f32; 2]| {
        let mut nodes = mixed(0.0, metal(0.1, [0.5; 3]), metal(0.6, [0.9, 0.6, 0.3]));
        nodes[1] = node("ND_add_bsdf", &[], &[("in1", 2), ("in2", 4)]);
        nodes[2].values.push(("weight".into(), number(weights[0])));
        nodes.push(node("ND_multiply_bsdfF", &[("in2", number(weights[1]))], &[("in1", 3)]));
        translated(nodes)
    };
    let translation = weighed([0.25, 0.5]);
    assert_eq!(translation.problems, Vec::<String>::new());
    for (random, roughness, color) in [(0.6, 0.6, [0.9, 0.6, 0.3]), (0.7, 0.1, [0.5; 3])] {
        near(&[chosen(&translation, Input::Roughness, [random; 3])[0]], &[roughness]);
        near(&chosen(&translation, Input::DiffuseColor, [random; 3])[..3], &color.map(|c| 0.75 * c));
    }
    let [problem] = &weighed([1.0, 0.5]).problems[..] else { panic!("one line") };
    assert!(problem.starts_with("/m/ND_add_bsdf: what is added weighs 1.5"), "{problem}");
}

#[test]
fn mixing_thin_and_solid_glass_gives_one_warning() {
    let thin = [("geometry_thin_walled", number(1.0)), ("transmission_weight", number(1.0))];
    let problems = translated(vec![
        node("ND_mix_surfaceshader", &[("mix", number(0.5))], &[("bg", 1), ("fg", 2)]),
        node(OPEN_PBR, &thin, &[]),
        node(OPEN_PBR, &thin[1..], &[]),
    ])
    .problems;
    let [problem] = &problems[..] else { panic!("one line: {problems:?}") };
    assert!(problem.starts_with("/m/ND_mix_surfaceshader: a thin wall is mixed"), "{problem}");
}
