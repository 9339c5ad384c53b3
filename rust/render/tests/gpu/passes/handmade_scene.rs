// SPDX-License-Identifier: Apache-2.0
//! A world made by hand, all of it on the device: meshes of few triangles, an assembly of them, chunks of records, and
//! chunk instances that overlap, far from the origin.

use glam::{DAffine3, DQuat, DVec3};
use oocpt_abi::{
    GpuAssembly, GpuChunk, GpuChunkInstance, GpuInstance, GpuMesh, GpuTriangle, LevelNode, MeshFlags, NO_ROW,
    TARGET_ASSEMBLY,
};
use oocpt_core::mesh::bvh4::build_bvh4;
use oocpt_core::mesh::{LeafKind, build_box_bvh, level_nodes};
use oocpt_core::{Aabb, Triangle};
use oocpt_gpu::{Buffer, BufferUsage, Gpu};
use std::sync::Arc;

/// Where the world is: a float knows places here to a sixteenth only.
pub(super) const FAR: DVec3 = DVec3::new(1.0e6, -7.0e5, 3.0e5);
/// Chunks of the world.
pub(super) const CHUNKS: u32 = 37;
/// Its meshes.
pub(super) const MESHES: u32 = 3;
/// What may be absent: chunks, then meshes.
pub(super) const UNITS: u32 = CHUNKS + MESHES;

/// A small generator (PCG, O'Neill 2014); the same numbers everywhere.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn word(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let word = ((self.0 >> 18) ^ self.0) >> 27;
        u32::try_from(word & 0xffff_ffff).unwrap_or_default().rotate_right((self.0 >> 59) as u32)
    }

    fn unit(&mut self) -> f64 {
        f64::from(self.word()) / 4_294_967_296.0
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    fn placement(&mut self, spread: f64, scale: f64) -> DAffine3 {
        let rotation = DQuat::from_scaled_axis(self.point() * 3.0);
        let scale = DVec3::splat(scale * (0.5 + self.unit()));
        let translation = self.point() * spread;
        DAffine3::from_scale_rotation_translation(scale, rotation, translation)
    }
}

/// The world on the device.
pub(super) struct Scene {
    gpu: Arc<Gpu>,
    /// Keeps everything that is pointed to.
    kept: Vec<Buffer>,
    /// What the world is around.
    pub(super) at: DVec3,
    pub(super) top_nodes: u64,
    pub(super) chunk_instances: u64,
    pub(super) assemblies: u64,
    /// The mesh table with every mesh resident.
    pub(super) meshes: Vec<GpuMesh>,
    /// The chunk table with every chunk resident.
    pub(super) chunks: Vec<GpuChunk>,
    /// Chunk of each chunk instance.
    pub(super) chunk_of: Vec<u32>,
}

fn around(points: impl Iterator<Item = DVec3>, pad: f64) -> Aabb {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for point in points {
        (min, max) = (min.min(point), max.max(point));
    }
    let outwards = |value: f64, towards: f64| {
        #[expect(clippy::cast_possible_truncation, reason = "rounded outwards")]
        let near = value as f32;
        let inside = (f64::from(near) - value) * towards < 0.0;
        if !inside {
            near
        } else if towards < 0.0 {
            near.next_down()
        } else {
            near.next_up()
        }
    };
    let (min, max) = (min - pad, max + pad);
    Aabb { min: min.to_array().map(|x| outwards(x, -1.0)), max: max.to_array().map(|x| outwards(x, 1.0)) }
}

fn corners(bounds: &Aabb) -> impl Iterator<Item = DVec3> {
    let (a, b) = (DVec3::from(bounds.min.map(f64::from)), DVec3::from(bounds.max.map(f64::from)));
    (0..8).map(move |i| {
        DVec3::new(
            if i & 1 == 0 { a.x } else { b.x },
            if i & 2 == 0 { a.y } else { b.y },
            if i & 4 == 0 { a.z } else { b.z },
        )
    })
}

fn nodes(boxes: &[Aabb]) -> Vec<LevelNode> {
    level_nodes(&build_box_bvh(boxes)).0
}

/// Records under a tree, and the box around them.
struct Group {
    place: GpuAssembly,
    bounds: Aabb,
}

impl Scene {
    /// The world of `seed` around `at`.
    pub(super) fn new(gpu: &Arc<Gpu>, seed: u64, at: DVec3) -> Self {
        let mut scene = Self {
            gpu: Arc::clone(gpu),
            kept: Vec::new(),
            at,
            top_nodes: 0,
            chunk_instances: 0,
            assemblies: 0,
            meshes: Vec::new(),
            chunks: Vec::new(),
            chunk_of: Vec::new(),
        };
        let mut random = Random(seed);
        let (meshes, mut targets): (Vec<_>, Vec<_>) = (0..MESHES)
            .map(|i| {
                let (mesh, bounds) = scene.mesh(&mut random, i == 1);
                (mesh, (i, bounds))
            })
            .unzip();
        let clump = scene.group(&mut random, &targets, 3);
        targets.push((TARGET_ASSEMBLY, clump.bounds));
        let groups: Vec<Group> = (0..CHUNKS).map(|_| scene.group(&mut random, &targets, 6)).collect();
        scene.meshes = meshes;
        scene.assemblies = scene.put(&[clump.place]);
        scene.chunks = groups
            .iter()
            .map(|g| GpuChunk { nodes: g.place.nodes, instances: g.place.instances, primvars: 0 })
            .collect();
        scene.place(&mut random, &groups);
        scene
    }

    /// Chunk instances: every chunk once, some twice.
    fn place(&mut self, random: &mut Random, groups: &[Group]) {
        let (mut instances, mut boxes) = (Vec::new(), Vec::new());
        for id in 0..CHUNKS + 16 {
            let chunk = id % CHUNKS;
            let mut world_from_chunk = random.placement(3.0, 0.7);
            world_from_chunk.translation += self.at;
            let l = world_from_chunk.matrix3.inverse().transpose();
            let rows = [l.x_axis, l.y_axis, l.z_axis].map(|row| row.as_vec3().to_array());
            let origin = world_from_chunk.translation.to_array();
            instances.push(GpuChunkInstance::new(rows, origin, chunk, id, NO_ROW));
            let bounds = &groups[chunk as usize].bounds;
            boxes.push(around(corners(bounds).map(|corner| world_from_chunk.transform_point3(corner)), 1e-5));
            self.chunk_of.push(chunk);
        }
        self.chunk_instances = self.put(&instances);
        self.top_nodes = self.put(&nodes(&boxes));
    }

    fn mesh(&mut self, random: &mut Random, is_veil: bool) -> (GpuMesh, Aabb) {
        let mut triangles = Vec::new();
        for face in 0..24 {
            let at = random.point();
            let [v0, v1, v2] = [(); 3].map(|()| (at + 0.6 * random.point()).as_vec3().to_array());
            triangles.push(Triangle { vertices: [v0, v1, v2], face });
        }
        let (bvh, order) = build_bvh4(&triangles, LeafKind::Triangles);
        let ordered = order.iter().map(|&at| {
            let Triangle { vertices: [v0, v1, v2], face } = triangles[at as usize];
            GpuTriangle { v0, face, v1, subset_and_sides: 0, v2, ptex: 0 }
        });
        let ordered: Vec<GpuTriangle> = ordered.collect();
        let points = |t: &Triangle| t.vertices.map(|v| DVec3::from(v.map(f64::from))).into_iter();
        let bounds = around(triangles.iter().flat_map(points), 0.0);
        let flags = if is_veil { MeshFlags::HAS_OPACITIES } else { MeshFlags::empty() };
        let constant = oocpt_abi::AttributeRate::Constant;
        let mesh = GpuMesh {
            nodes: self.put(&bvh.nodes),
            triangles: self.put(&ordered),
            reach: bounds.min.iter().chain(&bounds.max).fold(0.0, |reach, x| x.abs().max(reach)),
            flags: flags.with_rates(constant, constant, constant),
            corner_indices: 0,
            normals: 0,
            colors: 0,
            opacities: self.put(&[0.4_f32]),
            primvars: 0,
            primvar_count: 0,
            triangle_count: 24,
        };
        (mesh, bounds)
    }

    fn group(&mut self, random: &mut Random, targets: &[(u32, Aabb)], count: u32) -> Group {
        let (mut records, mut boxes) = (Vec::new(), Vec::new());
        for index in 0..count {
            let (target, bounds) = &targets[random.word() as usize % targets.len()];
            let parent_from_object = random.placement(1.0, 0.5);
            let m = parent_from_object.inverse();
            let row = |i: usize| {
                let [x, y, z] = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(|axis| axis[i]);
                [x, y, z, m.translation[i]].map(|value| {
                    #[expect(clippy::cast_possible_truncation, reason = "records are single precision")]
                    let value = value as f32;
                    value
                })
            };
            records.push(GpuInstance {
                object_from_parent: [row(0), row(1), row(2)],
                target: *target,
                prim_id: 7,
                index_in_prototype: index,
                prototype_count: count,
            });
            boxes.push(around(corners(bounds).map(|corner| parent_from_object.transform_point3(corner)), 1e-5));
        }
        let place = GpuAssembly { nodes: self.put(&nodes(&boxes)), instances: self.put(&records), primvars: 0 };
        let bounds = around(boxes.iter().flat_map(corners), 0.0);
        Group { place, bounds }
    }

    /// Places `items` where the device can read them.
    fn put<T: bytemuck::Pod>(&mut self, items: &[T]) -> u64 {
        let bytes = bytemuck::cast_slice(items);
        let buffer = Buffer::new(&self.gpu, "scene", bytes.len() as u64, BufferUsage::Upload).expect("small");
        buffer.write(0, bytes).expect("mapped");
        self.kept.push(buffer);
        self.kept.last().expect("just pushed").address()
    }
}
