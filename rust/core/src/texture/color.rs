// SPDX-License-Identifier: Apache-2.0
//! Decides which images are sRGB, converts with the sRGB curve, and expands images of one and two channels.

use super::{ColorSpace, TexelFormat};

/// Returns true if red, green and blue go through the sRGB curve. `Auto` asks the file's own word (`metadata`) first;
/// without one, an image of 8 bits with three or four channels is sRGB and every other is not. Texels of a named space
/// go through a conversion instead.
pub fn is_srgb(space: &ColorSpace, metadata: Option<bool>, format: TexelFormat, channels: u32) -> bool {
    match space {
        ColorSpace::Raw | ColorSpace::Named(_) => false,
        ColorSpace::Srgb => true,
        ColorSpace::Auto => metadata.unwrap_or(format == TexelFormat::U8 && channels >= 3),
    }
}

/// Encodes a value with the sRGB curve.
pub fn srgb_from_linear(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Expands an image with fewer channels to four: (r, r, r, 1), (r, r, r, g), (r, g, b, 1).
pub fn expand(channels: &[f64]) -> [f64; 4] {
    match *channels {
        [r] => [r, r, r, 1.0],
        [r, a] => [r, r, r, a],
        [r, g, b] => [r, g, b, 1.0],
        [r, g, b, a, ..] => [r, g, b, a],
        [] => [0.0, 0.0, 0.0, 1.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::linear_from_srgb;

    #[test]
    fn automatic_color_spaces_follow_the_specification() {
        use TexelFormat::{F16, F32, U8};
        let auto = |metadata, format, channels| is_srgb(&ColorSpace::Auto, metadata, format, channels);
        assert!(auto(None, U8, 3) && auto(None, U8, 4), "8 bits, three or four channels");
        assert!(!auto(None, U8, 1) && !auto(None, U8, 2), "8 bits, one or two");
        assert!(!auto(None, F16, 4) && !auto(None, F32, 3), "floats");
        assert!(auto(Some(true), F32, 1) && !auto(Some(false), U8, 3), "the file's own word wins");
        assert!(!is_srgb(&ColorSpace::Raw, Some(true), U8, 3), "raw is raw");
        assert!(is_srgb(&ColorSpace::Srgb, Some(false), F32, 1), "sRGB is sRGB");
    }

    #[test]
    fn the_srgb_curve_and_its_inverse_round_trip() {
        for byte in 0..=255_u32 {
            let encoded = f64::from(byte) / 255.0;
            let back = srgb_from_linear(linear_from_srgb(encoded));
            assert!((back - encoded).abs() < 1e-6, "{byte}: {back} for {encoded}");
        }
        assert!((linear_from_srgb(0.5) - 0.214_041_140_482).abs() < 1e-9, "a known value");
    }
}
