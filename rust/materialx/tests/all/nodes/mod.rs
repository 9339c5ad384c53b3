// SPDX-License-Identifier: Apache-2.0
//! Every pattern node of the data libraries against what `MaterialX`'s own GLSL gave for it (`nodes.csv`, which
//! `tests/reference/nodes.py` made), in bounds that `bounds` states.

mod bounds;
mod compare;
mod table;
mod translation;

use std::collections::{BTreeMap, BTreeSet};

use oocpt_materialx::value::{PortType, PortValue};

use super::support::{library, node, number, of_node, sound, translated, value, vector};
use bounds::Bound;
use compare::{compare, ways};
use oocpt_materialx::program::Geometry;
use oocpt_materialx::surface::Input;
use table::{Row, Table};

/// Rows of each output of each definition.
const ROWS: usize = 6;

fn fixture() -> Table {
    table::read(include_str!("../../data/nodes.csv"))
}

/// Definitions whose outputs are numbers are in the table or said not to be.
#[test]
fn every_node_definition_has_reference_rows() {
    let table = fixture();
    let mut rows: BTreeMap<(&str, &str), (usize, usize)> = BTreeMap::new();
    for block in &table.blocks {
        let found = rows.entry((&block.definition, &block.output)).or_default();
        found.0 += block.rows.len();
        found.1 += block.rows.iter().filter(|row| row.is_default).count();
    }
    for (of, count) in &rows {
        assert_eq!(*count, (ROWS, 1), "{of:?}: rows, those of defaults");
    }
    let compared: BTreeSet<&str> = rows.keys().map(|(definition, _)| *definition).collect();
    let missing: BTreeSet<&str> = table.missing.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!((compared.len(), missing.len()), (642, 60), "compared, not compared");
    let is_number = |ty: PortType| !matches!(ty, PortType::Text | PortType::File | PortType::Other);
    for definition in library().definitions() {
        let are_numbers = definition.outputs.iter().all(|(_, ty, _)| is_number(*ty));
        let name = &*definition.name;
        let is_known = compared.contains(name) || missing.contains(name);
        assert!(!are_numbers || definition.outputs.is_empty() || is_known, "{name} is nowhere");
        for (output, ..) in definition.outputs.iter().filter(|_| compared.contains(name)) {
            assert!(rows.contains_key(&(name, &**output)), "{name} {output}: no rows");
        }
    }
}

#[test]
fn node_values_match_materialx_glsl() {
    let mut wrong = Vec::new();
    for block in &fixture().blocks {
        for way in ways(block) {
            wrong.extend(compare(block, *way, library()).lines);
        }
    }
    assert!(wrong.is_empty(), "{} rows: {}", wrong.len(), wrong.join("\n"));
}

/// The comparison itself: a number that is off by more than its bound, and a component that is another's.
#[test]
#[expect(clippy::cast_possible_truncation, reason = "rounding does not matter")]
fn the_comparison_finds_planted_differences() {
    let table = fixture();
    for name in
        ["ND_add_float", "ND_noise3d_float", "ND_sin_float", "ND_mix_color3", "ND_srgb_texture_to_lin_rec709_color3"]
    {
        let mut block = table.blocks.iter().find(|block| block.definition == name).expect("in the table").clone();
        let most = Bound::of(&block).most as f32;
        for Row { given, expected, .. } in &mut block.rows {
            let scale = given.iter().chain(&*expected).fold(1.0_f32, |most, x| most.max(x.abs()));
            expected[0] += scale * (2.0 * most).max(1.0e-6);
        }
        assert_eq!(compare(&block, translation::Way::Read, library()).wrong, ROWS, "{name}");
    }
    let cross = table.blocks.iter().find(|block| block.category == "crossproduct");
    let mut swapped = cross.expect("in the table").clone();
    for row in &mut swapped.rows {
        row.expected.swap(0, 1);
    }
    assert!(compare(&swapped, translation::Way::Said, library()).wrong > 0, "swapped");
}

fn four(x: f32, y: f32, z: f32, w: f32) -> PortValue {
    PortValue::Numbers([x, y, z, w])
}

/// Cases that rows meet seldom; each was wrong once.
#[test]
fn rare_cases_match_materialx_glsl() {
    let is = |name: &str, values: &[(&str, PortValue)], expected: &[f32]| {
        assert_eq!(&of_node(name, values)[..expected.len()], expected, "{name}");
    };
    is("ND_convert_integer_boolean", &[("in", number(4.0))], &[1.0]);
    is("ND_convert_integer_boolean", &[("in", number(0.0))], &[0.0]);
    is("ND_extract_color4", &[("in", four(0.0, 0.0, 0.0, 3.0)), ("index", number(3.0))], &[3.0]);
    let mixed = |fg: f32| [("fg", number(fg)), ("bg", number(0.5)), ("mix", number(0.25))];
    is("ND_burn_float", &mixed(0.0), &[0.0]);
    is("ND_dodge_float", &mixed(1.0), &[0.0]);
    let layers = [("fg", four(0.5, 0.5, 0.5, 1.5)), ("bg", four(1.0, 2.0, 4.0, 0.0)), ("mix", number(0.5))];
    is("ND_disjointover_color4", &layers, &[0.5, 1.0, 2.0]);
    is("ND_roughness_dual", &[("roughness", vector(0.5, -1.0, 0.0))], &[0.25, 0.25]);
    is("ND_roughness_dual", &[("roughness", vector(2.0, 0.0, 0.0))], &[1.0, 1.0e-8]);
    is("ND_roughness_anisotropy", &[("roughness", number(2.0)), ("anisotropy", number(0.75))], &[1.0, 0.5]);
    is("ND_transformnormal_vector3", &[("in", vector(0.0, 3.0, -4.0))], &[0.0, 0.6, -0.8]);
    // A black value of a normal map is a flat one.
    let black = [("in", vector(0.0, 0.0, 0.0)), ("normal", vector(0.0, 0.0, 1.0))];
    is("ND_normalmap_float", &black, &[0.0, 0.0, 1.0]);
}

/// A ramp of two colours ends with the second, whatever the third is.
#[test]
fn ramps_use_their_number_of_colours() {
    let values = [
        ("num_intervals", number(2.0)),
        ("interval2", number(0.25)),
        ("color2", four(0.5, 0.25, 0.125, 1.0)),
        ("interval3", number(0.5)),
        ("color3", four(9.0, 9.0, 9.0, 9.0)),
        ("texcoord", vector(0.75, 0.0, 0.0)),
    ];
    assert_eq!(of_node("ND_ramp", &values)[..3], [0.5, 0.25, 0.125]);
}

/// What is connected decides at run time, where it is no constant.
#[test]
fn switch_inputs_of_nodes_can_be_connected() {
    let at = |kind: &str, name: &str, truth: f32, values: &[(&str, PortValue)]| {
        let translation = sound(vec![
            node("ND_open_pbr_surface_surfaceshader", &[("base_weight", number(1.0))], &[("base_color", 1)]),
            node(kind, values, &[(name, 2)]),
            node("ND_extract_vector2", &[], &[("in", 3)]),
            node("ND_texcoord_vector2", &[], &[]),
        ]);
        let surface = |what: Geometry| match what {
            Geometry::Uv0 => [truth, 0.5, 0.0, 0.0],
            Geometry::Normal => [0.0, 0.0, 1.0, 0.0],
            _ => [0.6, 0.0, 0.8, 0.0],
        };
        value(&translation, Input::DiffuseColor, surface, |_, _| [0.0; 4])[0]
    };
    let ratio = |name, truth| at("ND_facingratio_float", name, truth, &[]);
    assert_eq!([ratio("invert", 0.0), ratio("invert", 1.0)], [0.8, 1.0 - 0.8]);
    assert_eq!([ratio("faceforward", 0.0), ratio("faceforward", 1.0)], [-0.8, 0.8]);
    let place = [("texcoord", vector(0.3, 0.6, 0.0))];
    for style in [0.0, 1.0] {
        let said = of_node("ND_worleynoise2d_float", &[place[0].clone(), ("style", number(style))])[0];
        assert_eq!(at("ND_worleynoise2d_float", "style", style, &place), said, "style {style}");
    }
}

/// Programs have no matrices: a line says so.
#[test]
fn matrix_nodes_are_rejected_with_one_line() {
    let unit = PortValue::Matrix(std::array::from_fn(|row| std::array::from_fn(|k| f32::from(u8::from(row == k)))));
    let translation = translated(vec![
        node("ND_open_pbr_surface_surfaceshader", &[("base_weight", number(1.0))], &[("base_color", 1)]),
        node("ND_transformmatrix_vector3", &[("in", vector(1.0, 2.0, 3.0))], &[("mat", 2)]),
        node("ND_add_matrix33", &[("in1", unit.clone()), ("in2", unit)], &[]),
    ]);
    let line = "`transformmatrix` (/m/ND_transformmatrix_vector3) changes nothing: its matrix is worked out by nodes";
    assert_eq!(translation.problems, [line]);
}
