// SPDX-License-Identifier: Apache-2.0
//! Texels as they are compressed, and as they are given. Compressed, each channel is a plane of rows, one plane after
//! the other; integers may be stored as differences to the value before, across rows and planes. Given, the channels
//! of a texel are together.

use crate::DataType;

/// What a texel is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TexelLayout {
    pub(crate) data_type: DataType,
    pub(crate) channels: usize,
}

/// Rectangle of a face, texels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FaceRect {
    pub(crate) at: [usize; 2],
    pub(crate) size: [usize; 2],
    /// Texels of a row of the face.
    pub(crate) face_width: usize,
}

impl TexelLayout {
    pub(crate) fn bytes(self) -> usize {
        self.data_type.bytes() * self.channels
    }

    /// Copies planes to a rectangle of the face `out`.
    pub(crate) fn place(self, planes: &[u8], rect: FaceRect, out: &mut [u8]) {
        match self.data_type.bytes() {
            1 => interleave::<1>(planes, self.channels, rect, out),
            2 => interleave::<2>(planes, self.channels, rect, out),
            _ => interleave::<4>(planes, self.channels, rect, out),
        }
    }

    /// Copies a rectangle of the face `from` to planes.
    pub(crate) fn planes(self, from: &[u8], rect: FaceRect) -> Vec<u8> {
        let value = self.data_type.bytes();
        let mut planes = Vec::with_capacity(rect.size[0] * rect.size[1] * self.bytes());
        for channel in 0..self.channels {
            for row in rows(from, rect, self.bytes()) {
                let values = row.chunks_exact(self.bytes()).filter_map(|texel| texel.chunks_exact(value).nth(channel));
                values.for_each(|value| planes.extend_from_slice(value));
            }
        }
        self.swap_bytes(&mut planes);
        planes
    }

    /// Copies one texel everywhere in a rectangle of the face `out`.
    pub(crate) fn fill(self, texel: &[u8], rect: FaceRect, out: &mut [u8]) {
        for row in rows_mut(out, rect, self.bytes()) {
            row.chunks_exact_mut(self.bytes()).zip(std::iter::repeat(texel)).for_each(|(to, texel)| {
                to.iter_mut().zip(texel).for_each(|(to, from)| *to = *from);
            });
        }
    }

    /// Turns values from the byte order of files into that of this machine, or back.
    pub(crate) fn swap_bytes(self, bytes: &mut [u8]) {
        if cfg!(target_endian = "big") {
            bytes.chunks_exact_mut(self.data_type.bytes()).for_each(<[u8]>::reverse);
        }
    }
}

/// The rows of a rectangle of a face, bytes.
fn rows(face: &[u8], rect: FaceRect, texel: usize) -> impl Iterator<Item = &[u8]> {
    let [start, end] = [rect.at[0] * texel, (rect.at[0] + rect.size[0]) * texel];
    let rows = face.chunks_exact(rect.face_width * texel).skip(rect.at[1]).take(rect.size[1]);
    rows.filter_map(move |row| row.get(start..end))
}

fn rows_mut(face: &mut [u8], rect: FaceRect, texel: usize) -> impl Iterator<Item = &mut [u8]> {
    let [start, end] = [rect.at[0] * texel, (rect.at[0] + rect.size[0]) * texel];
    let rows = face.chunks_exact_mut(rect.face_width * texel).skip(rect.at[1]).take(rect.size[1]);
    rows.filter_map(move |row| row.get_mut(start..end))
}

/// `N` is the bytes of a value.
fn interleave<const N: usize>(planes: &[u8], channels: usize, rect: FaceRect, out: &mut [u8]) {
    let row_bytes = rect.size[0] * N;
    for (channel, plane) in planes.chunks_exact(row_bytes * rect.size[1]).take(channels).enumerate() {
        for (from, to) in plane.chunks_exact(row_bytes).zip(rows_mut(out, rect, channels * N)) {
            // Each chunk begins at this channel's value of a texel; the last one is shorter, but not than that.
            let texels = to.get_mut(channel * N..).unwrap_or_default().chunks_mut(channels * N);
            for (from, to) in from.as_chunks::<N>().0.iter().zip(texels) {
                if let Some(to) = to.first_chunk_mut::<N>() {
                    *to = *from;
                    if cfg!(target_endian = "big") {
                        to.reverse();
                    }
                }
            }
        }
    }
}

/// Replaces differences by values. Floating-point values are never stored as differences.
pub(crate) fn undo_differences(planes: &mut [u8], data_type: DataType) {
    match data_type {
        DataType::U8 => {
            let mut before = 0_u8;
            for value in planes {
                before = before.wrapping_add(*value);
                *value = before;
            }
        }
        DataType::U16 => {
            let mut before = 0_u16;
            for value in planes.as_chunks_mut().0 {
                before = before.wrapping_add(u16::from_le_bytes(*value));
                *value = before.to_le_bytes();
            }
        }
        DataType::F16 | DataType::F32 => {}
    }
}

/// Replaces values by differences; for integers only.
pub(crate) fn make_differences(planes: &mut [u8], data_type: DataType) {
    match data_type {
        DataType::U8 => {
            let mut before = 0_u8;
            for value in planes {
                let difference = value.wrapping_sub(before);
                before = std::mem::replace(value, difference);
            }
        }
        DataType::U16 => {
            let mut before = 0_u16;
            for bytes in planes.as_chunks_mut().0 {
                let value = u16::from_le_bytes(*bytes);
                *bytes = value.wrapping_sub(before).to_le_bytes();
                before = value;
            }
        }
        DataType::F16 | DataType::F32 => {}
    }
}
