// SPDX-License-Identifier: Apache-2.0
//! Moving placements at the time of a path (`geometry/motion.glsl`, with the same operations). Pure, any thread.

use crate::scene::TraversalScene;
use crate::vector::{AffineRows, V3, apply_columns, dot3};
use oocpt_abi::sampler::{pixel_seed, sample_1d};
use oocpt_abi::{Features, GpuInstance, GpuMotionKey, TARGET_ASSEMBLY, TARGET_MOVING, TIME_SET};
use oocpt_gpu::HostBytes;

/// Units of 16 bytes in a key.
const KEY_QUADS: usize = 4;
const _: () = assert!(size_of::<GpuMotionKey>() == 16 * KEY_QUADS, "a key has so many units");

impl TraversalScene<'_> {
    /// Time of a path, as `path_time` of the shaders; 0 if nothing moves.
    #[inline(always)]
    pub(crate) fn path_time(&self, path: u32) -> f32 {
        if !(self.has(Features::MOTION) || self.has(Features::DEFORMATION)) {
            return 0.0;
        }
        self.shutter_time(path)
    }

    #[inline(never)]
    fn shutter_time(&self, path: u32) -> f32 {
        if self.is_of_aovs() {
            return 0.5;
        }
        let (seed, pixel, sample) = self.sample_of(path);
        let [x, y] = self.pixel_position(pixel);
        sample_1d(sample, TIME_SET, pixel_seed(x, y, seed))
    }

    /// Pixel of a path in the picture, as `pixel_position` of wavefront/wavefront.glsl.
    pub(crate) fn pixel_position(&self, index: u32) -> [u32; 2] {
        let (width, height) = (self.frame.width.max(1), self.frame.height);
        let strip_size = width.wrapping_mul(8).max(1);
        let strip = index / strip_size;
        let rows = height.wrapping_sub(8 * strip).clamp(1, 8);
        let in_strip = index % strip_size;
        let tile = in_strip / (8 * rows);
        let columns = width.wrapping_sub(8 * tile).clamp(1, 8);
        let in_tile = in_strip % (8 * rows);
        let [x, y] = [8 * tile + in_tile % columns, 8 * strip + in_tile / columns];
        [self.frame.window_x.wrapping_add(x), self.frame.window_y.wrapping_add(y)]
    }

    /// Number of a target, as `TARGET_NUMBER` of the shaders.
    #[inline(always)]
    pub(crate) fn target_number(&self, target: u32) -> u32 {
        let flags = if self.has(Features::MOTION) { TARGET_ASSEMBLY | TARGET_MOVING } else { TARGET_ASSEMBLY };
        target & !flags
    }

    /// Map of a record of `instances`, as `placed_map` of the shaders; `None` if its keys are not in memory.
    #[inline(always)]
    pub(crate) fn placed_map(&self, instances: HostBytes<'_>, record: &GpuInstance, time: f32) -> Option<AffineRows> {
        if self.has(Features::MOTION) && record.target & TARGET_MOVING != 0 {
            return moving_map(instances, record, time);
        }
        Some(record.object_from_parent)
    }
}

/// Map of a moving record at a time, as `moving_map` of the shaders.
#[inline(never)]
fn moving_map(instances: HostBytes<'_>, record: &GpuInstance, time: f32) -> Option<AffineRows> {
    let [first, count, ..] = record.object_from_parent[0].map(|word| word.to_bits() as usize);
    let quad = |at: usize| instances.get::<[f32; 4]>(first + at);
    let key = |at: usize| -> Option<GpuMotionKey> {
        let at = at * KEY_QUADS;
        Some(bytemuck::cast([quad(at)?, quad(at + 1)?, quad(at + 2)?, quad(at + 3)?]))
    };
    let mut at = 0;
    while at + 2 < count && key(at + 1)?.time <= time {
        at += 1;
    }
    Some(inverse_between(&key(at)?, &key(at + 1)?, time))
}

/// Sine, as `quadrant_sine` of the shaders.
fn quadrant_sine(x: f32) -> f32 {
    let y = x * x;
    let high = y * (y * -2.505_210_8e-8 + 2.755_731_9e-6) + -1.984_127e-4;
    x * (y * (y * (y * high + 8.333_333e-3) + -1.666_666_7e-1) + 1.0)
}

/// Inverse map between two keys, as `inverse_map` of the shaders.
fn inverse_between(a: &GpuMotionKey, b: &GpuMotionKey, time: f32) -> AffineRows {
    let f = ((time - a.time) / (b.time - a.time)).clamp(0.0, 1.0);
    let mix = |a: [f32; 3], b: [f32; 3]| f * (V3(b) - V3(a)) + V3(a);
    let (stretch, shear) = (mix(a.stretch, b.stretch), mix(a.shear, b.shear));
    let translation = mix(a.translation, b.translation);
    let weights = if a.half_angle > 0.0 {
        [quadrant_sine((1.0 - f) * a.half_angle), quadrant_sine(f * a.half_angle)]
    } else {
        [1.0 - f, f]
    };
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a.rotation, b.rotation);
    let q = weights[0] * V3([ax, ay, az]) + weights[1] * V3([bx, by, bz]);
    let (x, y, z, w) = (q[0], q[1], q[2], weights[0] * aw + weights[1] * bw);
    let s = (2.0 / (w * w + dot3(q, q))) * q;
    let turn = [
        V3([1.0 - (y * s[1] + z * s[2]), x * s[1] + w * s[2], x * s[2] + -(w * s[1])]),
        V3([x * s[1] + -(w * s[2]), 1.0 - (x * s[0] + z * s[2]), y * s[2] + w * s[0]]),
        V3([x * s[2] + w * s[1], y * s[2] + -(w * s[0]), 1.0 - (x * s[0] + y * s[1])]),
    ];
    let size = stretch.largest();
    let (d, e) = (stretch.map(|v| v / size), shear.map(|v| v / size));
    let diagonal = V3([d[1] * d[2] + -(e[2] * e[2]), d[0] * d[2] + -(e[1] * e[1]), d[0] * d[1] + -(e[0] * e[0])]);
    let beside = V3([e[1] * e[2] + -(e[0] * d[2]), e[0] * e[2] + -(e[1] * d[1]), e[0] * e[1] + -(e[2] * d[0])]);
    let scale = 1.0 / ((d[0] * diagonal[0] + (e[0] * beside[0] + e[1] * beside[1])) * size);
    let row = |by: [f32; 3]| {
        let v = apply_columns(turn, scale * V3(by));
        [v[0], v[1], v[2], -dot3(v, translation)]
    };
    [
        row([diagonal[0], beside[0], beside[1]]),
        row([beside[0], diagonal[1], beside[2]]),
        row([beside[1], beside[2], diagonal[2]]),
    ]
}
