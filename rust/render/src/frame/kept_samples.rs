// SPDX-License-Identifier: Apache-2.0
//! The samples that a film has when a render ends, finished or given up, and the renders that go on with them. Pure.
//!
//! A film sums the samples of a pixel in ascending order, whatever their number is to be in the end: so a picture with
//! more samples begins with those that are there, and has the bits of one that was rendered at once. Not so where
//! samples are adaptive: an epoch is decided by the number of all samples.

use crate::frame::context::paths;
use crate::frame::film_regions::{self, FilmRegion};
use crate::job::RenderJob;
use crate::report::error_log::ErrorHistory;

/// See the module.
#[derive(Clone, Debug)]
pub(crate) struct KeptSamples {
    /// Whose samples they are.
    pub(crate) job: RenderJob,
    /// The film has the first so many paths, at least one for each pixel.
    pub(crate) paths: u64,
    /// Samples among them that were not finite, and `WavefrontCounters::nonfinite_pixel`.
    pub(crate) nonfinite: (u32, u32),
    pub(crate) history: ErrorHistory,
    /// The last row of `history` is that of all of them.
    pub(crate) is_told: bool,
    /// The images through pixel centres are not those of its window.
    pub(crate) lacks_planes: bool,
    /// Where pixels have other numbers of samples than `paths` says: what they have. All are in one.
    pub(crate) regions: Vec<FilmRegion>,
}

impl KeptSamples {
    /// Whether `job` goes on with them: it has the same samples, and no fewer.
    pub(crate) fn serve(&self, job: &RenderJob) -> bool {
        self.regions.is_empty()
            && job.has_samples_of(&self.job)
            && self.paths <= paths(job)
            && self.history.leads_to(job.request.pixels(), self.paths, job.settings.target_error)
    }

    /// Samples that pixels of the window of `job` have, if it is another window of the picture whose samples these are,
    /// or one that has them in part.
    pub(crate) fn moved_to(&self, job: &RenderJob) -> Option<Vec<FilmRegion>> {
        if !job.shares_samples_of(&self.job) {
            return None;
        }
        let window = self.job.request.part();
        let have =
            if self.regions.is_empty() { film_regions::of_film(window, self.paths) } else { self.regions.clone() };
        Some(film_regions::moved(&have, job.request.part()))
    }
}
