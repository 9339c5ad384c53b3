// SPDX-License-Identifier: Apache-2.0
//! The average texel of a face. Readers take it where a face is less than a texel wide.

use half::f16;

use crate::DataType;
use crate::texels::TexelLayout;

/// The average of texels in the byte order of this machine. Alpha weighs the channels before it or, if it is the first,
/// those after it.
pub(super) fn average(texel: TexelLayout, alpha_channel: Option<u32>, texels: &[u8]) -> Vec<u8> {
    let alpha = alpha_channel.map(|alpha| alpha as usize);
    let is_weighed = |channel| alpha.is_some_and(|alpha| if alpha == 0 { channel > 0 } else { channel < alpha });
    let value = texel.data_type.bytes();
    let mut sums = vec![0.0; texel.channels];
    let mut weights = 0.0;
    let mut count = 0.0;
    for each in texels.chunks_exact(texel.bytes()) {
        let values = || each.chunks_exact(value).map(|value| decode(texel.data_type, value));
        let weight = alpha.and_then(|alpha| values().nth(alpha)).unwrap_or(1.0);
        weights += weight;
        count += 1.0;
        for (channel, (sum, value)) in sums.iter_mut().zip(values()).enumerate() {
            *sum += if is_weighed(channel) { weight * value } else { value };
        }
    }
    let averages = sums.iter().enumerate().map(|(channel, sum)| {
        let total = if is_weighed(channel) { weights } else { count };
        if total == 0.0 { 0.0 } else { sum / total }
    });
    averages.flat_map(|average| encode(texel.data_type, average)).collect()
}

fn decode(data_type: DataType, value: &[u8]) -> f64 {
    match (data_type, value) {
        (DataType::U8, &[a]) => f64::from(a),
        (DataType::U16, &[a, b]) => f64::from(u16::from_ne_bytes([a, b])),
        (DataType::F16, &[a, b]) => f16::from_ne_bytes([a, b]).to_f64(),
        (DataType::F32, &[a, b, c, d]) => f64::from(f32::from_ne_bytes([a, b, c, d])),
        _ => 0.0,
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounded, and `as` keeps what is out of range at the limits")]
fn encode(data_type: DataType, value: f64) -> Vec<u8> {
    match data_type {
        DataType::U8 => (value.round() as u8).to_ne_bytes().to_vec(),
        DataType::U16 => (value.round() as u16).to_ne_bytes().to_vec(),
        DataType::F16 => f16::from_f64(value).to_ne_bytes().to_vec(),
        DataType::F32 => (value as f32).to_ne_bytes().to_vec(),
    }
}
