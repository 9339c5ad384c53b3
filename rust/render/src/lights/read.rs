// SPDX-License-Identifier: Apache-2.0
//! Pictures of lights read from images: the finest level, linear, the top row first.

use super::picture::MAX_TEXELS;
use crate::job::light_files::LightPicture;
use crate::textures::{ImageError, SourceImage};
use half::f16;

use oocpt_core::texture::{ColorSpace, TexelFormat, expand, is_srgb, linear_from_srgb};

/// Rows that are read at a time.
const BAND: u32 = 64;

impl LightPicture {
    /// Reads an image as lights use it: colours only, sRGB decoded if the rule for `auto` says so (`UsdUVTexture`).
    ///
    /// # Errors
    /// The image has more texels than a light's picture may have, or cannot be read.
    pub fn of_image(image: &dyn SourceImage) -> Result<Self, ImageError> {
        let info = image.info();
        let [width, height] = info.levels.first().copied().unwrap_or_default();
        let count = u64::from(width) * u64::from(height);
        if count == 0 || count > MAX_TEXELS {
            return Err(ImageError(format!("it has {width} x {height} texels, and lights take 1 to {MAX_TEXELS}")));
        }
        let encoded = is_srgb(&ColorSpace::Auto, info.is_srgb, info.format, info.channels);
        let channels = info.channels as usize;
        let row_bytes = width as usize * channels * info.format.bytes() as usize;
        let mut texels = vec![[0.0_f32; 3]; width as usize * height as usize];
        let mut band = vec![0; row_bytes * BAND.min(height) as usize];
        // Files are decoded from their top; rows of images count from the bottom.
        for top in (0..height).step_by(BAND as usize) {
            let rows = BAND.min(height - top);
            let first = height - top - rows;
            let bytes = &mut band[..row_bytes * rows as usize];
            image.read(0, [0, first], [width, rows], bytes)?;
            for (row, bytes) in (0..).zip(bytes.chunks_exact(row_bytes)) {
                let from_top = (height - 1 - first - row) as usize;
                let line = texels.iter_mut().skip(from_top * width as usize);
                for (texel, bytes) in line.zip(bytes.chunks_exact(channels * info.format.bytes() as usize)) {
                    *texel = color(bytes, info.format, encoded);
                }
            }
        }
        Ok(Self { width, height, texels })
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn color(bytes: &[u8], format: TexelFormat, encoded: bool) -> [f32; 3] {
    let mut values = [0.0_f64; 4];
    let stride = format.bytes() as usize;
    let count = (bytes.len() / stride).min(4);
    for (value, bytes) in values.iter_mut().zip(bytes.chunks_exact(stride)) {
        *value = match format {
            TexelFormat::U8 => f64::from(bytes[0]) / 255.0,
            TexelFormat::F16 => bytemuck::pod_read_unaligned::<f16>(bytes).to_f64(),
            TexelFormat::F32 => f64::from(bytemuck::pod_read_unaligned::<f32>(bytes)),
        };
    }
    let [r, g, b, _] = expand(&values[..count]);
    [r, g, b].map(|value| if encoded { linear_from_srgb(value) } else { value } as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::textures::ImageInfo;

    #[derive(Debug)]
    struct Ramp(ImageInfo);

    impl SourceImage for Ramp {
        fn info(&self) -> ImageInfo {
            self.0.clone()
        }

        /// Texel (x, y), y from the bottom, is (x, y, 7) / 255.
        fn read(&self, _: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
            let places = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [at[0] + x, at[1] + y]));
            for ([x, y], out) in places.zip(out.chunks_exact_mut(3)) {
                let byte = |value: u32| u8::try_from(value).expect("small");
                out.copy_from_slice(&[byte(x), byte(y), 7]);
            }
            Ok(())
        }
    }

    fn ramp(size: [u32; 2], is_srgb: Option<bool>) -> Ramp {
        let (format, wrap) = (TexelFormat::U8, None);
        Ramp(ImageInfo { levels: vec![size], channels: 3, format, tile_friendly: false, is_srgb, wrap })
    }

    #[expect(clippy::cast_possible_truncation, reason = "rounded as the code does")]
    fn narrow(value: f64) -> f32 {
        value as f32
    }

    #[test]
    fn the_top_row_comes_first_and_bands_do_not_show() {
        let picture = LightPicture::of_image(&ramp([5, 150], Some(false))).expect("read");
        assert_eq!((picture.width, picture.height, picture.texels.len()), (5, 150, 750), "size");
        for (at, texel) in picture.texels.iter().enumerate() {
            let at = u8::try_from(at % 5).ok().zip(u8::try_from(149 - at / 5).ok()).expect("small");
            let (x, y) = at;
            let wanted = [x, y, 7].map(|value| narrow(f64::from(value) / 255.0));
            assert_eq!(*texel, wanted, "texel {x}, {y} from the bottom");
        }
    }

    #[test]
    fn light_pictures_of_bytes_are_srgb_decoded_by_default() {
        let picture = LightPicture::of_image(&ramp([2, 1], None)).expect("read");
        let wanted = narrow(linear_from_srgb(7.0 / 255.0));
        assert_eq!(picture.texels[0][2].to_bits(), wanted.to_bits(), "sRGB by the rule for 8 bits and 3 channels");
    }

    #[test]
    fn too_many_texels_are_refused_before_memory_is_taken() {
        assert!(LightPicture::of_image(&ramp([1 << 20, 1 << 20], None)).is_err(), "2^40 texels");
        assert!(LightPicture::of_image(&ramp([0, 5], None)).is_err(), "none");
    }
}
