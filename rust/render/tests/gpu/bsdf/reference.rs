// SPDX-License-Identifier: Apache-2.0
//! The BSDF in f64, written from its definition (head of `shaders/material/bsdf.glsl`) without its code: albedos by
//! quadrature over normals (not visible normals), half vectors normalised, cosines where the shader has sums of
//! squares. Opaque surfaces.

use super::cases::{Case, SPECULAR_WORKFLOW};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Schlick's two ends.
#[derive(Clone, Copy)]
struct Fresnel {
    f0: DVec3,
    f90: DVec3,
}

impl Fresnel {
    fn at(self, cosine: f64) -> DVec3 {
        self.f0 + (self.f90 - self.f0) * (1.0 - cosine).powi(5)
    }

    fn average(self) -> DVec3 {
        self.f0 * (20.0 / 21.0) + self.f90 / 21.0
    }
}

fn density(alpha: f64, cosine: f64) -> f64 {
    let a2 = alpha * alpha;
    a2 / (PI * (cosine * cosine * (a2 - 1.0) + 1.0).powi(2))
}

fn lambda(alpha: f64, cosine: f64) -> f64 {
    let tangent2 = (1.0 - cosine * cosine) / (cosine * cosine);
    0.5 * ((1.0 + alpha * alpha * tangent2).sqrt() - 1.0)
}

fn masking(alpha: f64, o: f64, i: f64) -> f64 {
    1.0 / (1.0 + lambda(alpha, o) + lambda(alpha, i))
}

/// A and B by quadrature over normals distributed with their density.
#[expect(clippy::cast_precision_loss, reason = "few points")]
fn albedo(alpha: f64, cosine: f64, steps: [usize; 2]) -> [f64; 2] {
    let o = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
    let own = lambda(alpha, cosine);
    // Sine and cosine of the normals' angles to the surface's.
    let slopes: Vec<[f64; 2]> = (0..steps[1])
        .map(|b| {
            let u = (b as f64 + 0.5) / steps[1] as f64;
            let tangent = alpha * (u / (1.0 - u)).sqrt();
            let z = 1.0 / (1.0 + tangent * tangent).sqrt();
            [tangent * z, z]
        })
        .collect();
    let mut sum = [0.0; 2];
    for a in 0..steps[0] {
        let (sin, cos) = (PI * (a as f64 + 0.5) / steps[0] as f64).sin_cos();
        for [sine, z] in &slopes {
            let h = DVec3::new(sine * cos, sine * sin, *z);
            let half = o.dot(h);
            let i = 2.0 * half * h - o;
            if half <= 0.0 || i.z <= 0.0 {
                continue;
            }
            let weight = half / ((1.0 + own + lambda(alpha, i.z)) * cosine * z);
            let schlick = (1.0 - half).powi(5);
            sum[0] += weight * (1.0 - schlick);
            sum[1] += weight * schlick;
        }
    }
    sum.map(|x| x / (steps[0] * steps[1]) as f64)
}

/// The albedo of a layer; exact for a mirror.
pub(super) fn layer_albedo(roughness: f64, cosine: f64) -> [f64; 2] {
    if roughness < 0.01 {
        let schlick = (1.0 - cosine).powi(5);
        return [1.0 - schlick, schlick];
    }
    albedo(roughness * roughness, cosine, [48, 480])
}

/// Points at which functions of the cosine are averaged over the hemisphere.
const STEPS: i32 = 96;

/// The average over the hemisphere of a function of the cosine, which also gets the number of the point.
fn average<const N: usize>(mut f: impl FnMut(usize, f64) -> [f64; N]) -> [f64; N] {
    let mut sum = [0.0; N];
    for (number, step) in (0..STEPS).enumerate() {
        let x = (f64::from(step) + 0.5) / f64::from(STEPS);
        let values = f(number, x.powi(3));
        for (sum, value) in sum.iter_mut().zip(values) {
            *sum += value * 6.0 * x.powi(5) / f64::from(STEPS);
        }
    }
    sum
}

pub(super) struct Reference {
    case: Case,
    fresnel: Fresnel,
    dielectric: Fresnel,
    dielectric_scatter: DVec3,
    coat: Fresnel,
    scatter: DVec3,
    base: DVec3,
    diffuse_norm: DVec3,
    scatter_norm: f64,
}

/// The layers below: U of the dielectric (rgb), U1, U of the coat.
struct Under {
    specular: DVec3,
    lost: f64,
    coat: f64,
}

impl Reference {
    pub(super) fn new(case: &Case) -> Self {
        let case = case.rounded();
        let r0 = ((1.0 - case.ior) / (1.0 + case.ior)).powi(2);
        let specular = case.flags & SPECULAR_WORKFLOW != 0;
        let metallic = if specular { 0.0 } else { case.metallic };
        let f0 = if specular { case.specular } else { DVec3::splat(r0) };
        let dielectric = Fresnel { f0, f90: DVec3::splat((1e3 * f0.max_element()).min(1.0)) };
        let metal = Fresnel { f0: case.diffuse, f90: case.diffuse };
        let fresnel =
            Fresnel { f0: dielectric.f0.lerp(metal.f0, metallic), f90: dielectric.f90.lerp(metal.f90, metallic) };
        let coat = Fresnel { f0: DVec3::splat(r0), f90: DVec3::splat((1e3 * r0).min(1.0)) };
        // Of the specular layer, at the points of the averages.
        let mut layer = Vec::new();
        let [a, b] = average(|_, c| {
            let albedo = layer_albedo(case.roughness, c);
            layer.push(albedo);
            albedo
        });
        let scattered = |fresnel: Fresnel| {
            let f = fresnel.average();
            if case.roughness < 0.01 { DVec3::ZERO } else { f * f * (a + b) / (DVec3::ONE - f * (1.0 - a - b)) }
        };
        let dielectric_scatter = scattered(dielectric);
        let scatter = dielectric_scatter.lerp(scattered(metal), metallic);
        let base = case.diffuse * (1.0 - metallic) * case.opacity;
        let (diffuse_norm, scatter_norm) = (DVec3::ONE, 1.0);
        let mut made =
            Self { case, fresnel, dielectric, dielectric_scatter, coat, scatter, base, diffuse_norm, scatter_norm };
        let [x, y, z, lost] = average(|number, c| {
            let under = made.under_layer(c, layer[number]);
            let all = under.specular * under.coat;
            [all.x, all.y, all.z, under.lost * under.coat]
        });
        made.diffuse_norm = DVec3::new(x, y, z);
        made.scatter_norm = lost;
        made
    }

    fn under(&self, cosine: f64) -> Under {
        self.under_layer(cosine, layer_albedo(self.case.roughness, cosine))
    }

    /// The layers below, for a known albedo of the specular layer.
    fn under_layer(&self, cosine: f64, [a, b]: [f64; 2]) -> Under {
        let [c, d] = if self.case.coat > 0.0 { layer_albedo(self.case.coat_roughness, cosine) } else { [0.0; 2] };
        let lost = 1.0 - a - b;
        let specular = DVec3::ONE - (self.dielectric.f0 * a + self.dielectric.f90 * b + self.dielectric_scatter * lost);
        Under { specular, lost, coat: 1.0 - self.case.coat * (self.coat.f0 * c + self.coat.f90 * d).x }
    }

    /// Diffuse, single and multiple specular scattering, each BSDF * cosine, for a flat surface with both directions
    /// above it.
    pub(super) fn evaluate(&self) -> [DVec3; 3] {
        let (o, i) = (self.case.wo, self.case.wi);
        let (above, below) = (self.under(o.z), self.under(i.z));
        let scale = i.z / PI * above.coat * below.coat;
        let diffuse = self.base * above.specular * below.specular / self.diffuse_norm * scale;
        let (mut specular, mut multiple) = (DVec3::ZERO, DVec3::ZERO);
        if self.case.roughness >= 0.01 {
            multiple = self.scatter * above.lost * below.lost / self.scatter_norm * scale;
            specular += self.lobe(self.case.roughness, self.fresnel) * above.coat.min(below.coat);
        }
        if self.case.coat_roughness >= 0.01 {
            specular += self.case.coat * self.lobe(self.case.coat_roughness, self.coat);
        }
        [diffuse, specular, multiple]
    }

    fn lobe(&self, roughness: f64, fresnel: Fresnel) -> DVec3 {
        let (o, i) = (self.case.wo, self.case.wi);
        let alpha = roughness * roughness;
        let h = (o + i).normalize();
        fresnel.at(o.dot(h)) * density(alpha, h.z) * masking(alpha, o.z, i.z) / (4.0 * o.z)
    }

    /// Densities of the coat's and the specular layer's visible normals, of the diffuse lobe, of multiple scattering.
    pub(super) fn densities(&self) -> [f64; 4] {
        let (o, i) = (self.case.wo, self.case.wi);
        let h = (o + i).normalize();
        let visible = |roughness: f64| {
            let alpha = roughness * roughness;
            if roughness < 0.01 { 0.0 } else { density(alpha, h.z) / (1.0 + lambda(alpha, o.z)) / (4.0 * o.z) }
        };
        let alpha = self.case.roughness.powi(2);
        let scattered = 1.0 / (TAU * (i.z + alpha) * (1.0 / alpha).ln_1p());
        [visible(self.case.coat_roughness), visible(self.case.roughness), i.z / PI, scattered]
    }
}
