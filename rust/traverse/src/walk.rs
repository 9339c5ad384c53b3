// SPDX-License-Identifier: Apache-2.0
//! Walk of a ray through the top level, chunks, nested assemblies and meshes: traversal/traverse.glsl on a host thread.
//!
//! Everything that decides the bits of a hit (frames, entries of boxes, leaf tests, the order of ids) uses the same
//! operations as there; the order in which children are visited may differ, because the hit does not depend on it. For
//! any contents of memory, a walk reads within bounds and ends: an index out of range is no hit, and a walk of more
//! than [`MAX_STEPS`] is given up and counted as an overflow.

mod leaves;
mod levels;
mod mesh;
mod stack;

use crate::deferred_tests::DeferredTests;
use crate::leaf::triangle::RayShear;
use crate::node::{BoxRay, NUMBER};
use crate::pending::{ListedItems, PendingItem, PendingList};
use crate::pose::MeshPose;
use crate::scene::TraversalScene;
use crate::simd::Simd;
use crate::vector::V3;
pub(crate) use crate::walk::leaves::CandidateSurface;
use crate::walk::mesh::triangles_of;
use crate::walk::stack::{StackKey, TraversalStack};
use oocpt_abi::{
    Bvh4Node, CULL_PAD, DONE, Features, GpuInstance, GpuMesh, GpuPoint, GpuTriangle, LEAF, LISTED, LevelNode,
    MAX_LEVELS, RETURN, RayFlags,
};
use oocpt_gpu::{HostBytes, HostSpan};

/// Largest number of steps of a ray, a thousand times as many as rays of the largest scenes take.
const MAX_STEPS: u32 = 1 << 24;
/// Bytes of geometry below which it counts as cached: a ray then continues for [`LONG_TURN`] steps. With more bytes
/// each step may wait for memory: the ray prefetches it, and other rays take their turns until it has arrived.
const CACHED_BYTES: u64 = 16 << 20;
/// Number of steps (nodes, leaves or instances) of a long turn.
const LONG_TURN: u32 = 256;
/// Largest number of nested instance records.
pub(crate) const MAX_NESTING: usize = MAX_LEVELS as usize;

/// The ray in the world.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WorldRay {
    pub(crate) o: V3,
    pub(crate) o_lo: V3,
    pub(crate) d: V3,
    pub(crate) t_max: f32,
    pub(crate) path: u32,
    /// Flags, bits of `RAY_*`; streaming.
    pub(crate) flags: u32,
    /// Seed of the decisions about opacity.
    pub(crate) seed: u32,
    /// Time of the path in the shutter; valid only if something moves.
    pub(crate) time: f32,
    /// Category of the prims that block the ray, for any hit; 0: all.
    pub(crate) shadow_link: u32,
    /// Bit of [`oocpt_abi::PrimMask`] of the prims that the ray passes.
    pub(crate) passing: u32,
}

/// The closest hit so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ClosestHit {
    pub(crate) t: f32,
    pub(crate) uv: [f32; 2],
    pub(crate) triangle: u32,
    pub(crate) chunk_instance: u32,
    /// Instance records, from the chunk's down.
    pub(crate) chain: [u32; MAX_NESTING],
}

/// The state of a level that the walk returns to.
#[derive(Clone, Copy, Debug)]
struct WalkLevel<'v> {
    ray: BoxRay,
    d: V3,
    nodes: HostBytes<'v>,
    instances: HostBytes<'v>,
}

const NO_LEVEL: WalkLevel<'static> =
    WalkLevel { ray: BoxRay::NONE, d: V3([0.0; 3]), nodes: HostBytes::NONE, instances: HostBytes::NONE };

/// The buffers in which trees, instance records, mesh nodes and items were found last.
#[derive(Debug)]
pub(crate) struct RecentBuffers<'v> {
    nodes: HostSpan<'v>,
    instances: HostSpan<'v>,
    mesh_nodes: HostSpan<'v>,
    pub(crate) items: HostSpan<'v>,
}

/// The walk of a ray. It is created once and used for many rays.
#[derive(Debug)]
pub(crate) struct RayTraversal<'s, 'v, const ANY_HIT: bool> {
    pub(crate) scene: &'s TraversalScene<'v>,
    pub(crate) world: WorldRay,
    pub(crate) found: ClosestHit,
    pub(crate) pending: PendingList,
    pub(crate) deferred_tests: DeferredTests,
    pub(crate) hit: bool,
    pub(crate) hit_before: bool,
    /// Number of visits of resident chunks; streaming.
    pub(crate) visits: u32,
    /// Number of rays that ran out of stack, levels or steps.
    pub(crate) overflows: u32,
    is_streaming: bool,
    at: WalkLevel<'v>,
    /// The next reference, and the number of steps so far.
    next: StackKey,
    steps: u32,
    /// Number of steps before it is another ray's turn.
    turn: u32,
    /// Distance at which the ray enters what is visited now.
    entry: f32,
    limit: f32,
    level: usize,
    pub(crate) chunk_instance: u32,
    in_mesh: bool,
    /// Items that the ray came back with, and true if only some of the current chunk is to be visited; streaming.
    listed: ListedItems,
    filters: bool,
    /// Position of the walk: the chunk instance and, in a mesh, its records; streaming.
    pub(crate) item: PendingItem,
    pub(crate) mesh: GpuMesh,
    /// Items of the current mesh, with their motion.
    pub(crate) pose: MeshPose<'v>,
    shear: RayShear,
    /// Records from the chunk to the current level, and the innermost one.
    pub(crate) chain: [u32; MAX_NESTING],
    pub(crate) instance: GpuInstance,
    /// State of the top level, and of those below.
    levels: [WalkLevel<'v>; MAX_NESTING + 1],
    near: RecentBuffers<'v>,
    stack: TraversalStack,
}

impl<'s, 'v, const ANY_HIT: bool> RayTraversal<'s, 'v, ANY_HIT> {
    pub(crate) fn new(scene: &'s TraversalScene<'v>) -> Self {
        Self {
            scene,
            world: WorldRay::default(),
            found: ClosestHit::default(),
            pending: PendingList::default(),
            deferred_tests: DeferredTests::default(),
            hit: false,
            hit_before: false,
            visits: 0,
            overflows: 0,
            is_streaming: scene.has(Features::STREAMING),
            at: NO_LEVEL,
            next: StackKey::DONE,
            steps: 0,
            turn: if scene.special.geometry_bytes > CACHED_BYTES { 1 } else { LONG_TURN },
            entry: 0.0,
            limit: 0.0,
            level: 0,
            chunk_instance: 0,
            in_mesh: false,
            listed: ListedItems::default(),
            filters: false,
            item: PendingItem::default(),
            mesh: bytemuck::Zeroable::zeroed(),
            pose: MeshPose::NONE,
            shear: RayShear::default(),
            chain: [0; MAX_NESTING],
            instance: bytemuck::Zeroable::zeroed(),
            levels: [NO_LEVEL; MAX_NESTING + 1],
            near: RecentBuffers {
                nodes: HostSpan::NONE,
                instances: HostSpan::NONE,
                mesh_nodes: HostSpan::NONE,
                items: HostSpan::NONE,
            },
            stack: TraversalStack::new(scene.special.stack_size as usize),
        }
    }

    /// Index in chains of the current level, which is below the top level.
    #[inline(always)]
    pub(crate) fn level_index(&self) -> usize {
        self.level.saturating_sub(1)
    }

    /// Direction of the ray in the frame of the current level or mesh.
    #[inline(always)]
    pub(crate) fn direction(&self) -> V3 {
        self.at.d
    }

    /// Clears the results in place of a walk: no hit, nothing pending.
    pub(crate) fn no_walk(&mut self) {
        self.pending.clear();
        (self.hit, self.hit_before, self.visits) = (false, false, 0);
        self.next = StackKey::DONE;
        self.stack.reset();
    }

    /// Begins the walk of a ray. With streaming, a ray that has waited continues: `found` is its hit so far if its
    /// flags say so, and `listed` the items that it waited for.
    #[inline(always)]
    pub(crate) fn begin(&mut self, simd: impl Simd, world: WorldRay, listed: ListedItems) {
        self.world = world;
        self.hit_before = self.is_streaming && world.flags & RayFlags::HIT.bits() != 0;
        if !self.hit_before {
            self.found.t = world.t_max;
            self.found.chain[..self.scene.special.levels()].fill(0);
        }
        let limit = if self.hit_before { self.found.t * CULL_PAD } else { world.t_max };
        // NaN: no hit is nearer, and boxes are entered as if there were no limit.
        self.limit = if limit.is_nan() { f32::INFINITY } else { limit };
        (self.entry, self.level, self.in_mesh) = (0.0, 0, false);
        (self.hit, self.visits) = (false, 0);
        self.begin_top(simd);
        self.stack.reset();
        (self.next, self.steps) = (StackKey::new(0, 0.0), 0);
        if self.is_streaming {
            self.pending.clear();
            (self.listed, self.filters) = (listed, false);
            if world.flags & RayFlags::WAITED.bits() != 0 {
                self.next = self.begin_resumed();
            }
        }
    }

    /// Advances by a few nodes or a leaf, to the next read of memory, which is prefetched; returns false at the end of
    /// the walk.
    #[inline(always)]
    pub(crate) fn step(&mut self, simd: impl Simd) -> bool {
        let mut turn = self.turn;
        while turn > 0 && self.next.reference() != DONE {
            if self.in_mesh {
                self.walk_mesh(simd, &mut turn);
            } else {
                self.walk_levels(simd, &mut turn);
            }
            while self.next.reference() == RETURN {
                self.leave();
                self.next = self.pop();
            }
        }
        let reference = self.next.reference();
        self.steps = self.steps.saturating_add(self.turn - turn);
        if reference != DONE && self.steps < MAX_STEPS {
            self.prefetch(reference);
            return true;
        }
        self.stack.overflowed |= reference != DONE;
        if self.is_streaming {
            self.pending.forget_behind(self.limit);
        }
        self.overflows += u32::from(self.stack.overflowed);
        false
    }

    /// Pushes the items that a ray that has waited is to visit on the stack; returns the first one.
    fn begin_resumed(&mut self) -> StackKey {
        let is_gone = |item: &PendingItem| !item.is_whole() && !self.is_chunk_there(item.chunk.1);
        if self.world.flags & RayFlags::MORE.bits() != 0 {
            // Items behind the last one begin in its chunk: they wait until that chunk is resident again.
            self.listed.more = !self.listed.items().last().is_some_and(is_gone);
            self.pending.more = !self.listed.more;
        }
        if self.listed.more {
            self.stack.push(StackKey::new(0, 0.0));
        }
        for i in (0..self.listed.count).rev() {
            let (entry, chunk_instance) = self.listed.items[i].chunk;
            let is_first = i == 0 || self.listed.items[i - 1].chunk.1 != chunk_instance;
            if is_first {
                self.stack.push(StackKey::new(LEAF | LISTED | chunk_instance, entry));
            }
        }
        self.pop()
    }

    fn is_chunk_there(&self, chunk_instance: u32) -> bool {
        let instance = self.scene.chunk_instance(chunk_instance);
        instance.and_then(|instance| self.scene.chunk(instance.chunk)).is_some_and(|chunk| chunk.nodes != 0)
    }

    /// Distance behind which deferred references are not visited: a ray that any hit ends takes all.
    #[inline(always)]
    fn pop_limit(&self) -> f32 {
        if ANY_HIT { f32::INFINITY } else { self.limit }
    }

    #[inline(always)]
    fn pop(&mut self) -> StackKey {
        self.stack.pop(self.pop_limit())
    }

    /// Prefetches the node or leaf of a reference in the current tree.
    #[inline(always)]
    fn prefetch(&self, reference: u32) {
        let number = (reference & NUMBER) as usize;
        match (reference < LEAF, self.in_mesh) {
            (true, true) => self.at.nodes.prefetch::<Bvh4Node>(number, 1),
            (true, false) => self.at.nodes.prefetch::<LevelNode>(number, 1),
            (false, true) if self.pose.of_points => {
                self.pose.triangles.prefetch::<GpuPoint>(number, triangles_of(reference) as usize);
            }
            (false, true) => self.pose.triangles.prefetch::<GpuTriangle>(number, triangles_of(reference) as usize),
            (false, false) if self.level > 0 => self.at.instances.prefetch::<GpuInstance>(number, 1),
            (false, false) => self.scene.prefetch_chunk_instance(number),
        }
    }
}
