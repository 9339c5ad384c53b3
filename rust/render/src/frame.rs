// SPDX-License-Identifier: Apache-2.0
//! One frame from a job to its images: the table of contents of a render.
//!
//! Render thread only. What can be kept from frame to frame (device, scene, wave memory, images) is kept.

mod block;

pub(crate) use block::frame_block;

use crate::assets::{Scene, SceneCache, SceneView};
use crate::device::{Device, DeviceOptions};
use crate::error::RenderError;
use crate::feedback::Feedback;
use crate::film::Film;
use crate::inventory::{self, Compiled};
use crate::lights::{FileCache, LightTable, LightTables, MeshLightCache};
use crate::progress::Progress;
use crate::request::Severity;
use crate::schedule::{Schedule, first_wave};
use crate::session::Job;
use crate::specialise::{self, Carry};
use crate::streaming::{self, StreamBuffers};
use crate::sync::lock;
use crate::thread::Gate;
use crate::tile_waves::Tiles;
use crate::wavefront::{Passes, PathBuffers, PathNeeds};
use crate::waves::{self, Frames};
use oocpt_core::camera::CameraRays;
use oocpt_core::inventory::Inventory;
use oocpt_core::scene::{SceneFeatures, Snapshot};
use oocpt_gpu::{Buffer, DeviceKind, Gpu, GpuError, Usage};
use oocpt_shader_abi::{Features, Frame, path_bytes};
use std::sync::Arc;

/// Largest wave, paths.
const MAX_WAVE: u64 = 1 << 22;
/// Smallest wave, paths.
const MIN_WAVE: u64 = 1 << 12;
/// What a wave should take, seconds; it is submitted in parts of about a third of that.
const WAVE_SECS: f64 = 0.2;
/// A scene counts as fitting only when it leaves room for waves of this many paths (or of all there are).
const ROOMY_WAVE: u64 = 1 << 16;

/// A scene counts as fitting only when it leaves room for tiles of textures of so many bytes (or for all there are).
const FEWEST_TILES: u64 = 8 << 20;

/// What the render thread keeps from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Renderer {
    device: Option<Arc<Device>>,
    scene: SceneCache,
    waves: Option<PathBuffers>,
    stream: Option<StreamBuffers>,
    film: Option<Film>,
    light_files: FileCache,
    mesh_lights: MeshLightCache,
    light_tables: LightTables,
    /// Memory is short: streams even if the scene seems to fit, with few paths at a time.
    is_frugal: bool,
    /// The scene whose textures did not fit when it was rendered in core: it is streamed.
    outgrown: Option<Arc<Snapshot>>,
}

/// What a frame renders with besides its scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setting<'a> {
    pub(crate) device: &'a Arc<Device>,
    pub(crate) job: &'a Job,
    pub(crate) rays: &'a CameraRays,
    pub(crate) lights: &'a LightTable,
    /// Address of the light table on the device, or 0.
    pub(crate) lighting: u64,
    pub(crate) film: &'a Film,
    pub(crate) tables: &'a LightTables,
    /// What is carried although the scene does not need it.
    pub(crate) carry: &'a Carry,
    /// Of that, what these lights allow.
    pub(crate) light_carry: Features,
    /// Memory is short.
    pub(crate) is_frugal: bool,
}

impl Renderer {
    /// Renders `job` until it is done or `gate` says no; publishes images and stats on the way. Running out of memory gives back
    /// everything that is held and tries once more with as little as possible.
    pub(crate) fn render(&mut self, job: &Job, gate: &Gate<'_>) -> Result<(), RenderError> {
        job.request.validate()?;
        let mut progress = Progress::start(gate.shared(), job);
        let device = self.open(job)?;
        *lock(&gate.shared().device) = Some(device.gpu.report().clone());
        progress.device_opened(job);
        if let Some(requests) = job.options.fail_allocation_after {
            device.gpu.fail_allocation_after(requests);
        }
        self.is_frugal = false;
        let mut result = self.render_on(&device, job, gate, &mut progress);
        if let Err(error @ RenderError::Budget { .. }) = &result {
            tracing::info!(%error, "trying again with as little memory as possible");
            *self = Self { device: Some(Arc::clone(&device)), is_frugal: true, ..Self::default() };
            device.gpu.wait_idle()?;
            device.heap.trim();
            result = self.render_on(&device, job, gate, &mut progress);
        }
        if let Err(error @ RenderError::TexturesOutgrow) = &result {
            tracing::info!(%error, "streaming");
            self.outgrown = Some(Arc::clone(&job.snapshot));
            device.gpu.wait_idle()?;
            progress.begin_again();
            result = self.render_on(&device, job, gate, &mut progress);
        }
        progress.end(&device.gpu);
        if let Err(RenderError::Gpu(GpuError::DeviceLost { .. })) = &result {
            device.forget();
        }
        result
    }

    fn render_on(
        &mut self,
        device: &Arc<Device>,
        job: &Job,
        gate: &Gate<'_>,
        progress: &mut Progress<'_>,
    ) -> Result<(), RenderError> {
        let rays = job.request.camera.rays(job.snapshot.origin)?;
        let scene_lights = if job.settings.enable_scene_lights { job.snapshot.lights.as_slice() } else { &[] };
        let dome_visible = job.settings.dome_light_camera_visible;
        let files = &*job.files;
        let has_materials = job.snapshot.features.contains(SceneFeatures::MATERIALS);
        let (mut lights, mut warnings) =
            LightTable::new(&job.snapshot, scene_lights, dome_visible, has_materials, files, &mut self.light_files);
        let textures = self.scene.open_textures(&job.snapshot, job.images.as_ref(), &job.settings);
        if let Some(meshes) = self.mesh_lights.get(&job.snapshot, job.images.as_ref().map(|_| textures)) {
            lights.add_meshes(&meshes);
            warnings.extend(meshes.warning.clone());
        }
        let (carry, unknown) = Carry::parse(&job.settings.carry);
        warnings.extend(unknown.iter().map(|name| format!("oocpt:carry: {name:?} is no feature")));
        for warning in warnings {
            gate.shared().report(Severity::Warning, warning);
        }
        let light_carry = match &mut lights.general {
            Some(general) if !carry.is_empty() => general.carry(),
            _ => Features::empty(),
        };
        self.light_tables.sync(device, lights.general.as_ref())?;
        self.make_images(device, job)?;
        let Some(film) = self.film.take() else {
            return Err(RenderError::Internal("the frame's images were not made".into()));
        };
        let tables = std::mem::take(&mut self.light_tables);
        let setting = Setting {
            device,
            job,
            rays: &rays,
            lights: &lights,
            lighting: tables.lighting,
            film: &film,
            tables: &tables,
            carry: &carry,
            light_carry,
            is_frugal: self.is_frugal,
        };
        let result = self.render_scene(&setting, gate, progress);
        self.film = Some(film);
        self.light_tables = tables;
        result
    }

    /// Renders from a scene that is all there, or, where it does not fit, from what the rays ask for.
    fn render_scene(
        &mut self,
        setting: &Setting<'_>,
        gate: &Gate<'_>,
        progress: &mut Progress<'_>,
    ) -> Result<(), RenderError> {
        let (device, job) = (setting.device, setting.job);
        progress.stage("uploading the scene");
        let mut scenes = std::mem::take(&mut self.scene);
        let scene = scenes.sync(device, &job.snapshot, job.images.as_ref())?;
        progress.scene(&scene.assets);
        for warning in &scene.assets.textures.warnings {
            gate.shared().report(Severity::Warning, warning.clone());
        }
        if let Some(cap) = geometry_cap(job) {
            scene.keep_within(cap);
        }
        let mut in_core = self.fits(setting, scene);
        if in_core {
            self.stream = None;
            match scene.load_all(device, setting.lights.distant(), gate, &mut progress.timings) {
                Ok(true) => {}
                Ok(false) => {
                    self.scene = scenes;
                    return Ok(());
                }
                Err(error @ RenderError::Budget { .. }) => {
                    tracing::info!(%error, "the scene does not fit after all");
                    scene.forget_loads()?;
                    in_core = false;
                }
                Err(error) => return Err(error),
            }
        }
        progress.streaming(|stats| stats.in_core = in_core);
        let result = if in_core {
            self.render_in_core(setting, scene, gate, progress)
        } else {
            self.waves = None;
            streaming::render(setting, scene, &mut self.stream, gate, progress)
        };
        for complaint in scene.assets.textures.take_complaints() {
            gate.shared().report(Severity::Warning, complaint);
        }
        self.scene = scenes;
        result
    }

    /// Whether the whole scene fits what the settings and the device allow, with room for waves.
    fn fits(&mut self, setting: &Setting<'_>, scene: &Scene) -> bool {
        let (gpu, job) = (&setting.device.gpu, setting.job);
        let cap = geometry_cap(job);
        // A report of the chunks counts rays and loads, which only streaming does.
        let has_outgrown = self.outgrown.as_ref().is_some_and(|snapshot| Arc::ptr_eq(snapshot, &job.snapshot));
        let streams = self.is_frugal || job.options.force_streaming || !job.settings.chunk_report.is_empty();
        // Texture tiles are loaded on demand: a few of them may be enough.
        let least = scene.assets.geometry_bytes() + scene.assets.tile_bytes.min(FEWEST_TILES);
        if streams || has_outgrown || cap.is_some_and(|cap| least > cap) {
            return false;
        }
        let missing = scene.missing_bytes(setting.lights.distant().len()) + scene.assets.tile_bytes.min(FEWEST_TILES);
        let waves = if self.waves.is_some() {
            0
        } else {
            ROOMY_WAVE.min(paths(job)) * path_bytes(scene.levels(), false, has_light_paths(setting))
        };
        let fits = |gpu: &Gpu| {
            let memory = gpu.memory();
            memory.used.saturating_add(missing).saturating_add(waves) <= memory.budget
        };
        if !fits(gpu) {
            // What streaming left behind is not needed when the scene fits.
            self.stream = None;
        }
        fits(gpu)
    }

    fn render_in_core(
        &mut self,
        setting: &Setting<'_>,
        scene: &mut Scene,
        gate: &Gate<'_>,
        progress: &mut Progress<'_>,
    ) -> Result<(), RenderError> {
        let Setting { device, job, film, .. } = *setting;
        let held = scene.tile_bytes_held();
        progress.streaming(|stats| stats.texture_bytes = held);
        let view = scene.view(scene.stack_entries())?;
        let mut needed = specialise::features(&job.snapshot, setting.lights, setting.rays, &view);
        needed.set(Features::ADAPTIVE, film.adaptive().is_some());
        let carried = setting.carry.possible(needed, setting.light_carry);
        let features = needed | carried;
        let view = if setting.carry.levels { view.deepest(scene.stack_entries()) } else { view };
        self.make_waves(setting, &view, features)?;
        let Some(buffers) = &self.waves else {
            return Err(RenderError::Internal("the frame's waves were not made".into()));
        };
        progress.stage("compiling passes");
        let special = specialise::specialisation(features, &view);
        let passes = Passes::new(device, special, film, &mut progress.timings)?;
        let bsdf_tables = device.bsdf_tables(features)?; // before the list of what there is
        let tiles = scene.assets.textures.tile_count();
        let feedback = buffers.incomplete_paths.as_ref();
        let feedback = feedback.map(|paths| Feedback::new(&device.gpu, tiles, paths.address())).transpose()?;
        let mut listed = Inventory::default();
        scene.list(&mut listed, true);
        buffers.list(&mut listed);
        if let Some(feedback) = &feedback {
            feedback.list(&mut listed);
        }
        let inventory = inventory::of_frame(setting, Compiled { passes: &passes, special, carried }, listed);
        progress.made_of(specialise::left_out(features, film.has_planes()), inventory);
        let mut block = frame_block(setting, &view);
        block.bsdf_tables = bsdf_tables;
        buffers.bind(&mut block);
        block.texture_feedback = feedback.as_ref().map_or(0, Feedback::address);
        let frame = Buffer::new(&device.gpu, "frame", size_of::<Frame>() as u64, Usage::Upload)?;
        frame.write(0, bytemuck::bytes_of(&block))?;
        let frames = Frames { device, film, buffers, passes: &passes, frame: &frame, job, feedback: feedback.as_ref() };
        let mut tiles = Tiles { scene, cap: geometry_cap(job), feedback: feedback.as_ref() };
        progress.stage("rendering");
        waves::clear(&frames)?;
        if !waves::trace_planes(&frames, &mut tiles, gate, progress)? {
            return Ok(());
        }
        let total = if film.has_color() { progress.total_paths() } else { 0 };
        let start = first_wave(device.gpu.report().kind);
        let mut schedule = Schedule::new(total, start, buffers.capacity, WAVE_SECS);
        if progress.wants_octaves() && film.adaptive().is_none() {
            schedule = schedule.with_octaves(job.request.pixels());
        }
        waves::trace(&frames, &mut tiles, schedule, gate, progress)
    }

    fn open(&mut self, job: &Job) -> Result<Arc<Device>, RenderError> {
        let options = DeviceOptions {
            selector: job.settings.device.clone(),
            validation: job.options.validation,
            budget_mib: job.settings.memory_budget_mib,
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

    fn make_images(&mut self, device: &Device, job: &Job) -> Result<(), RenderError> {
        let adaptive = job.settings.adaptive_sampling;
        if !self.film.as_ref().is_some_and(|film| film.fits(&job.request, adaptive)) {
            self.film = None;
            self.film = Some(Film::new(&device.gpu, &job.request, adaptive)?);
        }
        self.film.as_mut().map_or(Ok(()), |film| film.begin(job))
    }

    /// Wave memory: at most a quarter of what the budget leaves, and no more than the render has paths; less when there is no
    /// memory.
    fn make_waves(&mut self, setting: &Setting<'_>, view: &SceneView, features: Features) -> Result<(), RenderError> {
        let Setting { device, job, .. } = *setting;
        let light_paths = has_light_paths(setting);
        let most = if is_cpu(device) { 1 << 17 } else { MAX_WAVE };
        let wanted = paths(job).clamp(MIN_WAVE, most).next_power_of_two();
        let textures = features.contains(Features::TEXTURES);
        let needs = PathNeeds { textures, light_paths, feedback: textures };
        let fits = |waves: &PathBuffers| waves.serves(view.max_levels, needs) && waves.asked >= wanted;
        if self.waves.as_ref().is_some_and(fits) {
            return Ok(());
        }
        self.waves = None;
        let memory = device.gpu.memory();
        let room = memory.budget.saturating_sub(memory.used) / 4 / path_bytes(view.max_levels, false, light_paths);
        let capacity = wanted.min(room).max(MIN_WAVE);
        let mut waves = shrinking(capacity, MIN_WAVE, |capacity| {
            PathBuffers::new(&device.gpu, capacity, capacity, view.max_levels, needs)
        })?;
        waves.asked = wanted;
        self.waves = Some(waves);
        Ok(())
    }
}

/// Calls `make` with `wanted`, then with half as much as long as there is no memory and it is above `least`.
pub(crate) fn shrinking<T>(
    wanted: u64,
    least: u64,
    make: impl Fn(u32) -> Result<T, GpuError>,
) -> Result<T, RenderError> {
    let mut capacity = wanted;
    loop {
        match make(u32::try_from(capacity).unwrap_or(u32::MAX)) {
            Err(GpuError::OutOfMemory { .. }) if capacity / 2 >= least => capacity /= 2,
            result => return Ok(result?),
        }
    }
}

/// The user's own cap on geometry, bytes.
pub(crate) fn geometry_cap(job: &Job) -> Option<u64> {
    (job.settings.geometry_budget_kib > 0).then(|| u64::from(job.settings.geometry_budget_kib) << 10)
}

/// Paths of the whole render.
fn paths(job: &Job) -> u64 {
    job.request.pixels() * u64::from(job.settings.samples_per_pixel)
}

/// Whether paths keep what lights ask of the surface that a ray left (`HAS_DEPARTURES` of the shaders).
pub(crate) fn has_light_paths(setting: &Setting<'_>) -> bool {
    let near = Features::LOCAL_LIGHTS | Features::MESH_LIGHTS;
    let features = setting.lights.features() | (setting.carry.features & setting.light_carry);
    features.intersects(near | Features::LIGHT_LINKS | Features::LIGHT_LOBES)
}

pub(crate) fn is_cpu(device: &Device) -> bool {
    device.gpu.report().kind == DeviceKind::Cpu
}
