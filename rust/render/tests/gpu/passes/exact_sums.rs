// SPDX-License-Identifier: Apache-2.0
//! The sums of `sum_exact` are those of `oocpt_film::ExactSums`, bit for bit, whatever the samples are.

use super::handmade_scene::Random;
use super::{close_device, open};
use bytemuck::Zeroable;
use oocpt_abi::{
    ERROR_GROUPS, ERROR_SUMS_BYTES, ExactPixel, Features, FilmPixel, FrameConstants, PushConstants, groups,
};
use oocpt_film::ExactSums as _;
use oocpt_gpu::{Buffer, BufferUsage, Gpu, Pipeline};
use oocpt_shaders::passes;
use std::sync::Arc;
use std::time::Duration;

const SIZE: [u32; 2] = [24, 16];
const PIXELS: u32 = SIZE[0] * SIZE[1];
/// Samples of a pixel; a wave ends in the midst of one.
const SAMPLES: u32 = 37;

/// Floats where rounding, windows and signs go wrong, and any others.
fn hostile(random: &mut Random) -> f32 {
    let bits = random.word();
    match random.word() % 8 {
        0 => [0.0, -0.0, 1.0, -1.0, f32::MIN_POSITIVE, f32::MAX, f32::MIN, f32::EPSILON][bits as usize % 8],
        1 => f32::from_bits(bits & 0x807f_ffff),                // subnormal
        2 => f32::from_bits(bits & 0xff80_0000 & !0x4000_0000), // powers of two
        3 => [f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1e38, 3.4e38, 1e-38, 1e-45, 2e6][bits as usize % 8],
        4 => f32::from_bits(bits & 0x00ff_ffff | 0x3f00_0000), // near one
        _ => f32::from_bits(bits),
    }
}

/// A float whose exponent is within a few of one.
fn near(random: &mut Random, exponent: u32) -> f32 {
    let exponent = (exponent + random.word() % 24).saturating_sub(12).min(254);
    f32::from_bits(random.word() & 0x807f_ffff | exponent << 23)
}

/// The sums of the device over waves of samples.
fn sums(gpu: &Arc<Gpu>, samples: &[[f32; 4]], waves: &[u32]) -> Vec<ExactPixel> {
    let behind = u64::from(PIXELS) * size_of::<FilmPixel>() as u64 + u64::from(ERROR_GROUPS * ERROR_SUMS_BYTES);
    let bytes = u64::from(PIXELS) * size_of::<ExactPixel>() as u64;
    let film = Buffer::new(gpu, "film", behind + bytes, BufferUsage::Device).expect("small");
    let result = Buffer::new(gpu, "result", bytes, BufferUsage::Readback).expect("small");
    let radiance = Buffer::new(gpu, "radiance", 16 * samples.len() as u64, BufferUsage::Upload).expect("small");
    radiance.write(0, bytemuck::cast_slice(samples)).expect("mapped");
    let block = Buffer::new(gpu, "frame", size_of::<FrameConstants>() as u64, BufferUsage::Upload).expect("small");
    let frame = FrameConstants {
        film: film.address(),
        radiance: radiance.address(),
        width: SIZE[0],
        height: SIZE[1],
        ..FrameConstants::zeroed()
    };
    block.write(0, bytemuck::bytes_of(&frame)).expect("mapped");
    let [low, high, top] = Features::empty().constants();
    let spec = [(0, 1), (1, 64), low, high, top];
    let module = &passes::SUM_EXACT;
    let pipeline = Pipeline::new(gpu, module.name, &module.specialised(&spec), &spec, 32).expect("it compiles");
    let mut commands = gpu.commands("sums").expect("a list");
    commands.fill(&film, 0, film.size(), 0);
    let mut first = 0;
    for count in waves {
        // All samples are in one array, so a wave begins at its own.
        let push = PushConstants::wave(block.address(), first.into(), *count, PIXELS).with(0, first);
        commands.dispatch(&pipeline, bytemuck::bytes_of(&push), groups(u64::from((*count).min(PIXELS))));
        first += count;
    }
    commands.copy(&film, behind, &result, 0, bytes);
    assert!(commands.submit().expect("submitted").wait(Duration::from_secs(60)).expect("alive"), "it ends");
    let mut sums = vec![ExactPixel::zeroed(); PIXELS as usize];
    result.read(0, bytemuck::cast_slice_mut(&mut sums)).expect("mapped");
    sums
}

#[test]
fn the_devices_exact_sums_are_those_of_the_host() {
    let gpu = open();
    let mut random = Random(7);
    let mut samples = vec![[0.0_f32; 4]; (PIXELS * SAMPLES) as usize];
    for (sample, path) in samples.iter_mut().zip((0..PIXELS).cycle()) {
        *sample = std::array::from_fn(|_| match path % 4 {
            // Of one magnitude and sign: sums carry.
            0 => 0.999_999_9,
            // Of a few magnitudes, from the smallest to the largest by the pixel: windows move.
            1 => near(&mut random, path * 256 / PIXELS),
            // Without normal numbers.
            2 => f32::from_bits(random.word() & 0x807f_ffff),
            _ => hostile(&mut random),
        });
    }
    // Paths take pixels in an order of their own; the numbers are sums of one limb.
    let numbers: Vec<[f32; 4]> = (0..PIXELS).map(|path| [path as f32; 4]).collect();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small whole numbers")]
    let order: Vec<usize> = sums(&gpu, &numbers, &[PIXELS]).iter().map(|sum| sum.mean()[0] as usize).collect();
    let mut by_path = vec![ExactPixel::zeroed(); PIXELS as usize];
    for (sample, at) in samples.iter().zip((0..PIXELS as usize).cycle()) {
        by_path[at].add_sample(*sample);
    }
    let expected: Vec<ExactPixel> = order.iter().map(|path| by_path[*path]).collect();
    assert!(order.iter().collect::<std::collections::BTreeSet<_>>().len() == order.len(), "each pixel once");
    let all = PIXELS * SAMPLES;
    for waves in [vec![all], vec![PIXELS - 5, 3 * PIXELS + 7, 1, all - 4 * PIXELS - 3]] {
        let found = sums(&gpu, &samples, &waves);
        for (pixel, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_eq!(found, expected, "pixel {pixel}, waves {waves:?}");
        }
    }
    close_device(&gpu);
}
