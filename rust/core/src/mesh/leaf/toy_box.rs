// SPDX-License-Identifier: Apache-2.0
//! The kind of leaf that `rust/book/src/extending.md` adds, for tests alone: boxes along the axes, each between two
//! points that follow each other. Pure.

use super::{ItemVertices, LeafItems, LeafKind, point};
use crate::desc::{DroppedData, MeshDesc};
use crate::mesh::Aabb;
use crate::mesh::deform::PointsPose;
use crate::mesh::topology::{MAX_CORNERS, MeshFace, MeshTopology};

pub(super) fn bounds(&[first, second, _]: &ItemVertices) -> Aabb {
    Aabb::EMPTY.with_point(first).with_point(second)
}

pub(super) fn vertices([first, second, _]: ItemVertices, _radii: [f32; 3]) -> ItemVertices {
    [first, second, [0.0; 3]]
}

/// Boxes with an extent along each axis; the others count as points that cannot be used.
pub(super) fn read(desc: &MeshDesc, poses: &[PointsPose], dropped: &mut DroppedData) -> LeafItems {
    let view = desc.points.view();
    let mut topology = MeshTopology { face_count: view.len() / 2, ..MeshTopology::default() };
    let is_usable = view.is_empty() || view.vec3(0).is_some();
    dropped.wrong_array_types += u64::from(!is_usable);
    dropped.oversized_meshes += u64::from(view.len() > MAX_CORNERS / 4);
    if is_usable && view.len() <= MAX_CORNERS / 4 {
        topology.points = (0..view.len()).map(|at| point(&view, at).unwrap_or_default()).collect();
        dropped.points += (view.len() % 2) as u64;
        for (index, at) in (0_u32..).zip((0..view.len() - view.len() % 2).step_by(2)) {
            let ends = [at, at + 1].map(|at| point(&view, at));
            let has_extent = |[a, b]: [[f32; 3]; 2]| a.iter().zip(&b).all(|(a, b)| a != b);
            if !matches!(ends, [Some(a), Some(b)] if has_extent([a, b])) {
                dropped.points += 1;
                continue;
            }
            let first = u32::try_from(topology.corners.len()).unwrap_or(u32::MAX);
            topology.faces.push(MeshFace { index, first, count: 3, is_hole: false });
            topology.corners.extend([2 * index, 2 * index + 1, 2 * index]);
        }
    }
    let desc = MeshDesc { normals: None, ..desc.clone() };
    LeafItems { topology, desc, kind: LeafKind::ToyBoxes, radii: Vec::new(), poses: poses.to_vec() }
}
