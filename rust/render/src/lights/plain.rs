// SPDX-License-Identifier: Apache-2.0
//! Constant domes and distant lights: sums over the domes, a table of distant lights with a way to choose one.

use super::luminance;
use oocpt_core::scene::{Emitter, Light};
use oocpt_shader_abi::GpuDistantLight;

/// The constant domes and the distant lights of a snapshot.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PlainLights {
    /// Sum over the dome lights, linear radiance.
    pub(crate) dome_radiance: [f32; 3],
    /// Sum over the dome lights that the camera may see.
    pub(crate) dome_background: [f32; 3],
    /// Whether a dome is visible to the camera.
    pub(crate) background_visible: bool,
    /// Whether there is a dome at all.
    pub(crate) has_dome: bool,
    /// Probability of choosing the dome for a shadow ray.
    pub(crate) dome_select: f32,
    /// The distant lights, probabilities in proportion to their irradiance.
    pub(crate) distant: Vec<GpuDistantLight>,
}

impl PlainLights {
    /// Sorts the lights by kind. `camera_visible` is the setting that hides every dome from the camera when false.
    pub(crate) fn new(lights: &[Light], camera_visible: bool) -> Self {
        let mut table = Self::default();
        let mut powers = Vec::new();
        for light in lights {
            let radiance = light.radiance;
            match light.emitter {
                Emitter::Dome { .. } => {
                    table.has_dome = true;
                    add(&mut table.dome_radiance, radiance);
                    if light.camera_visible && camera_visible {
                        table.background_visible = true;
                        add(&mut table.dome_background, radiance);
                    }
                }
                Emitter::Local(_) => {}
                Emitter::Distant { direction, one_minus_cos } => {
                    let solid_angle = std::f64::consts::TAU * f64::from(one_minus_cos);
                    powers.push(luminance(radiance) * if one_minus_cos > 0.0 { solid_angle } else { 1.0 });
                    table.distant.push(GpuDistantLight {
                        direction,
                        one_minus_cos,
                        radiance,
                        probability: 0.0,
                        cumulative: 0.0,
                    });
                }
            }
        }
        table.choose(&powers);
        table
    }

    /// Sets the probabilities of choosing each light from the irradiance it can give.
    #[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "probabilities fit f32")]
    fn choose(&mut self, powers: &[f64]) {
        let total: f64 = powers.iter().sum();
        let even = 1.0 / powers.len().max(1) as f64;
        let mut cumulative = 0.0;
        for (light, power) in self.distant.iter_mut().zip(powers) {
            // A small even share keeps dim lights from starving: variance, not bias.
            let share = if total > 0.0 && total.is_finite() { 0.9 * power / total + 0.1 * even } else { even };
            cumulative += share;
            light.probability = share as f32;
            light.cumulative = cumulative as f32;
        }
        if let Some(last) = self.distant.last_mut() {
            last.cumulative = 1.0;
        }
        let dome = luminance(self.dome_radiance) * std::f64::consts::PI;
        self.dome_select = match (self.has_dome, self.distant.is_empty()) {
            (false, _) => 0.0,
            (true, true) => 1.0,
            (true, false) => {
                let share = dome / (dome + total);
                (if share.is_finite() { share } else { 0.5 }).clamp(0.1, 0.9) as f32
            }
        };
    }
}

fn add(sum: &mut [f32; 3], value: [f32; 3]) {
    for (sum, value) in sum.iter_mut().zip(value) {
        *sum += value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_core::{LightDesc, LightKind};

    fn light(kind: LightKind, radiance: f32) -> Light {
        Light::from_desc(&LightDesc {
            kind,
            color: [radiance; 3],
            intensity: 1.0,
            exposure: 0.0,
            ..LightDesc::default()
        })
        .expect("a light")
    }

    fn sun(irradiance: f32) -> Light {
        light(LightKind::Distant { angle_degrees: 0.0 }, irradiance)
    }

    #[test]
    fn probabilities_sum_to_one_and_follow_power() {
        let table = PlainLights::new(&[sun(1.0), sun(3.0)], true);
        let sum: f32 = table.distant.iter().map(|light| light.probability).sum();
        assert!((sum - 1.0).abs() < 1e-6, "probabilities must sum to one, got {sum}");
        assert!(table.distant[1].probability > table.distant[0].probability, "the brighter light is chosen more often");
        assert_eq!(table.distant[1].cumulative.to_bits(), 1.0_f32.to_bits(), "the last light ends at exactly one");
        assert!(table.dome_select.abs() < f32::EPSILON, "there is no dome to choose");
    }

    #[test]
    fn a_dome_hidden_from_the_camera_still_lights() {
        let dome = light(LightKind::PLAIN_DOME, 2.0);
        let table = PlainLights::new(&[dome], false);
        assert!(!table.background_visible, "the setting hides it");
        assert_eq!(table.dome_radiance, [2.0; 3], "and keeps its light");
        assert!((table.dome_select - 1.0).abs() < f32::EPSILON, "it is the only light");
    }

    #[test]
    fn lights_of_extreme_power_keep_finite_probabilities() {
        let table = PlainLights::new(&[sun(f32::MAX), sun(0.0)], true);
        assert!(table.distant.iter().all(|light| light.probability > 0.0), "each light keeps a share");
        assert!(table.distant.iter().all(|light| light.probability.is_finite()), "no share may overflow");
    }
}
