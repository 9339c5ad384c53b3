// SPDX-License-Identifier: Apache-2.0
//! Derives the features that a scene and a camera need of the passes.
//!
//! Pure. The answer becomes specialisation constants: pipelines are compiled without the absent parts, and the host
//! does not make their buffers. To measure what that saves, benches and tests compile parts in that the scene does not
//! need ([`crate::ForcedFeatures`]): the same picture, bit for bit.

use crate::assets::SceneView;
use crate::device::PassSpecialisation;
use crate::lights::LightTable;
use oocpt_abi::{FEATURES, FeatureRow, Features};
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

/// Each feature, and whether it is there.
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
}
