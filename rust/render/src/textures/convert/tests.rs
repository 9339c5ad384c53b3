// SPDX-License-Identifier: Apache-2.0
//! Conversion of images that tests make up.

use super::*;
use crate::textures::ImageInfo;
use oocpt_core::texture::TexelFormat;

/// One channel of 8 bits; the rows come in bands of three.
#[derive(Debug)]
struct Rows {
    size: [u32; 2],
    /// Rows that are there.
    rows: u32,
}

fn byte(x: u32, y: u32) -> u8 {
    (x.wrapping_mul(37) ^ y.wrapping_mul(91)).to_le_bytes()[0]
}

/// Level, place, size and texels of a tile.
type Tile = (u32, [u32; 2], [u32; 2], Vec<u8>);

impl SourceImage for Rows {
    fn info(&self) -> ImageInfo {
        let levels = vec![self.size];
        ImageInfo { levels, channels: 1, format: TexelFormat::U8, tile_friendly: false, is_srgb: None, wrap: None }
    }

    fn read(&self, _: u32, _: [u32; 2], _: [u32; 2], _: &mut [u8]) -> Result<(), ImageError> {
        Err(ImageError("is decoded from top to bottom".into()))
    }

    fn decode(&self, _: u32, sink: &mut dyn FnMut(u32, &[u8]) -> bool) -> Result<(), ImageError> {
        for top in (0..self.rows).step_by(3) {
            let band: Vec<u8> = (top..self.rows.min(top + 3))
                .flat_map(|top| (0..self.size[0]).map(move |x| (x, top)))
                .map(|(x, top)| byte(x, self.size[1] - 1 - top))
                .collect();
            if !sink(top, &band) {
                return Ok(());
            }
        }
        Ok(())
    }
}

#[derive(Default)]
struct Kept(Vec<Tile>);

impl TileSink for Kept {
    fn tile(&mut self, level: u32, at: [u32; 2], size: [u32; 2], texels: &[u8]) -> Result<(), ImageError> {
        self.0.push((level, at, size, texels.to_vec()));
        Ok(())
    }
}

fn converted(image: &Rows, first: u32) -> Result<Kept, ImageError> {
    let layout = TileLayout::new(image.size, 1).expect("supported");
    let mut kept = Kept::default();
    let texels = StoredTexels::new(&image.info(), false);
    convert(&ImageDecoding { image, texels: &texels, transform: None, layout: &layout, first }, &mut kept)?;
    Ok(kept)
}

#[test]
fn every_tile_of_every_level_comes_once() {
    for size in [[1, 1], [300, 259], [128, 256], [1, 700], [513, 2]] {
        let kept = converted(&Rows { size, rows: size[1] }, 0).expect("whole");
        let layout = TileLayout::new(size, 1).expect("supported");
        let mut levels: Vec<Vec<Option<u8>>> = (0..layout.levels())
            .map(|level| vec![None; layout.level_size(level).iter().product::<u32>() as usize])
            .collect();
        for (level, at, tile, texels) in &kept.0 {
            let width = layout.level_size(*level)[0];
            for (i, texel) in (0..).zip(texels) {
                let (x, y) = (at[0] + i % tile[0], at[1] + i / tile[0]);
                let old = levels[*level as usize][(y * width + x) as usize].replace(*texel);
                assert_eq!(old, None, "{size:?}: texel {x}, {y} of level {level} comes twice");
            }
        }
        assert!(levels.iter().flatten().all(Option::is_some), "{size:?}: a texel is missing");
        let expected: Vec<_> = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| Some(byte(x, y)))).collect();
        assert!(levels[0] == expected, "{size:?}: level 0");
        let mean = |level: &[Option<u8>]| {
            level.iter().flatten().map(|byte| f64::from(*byte)).sum::<f64>() / level.len() as f64
        };
        for level in &levels {
            assert!((mean(level) - mean(&levels[0])).abs() < 1.5, "{size:?}: the mean is kept");
        }
    }
}

/// Ones, with texels that are none.
#[derive(Debug)]
struct Wild;

impl SourceImage for Wild {
    fn info(&self) -> ImageInfo {
        let levels = vec![[4, 4]];
        ImageInfo { levels, channels: 1, format: TexelFormat::F32, tile_friendly: true, is_srgb: None, wrap: None }
    }

    fn read(&self, _: u32, _: [u32; 2], _: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        let mut texels = [1.0_f32; 16];
        [texels[0], texels[5], texels[15]] = [f32::NAN, f32::NEG_INFINITY, f32::INFINITY];
        out.copy_from_slice(bytemuck::cast_slice(&texels));
        Ok(())
    }
}

/// Bytes by the way of floats, texel by texel.
#[test]
fn downsampled_bytes_match_the_pyramid_bit_for_bit() {
    for (channels, is_srgb) in [(1, false), (1, true), (2, true), (3, true), (4, true), (4, false)] {
        let info = ImageInfo {
            levels: vec![[16, 2]],
            channels,
            format: TexelFormat::U8,
            tile_friendly: false,
            is_srgb: None,
            wrap: None,
        };
        let texels = StoredTexels::new(&info, is_srgb);
        let rows = [0, 1].map(|y| (0..16 * channels).map(|x| byte(x, y)).collect::<Vec<u8>>());
        let mut halved = Vec::new();
        texels.halve(&rows[0], &rows[1], &mut halved);
        let layout = TileLayout::new([16, 2], channels.next_power_of_two()).expect("supported");
        let mut pyramid = TexturePyramid::new(&layout, channels as usize);
        let mut level = Vec::new();
        for row in &rows {
            let mut values = vec![0.0; row.len()];
            texels.decode(row, &mut values);
            pyramid.push(&values, &mut |at, _, row| {
                if at == 1 {
                    level.extend_from_slice(row)
                }
            });
        }
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&halved), bits(&level), "{channels} channels, sRGB {is_srgb}");
    }
}

#[test]
fn nan_texels_do_not_spread_to_coarser_levels() {
    let layout = TileLayout::new([4, 4], 4).expect("supported");
    let texels = StoredTexels::new(&Wild.info(), false);
    let mut kept = Kept::default();
    let decoding = ImageDecoding { image: &Wild, texels: &texels, transform: None, layout: &layout, first: 0 };
    convert(&decoding, &mut kept).expect("it can be read");
    let values = |level: usize| bytemuck::pod_collect_to_vec::<u8, f32>(&kept.0[level].3);
    let (whole, half) = (values(0), values(1));
    assert_eq!([whole[0], whole[1], whole[5], whole[15]], [0.0, 1.0, -65504.0, 65504.0], "where they were");
    assert!(half[1] == 1.0 && half.iter().all(|value| value.is_finite()), "means of what is there: {half:?}");
    assert!((half[0] - (0.0 + 1.0 + 1.0 - 65504.0) / 4.0).abs() < 0.01, "and of what stands for them: {half:?}");
}

#[test]
fn coarser_levels_alone_are_the_same() {
    let image = Rows { size: [300, 259], rows: 259 };
    let all = converted(&image, 0).expect("whole").0;
    let some = converted(&image, 2).expect("whole").0;
    let coarse: Vec<_> = all.into_iter().filter(|(level, ..)| *level >= 2).collect();
    assert!(coarse == some && !some.is_empty(), "levels from 2 on");
}

#[test]
fn images_with_wrong_row_counts_are_errors() {
    for rows in [0, 1, 100, 258, 260, 300] {
        // What the decoder gives is not what it said.
        let image = Rows { size: [300, 259], rows: rows.min(259) };
        let (longer, result) = (Rows { size: [300, rows], rows }, converted(&image, 0));
        assert_eq!(result.is_ok(), rows >= 259, "{rows} rows");
        if rows > 259 {
            let layout = TileLayout::new([300, 259], 1).expect("supported");
            let texels = StoredTexels::new(&longer.info(), false);
            let decoding =
                ImageDecoding { image: &longer, texels: &texels, transform: None, layout: &layout, first: 0 };
            let error = convert(&decoding, &mut Kept::default());
            assert!(error.is_err(), "{rows} rows of 259");
        }
    }
}
