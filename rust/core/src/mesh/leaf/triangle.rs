// SPDX-License-Identifier: Apache-2.0
//! Triangles. Pure.

use super::ItemVertices;
use crate::mesh::Aabb;

pub(super) fn bounds(vertices: &ItemVertices) -> Aabb {
    vertices.iter().fold(Aabb::EMPTY, |bounds, &vertex| bounds.with_point(vertex))
}

pub(super) fn vertices(points: ItemVertices, _radii: [f32; 3]) -> ItemVertices {
    points
}
