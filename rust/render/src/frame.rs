// SPDX-License-Identifier: Apache-2.0
//! Renders one frame from a job to its images; the functions here are the outline of a render.
//!
//! Render thread only. The device, the scene, the wave memory and the images are kept from frame to frame where they
//! can be.

use crate::assets::{DeviceScene, SceneCache, SceneView};
use crate::device::{Device, DeviceOptions, pipeline_folder};
use crate::engine::{self, CompiledFeatures, FrameTiles, WaveSource, WavefrontTracer};
use crate::error::RenderError;
use crate::feedback::FeedbackBuffers;
use crate::film::Film;
use crate::host_memory::{self, HostMemoryUser};
use crate::in_core::{path_needs, roomy_waves, share_of_waves};
use crate::in_flight;
use crate::job::RenderJob;
use crate::lights::{FileCache, LightTable, LightTables, MeshLightCache};
use crate::progress::FrameProgress;
use crate::request::Severity;
use crate::setting::{FrameContext, geometry_cap, in_flight, is_cpu, maps_host, paths, shrinking};
use crate::shared::FrameGate;
use crate::specialise::ForcedFeatures;
use crate::streaming::{self, StreamBuffers};
use crate::sync::lock;
use crate::upload::UploadDecision;
use crate::wavefront::{BackgroundCompile, PathBuffers};
use oocpt_abi::{Features, FrameConstants};
use oocpt_core::inventory::RenderInventory;
use oocpt_core::scene::Snapshot;
#[cfg(feature = "faults")]
use oocpt_gpu::{DriverCall, PlantedFailure};
use oocpt_gpu::{Gpu, GpuError};
use std::sync::Arc;

/// One part in so many of a scene's bytes is lost at most between the ranges of arenas.
const PACKING: u64 = 24;

/// A scene counts as fitting only if it leaves room for so many bytes of texture tiles (or for all there are).
const FEWEST_TILES: u64 = 8 << 20;

/// Sets the limit of host memory from which rays may read tiles of textures that find no room on the device. With a cap
/// on geometry, which counts mapped tiles, no limit is set.
fn let_tiles_be_mapped(setting: &FrameContext<'_>, scene: &DeviceScene) -> Result<(), RenderError> {
    let FrameContext { device, job, .. } = *setting;
    if scene.assets.tile_bytes > 0 && maps_host(device, &job.settings) && geometry_cap(job).is_none() {
        let heap = device.host_heap()?;
        let held = heap.stats().arena_bytes + heap.stats().dedicated_bytes;
        let limit = host_memory::limit_of(HostMemoryUser::Encoded, &job.settings, held, job.fixed_host_bytes);
        heap.set_limit(Some(limit));
    }
    Ok(())
}

/// The state that the render thread keeps from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Renderer {
    device: Option<Arc<Device>>,
    scene: SceneCache,
    waves: Option<PathBuffers>,
    stream: Option<StreamBuffers>,
    ahead: BackgroundCompile,
    film: Option<Film>,
    light_files: FileCache,
    mesh_lights: MeshLightCache,
    light_tables: LightTables,
    /// True if memory is short: the scene is streamed even if it seems to fit, with few paths at a time.
    is_frugal: bool,
    /// The scene whose textures did not fit when it was rendered in core; it is streamed from then on.
    outgrown: Option<Arc<Snapshot>>,
    upload: UploadDecision,
}

impl Renderer {
    /// Renders `job` until it is done or `gate` stops it; publishes images and stats on the way. A picture whose device
    /// is lost is rendered again from its start, once, on a newly opened device.
    pub(crate) fn render(&mut self, job: &RenderJob, gate: &FrameGate<'_>) -> Result<(), RenderError> {
        job.request.validate()?;
        let mut progress = FrameProgress::start(gate.shared(), job);
        match self.render_once(job, gate, &mut progress, 0) {
            Err(error @ RenderError::Gpu(GpuError::DeviceLost { .. })) if gate.proceed() => {
                gate.shared()
                    .report(Severity::Warning, format!("{error}; the picture is rendered again from its start"));
                // Everything that was made on the lost device is dropped.
                *self = Self::default();
                progress.begin_again();
                self.render_once(job, gate, &mut progress, 1)
            }
            result => result,
        }
    }

    /// Renders as [`Self::render`] does, after the loss of so many devices. On running out of memory, frees everything
    /// that is held and tries once more with as little as possible.
    fn render_once(
        &mut self,
        job: &RenderJob,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
        lost: u32,
    ) -> Result<(), RenderError> {
        let device = self.open(job)?;
        *lock(&gate.shared().device) = Some(device.gpu.report().clone());
        progress.device_opened(job);
        device.reading.set_limit(host_memory::reading(&job.settings, job.fixed_host_bytes));
        #[cfg(feature = "faults")]
        if let Some(failure) = job.options.faults.failure.filter(|_| job.generation == 1) {
            device.gpu.plant_failure(failure);
        }
        #[cfg(feature = "faults")]
        if let [devices, after] = job.options.faults.lost_devices
            && lost < devices
            && job.generation == 1
        {
            device.gpu.plant_failure(PlantedFailure { call: DriverCall::Submit, after: after.into(), times: 1 });
        }
        #[cfg(not(feature = "faults"))]
        let _ = lost;
        self.is_frugal = false;
        let mut result = self.render_on(&device, job, gate, progress);
        if let Err(error @ (RenderError::Budget { .. } | RenderError::NoProgress { .. })) = &result {
            tracing::info!(%error, "trying again with as little memory as possible");
            progress.begin_again();
            self.scene.clear(&device)?;
            *self = Self { device: Some(Arc::clone(&device)), is_frugal: true, ..Self::default() };
            device.gpu.wait_idle()?;
            device.heap.trim();
            result = self.render_on(&device, job, gate, progress);
        }
        if let Err(error @ RenderError::TexturesOutgrow) = &result {
            tracing::info!(%error, "streaming");
            self.outgrown = Some(Arc::clone(&job.snapshot));
            device.gpu.wait_idle()?;
            progress.begin_again();
            result = self.render_on(&device, job, gate, progress);
        }
        device.keep_pipelines(true);
        progress.end(&device.gpu);
        #[cfg(feature = "faults")]
        {
            *lock(&gate.shared().witness) = crate::faults::FaultWitness::of(&device.gpu);
        }
        if let Err(RenderError::Gpu(GpuError::DeviceLost { .. })) = &result {
            device.forget();
        }
        result
    }

    fn render_on(
        &mut self,
        device: &Arc<Device>,
        job: &RenderJob,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        let origin = job.snapshot.origin;
        let in_motion = job.request.camera.in_motion(origin).unwrap_or_else(|why| {
            gate.shared().report(Severity::Warning, why.to_string());
            None
        });
        let still = in_motion.as_ref().map_or(&job.request.camera, |(still, _)| still);
        let rays = still.rays(origin)?;
        let clip_planes = still.planes_along_rays()?;
        let scene_lights = if job.settings.enable_scene_lights { job.snapshot.lights.as_slice() } else { &[] };
        let dome_visible = job.settings.dome_light_camera_visible;
        let files = &*job.files;
        let (mut lights, mut warnings) =
            LightTable::new(&job.snapshot, scene_lights, dome_visible, files, &mut self.light_files);
        let textures = self.scene.open_textures(&job.snapshot, job.images.as_ref(), &job.settings);
        if let Some(meshes) = self.mesh_lights.get(&job.snapshot, job.images.as_ref().map(|_| textures)) {
            lights.add_meshes(&meshes);
            warnings.extend(meshes.warning.clone());
        }
        warnings.extend(self.mesh_lights.warning());
        let (carry, unknown) = ForcedFeatures::parse(&job.settings.carry);
        warnings.extend(unknown.iter().map(|name| format!("oocpt:carry: {name:?} is no feature")));
        for warning in warnings {
            gate.shared().report(Severity::Warning, warning);
        }
        let light_carry = if carry.is_empty() { Features::empty() } else { lights.carry() };
        self.light_tables.sync(device, &lights)?;
        self.make_images(device, job)?;
        let Some(film) = self.film.take() else {
            return Err(RenderError::Internal("the frame's images were not made".into()));
        };
        let tables = std::mem::take(&mut self.light_tables);
        let setting = FrameContext {
            device,
            job,
            rays: &rays,
            camera_motion: in_motion.as_ref().map(|(_, motion)| motion),
            clip_planes: &clip_planes,
            lights: &lights,
            lighting: tables.lighting,
            film: &film,
            tables: &tables,
            carry: &carry,
            light_carry,
            is_frugal: self.is_frugal,
            has_outgrown: self.outgrown.as_ref().is_some_and(|snapshot| Arc::ptr_eq(snapshot, &job.snapshot)),
        };
        let result = self.render_scene(&setting, gate, progress);
        self.film = Some(film);
        self.light_tables = tables;
        result
    }

    /// Renders in core if the scene fits; otherwise streams what the rays ask for.
    fn render_scene(
        &mut self,
        setting: &FrameContext<'_>,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        let (device, job) = (setting.device, setting.job);
        progress.stage("uploading the scene");
        let mut scenes = std::mem::take(&mut self.scene);
        let scene = scenes.sync(&job.snapshot, job.images.as_ref())?;
        progress.scene(&scene.assets);
        for warning in &scene.assets.textures.warnings {
            gate.shared().report(Severity::Warning, warning.clone());
        }
        if let Some(cap) = geometry_cap(job) {
            scene.keep_within(cap);
        }
        let missing = scene.missing_bytes();
        let mut in_core = self.fits(setting, scene, missing) && !self.comes_meanwhile(setting, missing);
        if in_core {
            self.stream = None;
            scene.store.kept().limit(0);
            scene.unmap(device, maps_host(device, &job.settings));
            let_tiles_be_mapped(setting, scene)?;
            match scene.load_all(device, gate, &mut progress.timings) {
                Ok(true) => {}
                Ok(false) => {
                    self.scene = scenes;
                    return Ok(());
                }
                Err(error @ RenderError::Budget { .. }) => {
                    tracing::info!(%error, "the scene does not fit after all");
                    scene.clear(device)?;
                    in_core = false;
                }
                Err(error) => return Err(error),
            }
        }
        progress.streaming(|stats| stats.in_core = in_core);
        let result = if in_core {
            self.render_in_core(setting, scene, None, gate, progress)
        } else {
            self.render_beyond(setting, scene, gate, progress)
        };
        for complaint in scene.assets.textures.take_complaints().into_iter().chain(scene.store.take_left_out()) {
            gate.shared().report(Severity::Warning, complaint);
        }
        self.scene = scenes;
        result
    }

    /// Renders a scene that does not fit the device: streams it until all of it is on the device or in host memory,
    /// should that happen, and renders the rest in core.
    fn render_beyond(
        &mut self,
        setting: &FrameContext<'_>,
        scene: &mut DeviceScene,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        let mut first = None;
        if !(streaming::may_split(setting, scene) && scene.is_all_there()) {
            self.waves = None;
            first = streaming::render(setting, scene, (&mut self.stream, &mut self.ahead), gate, progress)?;
            if first.is_none() {
                return Ok(());
            }
        }
        self.stream = None;
        // The passes of scenes in core never ask whether a chunk is resident.
        if !scene.is_all_there() {
            return Err(RenderError::Internal("a chunk went before the passes that count on it".into()));
        }
        scene.show_where_it_is(setting.device)?;
        let mapped = setting.device.host_heap_if_made().map_or(0, |heap| heap.stats().live_bytes);
        let held = scene.store.bytes();
        progress.streaming(|stats| {
            (stats.is_split, stats.mapped_bytes, stats.geometry_bytes) = (true, mapped, held);
            if first.is_none() {
                stats.hit_rate = 1.0;
            }
        });
        self.render_in_core(setting, scene, first, gate, progress)
    }

    /// Returns true if a scene that fits, but of which bytes are missing on the device, is rendered while these are
    /// loaded. Not on processors, where loading takes the cores that trace.
    fn comes_meanwhile(&mut self, setting: &FrameContext<'_>, missing: u64) -> bool {
        #[cfg(feature = "faults")]
        if setting.job.options.faults.streams_first {
            return setting.job.generation == 1;
        }
        !is_cpu(setting.device) && self.upload.streams(missing, paths(setting.job))
    }

    /// Returns true if the whole scene, of which bytes are missing on the device, fits what the settings and the device
    /// allow, with room for waves.
    fn fits(&mut self, setting: &FrameContext<'_>, scene: &DeviceScene, missing: u64) -> bool {
        let (gpu, job) = (&setting.device.gpu, setting.job);
        let cap = geometry_cap(job);
        // A report of the chunks counts rays and loads, which only streaming does.
        let streams = self.is_frugal || job.options.force_streaming || !job.settings.chunk_report.is_empty();
        // Texture tiles are loaded on demand: a few of them may be enough.
        let least = scene.assets.geometry_bytes() + scene.assets.tile_bytes.min(FEWEST_TILES);
        if streams || setting.has_outgrown || cap.is_some_and(|cap| least > cap) {
            return false;
        }
        let missing = missing + scene.assets.tile_bytes.min(FEWEST_TILES);
        let waves = if self.waves.is_some() { 0 } else { roomy_waves(setting, scene) };
        let unused_arenas = || {
            let heap = setting.device.heap.stats();
            heap.arena_bytes.saturating_sub(heap.used_bytes)
        };
        let fits = |gpu: &Gpu| {
            let memory = gpu.memory();
            let needed = (missing + missing / PACKING).saturating_sub(unused_arenas());
            memory.used.saturating_add(needed).saturating_add(waves) <= memory.budget
        };
        if !fits(gpu) {
            // Buffers of an earlier streamed render are not needed by a scene that fits.
            self.stream = None;
        }
        fits(gpu)
    }

    /// Renders the paths from `first` on of a scene that is wholly resident.
    fn render_in_core(
        &mut self,
        setting: &FrameContext<'_>,
        scene: &mut DeviceScene,
        first: Option<u64>,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        let device = setting.device;
        let held = scene.tile_bytes_held();
        progress.streaming(|stats| stats.texture_bytes = held);
        let view = scene.view(scene.stack_entries())?;
        let parts = CompiledFeatures::new(setting, &view, false);
        let mut view = if setting.carry.levels { view.deepest(scene.stack_entries()) } else { view };
        if let Some((stack_size, passes)) = self.ahead.serves(parts.compiled_for(setting, &view)?.0) {
            view.stack_size = stack_size;
            progress.streaming(|stats| stats.compiled_ahead = passes);
        }
        self.make_waves(setting, &view, parts.features, (scene.assets.tile_bytes, scene.maps_tiles(device)))?;
        let Some(paths) = &self.waves else {
            return Err(RenderError::Internal("the frame's waves were not made".into()));
        };
        let tiles = scene.assets.textures.tile_count();
        let feedback = paths.incomplete_paths();
        let feedback = feedback.map(|paths| FeedbackBuffers::new(&device.gpu, tiles, paths.address())).transpose()?;
        let mut listed = RenderInventory::default();
        scene.list(&mut listed, true);
        paths.list(&mut listed);
        if let Some(feedback) = &feedback {
            feedback.list(&mut listed);
        }
        let bind =
            |block: &mut FrameConstants| block.texture_feedback = feedback.as_ref().map_or(0, FeedbackBuffers::address);
        let mut tracer = WavefrontTracer::new(setting, paths, (&view, parts), listed, bind, progress)?;
        if let (Some(feedback), Some(incomplete_paths)) = (&feedback, paths.incomplete_paths()) {
            tracer.traces_into(feedback.written().into_iter().chain([incomplete_paths]).collect());
        }
        let tiles = FrameTiles { scene, cap: geometry_cap(setting.job), feedback: feedback.as_ref() };
        engine::render(&mut WaveSource::new(tracer, tiles, feedback.as_ref(), first), gate, progress).map(|_| ())
    }

    fn open(&mut self, job: &RenderJob) -> Result<Arc<Device>, RenderError> {
        let options = DeviceOptions {
            selector: job.settings.device.clone(),
            validation: job.options.validation,
            budget_mib: job.settings.memory_budget_mib,
            pipeline_cache: pipeline_folder(&job.settings.pipeline_cache),
        };
        if self.device.as_ref().is_some_and(|have| !have.serves(&options)) {
            *self = Self::default();
        }
        let device = Device::open(&options)?;
        if !self.device.as_ref().is_some_and(|have| Arc::ptr_eq(have, &device)) {
            *self = Self { device: Some(Arc::clone(&device)), ..Self::default() };
        }
        Ok(device)
    }

    fn make_images(&mut self, device: &Device, job: &RenderJob) -> Result<(), RenderError> {
        let adaptive = job.settings.adaptive_sampling;
        if !self.film.as_ref().is_some_and(|film| film.fits(&job.request, adaptive)) {
            self.film = None;
            self.film = Some(Film::new(&device.gpu, &job.request, adaptive)?);
        }
        self.film.as_mut().map_or(Ok(()), |film| film.begin(job))
    }

    /// Allocates wave memory as [`crate::in_flight`] says, but no more than a share of what the budget leaves
    /// ([`share_of_waves`]), and less if memory runs out. `tiles`: the bytes of all tiles, and whether they are mapped.
    fn make_waves(
        &mut self,
        setting: &FrameContext<'_>,
        view: &SceneView,
        features: Features,
        tiles: (u64, bool),
    ) -> Result<(), RenderError> {
        let FrameContext { device, .. } = *setting;
        let textures = features.contains(Features::TEXTURES);
        let needs = path_needs(setting, textures, features.contains(Features::DEFERRED_CUTOUTS));
        let path_bytes = needs.bytes_a_path(view.max_levels);
        let wanted = in_flight(setting, path_bytes).wanted();
        let fits = |waves: &PathBuffers| waves.serves(view.max_levels, needs) && waves.asked >= wanted;
        if self.waves.as_ref().is_some_and(fits) {
            return Ok(());
        }
        self.waves = None;
        let memory = device.gpu.memory();
        // Once the scene is resident, only tiles of textures are still to be loaded.
        let unused = memory.budget.saturating_sub(memory.used);
        let share = share_of_waves(unused, if textures { tiles.0 } else { 0 }, tiles.1);
        let capacity = wanted.min(share / path_bytes).max(in_flight::FEWEST);
        let mut waves = shrinking(capacity, in_flight::FEWEST, |capacity| {
            PathBuffers::new(&device.gpu, capacity, view.max_levels, needs)
        })?;
        waves.asked = wanted;
        self.waves = Some(waves);
        Ok(())
    }
}
