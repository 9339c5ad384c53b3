// SPDX-License-Identifier: Apache-2.0
//! A world of one mesh, in memory that shaders and host both see.

mod cutouts;

use bytemuck::{Pod, Zeroable};
use oocpt_abi::{
    Bvh4Node, Features, FrameConstants, GpuChunk, GpuChunkInstance, GpuInstance, GpuMesh, GpuPoint, GpuTriangle,
    LeafType, LevelNode, MESH_KEYS_SHIFT, MeshFlags, NO_ROW, PushConstants, Ray, SPEC_MAX_LEVELS, SPEC_STACK_SIZE,
    ShadowRay, WavefrontCounters, groups, hit_stride,
};
use oocpt_gpu::{Buffer, BufferUsage, Gpu, OpenOptions, Pipeline};
use oocpt_shaders::Pass;
use oocpt_traverse::{InstructionSet, TraversalConstants};
use std::sync::Arc;
use std::time::Duration;

const LEAF: u32 = 1 << 31;
/// -128, and cells of 1: planes from -128 to 127.
const GRID: [u32; 3] = [0xc300_0000; 3];
const CELLS: u32 = 127 | 127 << 8 | 127 << 16;

/// A small generator (PCG, O'Neill 2014); the same numbers everywhere.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn word(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let word = ((self.0 >> 18) ^ self.0) >> 27;
        u32::try_from(word & 0xffff_ffff).unwrap_or_default().rotate_right((self.0 >> 59) as u32)
    }

    /// A number from 0 to below `end`.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        self.word() as usize % end
    }

    /// A number from -1 to 1.
    #[expect(clippy::cast_precision_loss, reason = "24 bits")]
    pub(crate) fn signed(&mut self) -> f32 {
        (self.word() >> 8) as f32 / 8_388_608.0 - 1.0
    }

    /// A number from 0 to 1, both ends more often than by chance.
    pub(crate) fn weight(&mut self) -> f32 {
        match self.below(4) {
            0 => 0.0,
            1 => 1.0,
            _ => 0.5 + 0.5 * self.signed(),
        }
    }

    /// A power of two with an exponent from -most to most.
    pub(crate) fn power(&mut self, most: i32) -> i32 {
        i32::try_from(self.below(2 * most.unsigned_abs() as usize + 1)).expect("small") - most
    }

    pub(crate) fn point(&mut self, size: f32) -> [f32; 3] {
        [0; 3].map(|_| size * self.signed())
    }
}

/// A node whose four boxes are all of the grid.
pub(crate) fn node(inner: u32, first: u32, counts: [u32; 4], first_triangle: u32) -> Bvh4Node {
    let counts = counts.iter().rev().fold(0, |all, count| all << 2 | count);
    Bvh4Node {
        origin: GRID,
        cell_and_counts: CELLS | counts << 24,
        lower: [0; 3],
        upper: [u32::MAX; 3],
        first_child: inner << 28 | (first & 0x0fff_ffff),
        first_triangle,
    }
}

/// A centre and a radius.
pub(crate) type Ball = ([f32; 3], f32);

/// A tree over at most 16 bundles of points.
pub(crate) fn bundle_mesh(bundles: u32) -> Vec<Bvh4Node> {
    let counts = |first: u32| [0, 1, 2, 3].map(|i| u32::from(first + i < bundles));
    let mut nodes = vec![node(4, 1, [0; 4], 0)];
    nodes.extend((0..4).map(|i| node(0, 0, counts(4 * i), 4 * i)));
    nodes
}

/// A tree over `items`, at most 48, three to a leaf.
pub(crate) fn triangle_mesh(items: u32) -> Vec<Bvh4Node> {
    let counts = |first: u32| [0, 1, 2, 3].map(|i| items.saturating_sub(first + 3 * i).min(3));
    let mut nodes = vec![node(4, 1, [0; 4], 0)];
    nodes.extend((0..4).map(|i| node(0, 0, counts(12 * i), 12 * i)));
    nodes
}

/// Distance, barycentrics, triangle, chunk instance and record of a hit, as bits.
pub(crate) type Found = [u32; 6];

/// Results of a backend.
#[derive(Debug, PartialEq)]
pub(crate) struct Traced {
    /// Hits by path.
    pub(crate) hits: Vec<Option<Found>>,
    /// By path: true if the shadow ray hit something.
    pub(crate) in_shadow: Vec<bool>,
    pub(crate) overflows: u32,
}

/// A scene with one mesh, in memory that shaders and host both access.
pub(crate) struct World {
    gpu: Arc<Gpu>,
    special: TraversalConstants,
    passes: [Pipeline; 2],
    frame: Buffer,
    tables: Vec<Buffer>,
    cutouts: Option<Buffer>,
    mesh: Buffer,
    nodes: Buffer,
    items: Buffer,
    rays: Buffer,
    shadow_rays: Buffer,
    queue: Buffer,
    hits: Buffer,
    radiance: Buffer,
    surfaces: Buffer,
    escaped: Buffer,
    counters: Buffer,
    count: u32,
}

fn put<T: Pod>(gpu: &Arc<Gpu>, name: &str, values: &[T]) -> Buffer {
    let bytes: &[u8] = bytemuck::cast_slice(values);
    let buffer = Buffer::new(gpu, name, bytes.len() as u64, BufferUsage::Upload).expect("small");
    buffer.write(0, bytes).expect("mapped");
    buffer
}

fn level_node() -> LevelNode {
    let none = u32::MAX;
    let child = [LEAF, none, none, none];
    LevelNode { origin: GRID, cell: CELLS, lower: [0; 3], upper: [u32::MAX; 3], child, pad: [0; 2] }
}

impl World {
    /// Creates a world with room for `most` rays; `None` if the device has memory of its own.
    pub(crate) fn new(features: Features, stack_size: u32, most: u32) -> Option<Self> {
        let selector = std::env::var("OOCPT_TEST_DEVICE").ok();
        let gpu = Gpu::open(&OpenOptions { selector, validation: true, ..OpenOptions::default() }).expect("a device");
        if !gpu.has_host_memory() {
            return None;
        }
        let [low, high, top] = features.constants();
        let constants = [(SPEC_MAX_LEVELS, 1), (SPEC_STACK_SIZE, stack_size), low, high, top];
        let passes = [Pass::IntersectClosest, Pass::IntersectShadow].map(|pass| {
            let module = pass.info().module;
            Pipeline::new(&gpu, module.name, module.words, &constants, 32).expect("the pass compiles")
        });
        let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let record = GpuInstance {
            object_from_parent: identity,
            target: 0,
            prim_id: 0,
            index_in_prototype: 0,
            prototype_count: 1,
        };
        let rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let instance = GpuChunkInstance::new(rows, [0.0; 3], 0, 0, NO_ROW);
        let (level, records) = (put(&gpu, "level", &[level_node()]), put(&gpu, "records", &[record]));
        let chunk = GpuChunk { nodes: level.address(), instances: records.address(), primvars: 0 };
        let (chunks, instances) = (put(&gpu, "chunks", &[chunk]), put(&gpu, "instances", &[instance]));
        let make = |name, bytes: u32| {
            Buffer::new(&gpu, name, u64::from(most) * u64::from(bytes), BufferUsage::Upload).expect("small")
        };
        let mesh = put(&gpu, "mesh", &[GpuMesh::zeroed()]);
        let world = Self {
            special: TraversalConstants {
                max_levels: 1,
                stack_size,
                features,
                geometry_bytes: 0,
                instructions: InstructionSet::Widest,
            },
            passes,
            frame: put(&gpu, "frame", &[FrameConstants::zeroed()]),
            mesh,
            nodes: Buffer::new(&gpu, "nodes", 1 << 16, BufferUsage::Upload).expect("small"),
            items: Buffer::new(&gpu, "items", 1 << 16, BufferUsage::Upload).expect("small"),
            rays: make("rays", 48),
            shadow_rays: make("shadow rays", 64),
            queue: make("queue", 4),
            hits: make("hits", hit_stride(1)),
            radiance: make("radiance", 16),
            surfaces: make("surfaces", 4),
            escaped: make("escaped", 4),
            counters: put(&gpu, "counters", &[WavefrontCounters::zeroed()]),
            tables: vec![level, records, chunks, instances],
            cutouts: None,
            count: 0,
            gpu,
        };
        world.frame.write(0, bytemuck::bytes_of(&world.frame_block())).expect("mapped");
        Some(world)
    }

    fn frame_block(&self) -> FrameConstants {
        FrameConstants {
            top_nodes: self.tables[0].address(),
            chunk_instances: self.tables[3].address(),
            chunks: self.tables[2].address(),
            meshes: self.mesh.address(),
            rays: self.rays.address(),
            shadow_rays: self.shadow_rays.address(),
            hits: self.hits.address(),
            radiance: self.radiance.address(),
            ray_queue: [self.queue.address(); 2],
            shadow_queue: self.queue.address(),
            surface_queue: self.surfaces.address(),
            escaped_queue: self.escaped.address(),
            counters: self.counters.address(),
            ..FrameConstants::zeroed()
        }
    }

    /// Makes this the mesh.
    pub(crate) fn set_mesh(&self, nodes: &[Bvh4Node], items: &[GpuTriangle], kind: LeafType) {
        self.nodes.write(0, bytemuck::cast_slice(nodes)).expect("there is room");
        self.items.write(0, bytemuck::cast_slice(items)).expect("there is room");
        let (nodes, triangles) = (self.nodes.address(), self.items.address());
        let mesh = GpuMesh { nodes, triangles, reach: 128.0, flags: kind.flags(), ..GpuMesh::zeroed() };
        self.mesh.write(0, bytemuck::bytes_of(&mesh)).expect("mapped");
    }

    /// Makes these points the mesh, with a radius each, or with the first one's for all. With keys, points go from
    /// their places to those of `later` while the shutter is open.
    pub(crate) fn set_points(&self, nodes: &[Bvh4Node], points: &[Ball], later: &[Ball], has_own: bool) {
        let point = |&(center, _): &Ball| GpuPoint { center, face: 0 };
        let items: Vec<GpuPoint> = points.iter().chain(later).map(point).collect();
        let mut rest = if later.is_empty() { vec![] } else { vec![0.0, 1.0] };
        for (at, (_, radius)) in points.iter().enumerate() {
            rest.push(*radius);
            rest.extend(later.get(at).map(|(_, radius)| *radius));
        }
        self.nodes.write(0, bytemuck::cast_slice(nodes)).expect("there is room");
        self.items.write(0, bytemuck::cast_slice(&items)).expect("there is room");
        self.items.write(size_of_val(&*items) as u64, bytemuck::cast_slice(&rest)).expect("there is room");
        let own = if has_own { MeshFlags::OWN_RADII.bits() } else { 0 };
        let keys = if later.is_empty() { 0 } else { 2 << MESH_KEYS_SHIFT };
        let mesh = GpuMesh {
            nodes: self.nodes.address(),
            triangles: self.items.address(),
            reach: 128.0,
            flags: LeafType::POINT.flags() | own | keys,
            triangle_count: u32::try_from(points.len()).expect("few"),
            ..GpuMesh::zeroed()
        };
        self.mesh.write(0, bytemuck::bytes_of(&mesh)).expect("mapped");
    }

    /// Makes these hulls of two balls the mesh, which go to the places of `later` while the shutter is open, if any.
    pub(crate) fn set_hulls(&self, nodes: &[Bvh4Node], hulls: &[GpuTriangle], later: &[GpuTriangle]) {
        self.set_mesh(nodes, &[hulls, later].concat(), LeafType::ROUND);
        if !later.is_empty() {
            let times = 2 * size_of_val(hulls) as u64;
            self.items.write(times, bytemuck::cast_slice(&[0.0_f32, 1.0])).expect("there is room");
            let mesh = GpuMesh {
                nodes: self.nodes.address(),
                triangles: self.items.address(),
                reach: 128.0,
                flags: LeafType::ROUND.flags() | 2 << MESH_KEYS_SHIFT,
                triangle_count: u32::try_from(hulls.len()).expect("few"),
                ..GpuMesh::zeroed()
            };
            self.mesh.write(0, bytemuck::bytes_of(&mesh)).expect("mapped");
        }
    }

    /// Sets the addresses of the mesh to `at`, where there is no memory.
    pub(crate) fn set_mesh_addresses(&self, at: u64) {
        let mesh = GpuMesh { nodes: at, triangles: at, reach: 128.0, ..GpuMesh::zeroed() };
        self.mesh.write(0, bytemuck::bytes_of(&mesh)).expect("mapped");
    }

    /// Makes these (origin, direction) the rays.
    pub(crate) fn set_rays(&mut self, rays: &[[[f32; 3]; 2]]) {
        self.count = u32::try_from(rays.len()).expect("few");
        let rest = Ray { t_max: 3.0e38, ..Ray::zeroed() };
        let closest: Vec<Ray> = rays.iter().map(|&[o, d]| Ray { o, d, ..rest }).collect();
        let rest = ShadowRay { t_max: 0.999, contribution: [1.0; 3], ..ShadowRay::zeroed() };
        let shadows: Vec<ShadowRay> = rays.iter().map(|&[o, d]| ShadowRay { o, d, ..rest }).collect();
        let numbers: Vec<u32> = (0..self.count).collect();
        self.rays.write(0, bytemuck::cast_slice(&closest)).expect("there is room");
        self.shadow_rays.write(0, bytemuck::cast_slice(&shadows)).expect("there is room");
        self.queue.write(0, bytemuck::cast_slice(&numbers)).expect("there is room");
    }

    fn clear(&self) {
        let counters =
            WavefrontCounters { ray_count: [self.count; 2], shadow_count: self.count, ..WavefrontCounters::zeroed() };
        self.counters.write(0, bytemuck::bytes_of(&counters)).expect("mapped");
        for buffer in [&self.hits, &self.radiance, &self.surfaces, &self.escaped] {
            buffer.map(|bytes| bytes.fill(0)).expect("mapped");
        }
    }

    /// Traces with the shaders.
    pub(crate) fn shader(&self) -> Traced {
        self.clear();
        let push = PushConstants::wave(self.frame.address(), 0, self.count, 1);
        let mut commands = self.gpu.commands("trace").expect("a list");
        for pass in &self.passes {
            commands.dispatch(pass, bytemuck::bytes_of(&push), groups(u64::from(self.count)));
        }
        assert!(commands.submit().expect("it runs").wait(Duration::from_secs(120)).expect("it ends"), "in time");
        self.traced()
    }

    /// Traces on the host: rays one after the other, and in turns with the instructions that every processor has.
    pub(crate) fn native(&self) -> Traced {
        let traced = self.native_by(self.special);
        let other =
            TraversalConstants { instructions: InstructionSet::Portable, geometry_bytes: u64::MAX, ..self.special };
        assert!(traced == self.native_by(other), "in turns, by portable instructions: other hits");
        traced
    }

    fn native_by(&self, special: TraversalConstants) -> Traced {
        self.clear();
        let written =
            [&self.rays, &self.shadow_rays, &self.hits, &self.radiance, &self.surfaces, &self.escaped, &self.counters];
        let view = self.gpu.host_view(&written).expect("host memory");
        let push = PushConstants::wave(self.frame.address(), 0, self.count, 1);
        oocpt_traverse::closest(&view, push, special).expect("the tables are there");
        oocpt_traverse::shadow(&view, push, special).expect("the tables are there");
        drop(view);
        self.traced()
    }

    fn read<T: Pod>(buffer: &Buffer, count: u32) -> Vec<T> {
        let mut values = vec![T::zeroed(); count as usize];
        buffer.read(0, bytemuck::cast_slice_mut(&mut values)).expect("mapped");
        values
    }

    fn traced(&self) -> Traced {
        let counters = Self::read::<WavefrontCounters>(&self.counters, 1)[0];
        assert_eq!(counters.surface_count + counters.escaped_count, self.count, "each ray is in one queue");
        let records: Vec<[u32; 8]> = Self::read(&self.hits, self.count);
        let mut hits = vec![None; self.count as usize];
        for path in Self::read::<u32>(&self.surfaces, counters.surface_count) {
            let [u, v, triangle, instance, t, record, ..] = records[path as usize];
            hits[path as usize] = Some([t, u, v, triangle, instance, record]);
        }
        let radiance: Vec<[f32; 4]> = Self::read(&self.radiance, self.count);
        let in_shadow = radiance.iter().map(|light| light[0] == 0.0).collect();
        Traced { hits, in_shadow, overflows: counters.stack_overflows }
    }
}
