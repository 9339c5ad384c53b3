// SPDX-License-Identifier: Apache-2.0
//! Checking the authored topology: which faces are usable, which are holes. Drops single faces, never trusts a number.
//! Pure.

use super::triangulate::MAX_FACE_CORNERS;
use crate::array::{ArrayView, ElementType};
use crate::desc::{DroppedData, MeshDesc};

/// Most corners of a mesh; keeps every index below 2^32.
pub(crate) const MAX_CORNERS: usize = 1 << 29;
/// Largest coordinate: areas and box surfaces stay finite in single precision.
pub(crate) const MAX_COORDINATE: f64 = 1e18;

/// A usable face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MeshFace {
    /// Authored number.
    pub(crate) index: u32,
    /// Its first corner in `face_vertex_indices`.
    pub(crate) first: u32,
    /// Its corners, 3 or more.
    pub(crate) count: u32,
    /// Not drawn, though smooth normals know it.
    pub(crate) is_hole: bool,
}

/// The usable part of a mesh.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeshTopology {
    /// Usable faces in authored order.
    pub(crate) faces: Vec<MeshFace>,
    /// Point of each authored corner; only corners of usable faces are in range.
    pub(crate) corners: Vec<u32>,
    /// Positions; those of usable faces are finite.
    pub(crate) points: Vec<[f32; 3]>,
    /// Authored faces.
    pub(crate) face_count: usize,
}

/// Reads and checks the topology of `desc`. `None` when nothing is usable; `dropped` says why.
pub(crate) fn read_topology(desc: &MeshDesc, dropped: &mut DroppedData) -> Option<MeshTopology> {
    let counts = desc.face_vertex_counts.view();
    let indices = desc.face_vertex_indices.view();
    let points = desc.points.view();
    let is_int = |a: &ArrayView<'_>| a.is_empty() || a.element() == ElementType::I32;
    if !is_int(&counts) || !is_int(&indices) || !(points.is_empty() || points.vec3(0).is_some()) {
        dropped.wrong_array_types += 1;
        return None;
    }
    if indices.len() > MAX_CORNERS || counts.len() > MAX_CORNERS || points.len() > MAX_CORNERS {
        dropped.oversized_meshes += 1;
        return None;
    }
    let mut topology = MeshTopology {
        faces: Vec::with_capacity(counts.len().min(indices.len() / 3)),
        corners: (0..indices.len()).map(|i| indices.index(i).map_or(u32::MAX, i32::cast_unsigned)).collect(),
        points: (0..points.len()).map(|i| read_point(points.vec3(i))).collect(),
        face_count: counts.len(),
    };
    let holes = read_holes(desc, counts.len(), dropped);
    topology.read_faces(&counts, &holes, dropped);
    if topology.faces.iter().all(|face| face.is_hole) {
        dropped.empty_meshes += 1;
        return None;
    }
    Some(topology)
}

/// A point in single precision; NaN when it is not usable.
pub(super) fn read_point(point: Option<glam::DVec3>) -> [f32; 3] {
    match point {
        Some(p) if p.abs().max_element() <= MAX_COORDINATE && p.is_finite() => p.as_vec3().to_array(),
        _ => [f32::NAN; 3],
    }
}

/// Sorted face numbers to leave out.
fn read_holes(desc: &MeshDesc, face_count: usize, dropped: &mut DroppedData) -> Vec<usize> {
    let Some(array) = &desc.hole_indices else {
        return Vec::new();
    };
    let view = array.view();
    let in_range = |i| view.index(i).and_then(|h| usize::try_from(h).ok()).filter(|&h| h < face_count);
    let mut holes: Vec<usize> = (0..view.len()).filter_map(in_range).collect();
    dropped.hole_indices += (view.len() - holes.len()) as u64;
    holes.sort_unstable();
    holes.dedup();
    holes
}

impl MeshTopology {
    fn read_faces(&mut self, counts: &ArrayView<'_>, holes: &[usize], dropped: &mut DroppedData) {
        let mut first = 0_usize;
        let mut holes = holes.iter().copied().peekable();
        for index in 0..counts.len() {
            let is_hole = holes.next_if_eq(&index).is_some();
            let Ok(count) = usize::try_from(counts.index(index).unwrap_or(-1)) else {
                // A negative count takes no corners, so the faces after it still make sense.
                dropped.negative_counts += 1;
                continue;
            };
            let end = first.saturating_add(count);
            if end > self.corners.len() {
                dropped.faces_past_end += (counts.len() - index) as u64;
                return;
            }
            if self.is_usable(first..end, dropped) {
                // Both limits are below 2^32, see MAX_CORNERS.
                if let (Ok(index), Ok(first), Ok(count)) = (index.try_into(), first.try_into(), count.try_into()) {
                    self.faces.push(MeshFace { index, first, count, is_hole });
                }
            }
            first = end;
        }
        dropped.surplus_indices += (self.corners.len() - first) as u64;
    }

    fn is_usable(&self, corners: std::ops::Range<usize>, dropped: &mut DroppedData) -> bool {
        let corners = self.corners.get(corners).unwrap_or_default();
        if corners.len() < 3 {
            dropped.small_faces += 1;
        } else if corners.len() > MAX_FACE_CORNERS {
            dropped.huge_faces += 1;
        } else if corners.iter().any(|&c| c as usize >= self.points.len()) {
            dropped.point_indices += 1;
        } else if corners.iter().any(|&c| self.points[c as usize][0].is_nan()) {
            dropped.non_finite_points += 1;
        } else {
            return true;
        }
        false
    }

    /// Point numbers of a face's corners.
    pub(crate) fn face_corners(&self, face: &MeshFace) -> &[u32] {
        let first = face.first as usize;
        self.corners.get(first..first + face.count as usize).unwrap_or_default()
    }

    /// Position of a usable point.
    pub(crate) fn position(&self, point: u32) -> glam::DVec3 {
        self.points.get(point as usize).map_or(glam::DVec3::ZERO, |p| glam::Vec3::from(*p).as_dvec3())
    }

    /// Newell's normal of a face: its length is twice the area. Right-handed.
    pub(crate) fn face_normal(&self, face: &MeshFace) -> glam::DVec3 {
        let corners = self.face_corners(face);
        let Some(&anchor) = corners.first() else {
            return glam::DVec3::ZERO;
        };
        // Relative to a corner, so that a small face far from the origin keeps its digits.
        let anchor = self.position(anchor);
        let pairs = corners.iter().zip(corners.iter().cycle().skip(1));
        pairs.map(|(&a, &b)| (self.position(a) - anchor).cross(self.position(b) - anchor)).sum()
    }
}
