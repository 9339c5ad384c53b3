// SPDX-License-Identifier: Apache-2.0
//! What this scene and camera need of the passes, and what is left out for them.
//!
//! Pure. The answer becomes specialisation constants: pipelines are compiled without the absent parts, and the host
//! does not make their buffers.

use crate::assets::SceneView;
use crate::device::Specialisation;
use crate::lights::LightTable;
use oocpt_core::camera::CameraRays;
use oocpt_core::scene::{SceneFeatures, Snapshot};
use oocpt_shader_abi::Features;

/// What materials need.
const SURFACES: [(SceneFeatures, Features); 8] = [
    (SceneFeatures::MATERIALS, Features::MATERIALS),
    (SceneFeatures::TEXTURES, Features::TEXTURES),
    (SceneFeatures::CUTOUTS, Features::CUTOUTS),
    (SceneFeatures::TRANSMISSION, Features::TRANSMISSION),
    (SceneFeatures::COAT, Features::COAT),
    (SceneFeatures::EMISSION, Features::EMISSION),
    (SceneFeatures::INSTANCE_PRIMVARS, Features::INSTANCE_PRIMVARS),
    (SceneFeatures::INSTANCE_OPACITY, Features::INSTANCE_OPACITY),
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
    features
}

/// Whether some material makes surfaces be there or not.
pub(crate) fn has_cutouts(snapshot: &Snapshot) -> bool {
    snapshot.features.contains(SceneFeatures::CUTOUTS)
}

/// The specialisation of the passes for these features.
pub(crate) fn specialisation(features: Features, scene: &SceneView) -> Specialisation {
    Specialisation { max_levels: scene.max_levels, stack_size: scene.stack_size, features: features.bits() }
}

/// What was left out, in words for the stats.
pub(crate) fn left_out(features: Features, has_planes: bool) -> Vec<String> {
    let parts = [
        (Features::DOME, "dome light"),
        (Features::DISTANT, "distant lights"),
        (Features::LIGHT_TABLE, "light table and MIS over it"),
        (Features::LOCAL_LIGHTS, "local lights and light tree"),
        (Features::SHAPING, "light shaping"),
        (Features::IES, "IES profiles"),
        (Features::DOME_TEXTURE, "dome textures"),
        (Features::LIGHT_TEXTURE, "textures of rect lights"),
        (Features::LIGHT_LINKS, "light linking"),
        (Features::OPACITY, "opacity in traversal"),
        (Features::NORMALS, "interpolated normals"),
        (Features::COLORS, "colours"),
        (Features::INSTANCE_PRIMVARS, "primvars with a value per instance"),
        (Features::LENS, "lens"),
        (Features::INSTANCING, "nested instance levels"),
        (Features::MATERIALS, "materials, and tables of them"),
        (Features::TEXTURES, "textures, and ray cones for them"),
        (Features::CUTOUTS, "cutouts in traversal"),
        (Features::EMISSION, "emission of surfaces"),
        (Features::MESH_LIGHTS, "emissive meshes sampled as lights"),
        (Features::TRANSMISSION, "transmission"),
        (Features::COAT, "coats"),
    ];
    let absent = parts.iter().filter(|(part, _)| !features.contains(*part)).map(|(_, name)| *name);
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
}
