// SPDX-License-Identifier: Apache-2.0
//! The device memory that a scene in core needs beside its geometry. Pure.

use crate::assets::DeviceScene;
use crate::frame::context::{FrameContext, has_light_paths, has_shadow_rays, in_flight, limits_kinds};
use crate::wavefront::PathNeeds;

/// Waves leave one part in so many of the unused memory to others.
pub(crate) const LEFT_BY_WAVES: u64 = 8;
/// Bytes that a scene in core needs for tiles of textures beside its geometry: the scene counts as fitting, leaves
/// streaming and gets its waves only beside so many bytes, or beside all tiles if they take less.
pub(crate) const ROOM_FOR_TILES: u64 = 8 << 20;

/// Bytes of the `unused` ones that waves may take. `tile_bytes`: of all tiles of the scene's textures, which come
/// later; `maps_tiles`: those that find no room on the device are read in host memory.
pub(crate) fn share_of_waves(unused: u64, tile_bytes: u64, maps_tiles: bool) -> u64 {
    let left = unused / LEFT_BY_WAVES;
    let tiles = if maps_tiles { left.max(ROOM_FOR_TILES) } else { unused / 2 };
    unused - left.max(tiles.min(tile_bytes)).min(unused / 2)
}

/// Bytes of the waves that a scene in core needs room for.
pub(crate) fn roomy_waves(context: &FrameContext<'_>, scene: &DeviceScene) -> u64 {
    let textures = scene.assets.tile_bytes > 0;
    // Whether cutouts need queues is not known yet: they take little, and only of scenes that have textures.
    let path_bytes = path_needs(context, textures, false).bytes_a_path(scene.levels());
    in_flight(context, path_bytes).roomy() * path_bytes
}

/// What the paths of a scene in core need.
pub(crate) fn path_needs(context: &FrameContext<'_>, textures: bool, deferred_cutouts: bool) -> PathNeeds {
    PathNeeds {
        // First hits ask no light.
        shadows: context.film.has_light() && has_shadow_rays(context),
        textures,
        light_paths: has_light_paths(context),
        feedback: textures,
        deferred_cutouts,
        bounce_kinds: limits_kinds(&context.job.settings),
        plane_words: context.film.plane_words(),
        light_words: 0,
        path_states: !context.film.expressions().is_empty(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_leave_room_for_tiles_that_must_be_on_the_device() {
        const MIB: u64 = 1 << 20;
        assert_eq!(share_of_waves(800 * MIB, 0, false), 700 * MIB, "no textures");
        assert_eq!(share_of_waves(800 * MIB, 150 * MIB, false), 650 * MIB, "all tiles fit");
        assert_eq!(share_of_waves(800 * MIB, 4000 * MIB, false), 400 * MIB, "half where they do not");
        assert_eq!(share_of_waves(800 * MIB, 4000 * MIB, true), 700 * MIB, "the rest is mapped");
        assert_eq!(share_of_waves(24 * MIB, 4000 * MIB, true), 16 * MIB, "a few tiles find room");
        assert_eq!(share_of_waves(8 * MIB, 4000 * MIB, true), 4 * MIB, "waves keep half");
    }
}
