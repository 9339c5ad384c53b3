// SPDX-License-Identifier: Apache-2.0
//! What a scene in core needs of the device beside its geometry. Pure.

use crate::assets::DeviceScene;
use crate::setting::{FrameContext, has_light_paths, has_shadow_rays, in_flight};
use crate::wavefront::PathNeeds;

/// Share of what is unused that waves leave to others, where no tiles of textures come.
pub(crate) const LEFT_BY_WAVES: u64 = 8;

/// Bytes of the waves that a scene in core needs room for.
pub(crate) fn roomy_waves(setting: &FrameContext<'_>, scene: &DeviceScene) -> u64 {
    let textures = scene.assets.tile_bytes > 0;
    // Whether cutouts need queues is not known yet: they take little, and only of scenes that have textures.
    let path_bytes = path_needs(setting, textures, false).bytes_a_path(scene.levels());
    in_flight(setting, path_bytes).roomy() * path_bytes
}

/// What the paths of a scene in core need.
pub(crate) fn path_needs(setting: &FrameContext<'_>, textures: bool, deferred_cutouts: bool) -> PathNeeds {
    PathNeeds {
        // First hits ask no light.
        shadows: setting.film.has_color() && has_shadow_rays(setting),
        textures,
        light_paths: has_light_paths(setting),
        feedback: textures,
        deferred_cutouts,
    }
}
