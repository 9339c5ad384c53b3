// SPDX-License-Identifier: Apache-2.0
//! Pictures as EXR files that say how they were made: `oocpt:` attributes with the time they took, their samples and
//! rays, and their estimated error. Linear light, four 32-bit floats a pixel, colour premultiplied by alpha.
//!
//! Hosts write the files of their own renders, and Hydra gives a render buffer no way to pass attributes to them: our
//! `usdrecord` has them added ([`annotate`]), and for others the same numbers are in the report that `oocpt:report`
//! names. Files that are read may come from strangers: only a bounded part of their headers is read. Any thread.

use super::exr_header;
use super::picture_attribute::PREFIX;
pub use super::picture_attribute::{PictureAttribute, PictureAttributes};
use exr::meta::attribute::{AttributeValue, Text};
use exr::prelude::{Encoding, Image, Layer, LayerAttributes, MetaData, SpecificChannels, Vec2, WritableImage as _};
use oocpt_core::settings::Settings;
use oocpt_core::stats::{ErrorRow, RenderStats};
use std::io::{BufReader, BufWriter};
use std::path::Path;

/// Most attributes that are read.
const MAX_ATTRIBUTES: usize = 64;
/// Longest text of an attribute that is read, characters.
const MAX_TEXT_CHARS: usize = 400;

/// The reasons why a picture was not written or read.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The file and the error of the EXR library.
    #[error("{0}: {1}")]
    File(String, String),
    /// The number of floats does not match the size of the picture.
    #[error("{0} floats are no picture of {1} x {2}")]
    Size(usize, u32, u32),
}

/// Collects the attributes of a finished render's picture.
#[expect(clippy::cast_precision_loss, reason = "counts are exact below 2^53")]
pub(crate) fn attributes(stats: &RenderStats, device: &str, driver: &str, settings: &Settings) -> PictureAttributes {
    let ErrorRow { samples, seconds, seconds_tracing, rays, estimate, bytes_paged, truth, .. } =
        stats.error.clone().unwrap_or_else(|| ErrorRow {
            samples: stats.samples_completed,
            seconds: stats.seconds_total,
            rays: stats.rays_traced,
            ..ErrorRow::default()
        });
    let number = |name: &str, number: f64| (name.to_owned(), PictureAttribute::Number(number));
    let text = |name: &str, text: &str| (name.to_owned(), PictureAttribute::Text(text.to_owned()));
    let mut all = vec![
        text("renderer", &format!("OocPT {}", env!("CARGO_PKG_VERSION"))),
        text("device", device),
        text("driver", driver),
        number("seed", f64::from(settings.seed)),
        number("maxBounces", f64::from(settings.max_bounces)),
        text("pixelFilter", settings.pixel_filter.name()),
        number("pixelFilterWidth", f64::from(settings.filter().width)),
        number("samples", f64::from(samples)),
        number("seconds", seconds),
        number("secondsTracing", seconds_tracing),
        number("rays", rays as f64),
        number("bytesPaged", bytes_paged as f64),
        number("loads", stats.streaming.loads as f64),
        number("deviceBytes", stats.gpu_peak_bytes as f64),
    ];
    if let Some(estimate) = estimate {
        all.push(number("errorEstimate", estimate.rel_mse));
        all.push(number("errorLow", estimate.low));
        all.push(number("errorHigh", estimate.high));
    }
    if let Some(denoised) = &stats.denoised {
        all.push(text("denoiser", &denoised.by));
        all.push(text("denoised", if denoised.replaces_color { "color" } else { "layer" }));
        all.push(number("secondsDenoising", denoised.seconds));
        if let Some(truth) = &denoised.truth {
            all.push(number("denoisedRelMse", truth.rel_mse));
            all.push(number("denoisedRmse", truth.rmse));
            all.push(number("denoisedFlip", truth.flip));
        }
    }
    if let Some(truth) = truth {
        all.push(number("errorRelMse", truth.rel_mse));
        all.push(number("errorRmse", truth.rmse));
        all.push(number("errorFlip", truth.flip));
    }
    all
}

/// Writes an image of `size` pixels, four floats each and bottom row first as a render's are, with its attributes.
///
/// # Errors
/// [`PictureError`].
pub fn write(path: &Path, size: [u32; 2], rgba: &[f32], attributes: &PictureAttributes) -> Result<(), PictureError> {
    let [width, height] = size.map(|side| side as usize);
    if rgba.len() != width * height * 4 || rgba.is_empty() {
        return Err(PictureError::Size(rgba.len(), size[0], size[1]));
    }
    let pixel = |at: Vec2<usize>| {
        let start = ((height - 1 - at.y()) * width + at.x()) * 4;
        (rgba[start], rgba[start + 1], rgba[start + 2], rgba[start + 3])
    };
    let layer = layer_attributes(attributes);
    let layer = Layer::new((width, height), layer, Encoding::SMALL_LOSSLESS, SpecificChannels::rgba(pixel));
    let mut done = Ok(());
    let written = oocpt_files::replace_by(path, |file| {
        done = Image::from_layer(layer).write().to_buffered(BufWriter::new(file));
        done.as_ref().map_err(|error| std::io::Error::other(error.to_string())).copied()
    });
    written.map_err(|error| PictureError::File(path.display().to_string(), error.to_string()))
}

/// A text of a file, which is UTF-8 as `OpenEXR` has it. The library's own conversion panics beyond Latin-1.
pub(crate) fn exr_text(text: &str) -> Text {
    Text::from_slice_unchecked(text.as_bytes())
}

/// A layer's attributes in the terms of the EXR library.
pub(crate) fn layer_attributes(attributes: &PictureAttributes) -> LayerAttributes {
    let mut layer = LayerAttributes::default();
    for (name, value) in attributes {
        let value = match value {
            PictureAttribute::Text(text) => AttributeValue::Text(exr_text(text.as_str())),
            PictureAttribute::Number(number) => AttributeValue::F64(*number),
        };
        layer.other.insert(exr_text(format!("{PREFIX}{name}").as_str()), value);
    }
    layer
}

/// Adds attributes to an EXR file that a host has written; all else of it stays as it is.
///
/// # Errors
/// [`PictureError::File`]; the file stays as it is.
pub fn annotate(path: &Path, attributes: &PictureAttributes) -> Result<(), PictureError> {
    exr_header::add(path, attributes).map_err(|error| PictureError::File(path.display().to_string(), error.to_string()))
}

/// Reads the `oocpt:` attributes of an EXR file, sorted by name; a file without any was not made by OocPT.
///
/// # Errors
/// [`PictureError::File`].
pub fn read_attributes(path: &Path) -> Result<PictureAttributes, PictureError> {
    let read_error = |error: exr::error::Error| PictureError::File(path.display().to_string(), error.to_string());
    let file = oocpt_files::open(path).map_err(exr::error::Error::from).map_err(read_error)?;
    let meta = MetaData::read_from_buffered(BufReader::new(file), false).map_err(read_error)?;
    let mut found = PictureAttributes::new();
    for header in &meta.headers {
        for (name, value) in header.own_attributes.other.iter().chain(&header.shared_attributes.other) {
            let Some(name) = name.to_string().strip_prefix(PREFIX).map(printable) else { continue };
            let value = match value {
                AttributeValue::Text(text) => {
                    PictureAttribute::Text(printable(&String::from_utf8_lossy(text.as_slice())))
                }
                AttributeValue::F64(number) => PictureAttribute::Number(*number),
                AttributeValue::F32(number) => PictureAttribute::Number(f64::from(*number)),
                AttributeValue::I32(number) => PictureAttribute::Number(f64::from(*number)),
                _ => continue,
            };
            found.push((name, value));
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    found.dedup_by(|a, b| a.0 == b.0);
    found.truncate(MAX_ATTRIBUTES);
    Ok(found)
}

/// The printable characters of a text from a file.
fn printable(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(MAX_TEXT_CHARS).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_core::convergence::ErrorEstimate;

    fn find<'a>(all: &'a PictureAttributes, name: &str) -> Option<&'a PictureAttribute> {
        all.iter().find(|(have, _)| have == name).map(|(_, value)| value)
    }

    fn of_stats(stats: &RenderStats) -> PictureAttributes {
        let settings = Settings { seed: u32::MAX, ..Settings::default() };
        attributes(stats, "a\u{7}device", "a driver", &settings)
    }

    #[test]
    fn exr_attributes_are_added_without_changing_pixels() {
        let estimate = Some(ErrorEstimate { rel_mse: 1e-3, low: 5e-4, high: 2e-3 });
        let row = ErrorRow {
            samples: 16,
            seconds: 1.5,
            seconds_tracing: 1.25,
            rays: 1 << 40,
            estimate,
            ..ErrorRow::default()
        };
        let stats = RenderStats { error: Some(row), ..RenderStats::default() };
        let path = std::env::temp_dir().join(format!("oocpt-picture-{}.exr", std::process::id()));
        let pixels: Vec<f32> = (0_u8..24).map(|k| f32::from(k) / 7.0).collect();
        write(&path, [2, 3], &pixels, &of_stats(&stats)).expect("a file");
        let read = read_attributes(&path).expect("the file that was written");
        for (name, number) in [("samples", 16.0), ("seconds", 1.5), ("secondsTracing", 1.25), ("errorHigh", 2e-3)] {
            assert_eq!(find(&read, name), Some(&PictureAttribute::Number(number)), "{name}");
        }
        assert_eq!(find(&read, "rays"), Some(&PictureAttribute::Number(1_099_511_627_776.0)), "counts beyond 32 bits");
        assert_eq!(find(&read, "seed"), Some(&PictureAttribute::Number(4_294_967_295.0)), "any seed");
        assert_eq!(find(&read, "device"), Some(&PictureAttribute::Text("adevice".into())), "no control characters");
        assert_eq!(find(&read, "errorFlip"), None, "no reference, no truth");
        let reference = crate::film::reference::ReferencePicture::read(
            &path,
            [2, 3],
            crate::job::window::PixelWindow::whole([2, 3]),
        )
        .expect("three channels of it are a reference");
        drop(reference);
        let image = exr::prelude::read_first_rgba_layer_from_file(
            &path,
            |size, _| vec![[0.0_f32; 4]; size.area()],
            |pixels: &mut Vec<[f32; 4]>, at, (r, g, b, a): (f32, f32, f32, f32)| {
                pixels[at.y() * 2 + at.x()] = [r, g, b, a]
            },
        );
        let rows = image.expect("an EXR file").layer_data.channel_data.pixels;
        let bottom_first: Vec<f32> = rows.chunks(2).rev().flatten().flatten().copied().collect();
        assert_eq!(bottom_first, pixels, "the same bits, the right way up");
        std::fs::remove_file(path).expect("it is there");
    }

    #[test]
    fn invalid_pictures_are_errors() {
        let path = std::env::temp_dir().join(format!("oocpt-no-picture-{}.exr", std::process::id()));
        assert!(write(&path, [2, 2], &[0.0; 15], &PictureAttributes::new()).is_err(), "a float short");
        assert!(write(&path, [0, 0], &[], &PictureAttributes::new()).is_err(), "nothing");
        std::fs::write(&path, "no picture").expect("a temporary file");
        assert!(read_attributes(&path).is_err(), "no EXR file");
        std::fs::remove_file(path).expect("it is there");
    }
}
