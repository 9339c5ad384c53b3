// SPDX-License-Identifier: Apache-2.0
//! Open Image Denoise made safe: a filter for noisy pictures, on the processor or on a GPU, loaded at run time.
//!
//! A [`DenoiserDevice`] holds a device of the library. Images are rows of 32-bit floats in host memory, which a GPU
//! copies there and back, or buffers that the library reaches itself ([`SharedFilters`]). Any thread; the library
//! serialises calls for one device.

mod filter;
mod library;
mod opened;
mod shared;

use filter::{FilterWork, OidnBuffer, OidnFilter};
use opened::OpenDenoiser;
use std::path::Path;
use std::sync::Arc;

pub use shared::{PictureBuffers, SharedFilters};

/// The reasons why a picture is not denoised.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DenoiserError {
    /// The library cannot be loaded; the text is the loader's.
    #[error("Open Image Denoise 2 is not there ({0})")]
    Missing(String),
    /// The library refuses its task; the text is its own.
    #[error("Open Image Denoise: {0}")]
    Failed(String),
    /// An image has fewer numbers than its size says, or none.
    #[error("{0} floats are no image of {1} x {2}")]
    Size(usize, usize, usize),
    /// The caller wanted no more of it.
    #[error("denoising was given up")]
    Cancelled,
}

/// How much work is spent on a picture (`OIDN_QUALITY_*`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DenoiseQuality {
    /// For pictures on the way.
    Fast = 4,
    /// For the last one.
    High = 6,
}

/// Three floats of each pixel of an image: the first of every `stride`.
#[derive(Clone, Copy, Debug)]
pub struct FloatImage<'a> {
    /// Row after row, without gaps.
    pub floats: &'a [f32],
    /// Floats of a pixel, at least 3.
    pub stride: usize,
}

/// A picture to be denoised, and what guides the filter.
#[derive(Clone, Copy, Debug)]
pub struct NoisyPicture<'a> {
    /// Columns and rows of each image.
    pub size: [usize; 2],
    /// Linear light without upper bound.
    pub color: FloatImage<'a>,
    /// Reflectances of what is seen, from 0 to 1.
    pub albedo: FloatImage<'a>,
    /// Normals of what is seen, from -1 to 1.
    pub normal: FloatImage<'a>,
}

/// How a picture is filtered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DenoiseOptions {
    /// For [`DenoiseQuality::High`] the guides are denoised first.
    pub quality: DenoiseQuality,
    /// Most MiB that a filter takes; `None`: as much as it likes.
    pub most_mib: Option<u32>,
}

/// A device of the library.
#[derive(Clone, Debug)]
pub struct DenoiserDevice {
    opened: Arc<OpenDenoiser>,
}

impl DenoiserDevice {
    /// Loads the library, from `file` if one is named, and opens its device for the GPU whose UUID is given
    /// (`VkPhysicalDeviceIDProperties::deviceUUID`), or the processor if that is none of the library's.
    ///
    /// # Errors
    /// [`DenoiserError::Missing`], [`DenoiserError::Failed`].
    pub fn open(file: Option<&Path>, uuid: Option<[u8; 16]>) -> Result<Self, DenoiserError> {
        Ok(Self { opened: Arc::new(OpenDenoiser::new(file, uuid)?) })
    }

    /// The library's version and the kind of its device.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.opened.name
    }

    /// Denoises a picture into `out`, rows of `stride` floats a pixel of which the first three are written. `goes_on`
    /// is asked from time to time.
    ///
    /// # Errors
    /// [`DenoiserError`]; `out` may have been written in parts.
    pub fn denoise(
        &self,
        picture: &NoisyPicture<'_>,
        (out, stride): (&mut [f32], usize),
        options: DenoiseOptions,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<(), DenoiserError> {
        let size = picture.size;
        for image in [picture.color, picture.albedo, picture.normal, FloatImage { floats: out, stride }] {
            check(image, size)?;
        }
        let copy = |image| OidnBuffer::copy_of(&self.opened, image);
        let (color, albedo, normal) = (copy(picture.color)?, copy(picture.albedo)?, copy(picture.normal)?);
        let (color, guides) = (color.image(3), [albedo.image(3), normal.image(3)]);
        for filter in OidnFilter::of_picture(&self.opened, (color, guides, guides), size, options)? {
            filter.run(&FilterWork { goes_on })?;
        }
        color.buffer.read(size[0] * size[1], out, stride)
    }
}

/// Whether an image has the numbers that its size says.
fn check(image: FloatImage<'_>, [width, height]: [usize; 2]) -> Result<(), DenoiserError> {
    let floats = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(image.stride));
    let is_whole = image.stride >= 3 && !image.floats.is_empty() && floats == Some(image.floats.len());
    if is_whole { Ok(()) } else { Err(DenoiserError::Size(image.floats.len(), width, height)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    /// The library that tests use.
    pub(crate) fn library() -> PathBuf {
        std::env::var_os("OOCPT_DENOISER_LIBRARY").expect("a file, which `cargo xtask test` names").into()
    }

    /// For a GPU that there is not: on the processor.
    fn denoiser() -> DenoiserDevice {
        DenoiserDevice::open(Some(&library()), Some([7; 16])).expect("Open Image Denoise")
    }

    #[test]
    fn a_library_that_is_not_there_is_told() {
        let error = DenoiserDevice::open(Some(Path::new("/nowhere/libOpenImageDenoise.so")), None).err();
        assert!(matches!(&error, Some(DenoiserError::Missing(text)) if text.contains("/nowhere/")), "{error:?}");
    }

    #[test]
    fn a_library_that_is_another_is_told() {
        let error = DenoiserDevice::open(Some(Path::new("libm.so.6")), None).err();
        assert!(matches!(&error, Some(DenoiserError::Missing(text)) if text.contains("oidnNewDevice")), "{error:?}");
    }

    #[test]
    fn images_of_a_wrong_size_are_refused() {
        let size = |floats: &[f32], stride: usize, size| check(FloatImage { floats, stride }, size);
        assert_eq!(size(&[0.0; 12], 3, [2, 2]), Ok(()));
        assert_eq!(size(&[0.0; 11], 3, [2, 2]), Err(DenoiserError::Size(11, 2, 2)));
        assert!(size(&[0.0; 8], 2, [2, 2]).is_err(), "two floats are no colour");
        assert!(size(&[], 3, [0, 0]).is_err(), "nothing");
        assert!(size(&[0.0; 12], 3, [usize::MAX, 2]).is_err(), "more than can be counted");
    }

    /// Noise of mean 1 over grey, in pixels of four floats.
    pub(crate) fn noise(pixels: usize) -> Vec<f32> {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            #[expect(clippy::cast_precision_loss, reason = "24 bits")]
            let unit = (state >> 8) as f32 / 16_777_216.0;
            2.0 * unit
        };
        (0..pixels).flat_map(|_| [next(), next(), next(), 0.25]).collect()
    }

    #[test]
    fn noise_over_grey_becomes_grey_and_a_filter_that_is_given_up_says_so() {
        let denoiser = denoiser();
        let name = denoiser.name();
        assert!(name.starts_with("Open Image Denoise 2.") && name.ends_with(", CPU"), "{name}");
        let size = [96, 64];
        let color = noise(size[0] * size[1]);
        let flat = vec![0.5; color.len() / 4 * 3];
        let image = |floats| FloatImage { floats, stride: 3 };
        let picture = NoisyPicture {
            size,
            color: FloatImage { floats: &color, stride: 4 },
            albedo: image(&flat),
            normal: image(&flat),
        };
        for quality in [DenoiseQuality::Fast, DenoiseQuality::High] {
            let mut out = color.clone();
            denoiser
                .denoise(&picture, (&mut out, 4), DenoiseOptions { quality, most_mib: Some(512) }, &|| true)
                .expect("a picture");
            let spread = |floats: &[f32]| {
                let squares = floats.chunks_exact(4).map(|pixel| (pixel[1] - 1.0).powi(2)).sum::<f32>();
                squares / 6144.0
            };
            assert!(spread(&color) > 0.3 && spread(&out) < 0.02, "{} {}", spread(&color), spread(&out));
            assert!(out.chunks_exact(4).all(|pixel| pixel[3] == 0.25), "the fourth float stays");
            let given_up =
                denoiser.denoise(&picture, (&mut out, 4), DenoiseOptions { quality, most_mib: None }, &|| false);
            assert_eq!(given_up, Err(DenoiserError::Cancelled));
        }
        let short = NoisyPicture { albedo: image(&flat[3..]), ..picture };
        let mut out = color.clone();
        let options = DenoiseOptions { quality: DenoiseQuality::Fast, most_mib: None };
        let refused = denoiser.denoise(&short, (&mut out, 4), options, &|| true);
        assert!(matches!(refused, Err(DenoiserError::Size(..))), "{refused:?}");
    }
}
