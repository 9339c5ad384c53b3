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

    /// Its pieces, each in one octave, in ascending order.
    pub fn pieces(self) -> impl Iterator<Item = Self> {
        let mut begin = self.begin;
        std::iter::from_fn(move || {
            let octave = u32::BITS - begin.leading_zeros();
            let end = 1_u32.checked_shl(octave).map_or(self.end, |end| end.min(self.end));
            let piece = Self { begin, end };
            begin = end;
            (piece.begin < piece.end).then_some(piece)
        })
    }
}

impl fmt::Display for SampleRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.begin, self.end)
    }
}
