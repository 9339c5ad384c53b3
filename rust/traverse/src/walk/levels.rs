// SPDX-License-Identifier: Apache-2.0
//! The part of a walk outside of meshes: nodes of the top level, chunks and assemblies, and the changes of frame into
//! them, into meshes and back.

use super::stack::StackKey;
use super::{RayTraversal, WalkLevel, WorldRay};
use crate::leaf::triangle::RayShear;
use crate::node::NUMBER;
use crate::pending::PendingItem;
use crate::simd::Simd;
use crate::vector::{V3, apply_point, apply_vector, difference};
use oocpt_abi::{
    COUNTED_PATHS, Features, GpuInstance, LEAF, LISTED, LevelNode, MESH_PAD, RETURN, TARGET_ASSEMBLY, TOP_PAD,
};
use oocpt_gpu::HostBytes;

impl<const ANY_HIT: bool> RayTraversal<'_, '_, ANY_HIT> {
    /// Walks the nodes of a level, until a mesh is entered, the level is left, or the walk or its turn ends.
    #[inline(always)]
    pub(super) fn walk_levels(&mut self, simd: impl Simd, turn: &mut u32) {
        let mut next = self.next;
        loop {
            let reference = next.reference();
            if reference < LEAF {
                next = match self.at.nodes.item::<LevelNode>(reference) {
                    Some(node) => {
                        let met = simd.meet_level(&node, &self.at.ray, self.limit, next.entry());
                        self.stack.push_entered(met, self.pop_limit(), |lane| node.child[lane as usize & 3])
                    }
                    None => self.pop(),
                };
                *turn = turn.saturating_sub(1);
            } else if reference < RETURN {
                self.entry = next.entry();
                let number = reference & NUMBER;
                let entered =
                    if self.level == 0 { self.enter_chunk(simd, reference) } else { self.enter(simd, number) };
                next = if entered { StackKey::new(0, self.entry) } else { self.pop() };
                *turn = turn.saturating_sub(1);
            } else {
                break;
            }
            if *turn == 0 || self.in_mesh {
                break;
            }
        }
        self.next = next;
    }

    /// Enters a chunk from the top level; returns false if it is absent or done, or if there is no room.
    #[inline(always)]
    pub(super) fn enter_chunk(&mut self, simd: impl Simd, reference: u32) -> bool {
        let number = reference & NUMBER;
        let Some(instance) = self.scene.chunk_instance(number) else { return false };
        let Some(chunk) = self.scene.chunk(instance.chunk) else { return false };
        if self.is_streaming {
            let (key, is_listed) = ((self.entry, number), reference & LISTED != 0);
            if !is_listed && !self.listed.has_chunk_due(key) {
                return false;
            }
            if chunk.nodes == 0 {
                self.remember_chunk(key, is_listed);
                return false;
            }
            self.visits += 1;
            self.item.chunk = key;
            self.filters = is_listed && !self.listed.of_chunk(number).any(PendingItem::is_whole);
            if self.scene.has(Features::CHUNK_COUNTS) {
                self.scene.count_rays(instance.chunk, 1);
            }
        }
        if !self.stack.push(StackKey::RETURN) {
            return false;
        }
        self.chunk_instance = number;
        let map = &instance.chunk_from_world;
        let origin = (V3([map[0][3], map[1][3], map[2][3]]), V3(instance.origin_lo));
        let from = difference((self.world.o, self.world.o_lo), origin);
        let (o, d) = (apply_vector(map, from), apply_vector(map, self.world.d));
        self.begin_level(simd, o, d, [chunk.nodes, chunk.instances]);
        true
    }

    /// Notes that the chunk of a chunk instance is absent. Parts that were visited are not visited again.
    #[inline(never)]
    fn remember_chunk(&mut self, key: (f32, u32), is_listed: bool) {
        if is_listed {
            self.listed.of_chunk(key.1).for_each(|item| self.pending.remember(*item));
        } else {
            self.pending.remember(PendingItem::of_chunk(key));
        }
    }

    /// Streaming: true if the walk skips a record of a mesh because its item is done, or is absent and remembered.
    #[inline(always)]
    fn skips_mesh(&mut self, number: u32, nodes: u64) -> bool {
        self.item.record = (self.entry, number);
        if self.filters && !self.listed.is_due(&self.item) {
            return true;
        }
        if nodes == 0 {
            self.pending.remember(self.item);
            return true;
        }
        if self.scene.has(Features::CHUNK_COUNTS) && self.world.path.is_multiple_of(COUNTED_PATHS) {
            self.scene.count_rays(self.scene.streaming.chunk_count.wrapping_add(number), COUNTED_PATHS);
        }
        false
    }

    /// Enters the target of an instance record; returns false if there is no room, or nothing to visit now.
    #[inline(always)]
    pub(super) fn enter(&mut self, simd: impl Simd, record: u32) -> bool {
        let Some(instance) = self.at.instances.get::<GpuInstance>(record as usize) else { return false };
        let nested = self.scene.has(Features::INSTANCING) && instance.target & TARGET_ASSEMBLY != 0;
        if ANY_HIT && !nested && self.world.shadow_link != 0 && !self.scene.is_linked(self.world.shadow_link, &instance)
        {
            return false;
        }
        if !nested && self.scene.lets_pass(self.world.passing, &instance) {
            return false;
        }
        let no_level = nested && self.level >= self.scene.special.levels();
        if no_level {
            self.stack.overflowed = true;
            return false;
        }
        let Some(map) = self.scene.placed_map(self.at.instances, &instance, self.world.time) else { return false };
        let (o, d) = (apply_point(&map, self.at.ray.origin()), apply_vector(&map, self.at.d));
        let depth = self.level_index();
        if nested {
            let Some(assembly) = self.scene.assembly(self.scene.target_number(instance.target)) else { return false };
            if !self.stack.push(StackKey::RETURN) {
                return false;
            }
            self.chain[depth] = record;
            self.begin_level(simd, o, d, [assembly.nodes, assembly.instances]);
        } else {
            let number = self.scene.target_number(instance.target);
            let Some(mesh) = self.scene.mesh(number) else { return false };
            if self.is_streaming && self.skips_mesh(number, mesh.nodes) {
                return false;
            }
            if !self.stack.push(StackKey::RETURN) {
                return false;
            }
            self.chain[depth] = record;
            self.instance = instance;
            self.in_mesh = true;
            self.at.ray = simd.box_ray(o, d, MESH_PAD * (o.largest() + mesh.reach));
            self.at.d = d;
            self.at.nodes = self.scene.view.bytes_near(mesh.nodes, &mut self.near.mesh_nodes);
            self.pose = self.scene.pose_of(&mesh, self.world.time, &mut self.near.items);
            self.shear = RayShear::new(d);
            self.mesh = mesh;
        }
        true
    }

    /// Makes (o, d) the ray of the walk, and saves it and the arrays for the return.
    #[inline(always)]
    fn begin_level(&mut self, simd: impl Simd, o: V3, d: V3, [nodes, instances]: [u64; 2]) {
        let view = self.scene.view;
        let nodes = view.bytes_near(nodes, &mut self.near.nodes);
        let instances = view.bytes_near(instances, &mut self.near.instances);
        self.at = WalkLevel { ray: simd.box_ray(o, d, 0.0), d, nodes, instances };
        self.level += 1;
        self.keep_level();
    }

    /// Begins the world ray at the top level.
    #[inline(always)]
    pub(super) fn begin_top(&mut self, simd: impl Simd) {
        let WorldRay { o, d, .. } = self.world;
        let ray = simd.box_ray(o, d, TOP_PAD * o.largest());
        self.at = WalkLevel { ray, d, nodes: self.scene.top_nodes, instances: HostBytes::NONE };
        self.keep_level();
    }

    #[inline(always)]
    fn keep_level(&mut self) {
        if let Some(level) = self.levels.get_mut(self.level) {
            *level = self.at;
        }
    }

    /// Returns from a mesh to the level that it was entered from, or from an assembly or a chunk to the level above.
    #[inline(always)]
    pub(super) fn leave(&mut self) {
        if !self.in_mesh {
            self.level = self.level.saturating_sub(1);
        }
        self.in_mesh = false;
        if let Some(level) = self.levels.get(self.level) {
            self.at = *level;
        }
    }
}
