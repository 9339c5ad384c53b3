// SPDX-License-Identifier: Apache-2.0
//! Evaluates if a surface that a walk meets exists by its displayOpacity (traversal/opacity.glsl), with the seed of the
//! decision (`traversal/opacity_seed.glsl`). Any thread.

use crate::primvar::indices;
use crate::scene::TraversalScene;
use crate::walk::{CandidateSurface, RayTraversal};
use oocpt_abi::sampler::{combine, hash, unit_float};
use oocpt_abi::{
    AdaptiveSampling, Features, MeshFlags, NAME_DISPLAY_OPACITY, NO_MATERIAL, PathSegment, STREAM_BIT, STREAM_SEED,
    SUBSET_MASK, unpack_band,
};
use oocpt_gpu::HostBytes;

impl TraversalScene<'_> {
    /// Seed of a ray of a path: `ray` is twice the bounce, plus one for shadow rays.
    pub(crate) fn opacity_seed(&self, path: u32, ray: u32) -> u32 {
        if !self.special.features.intersects(Features::OPACITY | Features::CUTOUTS) {
            return 0;
        }
        let (seed, pixel, sample) = self.sample_of(path);
        combine(combine(combine(seed, self.whole_trace_order(pixel)), sample), ray)
    }

    /// Place of a pixel of the window in the trace order of the whole picture, as `whole_trace_order` of the shaders.
    fn whole_trace_order(&self, pixel: u32) -> u32 {
        let (width, height) = (self.frame.picture_width, self.frame.picture_height);
        if (width, height) == (self.frame.width, self.frame.height) {
            return pixel;
        }
        let [x, y] = self.pixel_position(pixel);
        let rows = height.wrapping_sub(y - y % 8).min(8);
        let columns = width.wrapping_sub(x - x % 8).min(8);
        let strip = (y - y % 8).wrapping_mul(width);
        strip.wrapping_add((x - x % 8) * rows).wrapping_add((y % 8) * columns).wrapping_add(x % 8)
    }

    /// Seed, pixel and sample of a path (`path_seed`, `path_pixel`, `path_sample` of wavefront/wavefront.glsl).
    pub(crate) fn sample_of(&self, path: u32) -> (u32, u32, u32) {
        let (mut first_pixel, mut first_sample, mut i) = (self.push.first_pixel, self.push.first_sample, path);
        if self.has(Features::STREAMING) {
            let place = self.path_place(path);
            let number = place / self.streaming.segment_size.max(1);
            let at = number as usize * 4;
            let segments = self.view.words(self.streaming.segments);
            let segment =
                PathSegment { first_pixel: segments.load(at), first_sample: segments.load(at + 1), count: 0, alive: 0 };
            (first_pixel, first_sample) = (segment.first_pixel, segment.first_sample);
            i = place.wrapping_sub(number.wrapping_mul(self.streaming.segment_size));
        }
        let place = first_pixel.wrapping_add(i);
        if !self.has(Features::ADAPTIVE) || self.is_of_aovs() {
            let pixels = self.frame.width.wrapping_mul(self.frame.height).max(1);
            return (self.frame.seed, place % pixels, first_sample.wrapping_add(place / pixels));
        }
        let Some(adaptive) = self.view.bytes(self.frame.adaptive).get::<AdaptiveSampling>(0) else { return (0, 0, 0) };
        let (band, row) = unpack_band(first_sample);
        let width = adaptive.width.get(band as usize).copied().unwrap_or(1).max(1);
        let entries = self.view.bytes(adaptive.entries);
        let [pixel, sample] = entries.get::<[u32; 2]>((place % width) as usize).unwrap_or_default();
        let seed = self.frame.seed ^ if pixel & STREAM_BIT != 0 { STREAM_SEED } else { 0 };
        (seed, pixel & !STREAM_BIT, sample.wrapping_add(row).wrapping_add(place / width))
    }

    /// Streaming: place to which the radiance of the path in a slot is written when it ends.
    pub(crate) fn path_place(&self, path: u32) -> u32 {
        self.view.bytes(self.streaming.places).get(path as usize).unwrap_or(0)
    }
}

/// Value of an attribute, as `attribute_float` of geometry/attribute.glsl.
fn attribute(values: HostBytes<'_>, corners: HostBytes<'_>, rate: u32, triangle: u32, uv: [f32; 2]) -> Option<f32> {
    let at = |index: u32| values.get::<f32>(index as usize);
    let [x, y, z] = indices(corners, rate, triangle)?;
    if x == y && y == z {
        return at(x);
    }
    Some(at(x)? * (1.0 - uv[0] - uv[1]) + at(y)? * uv[0] + at(z)? * uv[1])
}

impl<const ANY_HIT: bool> RayTraversal<'_, '_, ANY_HIT> {
    /// Returns true if the surface exists for this ray.
    #[inline(never)]
    pub(crate) fn is_opaque(&self, surface: CandidateSurface, uv: [f32; 2]) -> bool {
        let CandidateSurface { item: triangle, number, subset_and_sides } = surface;
        let scene = self.scene;
        let of_mesh = self.mesh.flags & MeshFlags::HAS_OPACITIES.bits() != 0;
        if !of_mesh && !scene.has(Features::INSTANCE_OPACITY) {
            return true;
        }
        let subset = subset_and_sides & SUBSET_MASK;
        if scene.has(Features::MATERIALS) && scene.material_slot(self.instance.prim_id, subset) != NO_MATERIAL {
            return true;
        }
        let found = if of_mesh {
            let (values, corners) = (scene.view.bytes(self.mesh.opacities), scene.view.bytes(self.mesh.corner_indices));
            attribute(values, corners, (self.mesh.flags >> 4) & 3, triangle, uv)
        } else {
            self.instance_primvar(NAME_DISPLAY_OPACITY).map(|value| value[0])
        };
        let Some(opacity) = found else { return true };
        if scene.is_of_aovs() {
            return opacity > 0.0;
        }
        let records = &self.chain[..=self.level_index()];
        let ids = records.iter().fold(combine(self.world.seed, self.chunk_instance), |h, &record| combine(h, record));
        unit_float(hash(combine(ids, number))) < opacity
    }
}
