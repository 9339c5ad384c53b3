// SPDX-License-Identifier: Apache-2.0
//! Images that are filtered with the samples: for each the mean over a pixel's samples of what they meet first, or of
//! the light that they meet on the paths of an expression, whose values come last.
//!
//! A sample leaves its values for all of them, one after the other, at its path or, while streaming, at its place in a
//! segment; before its light is added to the film they are added to the sums of its pixel, in the same order. So their
//! bits depend on budget and schedule as little as those of the colour. Without such an image there is nothing of it.

use crate::job::aov::AovKind;
use crate::job::expression::ExpressionId;
use oocpt_abi::{FrameConstants, PlaneOffsets, PlaneSum};
use oocpt_gpu::{Buffer, BufferUsage, Gpu, GpuError};
use std::sync::Arc;

/// The filtered images of a film, and the sums of their values.
#[derive(Debug)]
pub(crate) struct FilteredPlanes {
    kinds: Vec<AovKind>,
    words: u32,
    /// [`PlaneSum`] of each value, for each record of the film.
    pub(crate) sums: Buffer,
}

/// Those of `kinds` that are summed, which are sorted; `filters`: with those of first hits.
pub(crate) fn filtered(kinds: &[AovKind], filters: bool) -> Vec<AovKind> {
    kinds.iter().copied().filter(|kind| kind.is_summed(filters)).collect()
}

/// Values that a sample has for `kinds`.
fn words(kinds: &[AovKind]) -> u32 {
    // At most three for each kind.
    kinds.iter().map(|kind| u32::try_from(kind.channels()).unwrap_or(0)).sum()
}

/// Bytes of the sums of a film of so many records.
pub(crate) fn sums_bytes(kinds: &[AovKind], records: u64) -> u64 {
    records * u64::from(words(kinds)) * size_of::<PlaneSum>() as u64
}

impl FilteredPlanes {
    /// Sums for a film of so many records; `None` if none of `kinds` is summed.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        (kinds, filters): (&[AovKind], bool),
        records: u64,
    ) -> Result<Option<Self>, GpuError> {
        let kinds = filtered(kinds, filters);
        if kinds.is_empty() {
            return Ok(None);
        }
        let sums = Buffer::new(gpu, "plane_sums", sums_bytes(&kinds, records), BufferUsage::Device)?;
        Ok(Some(Self { words: words(&kinds), kinds, sums }))
    }

    pub(crate) fn has(&self, kind: AovKind) -> bool {
        self.kinds.contains(&kind)
    }

    /// The images, in the order of their values.
    pub(crate) fn kinds(&self) -> &[AovKind] {
        &self.kinds
    }

    /// The light path expressions among them.
    pub(crate) fn expressions(&self) -> Vec<ExpressionId> {
        self.kinds.iter().filter_map(|kind| kind.expression()).collect()
    }

    /// Whether some of them are of what samples meet first.
    pub(crate) fn has_first_hits(&self) -> bool {
        self.kinds.iter().any(|kind| kind.is_filterable())
    }

    /// Values of a sample.
    pub(crate) fn words(&self) -> u32 {
        self.words
    }

    /// Writes what passes ask of them into a frame block.
    pub(crate) fn bind(&self, frame: &mut FrameConstants) {
        frame.plane_sums = self.sums.address();
        frame.plane_words = self.words;
        frame.light_count = u32::try_from(self.expressions().len()).unwrap_or(0);
        let mut at = 0;
        for kind in &self.kinds {
            if let Some(first) = offset(&mut frame.plane_at, *kind) {
                *first = at;
            }
            at += words(&[*kind]);
        }
    }
}

/// Where it is noted at which value an image begins; `None` of one that is never filtered.
fn offset(at: &mut PlaneOffsets, kind: AovKind) -> Option<&mut u32> {
    match kind {
        AovKind::Normal => Some(&mut at.normal),
        AovKind::Neye => Some(&mut at.neye),
        AovKind::Albedo => Some(&mut at.albedo),
        AovKind::Position => Some(&mut at.position),
        AovKind::Peye => Some(&mut at.peye),
        AovKind::GeometricNormal => Some(&mut at.geometric_normal),
        AovKind::Color
        | AovKind::Depth
        | AovKind::CameraDepth
        | AovKind::PrimId
        | AovKind::InstanceId
        | AovKind::ElementId
        | AovKind::Motion
        | AovKind::SampleCount
        | AovKind::Variance
        | AovKind::Error
        | AovKind::Light(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_be_filtered_has_a_place_among_the_values() {
        for kind in AovKind::ALL {
            let mut at = PlaneOffsets::NONE;
            assert_eq!(offset(&mut at, kind).is_some(), kind.is_filterable(), "{kind:?}");
        }
        assert_eq!(words(&filtered(&AovKind::ALL, true)), 18, "six images of three channels");
    }
}
