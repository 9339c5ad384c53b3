// SPDX-License-Identifier: Apache-2.0
//! Images that are filtered with the samples: for each the mean over a pixel's samples of what they meet first, or of
//! the light that they meet on the paths of an expression, or how much of the light that shadow rays ask for arrives,
//! or how often they wait for loads, or the ids of what they meet first, ranked by their number, or what they meet
//! first by its depth. Values lie in this order.
//!
//! A sample leaves its values for all of them, one after the other, at its path or, while streaming, at its place in a
//! segment; before its light is added to the film they are added to the sums of its pixel, in the same order. So their
//! bits depend on budget and schedule as little as those of the colour. Without such an image there is nothing of it.

use crate::job::aov::AovKind;
use crate::job::deep::DeepLimits;
use crate::job::expression::ExpressionId;
use oocpt_abi::{DEEP_WORDS, DeepSlot, FrameConstants, ID_SLOTS, IdSlot, NO_INDEX, PlaneOffsets, PlaneSum};
use oocpt_gpu::{Buffer, BufferUsage, Gpu, GpuError};
use std::sync::Arc;

/// Words of an id.
const ID_WORDS: u32 = 2;

/// The filtered images of a film, and the sums of their values.
#[derive(Debug)]
pub(crate) struct FilteredPlanes {
    /// In the order of their values; those that rank ids come last, but for a deep image.
    kinds: Vec<AovKind>,
    sample: SampleWords,
    /// [`PlaneSum`] of each value, for each record of the film; behind them [`IdSlot`]s, then [`DeepSlot`]s.
    pub(crate) sums: Buffer,
    /// The bytes at which both begin.
    slots_at: [u64; 2],
}

/// What a sample has for filtered images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct SampleWords {
    /// Values that are summed.
    summed: u32,
    /// Ids that are ranked.
    ids: u32,
    /// A deep image, which has [`DEEP_WORDS`].
    deep: Option<DeepLimits>,
}

impl SampleWords {
    fn of(kinds: &[AovKind]) -> Self {
        let summed = kinds.iter().filter(|kind| !kind.is_list());
        let summed = summed.map(|kind| kind.summed_words()).sum();
        let ids = kinds.iter().filter(|kind| kind.ranks_ids()).count();
        Self { summed, ids: u32::try_from(ids).unwrap_or(0), deep: kinds.iter().find_map(|kind| kind.deep()) }
    }

    /// Words before those of a deep image.
    fn before_deep(self) -> u32 {
        self.summed + ID_WORDS * self.ids
    }

    fn all(self) -> u32 {
        self.before_deep() + self.deep.map_or(0, |_| DEEP_WORDS)
    }

    fn sums_bytes(self, records: u64) -> u64 {
        records * u64::from(self.summed) * size_of::<PlaneSum>() as u64
    }

    fn slots_bytes(self, records: u64) -> u64 {
        records * u64::from(self.ids) * u64::from(ID_SLOTS) * size_of::<IdSlot>() as u64
    }

    fn deep_bytes(self, records: u64) -> u64 {
        records * self.deep.map_or(0, |limits| u64::from(limits.samples())) * size_of::<DeepSlot>() as u64
    }
}

/// Those of `kinds`, which are sorted, that samples have values for, in the order of these; `filters`: with means of
/// first hits.
pub(crate) fn filtered(kinds: &[AovKind], filters: bool) -> Vec<AovKind> {
    let of_samples = || kinds.iter().copied().filter(|kind| kind.is_of_samples(filters));
    let (means, lists): (Vec<_>, Vec<_>) = of_samples().partition(|kind| !kind.is_list());
    let (ids, deep): (Vec<_>, Vec<_>) = lists.into_iter().partition(|kind| kind.ranks_ids());
    let (shadows, means): (Vec<_>, Vec<_>) = means.into_iter().partition(|kind| kind.is_of_shadows());
    let (waits, means): (Vec<_>, Vec<_>) = means.into_iter().partition(|kind| *kind == AovKind::LoadWaits);
    // Requests have one deep image at most.
    [means, shadows, waits, ids, deep].concat()
}

/// Bytes of the sums and slots of a film of so many records.
pub(crate) fn sums_bytes(kinds: &[AovKind], records: u64) -> u64 {
    let sample = SampleWords::of(kinds);
    sample.sums_bytes(records) + sample.slots_bytes(records) + sample.deep_bytes(records)
}

impl FilteredPlanes {
    /// Sums for a film of so many records; `None` if none of `kinds` is filtered.
    pub(crate) fn new(gpu: &Arc<Gpu>, kinds: Vec<AovKind>, records: u64) -> Result<Option<Self>, GpuError> {
        if kinds.is_empty() {
            return Ok(None);
        }
        let sample = SampleWords::of(&kinds);
        let sums = Buffer::new(gpu, "plane_sums", sums_bytes(&kinds, records), BufferUsage::Device)?;
        let ids_at = sample.sums_bytes(records);
        Ok(Some(Self { kinds, sample, sums, slots_at: [ids_at, ids_at + sample.slots_bytes(records)] }))
    }

    /// Where sums, slots of ids and those of deep images begin, and the bytes of each for a pixel.
    pub(crate) fn parts(&self) -> [(u64, u64); 3] {
        let ([ids_at, deep_at], of) = (self.slots_at, self.sample);
        [(0, of.sums_bytes(1)), (ids_at, of.slots_bytes(1)), (deep_at, of.deep_bytes(1))]
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

    /// Values of a sample that paths have until they end: of expressions, then of shadows and waits; the last that are
    /// summed.
    pub(crate) fn light_words(&self) -> u32 {
        let is_of_path =
            |kind: &&AovKind| kind.expression().is_some() || kind.is_of_shadows() || **kind == AovKind::LoadWaits;
        let of_light = self.kinds.iter().filter(is_of_path);
        of_light.map(|kind| kind.summed_words()).sum()
    }

    /// Whether some of them are of shadows.
    pub(crate) fn has_shadows(&self) -> bool {
        self.kinds.iter().any(|kind| kind.is_of_shadows())
    }

    /// Whether it is counted how often paths wait for loads.
    pub(crate) fn has_waits(&self) -> bool {
        self.kinds.contains(&AovKind::LoadWaits)
    }

    /// Whether some of them are of what samples meet first.
    pub(crate) fn has_first_hits(&self) -> bool {
        self.kinds.iter().any(|kind| kind.is_filterable() || kind.is_list())
    }

    /// Values of a sample.
    pub(crate) fn words(&self) -> u32 {
        self.sample.all()
    }

    /// Whether any image is a mean.
    pub(crate) fn has_means(&self) -> bool {
        self.sample.summed > 0
    }

    /// Whether any image ranks ids.
    pub(crate) fn has_ids(&self) -> bool {
        self.sample.ids > 0
    }

    /// Whether there is a deep image.
    pub(crate) fn has_deep(&self) -> bool {
        self.sample.deep.is_some()
    }

    /// Writes what passes ask of them into a frame block.
    pub(crate) fn bind(&self, frame: &mut FrameConstants) {
        frame.plane_sums = self.sums.address();
        let [ids, deep] = self.slots_at.map(|at| self.sums.address() + at);
        frame.id_slots = if self.has_ids() { ids } else { 0 };
        if let Some(limits) = self.sample.deep {
            (frame.deep_slots, frame.deep_at) = (deep, self.sample.before_deep());
            frame.deep_samples = u32::from(limits.samples());
            [frame.deep_tolerance, frame.deep_distance] = limits.depths();
        }
        frame.plane_words = self.sample.all();
        (frame.sum_words, frame.id_count) = (self.sample.summed, self.sample.ids);
        frame.light_count = u32::try_from(self.expressions().len()).unwrap_or(0);
        frame.light_words = self.light_words();
        let first = self.sample.summed - frame.light_words;
        let place = |kind| self.place_of(kind).map_or(NO_INDEX, |at| at - first);
        (frame.shadow_at, frame.catcher_at) = (place(AovKind::Shadow), place(AovKind::ShadowCatcher));
        for (kind, at) in self.places() {
            if let Some(first) = offset(&mut frame.plane_at, kind) {
                *first = at;
            }
        }
    }

    /// The images, and the value of a sample at which each begins.
    fn places(&self) -> impl Iterator<Item = (AovKind, u32)> {
        self.kinds.iter().scan(0, |at, kind| {
            let first = *at;
            *at += SampleWords::of(&[*kind]).all();
            Some((*kind, first))
        })
    }

    /// The value of a sample at which an image begins.
    pub(crate) fn place_of(&self, kind: AovKind) -> Option<u32> {
        self.places().find(|(have, _)| *have == kind).map(|(_, at)| at)
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
        AovKind::CryptoObject => Some(&mut at.crypto_object),
        AovKind::CryptoMaterial => Some(&mut at.crypto_material),
        AovKind::Color
        | AovKind::Depth
        | AovKind::CameraDepth
        | AovKind::PrimId
        | AovKind::InstanceId
        | AovKind::ElementId
        | AovKind::Motion
        | AovKind::MotionBoth
        | AovKind::SampleCount
        | AovKind::Variance
        | AovKind::Error
        | AovKind::MaterialId
        | AovKind::Shadow
        | AovKind::ShadowCatcher
        | AovKind::LoadWaits
        | AovKind::Denoised
        | AovKind::Primvar(_)
        | AovKind::Light(_)
        | AovKind::Deep(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::primvar::PrimvarImage;

    #[test]
    fn what_can_be_filtered_has_a_place_among_the_values() {
        for kind in AovKind::ALL {
            let mut at = PlaneOffsets::NONE;
            assert_eq!(offset(&mut at, kind).is_some(), kind.is_filterable() || kind.ranks_ids(), "{kind:?}");
        }
        let all = filtered(&AovKind::ALL, true);
        assert_eq!(
            SampleWords::of(&all),
            SampleWords { summed: 29, ids: 2, deep: None },
            "six images of three channels, shadows and waits"
        );
        assert!(all[..6].iter().all(|kind| kind.is_filterable()), "ids come last: {all:?}");
        let of_paths = [AovKind::Shadow, AovKind::ShadowCatcher, AovKind::LoadWaits];
        let always = [&of_paths[..], &[AovKind::CryptoObject, AovKind::CryptoMaterial]].concat();
        assert_eq!(filtered(&AovKind::ALL, false), always);
        let [mean, centred] = [false, true].map(|is| AovKind::Primvar(PrimvarImage::of("st", is).expect("a name")));
        assert_eq!(filtered(&[mean, centred], true), [mean], "whole numbers have no mean");
        assert_eq!(SampleWords::of(&[mean]), SampleWords { summed: 4, ids: 0, deep: None });
        assert_eq!(size_of::<IdSlot>() * oocpt_abi::ID_RANKS as usize, AovKind::CryptoObject.pixel_bytes());
    }
}
