// SPDX-License-Identifier: Apache-2.0
//! Whether a surface that a walk meets is there, by displayOpacity (traversal/opacity.glsl), and the seed that decides
//! (`include/opacity_seed.glsl`). Any thread.

use crate::sampler::{combine, hash, unit};
use crate::scene::Scene;
use crate::walk::Walk;
use oocpt_gpu::HostBytes;
use oocpt_shader_abi::{
    Adaptive, AttributeRate, Features, GpuAttribute, GpuInstance, GpuPrim, MAX_PRIM_ID, MeshFlags,
    NAME_DISPLAY_OPACITY, NO_MATERIAL, NO_NAME, NO_ROW, NO_VALUE, STREAM_BIT, STREAM_SEED, SUBSET_MASK, Segment,
    TARGET_ASSEMBLY, unpack_band,
};

impl Scene<'_> {
    /// The seed of a ray of a path: `ray` is twice the bounce, and one more for shadow rays.
    pub(crate) fn opacity_seed(&self, path: u32, ray: u32) -> u32 {
        if !self.special.features.intersects(Features::OPACITY | Features::CUTOUTS) {
            return 0;
        }
        let (seed, pixel, sample) = self.sample_of(path);
        combine(combine(combine(seed, pixel), sample), ray)
    }

    /// Seed, pixel and sample of a path (`path_seed`, `path_pixel`, `path_sample` of include/wavefront.glsl).
    pub(crate) fn sample_of(&self, path: u32) -> (u32, u32, u32) {
        let (mut first_pixel, mut first_sample, mut i) = (self.push.first_pixel, self.push.first_sample, path);
        if self.has(Features::STREAMING) {
            let place = self.path_place(path);
            let number = place / self.streaming.segment_size.max(1);
            let at = number as usize * 4;
            let segments = self.view.words(self.streaming.segments);
            let segment =
                Segment { first_pixel: segments.load(at), first_sample: segments.load(at + 1), count: 0, alive: 0 };
            (first_pixel, first_sample) = (segment.first_pixel, segment.first_sample);
            i = place.wrapping_sub(number.wrapping_mul(self.streaming.segment_size));
        }
        let place = first_pixel.wrapping_add(i);
        if !self.has(Features::ADAPTIVE) || self.is_of_aovs() {
            let pixels = self.frame.width.wrapping_mul(self.frame.height).max(1);
            return (self.frame.seed, place % pixels, first_sample.wrapping_add(place / pixels));
        }
        let Some(adaptive) = self.view.bytes(self.frame.adaptive).get::<Adaptive>(0) else { return (0, 0, 0) };
        let (band, row) = unpack_band(first_sample);
        let width = adaptive.width.get(band as usize).copied().unwrap_or(1).max(1);
        let entries = self.view.bytes(adaptive.entries);
        let [pixel, sample] = entries.get::<[u32; 2]>((place % width) as usize).unwrap_or_default();
        let seed = self.frame.seed ^ if pixel & STREAM_BIT != 0 { STREAM_SEED } else { 0 };
        (seed, pixel & !STREAM_BIT, sample.wrapping_add(row).wrapping_add(place / width))
    }

    /// Streaming: where the radiance of the path in a slot goes when it ends.
    pub(crate) fn path_place(&self, path: u32) -> u32 {
        self.view.bytes(self.streaming.places).get(path as usize).unwrap_or(0)
    }

    /// Whether a surface has a material (`material_slot`).
    fn has_material(&self, prim_id: i32, subset: u32) -> bool {
        let index = prim_id.wrapping_add(1).cast_unsigned();
        if index > MAX_PRIM_ID {
            return false;
        }
        let Some(prim) = self.view.bytes(self.frame.prims).get::<GpuPrim>(index as usize) else { return false };
        let slots = self.view.bytes(self.frame.material_slots);
        let slot = prim.first_slot.wrapping_add(subset) as usize;
        subset < prim.slot_count && slots.get::<u32>(slot).unwrap_or(NO_MATERIAL) != NO_MATERIAL
    }

    /// The first number of `row` of a primvar in a table of instance values, if it has one (`take_value`).
    fn value_at(&self, table: u64, row: u32, name: u32) -> Option<f32> {
        let attributes = self.view.bytes(table);
        let mut value = None;
        for index in 0_usize.. {
            let attribute: GpuAttribute = attributes.get(index)?;
            if attribute.name == NO_NAME {
                break;
            }
            let width = attribute.rate_and_width >> 8;
            let values = self.view.bytes(table.wrapping_add(attribute.values));
            let bits = values.get::<u32>(row as usize * width as usize).unwrap_or(NO_VALUE);
            if attribute.name == name && bits != NO_VALUE {
                value = Some(f32::from_bits(bits));
            }
        }
        value
    }
}

/// `attribute_float` of include/attribute.glsl.
fn attribute(values: HostBytes<'_>, corners: HostBytes<'_>, rate: u32, triangle: u32, uv: [f32; 2]) -> Option<f32> {
    let at = |index: u32| values.get::<f32>(index as usize);
    let first = triangle.wrapping_mul(3);
    let [x, y, z] = match rate {
        rate if rate == AttributeRate::Constant as u32 => return at(0),
        rate if rate == AttributeRate::Uniform as u32 => return at(triangle),
        rate if rate == AttributeRate::FaceVarying as u32 => [first, first.wrapping_add(1), first.wrapping_add(2)],
        _ => corners.get(triangle as usize)?,
    };
    if x == y && y == z {
        return at(x);
    }
    Some(at(x)? * (1.0 - uv[0] - uv[1]) + at(y)? * uv[0] + at(z)? * uv[1])
}

impl<const ANY_HIT: bool> Walk<'_, '_, ANY_HIT> {
    /// Whether the surface is there for this ray.
    #[inline(never)]
    pub(crate) fn is_opaque(&self, triangle: u32, subset_and_sides: u32, uv: [f32; 2]) -> bool {
        let scene = self.scene;
        let of_mesh = self.mesh.flags & MeshFlags::HAS_OPACITIES.bits() != 0;
        if !of_mesh && !scene.has(Features::INSTANCE_OPACITY) {
            return true;
        }
        let subset = subset_and_sides & SUBSET_MASK;
        if scene.has(Features::MATERIALS) && scene.has_material(self.instance.prim_id, subset) {
            return true;
        }
        let found = if of_mesh {
            let (values, corners) = (scene.view.bytes(self.mesh.opacities), scene.view.bytes(self.mesh.corner_indices));
            attribute(values, corners, (self.mesh.flags >> 4) & 3, triangle, uv)
        } else {
            self.instance_opacity()
        };
        let Some(opacity) = found else { return true };
        if scene.is_of_aovs() {
            return opacity > 0.0;
        }
        let records = &self.chain[..=self.level_index()];
        let ids = records.iter().fold(combine(self.world.seed, self.chunk_instance), |h, &record| combine(h, record));
        unit(hash(combine(ids, triangle))) < opacity
    }

    /// The opacity of the innermost level that has one (`instance_primvar`).
    fn instance_opacity(&self) -> Option<f32> {
        let scene = self.scene;
        let outer = scene.chunk_instance(self.chunk_instance)?;
        let placed = if outer.row == NO_ROW {
            None
        } else {
            scene.value_at(scene.frame.placed_values, outer.row, NAME_DISPLAY_OPACITY)
        };
        let mut value = placed;
        let chunk = scene.chunk(outer.chunk)?;
        let (mut table, mut instances) = (chunk.primvars, chunk.instances);
        for &record in &self.chain[..scene.special.levels()] {
            value = scene.value_at(table, record, NAME_DISPLAY_OPACITY).or(value);
            let target = scene.view.bytes(instances).get::<GpuInstance>(record as usize)?.target;
            if !scene.has(Features::INSTANCING) || target & TARGET_ASSEMBLY == 0 {
                break;
            }
            let assembly = scene.assembly(scene.target_number(target))?;
            (table, instances) = (assembly.primvars, assembly.instances);
        }
        value
    }
}
