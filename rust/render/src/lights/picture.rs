// SPDX-License-Identifier: Apache-2.0
//! Pictures of domes and rectangles on the device: texels, and for domes an alias table over cells of the picture. Pure.
//!
//! A cell's weight is the integral over it of the luminance times the sine of the polar angle, plus a small share of the mean so
//! that interpolation never leaves a cell that shines without a chance. Alias table: Vose 1991, "A Linear Algorithm for
//! Generating Random Numbers with a Given Distribution".

use super::files::LightPicture;
use super::{luminance, narrow};
use oocpt_shader_abi::{GpuAlias, MAP_FLOAT, MAP_HALF};
use std::f64::consts::PI;

/// Most texels of a picture: 16 K x 8 K.
pub(super) const MAX_TEXELS: u64 = 1 << 27;
/// Most cells along a side of an alias table.
const MAX_CELLS: u32 = 1024;
/// Share of a dome's samples that goes to all cells alike, by solid angle.
const EVEN_SHARE: f64 = 0.01;

/// A picture ready for the device.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EncodedPicture {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// [`MAP_HALF`] or [`MAP_FLOAT`].
    pub(crate) format: u32,
    pub(crate) bytes: Vec<u8>,
    /// Mean luminance over the picture, or over the sphere for a dome.
    pub(crate) mean: f64,
    pub(crate) columns: u32,
    pub(crate) rows: u32,
    /// Empty for rectangles.
    pub(crate) alias: Vec<GpuAlias>,
}

/// Why a picture cannot be used; `None`: it can.
pub(super) fn fault(picture: &LightPicture) -> Option<String> {
    let count = u64::from(picture.width) * u64::from(picture.height);
    if count == 0 || picture.texels.len() as u64 != count {
        return Some("the picture has no texels".into());
    }
    (count > MAX_TEXELS).then(|| format!("the picture has more than {MAX_TEXELS} texels"))
}

impl EncodedPicture {
    /// For a rectangle. Call [`fault`] before.
    pub(super) fn flat(picture: LightPicture) -> Self {
        Self::new(picture, false)
    }

    /// For a dome. Call [`fault`] before.
    pub(super) fn dome(picture: LightPicture) -> Self {
        Self::new(picture, true)
    }

    fn new(mut picture: LightPicture, is_dome: bool) -> Self {
        for texel in &mut picture.texels {
            // Not a number and negative light are none; infinite light is much.
            *texel = texel.map(|c| if c > 0.0 { c.min(1e30) } else { 0.0 });
        }
        let (width, height) = (picture.width, picture.height);
        let most = picture.texels.iter().flatten().copied().fold(0.0, f32::max);
        let format = if most <= 65504.0 { MAP_HALF } else { MAP_FLOAT };
        let mut encoded = Self {
            width,
            height,
            format,
            bytes: encode(&picture, format),
            mean: 0.0,
            columns: 0,
            rows: 0,
            alias: Vec::new(),
        };
        if is_dome {
            encoded.columns = width.min(MAX_CELLS);
            encoded.rows = height.min(MAX_CELLS);
            let weights = cells(&picture, encoded.columns, encoded.rows);
            encoded.mean = weights.iter().sum::<f64>() / (4.0 * PI);
            encoded.alias = alias(&weights, encoded.columns, encoded.rows);
        } else {
            let sum: f64 = picture.texels.iter().map(|&texel| luminance(texel)).sum();
            #[expect(clippy::cast_precision_loss, reason = "texels fit f64")]
            let mean = sum / picture.texels.len() as f64;
            encoded.mean = mean;
        }
        encoded
    }
}

fn encode(picture: &LightPicture, format: u32) -> Vec<u8> {
    let halves = |texel: &[f32; 3]| {
        let [r, g, b] = texel.map(|c| half::f16::from_f32(c).to_bits());
        [r, g, b, 0].map(u16::to_le_bytes)
    };
    if format == MAP_HALF {
        picture.texels.iter().flat_map(halves).flatten().collect()
    } else {
        picture.texels.iter().flat_map(|&[r, g, b]| [r, g, b, 0.0].map(f32::to_le_bytes)).flatten().collect()
    }
}

/// Integral of the luminance over each cell, in solid angle, the top row first. A cell also sees the texels next to it, which
/// interpolation brings into it.
fn cells(picture: &LightPicture, columns: u32, rows: u32) -> Vec<f64> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let (columns, rows) = (columns as usize, rows as usize);
    let mut weights = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        let band = |r: usize| PI * to_f64(r) / to_f64(rows);
        let solid = (band(row).cos() - band(row + 1).cos()) * 2.0 * PI / to_f64(columns);
        let (top, bottom) =
            ((row * height / rows).saturating_sub(1), ((row + 1) * height).div_ceil(rows).min(height - 1));
        for column in 0..columns {
            let (left, right) = (column * width / columns, ((column + 1) * width).div_ceil(columns));
            let mut sum = 0.0;
            for y in top..=bottom {
                for x in left..=right + 1 {
                    // One to the left and one to the right, around the edge.
                    let texel = picture.texels.get(y * width + (x + width - 1) % width);
                    sum += texel.map_or(0.0, |&texel| {
                        luminance(texel).max(f64::from(texel.iter().copied().fold(0.0, f32::max)) * 0.01)
                    });
                }
            }
            weights.push(sum / to_f64((bottom - top + 1) * (right + 2 - left)) * solid);
        }
    }
    weights
}

#[expect(clippy::cast_precision_loss, reason = "numbers of texels fit f64")]
fn to_f64(value: usize) -> f64 {
    value as f64
}

/// The table for these weights, mixed with an even share.
fn alias(weights: &[f64], columns: u32, rows: u32) -> Vec<GpuAlias> {
    let total: f64 = weights.iter().sum();
    let rows_f = f64::from(rows);
    let even = |cell: usize| {
        let row = to_f64(cell / columns as usize);
        0.5 * ((PI * row / rows_f).cos() - (PI * (row + 1.0) / rows_f).cos()) / f64::from(columns)
    };
    let share = if total > 0.0 && total.is_finite() { EVEN_SHARE } else { 1.0 };
    let mixed = |(cell, &weight): (usize, &f64)| {
        let own = if share < 1.0 { (1.0 - share) * weight / total } else { 0.0 };
        own + share * even(cell)
    };
    let probabilities: Vec<f64> = weights.iter().enumerate().map(mixed).collect();
    vose(&probabilities)
}

/// An alias table for probabilities that add up to 1.
pub(super) fn vose(probabilities: &[f64]) -> Vec<GpuAlias> {
    let n = to_f64(probabilities.len());
    let mut scaled: Vec<f64> = probabilities.iter().map(|p| p * n).collect();
    let mut table: Vec<GpuAlias> =
        (0..).zip(&scaled).map(|(i, &p)| GpuAlias { other: i, threshold: 1.0, density: narrow(p) }).collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..scaled.len()).partition(|&i| scaled[i] < 1.0);
    while let (Some(&less), Some(&more)) = (small.last(), large.last()) {
        small.pop();
        table[less].threshold = narrow(scaled[less]);
        table[less].other = u32::try_from(more).unwrap_or_default();
        scaled[more] -= 1.0 - scaled[less];
        if scaled[more] < 1.0 {
            large.pop();
            small.push(more);
        }
    }
    table
}
