// SPDX-License-Identifier: Apache-2.0
//! Cutouts and lights by programs that look up textures: the same bits whatever the budget.

use super::opacity_masks::{DISTANCES, cards, coverage, is_near};
use super::test_images::LEAF_AREA;
use super::*;

/// Leaves as in `leaves`, with an opacity that is the product of two lookups, the second at the place that the first
/// gives.
pub(super) fn leaves_by_program(db: &mut SceneDb) {
    leaves(db);
    let file = |name: &str| ParamValue::Asset(AssetRef { authored: name.into(), resolved: name.into() });
    for (material, threshold) in [("/sharp_leaf", 0.25), ("/soft_leaf", 0.0)] {
        let node = crate::materials::node;
        let mode = ParamValue::Int(if threshold > 0.0 { 1 } else { 2 });
        let params = [("alpha_mode", mode), ("alpha_cutoff", ParamValue::Float(threshold))];
        let nodes = vec![
            node("ND_gltf_pbr_surfaceshader", &params, &[("alpha", 1)]),
            node("ND_multiply_float", &[], &[("in1", 2), ("in2", 3)]),
            node("ND_image_float", &[("file", file("700x900x2"))], &[("texcoord", 4)]),
            node("ND_image_float", &[("file", file("512x512x1"))], &[("texcoord", 5)]),
            node("ND_texcoord_vector2", &[], &[]),
            node("ND_add_vector2", &[], &[("in1", 4), ("in2", 6)]),
            node("ND_image_vector2", &[("file", file("640x1030x2"))], &[("texcoord", 4)]),
        ];
        db.upsert_material(MaterialDesc { path: material.into(), nodes, surface: Some(0), ..MaterialDesc::default() });
    }
}

#[test]
fn streaming_program_textures_changes_no_bit() {
    same_bits(leaves_by_program);
}

/// Signs as in `signs`, two of them by programs: the product of two lookups, and a lookup at the place of another,
/// times stripes without lookups.
fn signs_by_program(db: &mut SceneDb) {
    signs(db);
    let file = |name: &str| ParamValue::Asset(AssetRef { authored: name.into(), resolved: name.into() });
    let node = crate::materials::node;
    let dark = [
        ("base_weight", ParamValue::Float(0.0)),
        ("specular_weight", ParamValue::Float(0.0)),
        ("emission_luminance", ParamValue::Float(1.0)),
    ];
    let surface = || node("ND_open_pbr_surface_surfaceshader", &dark, &[("emission_color", 1)]);
    let product = vec![
        surface(),
        node("ND_multiply_color3", &[], &[("in1", 2), ("in2", 3)]),
        node("ND_image_color3", &[("file", file("1000x800x4"))], &[]),
        node("ND_image_color3", &[("file", file("900x700x3"))], &[]),
    ];
    let moved = vec![
        surface(),
        node("ND_multiply_color3FA", &[], &[("in1", 2), ("in2", 5)]),
        node("ND_image_color3", &[("file", file("1100x300x4"))], &[("texcoord", 3)]),
        node("ND_add_vector2", &[], &[("in1", 4), ("in2", 6)]),
        node("ND_image_vector2", &[("file", file("640x1030x2"))], &[]),
        node("ND_noise2d_float", &[("pivot", ParamValue::Float(1.5))], &[("texcoord", 6)]),
        node("ND_texcoord_vector2", &[], &[]),
    ];
    for (path, nodes) in [("/glow_0", product), ("/glow_1", moved)] {
        db.upsert_material(MaterialDesc { path: path.into(), nodes, surface: Some(0), ..MaterialDesc::default() });
    }
}

#[test]
fn streaming_emission_program_textures_changes_no_bit() {
    same_bits(signs_by_program);
}

/// A comparison is a texture with a threshold, and has a mask; by `opaque` there it has a program, whose lookups are of
/// the finest level.
#[test]
fn coverage_of_a_comparison_is_the_same_from_every_distance() {
    let node = crate::materials::node;
    for (opaque, expected) in [(1.0, LEAF_AREA), (0.8, 0.8 * LEAF_AREA)] {
        // The program is the same code from everywhere: its distances are the nearest and the farthest.
        for along in DISTANCES.into_iter().filter(|along| opaque == 1.0 || [4, 512].contains(along)) {
            let [alpha, _] = coverage(64, (opaque == 1.0, false), None, |db| {
                let file =
                    ParamValue::Asset(AssetRef { authored: "leaf 256x128".into(), resolved: "leaf 256x128".into() });
                let values = [("value2", 0.5), ("in1", opaque), ("in2", 0.0)];
                let nodes = vec![
                    node("ND_open_pbr_surface_surfaceshader", &[], &[("geometry_opacity", 1)]),
                    node(
                        "ND_ifgreatereq_float",
                        &values.map(|(name, value)| (name, ParamValue::Float(value))),
                        &[("value1", 2)],
                    ),
                    node("ND_extract_color4", &[("index", ParamValue::Int(3))], &[("in", 3)]),
                    node("ND_image_color4", &[("file", file)], &[]),
                ];
                db.upsert_mesh(cards("/cards", 1, along, |_, _| [0.0; 2]));
                db.upsert_material(MaterialDesc {
                    path: "/m".into(),
                    nodes,
                    surface: Some(0),
                    ..MaterialDesc::default()
                });
            });
            is_near(&format!("{along} cards, {opaque} where it is there"), alpha, expected);
        }
    }
}
