// SPDX-License-Identifier: Apache-2.0
//! Walk of a ray through the top level, chunks, nested assemblies and meshes: traversal/traverse.glsl on a host thread.
//!
//! What makes the bits of a hit (frames, entries of boxes, leaf tests, the order of ids) is done in the same operations
//! as there; the order in which children are visited is free, since the hit does not depend on it. Whatever the memory
//! holds, a walk reads inside it and ends: an index that leads nowhere is no hit, and a walk of more than
//! [`MOST_STEPS`] is given up and counted as one without room.

mod leaves;
mod levels;

use crate::asking::Asking;
use crate::leaf::triangle::Shear;
use crate::node::{BoxRay, NUMBER, bundle_members, meet_level, meet_mesh};
use crate::pending::Pending;
use crate::pose::Pose;
use crate::scene::Scene;
use crate::vector::V3;
use oocpt_gpu::HostBytes;
use oocpt_shader_abi::{
    DONE, Features, GpuInstance, GpuLevelNode, GpuMesh, GpuMeshNode, GpuPoint, GpuTriangle, LEAF, LISTED, MAX_PENDING,
    MESH_LEAF_MASK, RETURN, RayFlags, waiting_count,
};

/// Boxes are culled only this far behind the closest hit (traverse.glsl).
const CULL_PAD: f32 = 1.000_003_8;
const ENTRY_SCALE: f32 = 0.999_996_4;
const TOP_PAD: f32 = 1.8e-7;
const MESH_PAD: f32 = 2.1e-6;
/// Nodes, leaves and instances that a ray may visit: a thousand times what rays of the largest scenes do.
const MOST_STEPS: u32 = 1 << 24;
/// Nodes that a ray goes through, at most, before it is another ray's turn (measured: decision 0049).
const NODES_AT_ONCE: u32 = 4;
/// Deepest chain of instance records.
pub(crate) const MOST_LEVELS: usize = 16;

/// The world ray.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WorldRay {
    pub(crate) o: V3,
    pub(crate) o_lo: V3,
    pub(crate) d: V3,
    pub(crate) t_max: f32,
    pub(crate) path: u32,
    /// Bits of `RAY_*`; streaming.
    pub(crate) flags: u32,
    /// Decides about opacity.
    pub(crate) seed: u32,
    /// Of the path, in the shutter; with something that moves only.
    pub(crate) time: f32,
    /// Any hit: category of the prims that count; 0: all.
    pub(crate) shadow_link: u32,
}

/// The closest hit so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Found {
    pub(crate) t: f32,
    pub(crate) uv: [f32; 2],
    pub(crate) triangle: u32,
    pub(crate) chunk_instance: u32,
    /// Instance records from the chunk's down.
    pub(crate) chain: [u32; MOST_LEVELS],
}

/// How many triangles a leaf of a mesh has.
#[inline(always)]
fn triangles_of(leaf: u32) -> u32 {
    ((leaf >> 28) & 7) + 1
}

/// A level to come back to.
#[derive(Clone, Copy, Debug)]
struct Level<'v> {
    ray: BoxRay,
    d: V3,
    nodes: HostBytes<'v>,
    instances: HostBytes<'v>,
}

const NO_LEVEL: Level<'static> = Level {
    ray: BoxRay { o: V3([0.0; 3]), reciprocal: V3([0.0; 3]), around: V3([0.0; 3]) },
    d: V3([0.0; 3]),
    nodes: HostBytes::NONE,
    instances: HostBytes::NONE,
};

/// See the module. Made once for many rays.
#[derive(Debug)]
pub(crate) struct Walk<'s, 'v, const ANY_HIT: bool> {
    pub(crate) scene: &'s Scene<'v>,
    pub(crate) world: WorldRay,
    pub(crate) found: Found,
    pub(crate) pending: Pending,
    pub(crate) asking: Asking,
    pub(crate) hit: bool,
    pub(crate) hit_before: bool,
    /// Of resident chunks; streaming.
    pub(crate) visits: u32,
    /// Rays that ran out of stack, levels or steps.
    pub(crate) overflows: u32,
    is_streaming: bool,
    at: Level<'v>,
    /// What is visited next, and how many were.
    reference: u32,
    steps: u32,
    entry: f32,
    limit: f32,
    level: usize,
    pub(crate) chunk_instance: u32,
    in_mesh: bool,
    /// The last key of the list that the ray came back with, if there was more behind it.
    resumed: Option<(f32, u32)>,
    pub(crate) mesh: GpuMesh,
    pub(crate) triangles: HostBytes<'v>,
    /// With what of it moves.
    pub(crate) pose: Pose<'v>,
    shear: Shear,
    /// Records from the chunk to here, and the innermost one.
    pub(crate) chain: [u32; MOST_LEVELS],
    pub(crate) instance: GpuInstance,
    levels: [Level<'v>; MOST_LEVELS],
    stack: Vec<(u32, f32)>,
    overflowed: bool,
}

impl<'s, 'v, const ANY_HIT: bool> Walk<'s, 'v, ANY_HIT> {
    pub(crate) fn new(scene: &'s Scene<'v>) -> Self {
        Self {
            scene,
            world: WorldRay::default(),
            found: Found::default(),
            pending: Pending::default(),
            asking: Asking::default(),
            hit: false,
            hit_before: false,
            visits: 0,
            overflows: 0,
            is_streaming: scene.has(Features::STREAMING),
            at: NO_LEVEL,
            reference: DONE,
            steps: 0,
            entry: 0.0,
            limit: 0.0,
            level: 0,
            chunk_instance: 0,
            in_mesh: false,
            resumed: None,
            mesh: bytemuck::Zeroable::zeroed(),
            triangles: HostBytes::NONE,
            pose: Pose::NONE,
            shear: Shear::default(),
            chain: [0; MOST_LEVELS],
            instance: bytemuck::Zeroable::zeroed(),
            levels: [NO_LEVEL; MOST_LEVELS],
            stack: Vec::with_capacity(scene.special.stack_size as usize),
            overflowed: false,
        }
    }

    /// Index of the current level, below the top level, in chains.
    #[inline(always)]
    pub(crate) fn level_index(&self) -> usize {
        self.level.saturating_sub(1)
    }

    /// Where the ray goes in the frame of the current level or mesh.
    #[inline(always)]
    pub(crate) fn direction(&self) -> V3 {
        self.at.d
    }

    /// In place of a walk: nothing was met, nothing is waited for.
    pub(crate) fn no_walk(&mut self) {
        self.pending.clear();
        (self.hit, self.hit_before, self.visits) = (false, false, 0);
        (self.reference, self.overflowed) = (DONE, false);
    }

    /// Begins the walk of a ray. With streaming one that has waited goes on: `found` is its hit so far if its flags say
    /// so, and `listed` the chunk instances that it waited for.
    #[inline(always)]
    pub(crate) fn begin(&mut self, world: WorldRay, listed: &[(f32, u32); MAX_PENDING as usize]) {
        self.world = world;
        self.hit_before = self.is_streaming && world.flags & RayFlags::HIT.bits() != 0;
        if !self.hit_before {
            self.found = Found { t: world.t_max, ..Found::default() };
        }
        let limit = if self.hit_before { self.found.t * CULL_PAD } else { world.t_max };
        // NaN: nothing is nearer, and boxes are entered as if there were no limit.
        self.limit = if limit.is_nan() { f32::INFINITY } else { limit };
        (self.entry, self.level, self.in_mesh) = (0.0, 0, false);
        (self.hit, self.visits, self.overflowed, self.resumed) = (false, 0, false, None);
        self.begin_top();
        self.stack.clear();
        self.stack.push((DONE, 0.0));
        (self.reference, self.steps) = (0, 0);
        if self.is_streaming {
            self.pending.clear();
            if world.flags & RayFlags::WAITED.bits() != 0 {
                self.reference = self.begin_resumed(listed);
            }
        }
    }

    /// A few nodes or a leaf further, to where memory is read next, which is asked for; false at the end of the walk.
    #[inline(always)]
    pub(crate) fn step(&mut self) -> bool {
        let mut reference = self.reference;
        if reference != DONE {
            reference = if reference < LEAF { self.descend_some(reference) } else { self.visit(reference) };
            while reference == RETURN {
                self.leave();
                reference = self.pop();
            }
        }
        self.steps += 1;
        if reference != DONE && self.steps < MOST_STEPS {
            self.prefetch(reference);
            self.reference = reference;
            return true;
        }
        self.overflowed |= reference != DONE;
        if self.is_streaming {
            self.pending.forget_behind(self.limit);
        }
        self.overflows += u32::from(self.overflowed);
        false
    }

    /// Puts what a ray that has waited is to visit on the stack; returns where to begin.
    fn begin_resumed(&mut self, listed: &[(f32, u32); MAX_PENDING as usize]) -> u32 {
        if self.world.flags & RayFlags::MORE.bits() != 0 {
            self.resumed = listed.last().copied();
            self.push(0, 0.0);
        }
        let count = waiting_count(self.world.flags);
        for &(entry, chunk_instance) in listed.iter().take(count as usize).rev() {
            self.push(LEAF | LISTED | chunk_instance, entry);
        }
        self.pop()
    }

    #[inline(always)]
    fn push(&mut self, reference: u32, entry: f32) {
        if self.stack.len() < self.scene.special.stack_size as usize {
            self.stack.push((reference, entry));
        } else {
            self.overflowed = true;
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> u32 {
        while let Some((reference, entry)) = self.stack.pop() {
            if ANY_HIT || entry <= self.limit || reference >= RETURN {
                self.entry = entry;
                return reference;
            }
        }
        DONE
    }

    /// Brings near what a reference of the current tree names.
    #[inline(always)]
    fn prefetch(&self, reference: u32) {
        let number = (reference & NUMBER) as usize;
        match (reference < LEAF, self.in_mesh) {
            (true, true) => self.at.nodes.prefetch::<GpuMeshNode>(number, 1),
            (true, false) => self.at.nodes.prefetch::<GpuLevelNode>(number, 1),
            (false, true) if self.pose.of_points => {
                self.triangles.prefetch::<GpuPoint>(number, triangles_of(reference) as usize);
            }
            (false, true) => self.triangles.prefetch::<GpuTriangle>(number, triangles_of(reference) as usize),
            (false, false) if self.level > 0 => self.at.instances.prefetch::<GpuInstance>(number, 1),
            (false, false) => self.scene.prefetch_chunk_instance(number),
        }
    }

    /// From node to node, as long as they are nodes and the ray's turn lasts.
    #[inline(always)]
    fn descend_some(&mut self, at: u32) -> u32 {
        let mut next = self.descend(at);
        for _ in 1..NODES_AT_ONCE {
            if next >= LEAF {
                break;
            }
            self.steps += 1;
            next = self.descend(next);
        }
        next
    }

    /// From a node to the nearest child that is met; the others go to the stack, the farthest first.
    #[inline(always)]
    fn descend(&mut self, at: u32) -> u32 {
        let (met, children) = if self.in_mesh {
            let Some(node) = self.at.nodes.get(at as usize) else { return self.pop() };
            let (met, children) = meet_mesh(&node, &self.at.ray, self.limit);
            let points = self.mesh.triangle_count;
            (met, if self.pose.of_points { children.map(|child| bundle_members(child, points)) } else { children })
        } else {
            let Some(node) = self.at.nodes.get(at as usize) else { return self.pop() };
            meet_level(&node, &self.at.ray, self.limit)
        };
        let mut mask = met.mask;
        if mask == 0 {
            return self.pop();
        }
        let first = mask.trailing_zeros() as usize;
        mask &= mask - 1;
        let mut nearest = (children[first & 3], met.entries[first & 3]);
        if mask != 0 {
            // Sorted insertion into what is put on the stack, the nearest kept apart.
            let mut others = [(0_u32, 0.0_f32); 3];
            let mut count = 0;
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize & 3;
                mask &= mask - 1;
                let mut next = (children[lane], met.entries[lane]);
                if next.1 < nearest.1 {
                    std::mem::swap(&mut next, &mut nearest);
                }
                let mut place = count;
                while place > 0 && others[place - 1].1 < next.1 {
                    others[place] = others[place - 1];
                    place -= 1;
                }
                others[place] = next;
                count += 1;
            }
            for &(child, entry) in &others[..count] {
                self.push(child, if entry > self.entry { entry } else { self.entry });
            }
        }
        self.entry = if nearest.1 > self.entry { nearest.1 } else { self.entry };
        nearest.0
    }

    /// Enters or leaves or tests what is no inner node.
    #[inline(always)]
    fn visit(&mut self, at: u32) -> u32 {
        let first = at & NUMBER;
        if self.in_mesh {
            let end = first + triangles_of(at);
            let ends = if self.mesh.flags & MESH_LEAF_MASK != 0 {
                self.visit_others(first, end)
            } else {
                self.visit_triangles(first, end)
            };
            if ends {
                return DONE;
            }
        } else {
            let entered = if self.level == 0 { self.enter_chunk(at) } else { self.enter(first) };
            if entered {
                return 0;
            }
        }
        self.pop()
    }
}
