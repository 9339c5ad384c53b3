// SPDX-License-Identifier: Apache-2.0
//! A plain path tracer: the definition of light transport that OocPT's pictures are held to.
//!
//! Lambert surfaces lit by constant domes (found by cosine-sampled rays that escape) and distant lights (by shadow rays).
//! `displayOpacity` is the chance that a crossing stops a ray of any kind. A path has one camera hit and at most
//! `max_bounces` further ones; each of them gathers the light that reaches it directly. No Russian roulette, no MIS: slow, but
//! there is little to get wrong. Colour is premultiplied; alpha is 1 where the camera ray stops or sees a visible dome.

use glam::{DVec2, DVec3, DVec4};
use oocpt_core::camera::Camera;
use oocpt_core::scene::snapshot::{Light, Snapshot};
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
        Self {
            samples: 256,
            max_bounces: 5,
            seed: 1,
            default_albedo: 0.18,
            clear: [0.0; 4],
        }
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
    let tracer = Tracer {
        world,
        lights: &snapshot.lights,
        options,
    };
    let pixels: Vec<(DVec4, DVec4)> = (0..width * height)
        .into_par_iter()
        .map(|index| tracer.pixel(&rays, index, width))
        .collect();
    let image = |read: &dyn Fn(&(DVec4, DVec4)) -> DVec4| {
        let data = pixels
            .iter()
            .flat_map(|pixel| read(pixel).as_vec4().to_array())
            .collect();
        Image {
            width,
            height,
            channels: 4,
            data,
        }
    };
    Ok(Reference {
        mean: image(&|p| p.0),
        variance: image(&|p| p.1),
        samples: options.samples,
    })
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
            let (geometric, shading) = towards(&surface, ray.direction);
            let albedo = surface.color.unwrap_or(DVec3::splat(self.options.default_albedo));
            throughput *= albedo;
            let start = surface.position + geometric * (1e-9 * (1.0 + surface.position.abs().max_element()));
            radiance += throughput * self.distant(start, (geometric, shading), random);
            let direction = random.cosine_hemisphere(shading);
            if direction.dot(geometric) <= 0.0 {
                break;
            }
            ray = Ray {
                origin: start,
                direction,
            };
        }
        radiance.extend(1.0)
    }

    fn background(&self) -> DVec4 {
        let visible = |light: &Light| {
            matches!(
                light,
                Light::Dome {
                    camera_visible: true,
                    ..
                }
            )
        };
        if self.lights.iter().any(visible) {
            self.dome(true).extend(1.0)
        } else {
            DVec4::from(self.options.clear)
        }
    }

    fn dome(&self, seen_by_camera: bool) -> DVec3 {
        let radiance = self.lights.iter().filter_map(|light| match light {
            Light::Dome {
                radiance,
                camera_visible,
            } if *camera_visible || !seen_by_camera => Some(radiance),
            _ => None,
        });
        radiance.map(|radiance| DVec3::from(radiance.map(f64::from))).sum()
    }

    /// Light from all distant lights that leaves a white surface at `start`: irradiance / pi.
    fn distant(&self, start: DVec3, (geometric, shading): (DVec3, DVec3), random: &mut Random) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for light in self.lights {
            let Light::Distant {
                direction,
                radiance,
                cos_half_angle,
            } = light
            else {
                continue;
            };
            let axis = DVec3::from(direction.map(f64::from)).normalize();
            let cosine_bound = f64::from(*cos_half_angle);
            let (towards_light, solid_angle) = if cosine_bound >= 1.0 {
                (axis, 1.0)
            } else {
                (
                    random.cone(axis, cosine_bound),
                    std::f64::consts::TAU * (1.0 - cosine_bound),
                )
            };
            let cosine = towards_light.dot(shading);
            if cosine <= 0.0 || towards_light.dot(geometric) <= 0.0 {
                continue;
            }
            let shadow_ray = Ray {
                origin: start,
                direction: towards_light,
            };
            if self
                .world
                .nearest_opaque(&shadow_ray, |opacity| random.uniform() < opacity)
                .is_none()
            {
                let radiance = DVec3::from(radiance.map(f64::from));
                sum += radiance * (cosine * solid_angle * std::f64::consts::FRAC_1_PI);
            }
        }
        sum
    }
}

/// The normals on the side the ray comes from: both sides of a surface reflect.
fn towards(surface: &Surface, direction: DVec3) -> (DVec3, DVec3) {
    let flip = |normal: DVec3| if normal.dot(direction) > 0.0 { -normal } else { normal };
    let geometric = flip(surface.geometric_normal);
    let shading = surface.shading_normal;
    (
        geometric,
        if shading.dot(geometric) < 0.0 {
            -shading
        } else {
            shading
        },
    )
}
