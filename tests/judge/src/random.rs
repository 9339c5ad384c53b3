// SPDX-License-Identifier: Apache-2.0
//! `SplitMix64` (Steele, Lea, Flood 2014): independent random numbers, nothing in common with the product's Sobol
//! points.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

/// One stream of uniform numbers. Copy-free, deterministic in its key.
#[derive(Debug)]
pub(crate) struct Random {
    state: u64,
}

impl Random {
    /// The stream of one pixel sample.
    pub(crate) fn new(seed: u64, pixel: u64, sample: u64) -> Self {
        let mut stream = Self { state: seed };
        for key in [pixel, sample] {
            stream.state = stream.next_u64() ^ key.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
        stream
    }

    fn next_u64(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in `[0, 1)`, 53 bits.
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Uniform on the unit disk (polar map).
    pub(crate) fn disk(&mut self) -> DVec2 {
        let radius = self.uniform().sqrt();
        DVec2::from_angle(TAU * self.uniform()) * radius
    }

    /// Cosine-distributed about the unit vector `normal`: pdf = cos / pi.
    pub(crate) fn cosine_hemisphere(&mut self, normal: DVec3) -> DVec3 {
        let disk = self.disk();
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let height = (1.0 - disk.length_squared()).max(0.0).sqrt();
        (tangent * disk.x + bitangent * disk.y + normal * height).normalize()
    }

    /// Uniform in the cone about the unit vector `axis`: pdf = 1 / (2 pi (1 - cos)).
    pub(crate) fn cone(&mut self, axis: DVec3, cos_half_angle: f64) -> DVec3 {
        let cosine = 1.0 - self.uniform() * (1.0 - cos_half_angle);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let angle = TAU * self.uniform();
        let (tangent, bitangent) = axis.any_orthonormal_pair();
        (tangent * (sine * angle.cos()) + bitangent * (sine * angle.sin()) + axis * cosine).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_have_the_moments_their_densities_say() {
        let axis = DVec3::new(0.3, -0.5, 0.8).normalize();
        let mut random = Random::new(1, 2, 3);
        let count = 200_000;
        let (mut cosine, mut cone) = (0.0, 0.0);
        for _ in 0..count {
            cosine += random.cosine_hemisphere(axis).dot(axis);
            cone += random.cone(axis, 0.5).dot(axis);
        }
        assert!((cosine / f64::from(count) - 2.0 / 3.0).abs() < 2e-3, "E[cos] of a cosine lobe is 2/3");
        assert!((cone / f64::from(count) - 0.75).abs() < 2e-3, "E[cos] of a uniform cone is the middle of its range");
    }

    #[test]
    fn streams_differ_by_every_key() {
        let first = |seed, pixel, sample| Random::new(seed, pixel, sample).uniform().to_bits();
        let keys = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 1, 1)];
        for (i, a) in keys.iter().enumerate() {
            for b in &keys[i + 1..] {
                assert_ne!(first(a.0, a.1, a.2), first(b.0, b.1, b.2), "{a:?} and {b:?} share a stream");
            }
        }
    }
}
