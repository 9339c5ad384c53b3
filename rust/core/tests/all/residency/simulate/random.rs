// SPDX-License-Identifier: Apache-2.0
//! Random numbers as a function of their keys, so that no order of events changes them.

/// A stream of numbers (`SplitMix64`; Steele, Lea, Flood 2014).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Random(u64);

impl Random {
    /// A stream of its own for each set of keys.
    pub(crate) fn of(keys: [u64; 3]) -> Self {
        let mut random = Self(0);
        for key in keys {
            random.0 ^= key;
            random.0 = random.bits();
        }
        random
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Below `count`, 0 for a count of 0.
    pub(crate) fn below(&mut self, count: u32) -> u32 {
        let wide = (self.bits() >> 32) * u64::from(count);
        u32::try_from(wide >> 32).unwrap_or(0)
    }

    /// In 0..1.
    pub(crate) fn fraction(&mut self) -> f64 {
        f64::from(u32::try_from(self.bits() >> 32).unwrap_or(0)) / 4_294_967_296.0
    }

    /// Below `count`, small numbers far more often: about half of all below the square root of `count`, as of a Zipf
    /// distribution of exponent 1.
    pub(crate) fn zipf(&mut self, count: u32) -> u32 {
        let octaves = u32::BITS - count.leading_zeros();
        let top = 1_u32 << self.below(octaves).min(31);
        (top - 1 + self.below(top)).min(count.saturating_sub(1))
    }
}
