// SPDX-License-Identifier: Apache-2.0
//! Known answers of the passes that estimate the worth of the rays that wait for a chunk, on invented rays and
//! radiances.

use super::{close_device, open};
use bytemuck::{Pod, Zeroable};
use oocpt_abi::{
    Features, FilmPixel, FrameConstants, GpuChunkInstance, NO_MESH, PathSegment, PendingItems, PushConstants,
    RouletteStats, SHADOW_BIT, StreamingPointers, WORTH_MUST, WORTH_ONE, WORTH_SUMS, WavefrontCounters,
};
use oocpt_gpu::{Buffer, BufferUsage, Gpu, Pipeline};
use oocpt_shaders::{ShaderModule, passes};
use std::sync::Arc;
use std::time::Duration;

const SIZE: [u32; 2] = [16, 8];
const PIXELS: u32 = 128;
const SAMPLES: u32 = 4;
/// A path has the slot of its place.
const PATHS: u32 = PIXELS * SAMPLES;
const SEGMENT: u32 = 64;
const CHUNKS: u32 = 8;
/// The constant that `measure_error` adds to a squared level.
const EPSILON: f64 = 1e-2;

/// Waiting rays, and the contributions of paths so far.
struct Waiting {
    roulette: RouletteStats,
    radiance: Vec<f32>,
    entries: Vec<u32>,
    rays: Vec<[u32; 12]>,
    shadow_rays: Vec<[u32; 16]>,
    paths: Vec<[f32; 4]>,
    /// Chunk of each path's rays.
    pending: Vec<PendingItems>,
}

impl Waiting {
    /// No ray waits, and every path has contributed 1.
    fn nobody() -> Self {
        Self {
            roulette: RouletteStats { mean: 1.0, second_moment: 1.0, ..RouletteStats::default() },
            radiance: vec![1.0; PATHS as usize],
            entries: Vec::new(),
            rays: vec![[0; 12]; PATHS as usize],
            shadow_rays: vec![[0; 16]; PATHS as usize],
            paths: vec![[0.0; 4]; PATHS as usize],
            pending: vec![PendingItems::default(); PATHS as usize],
        }
    }

    /// A shadow ray of a pixel waits for a chunk.
    fn shadow(&mut self, chunk: u32, pixel: u32, sample: u32, contribution: f32) {
        let path = sample * PIXELS + pixel;
        self.shadow_rays[path as usize][12..15].fill(contribution.to_bits());
        self.wait(chunk, path, SHADOW_BIT);
    }

    /// A closest ray of a pixel waits for a chunk.
    fn closest(&mut self, chunk: u32, pixel: u32, sample: u32, (bounce, throughput): (u32, f32)) {
        let path = sample * PIXELS + pixel;
        self.rays[path as usize][3] = bounce;
        self.paths[path as usize] = [throughput; 4];
        self.wait(chunk, path, 0);
    }

    fn wait(&mut self, chunk: u32, path: u32, kind: u32) {
        self.pending[path as usize].chunk_instance[0] = chunk;
        self.pending[path as usize].mesh[0] = NO_MESH;
        self.entries.push(path | kind);
    }

    /// Runs a pass; returns the worth of the chunks and the statistics of paths.
    fn run(&self, gpu: &Arc<Gpu>, module: &'static ShaderModule) -> (Vec<u32>, RouletteStats) {
        let mut kept = Vec::new();
        let mut upload = |bytes: &[u8]| {
            let buffer = Buffer::new(gpu, "made up", bytes.len().max(64) as u64, BufferUsage::Upload).expect("small");
            buffer.write(0, bytes).expect("mapped");
            kept.push(buffer);
            kept.last().map_or(0, Buffer::address)
        };
        let segments: Vec<PathSegment> = (0..PATHS / SEGMENT).map(|s| segment(s * SEGMENT)).collect();
        let places: Vec<u32> = (0..PATHS).collect();
        let radiance: Vec<[f32; 4]> = self.radiance.iter().map(|level| [*level; 4]).collect();
        let instances: Vec<GpuChunkInstance> =
            (0..CHUNKS).map(|chunk| GpuChunkInstance { chunk, ..GpuChunkInstance::zeroed() }).collect();
        let device = |bytes: usize| Buffer::new(gpu, "result", bytes as u64, BufferUsage::Device).expect("small");
        let [worth, sums, block] =
            [4 * CHUNKS as usize, 4 * WORTH_SUMS as usize, size_of::<RouletteStats>()].map(device);
        let mut counters = WavefrontCounters::zeroed();
        counters.deferred_count[0] = u32::try_from(self.entries.len()).expect("few");
        let streaming = StreamingPointers {
            segments: upload(bytemuck::cast_slice(&segments)),
            places: upload(bytemuck::cast_slice(&places)),
            ended_radiance: upload(bytemuck::cast_slice(&radiance)),
            deferred: [upload(bytemuck::cast_slice(&self.entries)), 0],
            pending: upload(bytemuck::cast_slice(&self.pending)),
            shadow_pending: upload(bytemuck::cast_slice(&self.pending)),
            roulette: block.address(),
            worth: worth.address(),
            worth_sums: sums.address(),
            segment_size: SEGMENT,
            segment_count: PATHS / SEGMENT,
            chunk_count: CHUNKS,
            first_tile: CHUNKS,
            slots: PATHS,
            unit_count: CHUNKS,
            ..StreamingPointers::zeroed()
        };
        let frame = FrameConstants {
            chunk_instances: upload(bytemuck::cast_slice(&instances)),
            rays: upload(bytemuck::cast_slice(&self.rays)),
            shadow_rays: upload(bytemuck::cast_slice(&self.shadow_rays)),
            paths: upload(bytemuck::cast_slice(&self.paths)),
            film: upload(bytemuck::cast_slice(&vec![FilmPixel::zeroed(); PIXELS as usize])),
            counters: upload(bytemuck::bytes_of(&counters)),
            streaming: upload(bytemuck::bytes_of(&streaming)),
            width: SIZE[0],
            height: SIZE[1],
            ..FrameConstants::zeroed()
        };
        let push = PushConstants::wave(upload(bytemuck::bytes_of(&frame)), 0, 0, PIXELS);
        let [low, high, top] = (Features::STREAMING | Features::ROULETTE).constants();
        let spec = [(0, 2), (1, 64), low, high, top];
        let pipeline = Pipeline::new(gpu, module.name, &module.specialised(&spec), &spec, 32).expect("it compiles");
        let mut commands = gpu.commands("roulette").expect("a list");
        commands.fill(&worth, 0, worth.size(), 0);
        commands.fill(&sums, 0, sums.size(), 0);
        commands.update(&block, 0, bytemuck::bytes_of(&self.roulette));
        let workgroups = u32::try_from(self.entries.len().div_ceil(64).max(1)).expect("few");
        commands.dispatch(&pipeline, bytemuck::bytes_of(&push), [workgroups, 1, 1]);
        let submission = commands.submit().expect("submitted");
        assert!(submission.wait(Duration::from_secs(60)).expect("alive"), "the pass ends");
        (read(gpu, &worth), read(gpu, &block)[0])
    }
}

/// The segment whose first place is `at`.
fn segment(at: u32) -> PathSegment {
    PathSegment { first_pixel: at % PIXELS, first_sample: at / PIXELS, count: SEGMENT, alive: 1 }
}

fn read<T: Pod>(gpu: &Arc<Gpu>, source: &Buffer) -> Vec<T> {
    let copy = Buffer::new(gpu, "copy", source.size(), BufferUsage::Readback).expect("small");
    let mut commands = gpu.commands("copy").expect("a list");
    commands.copy(source, 0, &copy, 0, source.size());
    assert!(commands.submit().expect("submitted").wait(Duration::from_secs(60)).expect("alive"), "the copy ends");
    copy.map(|bytes| bytemuck::pod_collect_to_vec(bytes)).expect("mapped")
}

/// Worth of the chunks, to the precision of the sums.
fn assert_worth(worth: &[u32], expected: &[(u32, f64)]) {
    for &(chunk, expected) in expected {
        let got = f64::from(worth[chunk as usize]) / f64::from(WORTH_ONE);
        assert!((got - expected).abs() <= 4e-3 * expected, "chunk {chunk}: {got}, not {expected}");
    }
}

#[test]
fn waiting_rays_of_a_pixel_add_before_squaring() {
    let gpu = open();
    let mut waiting = Waiting::nobody();
    for i in 0..SAMPLES {
        waiting.shadow(1, 5, i, 0.5);
        waiting.shadow(2, 16 + i, 2, 0.5);
    }
    waiting.shadow(3, 40, 0, 0.5);
    waiting.shadow(3, 40, 1, 0.25);
    waiting.shadow(3, 41, 1, 1.0);
    let (worth, _) = waiting.run(&gpu, &passes::ROULETTE_WORTH);
    let one = 0.25 / (1.0 + EPSILON);
    let several = (0.75 * 0.75 + 1.0) / (1.0 + EPSILON);
    assert_worth(&worth, &[(1, 16.0 * one), (2, 4.0 * one), (3, several), (0, 0.0)]);
    close_device(&gpu);
}

#[test]
fn worth_of_a_closest_hit_ray_is_throughput_times_mean_radiance() {
    let gpu = open();
    let mut waiting = Waiting::nobody();
    waiting.roulette.second_moment = 3.0;
    for i in 0..2 {
        waiting.closest(1, 5, i, (1, 0.5));
        waiting.closest(2, 50 + i, 0, (3, 0.5));
    }
    // A pixel of 0.1 in a picture of 1: relative to itself.
    for sample in 0..SAMPLES {
        waiting.radiance[(sample * PIXELS + 90) as usize] = 0.1;
    }
    waiting.shadow(3, 90, 1, 0.1);
    let (worth, _) = waiting.run(&gpu, &passes::ROULETTE_WORTH);
    // Their mean together, 1, squared, and twice the variance 2 of one.
    let (together, apart) = (1.0 + 2.0 * 0.25 * 2.0, 2.0 * 0.25 * 3.0);
    let dark = 0.01 / (0.01 + EPSILON);
    assert_worth(&worth, &[(1, together / (1.0 + EPSILON)), (2, apart / (1.0 + EPSILON)), (3, dark)]);
    close_device(&gpu);
}

#[test]
fn camera_rays_and_very_bright_rays_are_never_dropped() {
    let gpu = open();
    let mut waiting = Waiting::nobody();
    waiting.closest(1, 5, 0, (0, 1.0));
    waiting.shadow(2, 6, 0, 1000.0);
    waiting.shadow(3, 7, 0, f32::NAN);
    waiting.shadow(4, 8, 0, 1.0);
    let (worth, _) = waiting.run(&gpu, &passes::ROULETTE_WORTH);
    let must: Vec<bool> = worth.iter().map(|worth| worth & WORTH_MUST != 0).collect();
    assert_eq!(must, [false, true, true, true, false, false, false, false], "{worth:?}");
    close_device(&gpu);
}

#[test]
fn radiance_levels_and_variance_match_the_paths() {
    let gpu = open();
    let mut paths = Waiting::nobody();
    paths.roulette = RouletteStats::default();
    paths.radiance[PATHS as usize / 2..].fill(2.0);
    let (_, seen) = paths.run(&gpu, &passes::ROULETTE_LEVEL);
    assert!((seen.mean - 1.5).abs() < 1e-5 && (seen.second_moment - 2.5).abs() < 1e-5, "{seen:?}");
    // The mean of a pixel moved by 0.5 when its samples doubled; of that squared a half, for each of 4 paths.
    let expected = 0.5 * 4.0 * 0.25 / (2.25 + 0.01);
    assert!((seen.variance - expected).abs() < 1e-4 && seen.looks == 1, "{seen:?}, not {expected}");
    close_device(&gpu);
}
