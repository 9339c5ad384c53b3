// SPDX-License-Identifier: Apache-2.0
//! Renders one frame from a job to its images; the functions here are the outline of a render.
//!
//! Render thread only. The device, the scene, the wave memory and the images are kept from frame to frame where they
//! can be.

mod film_windows;
mod first_picture;
mod moved_window;
mod upload;

use crate::assets::{DeviceScene, SceneCache, SceneView};
use crate::device::{Device, DeviceOptions, pipeline_folder};
use crate::engine::{self, CompiledFeatures, FrameTiles, WaveSource, WavefrontTracer};
use crate::error::RenderError;
use crate::feedback::FeedbackBuffers;
use crate::film::{Film, FilmSums};
use crate::frame::context::{FrameContext, geometry_cap, in_flight, is_cpu, maps_host, paths, shrinking};
use crate::frame::film_part::makes_part;
use crate::frame::in_core::{ROOM_FOR_TILES, path_needs, roomy_waves, share_of_waves};
use crate::frame::in_flight;
use crate::frame::kept_samples::KeptSamples;
use crate::frame::progress::FrameProgress;
use crate::frame::view::CameraView;
use crate::host_memory::HostMemoryUser;
use crate::job::RenderJob;
use crate::job::request::Severity;
use crate::job::shared::FrameGate;
use crate::job::timings::RenderTimings;
use crate::lights::{FileCache, KeptLights, LightSource, LightTable, LightTables, MeshLightCache};
use crate::streaming::{self, StreamBuffers};
use crate::sync::lock;
use crate::wavefront::{BackgroundCompile, PathBuffers};
use film_windows::FilmShare;
use first_picture::FirstPictures;
use oocpt_abi::{Features, FrameConstants};
use oocpt_core::inventory::RenderInventory;
use oocpt_core::scene::Snapshot;
#[cfg(feature = "faults")]
use oocpt_gpu::{DriverCall, PlantedFailure};
use oocpt_gpu::{Gpu, GpuError};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;
use upload::UploadDecision;

/// One part in so many of a scene's bytes is lost at most between the ranges of arenas.
const PACKING: u64 = 24;

/// Shapes of trees over records that move may take one part in so many of what encoded geometry may: they are a
/// sixteenth of its bytes.
const SHAPES_SHARE: u64 = 8;

/// Sets the limit of host memory in which rays read the tiles of a scene in core that find no room on the device.
fn limit_mapped_tiles(context: &FrameContext<'_>, scene: &DeviceScene) -> Result<(), RenderError> {
    let FrameContext { device, job, .. } = *context;
    if scene.maps_tiles && scene.assets.tile_bytes > 0 {
        let heap = device.host_heap()?;
        let held = heap.stats().arena_bytes + heap.stats().dedicated_bytes;
        let limit = job.host_limit(HostMemoryUser::Encoded, held);
        heap.set_limit(Some(limit));
    }
    Ok(())
}

/// Sets the limit of host memory for shapes of trees over records that move.
fn limit_shapes(job: &RenderJob, scene: &DeviceScene) {
    let shapes = scene.store.shapes();
    if scene.assets.shapes().next().is_none() {
        return shapes.limit(0);
    }
    let encoded = job.host_limit(HostMemoryUser::Encoded, shapes.bytes());
    shapes.limit(encoded / SHAPES_SHARE);
}

/// Whether memory was too short.
fn is_short(result: &Result<(), RenderError>) -> bool {
    let is_short = matches!(result, Err(RenderError::Budget { .. } | RenderError::NoProgress { .. }));
    if let (true, Err(error)) = (is_short, result) {
        tracing::info!(%error, "memory is short");
    }
    is_short
}

/// The state that the render thread keeps from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Renderer {
    device: Option<Arc<Device>>,
    scene: SceneCache,
    waves: Option<PathBuffers>,
    /// Where waves of a scene in core say what tiles they lack.
    feedback: Option<FeedbackBuffers>,
    stream: Option<StreamBuffers>,
    ahead: BackgroundCompile,
    film: Option<Film>,
    /// Samples of `film`.
    kept: Option<KeptSamples>,
    first_pictures: FirstPictures,
    light_files: FileCache,
    mesh_lights: MeshLightCache,
    /// Whose tables `light_tables` has.
    lights: Option<KeptLights>,
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
        if job.request.part().is_empty() {
            return progress.show_nothing(job);
        }
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

    /// Renders samples of a picture that several devices render: `job` has [`RenderJob::team`]. A device that is lost
    /// is an error.
    pub(crate) fn render_team_block(
        &mut self,
        job: &RenderJob,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        self.render_once(job, gate, progress, u32::MAX)
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
        device.reading.set_limit(job.reading_limit());
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
        let mut share = FilmShare::Usual;
        let mut result = self.render_picture(&device, job, gate, progress, share);
        if is_short(&result) {
            self.begin_frugally(&device, progress)?;
            result = self.render_picture(&device, job, gate, progress, share);
        }
        if is_short(&result) && film_windows::are_smaller(job, &device.gpu) {
            share = FilmShare::Least;
            self.begin_frugally(&device, progress)?;
            result = self.render_picture(&device, job, gate, progress, share);
        }
        if let Err(error @ RenderError::TexturesOutgrow) = &result {
            tracing::info!(%error, "streaming");
            self.outgrown = Some(Arc::clone(&job.snapshot));
            device.gpu.wait_idle()?;
            progress.begin_again();
            result = self.render_picture(&device, job, gate, progress, share);
        }
        device.keep_pipelines(true);
        progress.end(&device.gpu);
        #[cfg(feature = "faults")]
        {
            *lock(&gate.shared().witness) = crate::job::faults::FaultWitness::of(&device.gpu);
        }
        if let Err(RenderError::Gpu(GpuError::DeviceLost { .. })) = &result {
            device.forget();
        }
        result
    }

    /// Frees everything that is held, to render again with as little memory as possible.
    fn begin_frugally(&mut self, device: &Arc<Device>, progress: &mut FrameProgress<'_>) -> Result<(), RenderError> {
        tracing::info!("trying again with as little memory as possible");
        progress.begin_again();
        self.scene.clear(device)?;
        *self = Self { device: Some(Arc::clone(device)), is_frugal: true, ..Self::default() };
        device.gpu.wait_idle()?;
        device.heap.trim();
        Ok(())
    }

    fn render_on(
        &mut self,
        device: &Arc<Device>,
        job: &RenderJob,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        let view = CameraView::of(job, gate.shared())?;
        let carry = &job.options.forced_features;
        let lights = self.sync_lights(device, job, progress)?;
        for warning in &lights.warnings {
            gate.shared().report(Severity::Warning, warning.clone());
        }
        let kept = self.kept.take().filter(|kept| kept.serve(job));
        let makes_part = makes_part(gate.shared(), job);
        self.make_images(device, job, makes_part, kept.is_some())?;
        let Some(film) = self.film.take() else {
            return Err(RenderError::Internal("the frame's images were not made".into()));
        };
        progress.begin_checkpoints(job, &device.gpu, &film, kept.is_none())?;
        progress.begin_part(job, &device.gpu, &film)?;
        if let Some(kept) = kept {
            progress.go_on(kept, job);
        }
        let tables = std::mem::take(&mut self.light_tables);
        let context = FrameContext {
            device,
            job,
            rays: &view.rays,
            camera_motion: view.motion.as_ref(),
            clip_planes: &view.clip_planes,
            lights: &lights.table,
            lighting: tables.lighting,
            film: &film,
            tables: &tables,
            carry,
            allowed_by_lights: lights.carried,
            pace: self.first_pictures.pace.rate().filter(|_| job.settings.interactive || job.team.is_some()),
            is_frugal: self.is_frugal,
            has_outgrown: self.outgrown.as_ref().is_some_and(|snapshot| Arc::ptr_eq(snapshot, &job.snapshot)),
        };
        let result = self.render_scene(&context, gate, progress);
        self.kept = progress.samples(job, &film).filter(|_| result.is_ok());
        let result = result.and_then(|()| progress.end_checkpoints(job, &film));
        let result = result.and_then(|()| progress.end_part(&film));
        self.film = Some(film);
        self.light_tables = tables;
        self.lights = Some(lights);
        result
    }

    /// Makes the device have the lights of `job`: those of the frame before, if nothing of them can have changed.
    fn sync_lights(
        &mut self,
        device: &Device,
        job: &RenderJob,
        progress: &mut FrameProgress<'_>,
    ) -> Result<KeptLights, RenderError> {
        let source = LightSource::of(job);
        let textures = self.scene.open_textures(&job.snapshot, job.images.as_ref(), &job.settings);
        if let Some(kept) = self.lights.take().filter(|kept| kept.serve(&source)) {
            return Ok(kept);
        }
        let scene_lights = if job.settings.enable_scene_lights { job.snapshot.lights.as_slice() } else { &[] };
        let dome_visible = job.settings.dome_light_camera_visible;
        let (mut table, mut warnings) =
            LightTable::new(&job.snapshot, scene_lights, dome_visible, &*job.files, &mut self.light_files);
        if let Some(meshes) = self.mesh_lights.get(&job.snapshot, job.images.as_ref().map(|_| textures)) {
            table.add_meshes(&meshes);
            warnings.extend(meshes.warning.clone());
        }
        warnings.extend(self.mesh_lights.warning());
        let carry = &job.options.forced_features;
        let carried = if carry.is_empty() { Features::empty() } else { table.carry() };
        self.light_tables.sync(device, &table)?;
        progress.timings.light_tables += 1;
        Ok(KeptLights { source, table, carried, warnings })
    }

    /// Renders from a scene that is all there, or, where it does not fit, from what the rays ask for.
    fn render_scene(
        &mut self,
        context: &FrameContext<'_>,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        let (device, job) = (context.device, context.job);
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
        // A cap on geometry counts tiles, wherever they are.
        scene.maps_tiles = maps_host(device, &job.settings) && geometry_cap(job).is_none();
        limit_shapes(job, scene);
        let mut in_core = self.comes_in_core(context, scene, (gate, &mut progress.timings))?;
        if in_core {
            self.stream = None;
            scene.store.kept().limit(0);
            scene.unmap(device, scene.maps_tiles);
            limit_mapped_tiles(context, scene)?;
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
        if !in_core {
            scene.store.stop_placing();
            gate.shared().places_moved.store(false, Ordering::Relaxed);
        }
        progress.streaming(|stats| stats.in_core = in_core);
        progress.note_levels(scene.store.shapes().take_counts());
        let result = if in_core {
            self.render_in_core(context, scene, progress.kept(), gate, progress)
        } else {
            self.render_beyond(context, scene, gate, progress)
        };
        progress.note_levels(scene.store.shapes().take_counts());
        for complaint in scene.assets.textures.take_complaints().into_iter().chain(scene.take_left_out()) {
            gate.shared().report(Severity::Warning, complaint);
        }
        self.scene = scenes;
        result
    }

    /// Places what moved where the device can, and says whether the scene is then rendered in core.
    fn comes_in_core(
        &mut self,
        context: &FrameContext<'_>,
        scene: &mut DeviceScene,
        (gate, timings): (&FrameGate<'_>, &mut RenderTimings),
    ) -> Result<bool, RenderError> {
        if let Some(is_placed) = scene.place_moved(context.device, timings)? {
            gate.shared().places_moved.store(is_placed, Ordering::Relaxed);
        }
        let missing = scene.missing_bytes();
        let mut fits = self.fits(context, scene, missing);
        if !fits && scene.store.placing_bytes() > 0 {
            scene.store.stop_placing();
            fits = self.fits(context, scene, missing);
        }
        Ok(fits && !self.comes_meanwhile(context, missing))
    }

    /// Renders a scene that does not fit the device: streams it until all of it is on the device or in host memory,
    /// should that happen, and renders the rest in core.
    fn render_beyond(
        &mut self,
        context: &FrameContext<'_>,
        scene: &mut DeviceScene,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        let (mut first, mut has_streamed) = (progress.kept(), false);
        if !(streaming::may_split(context, scene) && scene.is_all_there()) {
            self.waves = None;
            // The first time, memory is made as large as the whole picture needs it.
            if self.stream.is_some() && first.is_none() {
                self.show_first(context, gate, |renderer, context, gate, progress| {
                    streaming::render(context, scene, (&mut renderer.stream, &mut renderer.ahead), gate, progress)
                        .map(|_| ())
                })?;
            }
            first = streaming::render(context, scene, (&mut self.stream, &mut self.ahead), gate, progress)?;
            if first.is_none() {
                return Ok(());
            }
            has_streamed = true;
        }
        self.stream = None;
        // The passes of scenes in core never ask whether a chunk is resident.
        if !scene.is_all_there() {
            return Err(RenderError::Internal("a chunk went before the passes that count on it".into()));
        }
        scene.show_where_it_is(context.device)?;
        let mapped = context.device.host_heap_if_made().map_or(0, |heap| heap.stats().live_bytes);
        let held = scene.store.bytes();
        progress.streaming(|stats| {
            (stats.is_split, stats.mapped_bytes, stats.geometry_bytes) = (true, mapped, held);
            if !has_streamed {
                stats.hit_rate = 1.0;
            }
        });
        self.render_in_core(context, scene, first, gate, progress)
    }

    /// Whether a scene that fits, but of which bytes are missing on the device, is rendered while these are loaded. Not
    /// on processors, where loading takes the cores that trace.
    fn comes_meanwhile(&mut self, context: &FrameContext<'_>, missing: u64) -> bool {
        #[cfg(feature = "faults")]
        if context.job.options.faults.streams_first {
            return context.job.generation == 1;
        }
        !is_cpu(context.device) && self.upload.streams(missing, paths(context.job))
    }

    /// Whether the whole scene, of which bytes are missing on the device, fits what the settings and the device allow,
    /// with room for waves.
    fn fits(&mut self, context: &FrameContext<'_>, scene: &DeviceScene, missing: u64) -> bool {
        let (gpu, job) = (&context.device.gpu, context.job);
        let cap = geometry_cap(job);
        // A report of the chunks counts rays and loads, which only streaming does.
        let streams = self.is_frugal || job.options.force_streaming || !job.settings.chunk_report.is_empty();
        // Texture tiles are loaded on demand: a few of them may be enough.
        let least = scene.assets.geometry_bytes() + scene.assets.tile_bytes.min(ROOM_FOR_TILES);
        if streams || context.has_outgrown || cap.is_some_and(|cap| least > cap) {
            return false;
        }
        let missing = missing + scene.assets.tile_bytes.min(ROOM_FOR_TILES);
        let waves = if self.waves.is_some() { 0 } else { roomy_waves(context, scene) };
        let unused_arenas = || {
            let heap = context.device.heap.stats();
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
        context: &FrameContext<'_>,
        scene: &mut DeviceScene,
        first: Option<u64>,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        if first.is_none() {
            self.show_first(context, gate, |renderer, context, gate, progress| {
                renderer.trace_in_core(context, scene, None, gate, progress)
            })?;
        }
        #[cfg(feature = "faults")]
        if context.job.options.faults.first_picture_alone {
            return Ok(());
        }
        let held = scene.tile_bytes_held();
        progress.streaming(|stats| stats.texture_bytes = held);
        let began = Instant::now();
        // Where there is no other first picture, the first sample of each pixel is it.
        let gate =
            if context.job.settings.interactive { gate.for_first_picture(first_picture::PATIENCE) } else { *gate };
        self.trace_in_core(context, scene, first, &gate, progress)?;
        let pixels = context.job.request.pixels();
        if context.job.catches_up {
            return Ok(()); // a few pixels, on which the device is slow
        }
        if progress.timings.paths >= pixels {
            self.first_pictures.pace.learn(progress.timings.paths, progress.timings.trace_secs);
        } else if gate.is_superseded() {
            self.first_pictures.pace.learn_at_most(pixels, began.elapsed().as_secs_f64());
        }
        Ok(())
    }

    /// Shows the first picture of a job, if it is to have one ([`first_picture`]), which `render` traces.
    fn show_first(
        &mut self,
        context: &FrameContext<'_>,
        gate: &FrameGate<'_>,
        render: impl FnOnce(&mut Self, &FrameContext<'_>, &FrameGate<'_>, &mut FrameProgress<'_>) -> Result<(), RenderError>,
    ) -> Result<(), RenderError> {
        let mut kept = std::mem::take(&mut self.first_pictures);
        if let Some(picture) = (!context.is_frugal).then(|| kept.begin(context.device, context.job)).flatten() {
            let began = Instant::now();
            let view = CameraView::of(&picture.job, &kept.apart)?;
            let inner = FrameContext {
                job: &picture.job,
                rays: &view.rays,
                camera_motion: view.motion.as_ref(),
                clip_planes: &view.clip_planes,
                film: &picture.film,
                ..*context
            };
            let gate = gate.for_first_picture(first_picture::PATIENCE);
            let mut progress = FrameProgress::start(&kept.apart, &picture.job);
            match render(self, &inner, &gate, &mut progress) {
                // The whole picture finds out what to do about it.
                Err(
                    error
                    @ (RenderError::Budget { .. } | RenderError::NoProgress { .. } | RenderError::TexturesOutgrow),
                ) => tracing::debug!(%error, "no first picture"),
                result => result?,
            }
            let is_whole = !picture.film.has_color() || progress.paths_done() >= progress.total_paths();
            let done = (progress.is_finished() && is_whole).then(|| began.elapsed().as_secs_f64());
            drop(progress);
            kept.end(picture, done, &mut lock(&gate.shared().published), is_cpu(context.device));
        }
        self.first_pictures = kept;
        Ok(())
    }

    fn trace_in_core(
        &mut self,
        context: &FrameContext<'_>,
        scene: &mut DeviceScene,
        first: Option<u64>,
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<(), RenderError> {
        let device = context.device;
        let view = scene.view(scene.stack_entries())?;
        let parts = CompiledFeatures::new(context, &view, false);
        let mut view = if context.carry.levels { view.deepest(scene.stack_entries()) } else { view };
        if let Some((stack_size, passes)) = self.ahead.serves(parts.compiled_for(context, &view)?.0) {
            view.stack_size = stack_size;
            progress.streaming(|stats| stats.compiled_ahead = passes);
        }
        self.make_waves(context, &view, parts.features, (scene.assets.tile_bytes, scene.maps_tiles))?;
        let Some(paths) = &self.waves else {
            return Err(RenderError::Internal("the frame's waves were not made".into()));
        };
        let tiles = scene.assets.textures.tile_count();
        let feedback = paths.incomplete_paths();
        let known = self.feedback.take();
        let feedback = match feedback.map(|paths| paths.address()) {
            Some(paths) => match known.filter(|known| known.are_of(tiles, paths)) {
                Some(known) => Some(known),
                None => Some(FeedbackBuffers::new(&device.gpu, tiles, paths)?),
            },
            None => None,
        };
        let mut listed = RenderInventory::default();
        scene.list(&mut listed, true);
        paths.list(&mut listed);
        if let Some(feedback) = &feedback {
            feedback.list(&mut listed);
        }
        let bind =
            |block: &mut FrameConstants| block.texture_feedback = feedback.as_ref().map_or(0, FeedbackBuffers::address);
        let mut tracer = WavefrontTracer::new(context, paths, (&view, parts), listed, bind, progress)?;
        if let (Some(feedback), Some(incomplete_paths)) = (&feedback, paths.incomplete_paths()) {
            tracer.traces_into(feedback.written().into_iter().chain([incomplete_paths]).collect());
        }
        let tiles = FrameTiles { scene, cap: geometry_cap(context.job), feedback: feedback.as_ref() };
        let done = engine::render(&mut WaveSource::new(tracer, tiles, feedback.as_ref(), first), gate, progress);
        self.feedback = feedback;
        done.map(|_| ())
    }

    fn open(&mut self, job: &RenderJob) -> Result<Arc<Device>, RenderError> {
        let options = DeviceOptions {
            selector: job.settings.device.clone(),
            twin: job.team.as_ref().map_or(0, |team| team.twin),
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

    /// Allocates the images of `job`; with `keeps` the samples of the film stay.
    fn make_images(
        &mut self,
        device: &Device,
        job: &RenderJob,
        makes_part: bool,
        keeps: bool,
    ) -> Result<(), RenderError> {
        let sums = FilmSums::of(job, makes_part);
        if !self.film.as_ref().is_some_and(|film| film.fits(&job.request, sums)) {
            self.film = match self.film.take().filter(|_| keeps) {
                Some(film) => Some(film.with_images_of(&device.gpu, &job.request)?),
                None => Some(Film::new(&device.gpu, &job.request, sums)?),
            };
        }
        self.film.as_mut().map_or(Ok(()), |film| film.begin(job))
    }

    /// Allocates wave memory as [`crate::frame::in_flight`] says, but no more than a share of what the budget leaves
    /// ([`share_of_waves`]), and less if memory runs out. `tiles`: the bytes of all tiles, and whether they are mapped.
    fn make_waves(
        &mut self,
        context: &FrameContext<'_>,
        view: &SceneView,
        features: Features,
        tiles: (u64, bool),
    ) -> Result<(), RenderError> {
        let FrameContext { device, .. } = *context;
        let textures = features.contains(Features::TEXTURES);
        let needs = path_needs(context, textures, features.contains(Features::DEFERRED_CUTOUTS));
        let path_bytes = needs.bytes_a_path(view.max_levels);
        let wanted = in_flight(context, path_bytes).wanted();
        let fits = |waves: &PathBuffers| waves.serves(view.max_levels, needs) && waves.asked >= wanted;
        if self.waves.as_ref().is_some_and(fits) {
            return Ok(());
        }
        self.waves = None;
        let memory = device.gpu.memory();
        // Once the scene is resident, only tiles of textures are still to be loaded.
        let unused = memory.budget.saturating_sub(memory.used);
        let share = share_of_waves(unused, if textures { tiles.0 } else { 0 }, tiles.1);
        let capacity = wanted.min(share / path_bytes).max(in_flight::MIN_PATHS);
        let mut waves = shrinking(capacity, in_flight::MIN_PATHS, |capacity| {
            PathBuffers::new(&device.gpu, capacity, view.max_levels, needs)
        })?;
        waves.asked = wanted;
        self.waves = Some(waves);
        Ok(())
    }
}
