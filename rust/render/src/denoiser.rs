// SPDX-License-Identifier: Apache-2.0
//! The denoised picture: the colour, filtered by a library that is guided by albedo and normals.
//!
//! The render thread denoises images that were copied out and have not been published, so a host sees a picture before
//! or after it, never one in between. Without the library pictures stay as they are, and the user is told once.

use oocpt_core::settings::{DenoiseMode, Settings};
use oocpt_gpu::{DenoiseOptions, DenoiseQuality, DenoiserDevice, DenoiserError, FloatImage, NoisyPicture};
use std::path::Path;
use std::time::{Duration, Instant};

/// Pictures on the way are denoised while one takes no longer than this.
const LONGEST_ON_THE_WAY: Duration = Duration::from_millis(150);
/// Most MiB that the filter takes of a host memory budget: a part of it.
const BUDGET_SHARE: u32 = 4;
/// Fewest MiB that the filter is allowed.
const LEAST_MIB: u32 = 64;

/// The denoiser of a session, opened when it is needed first, and kept: opening a GPU takes 0.3 s.
#[derive(Debug, Default)]
pub(crate) struct SessionDenoiser {
    /// What was opened, and what came of it.
    opened: Option<(DenoiserChoice, Result<DenoiserDevice, DenoiserError>)>,
    is_told: bool,
    /// Time that the last picture on the way took, without that of opening the library.
    took: Option<Duration>,
}

/// A library and a device.
#[derive(Clone, Debug, PartialEq, Eq)]
struct DenoiserChoice {
    /// The file that was named; empty: none.
    file: String,
    /// The device that renders.
    uuid: Option<[u8; 16]>,
}

/// A picture as the denoiser made it.
#[derive(Clone, Debug)]
pub(crate) struct DenoisedPicture {
    /// Red, green, blue and the colour's alpha of each pixel of the window, bottom row first; none: the film has it
    /// (`crate::film::in_place`).
    pub(crate) rgba: Option<Vec<f32>>,
    /// The denoiser.
    pub(crate) by: String,
    pub(crate) took: Duration,
}

/// What a picture is denoised for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DenoiseTask<'a> {
    pub(crate) settings: &'a Settings,
    /// It is the last one of the render.
    pub(crate) is_last: bool,
    /// The device that renders, as the denoiser may know it.
    pub(crate) uuid: Option<[u8; 16]>,
}

impl DenoiseTask<'_> {
    /// The last picture gets the best quality, those on the way the fastest.
    fn options(&self) -> DenoiseOptions {
        let quality = if self.is_last { DenoiseQuality::High } else { DenoiseQuality::Fast };
        let budget = self.settings.host_memory_budget_mib;
        DenoiseOptions { quality, most_mib: (budget > 0).then(|| (budget / BUDGET_SHARE).max(LEAST_MIB)) }
    }
}

/// Denoises a picture of `size` of the images `color` (four floats a pixel), `albedo` and `normal` (three), until
/// `goes_on` turns false; gives it with the colour's alpha.
pub(crate) fn denoise_copies(
    denoiser: &DenoiserDevice,
    [color, albedo, normal]: [&[f32]; 3],
    size: [u32; 2],
    options: DenoiseOptions,
    goes_on: &dyn Fn() -> bool,
) -> Result<Vec<f32>, DenoiserError> {
    let image = |floats, stride| FloatImage { floats, stride };
    let (color, albedo, normal) = (image(color, 4), image(albedo, 3), image(normal, 3));
    let picture = NoisyPicture { size: size.map(|side| side as usize), color, albedo, normal };
    let mut rgba = color.floats.to_vec();
    denoiser.denoise(&picture, (&mut rgba, 4), options, goes_on)?;
    Ok(rgba)
}

impl SessionDenoiser {
    /// Whether a picture is worth denoising now: pictures on the way only where somebody asked for them, and where it
    /// is fast.
    pub(crate) fn is_due(&self, settings: &Settings, is_last: bool) -> bool {
        let is_fast = self.took.is_none_or(|took| took <= LONGEST_ON_THE_WAY);
        is_last || settings.denoise == DenoiseMode::Interactive && is_fast
    }

    /// Has `filter` denoise a picture, which gives its pixels, or none where the film has them; `None` if it was given
    /// up. An error is one line for the user, and comes once.
    pub(crate) fn denoise(
        &mut self,
        task: DenoiseTask<'_>,
        filter: impl FnOnce(&DenoiserDevice, DenoiseOptions) -> Result<Option<Vec<f32>>, DenoiserError>,
    ) -> Result<Option<DenoisedPicture>, String> {
        let began = Instant::now();
        let denoiser = match self.open(&task) {
            Ok(denoiser) => denoiser,
            Err(error) => return self.tell(format!("the picture is not denoised: {error}; {HOW_TO_GET_IT}")),
        };
        let opened = Instant::now();
        let rgba = match filter(denoiser, task.options()) {
            Ok(rgba) => rgba,
            Err(DenoiserError::Cancelled) => return Ok(None),
            Err(error) => return self.tell(format!("the picture is not denoised: {error}")),
        };
        let by = denoiser.name().to_owned();
        if !task.is_last {
            self.took = Some(opened.elapsed());
        }
        Ok(Some(DenoisedPicture { rgba, by, took: began.elapsed() }))
    }

    fn open(&mut self, task: &DenoiseTask<'_>) -> Result<&DenoiserDevice, DenoiserError> {
        let choice = DenoiserChoice { file: task.settings.denoiser_library.clone(), uuid: task.uuid };
        if self.opened.as_ref().is_none_or(|(opened, _)| *opened != choice) {
            let named = (!choice.file.is_empty()).then(|| Path::new(&choice.file));
            let opened = DenoiserDevice::open(named, choice.uuid);
            self.opened = Some((choice, opened));
            self.is_told = false;
        }
        match &self.opened {
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
