// SPDX-License-Identifier: Apache-2.0
//! The limits of a deep image: how many samples a pixel has at most, and which are one. Pure.

use std::fmt;

/// Most samples of a pixel, unless a product says another number.
const USUAL_SAMPLES: u8 = 16;
/// Largest difference of depths, as a part of the depth, of samples of one thing that are one.
const USUAL_TOLERANCE: f32 = 1e-3;

/// How many samples a pixel of a deep image has at most, and which samples of one thing are one: those whose depths
/// differ by less than a part of the depth, or by less than a distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct DeepLimits {
    samples: u8,
    /// Bits of the part and of the distance: floats that are not negative are in the order of their bits.
    depths: [u32; 2],
}

impl Default for DeepLimits {
    fn default() -> Self {
        Self { samples: USUAL_SAMPLES, depths: [USUAL_TOLERANCE.to_bits(), 0] }
    }
}

impl DeepLimits {
    /// Most samples that a pixel may have: 32 bytes each, twice on the device.
    pub const MAX_SAMPLES: u8 = 64;

    /// These limits with another number of samples; `None` unless it is in 1..=64.
    #[must_use]
    pub fn with_samples(self, samples: u8) -> Option<Self> {
        (1..=Self::MAX_SAMPLES).contains(&samples).then_some(Self { samples, ..self })
    }

    /// These limits with other tolerances: a part of the depth, and a distance in units of the scene. `None` if one is
    /// negative or no number.
    #[must_use]
    pub fn with_depths(self, part: f32, distance: f32) -> Option<Self> {
        let is_valid = |depth: f32| depth.is_finite() && depth >= 0.0;
        // -0 is 0.
        (is_valid(part) && is_valid(distance))
            .then(|| Self { depths: [part, distance].map(|d| d.abs().to_bits()), ..self })
    }

    /// Most samples of a pixel.
    #[must_use]
    pub fn samples(self) -> u8 {
        self.samples
    }

    /// The tolerances: a part of the depth, and a distance.
    #[must_use]
    pub fn depths(self) -> [f32; 2] {
        self.depths.map(f32::from_bits)
    }

    /// Limits that have all that an image of either limits has: as many samples as the one with more, as close as the
    /// one with smaller tolerances.
    #[must_use]
    pub(crate) fn finer(self, other: Self) -> Self {
        let [a, b] = [self.depths, other.depths];
        Self { samples: self.samples.max(other.samples), depths: [a[0].min(b[0]), a[1].min(b[1])] }
    }
}

impl fmt::Display for DeepLimits {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [part, distance] = self.depths();
        write!(out, "{}:{part}:{distance}", self.samples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_numbers_that_make_sense() {
        let usual = DeepLimits::default();
        assert!([0, 65].iter().all(|samples| usual.with_samples(*samples).is_none()));
        assert_eq!(usual.with_samples(64).map(DeepLimits::samples), Some(64));
        for wrong in [-1.0, f32::NAN, f32::INFINITY] {
            assert!(usual.with_depths(wrong, 0.0).is_none() && usual.with_depths(0.0, wrong).is_none(), "{wrong}");
        }
        assert_eq!(usual.with_depths(-0.0, 0.0), usual.with_depths(0.0, -0.0), "one zero");
    }

    #[test]
    fn an_image_of_two_limits_has_what_either_has() {
        let usual = DeepLimits::default();
        let few = usual.with_samples(2).and_then(|limits| limits.with_depths(0.0, 0.5)).expect("limits");
        let both = few.finer(usual);
        assert_eq!((both.samples(), both.depths()), (16, [0.0, 0.0]));
        assert_eq!(both, usual.finer(few));
    }
}
