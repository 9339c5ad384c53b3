// SPDX-License-Identifier: Apache-2.0
//! Runs the passes on a scene, with everything resident or with chunks that are loaded and evicted, in the order of
//! `oocpt_shaders`.

use super::handmade_scene::{CHUNKS, Scene, UNITS};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use oocpt_abi as abi;
use oocpt_abi::{
    Features, FilmPixel, FrameConstants, GpuChunk, GpuInfiniteLight, GpuLightKind, GpuMesh, LightFlags,
    LightTablePointers, NO_INDEX, PushConstants, PushFlags, StreamingPointers, UnitDemand, WavefrontCounters, groups,
    sort_blocks,
};
use oocpt_gpu::{Buffer, BufferUsage, CommandList, Gpu, Pipeline};
use oocpt_shaders::{ShaderModule, passes};
use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

pub(super) const SIZE: [u32; 2] = [32, 20];
pub(super) const PIXELS: u32 = SIZE[0] * SIZE[1];
pub(super) const PATHS: u32 = 3 * PIXELS;
const BOUNCES: u32 = 3;
const LEVELS: u32 = 2;
const STACK: u32 = 64;
/// The most paths in flight at any time.
pub(super) const SEGMENT_SIZE: u32 = 300;
pub(super) const SEGMENTS: u32 = 3;

/// The images that are compared: the film, and depth and instance ids.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Images {
    pub(super) film: Vec<u8>,
    pub(super) depth: Vec<u8>,
    pub(super) ids: Vec<u8>,
}

/// The passes and their memory.
pub(super) struct Tracer<'a> {
    pub(super) gpu: Arc<Gpu>,
    pub(super) scene: &'a Scene,
    features: Features,
    pipelines: HashMap<&'static str, Pipeline>,
    pub(super) buffers: HashMap<&'static str, Buffer>,
    /// Kept, because a GPU's driver takes milliseconds to allocate memory that the host reads.
    readback: RefCell<Option<Buffer>>,
    pub(super) streaming: StreamingPointers,
    pub(super) round: u32,
    walkers: u32,
    /// Capacities of the buffers `demanded` and `demand list`, in units.
    pub(super) demand_capacities: [u32; 2],
    pub(super) fault: u32,
}

impl<'a> Tracer<'a> {
    /// Memory for `slots` paths.
    pub(super) fn new(gpu: &Arc<Gpu>, scene: &'a Scene, features: Features) -> Self {
        let mut tracer = Self {
            gpu: Arc::clone(gpu),
            scene,
            features,
            pipelines: HashMap::new(),
            buffers: HashMap::new(),
            readback: RefCell::new(None),
            streaming: StreamingPointers::zeroed(),
            round: 0,
            walkers: 1 << 18,
            demand_capacities: [UNITS; 2],
            fault: 0,
        };
        let streams = features.contains(Features::STREAMING);
        let slots = u64::from(if streams { SEGMENTS * SEGMENT_SIZE } else { PATHS });
        let sizes =
            [("rays", 48), ("shadow_rays", 64), ("hits", abi::hit_stride(LEVELS)), ("paths", 16), ("radiance", 16)];
        let queues = [("queue 0", 4), ("queue 1", 4), ("shadow queue", 4), ("surfaces", 4), ("escaped", 4)];
        for (name, bytes) in sizes.into_iter().chain(queues) {
            tracer.make(name, slots * u64::from(bytes));
        }
        let lists = [("pending", 64), ("shadow pending", 64), ("kept", 80), ("deferred 0", 8), ("deferred 1", 8)];
        let numbers = [("progress", 4), ("places", 4), ("free slots", 4), ("ended", 16)];
        for (name, bytes) in lists.into_iter().chain(numbers) {
            tracer.make(name, slots * bytes);
        }
        tracer.make("segments", 16 * u64::from(SEGMENTS));
        tracer.make("demand", 16 * u64::from(UNITS));
        tracer.make("demand counts", 8);
        tracer.make("demanded", 4 * u64::from(UNITS));
        tracer.make("demand list", size_of::<UnitDemand>() as u64 * u64::from(UNITS));
        tracer.make("counts", 8 * u64::from(CHUNKS));
        tracer.make("sums", 4 * u64::from(sort_blocks(CHUNKS)));
        tracer.make("unit rays", 4 * u64::from(UNITS));
        tracer.make("chunks", size_of::<GpuChunk>() as u64 * u64::from(CHUNKS));
        tracer.make("meshes", size_of_val(&*scene.meshes) as u64);
        tracer.make("counters", size_of::<WavefrontCounters>() as u64);
        tracer.make("film", u64::from(PIXELS) * size_of::<FilmPixel>() as u64);
        tracer.make("depth", 4 * u64::from(PIXELS));
        tracer.make("ids", 4 * u64::from(PIXELS));
        let blocks = [
            ("lights", 2 * size_of::<GpuInfiniteLight>()),
            ("lighting", size_of::<LightTablePointers>()),
            ("streaming", size_of::<StreamingPointers>()),
            ("frame", size_of::<FrameConstants>()),
        ];
        for (name, bytes) in blocks {
            let buffer = Buffer::new(gpu, name, bytes as u64, BufferUsage::Upload).expect("small");
            tracer.buffers.insert(name, buffer);
        }
        tracer.fill_blocks();
        tracer
    }

    /// This tracer with at most so many threads for the rays of a round.
    pub(super) fn with_walkers(mut self, walkers: u32) -> Self {
        self.walkers = walkers;
        self.fill_blocks();
        self
    }

    /// This tracer with a word by which the host gives the picture up.
    pub(super) fn cancelled_by(mut self, word: u32) -> Self {
        let buffer = Buffer::new(&self.gpu, "cancelled", 4, BufferUsage::Upload).expect("small");
        buffer.write(0, &word.to_ne_bytes()).expect("mapped");
        self.buffers.insert("cancelled", buffer);
        self.fill_blocks();
        self
    }

    /// This tracer with these capacities of the buffers `demanded` and `demand list`.
    pub(super) fn with_demand_capacities(mut self, capacities: [u32; 2]) -> Self {
        self.demand_capacities = capacities;
        self.fill_blocks();
        self
    }

    fn make(&mut self, name: &'static str, bytes: u64) {
        self.buffers.insert(name, Buffer::new(&self.gpu, name, bytes, BufferUsage::Device).expect("small"));
    }

    pub(super) fn address(&self, name: &str) -> u64 {
        self.buffers[name].address()
    }

    fn fill_blocks(&mut self) {
        self.streaming = StreamingPointers {
            segments: self.address("segments"),
            progress: self.address("progress"),
            pending: self.address("pending"),
            shadow_pending: self.address("shadow pending"),
            surfaces: self.address("kept"),
            deferred: [self.address("deferred 0"), self.address("deferred 1")],
            demand: self.address("demand"),
            sort_counts: self.address("counts"),
            sort_sums: self.address("sums"),
            unit_rays: self.address("unit rays"),
            places: self.address("places"),
            ended_radiance: self.address("ended"),
            free_slots: self.address("free slots"),
            surface_materials: 0,
            segment_size: SEGMENT_SIZE,
            chunk_count: CHUNKS,
            slots: SEGMENTS * SEGMENT_SIZE,
            unit_count: UNITS,
            first_tile: UNITS,
            demand_counts: self.address("demand counts"),
            demanded: self.address("demanded"),
            demand_list: self.address("demand list"),
            demanded_capacity: self.demand_capacities[0],
            demand_capacity: self.demand_capacities[1],
            ..StreamingPointers::zeroed()
        };
        let dome = GpuInfiniteLight {
            direction: [0.0, 0.0, 1.0],
            one_minus_cos: 0.0,
            radiance: [0.5, 0.6, 0.7],
            probability: 0.4,
            cumulative: 0.4,
            diffuse: 1.0,
            specular: 1.0,
            flags: GpuLightKind::Dome as u32 | LightFlags::CAMERA_VISIBLE.bits(),
            map: NO_INDEX,
            light_link: 0,
            shadow_link: 0,
            shadow_color: 0,
        };
        let sun = GpuInfiniteLight {
            direction: [0.6, 0.8, 0.0],
            one_minus_cos: 0.02,
            radiance: [9.0; 3],
            probability: 0.6,
            cumulative: 1.0,
            flags: GpuLightKind::Distant as u32,
            ..dome
        };
        let lighting = LightTablePointers {
            infinite_lights: self.address("lights"),
            infinite_count: 2,
            ..LightTablePointers::default()
        };
        self.buffers["lights"].write(0, bytemuck::cast_slice(&[dome, sun])).expect("mapped");
        self.buffers["lighting"].write(0, bytemuck::bytes_of(&lighting)).expect("mapped");
        self.buffers["streaming"].write(0, bytemuck::bytes_of(&self.streaming)).expect("mapped");
        self.buffers["frame"].write(0, bytemuck::bytes_of(&self.frame())).expect("mapped");
    }

    fn frame(&self) -> FrameConstants {
        let eye = self.scene.at + DVec3::new(0.3, 0.2, 9.0);
        let high = eye.as_vec3();
        let mut frame = FrameConstants {
            top_nodes: self.scene.top_nodes,
            chunk_instances: self.scene.chunk_instances,
            chunks: self.address("chunks"),
            assemblies: self.scene.assemblies,
            meshes: self.address("meshes"),
            lighting: self.address("lighting"),
            rays: self.address("rays"),
            shadow_rays: self.address("shadow_rays"),
            hits: self.address("hits"),
            paths: self.address("paths"),
            radiance: self.address("radiance"),
            ray_queue: [self.address("queue 0"), self.address("queue 1")],
            shadow_queue: self.address("shadow queue"),
            surface_queue: self.address("surfaces"),
            escaped_queue: self.address("escaped"),
            streaming: self.address("streaming"),
            counters: self.address("counters"),
            film: self.address("film"),
            ray_o: high.to_array(),
            ray_o_lo: (eye - high.as_dvec3()).as_vec3().to_array(),
            ray_d: [-0.6, -0.375, -1.0],
            ray_d_x: [0.0375, 0.0, 0.0],
            ray_d_y: [0.0, 0.0375, 0.0],
            view: [[0.0; 4], [0.0; 4], [0.0, 0.0, 1.0, 0.0]],
            view_normal: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            default_albedo: [0.7; 3],
            width: SIZE[0],
            picture_width: SIZE[0],
            picture_height: SIZE[1],
            height: SIZE[1],
            seed: 5,
            most_walkers: self.walkers,
            max_bounces: BOUNCES,
            flags: 1,
            ..FrameConstants::zeroed()
        };
        frame.cancelled = self.buffers.get("cancelled").map_or(0, Buffer::address);
        frame.aov.camera_depth = self.address("depth");
        frame.aov.instance_id = self.address("ids");
        frame.aov_clear.instance_id = -1;
        frame.plane_at = oocpt_abi::PlaneOffsets::NONE;
        frame
    }

    pub(super) fn run(
        &mut self,
        commands: &mut CommandList,
        module: &'static ShaderModule,
        push: PushConstants,
        launch: Launch,
    ) {
        let [low, high, top] = self.features.constants();
        let spec = [(0, LEVELS), (1, STACK), low, high, top, (abi::SPEC_FAULT, self.fault)];
        let pipeline = self.pipelines.entry(module.name).or_insert_with(|| {
            Pipeline::new(&self.gpu, module.name, &module.specialised(&spec), &spec, 32).expect("the pass compiles")
        });
        let push = bytemuck::bytes_of(&push);
        match launch {
            Launch::Threads(threads) => commands.dispatch(pipeline, push, groups(u64::from(threads))),
            Launch::Groups(count) => commands.dispatch(pipeline, push, [count, 1, 1]),
            Launch::Indirect(at) => commands.dispatch_indirect(pipeline, push, &self.buffers["counters"], at),
        }
    }

    fn submit(&self, record: impl FnOnce(&mut CommandList)) {
        let mut commands = self.gpu.commands("test").expect("a list");
        record(&mut commands);
        let submission = commands.submit().expect("submitted");
        assert!(submission.wait(Duration::from_secs(60)).expect("alive"), "the submission did not end");
    }

    /// The contents of a buffer.
    pub(super) fn read<T: Pod>(&self, name: &str) -> Vec<T> {
        let source = &self.buffers[name];
        let size = source.size();
        let mut readback = self.readback.borrow_mut();
        if readback.as_ref().is_none_or(|buffer| buffer.size() < size) {
            *readback = Some(Buffer::new(&self.gpu, "readback", size, BufferUsage::Readback).expect("small"));
        }
        let copy = readback.as_ref().expect("made above");
        self.submit(|c| c.copy(source, 0, copy, 0, size));
        let length = usize::try_from(size).expect("small");
        copy.map(|bytes| bytemuck::pod_collect_to_vec(&bytes[..length])).expect("mapped")
    }

    pub(super) fn clear(&self, names: &[&str]) {
        self.submit(|c| names.iter().for_each(|name| c.fill(&self.buffers[*name], 0, self.buffers[*name].size(), 0)));
    }

    pub(super) fn set_chunks(&self, chunks: &[GpuChunk]) {
        self.submit(|c| c.update(&self.buffers["chunks"], 0, bytemuck::cast_slice(chunks)));
    }

    pub(super) fn set_meshes(&self, meshes: &[GpuMesh]) {
        self.submit(|c| c.update(&self.buffers["meshes"], 0, bytemuck::cast_slice(meshes)));
    }

    pub(super) fn images(&self) -> Images {
        Images { film: self.read("film"), depth: self.read("depth"), ids: self.read("ids") }
    }

    /// The wave of all paths, everything resident.
    pub(super) fn wave(&mut self) -> Images {
        self.clear(&["counters", "film"]);
        self.set_chunks(&self.scene.chunks);
        self.set_meshes(&self.scene.meshes);
        let mut commands = self.gpu.commands("wave").expect("a list");
        let q = PushConstants::wave(self.address("frame"), 0, PIXELS, PIXELS).flagged(PushFlags::AOVS);
        self.run(&mut commands, &passes::GENERATE_AOV_RAYS, q, Launch::Threads(PIXELS));
        self.round(&mut commands, q);
        let q = PushConstants::wave(self.address("frame"), 0, PATHS, PIXELS);
        self.run(&mut commands, &passes::GENERATE_CAMERA_RAYS, q, Launch::Threads(PATHS));
        for round in 0..=BOUNCES + 1 {
            self.round(&mut commands, q.with(round, 0));
        }
        self.run(&mut commands, &passes::ACCUMULATE, q, Launch::Threads(PIXELS));
        assert!(commands.submit().expect("submitted").wait(Duration::from_secs(60)).expect("alive"), "the wave ends");
        self.images()
    }

    /// Traces and shades one round; in core the last one has shadow rays only.
    pub(super) fn round(&mut self, c: &mut CommandList, q: PushConstants) {
        let aovs = q.flags == PushFlags::AOVS.bits();
        let streams = self.features.contains(Features::STREAMING);
        self.run(c, &passes::PREPARE_DISPATCH, q.with(q.round, abi::PREPARE_TRACE), Launch::Threads(1));
        if streams || aovs || q.round <= BOUNCES {
            self.run(c, &passes::INTERSECT_CLOSEST, q, Launch::Indirect(WavefrontCounters::TRACE_ARGS));
        }
        if !aovs {
            self.run(c, &passes::INTERSECT_SHADOW, q, Launch::Indirect(WavefrontCounters::SHADOW_ARGS));
        }
        if !streams && q.round > BOUNCES {
            return;
        }
        if streams {
            self.run(c, &passes::RECORD_SURFACES, q, Launch::Indirect(WavefrontCounters::RAY_ARGS));
        }
        self.run(c, &passes::PREPARE_DISPATCH, q.with(q.round, abi::PREPARE_SHADE), Launch::Threads(1));
        let (surfaces, escaped) = if aovs {
            (&passes::SHADE_AOVS, &passes::SHADE_AOVS)
        } else {
            (&passes::SHADE_SURFACE, &passes::SHADE_BACKGROUND)
        };
        self.run(c, escaped, q.with(q.round, abi::AOV_ESCAPED), Launch::Indirect(WavefrontCounters::ESCAPED_ARGS));
        self.run(c, surfaces, q.with(q.round, abi::AOV_SURFACES), Launch::Indirect(WavefrontCounters::SURFACE_ARGS));
    }
}

#[derive(Clone, Copy)]
pub(super) enum Launch {
    Threads(u32),
    Groups(u32),
    Indirect(u64),
}
