// SPDX-License-Identifier: Apache-2.0
//! The memory of a streaming render: paths in slots, lists of waiting rays, the demand for units, and what the host
//! reads of it.

use super::needs::StreamingNeeds;
use super::observe::{StepExtents, StepObservation};
use super::optional_buffers::{LOOKUP_BYTES, RouletteBuffers, TextureBuffers, alpha_test_bytes, list_alpha_tests};
use super::places::{PlaceBounds, RadiancePlaces, device_bytes};
use crate::error::RenderError;
use crate::wavefront::{PathBuffers, PathNeeds};
use oocpt_abi::{
    FrameConstants, GpuSurface, GpuSurfaceMaterial, PathSegment, PendingItems, RouletteStats, StreamingPointers,
    TILE_KEYS, UnitDemand, WORTH_SUMS, WavefrontCounters, sort_blocks,
};
use oocpt_core::inventory::RenderInventory;
use oocpt_gpu::{Buffer, BufferUsage, CommandList, Gpu, GpuError};
use std::sync::Arc;

/// Most units whose demand the host reads in a step, 16 bytes each; the others ask again in the next step.
const MAX_LISTED_UNITS: u32 = 1 << 16;

/// The device and readback buffers of a streaming render.
#[derive(Debug)]
pub(crate) struct StreamBuffers {
    /// One entry for each slot.
    pub(crate) paths: PathBuffers,
    pub(crate) ended: RadiancePlaces,
    /// The requested number of paths, in flight and in all; memory may have allowed fewer.
    requested: (u64, u64),
    needs: StreamingNeeds,
    textures: Option<TextureBuffers>,
    roulette: Option<RouletteBuffers>,
    progress: Buffer,
    places: Buffer,
    free_slots: Buffer,
    pending: Buffer,
    /// `None` without shadow rays.
    shadow_pending: Option<Buffer>,
    surfaces: Buffer,
    /// `None` without materials.
    surface_materials: Option<Buffer>,
    deferred: [Buffer; 2],
    segments: Buffer,
    demand: Buffer,
    demand_counts: Buffer,
    demanded: Buffer,
    demand_list: Buffer,
    sort_counts: Buffer,
    sort_sums: Buffer,
    unit_rays: Buffer,
    streaming: Buffer,
    /// The results of a step for the host: counters, segments, demand; one buffer for each step under way.
    readback: [Buffer; 2],
}

impl StreamBuffers {
    /// Allocates memory for `capacity` paths in flight (a power of two), where `asked` were wanted in flight and in
    /// all; about `host_bytes` of it in host memory.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        capacity: u32,
        (requested, host_bytes): ((u64, u64), u64),
        needs: StreamingNeeds,
    ) -> Result<Self, GpuError> {
        let array = |name: &str, count: u32, stride: usize| {
            Buffer::new(gpu, name, u64::from(count) * stride as u64, BufferUsage::Device)
        };
        let slots = |name: &str, stride: usize| array(name, capacity, stride);
        let needs = needs.at_least_one();
        let StreamingNeeds { levels, geometry, units, .. } = needs;
        let bounds = PlaceBounds { total: requested.1, host_bytes, plane_words: needs.plane_words };
        let ended = RadiancePlaces::new(gpu, capacity, bounds)?;
        let segment_count = ended.segment_count;
        let played = if needs.roulette { size_of::<RouletteStats>() + 4 * geometry as usize } else { 0 };
        let demand_bytes = StepExtents::demand_bytes(listed(needs) as usize);
        let visited = if needs.visits { 4 * geometry as usize } else { 0 };
        let read = size_of::<WavefrontCounters>()
            + segment_count as usize * size_of::<PathSegment>()
            + demand_bytes
            + visited
            + played;
        let readback = |name: &str| Buffer::new(gpu, name, read as u64, BufferUsage::Readback);
        let buffers = Self {
            paths: PathBuffers::new(gpu, capacity, levels, path_needs(needs))?,
            ended,
            requested,
            needs,
            textures: needs.textures.then(|| TextureBuffers::new(needs, slots)).transpose()?,
            roulette: needs.roulette.then(|| RouletteBuffers::new(gpu, geometry)).transpose()?,
            progress: slots("progress", 4)?,
            places: slots("places", 4)?,
            free_slots: slots("free_slots", 4)?,
            pending: slots("pending", size_of::<PendingItems>())?,
            shadow_pending: needs.shadows.then(|| slots("shadow_pending", size_of::<PendingItems>())).transpose()?,
            surfaces: slots("surfaces", size_of::<GpuSurface>())?,
            surface_materials: needs
                .materials
                .then(|| slots("surface materials", size_of::<GpuSurfaceMaterial>()))
                .transpose()?,
            deferred: [slots("deferred 0", 8)?, slots("deferred 1", 8)?],
            segments: array("segments", segment_count, size_of::<PathSegment>())?,
            demand: array("demand", units, 16)?,
            demand_counts: array("demand counts", 2, 4)?,
            demanded: array("demanded units", listed(needs), 4)?,
            demand_list: array("demand list", listed(needs), size_of::<UnitDemand>())?,
            sort_counts: array("sort_counts", sorted(needs), 8)?,
            sort_sums: array("sort_sums", sort_blocks(sorted(needs)).max(1), 4)?,
            unit_rays: array("unit_rays", geometry, 4)?,
            streaming: Buffer::new(gpu, "streaming", size_of::<StreamingPointers>() as u64, BufferUsage::Upload)?,
            readback: [readback("steps 0")?, readback("steps 1")?],
        };
        buffers.streaming.write(0, bytemuck::bytes_of(&buffers.block()))?;
        Ok(buffers)
    }

    /// Lists the buffers, and those that are left out.
    pub(crate) fn list(&self, inventory: &mut RenderInventory) {
        self.paths.list(inventory);
        let Self { progress, places, free_slots, pending, surfaces, deferred, readback, .. } = self;
        let waiting = [progress, places, free_slots, pending, surfaces, &deferred[0], &deferred[1]];
        let Self { segments, sort_counts, sort_sums, unit_rays, streaming, .. } = self;
        let Self { demand, demand_counts, demanded, demand_list, .. } = self;
        let tables = [segments, demand, demand_counts, demanded, demand_list, sort_counts, sort_sums, unit_rays];
        let tables = tables.into_iter().chain([streaming]).chain(self.ended.buffers());
        for buffer in waiting.into_iter().chain(tables).chain(readback) {
            inventory.add(buffer.name(), buffer.size());
        }
        match &self.roulette {
            Some(RouletteBuffers { block, worth, worth_sums, verdicts: [one, other] }) => {
                [block, worth, worth_sums, one, other]
                    .into_iter()
                    .for_each(|buffer| inventory.add(buffer.name(), buffer.size()));
            }
            None => inventory.leave_out("roulette", 4 * (3 * u64::from(self.needs.geometry) + u64::from(WORTH_SUMS))),
        }
        let capacity = u64::from(self.paths.capacity);
        match &self.shadow_pending {
            Some(buffer) => inventory.add(buffer.name(), buffer.size()),
            None => inventory.leave_out("shadow_pending", capacity * size_of::<PendingItems>() as u64),
        }
        match &self.surface_materials {
            Some(buffer) => inventory.add(buffer.name(), buffer.size()),
            None => inventory.leave_out("surface materials", capacity * size_of::<GpuSurfaceMaterial>() as u64),
        }
        let Some(textures) = &self.textures else {
            inventory.leave_out("resolve_queue", 4 * capacity);
            inventory.leave_out("resolve_progress", 4 * capacity);
            return list_alpha_tests(None, capacity, inventory);
        };
        for buffer in [&textures.resolve_queue, &textures.resolved, &textures.resolve_progress] {
            inventory.add(buffer.name(), buffer.size());
        }
        list_alpha_tests(textures.alpha_tests.as_ref(), capacity, inventory);
    }

    /// Device bytes that grow with the slots.
    pub(crate) fn slots_bytes(&self, gpu: &Gpu) -> u64 {
        u64::from(self.paths.capacity) * slot_bytes(gpu, self.needs)
    }

    /// Returns true if this memory serves such a scene and so many paths, or is as much as can be allocated for them.
    pub(crate) fn serves(&self, needs: StreamingNeeds, requested: (u64, u64)) -> bool {
        let enough = self.requested.0 >= requested.0 && self.requested.1 >= requested.1;
        self.needs == needs.at_least_one() && enough
    }

    fn block(&self) -> StreamingPointers {
        let textures = self.textures.as_ref();
        let of = |buffer: &dyn Fn(&TextureBuffers) -> &Buffer| textures.map_or(0, |t| buffer(t).address());
        let alpha_tests = |kind: usize| {
            textures.and_then(|t| t.alpha_tests.as_ref()).map_or(0, |alpha_tests| alpha_tests[kind].address())
        };
        let roulette = |of: &dyn Fn(&RouletteBuffers) -> &Buffer| self.roulette.as_ref().map_or(0, |r| of(r).address());
        StreamingPointers {
            roulette: roulette(&|r| &r.block),
            worth: roulette(&|r| &r.worth),
            worth_sums: roulette(&|r| &r.worth_sums),
            verdicts: [roulette(&|r| &r.verdicts[0]), roulette(&|r| &r.verdicts[1])],
            segment_count: self.ended.segment_count,
            segments: self.segments.address(),
            progress: self.progress.address(),
            pending: self.pending.address(),
            shadow_pending: self.shadow_pending.as_ref().map_or(0, Buffer::address),
            surfaces: self.surfaces.address(),
            deferred: [self.deferred[0].address(), self.deferred[1].address()],
            demand: self.demand.address(),
            demand_counts: self.demand_counts.address(),
            demanded: self.demanded.address(),
            demand_list: self.demand_list.address(),
            sort_counts: self.sort_counts.address(),
            sort_sums: self.sort_sums.address(),
            unit_rays: self.unit_rays.address(),
            places: self.places.address(),
            ended_radiance: self.ended.radiance.address(),
            free_slots: self.free_slots.address(),
            surface_materials: self.surface_materials.as_ref().map_or(0, Buffer::address),
            alpha_tests: alpha_tests(0),
            shadow_alpha_tests: alpha_tests(1),
            resolve_queue: of(&|textures| &textures.resolve_queue),
            resolved: of(&|textures| &textures.resolved),
            resolve_progress: of(&|textures| &textures.resolve_progress),
            segment_size: self.ended.segment_size,
            chunk_count: self.needs.chunks,
            slots: self.paths.capacity,
            unit_count: self.needs.units,
            lookups: self.needs.lookups,
            demanded_capacity: listed(self.needs),
            demand_capacity: listed(self.needs),
            first_tile: self.needs.geometry,
            unused: 0,
        }
    }

    /// Writes the addresses into a frame block.
    pub(crate) fn bind(&self, frame: &mut FrameConstants) {
        self.paths.bind(frame);
        frame.plane_values = self.ended.planes.as_ref().map_or(0, Buffer::address);
        frame.streaming = self.streaming.address();
    }

    /// The buffers that the trace passes write, besides those of the paths.
    pub(crate) fn written(&self) -> Vec<&Buffer> {
        let Self { progress, free_slots, pending, deferred, segments, unit_rays, .. } = self;
        let always = [progress, free_slots, pending, &deferred[0], &deferred[1], segments, unit_rays];
        let textures = self.textures.as_ref();
        let alpha_tests = textures.and_then(|textures| textures.alpha_tests.as_ref()).into_iter().flatten();
        let waiting = self.shadow_pending.iter().chain(textures.map(|textures| &textures.resolve_queue));
        always.into_iter().chain(waiting).chain(alpha_tests).collect()
    }

    /// Records commands that clear everything, before a stage.
    pub(crate) fn clear(&self, commands: &mut CommandList) {
        for buffer in [&self.paths.counters, &self.segments, &self.unit_rays, &self.demand] {
            commands.fill(buffer, 0, buffer.size(), 0);
        }
        if let Some(roulette) = &self.roulette {
            commands.fill(&roulette.block, 0, roulette.block.size(), 0);
        }
    }

    /// Clears the counts before the deferred rays are sorted.
    pub(crate) fn clear_sort(&self, commands: &mut CommandList) {
        commands.fill(&self.sort_counts, 0, self.sort_counts.size(), 0);
    }

    /// Clears the demand before it is counted.
    pub(crate) fn clear_demand(&self, commands: &mut CommandList) {
        commands.fill(&self.demand_counts, 0, self.demand_counts.size(), 0);
    }

    /// Workgroups of the pass that lists demand.
    pub(crate) fn demand_groups(&self) -> u32 {
        listed(self.needs).div_ceil(64).min(64)
    }

    /// Clears the sums before the contributions of rays are added up.
    pub(crate) fn clear_worth(&self, commands: &mut CommandList) {
        for buffer in self.roulette.iter().flat_map(|roulette| [&roulette.worth, &roulette.worth_sums]) {
            commands.fill(buffer, 0, buffer.size(), 0);
        }
    }

    /// Writes the verdicts that the roulette pass reads in step `number`, none of whose two predecessors may still be
    /// under way: a weight by chunk, if there is one.
    pub(crate) fn write_verdicts(&self, number: u64, verdicts: &[f32]) -> Result<(), RenderError> {
        let Some(roulette) = &self.roulette else { return Ok(()) };
        Ok(roulette.verdicts[verdict_table(number) as usize].write(0, bytemuck::cast_slice(verdicts))?)
    }

    /// Workgroups of the scan over the chunks.
    pub(crate) fn sort_blocks(&self) -> u32 {
        sort_blocks(sorted(self.needs))
    }

    /// Records a copy of what the host reads of step `number`.
    pub(crate) fn copy_out(&self, commands: &mut CommandList, number: u64) {
        let target = self.readback_of(number);
        commands.concurrent(|c| {
            let mut offset = 0;
            let played = self.roulette.iter().flat_map(|roulette| [&roulette.block, &roulette.worth]);
            let listed = [&self.demand_counts, &self.demand_list];
            let visited = self.needs.visits.then_some(&self.unit_rays);
            let sources = [&self.paths.counters, &self.segments].into_iter().chain(listed).chain(visited).chain(played);
            for source in sources {
                c.copy(source, 0, target, offset, source.size());
                offset += source.size();
            }
        });
    }

    fn readback_of(&self, number: u64) -> &Buffer {
        &self.readback[usize::from(number & 1 == 1)]
    }

    /// Reads the results of step `number`, once it has ended, into `seen`.
    pub(crate) fn observe(&self, number: u64, seen: &mut StepObservation) -> Result<(), RenderError> {
        let extents = StepExtents {
            segments: self.ended.segment_count as usize,
            listed: listed(self.needs) as usize,
            units: self.needs.units as usize,
            visited: if self.needs.visits { self.needs.geometry as usize } else { 0 },
        };
        Ok(self.readback_of(number).map(|bytes| seen.read(number, bytes, extents))?)
    }

    /// Rays that entered each chunk and mesh, if they were counted; waits for the device.
    pub(crate) fn unit_rays(&self, gpu: &Arc<Gpu>) -> Result<Vec<u32>, RenderError> {
        let target = Buffer::new(gpu, "unit rays", self.unit_rays.size(), BufferUsage::Readback)?;
        let mut commands = gpu.commands("unit rays")?;
        commands.copy(&self.unit_rays, 0, &target, 0, self.unit_rays.size());
        commands.submit()?.wait(crate::device::WAVE_TIMEOUT)?;
        Ok(target.map(|bytes| bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect())?)
    }
}

/// The table of verdicts that step `number` reads.
pub(super) fn verdict_table(number: u64) -> u32 {
    u32::from(number & 1 == 1)
}

/// Most units in the lists of demand.
fn listed(needs: StreamingNeeds) -> u32 {
    needs.units.min(MAX_LISTED_UNITS)
}

/// Number of chunks that have the keys by which deferred rays, and with textures materials, are sorted.
fn sorted(needs: StreamingNeeds) -> u32 {
    if needs.textures { needs.chunks + TILE_KEYS / 2 } else { needs.chunks }
}

/// The needs of the paths in slots.
fn path_needs(needs: StreamingNeeds) -> PathNeeds {
    let StreamingNeeds { textures, light_paths, shadows, bounce_kinds, light_words, path_states, .. } = needs;
    let none = PathNeeds::default();
    PathNeeds { shadows, textures, light_paths, bounce_kinds, light_words, path_states, ..none }
}

/// Bytes of device memory that a slot takes, at most.
pub(super) fn slot_bytes(gpu: &Gpu, needs: StreamingNeeds) -> u64 {
    let textures = if needs.textures { 8 + u64::from(needs.lookups) * LOOKUP_BYTES as u64 } else { 0 };
    let materials = if needs.materials { size_of::<GpuSurfaceMaterial>() as u64 } else { 0 };
    let cutouts = if needs.cutouts { 2 * alpha_test_bytes(needs) as u64 } else { 0 };
    // The buffers progress, places, free_slots; two lists of deferred rays.
    let numbers = 3 * 4 + 2 * 8;
    let pending = (1 + u64::from(needs.shadows)) * size_of::<PendingItems>() as u64;
    let waiting = numbers + pending + size_of::<GpuSurface>() as u64;
    path_needs(needs).bytes_a_path(needs.levels)
        + waiting
        + device_bytes(gpu, needs.plane_words)
        + textures
        + cutouts
        + materials
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_gpu::OpenOptions;

    #[test]
    fn slot_buffers_take_the_bytes_estimated_before() {
        let selector = std::env::var("OOCPT_TEST_DEVICE").ok();
        let gpu = Gpu::open(&OpenOptions { selector, ..OpenOptions::default() }).expect("a device");
        for bits in 0..32_u32 {
            let [textures, cutouts, materials, light_paths, shadows] = [0, 1, 2, 3, 4].map(|bit| bits >> bit & 1 == 1);
            let needs = StreamingNeeds {
                levels: 2,
                chunks: 3,
                geometry: 4,
                units: 5,
                textures,
                lookups: 7,
                cutouts: cutouts && textures,
                cutout_programs: cutouts && textures,
                materials,
                light_paths,
                shadows,
                roulette: false,
                visits: false,
                bounce_kinds: shadows && materials,
                plane_words: 3 * (bits % 3),
                light_words: 3 * (bits % 3 / 2),
                path_states: bits % 6 == 2,
            };
            // The largest number of places is assumed, eight a slot.
            let of = |capacity: u32| {
                let paths = 1 << 40;
                let made = StreamBuffers::new(&gpu, capacity, ((u64::from(capacity), paths), 1 << 40), needs);
                let mut listed = RenderInventory::default();
                made.expect("memory").list(&mut listed);
                let of_host = ["ended_radiance", "plane_values", "steps 0", "steps 1", "streaming"];
                let of_host = &of_host[2 * usize::from(gpu.is_unified())..];
                let buffers = listed.buffers.iter().filter(|buffer| !of_host.contains(&buffer.name.as_str()));
                buffers.map(|buffer| buffer.bytes).sum::<u64>()
            };
            let more = u64::from(1_u32 << 12);
            assert_eq!(of(2 << 12) - of(1 << 12), more * slot_bytes(&gpu, needs), "{needs:?}");
        }
    }
}
