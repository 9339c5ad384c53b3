// SPDX-License-Identifier: Apache-2.0
//! Opacity: as a texture with a threshold, or by a program of its own.

use oocpt_materialx::network::NetworkNode;
use oocpt_materialx::surface::Input;
use oocpt_materialx::value::PortValue;
use oocpt_materialx::{InputSource, TranslatedNetwork};

use crate::support::{file, node, number, sound, source};

const OPEN_PBR: &str = "ND_open_pbr_surface_surfaceshader";
const GLTF: &str = "ND_gltf_pbr_surfaceshader";

/// A leaf whose opacity is this node, which reads alpha of a picture by node 2, or what node 4 makes of it.
fn leaf(surface: &str, own: &[(&str, PortValue)], opacity: NetworkNode) -> TranslatedNetwork {
    let input = if surface == GLTF { "alpha" } else { "geometry_opacity" };
    sound(vec![
        node(surface, own, &[(input, 1)]),
        opacity,
        node("ND_extract_color4", &[("index", number(3.0))], &[("in", 3)]),
        node("ND_image_color4", &[("file", file("leaf.png"))], &[]),
        node("ND_modulo_float", &[("in2", number(0.3))], &[("in1", 2)]),
    ])
}

#[test]
fn opacity_that_compares_a_texel_is_a_texture_with_a_threshold() {
    let compared = |kind: &str, own: &[(&str, PortValue)], connection: &str| {
        leaf(OPEN_PBR, &[], node(kind, own, &[(connection, 2)]))
    };
    let [half, one, zero] = [0.5, 1.0, 0.0].map(number);
    let rising = [("value2", half.clone()), ("in1", one.clone()), ("in2", zero.clone())];
    let falling = [("value1", half), ("in1", one), ("in2", zero)];
    let masked = [("alpha_mode", number(1.0)), ("alpha_cutoff", number(0.5))];
    let smooth = [("low", number(0.25)), ("high", number(0.75))];
    for (what, translation, is_there) in [
        ("at least", compared("ND_ifgreatereq_float", &rising, "value1"), [false, true, true]),
        ("more than", compared("ND_ifgreater_float", &rising, "value1"), [false, false, true]),
        ("at most", compared("ND_ifgreatereq_float", &falling, "value2"), [true, true, false]),
        ("less than", compared("ND_ifgreater_float", &falling, "value2"), [true, false, false]),
        (
            "a curve before a threshold",
            leaf(GLTF, &masked, node("ND_smoothstep_float", &smooth, &[("in", 2)])),
            [false, true, true],
        ),
    ] {
        let InputSource::Texture(lookup, Some(3)) = source(&translation, Input::Opacity) else {
            panic!("{what}: {:?}", source(&translation, Input::Opacity));
        };
        assert!(translation.opacity_threshold > 0.0 && translation.opacity_program.instructions.is_empty(), "{what}");
        let opacities = [0.499_f32, 0.5, 0.501].map(|alpha| alpha * lookup.scale[3] + lookup.bias[3]);
        assert_eq!(opacities.map(|opacity| opacity >= translation.opacity_threshold), is_there, "{what}");
    }
}

#[test]
fn opacity_that_is_no_single_step_of_a_texel_keeps_its_program() {
    let [half, one, zero] = [0.5, 1.0, 0.0].map(number);
    let wave = [("value2", number(0.05)), ("in1", one.clone()), ("in2", zero.clone())];
    let equal = [("value2", half.clone()), ("in1", one.clone()), ("in2", zero.clone())];
    let faint = [("value2", half), ("in1", number(0.8)), ("in2", zero)];
    for (what, opacity) in [
        ("there at one value", node("ND_ifequal_float", &equal, &[("value1", 2)])),
        ("seven steps", node("ND_ifgreatereq_float", &wave, &[("value1", 4)])),
        ("a probability beside 0 and 1", node("ND_ifgreatereq_float", &faint, &[("value1", 2)])),
        ("no step", node("ND_power_float", &[("in2", number(2.0))], &[("in1", 2)])),
    ] {
        let translation = leaf(OPEN_PBR, &[], opacity);
        assert!(matches!(source(&translation, Input::Opacity), InputSource::Register(_)), "{what}");
        assert!(translation.opacity_threshold == 0.0 && !translation.opacity_program.instructions.is_empty(), "{what}");
    }
}

/// The other numbers cancel where they are equal: that is no reason to leave them out.
#[test]
fn opacity_of_one_texel_by_several_of_its_numbers_keeps_its_program() {
    let [half, one, zero] = [0.5, 1.0, 0.0].map(number);
    let there = [("value2", half), ("in1", one.clone()), ("in2", zero.clone())];
    let translation = sound(vec![
        node(OPEN_PBR, &[], &[("geometry_opacity", 1)]),
        node("ND_ifgreatereq_float", &there, &[("value1", 2)]),
        node("ND_add_float", &[], &[("in1", 3), ("in2", 4)]),
        node("ND_extract_color4", &[("index", number(3.0))], &[("in", 7)]),
        node("ND_subtract_float", &[], &[("in1", 5), ("in2", 6)]),
        node("ND_extract_color4", &[("index", zero)], &[("in", 7)]),
        node("ND_extract_color4", &[("index", one)], &[("in", 7)]),
        node("ND_image_color4", &[("file", file("leaf.png"))], &[]),
    ]);
    assert!(matches!(source(&translation, Input::Opacity), InputSource::Register(_)), "alpha + red - green");
}
