// SPDX-License-Identifier: Apache-2.0
//! Pictures of domes and rectangles on the device: texels, and for domes a distribution over cells of the picture.
//! Pure.
//!
//! A cell's weight is the integral over it of the interpolated luminance times the sine of the polar angle, plus a
//! small share of the mean. Guide: Chen and Asau 1974, "On Generating Random Variates from an Empirical Distribution".

use super::{luminance, narrow};
use crate::job::light_files::LightPicture;
use oocpt_abi::{GpuCdf, MAP_FLOAT, MAP_HALF};
use std::f64::consts::PI;

/// Most texels of a picture: 16 K x 8 K.
pub(super) const MAX_TEXELS: u64 = 1 << 27;
/// Most cells along a side of a distribution.
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
    /// The cells of a dome; empty for rectangles.
    pub(crate) cells: Vec<GpuCdf>,
}

/// The reason why a picture cannot be used; `None` if it can.
pub(super) fn fault(picture: &LightPicture) -> Option<String> {
    let count = u64::from(picture.width) * u64::from(picture.height);
    if count == 0 || picture.texels.len() as u64 != count {
        return Some("the picture has no texels".into());
    }
    (count > MAX_TEXELS).then(|| format!("the picture has more than {MAX_TEXELS} texels"))
}

impl EncodedPicture {
    /// Encodes the picture of a rectangle. Call [`fault`] before.
    pub(super) fn flat(picture: LightPicture) -> Self {
        Self::new(picture, false)
    }

    /// Encodes the picture of a dome. Call [`fault`] before.
    pub(super) fn dome(picture: LightPicture) -> Self {
        Self::new(picture, true)
    }

    fn new(mut picture: LightPicture, is_dome: bool) -> Self {
        for texel in &mut picture.texels {
            // NaN and negative light become 0; infinite light is bounded.
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
            cells: Vec::new(),
        };
        if is_dome {
            // Between two texels' middles the picture is linear: cells of half a texel follow it best.
            encoded.columns = width.saturating_mul(2).min(MAX_CELLS);
            encoded.rows = height.saturating_mul(2).min(MAX_CELLS);
            let weights = cells(&picture, encoded.columns, encoded.rows);
            encoded.mean = weights.iter().sum::<f64>() / (4.0 * PI);
            encoded.cells = distribution(&weights, encoded.columns, encoded.rows);
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

/// Integral of the luminance over each cell, in solid angle, the top row first: exactly that of the interpolated
/// picture, except that the solid angle is taken as uniform within a cell. So the contribution of a sample is nearly
/// the same wherever it falls, at the rim of a sun too.
fn cells(picture: &LightPicture, columns: u32, rows: u32) -> Vec<f64> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let (columns, rows) = (columns as usize, rows as usize);
    let brightness =
        |texel: [f32; 3]| luminance(texel).max(f64::from(texel.iter().copied().fold(0.0, f32::max)) * 0.01);
    let across: Vec<Vec<(usize, f64)>> =
        (0..columns).map(|column| shares(column, columns, width, |x| x.rem_euclid(to_i64(width)))).collect();
    let mut weights = Vec::with_capacity(columns * rows);
    let mut band = vec![0.0; width];
    for row in 0..rows {
        let edge = |r: usize| PI * to_f64(r) / to_f64(rows);
        let solid = (edge(row).cos() - edge(row + 1).cos()) * 2.0 * PI / to_f64(columns);
        band.fill(0.0);
        for (y, share) in shares(row, rows, height, |y| y.clamp(0, to_i64(height) - 1)) {
            let texels = picture.texels.get(y * width..(y + 1) * width).unwrap_or_default();
            for (sum, &texel) in band.iter_mut().zip(texels) {
                *sum += share * brightness(texel);
            }
        }
        let mean = |shares: &Vec<(usize, f64)>| -> f64 {
            shares.iter().map(|&(x, share)| share * band.get(x).copied().unwrap_or_default()).sum()
        };
        weights.extend(across.iter().map(|shares| solid * mean(shares)));
    }
    weights
}

/// The texels that cell `cell` of `cells` along a side shows by linear interpolation, each with its share of the cell's
/// mean; `place` wraps numbers outside of `0..texels`.
fn shares(cell: usize, cells: usize, texels: usize, place: impl Fn(i64) -> i64) -> Vec<(usize, f64)> {
    let size = to_f64(texels) / to_f64(cells);
    let (from, to) = (to_f64(cell) * size, to_f64(cell + 1) * size);
    #[expect(clippy::cast_possible_truncation, reason = "numbers of texels fit i64")]
    let range = ((from - 0.5).floor() as i64)..=((to + 0.5).floor() as i64);
    let share = |texel: i64| {
        #[expect(clippy::cast_precision_loss, reason = "numbers of texels fit f64")]
        let center = texel as f64 + 0.5;
        (hat_below(to - center) - hat_below(from - center)) / size
    };
    range
        .filter(|&texel| share(texel) > 0.0)
        .map(|texel| (usize::try_from(place(texel)).unwrap_or_default(), share(texel)))
        .collect()
}

/// Integral up to `x` of the tent of width 2 and height 1 about 0.
fn hat_below(x: f64) -> f64 {
    let x = x.clamp(-1.0, 1.0);
    if x < 0.0 { 0.5 * (1.0 + x) * (1.0 + x) } else { 1.0 - 0.5 * (1.0 - x) * (1.0 - x) }
}

fn to_i64(value: usize) -> i64 {
    i64::try_from(value).unwrap_or(i64::MAX)
}

#[expect(clippy::cast_precision_loss, reason = "numbers of texels fit f64")]
fn to_f64(value: usize) -> f64 {
    value as f64
}

/// Entries for these weights, mixed with an even share: the cells of each row, then the rows.
fn distribution(weights: &[f64], columns: u32, rows: u32) -> Vec<GpuCdf> {
    let total: f64 = weights.iter().sum();
    let (width, rows_f) = (columns as usize, f64::from(rows));
    let even = |row: usize| {
        let edge = |row: usize| (PI * to_f64(row) / rows_f).cos();
        0.5 * (edge(row) - edge(row + 1)) / f64::from(columns)
    };
    let share = if total > 0.0 && total.is_finite() { EVEN_SHARE } else { 1.0 };
    let mixed = |(cell, &weight): (usize, &f64)| {
        let own = if share < 1.0 { (1.0 - share) * weight / total } else { 0.0 };
        own + share * even(cell / width)
    };
    let probabilities: Vec<f64> = weights.iter().enumerate().map(mixed).collect();
    let of_rows: Vec<f64> = probabilities.chunks(width).map(|row| row.iter().sum()).collect();
    let of_rows = piecewise(&of_rows);
    let mut entries: Vec<GpuCdf> = Vec::with_capacity(probabilities.len() + of_rows.len());
    for (cells, row) in probabilities.chunks(width).zip(&of_rows) {
        let cells = piecewise(cells);
        entries.extend(
            cells
                .iter()
                .map(|cell| GpuCdf { density: narrow(f64::from(cell.density) * f64::from(row.density)), ..*cell }),
        );
    }
    entries.extend(of_rows);
    entries
}

/// The distribution of these weights, not all 0. Densities are those of the rounded starts, as the device draws.
pub(super) fn piecewise(weights: &[f64]) -> Vec<GpuCdf> {
    let total: f64 = weights.iter().sum();
    let count = to_f64(weights.len());
    let mut sum = 0.0;
    let mut starts: Vec<f32> = Vec::with_capacity(weights.len() + 1);
    for weight in weights {
        starts.push(narrow(f64::min(sum / total, 1.0)));
        sum += weight;
    }
    starts.push(1.0);
    let mut last = 0_usize;
    (0..weights.len())
        .map(|i| {
            let at = to_f64(i) / count;
            while last + 1 < weights.len() && starts.get(last + 1).is_some_and(|&start| f64::from(start) <= at) {
                last += 1;
            }
            let [start, end] = [i, i + 1].map(|i| starts.get(i).copied().unwrap_or(1.0));
            let density = narrow((f64::from(end) - f64::from(start)) * count);
            GpuCdf { start, guide: u32::try_from(last).unwrap_or_default(), density }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The picture's luminance, interpolated, at a point in texels from the upper left; around the sides, repeated
    /// above and below.
    fn interpolated(picture: &LightPicture, x: f64, y: f64) -> f64 {
        let (width, height) = (i64::from(picture.width), i64::from(picture.height));
        let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
        let (fx, fy) = (x - 0.5 - left, y - 0.5 - top);
        #[expect(clippy::cast_possible_truncation, reason = "a few texels")]
        let (left, top) = (left as i64, top as i64);
        let at = |dx: i64, dy: i64| {
            let index = (top + dy).clamp(0, height - 1) * width + (left + dx).rem_euclid(width);
            luminance(picture.texels[usize::try_from(index).expect("inside")])
        };
        (at(0, 0) * (1.0 - fx) + at(1, 0) * fx) * (1.0 - fy) + (at(0, 1) * (1.0 - fx) + at(1, 1) * fx) * fy
    }

    #[test]
    fn cell_weights_integrate_the_interpolated_picture() {
        const STEPS: u32 = 48;
        let picture = LightPicture {
            width: 5,
            height: 4,
            texels: (0..20_u16)
                .map(|i| [f32::from(i * 7 % 11), f32::from(i * 5 % 13), if i == 9 { 900.0 } else { 1.0 }])
                .collect(),
        };
        // The rows have half a texel a cell, an uneven number, and several texels a cell.
        for (columns, rows) in [(10, 8), (7, 3), (2, 2)] {
            let weights = cells(&picture, columns, rows);
            for (cell, &weight) in (0_u32..).zip(&weights) {
                let (column, row) = (cell % columns, cell / columns);
                let at = |cell: u32, step: u32, cells: u32, texels: u32| {
                    (f64::from(cell) + (f64::from(step) + 0.5) / f64::from(STEPS)) / f64::from(cells)
                        * f64::from(texels)
                };
                let mut sum = 0.0;
                for (y, x) in (0..STEPS).flat_map(|y| (0..STEPS).map(move |x| (y, x))) {
                    sum +=
                        interpolated(&picture, at(column, x, columns, picture.width), at(row, y, rows, picture.height));
                }
                let band = |r: u32| (PI * f64::from(r) / f64::from(rows)).cos();
                let solid = (band(row) - band(row + 1)) * 2.0 * PI / f64::from(columns);
                let expected = solid * sum / f64::from(STEPS * STEPS);
                assert!(
                    (weight - expected).abs() <= 1e-3 * expected,
                    "{columns} x {rows}, cell {cell}: {weight}, not {expected}"
                );
            }
        }
    }
}
