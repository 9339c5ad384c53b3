// SPDX-License-Identifier: Apache-2.0
//! Hair: its helper nodes against their formulas in f64, as constants and as programs; where a fibre's numbers go;
//! mixtures.

use oocpt_materialx::InputSource;
use oocpt_materialx::network::NetworkNode;
use oocpt_materialx::program::Geometry;
use oocpt_materialx::surface::Input;
use oocpt_materialx::value::PortValue;

use crate::support::{node, number, of_node, sound, source, translated, value, vector};

fn near(found: [f32; 4], known: &[f64], what: &str) {
    for (a, b) in found.iter().zip(known) {
        let off = (f64::from(*a) - b).abs() / b.abs().max(1e-3);
        assert!(off < 2e-5, "{what}: {found:?}, not {known:?}");
    }
}

/// Chiang et al. 2016, eq. 7 and 8.
fn roughness(along: f64, across: f64, scale: f64) -> [f64; 2] {
    let (along, across) = (along.clamp(0.001, 1.0), across.clamp(0.001, 1.0));
    let root = 0.726 * along + 0.812 * along.powi(2) + 3.7 * along.powi(20);
    [(root * scale).powi(2), 0.265 * across + 1.194 * across.powi(2) + 5.372 * across.powi(22)]
}

/// Eq. 9.
fn of_color(color: f64, across: f64) -> f64 {
    let below = 5.969 - 0.215 * across + 2.532 * across.powi(2) - 10.73 * across.powi(3)
        + 5.574 * across.powi(4)
        + 0.245 * across.powi(5);
    (color.clamp(0.001, 1.0).ln() / below).powi(2)
}

/// d'Eon et al. 2011: what eumelanin and pheomelanin absorb.
fn of_melanin(concentration: f64, redness: f64) -> [f64; 3] {
    let melanin = -(1.0 - concentration).max(0.0001).ln();
    let eumelanin = [0.657_704_f64, 0.498_077, 0.254_107];
    let pheomelanin = [0.829_444_f64, 0.670_32, 0.349_938];
    std::array::from_fn(|k| melanin * (-(1.0 - redness) * eumelanin[k].ln() - redness * pheomelanin[k].ln()))
}

#[test]
fn hair_helper_nodes_match_their_formulas() {
    for step in 0..24_u8 {
        let (a, b) = (f32::from(step) / 20.0 - 0.05, f32::from(step * 7 % 24) / 22.0);
        let (x, y) = (f64::from(a), f64::from(b));
        let found = of_node("ND_chiang_hair_roughness", &[("longitudinal", number(a)), ("azimuthal", number(b))]);
        near(found, &roughness(x, y, 1.0), "roughness");
        let colors = [("color", vector(a, b, 0.5)), ("azimuthal_roughness", number(b))];
        let found = of_node("ND_chiang_hair_absorption_from_color", &colors);
        near(found, &[of_color(x, y), of_color(y, y), of_color(0.5, y)], "absorption of a colour");
        let said = [("melanin_concentration", number(a.max(0.0))), ("melanin_redness", number(b))];
        let found = of_node("ND_deon_hair_absorption_from_melanin", &said);
        near(found, &of_melanin(x.max(0.0), y), "absorption of melanin");
    }
}

/// A surface of one fibre, whose first nodes are these two.
fn fibre(
    values: &[(&str, PortValue)],
    connections: &[(&str, usize, &str)],
    more: Vec<NetworkNode>,
) -> Vec<NetworkNode> {
    let mut hair = node("ND_chiang_hair_bsdf", values, &[]);
    hair.connections = connections.iter().map(|(input, at, output)| ((*input).into(), *at, (*output).into())).collect();
    [vec![node("ND_surface", &[], &[("bsdf", 1)]), hair], more].concat()
}

fn constant(source: InputSource) -> [f32; 4] {
    match source {
        InputSource::Constant(value) => value,
        other => panic!("no constant: {other:?}"),
    }
}

#[test]
fn hair_inputs_map_to_fibre_parameters() {
    let outputs = [
        ("roughness_R", 2, "roughness_R"),
        ("roughness_TT", 2, "roughness_TT"),
        ("roughness_TRT", 2, "roughness_TRT"),
        ("absorption_coefficient", 3, "absorption"),
    ];
    let said = [("tint_R", vector(0.1, 0.2, 0.3)), ("ior", number(1.4)), ("cuticle_angle", number(0.75))];
    let more = vec![
        node("ND_chiang_hair_roughness", &[("longitudinal", number(0.3)), ("scale_TRT", number(3.0))], &[]),
        node("ND_deon_hair_absorption_from_melanin", &[], &[]),
    ];
    let translation = sound(fibre(&said, &outputs, more));
    assert!(translation.hair && translation.program.instructions.is_empty(), "{translation:?}");
    let of = |input| constant(source(&translation, input));
    near(of(Input::DiffuseColor), &[0.1, 0.2, 0.3], "tint of R");
    near(of(Input::SpecularColor), &[1.0; 3], "tint of TT");
    near(of(Input::Ior), &[1.4], "index");
    let [r, tt, trt] = [1.0, 0.5, 3.0].map(|scale| roughness(0.3, 0.2, scale));
    near(of(Input::Anisotropy), &[r[0], r[1], tt[0], tt[1]], "R and TT");
    near(of(Input::ThinFilm), &[trt[0], trt[1], std::f64::consts::FRAC_PI_4], "TRT and tilt");
    near(of(Input::Absorption), &of_melanin(0.25, 0.5), "absorption");
    let slot = source(&translation, Input::Normal);
    assert_eq!(slot, InputSource::Primvar(0), "ribbons say where they are met");
    assert_eq!(translation.uses.primvars[0].fallback, [2.0; 4], "what is no ribbon does not");
}

/// Absorption of a colour that varies is a program; a texture of a tint is none.
#[test]
fn hair_inputs_may_come_from_a_program() {
    let more = vec![
        node("ND_chiang_hair_absorption_from_color", &[("azimuthal_roughness", number(0.4))], &[("color", 3)]),
        node("ND_position_vector3", &[], &[]),
    ];
    let translation = sound(fibre(&[], &[("absorption_coefficient", 2, "absorption")], more));
    let at = |what: Geometry| if what == Geometry::Primvar0 { [0.2, 0.5, 0.9, 0.0] } else { [2.0; 4] };
    let found = value(&translation, Input::Absorption, at, |_, _| [0.0; 4]);
    near(found, &[of_color(0.2, 0.4), of_color(0.5, 0.4), of_color(0.9, 0.4)], "absorption");
}

#[test]
fn hair_mixes_only_with_hair() {
    let mut nodes = vec![
        node("ND_surface", &[], &[("bsdf", 1)]),
        node("ND_mix_bsdf", &[("mix", number(0.25))], &[("bg", 2), ("fg", 3)]),
        node("ND_chiang_hair_bsdf", &[("absorption_coefficient", vector(1.0, 2.0, 4.0))], &[]),
        node("ND_chiang_hair_bsdf", &[("tint_TT", number(0.0))], &[]),
    ];
    let translation = sound(nodes.clone());
    near(constant(source(&translation, Input::Absorption)), &[0.75, 1.5, 3.0], "absorption");
    near(constant(source(&translation, Input::SpecularColor)), &[0.75; 3], "tint");
    nodes[3] = node("ND_oren_nayar_diffuse_bsdf", &[], &[]);
    let mixed = translated(nodes);
    assert!(mixed.hair, "{mixed:?}");
    let said = "/m/ND_mix_bsdf: hair is mixed with or layered on what is no hair: hair alone is left";
    assert_eq!(mixed.problems, [said], "the node that mixes");
    let turned = translated(fibre(&[], &[("normal", 2, "out")], vec![node("ND_normal_vector3", &[], &[])]));
    assert!(turned.problems.len() == 1 && turned.problems[0].contains("that of the curve"), "{turned:?}");
}
