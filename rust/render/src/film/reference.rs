// SPDX-License-Identifier: Apache-2.0
//! A reference picture from an EXR file, and the error of another picture against it. Where only a window is rendered,
//! only that is compared.
//!
//! Errors are in linear light and double precision; FLIP (Andersson et al. 2020) is that of the two pictures as sRGB in
//! 8 bits, at 67 pixels per degree. The file comes from the user: its size is checked before its pixels are read.

use crate::job::aov::AovKind;
use crate::job::publish::PublishedImages;
use crate::job::window::PixelWindow;
use exr::prelude::{ReadChannels as _, ReadLayers as _, Vec2, read};
use oocpt_core::stats::TrueError;
use std::io::BufReader;
use std::path::Path;

/// Keeps the relative error of black pixels finite.
const EPSILON: f64 = 1e-2;

/// A reference picture: bottom row first, as images of a render are.
#[derive(Debug)]
pub(crate) struct ReferencePicture {
    /// Columns of the whole picture.
    columns: u32,
    /// What is compared.
    window: PixelWindow,
    /// The pixels of the window.
    pixels: Vec<[f32; 3]>,
    /// These as sRGB in 8 bits, top row first.
    display: Vec<u8>,
}

/// The reasons why there is nothing to compare with.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ReferenceError {
    /// The file holds no readable picture.
    #[error("{0}")]
    Read(String),
    /// The picture has another size.
    #[error("the picture is {0} x {1} pixels, the reference {2} x {3}")]
    Size(u32, u32, usize, usize),
    /// The picture has pixels that are not finite.
    #[error("the reference has pixels that are not finite")]
    NotFinite,
}

impl ReferencePicture {
    /// Reads the first layer's R, G and B, of a picture of that size of which a window is rendered.
    pub(crate) fn read(path: &Path, [width, height]: [u32; 2], window: PixelWindow) -> Result<Self, ReferenceError> {
        let read_error = |error: exr::error::Error| ReferenceError::Read(format!("{}: {error}", path.display()));
        let open = || Ok(BufReader::new(oocpt_files::open(path)?));
        let meta = open().and_then(|file| exr::meta::MetaData::read_from_buffered(file, false)).map_err(read_error)?;
        let size = meta.headers.first().map_or(Vec2(0, 0), |header| header.layer_size);
        if size != Vec2(width as usize, height as usize) {
            return Err(ReferenceError::Size(width, height, size.x(), size.y()));
        }
        let columns = size.x();
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .rgb_channels(
                move |size, _| vec![[0.0_f32; 3]; size.area()],
                move |pixels, at, (r, g, b): (f32, f32, f32)| {
                    if let Some(pixel) = pixels.get_mut(at.y() * columns + at.x()) {
                        *pixel = [r, g, b];
                    }
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_buffered(open().map_err(read_error)?)
            .map_err(read_error)?;
        let top_first = image.layer_data.channel_data.pixels;
        if top_first.len() != size.area() {
            return Err(ReferenceError::Read(format!("{}: another layer than its first is read", path.display())));
        }
        let bottom_first: Vec<[f32; 3]> = top_first.chunks_exact(columns.max(1)).rev().flatten().copied().collect();
        let pixels: Vec<[f32; 3]> = window.rows(width, 1).flat_map(|row| &bottom_first[row]).copied().collect();
        if pixels.iter().flatten().any(|v| !v.is_finite()) {
            return Err(ReferenceError::NotFinite);
        }
        Ok(Self { columns: width, window, display: display(window.width, &pixels), pixels })
    }

    /// Compares with a published image of colour; `None` if there is none of this size.
    pub(crate) fn compare(&self, published: &PublishedImages, kind: AovKind) -> Option<TrueError> {
        let image = published.image(kind)?;
        let mut pixels: Vec<[f32; 3]> = Vec::with_capacity(self.pixels.len());
        for row in self.window.rows(self.columns, AovKind::Color.pixel_bytes()) {
            let rgba: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(image.get(row)?);
            pixels.extend(rgba.iter().map(|[r, g, b, _]| [*r, *g, *b]));
        }
        let (mut relative, mut square) = (0.0, 0.0);
        for (x, r) in pixels.iter().flatten().zip(self.pixels.iter().flatten()) {
            let (x, r) = (f64::from(*x), f64::from(*r));
            let apart = (x - r) * (x - r);
            square += apart;
            relative += apart / r.mul_add(r, EPSILON);
        }
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53")]
        let count = (3 * self.pixels.len()).max(1) as f64;
        let [width, height] = self.window.size();
        let flip = nv_flip::flip(
            nv_flip::FlipImageRgb8::with_data(width, height, &self.display),
            nv_flip::FlipImageRgb8::with_data(width, height, &display(width, &pixels)),
            nv_flip::DEFAULT_PIXELS_PER_DEGREE,
        );
        let flip = f64::from(nv_flip::FlipPool::from_image(&flip).mean());
        Some(TrueError { rel_mse: relative / count, rmse: (square / count).sqrt(), flip })
    }
}

/// Converts to sRGB in 8 bits (IEC 61966-2-1), top row first.
fn display(width: u32, pixels: &[[f32; 3]]) -> Vec<u8> {
    pixels.chunks_exact((width as usize).max(1)).rev().flatten().flatten().map(|v| srgb8(*v)).collect()
}

fn srgb8(linear: f32) -> u8 {
    let x = if linear.is_nan() { 0.0 } else { linear.clamp(0.0, 1.0) };
    let encoded = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..=255 by the clamp")]
    let byte = (encoded * 255.0).round() as u8;
    byte
}
