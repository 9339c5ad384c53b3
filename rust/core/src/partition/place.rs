// SPDX-License-Identifier: Apache-2.0
//! Composes the placements of opened assemblies in f64, and computes boxes that are conservative for their rounding to
//! single precision. Pure.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::chunk::Chunk;
use super::placement::OpenedPlacement;
use super::{ChunkInstance, PartitionedWorld};
use crate::instancing::affine::{MATRIX_ERROR, MAX_MAGNITUDE, nearest, round_down, round_up};
use crate::mesh::{Aabb, Bvh2, BvhNode, build_box_bvh};

/// Rounding of an origin held as two floats, and of f64 arithmetic on the way to it.
const ORIGIN_ERROR: f64 = 1.0 / (1_u64 << 44) as f64;

/// Number of chunks that a task places.
const TASK: usize = 1 << 8;

/// Chunks `first ..` of the world, placed at each of `placements`. Gives what is out of range as `None`.
pub(crate) fn place_chunks(
    placements: &[OpenedPlacement],
    chunks: &[std::sync::Arc<Chunk>],
    first: u32,
) -> Vec<Option<ChunkInstance>> {
    let inverses: Vec<Option<DMat3>> = placements.par_iter().map(|at| inverse(&at.frame.matrix3)).collect();
    let all = placements.par_iter().zip(inverses).flat_map(|(at, inverse)| {
        let numbered = chunks.par_iter().with_min_len(TASK).enumerate();
        numbered.filter_map(move |(k, chunk)| {
            // The world has fewer than 2^32 chunks.
            Some(place_chunk(at, inverse, chunk, first.checked_add(u32::try_from(k).ok()?)?))
        })
    });
    all.collect()
}

fn place_chunk(at: &OpenedPlacement, inverse: Option<DMat3>, chunk: &Chunk, number: u32) -> Option<ChunkInstance> {
    let (matrix, inverse) = (at.frame.matrix3, inverse?);
    let rows = inverse.transpose();
    let rows = [rows.x_axis, rows.y_axis, rows.z_axis];
    let origin = at.frame.transform_point3(chunk.origin());
    let inside = chunk.bounds();
    let (min, max) = (DVec3::from(inside.min.map(f64::from)), DVec3::from(inside.max.map(f64::from)));
    let columns = [matrix.x_axis.abs(), matrix.y_axis.abs(), matrix.z_axis.abs()];
    let spread = |v: DVec3| columns[0] * v.x + columns[1] * v.y + columns[2] * v.z;
    let center = matrix * (0.5 * (min + max));
    let half = spread(0.5 * (max - min));
    // The rounding E of the map's rows moves a point v (relative to the origin) by M E v.
    let reach = center.abs() + half;
    let error = spread(DVec3::from(rows.map(|row| row.abs().dot(reach)))) * MATRIX_ERROR;
    let error = error + (origin.abs() + reach) * ORIGIN_ERROR;
    let (low, high) = (origin + (center - half - error), origin + (center + half + error));
    let bounds = Aabb { min: low.to_array().map(round_down), max: high.to_array().map(round_up) };
    let chunk_from_world = rows.map(|row| row.to_array().map(nearest));
    let numbers = chunk_from_world.iter().flatten().chain(&bounds.min).chain(&bounds.max);
    let sound = numbers.fold(true, |sound, v| sound & (v.abs() <= MAX_MAGNITUDE));
    let regular = chunk_from_world.iter().flatten().any(|v| *v != 0.0);
    let (instance_id, row) = (at.id, at.row);
    (sound && regular).then_some(ChunkInstance { chunk: number, chunk_from_world, origin, instance_id, row, bounds })
}

/// The inverse, scaled first so that tiny and huge matrices do not underflow or overflow; `None` if there is none.
fn inverse(m: &DMat3) -> Option<DMat3> {
    let size = m.x_axis.abs().max(m.y_axis.abs()).max(m.z_axis.abs()).max_element();
    let scaled = *m * (1.0 / size);
    let inverse = scaled.inverse() * (1.0 / size);
    (size > 0.0 && scaled.determinant() != 0.0 && inverse.is_finite()).then_some(inverse)
}

/// The hierarchy over chunk instances; one node with empty boxes if there is none.
pub(crate) fn top_level(instances: &[ChunkInstance]) -> Bvh2 {
    if instances.is_empty() {
        return Bvh2 { nodes: vec![BvhNode::EMPTY], depth: 1 };
    }
    let boxes: Vec<Aabb> = instances.iter().map(|i| i.bounds).collect();
    build_box_bvh(&boxes)
}

impl PartitionedWorld {
    /// Returns true if both place the same chunks at the same places.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        let shared = |a: &[std::sync::Arc<Chunk>], b: &[std::sync::Arc<Chunk>]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| std::sync::Arc::ptr_eq(a, b))
        };
        self.levels == other.levels
            && self.unplaceable == other.unplaceable
            && self.opened == other.opened
            && self.chunk_bytes == other.chunk_bytes
            && shared(&self.chunks, &other.chunks)
            && self.instances == other.instances
            && self.placed == other.placed
    }
}
