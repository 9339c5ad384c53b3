// SPDX-License-Identifier: Apache-2.0
//! The plan of a GPU build of an instance tree: Morton keys, sort, Karras hierarchy, refit, four children to a node.
//!
//! Guarantees: [`steps`] is a pure function; the tree it makes depends only on the bounds (ties by index), not on
//! timing. Any thread. Sources: Karras 2012, "Maximizing Parallelism in the Construction of BVHs, Octrees, and k-d
//! Trees".

use crate::{LbvhBounds, LbvhPush, Module, WORKGROUP_SIZE, groups, passes};

/// Most items of one tree.
pub const MAX_ITEMS: u32 = 1 << 26;

/// Most items that one workgroup sorts whole, in shared memory; the twin of `SMALL` in `sort_small.comp`.
const SMALL: u32 = 2048;
/// Items of a tile of the radix sort: 64 threads x 16.
const TILE: u32 = 1024;
/// Digits of a radix pass.
const DIGITS: u32 = 256;
/// Digits of a key.
const RADIX_PASSES: u32 = 8;

/// A tree to build. Addresses are device addresses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Job {
    /// [`LbvhBounds`] per item, 4-byte aligned.
    pub bounds: u64,
    /// Room for `max(count - 1, 1)` [`crate::GpuLevelNode`], 16-byte aligned, not all of which will be used. The root
    /// will be node 0; leaves name the item.
    pub nodes: u64,
    /// Room for [`scratch_bytes`]`(count)`, 16-byte aligned; contents do not matter before, and are garbage after.
    pub scratch: u64,
    /// Room for one u32: stack entries that a walk may need.
    pub depth: u64,
    /// Items, at most [`MAX_ITEMS`]. 0 is allowed: one node without children.
    pub count: u32,
    /// Box around all items, in the same frame. Items outside of it only cost quality.
    pub around: LbvhBounds,
}

/// One step of a build. Steps run in order with a full compute memory barrier between them.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// The pass.
    pub module: &'static Module,
    /// Its push constants.
    pub push: LbvhPush,
    /// Workgroups.
    pub groups: [u32; 3],
}

/// Bytes of scratch memory to build a tree over `count` items.
#[must_use]
pub fn scratch_bytes(count: u32) -> u64 {
    Layout::new(count).bytes
}

/// Offsets in the scratch memory. After the sort the second key buffer holds the parents and the second item buffer the
/// visits.
struct Layout {
    keys: [u64; 2],
    items: [u64; 2],
    histogram: u64,
    bytes: u64,
}

impl Layout {
    fn new(count: u32) -> Self {
        let count = u64::from(count.max(2));
        let tiles = count.div_ceil(u64::from(TILE));
        let keys = (8 * count).next_multiple_of(16);
        let items = (4 * count).next_multiple_of(16);
        let histogram = 2 * keys + 2 * items;
        let bytes = histogram + 4 * u64::from(DIGITS) * (tiles + 1);
        Self { keys: [0, keys], items: [2 * keys, 2 * keys + items], histogram, bytes }
    }
}

/// The dispatches that build the tree of `job`, in order.
#[must_use]
pub fn steps(job: &Job) -> Vec<Step> {
    let mut push = first_push(job);
    let items = groups(u64::from(job.count));
    let mut steps = Vec::new();
    if (2..=SMALL).contains(&job.count) {
        steps.push(Step { module: &passes::LBVH_SORT_SMALL, push, groups: [1, 1, 1] });
    }
    if job.count > SMALL {
        let tiles = groups(u64::from(push.groups) * u64::from(WORKGROUP_SIZE));
        steps.push(Step { module: &passes::LBVH_MORTON, push, groups: items });
        for pass in 0..RADIX_PASSES {
            push.shift = 8 * pass;
            steps.push(Step { module: &passes::LBVH_SORT_COUNT, push, groups: tiles });
            steps.push(Step { module: &passes::LBVH_SORT_SCAN, push, groups: [DIGITS, 1, 1] });
            steps.push(Step { module: &passes::LBVH_SORT_SCATTER, push, groups: tiles });
            core::mem::swap(&mut push.keys_in, &mut push.keys_out);
            core::mem::swap(&mut push.items_in, &mut push.items_out);
        }
    }
    if job.count > 1 {
        steps.push(Step { module: &passes::LBVH_HIERARCHY, push, groups: items });
    }
    steps.push(Step { module: &passes::LBVH_REFIT, push, groups: items });
    steps.push(Step { module: &passes::LBVH_WIDEN, push, groups: items });
    steps
}

/// What the first step is given. Parents and visits take over the second halves of the sort's memory, which are free
/// after an even number of passes.
fn first_push(job: &Job) -> LbvhPush {
    let layout = Layout::new(job.count);
    let at = |offset: u64| job.scratch + offset;
    let (origin, scale) = quantisation(&job.around);
    LbvhPush {
        bounds: job.bounds,
        keys_in: at(layout.keys[0]),
        keys_out: at(layout.keys[1]),
        items_in: at(layout.items[0]),
        items_out: at(layout.items[1]),
        histogram: at(layout.histogram),
        nodes: job.nodes,
        parents: at(layout.keys[1]),
        visits: at(layout.items[1]),
        depth: job.depth,
        origin,
        scale,
        count: job.count,
        shift: 0,
        groups: job.count.div_ceil(TILE),
        pad: 0,
    }
}

/// Origin and scale that map a box to [0, 2^21) per axis; scale 0 for an axis without a usable extent.
fn quantisation(around: &LbvhBounds) -> ([f32; 3], [f32; 3]) {
    let scale = [0, 1, 2].map(|axis: usize| 2_097_152.0 / (around.max[axis] - around.min[axis]));
    (around.min, scale.map(|scale| if scale.is_finite() && scale > 0.0 { scale } else { 0.0 }))
}
