// SPDX-License-Identifier: Apache-2.0
//! Runs the passes on a scene, with everything resident or with chunks that come and go, in the order that `shader_abi` tells.

use super::world::{CHUNKS, FAR, Random, Scene};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use oocpt_gpu::{Buffer, Commands, Gpu, Pipeline, Usage};
use oocpt_shader_abi as abi;
use oocpt_shader_abi::{
    Counters, Features, FilmPixel, Frame, GpuChunk, GpuLight, Module, Push, PushFlags, SHADOW_BIT, Segment, Streaming,
    groups, passes, sort_blocks,
};
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

pub(super) const SIZE: [u32; 2] = [32, 20];
pub(super) const PIXELS: u32 = SIZE[0] * SIZE[1];
pub(super) const PATHS: u32 = 3 * PIXELS;
const BOUNCES: u32 = 3;
const LEVELS: u32 = 2;
const STACK: u32 = 64;
/// More paths than these are in flight at no time.
const SEGMENT_SIZE: u32 = 300;
const SEGMENTS: u32 = 3;

/// What is compared: the film, and depth and instance ids.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Images {
    pub(super) film: Vec<u8>,
    pub(super) depth: Vec<u8>,
    pub(super) ids: Vec<u8>,
}

/// What a run with streaming reports beside its images.
#[derive(Debug, Default)]
pub(super) struct Totals {
    pub(super) submissions: u32,
    pub(super) counters: Counters,
    pub(super) chunk_rays: Vec<u32>,
}

/// The passes and their memory.
pub(super) struct Tracer<'a> {
    gpu: Arc<Gpu>,
    scene: &'a Scene,
    features: Features,
    pipelines: HashMap<&'static str, Pipeline>,
    pub(super) buffers: HashMap<&'static str, Buffer>,
    pub(super) streaming: Streaming,
    round: u32,
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
            streaming: Streaming::zeroed(),
            round: 0,
        };
        let streams = features.contains(Features::STREAMING);
        let slots = u64::from(if streams { SEGMENTS * SEGMENT_SIZE } else { PATHS });
        let sizes =
            [("rays", 48), ("shadow_rays", 64), ("hits", abi::hit_stride(LEVELS)), ("paths", 16), ("radiance", 16)];
        let queues = [("queue 0", 4), ("queue 1", 4), ("shadow queue", 4), ("surfaces", 4), ("escaped", 4)];
        for (name, bytes) in sizes.into_iter().chain(queues) {
            tracer.make(name, slots * u64::from(bytes));
        }
        let per_slot = [
            ("progress", 4),
            ("pending", 32),
            ("shadow pending", 32),
            ("kept", 80),
            ("deferred 0", 8),
            ("deferred 1", 8),
        ];
        for (name, bytes) in per_slot {
            tracer.make(name, slots * bytes);
        }
        tracer.make("segments", 16 * u64::from(SEGMENTS));
        tracer.make("demand", 8 * u64::from(CHUNKS));
        tracer.make("counts", 8 * u64::from(CHUNKS));
        tracer.make("sums", 4 * u64::from(sort_blocks(CHUNKS)));
        tracer.make("chunk rays", 4 * u64::from(CHUNKS));
        tracer.make("chunks", 16 * u64::from(CHUNKS));
        tracer.make("counters", size_of::<Counters>() as u64);
        tracer.make("film", u64::from(PIXELS) * size_of::<FilmPixel>() as u64);
        tracer.make("depth", 4 * u64::from(PIXELS));
        tracer.make("ids", 4 * u64::from(PIXELS));
        let blocks =
            [("light", size_of::<GpuLight>()), ("streaming", size_of::<Streaming>()), ("frame", size_of::<Frame>())];
        for (name, bytes) in blocks {
            let buffer = Buffer::new(gpu, name, bytes as u64, Usage::Upload).expect("small");
            tracer.buffers.insert(name, buffer);
        }
        tracer.fill_blocks();
        tracer
    }

    fn make(&mut self, name: &'static str, bytes: u64) {
        self.buffers.insert(name, Buffer::new(&self.gpu, name, bytes, Usage::Device).expect("small"));
    }

    fn address(&self, name: &str) -> u64 {
        self.buffers[name].address()
    }

    fn fill_blocks(&mut self) {
        self.streaming = Streaming {
            segments: self.address("segments"),
            progress: self.address("progress"),
            pending: self.address("pending"),
            shadow_pending: self.address("shadow pending"),
            surfaces: self.address("kept"),
            deferred: [self.address("deferred 0"), self.address("deferred 1")],
            demand: self.address("demand"),
            sort_counts: self.address("counts"),
            sort_sums: self.address("sums"),
            chunk_rays: self.address("chunk rays"),
            segment_size: SEGMENT_SIZE,
            chunk_count: CHUNKS,
        };
        let light = GpuLight {
            direction: [0.6, 0.8, 0.0],
            one_minus_cos: 0.02,
            radiance: [9.0; 3],
            probability: 1.0,
            cumulative: 1.0,
        };
        self.buffers["light"].write(0, bytemuck::bytes_of(&light)).expect("mapped");
        self.buffers["streaming"].write(0, bytemuck::bytes_of(&self.streaming)).expect("mapped");
        self.buffers["frame"].write(0, bytemuck::bytes_of(&self.frame())).expect("mapped");
    }

    fn frame(&self) -> Frame {
        let eye = FAR + DVec3::new(0.3, 0.2, 9.0);
        let high = eye.as_vec3();
        let mut frame = Frame {
            top_nodes: self.scene.top_nodes,
            chunk_instances: self.scene.chunk_instances,
            chunks: self.address("chunks"),
            assemblies: self.scene.assemblies,
            meshes: self.scene.meshes,
            lights: self.address("light"),
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
            dome_radiance: [0.5, 0.6, 0.7],
            dome_background: [0.5, 0.6, 0.7],
            dome_select: 0.4,
            default_albedo: [0.7; 3],
            width: SIZE[0],
            height: SIZE[1],
            seed: 5,
            max_bounces: BOUNCES,
            light_count: 1,
            flags: 1,
            ..Frame::zeroed()
        };
        frame.aov.camera_depth = self.address("depth");
        frame.aov.instance_id = self.address("ids");
        frame.aov_clear.instance_id = -1;
        frame
    }

    fn run(&mut self, commands: &mut Commands, module: &'static Module, push: Push, launch: Launch) {
        let spec = [(0, LEVELS), (1, STACK), (2, self.features.bits())];
        let pipeline = self.pipelines.entry(module.name).or_insert_with(|| {
            Pipeline::new(&self.gpu, module.name, module.words, &spec, 32).expect("the pass compiles")
        });
        let push = bytemuck::bytes_of(&push);
        match launch {
            Launch::Threads(threads) => commands.dispatch(pipeline, push, groups(u64::from(threads))),
            Launch::Groups(count) => commands.dispatch(pipeline, push, [count, 1, 1]),
            Launch::Indirect(at) => commands.dispatch_indirect(pipeline, push, &self.buffers["counters"], at),
        }
    }

    fn submit(&self, record: impl FnOnce(&mut Commands)) {
        let mut commands = self.gpu.commands("test").expect("a list");
        record(&mut commands);
        let submission = commands.submit().expect("submitted");
        assert!(submission.wait(Duration::from_secs(60)).expect("alive"), "the submission did not end");
    }

    /// The contents of a buffer.
    pub(super) fn read<T: Pod>(&self, name: &str) -> Vec<T> {
        let source = &self.buffers[name];
        let copy = Buffer::new(&self.gpu, "copy", source.size(), Usage::Readback).expect("small");
        self.submit(|c| c.copy(source, 0, &copy, 0, source.size()));
        copy.map(|bytes| bytemuck::pod_collect_to_vec(bytes)).expect("mapped")
    }

    fn clear(&self, names: &[&str]) {
        self.submit(|c| names.iter().for_each(|name| c.fill(&self.buffers[*name], 0, self.buffers[*name].size(), 0)));
    }

    fn set_chunks(&self, chunks: &[GpuChunk]) {
        self.submit(|c| c.update(&self.buffers["chunks"], 0, bytemuck::cast_slice(chunks)));
    }

    fn images(&self) -> Images {
        Images { film: self.read("film"), depth: self.read("depth"), ids: self.read("ids") }
    }

    /// The wave of all paths, everything resident.
    pub(super) fn wave(&mut self) -> Images {
        self.clear(&["counters", "film"]);
        self.set_chunks(&self.scene.chunks);
        let mut commands = self.gpu.commands("wave").expect("a list");
        let q = Push::wave(self.address("frame"), 0, PIXELS, PIXELS).flagged(PushFlags::AOVS);
        self.run(&mut commands, &passes::GENERATE_AOV_RAYS, q, Launch::Threads(PIXELS));
        self.round(&mut commands, q);
        let q = Push::wave(self.address("frame"), 0, PATHS, PIXELS);
        self.run(&mut commands, &passes::GENERATE_CAMERA_RAYS, q, Launch::Threads(PATHS));
        for round in 0..=BOUNCES + 1 {
            self.round(&mut commands, q.with(round, 0));
        }
        self.run(&mut commands, &passes::ACCUMULATE, q, Launch::Threads(PIXELS));
        assert!(commands.submit().expect("submitted").wait(Duration::from_secs(60)).expect("alive"), "the wave ends");
        self.images()
    }

    /// Traces and shades one round; in core the last one has shadow rays only.
    fn round(&mut self, c: &mut Commands, q: Push) {
        let aovs = q.flags == PushFlags::AOVS.bits();
        let streams = self.features.contains(Features::STREAMING);
        self.run(c, &passes::PREPARE_DISPATCH, q.with(q.round, abi::PREPARE_TRACE), Launch::Threads(1));
        if streams || aovs || q.round <= BOUNCES {
            self.run(c, &passes::INTERSECT_CLOSEST, q, Launch::Indirect(Counters::RAY_ARGS));
        }
        if !aovs {
            self.run(c, &passes::INTERSECT_SHADOW, q, Launch::Indirect(Counters::SHADOW_ARGS));
        }
        if !streams && q.round > BOUNCES {
            return;
        }
        if streams {
            self.run(c, &passes::RECORD_SURFACES, q, Launch::Indirect(Counters::RAY_ARGS));
        }
        self.run(c, &passes::PREPARE_DISPATCH, q.with(q.round, abi::PREPARE_SHADE), Launch::Threads(1));
        let (surfaces, escaped) = if aovs {
            (&passes::SHADE_AOVS, &passes::SHADE_AOVS)
        } else {
            (&passes::SHADE_SURFACE, &passes::SHADE_BACKGROUND)
        };
        self.run(c, escaped, q.with(q.round, abi::AOV_ESCAPED), Launch::Indirect(Counters::ESCAPED_ARGS));
        self.run(c, surfaces, q.with(q.round, abi::AOV_SURFACES), Launch::Indirect(Counters::SURFACE_ARGS));
    }

    /// The same images with at most `resident` chunks at a time, `rounds` rounds a submission; chunks come by demand and go at random.
    pub(super) fn stream(&mut self, resident: usize, rounds: u32, seed: u64) -> (Images, Totals) {
        self.clear(&["film", "chunk rays"]);
        let mut random = Random(seed);
        let mut totals = Totals::default();
        self.stream_paths(PIXELS, PushFlags::AOVS, (resident, rounds), &mut random, &mut totals);
        self.stream_paths(PATHS, PushFlags::empty(), (resident, rounds), &mut random, &mut totals);
        totals.chunk_rays = self.read("chunk rays");
        (self.images(), totals)
    }

    fn stream_paths(
        &mut self,
        paths: u32,
        flags: PushFlags,
        (resident, rounds): (usize, u32),
        random: &mut Random,
        totals: &mut Totals,
    ) {
        self.clear(&["counters", "segments"]);
        self.round = 0;
        let mut here: Vec<u32> = Vec::new();
        let mut demand = vec![0_u32; 2 * CHUNKS as usize];
        let mut flying: Vec<Option<u32>> = vec![None; SEGMENTS as usize]; // first path of each segment
        let (mut given, mut taken) = (0, 0);
        while taken < paths {
            totals.submissions += 1;
            assert!(totals.submissions < 5000, "the paths do not end: {:?}", self.read::<Counters>("counters"));
            here = choose(&here, &demand, resident, random);
            let present =
                |(i, chunk): (usize, &GpuChunk)| if here.contains(&(i as u32)) { *chunk } else { GpuChunk::default() };
            let table: Vec<GpuChunk> = self.scene.chunks.iter().enumerate().map(present).collect();
            self.set_chunks(&table);
            self.sort(flags, &table);
            let mut fresh = Vec::new();
            for (segment, first) in (0..).zip(&mut flying) {
                if first.is_none() && given < paths {
                    *first = Some(given);
                    fresh.push((segment, given));
                    given = paths.min(given + SEGMENT_SIZE);
                }
            }
            self.trace(&fresh, paths, flags, rounds);
            demand = self.read("demand");
            self.check_demand(&demand);
            let segments: Vec<Segment> = self.read("segments");
            while let Some(s) = flying.iter().position(|first| *first == Some(taken)) {
                if segments[s].alive > 0 {
                    break;
                }
                let push = self.segment_push(s as u32, taken, segments[s].count, flags);
                if flags.is_empty() {
                    let mut commands = self.gpu.commands("accumulate").expect("a list");
                    self.run(&mut commands, &passes::ACCUMULATE, push, Launch::Threads(SEGMENT_SIZE.min(PIXELS)));
                    commands.submit().expect("submitted");
                }
                taken += segments[s].count;
                flying[s] = None;
            }
        }
        totals.counters = self.read("counters")[0];
    }

    fn segment_push(&self, segment: u32, first: u32, count: u32, flags: PushFlags) -> Push {
        let q = Push::wave(self.address("frame"), u64::from(first), count, PIXELS);
        q.with(self.round, segment * SEGMENT_SIZE).flagged(flags)
    }

    /// Sends deferred rays on, and checks where they went.
    fn sort(&mut self, flags: PushFlags, table: &[GpuChunk]) {
        let q = Push::wave(self.address("frame"), 0, 0, PIXELS).with(self.round, 0).flagged(flags);
        let before = self.waiting();
        let old: Counters = self.read("counters")[0];
        self.clear(&["counts"]);
        let mut commands = self.gpu.commands("sort").expect("a list");
        let c = &mut commands;
        self.run(c, &passes::SORT_DEFERRED_COUNT, q, Launch::Indirect(Counters::DEFERRED_ARGS));
        self.run(
            c,
            &passes::SORT_DEFERRED_SCAN,
            q.with(q.round, abi::SCAN_BLOCKS),
            Launch::Groups(sort_blocks(CHUNKS)),
        );
        self.run(c, &passes::SORT_DEFERRED_SCAN, q.with(q.round, abi::SCAN_SUMS), Launch::Groups(1));
        self.run(c, &passes::SORT_DEFERRED_SCATTER, q, Launch::Indirect(Counters::DEFERRED_ARGS));
        commands.submit().expect("submitted");
        let new: Counters = self.read("counters")[0];
        let parity = (self.round & 1) as usize;
        let ready = |chunks: &[u32], shadow: bool| {
            let asked = if shadow { chunks } else { &chunks[..1] };
            asked.iter().copied().find(|chunk| table[*chunk as usize].nodes != 0)
        };
        let (mut stay, mut go) = (Vec::new(), [Vec::new(), Vec::new()]);
        for (entry, chunks) in &before {
            let shadow = entry & SHADOW_BIT != 0;
            match ready(chunks, shadow) {
                Some(chunk) => go[usize::from(shadow)].push((chunk, entry & !SHADOW_BIT)),
                None => stay.push(*entry),
            }
        }
        let queues: [Vec<u32>; 2] = [self.read(["queue 0", "queue 1"][parity]), self.read("shadow queue")];
        let ranges = [(old.ray_count[parity], new.ray_count[parity]), (old.shadow_count, new.shadow_count)];
        for kind in 0..2 {
            let queue = &queues[kind][ranges[kind].0 as usize..ranges[kind].1 as usize];
            let chunk_of: HashMap<u32, u32> = go[kind].iter().map(|(chunk, path)| (*path, *chunk)).collect();
            let mut sent: Vec<(u32, u32)> = queue.iter().map(|path| (chunk_of[path], *path)).collect();
            assert!(sent.is_sorted_by_key(|(chunk, _)| *chunk), "rays of a chunk are side by side: {sent:?}");
            sent.sort_unstable();
            go[kind].sort_unstable();
            assert_eq!(sent, go[kind], "the rays that may go on do, once each");
        }
        let mut left: Vec<u32> = self.waiting().into_iter().map(|(entry, _)| entry).collect();
        left.sort_unstable();
        stay.sort_unstable();
        assert_eq!(left, stay, "the others wait on");
    }

    /// The deferred rays and the chunks on their lists.
    fn waiting(&self) -> Vec<(u32, Vec<u32>)> {
        let counters: Counters = self.read("counters")[0];
        let list = counters.deferred_parity as usize;
        let entries: Vec<u32> = self.read(["deferred 0", "deferred 1"][list]);
        let flags = [
            self.read::<[u32; 12]>("rays").iter().map(|ray| ray[11]).collect::<Vec<u32>>(),
            self.read::<[u32; 16]>("shadow_rays").iter().map(|ray| ray[11]).collect(),
        ];
        let pending: [Vec<abi::Pending>; 2] = [self.read("pending"), self.read("shadow pending")];
        let lists = |entry: &u32| {
            let (kind, path) = (usize::from(entry & SHADOW_BIT != 0), (entry & !SHADOW_BIT) as usize);
            let count = (flags[kind][path] >> 4 & 7) as usize;
            let keys = &pending[kind][path];
            assert!(count >= 1, "a ray waits for something");
            assert!(keys.entry[..count].is_sorted(), "nearest first: {keys:?}");
            let instances = &keys.chunk_instance[..count];
            (*entry, instances.iter().map(|i| self.scene.chunk_of[*i as usize]).collect())
        };
        entries[..counters.deferred_count[list] as usize].iter().map(lists).collect()
    }

    fn trace(&mut self, fresh: &[(u32, u32)], paths: u32, flags: PushFlags, rounds: u32) {
        let mut commands = self.gpu.commands("trace").expect("a list");
        let generate = if flags.is_empty() { &passes::GENERATE_CAMERA_RAYS } else { &passes::GENERATE_AOV_RAYS };
        for (segment, first) in fresh {
            let count = SEGMENT_SIZE.min(paths - first);
            let push = self.segment_push(*segment, *first, count, flags);
            self.run(&mut commands, generate, push, Launch::Threads(count));
        }
        let q = Push::wave(self.address("frame"), 0, 0, PIXELS).flagged(flags);
        for _ in 0..rounds {
            self.round(&mut commands, q.with(self.round, 0));
            self.round += 1;
        }
        self.run(&mut commands, &passes::PREPARE_DISPATCH, q.with(self.round, abi::PREPARE_DEMAND), Launch::Threads(1));
        let demand = &self.buffers["demand"];
        commands.fill(demand, 0, demand.size(), 0);
        self.run(&mut commands, &passes::COUNT_DEMAND, q, Launch::Indirect(Counters::DEFERRED_ARGS));
        commands.submit().expect("submitted");
    }

    fn check_demand(&self, demand: &[u32]) {
        let mut expected = vec![0; 2 * CHUNKS as usize];
        for (_, chunks) in self.waiting() {
            for (i, chunk) in chunks.iter().enumerate() {
                expected[*chunk as usize + if i == 0 { 0 } else { CHUNKS as usize }] += 1;
            }
        }
        assert_eq!(demand, expected, "demand is what the lists say");
    }
}

#[derive(Clone, Copy)]
enum Launch {
    Threads(u32),
    Groups(u32),
    Indirect(u64),
}

/// The next chunks: the one most waited for, some of those before, and some at random.
fn choose(here: &[u32], demand: &[u32], resident: usize, random: &mut Random) -> Vec<u32> {
    let most = (0..CHUNKS).max_by_key(|chunk| demand[*chunk as usize]);
    let mut next: Vec<u32> = most.into_iter().collect();
    for chunk in here {
        if random.word() % 3 == 0 && !next.contains(chunk) {
            next.push(*chunk);
        }
    }
    while next.len() < resident {
        let chunk = random.word() % CHUNKS;
        if !next.contains(&chunk) {
            next.push(chunk);
        }
    }
    next.truncate(resident);
    next
}
