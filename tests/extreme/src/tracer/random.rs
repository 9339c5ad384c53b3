// SPDX-License-Identifier: Apache-2.0
//! Xoshiro256** (Blackman and Vigna 2021), seeded by a Weyl sequence; nothing in common with the product's sampler.

use std::f64::consts::TAU;

use glam::DVec3;

/// A stream of uniform numbers.
pub(crate) struct Random([u64; 4]);

impl Random {
    /// The stream number `stream` of `seed`.
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        let mut x = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ stream.wrapping_mul(0xd134_2543_de82_ef95);
        let state = [0, 1, 2, 3].map(|_| {
            x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let y = (x ^ (x >> 32)).wrapping_mul(0xd6e8_feb8_6659_fd93);
            let z = (y ^ (y >> 32)).wrapping_mul(0xd6e8_feb8_6659_fd93);
            z ^ (z >> 32) | 1
        });
        Self(state)
    }

    fn next(&mut self) -> u64 {
        let s = &mut self.0;
        let result = s[1].wrapping_mul(5).rotate_left(7).wrapping_mul(9);
        let t = s[1] << 17;
        s[2] ^= s[0];
        s[3] ^= s[1];
        s[1] ^= s[2];
        s[0] ^= s[3];
        s[2] ^= t;
        s[3] = s[3].rotate_left(45);
        result
    }

    /// In 0 to 1, 1 excluded, 53 bits.
    pub(crate) fn uniform(&mut self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
        let bits = (self.next() >> 11) as f64;
        bits / 9_007_199_254_740_992.0
    }

    /// Distributed by the cosine about the unit vector `n`: a point of a sphere that touches the surface (Lambert's
    /// cosine law).
    pub(crate) fn cosine(&mut self, n: DVec3) -> DVec3 {
        let z = 2.0 * self.uniform() - 1.0;
        let (sin, cos) = (TAU * self.uniform()).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        (n + DVec3::new(r * cos, r * sin, z)).normalize_or(n)
    }

    /// Uniform in the cone about the unit vector `axis` with this `1 - cos` of its half angle.
    pub(crate) fn cone(&mut self, axis: DVec3, one_minus_cos: f64) -> DVec3 {
        let h = self.uniform() * one_minus_cos;
        let r = (h * (2.0 - h)).max(0.0).sqrt();
        let (sin, cos) = (TAU * self.uniform()).sin_cos();
        let (x, y) = axis.any_orthonormal_pair();
        (x * (r * cos) + y * (r * sin) + axis * (1.0 - h)).normalize()
    }
}
