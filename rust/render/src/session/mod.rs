// SPDX-License-Identifier: Apache-2.0
//! The renderer as one delegate sees it: a scene to edit, a request to render, threads that commit and render it.
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
//! The commit thread applies edits and commits the scene ([`SceneDb::commit`]). A commit belongs to a `render`: while
//! it is pending the session is not converged, unless `stop` came after. What is rendered meanwhile:
//! - In an interactive session, the newest request with the scene of the commit before, at once. When the commit is
//!   done and the scene is another one, the request that is the newest then is rendered with it.
//! - In a batch session, and before the first commit, the job before. Each commit is followed by a job of its own
//!   request. Requests that come during a commit share the next one.
//!
//! A commit that fails is told and leaves the scene as it was; the next `render` with anything changed, or `restart`,
//! tries again. A session that ends waits for the commit under way.
//!
//! Threads: every method may be called from any thread; they return without waiting for the GPU or for a commit, except
//! [`Session::stop`] with `blocking`, [`Session::wait_converged`] and [`Session::with_scene`]. Images are published
//! before `is_converged` turns true, so that a host which reads after seeing it gets the final image; so are messages.

mod commit;
mod committing;
pub(crate) mod early;
mod products;
mod thread;

use crate::error::RenderError;
use crate::film::denoised::add_guides;
use crate::film::picture;
use crate::film::products::add_kinds;
use crate::job::SessionOptions;
use crate::job::aov::AovKind;
use crate::job::commits::{CommitProgress, RenderAsk};
use crate::job::edits::SceneEdit;
use crate::job::light_files::{LightFiles, NoFiles};
use crate::job::product::RenderProduct;
use crate::job::request::{Message, RenderRequest, Severity};
use crate::job::shared::SharedState;
use crate::job::timings::RenderTimings;
use crate::sync::lock;
use crate::textures::{HeightTextures, ImageLibrary};
use commit::SessionScene;
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{SettingError, SettingValue, Settings};
use oocpt_core::stats::RenderStats;
use oocpt_core::texture::HeightFiles;
use oocpt_gpu::DeviceReport;
use products::PlannedProducts;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// One scene, one camera, a thread that commits and one that renders.
#[derive(Debug)]
pub struct Session {
    pub(crate) shared: Arc<SharedState>,
    /// Locked by the commit thread while it works: no method that a host calls may wait for it.
    scene: Arc<Mutex<SessionScene>>,
    settings: Mutex<Settings>,
    options: Mutex<SessionOptions>,
    images: Option<Arc<dyn ImageLibrary>>,
    files: Mutex<Arc<dyn LightFiles>>,
    products: Mutex<PlannedProducts>,
    commit_thread: SessionThread,
    render_thread: SessionThread,
}

/// A thread of the session, once it is started.
type SessionThread = Mutex<Option<JoinHandle<()>>>;

impl Session {
    /// A session with an empty scene. Cheap: the device is opened by the first render, and its errors are messages.
    pub fn new(settings: Settings) -> Self {
        Self::with_options(settings, SessionOptions::default())
    }

    /// As [`Session::new`], with options.
    pub fn with_options(settings: Settings, options: SessionOptions) -> Self {
        Self {
            shared: Arc::default(),
            scene: Arc::default(),
            settings: Mutex::new(settings),
            options: Mutex::new(options),
            images: None,
            files: Mutex::new(Arc::new(NoFiles)),
            products: Mutex::default(),
            commit_thread: Mutex::default(),
            render_thread: Mutex::default(),
        }
    }

    /// The session, with somebody who opens the images that textures name; without, every texture is its fallback.
    #[must_use]
    pub fn with_images(self, images: Arc<dyn ImageLibrary>) -> Self {
        let mut session = self;
        let heights = Arc::new(HeightTextures::new(Arc::clone(&images)));
        let mut scene = lock(&session.scene);
        scene.db.set_height_files(Arc::clone(&heights) as Arc<dyn HeightFiles>);
        scene.heights = Some(heights);
        drop(scene);
        session.images = Some(images);
        session
    }

    /// Says who reads the files that lights name; without, none can be read. Takes effect with the next
    /// [`Session::render`].
    pub fn set_light_files(&self, files: Arc<dyn LightFiles>) {
        *lock(&self.files) = files;
    }

    /// Edits the scene, in the order of the calls; takes effect with the next [`Session::render`]. The commit thread
    /// applies the edits: until then they hold what they were made of, of each prim the last edit.
    pub fn edit(&self, edits: Vec<SceneEdit>) {
        if !edits.is_empty() && self.ensure_threads() {
            self.shared.control().commits.edit(edits.into());
            self.shared.notify();
        }
    }

    /// Edits the scene at once, for whoever has the time: waits for a commit that is pending. The edits take effect
    /// with the next [`Session::render`].
    pub fn with_scene<R>(&self, edit: impl FnOnce(&mut SceneDb) -> R) -> R {
        let mut control = self.shared.control();
        while control.commits.is_pending() {
            control = self.shared.wait(control);
        }
        drop(control);
        let mut scene = lock(&self.scene);
        let waiting = self.shared.control().commits.take_edits();
        scene.edit(waiting, &self.shared);
        edit(&mut scene.db)
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

    /// Has the scene's edits committed and `request` rendered in the background; an image under way is given up if
    /// anything it depends on has changed, and goes on undisturbed otherwise. Returns at once.
    ///
    /// Clipping planes that are not finite are left out, with a warning: a request that has one would not equal itself.
    pub fn render(&self, request: RenderRequest) {
        self.render_products(request, Vec::new());
    }

    /// Whether products are written: not by an interactive session, which would write at every change, nor if the
    /// settings say so.
    pub fn writes_products(&self) -> bool {
        let settings = lock(&self.settings);
        settings.write_products && !settings.interactive
    }

    /// As [`Session::render`]. If [`Session::writes_products`], the pictures of `products` are rendered too, before
    /// that of `request`, and their files written; the session is converged when that is done. What cannot be written
    /// is told.
    pub fn render_products(&self, mut request: RenderRequest, products: Vec<RenderProduct>) {
        if !self.ensure_threads() {
            return;
        }
        let planes = request.camera.clip_planes.len();
        request.camera.clip_planes.retain(|plane| plane.is_finite());
        let is_cut = request.camera.clip_planes.len() < planes;
        let (settings, options, images) = (self.settings().with_span(), *lock(&self.options), self.images.clone());
        let files = Arc::clone(&lock(&self.files));
        let products = if self.writes_products() { products } else { Vec::new() };
        let mut planned = lock(&self.products);
        let plan = planned.plan(products, &self.shared);
        plan.of_host.iter().for_each(|file| add_kinds(&mut request, file));
        let left_out = request.keep_shown();
        if let Some(limits) = request.deep() {
            request.add_deep(limits); // one in place of all
        }
        add_guides(&mut request, &settings);
        let mut before = plan.before.clone();
        before.iter_mut().for_each(|picture| add_guides(&mut picture.request, &settings));
        let (products, before) = (plan.of_host.clone().into(), before.into());
        drop(planned);
        let ask = RenderAsk { request, settings, options, images, files, products, before, asked_at: Instant::now() };
        let asked = self.shared.control().ask(ask);
        let Some(is_new) = asked else { return };
        if is_cut && is_new {
            let text = "clipping planes of the camera that are not finite are left out";
            self.shared.report(Severity::Warning, text.to_owned());
        }
        if is_new && !left_out.is_empty() {
            let names: Vec<String> = left_out.into_iter().map(AovKind::name).collect();
            let text = format!("left out, since too many expressions or primvars are asked for: {}", names.join(", "));
            self.shared.report(Severity::Warning, text);
        }
        self.shared.notify();
    }

    /// Starts the threads; tells why if that fails.
    fn ensure_threads(&self) -> bool {
        let (shared, scene) = (Arc::clone(&self.shared), Arc::clone(&self.scene));
        self.ensure_thread(&self.commit_thread, "oocpt-commit", move || committing::run(&shared, &scene)) && {
            let shared = Arc::clone(&self.shared);
            self.ensure_thread(&self.render_thread, "oocpt-render", move || thread::run(&shared))
        }
    }

    fn ensure_thread(&self, thread: &SessionThread, name: &str, run: impl FnOnce() + Send + 'static) -> bool {
        let mut thread = lock(thread);
        if thread.is_some() {
            return true;
        }
        match std::thread::Builder::new().name(name.into()).spawn(run) {
            Ok(handle) => *thread = Some(handle),
            Err(error) => self.shared.fail(&RenderError::Internal(format!("cannot start the thread {name}: {error}"))),
        }
        thread.is_some()
    }

    /// How far the commits are.
    pub fn commit_progress(&self) -> CommitProgress {
        self.shared.control().commits.progress()
    }

    /// A gate that commits pass, for tests.
    #[cfg(feature = "faults")]
    pub fn commit_gate(&self) -> Arc<crate::job::faults::CommitGate> {
        Arc::clone(&self.shared.commit_gate)
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

    /// Ends the current render with the samples that it has. A commit that is pending goes on, but no render follows
    /// it. With `blocking`, returns when the render thread is idle.
    pub fn stop(&self, blocking: bool) {
        let has_thread = lock(&self.render_thread).is_some();
        let mut control = self.shared.control();
        control.stopped = true;
        control.commits.stop();
        self.shared.notify();
        while blocking && has_thread && control.job.is_some() && control.finished != control.generation {
            control = self.shared.wait(control);
        }
    }

    /// Whether the session was stopped and not restarted since.
    pub fn is_stopped(&self) -> bool {
        let control = self.shared.control();
        control.stopped && !control.commits.is_awaited()
    }

    /// Turns the measuring of passes on or off for renders that start from now on.
    pub fn set_profiling(&self, profile: bool) {
        lock(&self.options).profile = profile;
    }

    /// Renders the last request again from its first sample.
    pub fn restart(&self) {
        let options = *lock(&self.options);
        self.shared.control().restart(options);
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
        products::attributes(&self.shared, &self.settings())
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
        for thread in [&self.commit_thread, &self.render_thread] {
            if let Some(handle) = lock(thread).take()
                && handle.join().is_err()
            {
                tracing::error!("a thread of the session had panicked");
            }
        }
    }
}
