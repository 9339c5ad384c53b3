// SPDX-License-Identifier: Apache-2.0
//! Cutouts by programs that look up textures: the same bits whatever the budget.

use super::*;

/// Leaves as `leaves` has them, their opacity the product of two lookups, the second where the first says.
fn leaves_by_program(db: &mut SceneDb) {
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
fn programs_that_wait_for_their_tiles_leave_no_trace_in_the_picture() {
    same_bits(leaves_by_program);
}
