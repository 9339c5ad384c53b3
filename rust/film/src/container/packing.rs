// SPDX-License-Identifier: Apache-2.0
//! Packs records of one size: bytes at the same place of all records are a *lane*, and a lane of one value is written
//! once. Sums use few of the bytes that they have: a third to half is left, at the speed of memory.
//!
//! Packed are a bit for each lane, set if it has several values, then the lanes in order, of one byte or of as many as
//! there are records. With a stride of 1 nothing is packed. Pure.

/// Packs records of `stride` bytes; `raw` is a multiple of that.
pub(super) fn pack(raw: &[u8], stride: usize) -> Vec<u8> {
    if stride <= 1 || raw.is_empty() {
        return raw.to_vec();
    }
    let mut packed = vec![0; stride.div_ceil(8)];
    // A record at a time: the lanes' accesses by themselves would miss the cache.
    let mut differs = vec![0_u8; stride];
    let (first, _) = raw.split_at(stride);
    for record in raw.chunks_exact(stride) {
        for (differs, (byte, first)) in differs.iter_mut().zip(record.iter().zip(first)) {
            *differs |= byte ^ first;
        }
    }
    for (lane, differs) in differs.iter().enumerate() {
        if *differs == 0 {
            packed.push(first[lane]);
        } else {
            packed[lane / 8] |= 1 << (lane % 8);
            packed.extend(raw.iter().skip(lane).step_by(stride));
        }
    }
    packed
}

/// The `length` bytes that were packed; `None` if these are not bytes that [`pack`] made.
pub(super) fn unpack(packed: &[u8], stride: usize, length: usize) -> Option<Vec<u8>> {
    if stride <= 1 || length == 0 {
        return (packed.len() == length).then(|| packed.to_vec());
    }
    let (bits, mut rest) = packed.split_at_checked(stride.div_ceil(8))?;
    if !length.is_multiple_of(stride) {
        return None;
    }
    let records = length / stride;
    let mut raw = vec![0; length];
    for lane in 0..stride {
        if bits[lane / 8] >> (lane % 8) & 1 == 0 {
            let (value, after) = rest.split_first()?;
            if *value != 0 {
                raw.iter_mut().skip(lane).step_by(stride).for_each(|byte| *byte = *value);
            }
            rest = after;
        } else {
            let (values, after) = rest.split_at_checked(records)?;
            raw.iter_mut().skip(lane).step_by(stride).zip(values).for_each(|(byte, value)| *byte = *value);
            rest = after;
        }
    }
    rest.is_empty().then_some(raw)
}

/// Most bytes that so many are packed to.
pub(super) fn most_packed(length: usize, stride: usize) -> usize {
    length + stride.div_ceil(8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_of_one_value_are_written_once() {
        let raw: Vec<u8> = (0..100_u8).flat_map(|k| [7, k, 0]).collect();
        let packed = pack(&raw, 3);
        assert_eq!(packed.len(), 1 + 1 + 100 + 1);
        assert_eq!(unpack(&packed, 3, raw.len()), Some(raw.clone()));
        assert!(packed.len() <= most_packed(raw.len(), 3));
        for cut in 0..packed.len() {
            assert_eq!(unpack(&packed[..cut], 3, raw.len()), None, "{cut} bytes");
        }
        assert_eq!(unpack(&packed, 3, raw.len() - 1), None, "no whole records");
        assert_eq!(unpack(&packed, 3, raw.len() - 3), None, "a record less");
        assert_eq!(unpack(&packed, 3, raw.len() + 1), None, "a byte that no record has");
    }
}
