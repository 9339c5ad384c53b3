// SPDX-License-Identifier: Apache-2.0
//! Renders a scene that does not fit: paths wait for chunks, and the planner loads those that most of them wait for.
//!
//! [`render`] allocates the memory and lets the engine run over a [`StreamingStage`]: take in what the device has
//! finished (`observe`), advance the loads and ask the planner (`residency`), submit the next step (`record`). A step
//! writes the chunk table, wakes the rays whose chunk is resident, traces some rounds and counts the waiting rays of
//! each unit. Loads go on beside the steps on the loader's threads and the transfer queue.
//!
//! The picture does not depend on any of this: `shaders/README.md` ("Streaming") and decisions/0005 explain it.

mod buffers;
mod clock;
mod leave;
mod left;
mod mapping;
mod needs;
mod observe;
mod optional_buffers;
mod places;
mod reach;
mod record;
mod report;
mod residency;
mod rounds;
mod segments;
mod share;
mod stage;
mod stall;
mod stragglers;

pub(crate) use buffers::StreamBuffers;

use crate::assets::{DeviceScene, HostHeapFiller, SceneAssets, SceneView, bytes_with_gaps};
use crate::device::Device;
use crate::engine::{self, CompiledFeatures, WavefrontTracer};
use crate::error::RenderError;
use crate::frame::context::{
    FrameContext, geometry_cap, has_light_paths, has_shadow_rays, is_cpu, limits_kinds, maps_host, shrinking,
};
use crate::frame::in_core::{LEFT_BY_WAVES, roomy_waves};
use crate::frame::progress::FrameProgress;
use crate::frame::specialise;
use crate::host_memory::HostMemoryUser;
use crate::job::RenderJob;
use crate::job::shared::FrameGate;
use crate::job::timings::LeftMoment;
use crate::wavefront::BackgroundCompile;
use clock::StageClock;
use leave::LeaveDecision;
use left::PathsLeftLog;
use needs::StreamingNeeds;
use observe::StepObservation;
use oocpt_abi::{Features, FrameConstants, MAX_PENDING};
use oocpt_core::inventory::RenderInventory;
use oocpt_gpu::MemoryUse;
use residency::{ResidencyStart, SceneResidency};
use share::ShareRequest;
use stage::StreamingStage;
use std::time::Instant;
use stragglers::StragglerRoulette;

/// Most paths in slots.
const MAX_PATHS: u64 = 1 << 25;
/// Most paths in slots if images are shown on the way: a round of them is short enough for stop and pause to take
/// effect.
const MAX_PATHS_INTERACTIVE: u64 = 1 << 22;
/// Most paths in slots on a processor that traces in software.
const MAX_PATHS_CPU: u64 = 1 << 14;
/// Fewest paths in slots.
const MIN_PATHS: u64 = 1 << 12;
/// Approximate bytes of the buffers of a frame that do not grow with its paths.
const SMALL_BUFFERS: u64 = 1 << 20;
/// Smallest arena that is allocated ahead, bytes.
const MIN_RESERVED_BYTES: u64 = 4 << 20;
/// One part in so many of the geometry's memory is left free for holes between ranges.
const SLACK: u64 = 16;

/// The state that the stages of a frame share.
#[derive(Debug)]
pub(crate) struct StreamingContext<'a, 'r> {
    pub(crate) tracer: WavefrontTracer<'a>,
    pub(crate) buffers: &'a StreamBuffers,
    pub(crate) residency: SceneResidency<'r>,
    pub(crate) clock: StageClock,
    /// Stack entries below the top level that the passes are compiled for.
    pub(crate) stack_entries: u32,
    view: SceneView,
    /// The number of unfinished paths over time.
    pub(crate) left: PathsLeftLog,
    /// `None` without `oocpt:stragglerRoulette`.
    pub(crate) stragglers: Option<StragglerRoulette>,
}

/// Renders `context` from `scene`; publishes images and stats on the way. Gives the first path that is left, where the
/// rest is better rendered without streaming ([`DeviceScene::is_all_there`]).
pub(crate) fn render(
    context: &FrameContext<'_>,
    scene: &mut DeviceScene,
    (kept, ahead): (&mut Option<StreamBuffers>, &mut BackgroundCompile),
    gate: &FrameGate<'_>,
    progress: &mut FrameProgress<'_>,
) -> Result<Option<u64>, RenderError> {
    let FrameContext { device, job, .. } = *context;
    // Paths first: the heap takes what it can get.
    make_buffers(context, scene, kept)?;
    scene.make_empty_tables(device)?;
    let view = scene.view(0)?;
    let buffers = kept.as_ref().ok_or_else(|| RenderError::Internal("the frame's paths were not made".into()))?;
    let parts = CompiledFeatures::new(context, &view, true);
    device.bsdf_tables(parts.features)?; // before geometry takes what is left
    let budget = geometry_budget(context, scene, buffers);
    reserve(context, scene, budget)?;
    let policy = job.settings.policy;
    let mut listed = RenderInventory::default();
    scene.list(&mut listed, false);
    buffers.list(&mut listed);
    listed.add("geometry and textures, at most", budget);
    let assets = scene.assets.clone();
    let filler = host_share(context, scene, maps_host(device, &job.settings))?;
    let may_leave = filler.is_some() && may_split(context, scene) && holds(device, &assets, budget)?;
    let mut leave = LeaveDecision::new(may_leave, assets.tile_bytes > 0, buffers.paths.capacity, leaves_soon(job));
    let (_, store, tables) = scene.parts()?;
    let mut residency =
        SceneResidency::new(ResidencyStart { device, assets: &assets, store, tables, budget, policy, filler })?;
    leave.bring_rest(&mut residency, progress.paths_to_trace());
    if residency.brings_rest && !job.settings.interactive {
        let started = Instant::now();
        residency.map_all(gate)?;
        progress.timings.upload_secs += started.elapsed().as_secs_f64();
    }
    let stack_entries = residency.stack_entries.max(assets.likely_stack());
    let view = view.with_stack(stack_entries + MAX_PENDING);
    let bind = |block: &mut FrameConstants| buffers.bind(block);
    let mut tracer = WavefrontTracer::new(context, &buffers.paths, (&view, parts), listed, bind, progress)?;
    tracer.traces_into(buffers.written());
    if may_leave && leave.pays(progress.paths_to_trace()) {
        let view = if context.carry.levels { view.deepest(stack_entries) } else { view.with_stack(stack_entries) };
        ahead.begin(device, CompiledFeatures::new(context, &view, false).compiled_for(context, &view)?, context.film);
        leave.compiles = ahead.pending();
    }
    tracing::info!(
        mib = budget >> 20,
        of_mib = assets.bytes >> 20,
        chunks = assets.chunk_count(),
        meshes = assets.snapshot.meshes.len(),
        tiles = assets.textures.tile_count(),
        may_leave,
        paths = buffers.paths.capacity,
        %policy,
        "streaming"
    );
    let streamer = StreamingContext {
        tracer,
        buffers,
        residency,
        clock: StageClock::new(Instant::now()),
        stack_entries,
        view,
        left: PathsLeftLog::of(progress.paths_to_trace()),
        stragglers: job.settings.straggler_roulette.then(|| stragglers(context)),
    };
    let first = progress.kept();
    engine::render(&mut StreamingStage::new(streamer, leave, gate.patience(), first), gate, progress)
}

fn stragglers(context: &FrameContext<'_>) -> StragglerRoulette {
    let units = context.job.snapshot.world.chunks.len() + context.job.snapshot.meshes.len();
    let stragglers = StragglerRoulette::new(context.job.settings.seed, units);
    #[cfg(feature = "faults")]
    let stragglers = stragglers.with_faults(context.job.options.faults);
    stragglers
}

/// Most lookups of textures of a surface, with those of what the mesh emits that it asks for light.
fn lookups(context: &FrameContext<'_>) -> u32 {
    let of_lights = context.lights.mesh_lookups();
    u32::try_from(context.job.snapshot.surfaces.most_lookups()).unwrap_or(0) + of_lights
}

/// Allocates path memory: its share of what the budget leaves beside what must stay ([`ShareRequest`]), and no more
/// than the render has paths; less if memory runs out. The scene's assets on the device are evicted if paths have no
/// room beside them.
fn make_buffers(
    context: &FrameContext<'_>,
    scene: &mut DeviceScene,
    kept: &mut Option<StreamBuffers>,
) -> Result<(), RenderError> {
    let FrameContext { device, job, .. } = *context;
    let textures = !scene.assets.textures.is_empty();
    let needs = StreamingNeeds {
        levels: scene.levels(),
        chunks: scene.chunk_count(),
        geometry: scene.assets.geometry_count(),
        units: scene.unit_count(),
        textures,
        lookups: lookups(context),
        materials: job.snapshot.features.contains(Features::MATERIALS),
        cutouts: textures && specialise::has_cutouts(&job.snapshot),
        cutout_programs: textures && job.snapshot.features.contains(Features::CUTOUT_PROGRAMS),
        light_paths: has_light_paths(context),
        shadows: context.film.has_light() && has_shadow_rays(context),
        roulette: job.settings.straggler_roulette,
        visits: maps_host(device, &job.settings),
        bounce_kinds: limits_kinds(&job.settings),
        plane_words: context.film.plane_words(),
        light_words: context.film.light_words(),
        path_states: !context.film.expressions().is_empty(),
    };
    let most = if leaves_soon(job) { MIN_PATHS } else { most_paths(context) };
    let paths = job.request.pixels() * u64::from(job.settings.samples_per_pixel);
    let wanted = paths.clamp(MIN_PATHS, most).next_power_of_two();
    if kept.as_ref().is_some_and(|buffers| buffers.serves(needs, (wanted, paths))) {
        return Ok(());
    }
    *kept = None;
    let slot_bytes = buffers::slot_bytes(&device.gpu, needs);
    let unused = |memory: MemoryUse| memory.budget.saturating_sub(memory.used);
    let largest_unit = scene.assets.catalog.least_budget();
    let room = ShareRequest {
        bytes: unused(device.gpu.memory()) + scene.bytes_to_clear(device),
        slot_bytes,
        largest_unit,
        units: scene.assets.bytes,
        cap: geometry_cap(job).unwrap_or(u64::MAX),
        maps: needs.visits,
        wanted,
        fewest: MIN_PATHS,
    };
    let capacity = room.slots();
    // The tables of a streamed scene, and a little for the small buffers of a frame, come beside it.
    let beside = scene.table_bytes() + SMALL_BUFFERS;
    if capacity * slot_bytes + beside > unused(device.gpu.memory()) {
        scene.clear(device)?;
    }
    let host_bytes = job.host_limit(HostMemoryUser::EndedPaths, 0);
    *kept = Some(shrinking(capacity, MIN_PATHS, |capacity| {
        StreamBuffers::new(&device.gpu, capacity, ((wanted, paths), host_bytes), needs)
    })?);
    Ok(())
}

/// Returns true if a scene that is wholly on the device and in host memory may be rendered without streaming. Tiles of
/// textures need room then, which a cap on geometry gives to chunks.
pub(crate) fn may_split(context: &FrameContext<'_>, scene: &DeviceScene) -> bool {
    let FrameContext { device, job, film, .. } = *context;
    let streams = context.is_frugal || job.options.force_streaming || !job.settings.chunk_report.is_empty();
    maps_host(device, &job.settings)
        && !streams
        && !job.settings.straggler_roulette
        && film.adaptive().is_none()
        && (scene.assets.tile_bytes == 0 || !context.has_outgrown && geometry_cap(job).is_none())
}

/// Returns true if the device, with `budget` bytes for geometry, and the host memory that may be used hold all of the
/// scene.
fn holds(device: &Device, assets: &SceneAssets, budget: u64) -> Result<bool, RenderError> {
    let (bytes, mapped) = (assets.geometry_bytes(), device.host_heap()?.limit().unwrap_or(0));
    Ok(bytes + bytes / SLACK <= budget.saturating_add(mapped))
}

/// Returns true if a test wants the rest of a picture rendered without streaming, however short it is.
fn leaves_soon(job: &RenderJob) -> bool {
    #[cfg(feature = "faults")]
    return job.options.faults.leaves_soon;
    #[cfg(not(feature = "faults"))]
    {
        let _ = job;
        false
    }
}

/// Most paths in flight.
fn most_paths(context: &FrameContext<'_>) -> u64 {
    let FrameContext { device, job, .. } = *context;
    match (context.is_frugal, is_cpu(device), job.settings.interactive) {
        (true, ..) => MIN_PATHS,
        (false, true, _) => MAX_PATHS_CPU,
        (false, false, true) => MAX_PATHS_INTERACTIVE,
        (false, false, false) => MAX_PATHS,
    }
}

/// Divides the host memory for encoded geometry: geometry that rays read there is not kept a second time.
fn host_share(
    context: &FrameContext<'_>,
    scene: &mut DeviceScene,
    maps: bool,
) -> Result<Option<HostHeapFiller>, RenderError> {
    let FrameContext { device, job, .. } = *context;
    if !maps {
        scene.unmap(device, false);
        let (kept, shapes) = (scene.store.kept(), scene.store.shapes().bytes());
        let held = kept.bytes() + shapes;
        let limit = job.host_limit(HostMemoryUser::Encoded, held);
        kept.limit(limit.saturating_sub(shapes));
        return Ok(None);
    }
    let heap = device.host_heap()?.stats();
    let shapes = scene.store.shapes().bytes();
    let held = heap.arena_bytes + heap.dedicated_bytes + scene.store.kept().bytes() + shapes;
    let limit = job.host_limit(HostMemoryUser::Encoded, held);
    let limit = limit.saturating_sub(shapes);
    let mapped = bytes_with_gaps(scene.assets.bytes, scene.assets.largest_bytes).min(limit);
    scene.store.kept().limit(limit - mapped);
    HostHeapFiller::start(device, mapped).map(Some)
}

/// Bytes that chunks, meshes and assemblies may take: what the budget leaves, less some slack, no more than the user's
/// own cap, and so little that a picture whose rest is traced without streaming has room for waves then.
fn geometry_budget(context: &FrameContext<'_>, scene: &DeviceScene, buffers: &StreamBuffers) -> u64 {
    let memory = context.device.gpu.memory();
    let heap = context.device.heap.stats();
    let unused_arenas = heap.arena_bytes.saturating_sub(heap.used_bytes);
    let free = memory.budget.saturating_sub(memory.used) + unused_arenas + scene.store.bytes();
    let slack = free / SLACK;
    let left = free - slack;
    let cap = geometry_cap(context.job).unwrap_or(u64::MAX);
    if !(maps_host(context.device, &context.job.settings) && may_split(context, scene)) {
        return left.min(cap);
    }
    let waves = roomy_waves(context, scene);
    let waves = waves + waves / (LEFT_BY_WAVES - 1);
    let beside = share::beside_waves(left, buffers.slots_bytes(&context.device.gpu), waves);
    beside.max(scene.assets.catalog.least_budget().min(left)).min(cap)
}

/// Makes large arenas for `budget` bytes of units and what they lose to holes, as far as there is
/// memory: in small ones, units of very different sizes find no place long before the budget is reached.
fn reserve(context: &FrameContext<'_>, scene: &DeviceScene, budget: u64) -> Result<(), RenderError> {
    let (memory, heap) = (context.device.gpu.memory(), context.device.heap.stats());
    let there = heap.arena_bytes.saturating_sub(heap.used_bytes) + scene.store.bytes();
    let wanted = budget.min(scene.assets.bytes);
    let wanted = (wanted + wanted / SLACK).saturating_sub(there);
    let unused = memory.budget.saturating_sub(memory.used).saturating_sub(SMALL_BUFFERS);
    // Units too large for arenas have memory of their own, which the arenas must leave.
    let largest = scene.assets.largest_bytes;
    let dedicated = if largest > context.device.heap.largest_shared() { largest } else { 0 };
    let mut left = wanted.min(unused).saturating_sub(dedicated);
    while left >= MIN_RESERVED_BYTES {
        match context.device.heap.reserve(left)? {
            0 => break,
            bytes => left = left.saturating_sub(bytes),
        }
    }
    Ok(())
}

impl StreamingContext<'_, '_> {
    /// Compiles the passes anew if a chunk on the device needs a deeper stack than they have.
    pub(crate) fn deepen(&mut self, progress: &mut FrameProgress<'_>) -> Result<(), RenderError> {
        if self.residency.stack_entries <= self.stack_entries {
            return Ok(());
        }
        self.stack_entries = self.residency.stack_entries;
        let view = self.view.with_stack(self.stack_entries + MAX_PENDING);
        progress.streaming(|stats| stats.recompilations += 1);
        self.tracer.deepen(view.stack_size, &mut progress.timings)
    }

    /// Notes the number of paths left `seconds` after the first sample was begun.
    fn note_left(&mut self, seconds: f64, paths_left: u64) {
        let planner = self.residency.planner.stats();
        let (loads, bytes_paged) = (planner.loads, planner.bytes_loaded);
        self.left.note(LeftMoment { seconds, paths_left, loads, bytes_paged });
    }

    /// Bytes of geometry in host memory that rays read.
    fn mapped_bytes(&self) -> u64 {
        self.tracer.context.device.host_heap_if_made().map_or(0, |heap| heap.stats().live_bytes)
    }

    /// Updates the stats.
    fn report(&self, progress: &mut FrameProgress<'_>, seen: &StepObservation, stragglers: u64, paths_left: u64) {
        let heap = self.tracer.context.device.heap.stats();
        let planner = self.residency.planner.stats();
        let counters = &seen.counters;
        let (visits, misses) = (counters.chunk_visits as f64, counters.chunk_misses as f64);
        progress.streaming(|stats| {
            stats.resident_chunks = planner.resident_units;
            stats.chunks_touched = planner.units_touched;
            stats.loads = planner.loads;
            stats.waits = counters.chunk_misses;
            stats.reloads = planner.reloads;
            stats.evictions = planner.evictions;
            stats.failed_loads = planner.failed_loads;
            stats.bytes_paged = planner.bytes_loaded;
            stats.texture_bytes = self.residency.textures.bytes_held;
            stats.texture_loads = self.residency.textures.loads;
            stats.texture_reloads = self.residency.textures.reloads;
            stats.texture_bytes_paged = self.residency.textures.bytes_loaded;
            stats.reloaded_bytes = planner.bytes_reloaded;
            stats.hit_rate = if visits + misses > 0.0 { visits / (visits + misses) } else { 1.0 };
            stats.waiting_rays = seen.waiting();
            stats.stragglers = stragglers;
            stats.paths_left = paths_left;
            stats.geometry_bytes = planner.bytes_held;
            stats.geometry_budget_bytes = self.residency.planner.budget();
            stats.geometry_peak_bytes = planner.peak_bytes;
            stats.mapped_bytes = self.mapped_bytes();
            stats.fragmentation = heap.fragmentation;
            stats.roulette_paths = u64::from(seen.roulette.ended_paths);
            stats.roulette_shadow_rays = u64::from(seen.roulette.ended_shadows);
            stats.roulette_loads_saved = self.stragglers.as_ref().map_or(0, StragglerRoulette::loads_saved);
            stats.seconds_tracing = self.clock.tracing;
            stats.seconds_loading = self.clock.loading;
            stats.seconds_waiting = self.clock.waiting;
            stats.seconds_overlapped = self.clock.overlapped;
        });
    }
}
