// SPDX-License-Identifier: Apache-2.0
//! A plain path tracer: the definition of light transport that OocPT's pictures are held to.
//!
//! Lambert surfaces lit by constant domes (found by cosine-sampled rays that escape) and distant lights (by shadow
//! rays). With a shading normal the cosine lobe is about that one, and what of it falls below the true surface is
//! mirrored at it, so that no light is lost. Albedo is clamped to `[0, 1]`. `displayOpacity` is the chance that a
//! crossing stops a ray of any kind. A path has one camera hit and at most `max_bounces` further ones; each of them
//! gathers the light that reaches it directly. No Russian roulette, no MIS: slow, but there is little to get wrong.
//! Colour is premultiplied; alpha is 1 where the camera ray stops or sees a visible dome.

use glam::{DVec2, DVec3, DVec4};
use oocpt_core::camera::Camera;
use oocpt_core::scene::snapshot::{Light, LightEmitter, Snapshot};
use rayon::prelude::*;

use crate::JudgeError;
use crate::camera::{PixelRays, Ray};
use crate::image::Image;
use crate::random::Random;
use crate::world::{Surface, World};

/// How much work the judge does, and what it assumes.
#[derive(Debug, Clone, Copy)]
pub struct PathTracerOptions {
    /// Independent samples per pixel.
    pub samples: u32,
    /// Indirect bounces; 0 = direct light only.
    pub max_bounces: u32,
    /// Key of all random numbers.
    pub seed: u64,
    /// Albedo of a mesh without `displayColor`.
    pub default_albedo: f64,
    /// What a camera ray sees where there is nothing: red, green, blue, alpha.
    pub clear: [f64; 4],
}

impl Default for PathTracerOptions {
    fn default() -> Self {
        Self { samples: 256, max_bounces: 5, seed: 1, default_albedo: 0.18, clear: [0.0; 4] }
    }
}

/// Mean of every pixel and channel (RGBA), and the variance of one sample.
#[derive(Debug, Clone)]
pub struct Reference {
    /// Mean over the samples.
    pub mean: Image,
    /// Unbiased variance of a single sample.
    pub variance: Image,
    /// Number of samples behind the mean.
    pub samples: u32,
}

/// Renders the snapshot.
///
/// # Errors
/// [`JudgeError::Singular`] for a camera without inverse.
pub fn path_trace(
    world: &World,
    snapshot: &Snapshot,
    camera: &Camera,
    options: &PathTracerOptions,
) -> Result<Reference, JudgeError> {
    let rays = PixelRays::new(camera, snapshot.origin)?;
    let (width, height) = rays.size();
    let tracer = Tracer { world, lights: &snapshot.lights, options };
    let pixels: Vec<(DVec4, DVec4)> =
        (0..width * height).into_par_iter().map(|index| tracer.pixel(&rays, index, width)).collect();
    let image = |read: &dyn Fn(&(DVec4, DVec4)) -> DVec4| {
        let data = pixels.iter().flat_map(|pixel| read(pixel).as_vec4().to_array()).collect();
        Image { width, height, channels: 4, data }
    };
    Ok(Reference { mean: image(&|p| p.0), variance: image(&|p| p.1), samples: options.samples })
}

struct Tracer<'a> {
    world: &'a World,
    lights: &'a [Light],
    options: &'a PathTracerOptions,
}

impl Tracer<'_> {
    fn pixel(&self, rays: &PixelRays, index: usize, width: usize) -> (DVec4, DVec4) {
        let corner = DVec2::new((index % width) as f64, (index / width) as f64);
        let (mut mean, mut squares) = (DVec4::ZERO, DVec4::ZERO);
        for sample in 0..self.options.samples {
            let mut random = Random::new(self.options.seed, index as u64, u64::from(sample));
            let jitter = DVec2::new(random.uniform(), random.uniform());
            let disk = random.disk();
            let value = self.radiance(rays.through_lens(corner + jitter, disk), &mut random);
            // Welford's update.
            let difference = value - mean;
            mean += difference / f64::from(sample + 1);
            squares += difference * (value - mean);
        }
        (mean, squares / f64::from(self.options.samples.saturating_sub(1).max(1)))
    }

    fn radiance(&self, camera_ray: Ray, random: &mut Random) -> DVec4 {
        let (mut ray, mut throughput, mut radiance) = (camera_ray, DVec3::ONE, DVec3::ZERO);
        for vertex in 0..=self.options.max_bounces.saturating_add(1) {
            let Some(hit) = self.world.nearest_opaque(&ray, |opacity| random.uniform() < opacity) else {
                if vertex == 0 {
                    return self.background();
                }
                radiance += throughput * self.dome(false);
                break;
            };
            // The last vertex may see the dome, but is not lit itself.
            if vertex > self.options.max_bounces {
                break;
            }
            let surface = self.world.surface(&ray, &hit);
            let lobe = Lobe::new(&surface, ray.direction);
            let albedo = surface.color.unwrap_or(DVec3::splat(self.options.default_albedo));
            throughput *= albedo.clamp(DVec3::ZERO, DVec3::ONE);
            let start = surface.position + lobe.geometric * (1e-9 * (1.0 + surface.position.abs().max_element()));
            radiance += throughput * self.distant(start, &lobe, random);
            ray = Ray { origin: start, direction: lobe.sample(random) };
        }
        radiance.extend(1.0)
    }

    fn background(&self) -> DVec4 {
        let visible = |light: &Light| light.camera_visible && matches!(light.emitter, LightEmitter::Dome { .. });
        if self.lights.iter().any(visible) { self.dome(true).extend(1.0) } else { DVec4::from(self.options.clear) }
    }

    fn dome(&self, seen_by_camera: bool) -> DVec3 {
        let radiance = self.lights.iter().filter_map(|light| match &light.emitter {
            LightEmitter::Dome { .. } if light.camera_visible || !seen_by_camera => Some(light.radiance),
            _ => None,
        });
        radiance.map(|radiance| DVec3::from(radiance.map(f64::from))).sum()
    }

    /// Light from all distant lights that leaves a white surface at `start`: the integral of radiance times the lobe.
    fn distant(&self, start: DVec3, lobe: &Lobe, random: &mut Random) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for light in self.lights {
            let LightEmitter::Distant { direction, one_minus_cos } = &light.emitter else {
                continue;
            };
            let axis = DVec3::from(direction.map(f64::from)).normalize();
            let one_minus_cos = f64::from(*one_minus_cos);
            let (towards_light, solid_angle) = if one_minus_cos <= 0.0 {
                (axis, 1.0)
            } else {
                (random.cone(axis, 1.0 - one_minus_cos), std::f64::consts::TAU * one_minus_cos)
            };
            let density = lobe.density(towards_light);
            if density <= 0.0 {
                continue;
            }
            let shadow_ray = Ray { origin: start, direction: towards_light };
            if self.world.nearest_opaque(&shadow_ray, |opacity| random.uniform() < opacity).is_none() {
                sum += DVec3::from(light.radiance.map(f64::from)) * (density * solid_angle);
            }
        }
        sum
    }
}

/// Reflection of a white surface: cosine over pi about the shading normal, mirrored up where it falls below the
/// surface.
struct Lobe {
    geometric: DVec3,
    shading: DVec3,
}

impl Lobe {
    /// Both normals on the side that the ray comes from: both sides of a surface reflect.
    fn new(surface: &Surface, direction: DVec3) -> Self {
        let flip = |normal: DVec3, wrong: bool| if wrong { -normal } else { normal };
        let geometric = flip(surface.geometric_normal, surface.geometric_normal.dot(direction) > 0.0);
        let shading = flip(surface.shading_normal, surface.shading_normal.dot(geometric) < 0.0);
        Self { geometric, shading }
    }

    fn mirrored(&self, direction: DVec3) -> DVec3 {
        direction - self.geometric * (2.0 * self.geometric.dot(direction))
    }

    fn density(&self, direction: DVec3) -> f64 {
        if direction.dot(self.geometric) <= 0.0 {
            return 0.0;
        }
        let cosines = direction.dot(self.shading).max(0.0) + self.mirrored(direction).dot(self.shading).max(0.0);
        cosines * std::f64::consts::FRAC_1_PI
    }

    fn sample(&self, random: &mut Random) -> DVec3 {
        let direction = random.cosine_hemisphere(self.shading);
        if direction.dot(self.geometric) < 0.0 { self.mirrored(direction) } else { direction }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilted_lobe_loses_nothing_and_samples_its_density() {
        let lobe = Lobe { geometric: DVec3::Z, shading: DVec3::new(0.8, 0.0, 0.6) };
        let mut random = Random::new(3, 0, 0);
        let count = 400_000;
        let (mut integral, mut by_density, mut by_sampling) = (0.0, 0.0, 0.0);
        for _ in 0..count {
            let uniform = random.cone(DVec3::Z, 0.0);
            let weight = lobe.density(uniform) * std::f64::consts::TAU;
            integral += weight;
            by_density += weight * uniform.x;
            by_sampling += lobe.sample(&mut random).x;
        }
        let mean = |sum: f64| sum / f64::from(count);
        assert!((mean(integral) - 1.0).abs() < 5e-3, "the lobe integrates to {}", mean(integral));
        assert!(
            (mean(by_density) - mean(by_sampling)).abs() < 5e-3,
            "{} against {}",
            mean(by_density),
            mean(by_sampling)
        );
    }
}
