// SPDX-License-Identifier: Apache-2.0
//! Has pictures denoised before they are published.

use super::FrameProgress;
use crate::denoiser::{DenoiseTask, DenoisedPicture, denoise_copies};
use crate::error::RenderError;
use crate::film::Film;
use crate::film::denoised;
use crate::job::RenderJob;
use crate::job::aov::AovKind;
use crate::job::publish::PictureExtent;
use crate::job::request::Severity;
use crate::job::shared::FrameGate;
use crate::sync::lock;
use oocpt_core::settings::Settings;
use oocpt_core::stats::DenoiserUsage;
use oocpt_gpu::{DenoiseOptions, DenoiserDevice, DenoiserError};

/// How the pictures of a job are denoised.
#[derive(Debug)]
pub(super) struct DenoisingPlan {
    settings: Settings,
    /// Images are copied to the host to be denoised.
    by_host: bool,
    /// The last picture, once it is there: its images may be published again.
    last: Option<DenoisedPicture>,
}

impl DenoisingPlan {
    /// `None` if nothing of the job is to be denoised, or if the whole that it is a window of is.
    pub(super) fn of(job: &RenderJob) -> Option<Self> {
        let is_wanted = job.film_window.is_none() && denoised::is_wanted(&job.request.kinds(), &job.settings);
        #[cfg(feature = "faults")]
        let by_host = job.options.faults.denoises_by_host;
        #[cfg(not(feature = "faults"))]
        let by_host = false;
        is_wanted.then(|| Self { settings: job.settings.clone(), by_host, last: None })
    }

    /// Whether hosts see the denoised picture in place of the colour.
    pub(super) fn replaces_color(&self) -> bool {
        denoised::replaces_color(&self.settings)
    }
}

impl FrameProgress<'_> {
    /// The picture that was copied out, denoised, if it is to be and all of it is there.
    pub(super) fn denoise(
        &mut self,
        film: &Film,
        extent: PictureExtent,
        is_last: bool,
    ) -> Result<Option<DenoisedPicture>, RenderError> {
        let Some(denoising) = &self.denoising else { return Ok(None) };
        let is_due = lock(&self.shared.denoiser).is_due(&denoising.settings, is_last);
        if !is_due || !extent.covers(self.pixels) {
            return Ok(None);
        }
        if denoising.last.is_some() {
            return Ok(denoising.last.clone());
        }
        let by_host = denoising.by_host;
        let picture = self.denoised(is_last, |denoiser, options, goes_on| {
            let size = self.layout.window.size();
            if !by_host && film.denoise(denoiser, size, options, goes_on)? {
                return Ok(None);
            }
            let denoise = |images: [&[f32]; 3]| denoise_copies(denoiser, images, size, options, goes_on);
            let denoised = film.look_at_guides(denoise).map_err(|error| DenoiserError::Failed(error.to_string()))?;
            denoised.ok_or_else(|| DenoiserError::Failed("images that guide it are missing".to_owned()))?.map(Some)
        });
        if is_last && let Some(denoising) = &mut self.denoising {
            denoising.last.clone_from(&picture);
        }
        Ok(picture)
    }

    /// Denoises the published picture that was put together of windows, if it is to be.
    pub(crate) fn denoise_windows(&mut self) {
        let Some(denoising) = &self.denoising else { return };
        let mut published = lock(&self.shared.published);
        published.show_denoised(denoising.replaces_color());
        let images = [AovKind::Color, AovKind::Albedo, AovKind::Normal].map(|kind| published.window_of(kind));
        drop(published);
        let [Some(color), Some(albedo), Some(normal)] = images else { return };
        let denoise = |denoiser: &DenoiserDevice, options, goes_on: &dyn Fn() -> bool| {
            let size = self.layout.window.size();
            denoise_copies(denoiser, [&color, &albedo, &normal], size, options, goes_on).map(Some)
        };
        if let Some(DenoisedPicture { rgba: Some(rgba), .. }) = self.denoised(true, denoise) {
            lock(&self.shared.published).put(AovKind::Denoised, bytemuck::cast_slice(&rgba), u64::MAX);
        }
    }

    /// Has `filter` denoise a picture, and says in the stats what did it; tells why it cannot be denoised.
    fn denoised(
        &self,
        is_last: bool,
        filter: impl FnOnce(&DenoiserDevice, DenoiseOptions, &dyn Fn() -> bool) -> Result<Option<Vec<f32>>, DenoiserError>,
    ) -> Option<DenoisedPicture> {
        let denoising = self.denoising.as_ref()?;
        let gate = FrameGate::new(self.shared, self.generation);
        let goes_on = || !gate.is_superseded();
        let uuid = lock(&self.shared.device).as_ref().map(|device| device.uuid);
        let task = DenoiseTask { settings: &denoising.settings, is_last, uuid };
        let filter = |denoiser: &DenoiserDevice, options| filter(denoiser, options, &goes_on);
        let picture = lock(&self.shared.denoiser).denoise(task, filter).unwrap_or_else(|text| {
            self.shared.report(Severity::Warning, text);
            None
        })?;
        let usage = DenoiserUsage {
            by: picture.by.clone(),
            seconds: picture.took.as_secs_f64(),
            replaces_color: denoising.replaces_color(),
            in_place: picture.rgba.is_none(),
            truth: None,
        };
        lock(&self.shared.stats).denoised = Some(usage);
        Some(picture)
    }
}
