// SPDX-License-Identifier: Apache-2.0
//! What groups of lights bring, roughly, as `local_share` of `shaders/light/sample.glsl` compares it
//! (decisions/0062). Pure.

use super::narrow;
use oocpt_abi::LightTablePointers;

/// See the module.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SceneBrightness {
    /// Sum of what local lights give at distance 1 where they shine.
    pub(super) local: f64,
    /// Irradiance that domes give.
    pub(super) domes: f64,
    /// Irradiance of all distant lights on surfaces that face them.
    distant: f64,
    /// Their directions times that.
    axis: [f64; 3],
}

impl SceneBrightness {
    /// Adds a distant light in a unit direction.
    pub(super) fn add_distant(&mut self, direction: [f32; 3], irradiance: f64) {
        self.distant += irradiance;
        self.axis = [0, 1, 2].map(|k| self.axis[k] + f64::from(direction[k]) * irradiance);
    }

    /// The block with what it says. `mesh`: power of the meshes that emit light, if there are any, as `has_locals` says
    /// of local lights.
    pub(super) fn put(&self, block: LightTablePointers, has_locals: bool, mesh: Option<f64>) -> LightTablePointers {
        LightTablePointers {
            local_brightness: if has_locals { usable(self.local) } else { 0.0 },
            mesh_brightness: mesh.map_or(0.0, usable),
            dome_irradiance: if self.domes > 0.0 { usable(self.domes) } else { 0.0 },
            distant_irradiance: if self.distant > 0.0 { usable(self.distant) } else { 0.0 },
            distant_axis: self.axis.map(|v| if v.is_finite() { narrow(v.clamp(-1e30, 1e30)) } else { 0.0 }),
            ..block
        }
    }
}

/// What the device takes for `value` of lights that are there: neither 0 nor too large to be added up.
fn usable(value: f64) -> f32 {
    if value.is_finite() { narrow(value.clamp(1e-30, 1e30)) } else { 1e30 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_of_present_lights_is_positive_and_finite() {
        let nothing = SceneBrightness::default().put(LightTablePointers::default(), false, None);
        let all = [nothing.local_brightness, nothing.mesh_brightness, nothing.dome_irradiance];
        assert!(all.iter().all(|value| value.to_bits() == 0), "no lights: {all:?}");
        let mut endless = SceneBrightness { local: 0.0, domes: f64::INFINITY, ..SceneBrightness::default() };
        endless.add_distant([0.0, 0.0, 1.0], 1e300);
        let put = endless.put(LightTablePointers::default(), true, Some(f64::NAN));
        let all = [put.local_brightness, put.mesh_brightness, put.dome_irradiance, put.distant_irradiance];
        assert!(all.iter().all(|value| *value > 0.0 && *value <= 1e30), "black and blinding lights: {all:?}");
        assert!(put.distant_axis.iter().all(|value| value.is_finite()), "{:?}", put.distant_axis);
    }
}
