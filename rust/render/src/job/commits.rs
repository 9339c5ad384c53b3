// SPDX-License-Identifier: Apache-2.0
//! What the host asks for and the commit thread answers: the newest request, edits that wait, commits that are due, and
//! the jobs that follow from them. Pure; under the mutex of [`RenderControl`].
//!
//! A request is sealed with the edits before it: a commit never has half of what a host edits between two requests. In
//! an interactive session a job of the newest request follows at once, with the scene of the commit before; another one
//! comes when the scene is another one. In a batch session a job comes after its commit alone.

use crate::job::aov::{AovKind, AovRequest};
use crate::job::edits::EditQueue;
use crate::job::light_files::LightFiles;
use crate::job::product::{ProductFile, ProductPicture};
use crate::job::request::RenderRequest;
use crate::job::{MeshCounts, RenderJob, SessionOptions};
use crate::textures::ImageLibrary;
use oocpt_core::inventory::PrimvarUse;
use oocpt_core::scene::{NamingPrimvar, PrimNames, Snapshot};
use oocpt_core::settings::Settings;
use std::collections::VecDeque;
use std::sync::Arc;
use std::thread::ThreadId;
use std::time::{Duration, Instant};

/// A job whose request came with edits waits so long for their commit: what a host changes together is shown together
/// unless that would hold the picture for longer than a frame of 60 a second.
const TOGETHER: Duration = Duration::from_millis(16);

/// What a host wants to see of its scene.
#[derive(Clone, Debug)]
pub(crate) struct RenderAsk {
    pub(crate) request: RenderRequest,
    pub(crate) settings: Settings,
    pub(crate) options: SessionOptions,
    pub(crate) images: Option<Arc<dyn ImageLibrary>>,
    pub(crate) files: Arc<dyn LightFiles>,
    /// What is written of its picture.
    pub(crate) products: Arc<[ProductFile]>,
    /// Other pictures, for files alone, that are rendered before it; batch sessions only.
    pub(crate) before: Arc<[ProductPicture]>,
    /// When the host asked.
    pub(crate) asked_at: Instant,
}

impl RenderAsk {
    /// Whether a picture of it names what samples meet.
    pub(crate) fn names_things(&self) -> bool {
        let requests = self.before.iter().map(|picture| &picture.request).chain([&self.request]);
        let files = self.before.iter().flat_map(|picture| &picture.files).chain(self.products.iter());
        requests.flat_map(|request| &request.aovs).any(|aov| aov.kind.ranks_ids())
            || files.flat_map(|file| &file.channels).any(|channel| channel.cryptomatte.is_some())
    }

    /// The primvars that name what its pictures show.
    pub(crate) fn naming(&self) -> Vec<Arc<NamingPrimvar>> {
        let files = self.before.iter().flat_map(|picture| &picture.files).chain(self.products.iter());
        let layers = files.flat_map(|file| &file.channels).filter_map(|channel| channel.cryptomatte.as_ref());
        let mut all: Vec<Arc<NamingPrimvar>> = layers.filter_map(|layer| layer.naming.clone()).collect();
        all.dedup_by(|a, b| Arc::ptr_eq(a, b));
        all
    }

    /// Names of the primvars that its pictures show, sorted.
    pub(crate) fn shown_primvars(&self) -> Vec<Arc<str>> {
        let requests = self.before.iter().map(|picture| &picture.request).chain([&self.request]);
        let primvars = requests.flat_map(|request| &request.aovs).filter_map(|aov| aov.kind.primvar());
        let mut names: Vec<Arc<str>> = primvars.map(|primvar| primvar.name()).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    fn is_same(&self, request: &RenderRequest, settings: &Settings, files: &Arc<dyn LightFiles>) -> bool {
        self.request == *request && self.settings == *settings && Arc::ptr_eq(&self.files, files)
    }

    /// Whether the job is what is asked for, whatever its scene.
    fn is_of(&self, job: &RenderJob) -> bool {
        let request = with_catchers(self.request.clone(), &job.snapshot);
        let is_same = request == job.request && self.settings == job.settings && Arc::ptr_eq(&self.files, &job.files);
        is_same && self.products == job.products
    }

    fn is_like(&self, other: &Self) -> bool {
        let has_same_files = self.products == other.products && self.before == other.before;
        self.is_same(&other.request, &other.settings, &other.files) && has_same_files
    }

    /// Its pictures, its own last.
    fn pictures(&self) -> VecDeque<Self> {
        let alone = Self { before: Arc::default(), ..self.clone() };
        // Files of samples are of the host's picture.
        let settings = Settings { checkpoint: String::new(), film_part: String::new(), ..self.settings.clone() };
        let before = self.before.iter().map(|picture| Self {
            request: picture.request.clone(),
            products: picture.files.clone().into(),
            settings: settings.clone(),
            ..alone.clone()
        });
        before.chain([alone.clone()]).collect()
    }

    fn job(self, scene: CommittedScene, generation: u64, goes_on: bool) -> Arc<RenderJob> {
        let Self { request, settings, options, images, files, products, before: _, asked_at } = self;
        let CommittedScene { snapshot, primvars, identity, names, meshes, fixed_host_bytes } = scene;
        Arc::new(RenderJob {
            request: with_catchers(request, &snapshot),
            snapshot,
            settings,
            options,
            images,
            files,
            products,
            primvars,
            scene: identity,
            names,
            meshes,
            fixed_host_bytes,
            goes_on,
            film_window: None,
            catches_up: false,
            team: None,
            asked_at,
            generation,
        })
    }
}

/// A request with the image of the alpha that shadow catchers have, where a scene has some and colour is wanted.
fn with_catchers(mut request: RenderRequest, snapshot: &Snapshot) -> RenderRequest {
    let (kinds, kind) = (request.kinds(), AovKind::ShadowCatcher);
    let is_wanted = kinds.contains(&AovKind::Color) || kinds.contains(&AovKind::Denoised);
    if is_wanted && !kinds.contains(&kind) && snapshot.surfaces.catches_shadows() {
        request.aovs.push(AovRequest { kind, clear: kind.default_clear() });
    }
    request
}

/// The result of a commit.
#[derive(Clone, Debug)]
pub(crate) struct CommittedScene {
    pub(crate) snapshot: Arc<Snapshot>,
    /// The scene's primvars, and whether each is used.
    pub(crate) primvars: Arc<[PrimvarUse]>,
    /// Hash of the scene, if something is to be known by it.
    pub(crate) identity: Option<u128>,
    /// Names of what samples meet, for whoever asks for them.
    pub(crate) names: Option<Arc<PrimNames>>,
    pub(crate) meshes: MeshCounts,
    /// Bytes of host memory that can be put nowhere else; 0 where there is no budget of it.
    pub(crate) fixed_host_bytes: u64,
}

impl CommittedScene {
    fn of(job: &RenderJob) -> Self {
        Self {
            snapshot: Arc::clone(&job.snapshot),
            primvars: Arc::clone(&job.primvars),
            identity: job.scene,
            names: job.names.clone(),
            meshes: job.meshes,
            fixed_host_bytes: job.fixed_host_bytes,
        }
    }
}

/// How far the commits of a session are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CommitProgress {
    /// Commits that have ended, those that found nothing to do included.
    pub ended: u64,
    /// Of these, those that held a thread of the host: always none.
    pub in_host_thread: u64,
    /// Commits that were given up while they built meshes of prims that the host had edited again; they have not ended.
    pub given_up: u64,
    /// True if the scene of the newest [`crate::Session::render`] is not committed yet.
    pub is_pending: bool,
}

/// The next piece of work of the commit thread.
#[derive(Debug)]
pub(crate) struct CommitWork {
    pub(crate) edits: EditQueue,
    /// What the commit is for; none if the edits are only noted.
    pub(crate) ask: Option<RenderAsk>,
    /// Whether pictures are shown meanwhile.
    pub(crate) is_live: bool,
}

/// The host's requests to the commit thread and the render thread.
#[derive(Debug, Default)]
pub(crate) struct RenderControl {
    pub(crate) commits: CommitQueue,
    pub(crate) job: Option<Arc<RenderJob>>,
    /// Grows with every posted or restarted job.
    pub(crate) generation: u64,
    /// Generation that the thread has finished (rendered, failed or given up).
    pub(crate) finished: u64,
    /// Generation that is to end with the samples that it has.
    pub(crate) ends_early: u64,
    pub(crate) paused: bool,
    pub(crate) stopped: bool,
    pub(crate) quit: bool,
}

impl RenderControl {
    /// Whether the newest picture is still to come: a job is under way or its scene is being committed.
    pub(crate) fn is_rendering(&self) -> bool {
        let is_rendering = self.job.is_some() && self.finished != self.generation && !self.stopped;
        is_rendering || self.commits.is_awaited()
    }
}

/// Requests and edits on their way to a job.
#[derive(Debug, Default)]
pub(crate) struct CommitQueue {
    /// What was asked for last.
    newest: Option<RenderAsk>,
    /// Edits since then; no commit is made of them before the next request.
    edits: EditQueue,
    /// True if the scene has such edits already.
    is_edited: bool,
    /// Edits of requests whose commit has not begun.
    due: EditQueue,
    is_due: bool,
    is_under_way: bool,
    has_failed: bool,
    /// The next job ends a stop.
    ends_stop: bool,
    /// The pictures of the newest request that no commit was begun for.
    pictures: VecDeque<RenderAsk>,
    /// A job follows the next commit even if nothing has changed.
    restarts: bool,
    /// The newest job waits until then for the commit that is pending.
    held_until: Option<Instant>,
    /// The thread that asked last.
    host: Option<ThreadId>,
    /// Counts requests that brought edits; those that [`Self::makes_moot`] has looked at.
    sealed: u64,
    looked_at: u64,
    /// The commit before the one under way was given up.
    was_given_up: bool,
    ended: u64,
    in_host_thread: u64,
    given_up: u64,
}

impl CommitQueue {
    /// Adds edits, which take effect with the next request.
    pub(crate) fn edit(&mut self, edits: EditQueue) {
        self.edits.then(edits);
    }

    /// Whether a request has no scene yet.
    pub(crate) fn is_pending(&self) -> bool {
        self.is_due || self.is_under_way
    }

    /// Whether a host that waits for its picture has to wait for a commit.
    pub(crate) fn is_awaited(&self) -> bool {
        self.is_pending() && self.ends_stop
    }

    pub(crate) fn has_work(&self) -> bool {
        self.is_due || (!self.is_under_way && !self.edits.is_empty())
    }

    /// The next piece of work. Edits without a request are only noted, so that the host's arrays that they replace are
    /// given back soon; never while a request waits that came before them.
    pub(crate) fn begin(&mut self) -> Option<CommitWork> {
        let is_live = self.newest.as_ref().is_some_and(|newest| newest.settings.interactive);
        if self.is_due {
            self.is_due = false;
            self.is_under_way = true;
            let ask = self.pictures.pop_front().or_else(|| self.newest.clone());
            return Some(CommitWork { edits: std::mem::take(&mut self.due), ask, is_live });
        }
        (!self.edits.is_empty()).then(|| CommitWork { edits: self.take_edits(), ask: None, is_live })
    }

    /// Takes the edits that no request came after; the next one is told that the scene has them.
    pub(crate) fn take_edits(&mut self) -> EditQueue {
        self.is_edited = true;
        std::mem::take(&mut self.edits)
    }

    /// How long the newest job is to wait for the commit that is pending, if at all.
    pub(crate) fn hold(&self, now: Instant) -> Option<Duration> {
        self.held_until.filter(|until| now < *until).map(|until| until - now)
    }

    /// Whether the commit under way is to be given up, since the next one brings other edits of prims that it builds
    /// meshes of. Only in an interactive session, and never two in a row: a host that drags something sees it move.
    pub(crate) fn makes_moot(&mut self, building: &[Arc<str>]) -> bool {
        let is_live = self.newest.as_ref().is_some_and(|newest| newest.settings.interactive);
        let is_new = self.looked_at != self.sealed;
        self.looked_at = self.sealed;
        is_live && is_new && self.is_due && !self.was_given_up && self.due.make_moot(building)
    }

    /// The commit under way was given up; the next one is due.
    pub(crate) fn give_up(&mut self) {
        (self.is_under_way, self.was_given_up) = (false, true);
        self.given_up += 1;
    }

    pub(crate) fn stop(&mut self) {
        self.ends_stop = false;
    }

    pub(crate) fn progress(&self) -> CommitProgress {
        let Self { ended, in_host_thread, given_up, .. } = *self;
        CommitProgress { ended, in_host_thread, given_up, is_pending: self.is_pending() }
    }
}

impl RenderControl {
    /// Takes a request. `None` if it is that of before and nothing was edited; else whether it is another one.
    pub(crate) fn ask(&mut self, ask: RenderAsk) -> Option<bool> {
        let commits = &mut self.commits;
        let is_known = commits.newest.as_ref().is_some_and(|newest| newest.is_like(&ask));
        let is_edited = commits.is_edited || !commits.edits.is_empty();
        if is_known && !is_edited {
            return None;
        }
        commits.sealed += u64::from(!commits.edits.is_empty());
        commits.due.then(std::mem::take(&mut commits.edits));
        commits.is_edited = false;
        commits.is_due = true;
        commits.ends_stop = true;
        commits.host = Some(std::thread::current().id());
        if let Some(job) = self.job.as_ref().filter(|job| ask.settings.interactive && !ask.is_of(job)) {
            if is_edited {
                commits.held_until = commits.held_until.or_else(|| Instant::now().checked_add(TOGETHER));
            }
            let scene = CommittedScene::of(job);
            self.stopped = false;
            // The scene lives on in the new job: what is dropped here is small.
            drop(self.post(ask.clone(), scene, true));
        }
        self.commits.pictures = ask.pictures();
        self.commits.newest = Some(ask);
        Some(!is_known)
    }

    /// After the end of a job: has the next picture of the newest request rendered, if there is one. Not after a stop,
    /// nor where the user wants an end.
    pub(crate) fn next_picture(&mut self) {
        if self.ends_early == self.generation || self.stopped {
            self.commits.pictures.clear();
        }
        if !self.commits.pictures.is_empty() && !self.commits.is_pending() {
            self.commits.is_due = true;
            self.commits.ends_stop = true;
        }
    }

    /// Ends the commit for `ask`: posts what follows of it. Without a result, the scene stays what it was. Returns what
    /// is to be dropped without the lock.
    #[must_use]
    pub(crate) fn committed(&mut self, ask: RenderAsk, result: Option<CommittedScene>) -> Option<Arc<RenderJob>> {
        let commits = &mut self.commits;
        (commits.is_under_way, commits.was_given_up) = (false, false);
        commits.held_until = None;
        commits.has_failed = result.is_none();
        commits.ended += 1;
        commits.in_host_thread += u64::from(commits.host == Some(std::thread::current().id()));
        // What came during the commit counts, where pictures on the way are wanted.
        let ask = commits.newest.clone().filter(|newest| newest.settings.interactive).unwrap_or(ask);
        let scene = result.or_else(|| self.job.as_deref().map(CommittedScene::of));
        let restarts = std::mem::take(&mut commits.restarts);
        let is_new = |scene: &CommittedScene| {
            let is_shown = |job: &Arc<RenderJob>| job.snapshot.version == scene.snapshot.version && ask.is_of(job);
            restarts || !self.job.as_ref().is_some_and(is_shown)
        };
        let scene = scene.filter(is_new);
        // A picture that is there already is followed by the next one.
        commits.is_due |= scene.is_none() && !commits.pictures.is_empty();
        if scene.is_some() && commits.ends_stop {
            self.stopped = false;
        }
        commits.ends_stop &= commits.is_due;
        self.post(ask, scene?, !restarts)
    }

    /// Renders the newest job again, from its first sample; if its commit is pending, then after that.
    pub(crate) fn restart(&mut self, options: SessionOptions) {
        let commits = &mut self.commits;
        commits.is_due |= commits.has_failed;
        if let Some(newest) = &mut commits.newest {
            newest.options = options;
            if !newest.before.is_empty() {
                commits.pictures = newest.pictures();
                commits.is_due = true;
            }
        }
        let is_pending = commits.is_pending();
        commits.ends_stop = is_pending;
        let is_live = commits.newest.as_ref().is_some_and(|newest| newest.settings.interactive);
        commits.restarts = is_pending && !is_live;
        self.paused = false;
        if !commits.restarts {
            self.stopped = false;
            self.generation += 1;
            let generation = self.generation;
            self.job = self
                .job
                .take()
                .map(|job| Arc::new(RenderJob { options, generation, goes_on: false, ..(*job).clone() }));
        }
    }

    /// Posts a job; returns the one before.
    fn post(&mut self, ask: RenderAsk, scene: CommittedScene, goes_on: bool) -> Option<Arc<RenderJob>> {
        self.generation += 1;
        self.job.replace(ask.job(scene, self.generation, goes_on))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::edits::SceneEdit;
    use crate::job::light_files::NoFiles;
    use glam::DMat4;
    use oocpt_core::camera::Camera;
    use oocpt_core::scene::SceneDb;

    fn camera() -> Camera {
        Camera {
            world_from_view: DMat4::IDENTITY,
            projection: DMat4::IDENTITY,
            display_window: [0.0, 0.0, 1.0, 1.0],
            data_window: [0, 0, 1, 1],
            lens_radius: 0.0,
            focus_distance: 0.0,
            clip_planes: Vec::new(),
            motion: Vec::new(),
            exposure_scale: 1.0,
        }
    }

    fn ask(width: u32, files: &Arc<dyn LightFiles>) -> RenderAsk {
        RenderAsk {
            request: RenderRequest { width, height: 1, camera: camera(), aovs: Vec::new(), window: None },
            settings: Settings { interactive: true, ..Settings::default() },
            options: SessionOptions::default(),
            images: None,
            files: Arc::clone(files),
            products: Arc::default(),
            before: Arc::default(),
            asked_at: Instant::now(),
        }
    }

    fn scene() -> CommittedScene {
        let snapshot = SceneDb::new().commit().snapshot;
        let primvars = Vec::new().into();
        CommittedScene {
            snapshot,
            primvars,
            identity: None,
            names: None,
            meshes: MeshCounts::default(),
            fixed_host_bytes: 0,
        }
    }

    /// Asks for a picture of this width and ends its commit; the scene is that of before.
    fn commit(control: &mut RenderControl, scene: &CommittedScene, ask: RenderAsk) {
        assert_eq!(control.ask(ask), Some(true), "a request that is new");
        let ask = control.commits.begin().and_then(|work| work.ask).expect("a commit");
        drop(control.committed(ask, Some(scene.clone())));
    }

    #[test]
    fn a_request_that_comes_with_edits_waits_for_their_commit_a_little_and_others_do_not() {
        let files: Arc<dyn LightFiles> = Arc::new(NoFiles);
        let scene = scene();
        let mut control = RenderControl::default();
        commit(&mut control, &scene, ask(1, &files));
        assert_eq!(control.generation, 1, "one job");
        assert_eq!(control.ask(ask(1, &files)), None, "the same again");
        commit(&mut control, &scene, ask(2, &files));
        assert_eq!(control.generation, 2, "no second job of a scene that stayed");
        control.commits.edit(vec![SceneEdit::other(|_| {})].into());
        control.ask(ask(3, &files));
        let now = Instant::now();
        let hold = control.commits.hold(now).expect("it waits for the edits");
        assert!(hold <= TOGETHER && control.commits.hold(now + TOGETHER).is_none(), "not for long: {hold:?}");
        let ask_of_edits = control.commits.begin().and_then(|work| work.ask).expect("a commit");
        control.ask(ask(4, &files));
        drop(control.committed(ask_of_edits, Some(scene.clone())));
        assert_eq!(control.commits.hold(now), None, "the commit is done");
        assert_eq!(control.job.as_ref().map(|job| job.request.width), Some(4), "the newest request");
        control.commits.begin().expect("the commit of the last one");
        control.ask(ask(5, &files));
        assert_eq!(control.commits.hold(Instant::now()), None, "nothing was edited");
    }

    #[test]
    fn a_commit_is_given_up_for_edits_of_what_it_builds_and_the_next_one_is_not() {
        let files: Arc<dyn LightFiles> = Arc::new(NoFiles);
        let scene = scene();
        let edits = |path: &str| vec![SceneEdit::upsert(path, |_| {})].into();
        let building: [Arc<str>; 2] = ["/ball".into(), "/box".into()];
        for interactive in [true, false] {
            let asks = |width| {
                let settings = Settings { interactive, ..Settings::default() };
                RenderAsk { settings, ..ask(width, &files) }
            };
            let mut control = RenderControl::default();
            control.commits.edit(edits("/ball"));
            control.ask(asks(1));
            control.commits.begin().expect("a commit");
            control.commits.edit(edits("/box"));
            assert!(!control.commits.makes_moot(&building), "no request came with it");
            control.ask(asks(2));
            assert!(!control.commits.makes_moot(&building[..1]), "another prim");
            control.commits.edit(edits("/ball"));
            control.ask(asks(3));
            assert_eq!(control.commits.makes_moot(&building), interactive, "in a live view");
            assert!(!control.commits.makes_moot(&building), "asked once");
            if interactive {
                control.commits.give_up();
                let work = control.commits.begin().expect("the next one follows");
                assert_eq!(work.edits.into_iter().count(), 2, "with the edits of both");
                control.commits.edit(edits("/ball"));
                control.ask(asks(4));
                assert!(!control.commits.makes_moot(&building), "it is not given up");
                drop(control.committed(work.ask.expect("of a request"), Some(scene.clone())));
                assert_eq!((control.commits.progress().given_up, control.commits.progress().ended), (1, 1));
                control.commits.begin().expect("the last one");
                control.commits.edit(edits("/box"));
                control.ask(asks(5));
                assert!(control.commits.makes_moot(&building), "and the one after it may be");
            }
        }
    }

    #[test]
    fn edits_without_a_request_are_noted_while_no_request_waits() {
        let files: Arc<dyn LightFiles> = Arc::new(NoFiles);
        let mut control = RenderControl::default();
        let edits = || vec![SceneEdit::other(|_| {})].into();
        control.commits.edit(edits());
        let noted = control.commits.begin().expect("work");
        assert!(noted.ask.is_none() && !noted.edits.is_empty(), "noted");
        assert!(!control.commits.is_pending() && control.commits.begin().is_none(), "not committed");
        assert_eq!(control.ask(ask(1, &files)), Some(true), "a request");
        control.commits.edit(edits());
        let work = control.commits.begin().expect("work");
        assert!(work.ask.is_some() && work.edits.is_empty(), "without the edits after it");
        assert_eq!(control.ask(ask(1, &files)), Some(false), "the same request with edits is work");
    }

    #[test]
    fn pictures_of_products_come_before_the_hosts_one_after_the_other() {
        let files: Arc<dyn LightFiles> = Arc::new(NoFiles);
        let scene = scene();
        let picture = |width: u32| ProductPicture { request: ask(width, &files).request, files: Vec::new() };
        let batch = |before: &[u32]| {
            let before: Vec<ProductPicture> = before.iter().copied().map(picture).collect();
            let settings = Settings { interactive: false, ..Settings::default() };
            RenderAsk { settings, before: before.into(), ..ask(9, &files) }
        };
        let mut control = RenderControl::default();
        let next = |control: &mut RenderControl| {
            let work = control.commits.begin().expect("a commit is due");
            drop(control.committed(work.ask.expect("of a request"), Some(scene.clone())));
            // The render thread has nothing to end where no job came.
            if control.finished != control.generation {
                control.finished = control.generation;
                control.next_picture();
            }
            control.job.as_ref().expect("posted").request.width
        };
        assert_eq!(control.ask(batch(&[5, 6])), Some(true));
        assert_eq!([next(&mut control), next(&mut control)], [5, 6]);
        assert!(control.is_rendering(), "the host's is to come");
        assert_eq!(control.ask(batch(&[5, 6])), None, "the host asks on and on");
        assert_eq!(next(&mut control), 9);
        assert!(!control.is_rendering() && !control.commits.has_work(), "that was the last");

        assert_eq!(control.ask(batch(&[7, 8])), Some(true));
        control.ends_early = control.generation + 1;
        assert_eq!(next(&mut control), 7);
        assert!(!control.is_rendering(), "the user wants an end");

        control.restart(SessionOptions::default());
        assert!(control.is_rendering(), "all of them again");
        assert_eq!([next(&mut control), next(&mut control), next(&mut control)], [7, 8, 9]);
        assert!(!control.is_rendering() && !control.commits.has_work(), "that was the last");
        control.restart(SessionOptions::default());
        assert_eq!(next(&mut control), 7);
        assert_eq!(control.ask(batch(&[7, 6])), Some(true), "the first of these is there");
        assert_eq!([next(&mut control), next(&mut control)], [7, 6], "so it is not rendered again");
        assert_eq!(next(&mut control), 9);
    }
}
