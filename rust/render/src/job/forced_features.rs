// SPDX-License-Identifier: Apache-2.0
//! What benches and tests have compiled in beyond what a scene needs, to measure what leaving it out saves and to hold
//! that the picture has the same bits. Pure.

use oocpt_abi::{CarryRule, FEATURES, FeatureRow, Features};

/// Features to compile in although the scene does not use them, as far as the picture stays the same. Materials are
/// shaded another way, so they are never carried. In core only, but for parts that need no memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ForcedFeatures {
    /// Those that the scene does not need.
    pub features: Features,
    /// Passes and memory for the deepest nesting.
    pub levels: bool,
}

impl ForcedFeatures {
    /// Nothing: what renders have.
    pub const NONE: Self = Self { features: Features::empty(), levels: false };
    /// All that can be compiled in.
    pub const ALL: Self = Self { features: Features::all(), levels: true };

    /// Whether anything is asked for.
    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::NONE
    }

    /// Returns the forced features that passes with `needed` can have; the light table allows `of_lights`.
    pub(crate) fn possible(&self, needed: Features, of_lights: Features) -> Features {
        let has_materials = needed.contains(Features::MATERIALS);
        let in_core = !needed.contains(Features::STREAMING);
        let may = |feature: &&FeatureRow| match feature.carry {
            CarryRule::Never => false,
            CarryRule::Always => true,
            CarryRule::Lights => of_lights.contains(feature.bit),
            CarryRule::Materials => has_materials,
            CarryRule::MaterialsInCore => has_materials && in_core,
        };
        let possible = FEATURES.iter().filter(may).fold(Features::empty(), |sum, feature| sum | feature.bit);
        let mut carried = self.features & possible;
        // Opacity by instance is compiled in beside opacity.
        carried.set(Features::OPACITY, carried.intersects(Features::OPACITY | Features::INSTANCE_OPACITY));
        // Ptex is a branch of the texture lookups.
        carried
            .set(Features::PTEX, carried.contains(Features::PTEX) && (carried | needed).contains(Features::TEXTURES));
        carried - needed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_that_change_the_picture_are_not_carried() {
        let never = Features::DOME_SHADOW_RAYS | Features::MATERIALS | Features::STREAMING;
        for needed in [Features::empty(), Features::DOME, Features::MATERIALS] {
            let carried = ForcedFeatures::ALL.possible(needed, Features::LOCAL_LIGHTS);
            assert!(!carried.intersects(never | needed), "{needed:?}: {carried:?}");
        }
        let some = ForcedFeatures { features: Features::LENS | Features::COAT, levels: true };
        assert_eq!(some.possible(Features::empty(), Features::empty()), Features::LENS, "no coat without materials");
        assert!(ForcedFeatures::NONE.is_empty() && !some.is_empty());
    }
}
