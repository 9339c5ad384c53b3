// SPDX-License-Identifier: Apache-2.0
//! Push constants of the wavefront passes.

use bitflags::bitflags;
use bytemuck::{Pod, Zeroable};

bitflags! {
    /// What the rays of a submission are (`PushConstants::flags`).
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
    pub struct PushFlags: u32 {
        /// Rays of `generate_aov_rays`: they meet every surface of opacity above 0, and are not counted in the totals.
        const AOVS = 1;
        /// `generate_*`, streaming: the slots from `arg0` on have never been used.
        const FRESH = 2;
        /// `generate_camera_rays`, in core: only paths that lacked a tile of a texture start
        /// ([`super::TextureFeedback`]).
        const RETRACE = 4;
    }
}

/// Where `generate_*` finds the number of the segment in `PushConstants::flags`, streaming.
pub const PUSH_SEGMENT_SHIFT: u32 = 8;
/// Where `first_sample` has the number of the band with [`super::Features::ADAPTIVE`]; below it is the row.
pub const BAND_SHIFT: u32 = 26;

/// `first_sample` of a row (below 2^[`BAND_SHIFT`]) of a band; `band_of` and `row_of` of the shaders take it apart.
#[must_use]
pub const fn pack_band(band: u32, row: u32) -> u32 {
    row | band << BAND_SHIFT
}

/// Band and row, as `band_of` and `row_of` of the shaders.
#[must_use]
pub const fn unpack_band(first_sample: u32) -> (u32, u32) {
    (first_sample >> BAND_SHIFT, first_sample & ((1 << BAND_SHIFT) - 1))
}

/// Set in the pixel of an entry of the second stream.
pub const STREAM_BIT: u32 = 1 << 31;
/// The second stream's seed differs from the first one's by this, xor.
pub const STREAM_SEED: u32 = 0x5bd1_e995;
/// Octaves of variance estimates that the film keeps for each stream.
pub const ESTIMATE_RING: u32 = 8;
/// First octave of samples at which a stream estimates its variance.
pub const ESTIMATE_FIRST: u32 = 3;

shared! {
    /// Push constants of every wavefront pass, 32 B.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
    pub struct PushConstants {
        /// Device address of a [`super::FrameConstants`].
        pub frame: u64,
        /// First path of the wave: index of its pixel in trace order (`first_path % (width * height)`).
        pub first_pixel: u32,
        /// First path of the wave: its sample number (`first_path / (width * height)`), or, with
        /// [`super::Features::ADAPTIVE`], band and row of [`pack_band`].
        pub first_sample: u32,
        /// Paths in the wave. `width * height + path_count` must stay below 2^32.
        pub path_count: u32,
        /// Round: 0 = camera rays. In a wave all rays of round `r` are at bounce `r`; passes ask the ray for its
        /// bounce, and the round only for which of the two ray queues is read. With streaming, rounds are numbered
        /// through all submissions.
        pub round: u32,
        /// Meaning depends on the pass; 0 where none is told.
        pub arg0: u32,
        /// Bits of [`PushFlags`].
        pub flags: u32,
    }
}

impl PushConstants {
    /// The push constants of the wave that traces `first_path .. first_path + path_count` of an image of `pixels`
    /// pixels, in round 0 with `arg0` and flags 0. `pixels` of 0 counts as 1. Sample numbers wrap at 2^32.
    #[must_use]
    pub fn wave(frame: u64, first_path: u64, path_count: u32, pixels: u32) -> Self {
        let pixels = u64::from(pixels.max(1));
        let low = |value: u64| u32::try_from(value & u64::from(u32::MAX)).unwrap_or_default();
        Self {
            frame,
            first_pixel: low(first_path % pixels),
            first_sample: low(first_path / pixels),
            path_count,
            round: 0,
            arg0: 0,
            flags: 0,
        }
    }

    /// The same wave in another round and with another `arg0`.
    #[must_use]
    pub fn with(self, round: u32, arg0: u32) -> Self {
        Self { round, arg0, ..self }
    }

    /// The same wave in band `band` of the list of entries, `row` rows further on ([`super::Features::ADAPTIVE`]).
    #[must_use]
    pub fn in_band(self, band: u32, row: u32) -> Self {
        Self { first_sample: pack_band(band, self.first_sample + row), ..self }
    }

    /// The same wave with rays of the kind that `flags` say.
    #[must_use]
    pub fn flagged(self, flags: PushFlags) -> Self {
        Self { flags: flags.bits(), ..self }
    }

    /// For `generate_*` with streaming: the paths become segment `segment` (below 2^24) and take `path_count` free
    /// slots. `taken` slots were taken before, of `slots`; the caller knows that `taken + path_count <= slots + freed`,
    /// and that no multiple of `slots` lies between.
    #[must_use]
    pub fn into_slots(self, segment: u32, taken: u64, slots: u32) -> Self {
        let slots = u64::from(slots.max(1));
        let fresh = if taken < slots { PushFlags::FRESH.bits() } else { 0 };
        let arg0 = u32::try_from(taken % slots).unwrap_or_default();
        Self { arg0, flags: self.flags | fresh | segment << PUSH_SEGMENT_SHIFT, ..self }
    }
}
