// SPDX-License-Identifier: Apache-2.0
//! Smooth normals of subdivision meshes without authored normals. Pure.

use glam::DVec3;

use super::topology::MeshTopology;

/// One unit normal per point: the area-weighted mean of the faces around it (Newell normals), on the outer side of a
/// `left_handed` mesh. Where that cancels out it is the normal of some face there; points without a face get +z.
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
