// SPDX-License-Identifier: Apache-2.0
//! Checks that a description can be taken apart: that nothing of its values is dropped or replaced. Pure.

use rustc_hash::FxHashMap;

use super::demand::BuildDemand;
use crate::array::{ElementType, TypedArray};
use crate::desc::{Interpolation, MeshDesc, Primvar};

/// Returns true if every primvar that is read has a value for each of its elements, and each subset names faces that
/// are there. What is dropped and counted elsewhere is then the same for the whole mesh and for its patches: nothing.
pub(super) fn has_plain_values(desc: &MeshDesc, demand: &BuildDemand<'_>) -> bool {
    let lengths: FxHashMap<Interpolation, usize> = [
        (Interpolation::Uniform, desc.face_vertex_counts.len()),
        (Interpolation::Vertex, desc.points.len()),
        (Interpolation::Varying, desc.points.len()),
        (Interpolation::FaceVarying, desc.face_vertex_indices.len()),
    ]
    .into_iter()
    .collect();
    let is_plain = |primvar: &Primvar| {
        let Some(&length) = lengths.get(&primvar.interpolation) else { return true };
        let Some(indices) = primvar.indices.as_ref().filter(|indices| !indices.is_empty()) else {
            return primvar.values.len() == length;
        };
        let view = indices.view();
        let is_there =
            |at| view.index(at).and_then(|at| usize::try_from(at).ok()).is_some_and(|at| at < primvar.values.len());
        view.element() == ElementType::I32 && view.len() == length && (0..length).all(is_there)
    };
    let own = [&desc.normals, &desc.display_color, &desc.display_opacity].into_iter().flatten();
    let named = desc.primvars.iter().filter(|named| demand.reads(&named.name)).map(|named| &named.primvar);
    let faces = desc.face_vertex_counts.len();
    let names_faces = |array: &TypedArray| {
        let view = array.view();
        let is_there = |at| view.index(at).and_then(|face| usize::try_from(face).ok()).is_some_and(|face| face < faces);
        (0..view.len()).all(is_there)
    };
    own.chain(named).all(is_plain)
        && desc.subsets.iter().map(|subset| &subset.faces).chain(&desc.hole_indices).all(names_faces)
}
