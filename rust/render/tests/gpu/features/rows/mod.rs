// SPDX-License-Identifier: Apache-2.0
//! Rows of the table: the parts that each kind of scene has beside those of the bare one.

mod geometry;
mod lights;
mod materials;
mod streaming;
mod textures;

use super::scenes::shown;
use oocpt_core::scene::SceneDb;

/// The contents of a row: names of features, of passes, of buffers and of primvars that exist because of it.
pub(crate) type Names = &'static [&'static str];

/// Lists of names; one may be in several.
pub(crate) type Lists = &'static [Names];

/// A scene that needs something.
pub(crate) struct Row {
    pub(crate) what: &'static str,
    pub(crate) build: fn(&mut SceneDb),
    pub(crate) features: Names,
    pub(crate) passes: Lists,
    pub(crate) buffers: Lists,
    pub(crate) primvars: Names,
    /// Features of the request, the settings or the session, if the scene does not need them itself.
    pub(crate) also: Also,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Also {
    Nothing,
    Lens,
    Moves,
    Clips,
    Motion,
    Adaptive,
    Kinds,
    Filter,
    Depth,
    Albedo,
    Primvar,
    StreamedPrimvar,
    Filtered,
    StreamedFiltered,
    Ids,
    Deep,
    Parts,
    StreamedParts,
    Errors,
    Counts,
    Shadows,
    Waits,
    FilmPart,
    Streaming,
    Mapped,
    Roulette,
    ChunkReport,
    ToyLobe,
}

pub(crate) const NONE: Names = &[];
pub(crate) const OF_STREAMING: Names = &[
    "progress",
    "places",
    "ended_radiance",
    "free_slots",
    "pending",
    "surfaces",
    "deferred 0",
    "deferred 1",
    "segments",
    "demand",
    "demand counts",
    "demanded units",
    "demand list",
    "sort_counts",
    "sort_sums",
    "unit_rays",
    "streaming",
    "steps 0",
    "steps 1",
    "geometry and textures, at most",
];
pub(crate) const OF_MESH_LIGHTS: Names = &[
    "light_paths",
    "lighting",
    "mesh lights",
    "meshes of mesh lights",
    "trees of mesh lights",
    "leaves of mesh lights",
    "triangles of mesh lights",
    "faces of mesh lights",
];
pub(crate) const OF_MATERIALS: Names = &["lighting", "material table", "prim table", "material slots", "BSDF tables"];
pub(crate) const OF_TEXTURES: Names = &["cones", "texture table", "texture pages", "sRGB table"];
pub(crate) const OF_TILES: Names = &[
    "texture tiles, at most",
    "incomplete_paths",
    "texture feedback",
    "requested tiles",
    "wanted tiles",
    "texture feedback copy",
];
pub(crate) const OF_LIGHTS: Names = &["light_paths", "lighting", "local lights", "light tree"];
pub(crate) const OF_RESOLVING: Names = &["surface materials", "resolve_queue", "resolved", "resolve_progress"];
pub(crate) const OF_PARTS: Names = &["path_states", "light path automaton"];
pub(crate) const OF_PRIMVARS: Names = &["mesh primvars", "mesh corners"];
pub(crate) const STREAM_PASSES: Names = &[
    "record_surfaces",
    "sort_deferred_count",
    "sort_deferred_scan",
    "sort_deferred_scatter",
    "count_demand",
    "list_demand",
    "retire_paths",
];

pub(crate) const BARE: Row = Row {
    what: "a bare board",
    build: shown,
    features: NONE,
    passes: &[],
    buffers: &[],
    primvars: NONE,
    also: Also::Nothing,
};

pub(crate) use {geometry::ROWS as GEOMETRY, lights::ROWS as LIGHTS, materials::ROWS as MATERIALS};
pub(crate) use {streaming::ROWS as STREAMING, textures::ROWS as TEXTURES};

/// All rows.
pub(crate) fn all() -> impl Iterator<Item = &'static Row> {
    [GEOMETRY, LIGHTS, MATERIALS, TEXTURES, STREAMING].into_iter().flatten()
}
