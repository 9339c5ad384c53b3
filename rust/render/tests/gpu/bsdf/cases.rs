// SPDX-License-Identifier: Apache-2.0
//! The cases of the BSDF's tests: parameters, normals, directions; and the random ones.

use glam::DVec3;
use std::f64::consts::TAU;

pub(super) const CASE_FLOATS: usize = 64;
/// The flag `SHADING_SPECULAR_WORKFLOW`.
pub(super) const SPECULAR_WORKFLOW: u32 = 1;

/// A fibre along x; counts with its flag.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hair {
    /// Tints of R, TT, TRT.
    pub(crate) tints: [DVec3; 3],
    pub(crate) absorption: DVec3,
    /// Variances of R, TT, TRT; the next field has the same order.
    pub(crate) variance: DVec3,
    pub(crate) spread: DVec3,
    pub(crate) tilt: f64,
    /// Outside of -1..1 the normal determines the offset.
    pub(crate) offset: f64,
}

impl Default for Hair {
    fn default() -> Self {
        Self {
            tints: [DVec3::ONE; 3],
            absorption: DVec3::ZERO,
            variance: DVec3::splat(0.1),
            spread: DVec3::splat(0.1),
            tilt: 0.0,
            offset: 2.0,
        }
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Case {
    pub(super) g: DVec3,
    pub(super) n: DVec3,
    pub(super) wo: DVec3,
    pub(super) wi: DVec3,
    pub(super) u: [f32; 3],
    pub(super) diffuse: DVec3,
    pub(super) specular: DVec3,
    pub(super) metallic: f64,
    pub(super) roughness: f64,
    pub(super) ior: f64,
    pub(super) coat: f64,
    pub(super) coat_roughness: f64,
    pub(super) opacity: f64,
    pub(super) flags: u32,
    /// Colour of sheen; only counts on a device with its lobe.
    pub(super) sheen: DVec3,
    pub(super) sheen_roughness: f64,
    /// Ratio and turn of the base, of the coat; the tangent is the x axis. They only count on a device with their
    /// lobes, as the fields below do.
    pub(super) anisotropy: [f64; 4],
    /// Weight, thickness in nm, index.
    pub(super) film: DVec3,
    pub(super) diffuse_roughness: f64,
    pub(super) hair: Hair,
}

impl Default for Case {
    /// A white material with `UsdPreviewSurface`'s defaults for the rest; seen and lit from above.
    fn default() -> Self {
        Self {
            g: DVec3::Z,
            n: DVec3::Z,
            wo: DVec3::Z,
            wi: DVec3::Z,
            u: [0.5; 3],
            diffuse: DVec3::ONE,
            specular: DVec3::ZERO,
            metallic: 0.0,
            roughness: 0.5,
            ior: 1.5,
            coat: 0.0,
            coat_roughness: 0.01,
            opacity: 1.0,
            flags: 0,
            sheen: DVec3::ZERO,
            sheen_roughness: 0.5,
            anisotropy: [1.0, 0.0, 1.0, 0.0],
            film: DVec3::ZERO,
            diffuse_roughness: 0.0,
            hair: Hair::default(),
        }
    }
}

impl Case {
    #[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "the shader has f32")]
    pub(super) fn floats(&self) -> [f32; CASE_FLOATS] {
        let mut floats = [0.0; CASE_FLOATS];
        for (i, v) in [self.g, self.n, self.wo, self.wi].into_iter().enumerate() {
            floats[3 * i..3 * i + 3].copy_from_slice(&v.as_vec3().to_array());
        }
        floats[12..15].copy_from_slice(&self.u);
        floats[16..19].copy_from_slice(&self.diffuse.as_vec3().to_array());
        floats[19] = self.metallic as f32;
        floats[20..23].copy_from_slice(&self.specular.as_vec3().to_array());
        floats[23] = self.roughness as f32;
        floats[27] = self.ior as f32;
        floats[28..31].copy_from_slice(&[self.coat, self.coat_roughness, self.opacity].map(|x| x as f32));
        floats[31] = self.flags as f32;
        floats[32..35].copy_from_slice(&self.sheen.as_vec3().to_array());
        floats[35] = self.sheen_roughness as f32;
        floats[36..40].copy_from_slice(&self.anisotropy.map(|x| x as f32));
        floats[40..43].copy_from_slice(&self.film.as_vec3().to_array());
        floats[43] = self.diffuse_roughness as f32;
        let Hair { tints: [r, tt, trt], absorption, variance, spread, tilt, offset } = self.hair;
        for (i, v) in [r, tt, trt, absorption, variance, spread].into_iter().enumerate() {
            floats[44 + 3 * i..47 + 3 * i].copy_from_slice(&v.as_vec3().to_array());
        }
        floats[62] = tilt as f32;
        floats[63] = offset as f32;
        floats
    }

    /// The case as the shader receives it: every number rounded to f32.
    pub(super) fn rounded(mut self) -> Self {
        for v in [
            &mut self.g,
            &mut self.n,
            &mut self.wo,
            &mut self.wi,
            &mut self.diffuse,
            &mut self.specular,
            &mut self.sheen,
            &mut self.film,
            &mut self.hair.absorption,
            &mut self.hair.variance,
            &mut self.hair.spread,
        ]
        .into_iter()
        .chain(&mut self.hair.tints)
        {
            *v = v.as_vec3().as_dvec3();
        }
        let numbers = [&mut self.metallic, &mut self.roughness, &mut self.ior, &mut self.coat];
        for x in numbers
            .into_iter()
            .chain([&mut self.coat_roughness, &mut self.opacity, &mut self.sheen_roughness])
            .chain(&mut self.anisotropy)
            .chain([&mut self.diffuse_roughness, &mut self.hair.tilt, &mut self.hair.offset])
        {
            #[expect(clippy::cast_possible_truncation, reason = "the purpose")]
            let single = *x as f32;
            *x = f64::from(single);
        }
        self
    }
}

/// The direction at a cosine with z and an angle about it.
pub(super) fn direction(cosine: f64, angle: f64) -> DVec3 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    DVec3::new(sine * angle.cos(), sine * angle.sin(), cosine)
}

/// `SplitMix64` (Steele et al. 2014).
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A random number in 0..1.
    #[expect(clippy::cast_precision_loss, reason = "24 bits")]
    pub(super) fn unit(&mut self) -> f64 {
        (self.bits() >> 40) as f64 / f64::from(1 << 24)
    }

    pub(super) fn units(&mut self) -> [f32; 3] {
        #[expect(clippy::cast_possible_truncation, reason = "24 bits fit")]
        std::array::from_fn(|_| self.unit() as f32)
    }

    pub(super) fn pick(&mut self, from: &[f64]) -> f64 {
        #[expect(clippy::cast_possible_truncation, reason = "a remainder")]
        let index = (self.bits() % from.len() as u64) as usize;
        from[index]
    }

    pub(super) fn color(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }

    /// A direction on the hemisphere of z, more often near the horizon than uniform.
    pub(super) fn above(&mut self) -> DVec3 {
        let cosine = self.unit().powi(2).max(1e-3);
        direction(cosine, TAU * self.unit())
    }

    /// A case of random parameters; both directions above a flat surface.
    pub(super) fn case(&mut self) -> Case {
        Case {
            wo: self.above(),
            wi: self.above(),
            u: self.units(),
            diffuse: self.color(),
            specular: self.color(),
            metallic: self.pick(&[0.0, 1.0]).max(self.unit() - 0.5),
            roughness: self.unit(),
            ior: 1.0 + 2.0 * self.unit(),
            coat: self.pick(&[0.0, 1.0]) * self.unit(),
            coat_roughness: self.unit(),
            opacity: self.pick(&[1.0, 0.0, 0.5]).max(self.unit() - 0.5),
            flags: u32::from(self.unit() < 0.3) * SPECULAR_WORKFLOW,
            ..Case::default()
        }
    }
}
