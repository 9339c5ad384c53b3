// SPDX-License-Identifier: Apache-2.0
//! Colours and the legend.

use super::letters::{ADVANCE, write};
use anyhow::Result;
use image::{Rgb, RgbImage};

/// The background colour.
pub(crate) const BACKGROUND: [f64; 3] = [0.06, 0.06, 0.08];
/// The colour of a chunk whose number is zero.
pub(crate) const NEVER: [f64; 3] = [0.28, 0.28, 0.31];
/// Height of the legend below the picture, pixels.
pub(crate) const LEGEND: u32 = 34;

/// Colours from dark blue over green to yellow, like matplotlib's viridis; sRGB at equal steps.
const RAMP: [[f64; 3]; 9] = [
    [0.267, 0.005, 0.329],
    [0.278, 0.176, 0.483],
    [0.230, 0.322, 0.546],
    [0.173, 0.449, 0.558],
    [0.128, 0.567, 0.551],
    [0.158, 0.684, 0.502],
    [0.369, 0.789, 0.383],
    [0.678, 0.864, 0.190],
    [0.993, 0.906, 0.144],
];

/// The ramp's colour at `t` in 0..1.
pub(crate) fn ramp(t: f64) -> [f64; 3] {
    let at = t.clamp(0.0, 1.0) * 8.0;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 7")]
    let low = (at.floor() as usize).min(7);
    mix(RAMP[low], RAMP[low + 1], at - at.floor().min(7.0))
}

/// The colour of a number where `max` is the largest one, on a logarithmic scale.
#[expect(clippy::cast_precision_loss, reason = "a colour")]
pub(crate) fn color(value: u64, max: u64) -> [f64; 3] {
    match value {
        0 => NEVER,
        _ => ramp((value as f64).ln() / (max.max(2) as f64).ln()),
    }
}

/// Interpolates from `a` to `b` by `t`.
pub(crate) fn mix(a: [f64; 3], b: [f64; 3], t: f64) -> [f64; 3] {
    [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * t)
}

/// Converts a colour to a pixel.
pub(crate) fn pixel(color: [f64; 3]) -> Rgb<u8> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..=255 by the clamp")]
    Rgb(color.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8))
}

/// Draws the legend of `title` into the last [`LEGEND`] rows: never, 1, powers of ten, the largest.
pub(crate) fn legend(image: &mut RgbImage, title: &str, max: u64) -> Result<()> {
    let (width, top) = (image.width(), image.height().saturating_sub(LEGEND));
    for y in top..image.height() {
        for x in 0..width {
            image.put_pixel(x, y, pixel(BACKGROUND));
        }
    }
    write(image, 8, top + 6, title)?;
    let (left, right) = (8 + ADVANCE * u32::try_from(title.len()).unwrap_or(0) + 90, width.saturating_sub(60));
    let row = top + 4;
    bar(image, left - 80, row, 20, |_| NEVER);
    write(image, left - 74, row + 14, "0")?;
    if right <= left + 20 {
        return Ok(());
    }
    let length = right - left;
    bar(image, left, row, length, ramp);
    let mut value = 1_u64;
    while value < max {
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a position in the picture"
        )]
        let x = (f64::from(length) * (value as f64).ln() / (max.max(2) as f64).ln()) as u32;
        if x + 40 < length {
            write(image, left + x, row + 14, &short(value))?;
        }
        value = value.saturating_mul(10);
    }
    let text = short(max);
    write(image, right.saturating_sub(ADVANCE * u32::try_from(text.len()).unwrap_or(0)), row + 14, &text)
}

/// A bar of ten rows.
fn bar(image: &mut RgbImage, left: u32, top: u32, length: u32, color: impl Fn(f64) -> [f64; 3]) {
    for x in 0..length {
        let t = f64::from(x) / f64::from(length);
        for y in 0..10 {
            put(image, left + x, top + y, color(t));
        }
    }
}

fn put(image: &mut RgbImage, x: u32, y: u32, color: [f64; 3]) {
    if x < image.width() && y < image.height() {
        image.put_pixel(x, y, pixel(color));
    }
}

/// A number in few letters: 950, 12K, 3.4M.
pub(crate) fn short(value: u64) -> String {
    let (scale, unit) = match value {
        0..1000 => return value.to_string(),
        1000..1_000_000 => (1000, "K"),
        1_000_000..1_000_000_000 => (1_000_000, "M"),
        _ => (1_000_000_000, "G"),
    };
    let (whole, tenth) = (value / scale, value % scale * 10 / scale);
    if whole < 10 && tenth > 0 { format!("{whole}.{tenth}{unit}") } else { format!("{whole}{unit}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn different_counts_have_different_colours_and_zero_is_grey() {
        assert_eq!(color(0, 1000), NEVER, "never");
        assert_eq!(color(1, 1000), RAMP[0], "least");
        assert_eq!(color(1000, 1000), RAMP[8], "most");
        assert_ne!(color(10, 1000), color(11, 1000), "different numbers, different colours");
        assert_eq!(color(1, 1), RAMP[0], "a largest number of 1 divides by nothing");
    }

    #[test]
    fn short_numbers() {
        let texts = [0, 999, 1000, 1500, 12_345, 3_400_000, 5_000_000_000].map(short);
        assert_eq!(texts, ["0", "999", "1K", "1.5K", "12K", "3.4M", "5G"], "as in the legend");
    }
}
