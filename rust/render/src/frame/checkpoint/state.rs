// SPDX-License-Identifier: Apache-2.0
//! What a checkpoint has beside the records of the film: how many paths they are, and what is known of their error.
//! JSON; it may come from strangers.

use crate::frame::context::paths;
use crate::frame::kept_samples::KeptSamples;
use crate::job::RenderJob;
use crate::job::aov::AovKind;
use crate::report::error_log::ErrorHistory;
use serde::{Deserialize, Serialize};

/// Changes when the records or this struct mean something else.
const VERSION: u32 = 1;

/// See the module.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub(super) struct EngineState {
    version: u32,
    paths: u64,
    /// As [`KeptSamples::nonfinite`].
    nonfinite: (u32, u32),
    is_told: bool,
    history: ErrorHistory,
    /// Names of the filtered images whose sums the file has, in their order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    images: Vec<String>,
}

impl EngineState {
    pub(super) fn of(kept: &KeptSamples, images: &[AovKind]) -> Self {
        let KeptSamples { job: _, paths, nonfinite, history, is_told, .. } = kept;
        Self {
            version: VERSION,
            paths: *paths,
            nonfinite: *nonfinite,
            is_told: *is_told,
            history: history.clone(),
            images: names(images),
        }
    }

    pub(super) fn text(&self) -> std::io::Result<Vec<u8>> {
        Ok(serde_json::to_vec(self)?)
    }

    pub(super) fn read(text: &[u8]) -> Result<Self, serde_json::Error> {
        serde_json::from_slice(text)
    }

    /// The samples as those of `job`, which is of the same film and filters these `images`; else the reason why it
    /// cannot go on with them.
    pub(super) fn kept(self, job: &RenderJob, wanted: &[AovKind]) -> Result<KeptSamples, String> {
        let Self { version, paths: have, nonfinite, is_told, history, images } = self;
        let pixels = job.request.pixels();
        if version != VERSION {
            return Err(format!("is a checkpoint of version {version}, not {VERSION}"));
        }
        let wanted = names(wanted);
        if images != wanted {
            let list = |names: &[String]| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            return Err(format!(
                "has samples of other filtered images: {}, where {} are wanted",
                list(&images.iter().map(|name| name.chars().take(32).collect()).collect::<Vec<_>>()),
                list(&wanted)
            ));
        }
        if have < pixels || !history.is_sound() {
            return Err("damaged: it says that it has samples that no checkpoint has".to_owned());
        }
        let samples = have.div_ceil(pixels.max(1));
        if have > paths(job) {
            let wanted = job.settings.samples_per_pixel;
            return Err(format!("has {samples} samples of each pixel, more than the {wanted} that are wanted"));
        }
        if !history.leads_to(pixels, have, job.settings.target_error) {
            return Err(format!("has {samples} samples of each pixel, more than the target error takes"));
        }
        let (job, lacks_planes, regions) = (job.clone(), false, Vec::new());
        Ok(KeptSamples { job, paths: have, nonfinite, history, is_told, lacks_planes, regions })
    }
}

fn names(images: &[AovKind]) -> Vec<String> {
    images.iter().map(|kind| kind.name()).collect()
}
