// SPDX-License-Identifier: Apache-2.0
//! Derives the features that a scene and a camera need of the passes.
//!
//! Pure. The features become specialisation constants: pipelines are compiled without the absent parts, and the host
//! does not allocate their buffers. To measure what that saves, `oocpt:carry` compiles in parts that the scene does not
//! need ([`ForcedFeatures`]); the picture is the same, bit for bit.

use crate::assets::SceneView;
use crate::device::PassSpecialisation;
use crate::lights::LightTable;
use oocpt_abi::{CarryRule, FEATURES, FeatureRow, Features};
use oocpt_core::camera::CameraRays;
use oocpt_core::inventory::FeatureUse;
use oocpt_core::mesh::LeafKind;
use oocpt_core::scene::Snapshot;
use std::collections::BTreeSet;

/// The features that the frame decides, independent of the snapshot.
const OF_FRAME: Features = Features::DOME
    .union(Features::DISTANT)
    .union(Features::LOCAL_LIGHTS)
    .union(Features::LENS)
    .union(Features::INSTANCING);

/// The features a frame needs, apart from streaming.
pub(crate) fn features(snapshot: &Snapshot, lights: &LightTable, rays: &CameraRays, scene: &SceneView) -> Features {
    let mut features = lights.features | (snapshot.features - OF_FRAME) | of_leaves(&snapshot.leaf_kinds);
    features.set(Features::LENS, rays.lens_u != [0.0; 3] || rays.lens_v != [0.0; 3]);
    features.set(Features::INSTANCING, scene.max_levels > 1);
    // There are no texture tables without images.
    features.set(Features::TEXTURES, features.contains(Features::TEXTURES) && scene.textures != 0);
    features.set(Features::CUTOUTS, features.contains(Features::CUTOUTS) && scene.has_cutouts);
    let has_masks = features.contains(Features::CUTOUTS | Features::TEXTURES) && scene.has_opacity_masks;
    features.set(Features::OPACITY_MASKS, has_masks);
    features.set(Features::PTEX, features.contains(Features::PTEX | Features::TEXTURES));
    features
}

/// The features that the kinds of leaves need.
fn of_leaves(kinds: &BTreeSet<LeafKind>) -> Features {
    kinds.iter().map(|&kind| kind.row().needs).fold(Features::empty(), Features::union)
}

/// Returns true if a material can make surfaces transparent to rays.
pub(crate) fn has_cutouts(snapshot: &Snapshot) -> bool {
    snapshot.features.contains(Features::CUTOUTS)
}

/// The specialisation of the passes for these features.
pub(crate) fn specialisation(features: Features, scene: &SceneView) -> PassSpecialisation {
    PassSpecialisation {
        max_levels: scene.max_levels,
        stack_size: scene.stack_size,
        features,
        #[cfg(feature = "faults")]
        fault: 0,
    }
}

/// Features compiled in by `oocpt:carry` although the scene does not use them, as far as the picture stays the same.
/// Material features change how surfaces are shaded, so they are never carried. Only in core, except for features that
/// need no memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ForcedFeatures {
    pub(crate) features: Features,
    /// True if passes and memory are sized for the deepest nesting.
    pub(crate) levels: bool,
}

impl ForcedFeatures {
    const NOTHING: Self = Self { features: Features::empty(), levels: false };

    /// Parses the features that a setting names: names of the shaders, `LEVELS`, or `all`, separated by commas. Also
    /// returns the unknown names.
    pub(crate) fn parse(text: &str) -> (Self, Vec<String>) {
        let mut carry = Self::NOTHING;
        let mut unknown = Vec::new();
        for name in text.split([',', ' ']).map(str::trim).filter(|name| !name.is_empty()) {
            match (name.to_ascii_uppercase().as_str(), Features::from_name(&name.to_ascii_uppercase())) {
                ("ALL", _) => carry = Self { features: Features::all(), levels: true },
                ("FEATURES", _) => carry.features = Features::all(),
                ("LEVELS", _) => carry.levels = true,
                (_, Some(feature)) => carry.features |= feature,
                (_, None) => unknown.push(name.chars().take(40).collect()),
            }
        }
        (carry, unknown)
    }

    /// Returns true if no feature is carried.
    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::NOTHING
    }

    /// The requested features that passes which need `needed` can carry; `of_lights` is what the light table allows.
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
        // These two features are requested together.
        carried.set(Features::OPACITY, carried.intersects(Features::OPACITY | Features::INSTANCE_OPACITY));
        // Without textures, passes have nothing that this could be compiled into.
        carried
            .set(Features::PTEX, carried.contains(Features::PTEX) && (carried | needed).contains(Features::TEXTURES));
        carried - needed
    }
}

/// Each feature, with its state: present or not, carried or not.
pub(crate) fn list(features: Features, carried: Features) -> Vec<FeatureUse> {
    let entry = |feature: &FeatureRow| FeatureUse {
        name: feature.name.to_owned(),
        what: feature.what.to_owned(),
        present: features.contains(feature.bit),
        carried: carried.contains(feature.bit),
    };
    FEATURES.iter().map(entry).collect()
}

/// The absent features in words, for the stats.
pub(crate) fn left_out(features: Features, has_planes: bool) -> Vec<String> {
    let always = Features::STREAMING | Features::CHUNK_COUNTS | Features::DOME_SHADOW_RAYS;
    let absent =
        FEATURES.iter().filter(|feature| !(always | features).contains(feature.bit)).map(|feature| feature.what);
    let planes = (!has_planes).then_some("passes generate_aov_rays and shade_aovs, and their images");
    let in_core = !features.contains(Features::STREAMING);
    let streaming = in_core.then_some("streaming: the whole scene is resident");
    absent.chain(planes).chain(streaming).map(String::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn present_features_are_not_listed_as_omitted() {
        let with = left_out(Features::DOME | Features::LENS, true);
        assert!(!with.iter().any(|name| name == "lens" || name == "dome light"), "present parts are not left out");
        let without = left_out(Features::empty(), false);
        assert_eq!(without.len(), with.len() + 3, "dome, lens and the image pass are left out");
        let streaming = left_out(Features::STREAMING, true);
        assert!(!streaming.iter().any(|name| name.contains("streaming")), "what streams has not left streaming out");
    }

    #[test]
    fn every_feature_is_listed_by_the_shaders_name() {
        let list = list(Features::LENS, Features::LENS);
        let lens = list.iter().find(|entry| entry.name == "LENS").expect("by the shaders' name");
        assert!(lens.present && lens.carried && list.iter().filter(|entry| entry.present).count() == 1, "{list:?}");
    }

    #[test]
    fn features_that_change_the_picture_are_not_carried() {
        let (all, unknown) = ForcedFeatures::parse("all");
        assert!(unknown.is_empty() && all.levels);
        let never = Features::DOME_SHADOW_RAYS | Features::MATERIALS | Features::STREAMING;
        for needed in [Features::empty(), Features::DOME, Features::MATERIALS] {
            let carried = all.possible(needed, Features::LOCAL_LIGHTS);
            assert!(!carried.intersects(never | needed), "{needed:?}: {carried:?}");
        }
        let (some, unknown) = ForcedFeatures::parse("lens, COAT levels,nonsense");
        assert_eq!(unknown, ["nonsense"]);
        assert!(some.levels && some.features == Features::LENS | Features::COAT, "{some:?}");
        assert_eq!(some.possible(Features::empty(), Features::empty()), Features::LENS, "no coat without materials");
        assert!(ForcedFeatures::parse("").0.is_empty());
    }
}
