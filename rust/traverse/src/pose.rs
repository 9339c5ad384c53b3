// SPDX-License-Identifier: Apache-2.0
//! The triangles of a mesh at a time of the shutter: geometry/pose.glsl, operation by operation. Pure, any thread.

use crate::scene::TraversalScene;
use crate::vector::V3;
use oocpt_abi::{Features, GpuMesh, GpuPoint, GpuTriangle, LeafType, MESH_KEYS_SHIFT, MeshFlags};
use oocpt_gpu::{HostBytes, HostSpan};

/// The arrays of the two keys that a time is between.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeshPose<'v> {
    pub(crate) triangles: HostBytes<'v>,
    later: HostBytes<'v>,
    /// Of the way from one to the other.
    part: f32,
    pub(crate) moves: bool,
    /// Items are points, whose radii these are.
    pub(crate) of_points: bool,
    radii: HostBytes<'v>,
    /// From a point to the next one; 0: all have the same radius.
    radius_stride: usize,
}

impl<'v> MeshPose<'v> {
    pub(crate) const NONE: Self = Self {
        triangles: HostBytes::NONE,
        later: HostBytes::NONE,
        part: 0.0,
        moves: false,
        of_points: false,
        radii: HostBytes::NONE,
        radius_stride: 0,
    };

    /// The vertices of an item, and its subset and sides.
    #[inline(always)]
    pub(crate) fn item(&self, index: u32) -> Option<([V3; 3], u32)> {
        if self.of_points {
            return self.ball(index as usize).map(|(center, r)| ([center, center, V3([r, r, 0.0])], 0));
        }
        let item = self.triangles.get::<GpuTriangle>(index as usize)?;
        let vertices = [V3(item.v0), V3(item.v1), V3(item.v2)];
        Some((if self.moves { self.posed(vertices, index) } else { vertices }, item.subset_and_sides))
    }

    /// Centre and radius of a point.
    #[inline(always)]
    pub(crate) fn ball(&self, index: usize) -> Option<(V3, f32)> {
        let mut center = V3(self.triangles.get::<GpuPoint>(index)?.center);
        let mut radius: f32 = self.radii.get(index * self.radius_stride)?;
        if let Some(to) = self.later.get::<GpuPoint>(index).filter(|_| self.moves) {
            center = V3([0, 1, 2].map(|k| center.0[k] + self.part * (to.center[k] - center.0[k])));
            if self.radius_stride != 0 {
                let to: f32 = self.radii.get(index * self.radius_stride + 1)?;
                radius += self.part * (to - radius);
            }
        }
        Some((center, radius))
    }

    /// The corners of triangle `index`, which are `from` at the first of both keys.
    #[inline(always)]
    pub(crate) fn posed(&self, from: [V3; 3], index: u32) -> [V3; 3] {
        let Some(to) = self.later.get::<GpuTriangle>(index as usize) else { return from };
        let mix = |a: V3, b: [f32; 3]| V3([0, 1, 2].map(|k| a.0[k] + self.part * (b[k] - a.0[k])));
        [mix(from[0], to.v0), mix(from[1], to.v1), mix(from[2], to.v2)]
    }
}

impl<'v> TraversalScene<'v> {
    /// The triangles of a mesh at a time. `near`: where items were found last.
    #[inline(always)]
    pub(crate) fn pose_of(&self, mesh: &GpuMesh, time: f32, near: &mut HostSpan<'v>) -> MeshPose<'v> {
        let still = MeshPose { triangles: self.view.bytes_near(mesh.triangles, near), ..MeshPose::NONE };
        if self.special.features.intersects(Features::POINTS | Features::DEFORMATION) {
            return self.pose_of_others(mesh, time, still);
        }
        still
    }

    #[inline(never)]
    fn pose_of_others(&self, mesh: &GpuMesh, time: f32, mut still: MeshPose<'v>) -> MeshPose<'v> {
        let keys = (mesh.flags >> MESH_KEYS_SHIFT) & 31;
        still.of_points = self.has(Features::POINTS) && LeafType::number_of(mesh.flags) == LeafType::POINT.number;
        let item_bytes = if still.of_points { size_of::<GpuPoint>() } else { size_of::<GpuTriangle>() };
        let stride = u64::from(mesh.triangle_count) * item_bytes as u64;
        let mut radii = 0;
        if still.of_points {
            radii = mesh.triangles.wrapping_add(u64::from(keys.max(1)) * stride + u64::from(4 * keys));
            let has_own = mesh.flags & MeshFlags::OWN_RADII.bits() != 0;
            still.radius_stride = if has_own { keys.max(1) as usize } else { 0 };
            still.radii = self.view.bytes(radii);
        }
        if !self.has(Features::DEFORMATION) || keys < 2 {
            return still;
        }
        let times = self.view.bytes(mesh.triangles.wrapping_add(u64::from(keys) * stride));
        let at = |key: u32| times.get::<f32>(key as usize).unwrap_or(0.0);
        let mut key = 0;
        while key + 2 < keys && at(key + 1) <= time {
            key += 1;
        }
        let begin = at(key);
        let part = ((time - begin) / (at(key + 1) - begin)).clamp(0.0, 1.0);
        let from = mesh.triangles.wrapping_add(u64::from(key) * stride);
        if still.radius_stride != 0 {
            still.radii = self.view.bytes(radii.wrapping_add(u64::from(4 * key)));
        }
        let later = self.view.bytes(from.wrapping_add(stride));
        MeshPose { triangles: self.view.bytes(from), later, part, moves: true, ..still }
    }
}
