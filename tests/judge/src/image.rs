// SPDX-License-Identifier: Apache-2.0
//! Plain float images, bottom-up as Hydra's render buffers, and their way to an EXR file for people to look at.

use std::path::Path;

use exr::prelude::WritableImage;

use crate::JudgeError;

/// `width x height x channels` floats, rows bottom-up, channels interleaved.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Floats per pixel.
    pub channels: usize,
    /// The floats, `data[(y * width + x) * channels + c]`.
    pub data: Vec<f32>,
}

impl Image {
    /// A black image.
    #[must_use]
    pub fn new(width: usize, height: usize, channels: usize) -> Self {
        Self { width, height, channels, data: vec![0.0; width * height * channels] }
    }

    /// An image of floats as a render buffer holds them.
    ///
    /// # Errors
    /// [`JudgeError::Shape`] when the length does not fit.
    pub fn from_data(width: usize, height: usize, channels: usize, data: Vec<f32>) -> Result<Self, JudgeError> {
        if data.len() != width * height * channels {
            return Err(JudgeError::Shape(width, height, channels, data.len(), 1, 1));
        }
        Ok(Self { width, height, channels, data })
    }

    /// The channels of one pixel.
    #[must_use]
    pub fn pixel(&self, x: usize, y: usize) -> &[f32] {
        let start = (y * self.width + x) * self.channels;
        &self.data[start..start + self.channels]
    }

    /// Mean over all pixels of each channel.
    #[must_use]
    pub fn mean(&self) -> Vec<f64> {
        let mut sum = vec![0.0; self.channels];
        for pixel in self.data.chunks_exact(self.channels) {
            for (sum, &value) in sum.iter_mut().zip(pixel) {
                *sum += f64::from(value);
            }
        }
        let count = (self.width * self.height).max(1) as f64;
        sum.iter_mut().for_each(|sum| *sum /= count);
        sum
    }

    /// # Errors
    /// [`JudgeError::Shape`] unless both images have the same size and channels.
    pub fn same_shape(&self, other: &Self) -> Result<(), JudgeError> {
        let shape = |i: &Self| (i.width, i.height, i.channels);
        if shape(self) == shape(other) {
            return Ok(());
        }
        Err(JudgeError::Shape(self.width, self.height, self.channels, other.width, other.height, other.channels))
    }

    /// Writes the first three channels (or one as grey) as RGB EXR, top row first as files have it.
    ///
    /// # Errors
    /// [`JudgeError::Write`] with the path.
    pub fn write_exr(&self, path: &Path) -> Result<(), JudgeError> {
        let failed = |reason: String| JudgeError::Write { path: path.display().to_string(), reason };
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|error| failed(error.to_string()))?;
        }
        let channel = |pixel: &[f32], index: usize| pixel.get(index).or(pixel.first()).copied().unwrap_or(0.0);
        let pixels = exr::prelude::SpecificChannels::rgb(|position: exr::prelude::Vec2<usize>| {
            let pixel = self.pixel(position.x(), self.height - 1 - position.y());
            (channel(pixel, 0), channel(pixel, 1), channel(pixel, 2))
        });
        let image = exr::prelude::Image::from_channels((self.width, self.height), pixels);
        image.write().to_file(path).map_err(|error| failed(error.to_string()))
    }
}

/// Rounds to the precision of images.
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is the point")]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}
