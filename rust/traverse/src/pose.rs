// SPDX-License-Identifier: Apache-2.0
//! The triangles of a mesh at a time of the shutter: include/pose.glsl, operation by operation. Pure, any thread.

use crate::scene::Scene;
use crate::vector::V3;
use oocpt_gpu::HostBytes;
use oocpt_shader_abi::{Features, GpuMesh, GpuTriangle, MESH_KEYS_SHIFT};

/// The arrays of the two keys that a time is between.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose<'v> {
    pub(crate) triangles: HostBytes<'v>,
    later: HostBytes<'v>,
    /// Of the way from one to the other.
    part: f32,
    pub(crate) moves: bool,
}

impl<'v> Pose<'v> {
    pub(crate) const NONE: Self = Self { triangles: HostBytes::NONE, later: HostBytes::NONE, part: 0.0, moves: false };

    /// The corners of triangle `index`, which are `from` at the first of both keys.
    #[inline(always)]
    pub(crate) fn posed(&self, from: [V3; 3], index: u32) -> [V3; 3] {
        let Some(to) = self.later.get::<GpuTriangle>(index as usize) else { return from };
        let mix = |a: V3, b: [f32; 3]| V3([0, 1, 2].map(|k| a.0[k] + self.part * (b[k] - a.0[k])));
        [mix(from[0], to.v0), mix(from[1], to.v1), mix(from[2], to.v2)]
    }
}

impl<'v> Scene<'v> {
    /// The triangles of a mesh at a time.
    pub(crate) fn pose_of(&self, mesh: &GpuMesh, time: f32) -> Pose<'v> {
        let still = Pose { triangles: self.view.bytes(mesh.triangles), ..Pose::NONE };
        let keys = (mesh.flags >> MESH_KEYS_SHIFT) & 31;
        if !self.has(Features::DEFORMATION) || keys < 2 {
            return still;
        }
        let stride = u64::from(mesh.triangle_count) * size_of::<GpuTriangle>() as u64;
        let times = self.view.bytes(mesh.triangles.wrapping_add(u64::from(keys) * stride));
        let at = |key: u32| times.get::<f32>(key as usize).unwrap_or(0.0);
        let mut key = 0;
        while key + 2 < keys && at(key + 1) <= time {
            key += 1;
        }
        let begin = at(key);
        let part = ((time - begin) / (at(key + 1) - begin)).clamp(0.0, 1.0);
        let from = mesh.triangles.wrapping_add(u64::from(key) * stride);
        Pose { triangles: self.view.bytes(from), later: self.view.bytes(from.wrapping_add(stride)), part, moves: true }
    }
}
