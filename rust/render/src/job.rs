// SPDX-License-Identifier: Apache-2.0
//! What a render thread is asked to render. Plain data.

use crate::light_files::LightFiles;
use crate::request::RenderRequest;
use crate::textures::ImageLibrary;
use oocpt_core::inventory::PrimvarUse;
use oocpt_core::scene::Snapshot;
use oocpt_core::settings::Settings;
use std::sync::Arc;

/// What to render; immutable once posted.
#[derive(Clone, Debug)]
pub(crate) struct Job {
    pub(crate) snapshot: Arc<Snapshot>,
    pub(crate) request: RenderRequest,
    pub(crate) settings: Settings,
    pub(crate) options: SessionOptions,
    pub(crate) images: Option<Arc<dyn ImageLibrary>>,
    pub(crate) files: Arc<dyn LightFiles>,
    /// The scene's primvars, and which of them are used.
    pub(crate) primvars: Arc<[PrimvarUse]>,
    /// That of `Control` when it was posted.
    pub(crate) generation: u64,
}

/// How a session runs, apart from what it renders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SessionOptions {
    /// Turns Vulkan's validation layer on; its messages become errors. For tests.
    pub validation: bool,
    /// Measures the GPU time of each pass ([`crate::Session::timings`]); costs a little speed.
    pub profile: bool,
    /// Streams the scene even if it fits. For tests and benches.
    pub force_streaming: bool,
    /// Makes rays forget the chunks they would have to wait for: the picture is wrong. For the test that shows that the
    /// comparison of pictures notices.
    pub plant_lost_chunks: bool,
    /// The probability, in thousandths, with which roulette on loads (`oocpt:stragglerRoulette`) loads whatever it
    /// plays for; none = by what loads cost and bring. For tests.
    pub roulette_per_mille: Option<u16>,
    /// Makes that roulette end rays without weighting those that go on: the picture is too dark. For the test that
    /// shows that it would be noticed.
    pub plant_unweighted_roulette: bool,
    /// Lets each pixel's own samples decide how many more it gets: adaptive pictures are biased. For the test that
    /// shows that it would notice.
    pub plant_naive_sampling: bool,
    /// A planted fault, for tests, with adaptive sampling: roulette on loads is also played with samples that decide
    /// where others go.
    pub plant_early_roulette: bool,
    /// Makes one request for device memory fail, after this many that succeed. For tests.
    pub fail_allocation_after: Option<u64>,
    /// Draws a progress bar on standard error while samples are traced; for command lines.
    pub progress_bar: bool,
}
