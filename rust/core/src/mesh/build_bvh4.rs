// SPDX-License-Identifier: Apache-2.0
//! The hierarchy over the items of a mesh, whatever they are. Pure; one thread per build.

use super::bundle::build_bundles;
use super::bvh::build_item_bvh;
use super::bvh4::{Bvh4, compress};
use super::{Aabb, LeafKind, Triangle};

/// Builds the hierarchy over `triangles` (at least one, finite, fewer than 2^28) and the BVH order: `order[k]` is the
/// number of the triangle at place k.
#[must_use]
pub fn build_bvh4(triangles: &[Triangle], kind: LeafKind) -> (Bvh4, Vec<u32>) {
    let boxes: Vec<Aabb> = triangles.iter().map(|triangle| triangle.bounds(kind)).collect();
    build_bvh4_over(&boxes, kind)
}

/// [`build_bvh4`] over the boxes of triangles.
pub(super) fn build_bvh4_over(boxes: &[Aabb], kind: LeafKind) -> (Bvh4, Vec<u32>) {
    if kind == LeafKind::Points {
        return build_bundles(boxes);
    }
    let (bvh, order) = build_item_bvh(boxes);
    compress(&bvh, &order, false)
}
