// SPDX-License-Identifier: Apache-2.0
//! Normals: authored ones, and smooth ones of subdivision meshes without. Pure.

use std::cell::OnceCell;

use glam::{DVec3, Vec3};
use oocpt_abi::AttributeRate;

use super::primvar::{PrimvarLayout, ValueSlot, convert, extend_points};
use super::topology::MeshTopology;
use super::{Attribute, Triangle};
use crate::array::ArrayView;
use crate::desc::{DroppedData, MeshDesc, Subdivision};

/// One unit normal per point: the area-weighted mean of the faces around it (Newell normals), on the outer side of a
/// `left_handed` mesh. If that cancels out it is the normal of some face there; points without a face get +z.
pub(crate) fn smooth_normals(topology: &MeshTopology, left_handed: bool) -> Vec<[f32; 3]> {
    let side = if left_handed { -1.0 } else { 1.0 };
    let mut sums = vec![DVec3::ZERO; topology.points.len()];
    let mut fallback = vec![DVec3::Z; topology.points.len()];
    for face in &topology.faces {
        let normal = topology.face_normal(face) * side;
        for &point in topology.face_corners(face) {
            if let (Some(sum), Some(other)) = (sums.get_mut(point as usize), fallback.get_mut(point as usize)) {
                *sum += normal;
                *other = normal;
            }
        }
    }
    let unit = |(sum, other): (DVec3, DVec3)| {
        sum.try_normalize().or_else(|| other.try_normalize()).unwrap_or(DVec3::Z).as_vec3().to_array()
    };
    sums.into_iter().zip(fallback).map(unit).collect()
}

/// The normal of a triangle, on the given side; none where it has no area.
pub(super) fn geometric_normal(triangle: &Triangle, side: f32) -> Option<[f32; 3]> {
    let [a, b, c] = triangle.vertices.map(Vec3::from);
    let (e, f) = (b - a, c - a);
    // Scaled first: products of large edges would overflow.
    let scale = 1.0 / e.abs().max(f.abs()).max_element();
    Some(((e * scale).cross(f * scale).try_normalize()? * side).to_array())
}

/// The normals of a mesh: authored, else smooth where it is a subdivision surface.
pub(super) fn build_normals(
    desc: &MeshDesc,
    topology: &MeshTopology,
    layout: PrimvarLayout<'_>,
    triangles: &[Triangle],
    dropped: &mut DroppedData,
) -> Option<Attribute<[f32; 3]>> {
    let smooth = OnceCell::new();
    let smooth = || smooth.get_or_init(|| smooth_normals(topology, desc.left_handed));
    let side = if desc.left_handed { -1.0 } else { 1.0 };
    let replacement = |slot| match slot {
        ValueSlot::Mesh => None,
        ValueSlot::Triangle(t) => triangles.get(t).and_then(|t| geometric_normal(t, side)),
        ValueSlot::Point(p) => smooth().get(p).copied(),
    };
    let authored = desc.normals.as_ref().and_then(|p| convert(p, layout, dropped, read_normal, replacement));
    let is_smooth = matches!(desc.subdivision, Subdivision::CatmullClark | Subdivision::Loop);
    let smoothed = || Attribute { rate: AttributeRate::Vertex, values: extend_points(layout, smooth().clone()) };
    let mut normals = authored.or_else(|| is_smooth.then(smoothed));
    if !layout.centers.is_empty() {
        // The mean of unit vectors is none.
        for normal in normals.iter_mut().flat_map(|normals| &mut normals.values) {
            *normal = Vec3::from(*normal).try_normalize().unwrap_or(Vec3::Z).to_array();
        }
    }
    normals
}

fn read_normal(values: &ArrayView<'_>, i: usize) -> Option<[f32; 3]> {
    values.vec3(i)?.try_normalize().map(|n| n.as_vec3().to_array())
}
