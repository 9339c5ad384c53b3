// SPDX-License-Identifier: Apache-2.0
//! The denoised picture: the colour, filtered by a library that is guided by albedo and normals.
//!
//! The render thread denoises images that were copied out and have not been published, so a host sees a picture before
//! or after it, never one in between. Without the library pictures stay as they are, and the user is told once.

use oocpt_core::settings::{DenoiseMode, Settings};
use oocpt_gpu::{DenoiseQuality, DenoiserDevice, DenoiserError, FloatImage, NoisyPicture};
use std::path::Path;
use std::time::{Duration, Instant};

/// Pictures on the way are denoised while one takes no longer than this.
const LONGEST_ON_THE_WAY: Duration = Duration::from_millis(150);
/// Most MiB that the filter takes of a host memory budget: a part of it.
const BUDGET_SHARE: u32 = 4;
/// Fewest MiB that the filter is allowed.
const LEAST_MIB: u32 = 64;

/// The denoiser of a session, opened when it is needed first.
#[derive(Debug, Default)]
pub(crate) struct SessionDenoiser {
    /// The file that was named, and what came of it.
    opened: Option<(String, Result<DenoiserDevice, DenoiserError>)>,
    is_told: bool,
    /// Time that the last picture on the way took, without that of opening the library.
    took: Option<Duration>,
}

/// A picture as the denoiser made it.
#[derive(Clone, Debug)]
pub(crate) struct DenoisedPicture {
    /// Red, green, blue and the colour's alpha of each pixel of the window, bottom row first.
    rgba: Vec<f32>,
    /// The denoiser.
    pub(crate) by: String,
    pub(crate) took: Duration,
}

impl DenoisedPicture {
    /// Its pixels as an image's.
    pub(crate) fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.rgba)
    }
}

/// What a picture is denoised for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DenoiseTask<'a> {
    pub(crate) settings: &'a Settings,
    /// Columns and rows of the window.
    pub(crate) size: [u32; 2],
    /// It is the last one of the render.
    pub(crate) is_last: bool,
    /// The device that renders, as the denoiser may know it.
    pub(crate) uuid: Option<[u8; 16]>,
}

impl DenoiseTask<'_> {
    /// The last picture gets the best quality, those on the way the fastest.
    fn quality(&self) -> DenoiseQuality {
        if self.is_last { DenoiseQuality::High } else { DenoiseQuality::Fast }
    }

    /// Most MiB for the filter; none: as much as it likes.
    fn most_mib(&self) -> Option<u32> {
        let budget = self.settings.host_memory_budget_mib;
        (budget > 0).then(|| (budget / BUDGET_SHARE).max(LEAST_MIB))
    }
}

impl SessionDenoiser {
    /// Whether a picture is worth denoising now: pictures on the way only where somebody asked for them, and where it
    /// is fast.
    pub(crate) fn is_due(&self, settings: &Settings, is_last: bool) -> bool {
        let is_fast = self.took.is_none_or(|took| took <= LONGEST_ON_THE_WAY);
        is_last || settings.denoise == DenoiseMode::Interactive && is_fast
    }

    /// Denoises the picture of the images `color` (four floats a pixel), `albedo` and `normal` (three); `None` if it
    /// was given up, because `goes_on` turned false. An error is one line for the user, and comes once.
    pub(crate) fn denoise(
        &mut self,
        [color, albedo, normal]: [&[f32]; 3],
        task: DenoiseTask<'_>,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Option<DenoisedPicture>, String> {
        let began = Instant::now();
        let denoiser = match self.open(&task) {
            Ok(denoiser) => denoiser,
            Err(error) => return self.tell(format!("the picture is not denoised: {error}; {HOW_TO_GET_IT}")),
        };
        let opened = Instant::now();
        let image = |floats, stride| FloatImage { floats, stride };
        let (color, guides) = (image(color, 4), [image(albedo, 3), image(normal, 3)]);
        let size = task.size.map(|side| side as usize);
        let picture = NoisyPicture { size, color, albedo: guides[0], normal: guides[1] };
        let mut rgba = color.floats.to_vec();
        let how = (task.quality(), task.most_mib());
        match denoiser.denoise(&picture, (&mut rgba, 4), how, goes_on) {
            Ok(()) => {}
            Err(DenoiserError::Cancelled) => return Ok(None),
            Err(error) => return self.tell(format!("the picture is not denoised: {error}")),
        }
        let by = denoiser.name().to_owned();
        if !task.is_last {
            self.took = Some(opened.elapsed());
        }
        Ok(Some(DenoisedPicture { rgba, by, took: began.elapsed() }))
    }

    fn open(&mut self, task: &DenoiseTask<'_>) -> Result<&mut DenoiserDevice, DenoiserError> {
        let file = &task.settings.denoiser_library;
        if self.opened.as_ref().is_none_or(|(named, _)| named != file) {
            let named = (!file.is_empty()).then(|| Path::new(file));
            self.opened = Some((file.clone(), DenoiserDevice::open(named, task.uuid)));
            self.is_told = false;
        }
        match &mut self.opened {
            Some((_, Ok(denoiser))) => Ok(denoiser),
            Some((_, Err(error))) => Err(error.clone()),
            None => Err(DenoiserError::Missing(String::new())),
        }
    }

    /// An error, if it is the first one.
    fn tell(&mut self, text: String) -> Result<Option<DenoisedPicture>, String> {
        if std::mem::replace(&mut self.is_told, true) { Ok(None) } else { Err(text) }
    }
}

/// What a user does who has no denoiser.
const HOW_TO_GET_IT: &str = "install the package pyoidn with the Python that renders (pip install pyoidn), or name \
                             the library in oocpt:denoiserLibrary";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_on_the_way_are_denoised_on_request_and_while_that_is_fast() {
        let of = |took: Option<Duration>| SessionDenoiser { took, ..SessionDenoiser::default() };
        let wants = |denoise: DenoiseMode| Settings { denoise, ..Settings::default() };
        let (fast, slow) = (of(Some(LONGEST_ON_THE_WAY)), of(Some(2 * LONGEST_ON_THE_WAY)));
        let interactive = wants(DenoiseMode::Interactive);
        assert!(of(None).is_due(&interactive, false) && fast.is_due(&interactive, false));
        assert!(!slow.is_due(&interactive, false) && slow.is_due(&interactive, true), "the last one always");
        assert!(!fast.is_due(&wants(DenoiseMode::Final), false));
    }
}
