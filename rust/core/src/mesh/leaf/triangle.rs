// SPDX-License-Identifier: Apache-2.0
//! Triangles. Pure.

use super::Vertices;
use crate::mesh::Aabb;

pub(super) fn bounds(vertices: &Vertices) -> Aabb {
    vertices.iter().fold(Aabb::EMPTY, |bounds, &vertex| bounds.with_point(vertex))
}

pub(super) fn vertices(points: Vertices, _radii: [f32; 3]) -> Vertices {
    points
}
