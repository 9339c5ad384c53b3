// SPDX-License-Identifier: Apache-2.0
//! Random numbers that are a function of their key, and smooth noise. Pure; any thread.

/// A stream of numbers that belongs to a key: the same key gives the same stream, whoever asks and in which order.
#[derive(Clone, Debug)]
pub(crate) struct Random(u64);

/// The finaliser of `SplitMix64` (Steele, Lea, Flood 2014).
fn mix(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// One number for several.
pub(crate) fn hash(key: &[u64]) -> u64 {
    key.iter().fold(0x9e37_79b9_7f4a_7c15, |state, part| mix(state ^ mix(part.wrapping_add(0x9e37_79b9_7f4a_7c15))))
}

impl Random {
    /// The stream of `key`.
    pub(crate) fn new(key: &[u64]) -> Self {
        Self(hash(key))
    }

    /// 64 random bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        unit(self.bits())
    }

    /// Evenly between two bounds.
    pub(crate) fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// An angle in radians.
    pub(crate) fn angle(&mut self) -> f64 {
        self.unit() * std::f64::consts::TAU
    }

    /// Normally distributed with mean 0 and deviation 1 (Box and Muller 1958).
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * self.angle().cos()
    }

    /// A random direction.
    pub(crate) fn direction(&mut self) -> glam::DVec3 {
        let (y, angle) = (self.range(-1.0, 1.0), self.angle());
        let radius = (1.0 - y * y).sqrt();
        glam::DVec3::new(radius * angle.cos(), y, radius * angle.sin())
    }
}

fn unit(bits: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "53 bits are exact in f64")]
    let value = (bits >> 11) as f64 / (1_u64 << 53) as f64;
    value
}

/// Smooth value noise in the plane, summed over octaves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    /// Value of one lattice point, -1 to 1.
    fn lattice(self, x: f64, z: f64) -> f64 {
        2.0 * unit(hash(&[self.0, x.to_bits(), z.to_bits()])) - 1.0
    }

    fn once(self, x: f64, z: f64) -> f64 {
        // Adding zero makes -0 the same lattice point as 0.
        let (ix, iz) = (x.floor() + 0.0, z.floor() + 0.0);
        let fade = |t: f64| t * t * t * (t * (6.0 * t - 15.0) + 10.0);
        let (fx, fz) = (fade(x - ix), fade(z - iz));
        let row = |dz: f64| {
            let (a, b) = (self.lattice(ix, iz + dz), self.lattice(ix + 1.0, iz + dz));
            a + (b - a) * fx
        };
        let (near, far) = (row(0.0), row(1.0));
        near + (far - near) * fz
    }

    /// About -1 to 1, deviation about 0.35; features as large as `wavelength` and smaller.
    pub(crate) fn at(self, x: f64, z: f64, wavelength: f64, octaves: u32) -> f64 {
        let (mut total, mut weight, mut scale) = (0.0, 1.0, 1.0 / wavelength);
        for octave in 0..octaves {
            let (sin, cos) = (0.6 * f64::from(octave)).sin_cos();
            let (u, v) = (scale * (x * cos - z * sin), scale * (x * sin + z * cos));
            total += weight * self.once(u + 17.3 * f64::from(octave), v + 5.1 * f64::from(octave));
            weight *= 0.5;
            scale *= 2.0;
        }
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_belongs_to_its_key() {
        let draw = |key: &[u64]| {
            let mut random = Random::new(key);
            [random.unit(), random.unit(), random.normal()]
        };
        assert!(draw(&[1, 2]) == draw(&[1, 2]), "the same key twice");
        assert!(draw(&[1, 2]) != draw(&[2, 1]), "another key");
    }

    #[test]
    fn noise_is_continuous_and_varied() {
        let noise = Noise(3);
        let values: Vec<f64> = (0..4000_i32).map(|i| noise.at(f64::from(i) * 0.01 - 20.0, 0.3, 5.0, 4)).collect();
        let step = values.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
        let (low, high) = values.iter().fold((0.0_f64, 0.0_f64), |(l, h), &v| (l.min(v), h.max(v)));
        assert!(step < 0.1, "a step of {step} in a hundredth of a wavelength");
        assert!(low < -0.3 && high > 0.3, "between {low} and {high}");
    }
}
