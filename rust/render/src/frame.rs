// SPDX-License-Identifier: Apache-2.0
//! One frame from a job to its images: the table of contents of a render.
//!
//! Render thread only. What can be kept from frame to frame (device, scene, wave memory, images) is kept.

use crate::device::{Device, DeviceOptions};
use crate::error::RenderError;
use crate::film::Film;
use crate::progress::Progress;
use crate::scene::{LightTable, SceneCache, SceneView};
use crate::schedule::Schedule;
use crate::session::Job;
use crate::specialise;
use crate::sync::lock;
use crate::thread::Gate;
use crate::wavefront::{Passes, WaveBuffers, path_bytes};
use crate::waves::{self, Frames};
use bytemuck::Zeroable;
use oocpt_core::camera::CameraRays;
use oocpt_gpu::{Buffer, DeviceKind, Usage};
use oocpt_shader_abi::{Frame, FrameFlags};
use std::sync::Arc;
use std::time::Instant;

/// Albedo of a surface without a colour, as `UsdPreviewSurface`'s diffuseColor.
const DEFAULT_ALBEDO: [f32; 3] = [0.18; 3];
/// Largest wave, paths.
const MAX_WAVE: u64 = 1 << 22;
/// Smallest wave, paths.
const MIN_WAVE: u64 = 1 << 12;

/// What the render thread keeps from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Renderer {
    device: Option<Arc<Device>>,
    scene: SceneCache,
    waves: Option<WaveBuffers>,
    film: Option<Film>,
}

impl Renderer {
    /// Renders `job` until it is done or `gate` says no; publishes images and stats on the way.
    pub(crate) fn render(&mut self, job: &Job, gate: &Gate<'_>) -> Result<(), RenderError> {
        job.request.validate()?;
        let mut progress = Progress::start(gate.shared(), job);
        let device = self.open(job)?;
        *lock(&gate.shared().device) = Some(device.gpu.report().clone());
        let result = self.render_on(&device, job, gate, &mut progress);
        progress.validation(&device.gpu);
        if let Err(RenderError::Gpu(oocpt_gpu::GpuError::DeviceLost { .. })) = &result {
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
        let lights = LightTable::new(scene_lights, job.settings.dome_light_camera_visible);
        progress.stage("uploading the scene");
        let scene = self.scene.sync(device, &job.snapshot, &lights, &mut progress.timings)?;
        let features = specialise::features(&job.snapshot, &lights, &rays);
        self.make_images(device, job)?;
        self.make_waves(device, job, &scene)?;
        let (Some(film), Some(buffers)) = (&self.film, &self.waves) else {
            return Err(RenderError::Internal("the frame's memory was not made".into()));
        };
        progress.stage("compiling passes");
        let started = Instant::now();
        let special = specialise::specialisation(features, &scene);
        let passes = Passes::new(device, special, film.has_planes())?;
        progress.timings.compile_secs += started.elapsed().as_secs_f64();
        progress.left_out(specialise::left_out(features, film.has_planes()));
        let mut block = frame_block(job, &lights, &scene, &rays);
        buffers.bind(&mut block);
        film.bind(&mut block, &job.request.aovs);
        let frame = Buffer::new(&device.gpu, "frame", size_of::<Frame>() as u64, Usage::Upload)?;
        frame.write(0, bytemuck::bytes_of(&block))?;
        let frames = Frames { device, film, buffers, passes: &passes, frame: &frame, job };
        progress.stage("rendering");
        waves::clear(&frames)?;
        if !waves::trace_planes(&frames, gate, progress)? {
            return Ok(());
        }
        let total = if film.has_color() { progress.total_paths() } else { 0 };
        let start = if is_cpu(device) { 1 << 14 } else { 1 << 19 };
        let schedule = Schedule::new(total, start, buffers.capacity, 0.05);
        waves::trace(&frames, schedule, gate, progress)
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
        if !self.film.as_ref().is_some_and(|film| film.fits(&job.request)) {
            self.film = None;
            self.film = Some(Film::new(&device.gpu, &job.request)?);
        }
        Ok(())
    }

    /// Wave memory: at most a quarter of what the budget leaves, and no more than the render has paths.
    fn make_waves(&mut self, device: &Device, job: &Job, scene: &SceneView) -> Result<(), RenderError> {
        let paths = job.request.pixels() * u64::from(job.settings.samples_per_pixel);
        let most = if is_cpu(device) { 1 << 17 } else { MAX_WAVE };
        let wanted = paths.clamp(MIN_WAVE, most).next_power_of_two();
        let fits = |waves: &WaveBuffers| waves.max_levels == scene.max_levels && u64::from(waves.capacity) >= wanted;
        if self.waves.as_ref().is_some_and(fits) {
            return Ok(());
        }
        self.waves = None;
        let memory = device.gpu.memory();
        let room = memory.budget.saturating_sub(memory.used) / 4 / path_bytes(scene.max_levels);
        let capacity = wanted.min(room).max(MIN_WAVE);
        let capacity = u32::try_from(capacity).unwrap_or(u32::MAX);
        self.waves = Some(WaveBuffers::new(&device.gpu, capacity, scene.max_levels)?);
        Ok(())
    }
}

fn is_cpu(device: &Device) -> bool {
    device.gpu.report().kind == DeviceKind::Cpu
}

fn frame_block(job: &Job, lights: &LightTable, scene: &SceneView, rays: &CameraRays) -> Frame {
    let mut flags = FrameFlags::empty();
    flags.set(FrameFlags::DOME_CAMERA_VISIBLE, lights.background_visible);
    Frame {
        top_nodes: scene.top_nodes,
        chunk_instances: scene.chunk_instances,
        chunks: scene.chunks,
        assemblies: scene.assemblies,
        meshes: scene.meshes,
        lights: scene.lights,
        ray_o: rays.o,
        ray_o_x: rays.o_x,
        ray_o_y: rays.o_y,
        ray_d: rays.d,
        ray_d_x: rays.d_x,
        ray_d_y: rays.d_y,
        lens_u: rays.lens_u,
        lens_v: rays.lens_v,
        focus: rays.focus,
        clip_z: rays.clip_z,
        clip_w: rays.clip_w,
        view: rays.view_from_world,
        view_normal: rays.view_normal,
        dome_radiance: lights.dome_radiance,
        dome_background: lights.dome_background,
        dome_select: lights.dome_select,
        default_albedo: DEFAULT_ALBEDO,
        clamp: job.settings.clamp,
        width: job.request.width,
        height: job.request.height,
        seed: job.settings.seed,
        max_bounces: job.settings.max_bounces,
        // The table is indexed by u32 and holds at most as many lights as the scene has prims.
        light_count: u32::try_from(lights.distant.len()).unwrap_or(u32::MAX),
        flags: flags.bits(),
        ..Frame::zeroed()
    }
}
