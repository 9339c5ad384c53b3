// SPDX-License-Identifier: Apache-2.0
//! What this scene and camera need of the passes, and what is left out for them.
//!
//! Pure. The answer becomes specialisation constants: pipelines are compiled without the absent parts, and the host
//! does not make their buffers. To measure what that saves, `oocpt:carry` compiles parts in that the scene does not need ([`Carry`]):
//! the same picture, bit for bit.

use crate::assets::SceneView;
use crate::device::Specialisation;
use crate::lights::LightTable;
use oocpt_core::camera::CameraRays;
use oocpt_core::inventory::FeatureUse;
use oocpt_core::scene::{SceneFeatures, Snapshot};
use oocpt_shader_abi::{Features, Lobes};

/// What materials need.
const SURFACES: [(SceneFeatures, Features); 10] = [
    (SceneFeatures::MATERIALS, Features::MATERIALS),
    (SceneFeatures::TEXTURES, Features::TEXTURES),
    (SceneFeatures::PTEX, Features::PTEX),
    (SceneFeatures::CUTOUTS, Features::CUTOUTS),
    (SceneFeatures::TRANSMISSION, Features::TRANSMISSION),
    (SceneFeatures::ROUGH_TRANSMISSION, Features::ROUGH_TRANSMISSION),
    (SceneFeatures::COAT, Features::COAT),
    (SceneFeatures::EMISSION, Features::EMISSION),
    (SceneFeatures::INSTANCE_PRIMVARS, Features::INSTANCE_PRIMVARS),
    (SceneFeatures::INSTANCE_OPACITY, Features::INSTANCE_OPACITY),
];

/// The features in words.
const PARTS: [(Features, &str); 32] = [
    (Features::DOME, "dome light"),
    (Features::DOME_SHADOW_RAYS, "shadow rays to constant domes"),
    (Features::DISTANT, "distant lights"),
    (Features::LIGHT_TABLE, "light table and MIS over it"),
    (Features::LOCAL_LIGHTS, "local lights and light tree"),
    (Features::SHAPING, "light shaping"),
    (Features::IES, "IES profiles"),
    (Features::DOME_TEXTURE, "dome textures"),
    (Features::LIGHT_TEXTURE, "textures of rect lights"),
    (Features::LIGHT_LINKS, "light linking"),
    (Features::LIGHT_LOBES, "lights' own multipliers for diffuse and specular"),
    (Features::OPACITY, "opacity in traversal"),
    (Features::NORMALS, "interpolated normals"),
    (Features::COLORS, "colours"),
    (Features::INSTANCE_PRIMVARS, "primvars with a value per instance"),
    (Features::INSTANCE_OPACITY, "opacity with a value per instance"),
    (Features::LENS, "lens"),
    (Features::INSTANCING, "nested instance levels"),
    (Features::MATERIALS, "materials, and tables of them"),
    (Features::TEXTURES, "textures, and ray cones for them"),
    (Features::PTEX, "Ptex"),
    (Features::CUTOUTS, "cutouts in traversal"),
    (Features::EMISSION, "emission of surfaces"),
    (Features::MESH_LIGHTS, "emissive meshes sampled as lights"),
    (Features::MESH_LIGHT_VALUES, "emission of lights by textures and primvars"),
    (Features::TRANSMISSION, "transmission"),
    (Features::ROUGH_TRANSMISSION, "rough transmission, and tables of what it loses"),
    (Features::COAT, "coats"),
    (Features::ADAPTIVE, "adaptive sampling: lists of samples, the second stream of the film"),
    (Features::STREAMING, "streaming of what does not fit"),
    (Features::CHUNK_COUNTS, "counts of rays by chunk"),
    (Features::ROULETTE, "roulette on loads for stragglers"),
];

/// The features a frame needs, apart from streaming.
pub(crate) fn features(snapshot: &Snapshot, lights: &LightTable, rays: &CameraRays, scene: &SceneView) -> Features {
    let mut features = lights.features();
    features.set(Features::OPACITY, snapshot.features.contains(SceneFeatures::OPACITY));
    features.set(Features::NORMALS, snapshot.features.contains(SceneFeatures::NORMALS));
    features.set(Features::COLORS, snapshot.features.contains(SceneFeatures::COLORS));
    features.set(Features::LENS, rays.lens_u != [0.0; 3] || rays.lens_v != [0.0; 3]);
    features.set(Features::INSTANCING, scene.max_levels > 1);
    for (scene, feature) in SURFACES {
        features.set(feature, snapshot.features.contains(scene));
    }
    // Without images there are no tables of them.
    features.set(Features::TEXTURES, features.contains(Features::TEXTURES) && scene.textures != 0);
    features.set(Features::PTEX, features.contains(Features::PTEX | Features::TEXTURES));
    features
}

/// Whether some material makes surfaces be there or not.
pub(crate) fn has_cutouts(snapshot: &Snapshot) -> bool {
    snapshot.features.contains(SceneFeatures::CUTOUTS)
}

/// The specialisation of the passes for these features.
pub(crate) fn specialisation(features: Features, scene: &SceneView) -> Specialisation {
    Specialisation { max_levels: scene.max_levels, stack_size: scene.stack_size, features, lobes: Lobes::empty() }
}

/// What is carried along although the scene does not need it: what `oocpt:carry` asks for and what can be had without another
/// picture. The light table is another estimator, and materials need it, so these two are never carried. In core only, but for parts that
/// need no memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Carry {
    pub(crate) features: Features,
    /// Passes and memory for the deepest nesting.
    pub(crate) levels: bool,
}

impl Carry {
    const NOTHING: Self = Self { features: Features::empty(), levels: false };

    /// What a setting names: features as the shaders call them, `LEVELS`, or `all`, parted by commas. Gives names that are none.
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

    /// Whether anything is asked for.
    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::NOTHING
    }

    /// Of what is asked for, what passes that need `needed` can carry; `of_lights` is what the light table allows.
    pub(crate) fn possible(&self, needed: Features, of_lights: Features) -> Features {
        let mut possible = Features::OPACITY | Features::NORMALS | Features::COLORS | Features::LENS;
        possible |= Features::INSTANCING | Features::INSTANCE_PRIMVARS | Features::INSTANCE_OPACITY | Features::OPACITY;
        if needed.contains(Features::LIGHT_TABLE) {
            possible |= of_lights | Features::DOME | Features::DISTANT;
        } else {
            possible |= Features::DOME | Features::DISTANT;
            possible.set(Features::DOME_SHADOW_RAYS, needed.contains(Features::DISTANT));
        }
        if needed.contains(Features::MATERIALS) {
            possible |= Features::TEXTURES | Features::CUTOUTS | Features::TRANSMISSION;
            possible |= Features::ROUGH_TRANSMISSION | Features::COAT | Features::EMISSION | Features::PTEX;
        }
        if needed.contains(Features::STREAMING) {
            possible -= Features::TEXTURES | Features::CUTOUTS | Features::PTEX;
        }
        let mut carried = self.features & possible;
        // These two are asked for together.
        carried.set(Features::OPACITY, carried.intersects(Features::OPACITY | Features::INSTANCE_OPACITY));
        // Without textures there is nothing that it could be compiled into.
        carried
            .set(Features::PTEX, carried.contains(Features::PTEX) && (carried | needed).contains(Features::TEXTURES));
        carried - needed
    }
}

/// Each feature, and whether it is there.
pub(crate) fn list(features: Features, carried: Features) -> Vec<FeatureUse> {
    let entry = |(feature, what): &(Features, &str)| FeatureUse {
        name: feature.iter_names().map(|(name, _)| name).collect(),
        what: (*what).to_owned(),
        present: features.contains(*feature),
        carried: carried.contains(*feature),
    };
    PARTS.iter().map(entry).collect()
}

/// What was left out, in words for the stats.
pub(crate) fn left_out(features: Features, has_planes: bool) -> Vec<String> {
    let always = Features::STREAMING | Features::CHUNK_COUNTS | Features::DOME_SHADOW_RAYS;
    let parts = PARTS.iter().filter(|(part, _)| !always.contains(*part));
    let absent = parts.filter(|(part, _)| !features.contains(*part)).map(|(_, name)| *name);
    let planes = (!has_planes).then_some("passes generate_aov_rays and shade_aovs, and their images");
    let in_core = !features.contains(Features::STREAMING);
    let streaming = in_core.then_some("streaming: the whole scene is resident");
    absent.chain(planes).chain(streaming).map(String::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_present_is_not_listed_as_left_out() {
        let with = left_out(Features::DOME | Features::LENS, true);
        assert!(!with.iter().any(|name| name == "lens" || name == "dome light"), "present parts are not left out");
        let without = left_out(Features::empty(), false);
        assert_eq!(without.len(), with.len() + 3, "dome, lens and the image pass are left out");
        let streaming = left_out(Features::STREAMING, true);
        assert!(!streaming.iter().any(|name| name.contains("streaming")), "what streams has not left streaming out");
    }

    #[test]
    fn every_feature_is_listed_once_but_for_the_planted_fault() {
        let listed = PARTS.iter().fold(Features::empty(), |sum, (part, _)| {
            assert!(!sum.intersects(*part) && part.bits().count_ones() == 1, "{part:?} is listed twice");
            sum | *part
        });
        assert_eq!(listed, Features::all() - Features::PLANT_SKIP_DEFERRED, "a feature has no words");
        let list = list(Features::LENS, Features::LENS);
        let lens = list.iter().find(|entry| entry.name == "LENS").expect("by the shaders' name");
        assert!(lens.present && lens.carried && list.iter().filter(|entry| entry.present).count() == 1, "{list:?}");
    }

    #[test]
    fn what_would_change_the_picture_is_not_carried() {
        let (all, unknown) = Carry::parse("all");
        assert!(unknown.is_empty() && all.levels);
        let never = Features::LIGHT_TABLE | Features::MATERIALS | Features::STREAMING | Features::PLANT_SKIP_DEFERRED;
        for needed in [Features::empty(), Features::DOME, Features::LIGHT_TABLE | Features::MATERIALS] {
            let carried = all.possible(needed, Features::LOCAL_LIGHTS);
            assert!(!carried.intersects(never | needed), "{needed:?}: {carried:?}");
        }
        let dome = all.possible(Features::DOME, Features::empty());
        assert!(!dome.contains(Features::DOME_SHADOW_RAYS), "another estimator: {dome:?}");
        let (some, unknown) = Carry::parse("lens, COAT levels,nonsense");
        assert_eq!(unknown, ["nonsense"]);
        assert!(some.levels && some.features == Features::LENS | Features::COAT, "{some:?}");
        assert_eq!(some.possible(Features::empty(), Features::empty()), Features::LENS, "no coat without materials");
        assert!(Carry::parse("").0.is_empty());
    }
}
