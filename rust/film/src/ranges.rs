// SPDX-License-Identifier: Apache-2.0
//! Ranges of samples, and octaves: octave 0 is sample 0, octave k the samples `2^(k-1)..2^k`. Pure.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Most samples of a pixel.
pub const MAX_SAMPLES: u32 = 1 << 31;

/// Samples `begin..end` of every pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct SampleRange {
    /// First sample.
    pub begin: u32,
    /// Sample behind the last.
    pub end: u32,
}

impl SampleRange {
    /// Samples `begin..end`.
    #[must_use]
    pub const fn new(begin: u32, end: u32) -> Self {
        Self { begin, end }
    }

    /// Number of samples.
    #[must_use]
    pub const fn samples(self) -> u32 {
        self.end.saturating_sub(self.begin)
    }

    /// The octave of its first sample.
    #[must_use]
    pub const fn octave(self) -> u32 {
        u32::BITS - self.begin.leading_zeros()
    }

    /// The samples of an octave.
    pub(crate) const fn of_octave(octave: u32) -> Self {
        match octave {
            0 => Self { begin: 0, end: 1 },
            1..=31 => Self { begin: 1 << (octave - 1), end: 1 << octave },
            _ => Self { begin: MAX_SAMPLES, end: MAX_SAMPLES },
        }
    }

    /// Whether it has samples, of one octave; then it ends at [`MAX_SAMPLES`] at most.
    pub(crate) const fn is_in_octave(self) -> bool {
        let octave = Self::of_octave(self.octave());
        self.begin < self.end && octave.begin <= self.begin && self.end <= octave.end
    }

    /// Its pieces, each in one octave, in ascending order.
    pub fn pieces(self) -> impl Iterator<Item = Self> {
        let mut begin = self.begin;
        std::iter::from_fn(move || {
            let end = 1_u32.checked_shl(Self::new(begin, begin).octave()).map_or(self.end, |end| end.min(self.end));
            let piece = Self { begin, end };
            begin = end;
            (piece.begin < piece.end).then_some(piece)
        })
    }
}

/// Ranges in ascending order, joined where they meet; they do not overlap.
pub(crate) fn joined(ranges: impl IntoIterator<Item = SampleRange>) -> Vec<SampleRange> {
    let mut all: Vec<SampleRange> = ranges.into_iter().collect();
    all.sort_unstable();
    let mut joined: Vec<SampleRange> = Vec::new();
    for range in all {
        match joined.last_mut() {
            Some(last) if last.end == range.begin => last.end = range.end,
            _ => joined.push(range),
        }
    }
    joined
}

/// Number of samples of ranges.
pub(crate) fn samples(ranges: &[SampleRange]) -> u32 {
    ranges.iter().fold(0, |sum, range| sum.saturating_add(range.samples()))
}

/// What is missing of samples `0..end`.
#[must_use]
pub fn missing(ranges: &[SampleRange], end: u32) -> Vec<SampleRange> {
    let mut at = 0;
    let mut holes = Vec::new();
    for range in joined(ranges.iter().copied()).into_iter().chain([SampleRange::new(end, end)]) {
        if range.begin.min(end) > at {
            holes.push(SampleRange::new(at, range.begin.min(end)));
        }
        at = at.max(range.end);
    }
    holes
}

/// Samples that two lists have both; each list is in ascending order and does not overlap itself.
pub(crate) fn overlap(mine: &[SampleRange], its: &[SampleRange]) -> Option<SampleRange> {
    mine.iter().find_map(|a| {
        its.iter().find_map(|b| {
            let (begin, end) = (a.begin.max(b.begin), a.end.min(b.end));
            (begin < end).then_some(SampleRange { begin, end })
        })
    })
}

/// What is wrong with the samples of planes, if anything: first may be those from sample 0 to the end of an octave,
/// then come those of single octaves that do not follow them at once.
pub(crate) fn check(planes: &[Vec<SampleRange>]) -> Result<(), &'static str> {
    let mut next = 0;
    for (index, plane) in planes.iter().enumerate() {
        let Some(first) = plane.first() else { return Err("a plane without samples") };
        let is_prefix = index == 0 && first.begin == 0;
        if first.begin < next || joined(plane.iter().copied()) != *plane {
            return Err("samples of planes are not in ascending order");
        }
        let of_octaves = match is_prefix {
            true => plane.len() == 1 && first.end.is_power_of_two(),
            false => plane.iter().all(|range| range.is_in_octave() && range.octave() == first.octave()),
        };
        if !of_octaves {
            return Err("samples of a plane are not of one octave");
        }
        let octave = SampleRange::of_octave(first.octave());
        if index == 1 && planes[0][0] == SampleRange::new(0, octave.begin) && *plane == [octave] {
            return Err("an octave that belongs to the first plane");
        }
        next = if is_prefix { first.end } else { octave.end };
    }
    Ok(())
}

impl fmt::Display for SampleRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.begin, self.end)
    }
}
