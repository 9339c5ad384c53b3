// SPDX-License-Identifier: Apache-2.0
//! The part of a walk that changes frames: into chunks, assemblies and meshes, and back.

use super::{Level, MESH_PAD, TOP_PAD, Walk, WorldRay};
use crate::leaf::triangle::Shear;
use crate::node::{BoxRay, NUMBER};
use crate::pending::before;
use crate::vector::{V3, apply_point, apply_vector, difference, safe_reciprocal};
use oocpt_gpu::HostBytes;
use oocpt_shader_abi::{Features, GpuInstance, LISTED, RETURN, TARGET_ASSEMBLY};

impl<const ANY_HIT: bool> Walk<'_, '_, ANY_HIT> {
    /// From the top level into a chunk; false where it is absent or done, or where there is no room.
    #[inline(always)]
    pub(super) fn enter_chunk(&mut self, reference: u32) -> bool {
        let number = reference & NUMBER;
        let Some(instance) = self.scene.chunk_instance(number) else { return false };
        let Some(chunk) = self.scene.chunk(instance.chunk) else { return false };
        if self.is_streaming {
            let key = (self.entry, number);
            if reference & LISTED == 0
                && let Some(last) = self.resumed
                && !before(last, key)
            {
                return false;
            }
            if chunk.nodes == 0 {
                self.pending.remember(key);
                return false;
            }
            self.visits += 1;
            self.asking.enter(self.entry);
            if self.scene.has(Features::CHUNK_COUNTS) {
                self.scene.count_chunk(instance.chunk);
            }
        }
        if self.stack.len() >= self.scene.special.stack_size as usize {
            self.overflowed = true;
            return false;
        }
        self.stack.push((RETURN, 0.0));
        self.chunk_instance = number;
        let map = &instance.chunk_from_world;
        let origin = (V3([map[0][3], map[1][3], map[2][3]]), V3(instance.origin_lo));
        let from = difference((self.world.o, self.world.o_lo), origin);
        self.begin_level(apply_vector(map, from), apply_vector(map, self.world.d), [chunk.nodes, chunk.instances]);
        true
    }

    /// Into the target of an instance record; false where there is no room.
    #[inline(always)]
    pub(super) fn enter(&mut self, record: u32) -> bool {
        let Some(instance) = self.at.instances.get::<GpuInstance>(record as usize) else { return false };
        let nested = self.scene.has(Features::INSTANCING) && instance.target & TARGET_ASSEMBLY != 0;
        if ANY_HIT && !nested && self.world.shadow_link != 0 && !self.scene.is_linked(self.world.shadow_link, &instance)
        {
            return false;
        }
        let no_level = nested && self.level >= self.scene.special.levels();
        if self.stack.len() >= self.scene.special.stack_size as usize || no_level {
            self.overflowed = true;
            return false;
        }
        let Some(map) = self.scene.placed_map(self.at.instances, &instance, self.world.time) else { return false };
        let (o, d) = (apply_point(&map, self.at.ray.o), apply_vector(&map, self.at.d));
        let depth = self.level_index();
        if nested {
            let Some(assembly) = self.scene.assembly(self.scene.target_number(instance.target)) else { return false };
            self.stack.push((RETURN, 0.0));
            self.chain[depth] = record;
            self.begin_level(o, d, [assembly.nodes, assembly.instances]);
        } else {
            let Some(mesh) = self.scene.mesh(self.scene.target_number(instance.target)) else { return false };
            self.stack.push((RETURN, 0.0));
            self.chain[depth] = record;
            self.instance = instance;
            self.in_mesh = true;
            let reciprocal = safe_reciprocal(d);
            let pad = MESH_PAD * (o.largest() + mesh.reach);
            self.at.ray = BoxRay { o, reciprocal, around: reciprocal.map(|r| pad * r.abs()) };
            self.at.d = d;
            self.at.nodes = self.scene.view.bytes(mesh.nodes);
            self.pose = self.scene.pose_of(&mesh, self.world.time);
            self.triangles = self.pose.triangles;
            self.shear = Shear::new(d);
            self.mesh = mesh;
        }
        true
    }

    /// Makes (o, d) the ray of the walk, and remembers it and the arrays for coming back.
    #[inline(always)]
    fn begin_level(&mut self, o: V3, d: V3, [nodes, instances]: [u64; 2]) {
        let reciprocal = safe_reciprocal(d);
        let ray = BoxRay { o, reciprocal, around: reciprocal.map(|r| 0.0 * r.abs()) };
        let (nodes, instances) = (self.scene.view.bytes(nodes), self.scene.view.bytes(instances));
        self.at = Level { ray, d, nodes, instances };
        self.level += 1;
        let index = self.level_index();
        self.levels[index] = self.at;
    }

    /// The world ray, at the top level.
    #[inline(always)]
    pub(super) fn begin_top(&mut self) {
        let WorldRay { o, d, .. } = self.world;
        let reciprocal = safe_reciprocal(d);
        let pad = TOP_PAD * o.largest();
        let ray = BoxRay { o, reciprocal, around: reciprocal.map(|r| pad * r.abs()) };
        self.at = Level { ray, d, nodes: self.scene.top_nodes, instances: HostBytes::NONE };
    }

    /// Back from a mesh to the level that it was entered from, or from an assembly or a chunk to the level above.
    #[inline(always)]
    pub(super) fn leave(&mut self) {
        if !self.in_mesh {
            self.level = self.level.saturating_sub(1);
        }
        self.in_mesh = false;
        if self.level == 0 {
            self.begin_top();
        } else {
            self.at = self.levels[self.level_index()];
        }
    }
}
