// SPDX-License-Identifier: Apache-2.0
//! Pictures as parts of the page.

use crate::report::{draw, summary};
use anyhow::{Context, Result};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::imageops::thumbnail;
use image::{DynamicImage, ImageFormat, ImageReader, Limits, Rgb32FImage, RgbImage};
use oocpt_render::chunk_report::{ChunkReport, ReportCamera};
use std::io::Cursor;
use std::path::Path;

/// Longest side on the page, pixels.
const SIDE: u32 = 1280;
/// Longest side and most bytes of a picture that is read.
const MAX_SIDE: u32 = 1 << 15;
const MAX_BYTES: u64 = 4 << 30;

/// A picture inside of the page.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct EmbeddedPicture {
    /// Size on the page, pixels.
    pub(super) size: [u32; 2],
    /// A PNG file as a `data:` address.
    pub(super) address: String,
}

impl EmbeddedPicture {
    fn new(image: &RgbImage) -> Result<Self> {
        let mut png = Cursor::new(Vec::new());
        image.write_to(&mut png, ImageFormat::Png)?;
        let address = format!("data:image/png;base64,{}", STANDARD.encode(png.into_inner()));
        Ok(Self { size: image.dimensions().into(), address })
    }
}

/// The colour of a PNG or EXR file; EXR is linear and is shown as sRGB.
pub(super) fn of_file(file: &Path) -> Result<EmbeddedPicture> {
    let name = || format!("cannot read {}", file.display());
    let mut reader = ImageReader::open(file).with_context(name)?.with_guessed_format().with_context(name)?;
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let image = reader.decode().with_context(name)?;
    let [width, height] = fitted(image.width(), image.height());
    let shown = match image {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => encoded(&image.into_rgb32f()),
        image => image.into_rgb8(),
    };
    EmbeddedPicture::new(&thumbnail(&shown, width, height))
}

/// The size at which a picture is on the page.
fn fitted(width: u32, height: u32) -> [u32; 2] {
    let longest = u64::from(width.max(height).max(SIDE));
    [width, height].map(|side| u32::try_from(u64::from(side) * u64::from(SIDE) / longest).unwrap_or(SIDE).max(1))
}

/// Linear colour as sRGB (IEC 61966-2-1).
fn encoded(linear: &Rgb32FImage) -> RgbImage {
    RgbImage::from_fn(linear.width(), linear.height(), |x, y| {
        let channel = |c: f32| if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
        crate::report::paint::pixel(linear.get_pixel(x, y).0.map(|c| f64::from(channel(c))))
    })
}

/// The boxes of chunks from the render's camera, by loads and by rays, and what is to be said of them.
pub(super) fn of_chunks(report: &ChunkReport) -> Result<([EmbeddedPicture; 2], String)> {
    let [width, height] = fitted(report.width.max(1), report.height.max(1));
    let ReportCamera { o, o_x, o_y, d, d_x, d_y } = report.camera;
    let by = |change: [f64; 3], side: u32, shown: u32| change.map(|c| c * f64::from(side) / f64::from(shown));
    let camera = ReportCamera {
        o,
        d,
        o_x: by(o_x, report.width, width),
        d_x: by(d_x, report.width, width),
        o_y: by(o_y, report.height, height),
        d_y: by(d_y, report.height, height),
    };
    let shown = ChunkReport { width, height, camera, progress: Vec::new(), ..report.clone() };
    let loads = EmbeddedPicture::new(&draw(&shown, "loads", |chunk| chunk.loads)?)?;
    let rays = EmbeddedPicture::new(&draw(&shown, "rays", |chunk| chunk.rays)?)?;
    Ok(([loads, rays], summary(report)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_pictures_are_fitted_and_small_ones_stay() {
        assert_eq!(fitted(640, 480), [640, 480]);
        assert_eq!(fitted(2560, 100), [1280, 50]);
        assert_eq!(fitted(3, MAX_SIDE), [1, SIDE], "no side is empty");
    }

    #[test]
    fn files_are_shown_in_their_colours() {
        let folder = std::env::temp_dir().join(format!("oocpt-colours-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        let (linear, encoded) = (folder.join("linear.exr"), folder.join("encoded.png"));
        Rgb32FImage::from_pixel(1300, 4, image::Rgb([0.25, f32::NAN, 9e30])).save(&linear).expect("a picture");
        RgbImage::from_pixel(1300, 4, image::Rgb([137, 0, 255])).save(&encoded).expect("a picture");
        for file in [linear, encoded] {
            let EmbeddedPicture { size, address } = of_file(&file).expect("a picture");
            let png = STANDARD.decode(address.split_once(',').expect("an address").1).expect("base64");
            let shown = image::load_from_memory(&png).expect("a PNG").into_rgb8();
            assert_eq!((shown.dimensions().into(), size), (size, [1280, 3]), "{}", file.display());
            assert!(
                shown.pixels().all(|pixel| pixel.0 == [137, 0, 255]),
                "{}: {:?}",
                file.display(),
                shown.get_pixel(7, 1)
            );
        }
        std::fs::remove_dir_all(&folder).expect("it is there");
    }

    #[test]
    fn linear_colour_is_shown_as_srgb() {
        let linear = Rgb32FImage::from_fn(2, 1, |x, _| image::Rgb(if x == 0 { [0.0, 0.25, 1.0] } else { [9.0; 3] }));
        assert_eq!(encoded(&linear).into_raw(), [0, 137, 255, 255, 255, 255]);
    }
}
