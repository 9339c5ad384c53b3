// SPDX-License-Identifier: Apache-2.0
//! The job of a render thread, and how it comes about. Plain data.

pub(crate) mod aov;
pub(crate) mod commits;
pub(crate) mod deep;
pub(crate) mod edits;
pub(crate) mod expression;
#[cfg(feature = "faults")]
pub(crate) mod faults;
pub(crate) mod forced_features;
pub(crate) mod light_files;
pub(crate) mod patience;
pub(crate) mod primvar;
pub(crate) mod product;
pub(crate) mod publish;
pub(crate) mod request;
pub(crate) mod shared;
pub(crate) mod timings;
pub(crate) mod window;

use crate::host_memory::{self, HostMemoryUser};
use crate::job::forced_features::ForcedFeatures;
use crate::job::light_files::LightFiles;
use crate::job::product::ProductFile;
use crate::job::request::RenderRequest;
use crate::job::window::{FilmWindow, PictureLayout};
use crate::textures::ImageLibrary;
use oocpt_core::inventory::PrimvarUse;
use oocpt_core::scene::{PrimNames, Snapshot};
use oocpt_core::settings::Settings;
use oocpt_film::ExactFilm;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// What the job of one of several devices knows of the picture that they render together.
#[derive(Clone, Debug)]
pub(crate) struct TeamWork {
    /// Where the exact sums of its samples go.
    pub(crate) film: Arc<Mutex<ExactFilm>>,
    /// Logical devices of the same physical one that come before it.
    pub(crate) twin: u32,
    /// Number of the devices, which share host memory.
    pub(crate) devices: u32,
}

/// Meshes that the commits of a session have made so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MeshCounts {
    pub(crate) made: u64,
    /// Of these, those that deformed and were refitted.
    pub(crate) refitted: u64,
}

/// A scene, a request and settings to render; immutable once posted.
#[derive(Clone, Debug)]
pub(crate) struct RenderJob {
    pub(crate) snapshot: Arc<Snapshot>,
    pub(crate) request: RenderRequest,
    pub(crate) settings: Settings,
    pub(crate) options: SessionOptions,
    pub(crate) images: Option<Arc<dyn ImageLibrary>>,
    pub(crate) files: Arc<dyn LightFiles>,
    /// What is written of the finished picture.
    pub(crate) products: Arc<[ProductFile]>,
    /// The scene's primvars, and whether each is used.
    pub(crate) primvars: Arc<[PrimvarUse]>,
    /// Hash of the scene ([`oocpt_core::scene::SceneDb::identity`]), where a film is kept that is known by it.
    pub(crate) scene: Option<u128>,
    /// Names of what samples meet, if an image needs them.
    pub(crate) names: Option<Arc<PrimNames>>,
    /// Of the session, when it was posted.
    pub(crate) meshes: MeshCounts,
    /// Bytes of host memory that can be put nowhere else; 0 where there is no budget of it.
    pub(crate) fixed_host_bytes: u64,
    /// It may go on with the samples of a picture that differs in their number alone, or in what ends it.
    pub(crate) goes_on: bool,
    /// It is one of several windows of a picture, the one that the request names.
    pub(crate) film_window: Option<FilmWindow>,
    /// It renders some samples of a picture that several devices render.
    pub(crate) team: Option<TeamWork>,
    /// It brings pixels that a moved window has anew to the samples of the others, which nobody sees before the rest.
    pub(crate) catches_up: bool,
    /// When the host asked for it.
    pub(crate) asked_at: Instant,
    /// The generation of `RenderControl` when the job was posted.
    pub(crate) generation: u64,
}

impl RenderJob {
    /// Most bytes of a user of host memory that already holds `held`.
    pub(crate) fn host_limit(&self, user: HostMemoryUser, held: u64) -> u64 {
        host_memory::limit_of(user, &self.settings, held, self.fixed_host_bytes) / self.devices()
    }

    /// Most bytes of meshes in files that are read at a time.
    pub(crate) fn reading_limit(&self) -> u64 {
        host_memory::reading(&self.settings, self.fixed_host_bytes) / self.devices()
    }

    fn devices(&self) -> u64 {
        self.team.as_ref().map_or(1, |team| team.devices.max(1).into())
    }

    /// Where the pixels of its film go in the images.
    pub(crate) fn layout(&self) -> PictureLayout {
        self.request.layout().of_window(self.film_window)
    }

    /// Whether the pixels that it has in common with `have`, which has another window, have the same samples. In live
    /// views alone, and not where the error of all samples decides.
    pub(crate) fn shares_samples_of(&self, have: &Self) -> bool {
        let (request, window) = (&have.request, self.request.window);
        let (part, had) = (self.request.part(), request.part());
        let has_shared = !part.overlap(had).is_empty();
        has_shared
            && self.settings.interactive
            && self.settings.target_error <= 0.0
            && self.has_samples_of(&Self { request: RenderRequest { window, ..request.clone() }, ..have.clone() })
    }

    /// Whether samples of `have` are samples of this job too, and may be used.
    pub(crate) fn has_samples_of(&self, have: &Self) -> bool {
        let same_images = match (&have.images, &self.images) {
            (Some(have), Some(images)) => Arc::ptr_eq(have, images),
            (have, images) => have.is_none() && images.is_none(),
        };
        self.goes_on
            && have.snapshot.version == self.snapshot.version
            && self.request.has_samples_of(&have.request, self.settings.filter_aovs)
            && have.options == self.options
            && Arc::ptr_eq(&have.files, &self.files)
            && same_images
            && self.settings.goes_on_from(&have.settings)
    }
}

/// Options of how a session runs, apart from the scene and the request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SessionOptions {
    /// Turns Vulkan's validation layer on; its messages become errors. For tests.
    pub validation: bool,
    /// Measures the GPU time of each pass ([`crate::Session::timings`]); costs a little speed.
    pub profile: bool,
    /// Streams the scene even if it fits. For tests and benches.
    pub force_streaming: bool,
    /// Compiles more into the passes than the scene needs; the picture stays the same. For tests and benches.
    pub forced_features: ForcedFeatures,
    /// Most paths that a scene in core has in flight, to the power of two below; none: as many as pay. For tests and
    /// benches.
    pub in_flight: Option<u32>,
    /// Draws a progress bar on standard error while samples are traced; for command lines.
    pub progress_bar: bool,
    /// Makes a render that shows no intermediate images say how it ended: a [`crate::Severity::Status`] with time,
    /// error and memory, and a warning if a few pixels hold most of the error. For hosts with a user.
    pub closing_words: bool,
    /// Faults injected by tests.
    #[cfg(feature = "faults")]
    pub faults: faults::PlantedFaults,
}
