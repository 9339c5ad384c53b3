// SPDX-License-Identifier: Apache-2.0
//! The outermost numbers of some records, from which their box follows: what blocks keep and lattices measure. Pure.

/// Outermost numbers of some records: lower corner (negative), upper corner, largest spread, 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RecordPeaks(pub(crate) [f32; 8]);

impl RecordPeaks {
    /// Of no record.
    pub(crate) const NONE: Self = Self([f32::NEG_INFINITY; 8]);

    /// Of both.
    #[inline]
    pub(crate) fn max(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| if other.0[k] > self.0[k] { other.0[k] } else { self.0[k] }))
    }
}
