// SPDX-License-Identifier: Apache-2.0
//! Colours, the legend and its letters.

use image::{Rgb, RgbImage};

/// Behind everything.
pub(crate) const BACKGROUND: [f64; 3] = [0.06, 0.06, 0.08];
/// A chunk whose number is zero.
pub(crate) const NEVER: [f64; 3] = [0.28, 0.28, 0.31];
/// Height of the legend below the picture, pixels.
pub(crate) const LEGEND: u32 = 34;

/// Dark blue over green to yellow, like matplotlib's viridis; sRGB at equal steps.
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

/// `a` to `b` by `t`.
pub(crate) fn mix(a: [f64; 3], b: [f64; 3], t: f64) -> [f64; 3] {
    [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * t)
}

/// As a pixel.
pub(crate) fn pixel(color: [f64; 3]) -> Rgb<u8> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..=255 by the clamp")]
    Rgb(color.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8))
}

/// Draws the legend of `title` into the last [`LEGEND`] rows: never, 1, powers of ten, the largest.
pub(crate) fn legend(image: &mut RgbImage, title: &str, max: u64) {
    let (width, top) = (image.width(), image.height().saturating_sub(LEGEND));
    for y in top..image.height() {
        for x in 0..width {
            image.put_pixel(x, y, pixel(BACKGROUND));
        }
    }
    write(image, 8, top + 6, title);
    let (left, right) = (8 + 12 * u32::try_from(title.len()).unwrap_or(0) + 90, width.saturating_sub(60));
    let row = top + 4;
    bar(image, left - 80, row, 20, |_| NEVER);
    write(image, left - 74, row + 15, "0");
    if right <= left + 20 {
        return;
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
            write(image, left + x, row + 15, &short(value));
        }
        value = value.saturating_mul(10);
    }
    let text = short(max);
    write(image, right.saturating_sub(8 * u32::try_from(text.len()).unwrap_or(0)), row + 15, &text);
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

/// Three columns, five rows, the top row in the highest three bits.
fn glyph(letter: char) -> u16 {
    match letter {
        '0' => 0b111_101_101_101_111,
        '1' => 0b010_110_010_010_111,
        '2' => 0b111_001_111_100_111,
        '3' => 0b111_001_111_001_111,
        '4' => 0b101_101_111_001_001,
        '5' => 0b111_100_111_001_111,
        '6' => 0b111_100_111_101_111,
        '7' => 0b111_001_010_010_010,
        '8' => 0b111_101_111_101_111,
        '9' => 0b111_101_111_001_111,
        '.' => 0b000_000_000_000_010,
        '-' => 0b000_000_111_000_000,
        '_' => 0b000_000_000_000_111,
        ':' => 0b000_010_000_010_000,
        '/' => 0b001_001_010_100_100,
        '(' => 0b001_010_010_010_001,
        ')' => 0b100_010_010_010_100,
        'A' => 0b010_101_111_101_101,
        'B' => 0b110_101_110_101_110,
        'C' => 0b011_100_100_100_011,
        'E' => 0b111_100_110_100_111,
        'F' => 0b111_100_110_100_100,
        'H' => 0b101_101_111_101_101,
        'I' => 0b111_010_010_010_111,
        'J' => 0b001_001_001_101_010,
        'N' => 0b110_101_101_101_101,
        'P' => 0b110_101_110_100_100,
        'Q' => 0b010_101_101_110_011,
        'T' => 0b111_010_010_010_010,
        'U' => 0b101_101_101_101_111,
        'V' => 0b101_101_101_101_010,
        'W' => 0b101_101_111_111_101,
        'X' => 0b101_101_010_101_101,
        'Z' => 0b111_001_010_100_111,
        'D' => 0b110_101_101_101_110,
        'G' => 0b111_100_101_101_111,
        'K' => 0b101_110_100_110_101,
        'L' => 0b100_100_100_100_111,
        'M' => 0b101_111_111_101_101,
        'O' => 0b010_101_101_101_010,
        'R' => 0b110_101_110_101_101,
        'S' => 0b011_100_010_001_110,
        'Y' => 0b101_101_010_010_010,
        _ => 0,
    }
}

/// Writes text, two pixels to a dot.
fn write(image: &mut RgbImage, left: u32, top: u32, text: &str) {
    write_in(image, left, top, text, [0.9; 3]);
}

/// Writes capitals in a colour.
pub(crate) fn write_in(image: &mut RgbImage, left: u32, top: u32, text: &str, color: [f64; 3]) {
    for (k, letter) in (0_u32..).zip(text.chars()) {
        let bits = glyph(letter);
        for dot in 0..15_u32 {
            if bits >> (14 - dot) & 1 == 1 {
                let (x, y) = (left + 8 * k + 2 * (dot % 3), top + 2 * (dot / 3));
                for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    put(image, x + dx, y + dy, color);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_is_another_colour_and_nothing_is_grey() {
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
