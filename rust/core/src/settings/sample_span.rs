// SPDX-License-Identifier: Apache-2.0
//! The setting that has only some of a picture's samples rendered. Pure, any thread.

use serde::{Deserialize, Serialize};

/// Largest number of samples per pixel: sample indices stay exact in f32.
pub(super) const MAX_SAMPLES: u32 = 1 << 24;

/// Samples `begin..end` of every pixel; none of them: all that `oocpt:samplesPerPixel` says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct SampleSpan {
    /// First sample.
    pub begin: u32,
    /// Sample behind the last.
    pub end: u32,
}

impl SampleSpan {
    /// Whether it says nothing.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.end == 0
    }

    /// The span that a text means: `A..B`, with `A` below `B`, or nothing.
    #[must_use]
    pub fn named(text: &str) -> Option<Self> {
        if text.is_empty() {
            return Some(Self::default());
        }
        let (begin, end) = text.split_once("..")?;
        let (begin, end) = (begin.trim().parse().ok()?, end.trim().parse().ok()?);
        (begin < end && end <= MAX_SAMPLES).then_some(Self { begin, end })
    }
}

impl std::fmt::Display for SampleSpan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.is_empty() { Ok(()) } else { write!(f, "{}..{}", self.begin, self.end) }
    }
}
