// SPDX-License-Identifier: Apache-2.0
//! How the texels of an image are stored, and what they mean: from bytes of a file to linear values and back.
//!
//! Mip levels are means of linear values, stored as the file's texels are. The device takes 1, 2 or 4 channels: three
//! become four.

use super::image::ImageInfo;
use half::f16;
use half::slice::HalfFloatSliceExt;
use oocpt_core::texture::{TexelFormat, linear_from_srgb, srgb_from_linear};

/// Steps of the table that finds the byte of a linear value.
const STEPS: usize = 4096;

/// See the module.
#[derive(Debug)]
pub(super) struct StoredTexels {
    /// 1 to 4.
    channels: usize,
    format: TexelFormat,
    is_srgb: bool,
    /// What a byte of a colour channel stands for.
    decoded: [f32; 256],
    /// Where one byte ends and the next begins.
    between: [f32; 255],
    /// The byte of the value `i / STEPS`.
    coarse: Box<[u8]>,
}

#[expect(clippy::cast_possible_truncation, reason = "tables of values between 0 and 1")]
impl StoredTexels {
    pub(super) fn new(info: &ImageInfo, is_srgb: bool) -> Self {
        let value = |byte: f64| if is_srgb { linear_from_srgb(byte / 255.0) } else { byte / 255.0 };
        let mut decoded = [0.0; 256];
        let mut between = [0.0; 255];
        for (byte, out) in (0_u8..=255).zip(&mut decoded) {
            *out = value(f64::from(byte)) as f32;
        }
        for (byte, out) in (0_u8..=254).zip(&mut between) {
            *out = value(f64::from(byte) + 0.5) as f32;
        }
        let byte_of = |value: f32| between.partition_point(|edge| *edge <= value) as u8;
        let coarse = (0..=STEPS).map(|step| byte_of(step as f32 / STEPS as f32)).collect();
        Self { channels: info.channels as usize, format: info.format, is_srgb, decoded, between, coarse }
    }

    /// Channels of the file, 1 to 4.
    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    /// Channels on the device: 1, 2 or 4.
    pub(super) fn device_channels(&self) -> usize {
        if self.channels == 3 { 4 } else { self.channels }
    }

    /// Whether every texel is a number between 0 and 1.
    pub(super) fn is_bounded(&self) -> bool {
        self.format == TexelFormat::U8
    }

    /// Whether colours go through the sRGB curve.
    pub(super) fn is_srgb(&self) -> bool {
        self.is_srgb
    }

    /// Bytes of a texel in the file.
    pub(super) fn file_bytes(&self) -> usize {
        self.channels * self.format.bytes() as usize
    }

    /// Bytes of a texel on the device.
    pub(super) fn device_bytes(&self) -> usize {
        self.device_channels() * self.format.bytes() as usize
    }

    /// Whether a channel of the file goes through the curve: all but alpha, the second of two or the fourth.
    fn is_color(&self, channel: usize) -> bool {
        self.is_srgb && (channel == 0 || (channel < 3 && self.channels >= 3))
    }

    /// Values of texels of the file; `out` has one for each channel of each.
    pub(super) fn decode(&self, bytes: &[u8], out: &mut [f32]) {
        match self.format {
            TexelFormat::U8 => {
                let unit: [f32; 256] = std::array::from_fn(|byte| byte as f32 / 255.0);
                if (0..self.channels).all(|channel| self.is_color(channel)) {
                    return look_up(bytes, &self.decoded, out);
                }
                if !self.is_srgb {
                    return look_up(bytes, &unit, out);
                }
                let texels = bytes.chunks_exact(self.channels).zip(out.chunks_exact_mut(self.channels));
                for (bytes, out) in texels {
                    for (channel, (byte, out)) in bytes.iter().zip(out).enumerate() {
                        let table = if self.is_color(channel) { &self.decoded } else { &unit };
                        *out = table[usize::from(*byte)];
                    }
                }
            }
            TexelFormat::F16 => {
                // Bytes of a band need not be aligned.
                let halves: Vec<f16> =
                    bytes.chunks_exact(2).map(|bytes| f16::from_ne_bytes([bytes[0], bytes[1]])).collect();
                let count = halves.len().min(out.len());
                halves[..count].convert_to_f32_slice(&mut out[..count]);
                self.through_curve(out, |value| linear_from_srgb(f64::from(value)) as f32);
            }
            TexelFormat::F32 => {
                for (bytes, out) in bytes.chunks_exact(4).zip(out.iter_mut()) {
                    *out = f32::from_ne_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
                }
                self.through_curve(out, |value| linear_from_srgb(f64::from(value)) as f32);
            }
        }
    }

    /// The mean of each 2 x 2 texels of two rows of bytes: the bits that [`Self::decode`] and `TexturePyramid` give one
    /// after the other, since factors of 1/2 are exact. For bytes only.
    pub(super) fn halve(&self, upper: &[u8], lower: &[u8], out: &mut Vec<f32>) {
        let unit: [f32; 256] = std::array::from_fn(|byte| byte as f32 / 255.0);
        let tables: [&[f32; 256]; 4] =
            std::array::from_fn(|channel| if self.is_color(channel) { &self.decoded } else { &unit });
        out.clear();
        match self.channels {
            1 => halve_rows::<1>(upper, lower, tables, out),
            2 => halve_rows::<2>(upper, lower, tables, out),
            3 => halve_rows::<3>(upper, lower, tables, out),
            _ => halve_rows::<4>(upper, lower, tables, out),
        }
    }

    fn through_curve(&self, values: &mut [f32], curve: impl Fn(f32) -> f32) {
        if !self.is_srgb {
            return;
        }
        for texel in values.chunks_exact_mut(self.channels) {
            for (channel, value) in texel.iter_mut().enumerate() {
                if self.is_color(channel) {
                    *value = curve(*value);
                }
            }
        }
    }

    /// Stores values as the file would, in place of what is in `out`.
    pub(super) fn encode(&self, values: &[f32], out: &mut Vec<u8>) {
        out.clear();
        match self.format {
            TexelFormat::U8 => {
                for texel in values.chunks_exact(self.channels) {
                    for (channel, value) in texel.iter().enumerate() {
                        out.push(if self.is_color(channel) { self.byte_of(*value) } else { unit_byte(*value) });
                    }
                }
            }
            TexelFormat::F16 => {
                let mut curved = values.to_vec();
                self.through_curve(&mut curved, |value| srgb_from_linear(f64::from(value)) as f32);
                let mut halves = vec![f16::ZERO; curved.len()];
                halves.convert_from_f32_slice(&curved);
                out.extend_from_slice(bytemuck::cast_slice(&halves));
            }
            TexelFormat::F32 => {
                let mut curved = values.to_vec();
                self.through_curve(&mut curved, |value| srgb_from_linear(f64::from(value)) as f32);
                out.extend_from_slice(bytemuck::cast_slice(&curved));
            }
        }
    }

    /// The byte of a colour channel whose value is nearest.
    fn byte_of(&self, value: f32) -> u8 {
        #[expect(clippy::cast_sign_loss, reason = "a float becomes the nearest number there is")]
        let step = ((value * STEPS as f32) as usize).min(STEPS);
        let mut byte = self.coarse[step];
        while self.between.get(usize::from(byte)).is_some_and(|edge| *edge <= value) {
            byte += 1;
        }
        byte
    }

    /// Copies texels of the file and gives them the channels of the device's; the fourth is 1.
    pub(super) fn widen(&self, bytes: &[u8], out: &mut [u8]) {
        let one: &[u8] = match self.format {
            TexelFormat::U8 => &[255],
            TexelFormat::F16 => &f16::ONE.to_ne_bytes(),
            TexelFormat::F32 => &1.0_f32.to_ne_bytes(),
        };
        for (from, to) in bytes.chunks_exact(self.file_bytes()).zip(out.chunks_exact_mut(self.device_bytes())) {
            to[..from.len()].copy_from_slice(from);
            if to.len() > from.len() {
                to[from.len()..].copy_from_slice(one);
            }
        }
    }
}

fn halve_rows<const CHANNELS: usize>(upper: &[u8], lower: &[u8], tables: [&[f32; 256]; 4], out: &mut Vec<f32>) {
    let pairs = |row: &'_ [u8]| row.as_chunks::<CHANNELS>().0.len() / 2;
    out.reserve(pairs(upper).min(pairs(lower)) * CHANNELS);
    let upper = upper.as_chunks::<CHANNELS>().0.as_chunks::<2>().0;
    let lower = lower.as_chunks::<CHANNELS>().0.as_chunks::<2>().0;
    for ([a, b], [c, d]) in upper.iter().zip(lower) {
        let value = |k: usize, texel: &[u8; CHANNELS]| tables[k][usize::from(texel[k])];
        let mean = std::array::from_fn::<f32, CHANNELS, _>(|k| {
            0.25 * ((value(k, a) + value(k, b)) + (value(k, c) + value(k, d)))
        });
        out.extend_from_slice(&mean);
    }
}

fn look_up(bytes: &[u8], table: &[f32; 256], out: &mut [f32]) {
    for (byte, out) in bytes.iter().zip(out) {
        *out = table[usize::from(*byte)];
    }
}

/// The byte of a value between 0 and 1 that is no colour.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
fn unit_byte(value: f32) -> u8 {
    (value * 255.0 + 0.5).clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texels(channels: u32, format: TexelFormat, is_srgb: bool) -> StoredTexels {
        let info =
            ImageInfo { levels: vec![[1, 1]], channels, format, tile_friendly: false, is_srgb: None, wrap: None };
        StoredTexels::new(&info, is_srgb)
    }

    #[test]
    fn encoded_texels_round_to_nearest() {
        for channels in 1..=4 {
            for is_srgb in [false, true] {
                let texels = texels(channels, TexelFormat::U8, is_srgb);
                let bytes: Vec<u8> = (0..=255).flat_map(|byte| vec![byte; channels as usize]).collect();
                let mut values = vec![0.0; bytes.len()];
                texels.decode(&bytes, &mut values);
                let mut back = Vec::new();
                texels.encode(&values, &mut back);
                assert_eq!(back, bytes, "{channels} channels, sRGB {is_srgb}");
            }
        }
        let texels = texels(3, TexelFormat::U8, true);
        for i in 0..200_000_u32 {
            let value = i as f32 / 199_999.0;
            let slow = texels.between.partition_point(|edge| *edge <= value);
            assert_eq!(usize::from(texels.byte_of(value)), slow, "{value}");
        }
        assert_eq!([f32::NAN, -1.0, 2.0].map(|value| texels.byte_of(value)), [0, 0, 255], "outside");
    }

    #[test]
    fn alpha_is_not_srgb_decoded() {
        for (channels, alpha) in [(2, 1), (4, 3)] {
            for format in [TexelFormat::U8, TexelFormat::F16, TexelFormat::F32] {
                let texels = texels(channels, format, true);
                let half: Vec<u8> = match format {
                    TexelFormat::U8 => vec![51],
                    TexelFormat::F16 => f16::from_f32(0.2).to_ne_bytes().to_vec(),
                    TexelFormat::F32 => 0.2_f32.to_ne_bytes().to_vec(),
                };
                let mut values = vec![0.0; channels as usize];
                texels.decode(&half.repeat(channels as usize), &mut values);
                assert!((values[alpha] - 0.2).abs() < 1e-4, "{channels} channels, {format:?}: {values:?}");
                assert!((f64::from(values[0]) - linear_from_srgb(0.2)).abs() < 1e-4, "{format:?}: {values:?}");
                let mut back = Vec::new();
                texels.encode(&values, &mut back);
                assert_eq!(back.len(), half.len() * channels as usize, "{format:?}: as many bytes");
            }
        }
    }

    #[test]
    fn three_channel_texels_widen_to_four() {
        let texels = texels(3, TexelFormat::U8, false);
        let mut out = [0; 8];
        texels.widen(&[1, 2, 3, 4, 5, 6], &mut out);
        assert_eq!(out, [1, 2, 3, 255, 4, 5, 6, 255], "alpha is 1");
    }
}
