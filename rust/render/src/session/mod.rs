// SPDX-License-Identifier: Apache-2.0
//! The renderer as one delegate sees it: a scene to edit, a request to render, a thread that renders it.
//!
//! States of a session's render thread:
//! - `Idle`: no job, or the job is finished. Converged.
//! - `Rendering`: waves are being traced. Not converged.
//! - `Paused`: as `Rendering`, but no new wave starts. Not converged.
//! - `Stopped`: the job was given up by [`Session::stop`]. Converged (with what it has).
//!
//! Transitions: `render` with anything changed and `restart` lead to `Rendering` from every state; the last wave, an
//! error or the time limit lead to `Idle`; `pause`/`resume`/`stop` as named. They take effect at a wave boundary.
//!
//! Threads: every method may be called from any thread; they return without waiting for the GPU, except
//! [`Session::stop`] with `blocking` and [`Session::wait_converged`]. Images are published before `is_converged` turns
//! true, so that a host which reads after seeing it gets the final image.

pub(crate) mod early;
mod thread;

use crate::device::loader::Loader;
use crate::error::RenderError;
use crate::film::picture;
use crate::geometry_files::{GeometryFiles, GeometrySetting};
use crate::host_memory::{self, HostMemoryTaken, HostMemoryUser};
use crate::job::aov::AovKind;
use crate::job::light_files::{LightFiles, NoFiles};
use crate::job::request::{Message, RenderRequest, Severity};
use crate::job::shared::SharedState;
use crate::job::timings::RenderTimings;
use crate::job::{RenderJob, SessionOptions};
use crate::report::material_report::MaterialReport;
use crate::sync::lock;
use crate::textures::{HeightTextures, ImageLibrary};
use oocpt_core::inventory::PrimvarUse;
use oocpt_core::mesh::MeshFiles;
use oocpt_core::partition::PartitionOptions;
use oocpt_core::scene::{DicingCamera, LentBytes, SceneDb, Snapshot, summary};
use oocpt_core::settings::{SettingError, SettingValue, Settings};
use oocpt_core::stats::RenderStats;
use oocpt_core::texture::HeightFiles;
use oocpt_gpu::DeviceReport;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// One scene, one camera, one render thread.
#[derive(Debug)]
pub struct Session {
    pub(crate) shared: Arc<SharedState>,
    scene: Mutex<SceneDb>,
    settings: Mutex<Settings>,
    options: Mutex<SessionOptions>,
    images: Option<Arc<dyn ImageLibrary>>,
    heights: Option<Arc<HeightTextures>>,
    files: Mutex<Arc<dyn LightFiles>>,
    geometry_files: Mutex<Option<Arc<GeometryFiles>>>,
    /// Of the snapshot of that version.
    primvars: Mutex<(u64, Arc<[PrimvarUse]>)>,
    /// What `oocpt:materialReport` was written of: edits of materials, and the file.
    material_report: Mutex<(u64, String)>,
    /// What was said last of the budget of host memory.
    host_complaint: Mutex<Option<String>>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl Session {
    /// A session with an empty scene. Cheap: the device is opened by the first render, and its errors are messages.
    pub fn new(settings: Settings) -> Self {
        Self::with_options(settings, SessionOptions::default())
    }

    /// As [`Session::new`], with options.
    pub fn with_options(settings: Settings, options: SessionOptions) -> Self {
        Self {
            shared: Arc::default(),
            scene: Mutex::new(SceneDb::new()),
            settings: Mutex::new(settings),
            options: Mutex::new(options),
            images: None,
            heights: None,
            geometry_files: Mutex::default(),
            files: Mutex::new(Arc::new(NoFiles)),
            primvars: Mutex::default(),
            material_report: Mutex::default(),
            host_complaint: Mutex::default(),
            thread: Mutex::new(None),
        }
    }

    /// The session, with somebody who opens the images that textures name; without, every texture is its fallback.
    #[must_use]
    pub fn with_images(self, images: Arc<dyn ImageLibrary>) -> Self {
        let mut session = self;
        let heights = Arc::new(HeightTextures::new(Arc::clone(&images)));
        lock(&session.scene).set_height_files(Arc::clone(&heights) as Arc<dyn HeightFiles>);
        session.heights = Some(heights);
        session.images = Some(images);
        session
    }

    /// Says who reads the files that lights name; without, none can be read. Takes effect with the next
    /// [`Session::render`].
    pub fn set_light_files(&self, files: Arc<dyn LightFiles>) {
        *lock(&self.files) = files;
    }

    /// Edits the scene; the edits take effect with the next [`Session::render`].
    pub fn with_scene<R>(&self, edit: impl FnOnce(&mut SceneDb) -> R) -> R {
        edit(&mut lock(&self.scene))
    }

    /// Changes one setting by its Hydra key; takes effect with the next [`Session::render`]. Returns whether it
    /// changed.
    pub fn set_setting(&self, key: &str, value: SettingValue) -> Result<bool, SettingError> {
        lock(&self.settings).set(key, value)
    }

    /// The settings as they stand.
    pub fn settings(&self) -> Settings {
        lock(&self.settings).clone()
    }

    /// Commits the scene's edits and renders `request` in the background; an image under way is given up if anything
    /// it depends on has changed, and goes on undisturbed otherwise. Returns at once.
    ///
    /// Clipping planes that are not finite are left out, with a warning: a request that has one would not equal itself.
    pub fn render(&self, mut request: RenderRequest) {
        let planes = request.camera.clip_planes.len();
        request.camera.clip_planes.retain(|plane| plane.is_finite());
        let is_cut = request.camera.clip_planes.len() < planes;
        let (chunk_bytes, dicing_rate, is_live) = {
            let settings = lock(&self.settings);
            self.heights.iter().for_each(|heights| heights.keep_in(&settings));
            (u64::from(settings.chunk_size_kib) << 10, settings.dicing_rate, settings.interactive)
        };
        let mut scene = lock(&self.scene);
        scene.set_partition(PartitionOptions { chunk_bytes });
        scene.set_dicing(DicingCamera::new(&request.camera, dicing_rate).live(is_live));
        let lent = self.keep_meshes(&mut scene);
        let commit = scene.commit();
        let fixed_host_bytes = self.watch_host_memory(&scene, &lent, &commit.snapshot);
        let primvars = self.primvars_of(&scene, commit.snapshot.version);
        self.report_materials(&scene);
        let meshes_made = scene.meshes_made();
        drop(scene);
        for line in summary(&commit.warnings) {
            self.shared.report(Severity::Warning, line);
        }
        let (settings, options) = (self.settings(), *lock(&self.options));
        let files = Arc::clone(&lock(&self.files));
        let mut control = self.shared.control();
        let unchanged = control.job.as_ref().is_some_and(|job| {
            job.snapshot.version == commit.snapshot.version
                && job.request == request
                && job.settings == settings
                && Arc::ptr_eq(&job.files, &files)
        });
        if unchanged {
            return;
        }
        if is_cut {
            let text = "clipping planes of the camera that are not finite are left out";
            self.shared.report(Severity::Warning, text.to_owned());
        }
        let images = self.images.clone();
        let snapshot = commit.snapshot;
        control.generation += 1;
        let generation = control.generation;
        control.job = Some(Arc::new(RenderJob {
            snapshot,
            request,
            settings,
            options,
            images,
            files,
            primvars,
            meshes_made,
            fixed_host_bytes,
            goes_on: true,
            generation,
        }));
        control.stopped = false;
        drop(control);
        self.shared.notify();
        self.ensure_thread();
    }

    /// Has meshes built and kept as the settings say. With a budget of host memory gives what the scene's arrays take.
    fn keep_meshes(&self, scene: &mut SceneDb) -> LentBytes {
        let settings = lock(&self.settings);
        let budget = host_memory::budget(&settings);
        let lent = budget.map(|_| scene.lent()).unwrap_or_default();
        let tables = scene.snapshot().world.host_bytes();
        let fixed = lent.bytes + tables + Loader::staging_bytes();
        let has_rendered = self.shared.control().job.is_some();
        let commit = host_memory::of_commit(&settings, fixed, has_rendered);
        scene.set_host_budget(budget.unwrap_or(u64::MAX));
        scene.set_partition_memory(commit.sorting);
        let memory = scene.mesh_memory();
        memory.set_room(commit.building);
        memory.set_limit(host_memory::limit_of(HostMemoryUser::Meshes, &settings, memory.held(), fixed));
        let setting = GeometrySetting::of(&settings);
        let mut files = lock(&self.geometry_files);
        if files.as_ref().map(|files| files.setting()) != setting.as_ref() {
            *files = setting.map(|setting| Arc::new(GeometryFiles::new(setting, &self.shared)));
            scene.set_mesh_files(files.clone().map(|files| files as Arc<dyn MeshFiles>));
        }
        lent
    }

    /// With a budget of host memory: the bytes that can be put nowhere else; tells where they are more than there is,
    /// or where meshes have no other place.
    fn watch_host_memory(&self, scene: &SceneDb, lent: &LentBytes, snapshot: &Snapshot) -> u64 {
        let settings = lock(&self.settings);
        let Some(budget) = host_memory::budget(&settings) else { return 0 };
        let tables = snapshot.world.host_bytes();
        let memory = scene.mesh_memory();
        let taken = HostMemoryTaken {
            lent,
            tables,
            staging: Loader::staging_bytes(),
            held: memory.held(),
            building: memory.overrun(),
            has_files: lock(&self.geometry_files).is_some(),
        };
        let complaint = host_memory::complaint(budget, &taken);
        // Once, however often the scene is rendered.
        let mut told = lock(&self.host_complaint);
        if let Some(text) = complaint.as_ref().filter(|_| *told != complaint) {
            self.shared.report(Severity::Warning, text.clone());
        }
        *told = complaint;
        lent.bytes + tables + Loader::staging_bytes()
    }

    fn primvars_of(&self, scene: &SceneDb, version: u64) -> Arc<[PrimvarUse]> {
        let mut known = lock(&self.primvars);
        if known.0 != version {
            *known = (version, scene.primvar_uses().into());
        }
        Arc::clone(&known.1)
    }

    /// Writes the report that `oocpt:materialReport` names, once for each state of the materials.
    fn report_materials(&self, scene: &SceneDb) {
        let file = lock(&self.settings).material_report.clone();
        let mut written = lock(&self.material_report);
        let wanted = (scene.material_edits(), file);
        if wanted.1.is_empty() || *written == wanted {
            return;
        }
        *written = wanted;
        if let Err(error) = MaterialReport::of(scene).write(Path::new(&written.1)) {
            self.shared.report(Severity::Warning, format!("oocpt:materialReport: {error}"));
        }
    }

    fn ensure_thread(&self) {
        let mut thread = lock(&self.thread);
        if thread.is_some() {
            return;
        }
        let shared = Arc::clone(&self.shared);
        match std::thread::Builder::new().name("oocpt-render".into()).spawn(move || thread::run(&shared)) {
            Ok(handle) => *thread = Some(handle),
            Err(error) => {
                self.shared.fail(&RenderError::Internal(format!("cannot start the render thread: {error}")));
                let mut control = self.shared.control();
                control.finished = control.generation;
            }
        }
    }

    /// Whether the images are final: rendered to the end, ended by an error, stopped, or nothing asked for.
    pub fn is_converged(&self) -> bool {
        !self.shared.control().is_rendering()
    }

    /// No new wave starts until [`Session::resume`].
    pub fn pause(&self) {
        self.shared.control().paused = true;
        self.shared.notify();
    }

    /// Ends a pause.
    pub fn resume(&self) {
        self.shared.control().paused = false;
        self.shared.notify();
    }

    /// Whether the session is paused.
    pub fn is_paused(&self) -> bool {
        self.shared.control().paused
    }

    /// Gives the current image up as it is. With `blocking`, returns when the render thread is idle.
    pub fn stop(&self, blocking: bool) {
        let mut control = self.shared.control();
        control.stopped = true;
        self.shared.notify();
        let has_thread = lock(&self.thread).is_some();
        while blocking && has_thread && control.job.is_some() && control.finished != control.generation {
            control = self.shared.wait(control);
        }
    }

    /// Whether the session was stopped and not restarted since.
    pub fn is_stopped(&self) -> bool {
        self.shared.control().stopped
    }

    /// Turns the measuring of passes on or off for renders that start from now on.
    pub fn set_profiling(&self, profile: bool) {
        lock(&self.options).profile = profile;
    }

    /// Renders the last request again from its first sample.
    pub fn restart(&self) {
        let options = *lock(&self.options);
        let mut control = self.shared.control();
        control.generation += 1;
        let generation = control.generation;
        if let Some(job) = control.job.take() {
            control.job = Some(Arc::new(RenderJob { options, generation, goes_on: false, ..(*job).clone() }));
        }
        control.stopped = false;
        control.paused = false;
        drop(control);
        self.shared.notify();
    }

    /// Waits until [`Session::is_converged`], at most `timeout`; returns whether it is.
    pub fn wait_converged(&self, timeout: Duration) -> bool {
        let end = Instant::now() + timeout;
        let mut control = self.shared.control();
        while control.is_rendering() {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            control = self.shared.wait_at_most(control, left);
        }
        true
    }

    /// Copies the latest published image of `kind` to `out` (see [`AovKind`] for its layout).
    /// Returns false, with `out` untouched, when there is none yet or when its size in bytes differs.
    pub fn read_aov(&self, kind: AovKind, out: &mut [u8]) -> bool {
        self.read_new_aov(kind, 0, out) != 0
    }

    /// As [`Session::read_aov`], but an image whose version is `known` is not copied again. Returns the version of what
    /// `out` holds then: 0 if there is no such image, never the same for two images of a session.
    pub fn read_new_aov(&self, kind: AovKind, known: u64, out: &mut [u8]) -> u64 {
        lock(&self.shared.published).copy(kind, known, out)
    }

    /// Number of the job whose picture is shown ([`Session::generation`] is that of the newest one); 0 before there is
    /// one.
    pub fn shown_generation(&self) -> u64 {
        lock(&self.shared.published).generation()
    }

    /// Counters of the current or last render.
    pub fn stats(&self) -> RenderStats {
        lock(&self.shared.stats).clone()
    }

    /// How the picture of the current or last render was made, for its file.
    pub fn picture_attributes(&self) -> picture::PictureAttributes {
        let settings = self.settings();
        let device = self.device_report().map(|device| (device.name, device.driver)).unwrap_or_default();
        picture::attributes(&self.stats(), &device.0, &device.1, settings.seed, settings.max_bounces)
    }

    /// Where the time of the last finished render went.
    pub fn timings(&self) -> RenderTimings {
        lock(&self.shared.timings).clone()
    }

    /// What became of planted failures, and what the driver gave, by the end of the last render.
    #[cfg(feature = "faults")]
    pub fn witness(&self) -> crate::job::faults::FaultWitness {
        *lock(&self.shared.witness)
    }

    /// The device that rendered last; none before the first render opened one.
    pub fn device_report(&self) -> Option<DeviceReport> {
        lock(&self.shared.device).clone()
    }

    /// The messages since the last call, oldest first.
    pub fn take_messages(&self) -> Vec<Message> {
        std::mem::take(&mut *lock(&self.shared.messages))
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.shared.control().quit = true;
        self.shared.notify();
        if let Some(handle) = lock(&self.thread).take()
            && handle.join().is_err()
        {
            tracing::error!("the render thread had panicked");
        }
    }
}
