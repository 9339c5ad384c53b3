// SPDX-License-Identifier: Apache-2.0
//! Rows of scenes that stream.

use super::super::scenes::papered;
use super::geometry::dusty;
use super::{
    Also, BARE, OF_MATERIALS, OF_MESH_LIGHTS, OF_PARTS, OF_RESOLVING, OF_STREAMING, OF_TEXTURES, Row, STREAM_PASSES,
};
use oocpt_core::scene::ParamValue;

pub(crate) const ROWS: &[Row] = &[
    Row {
        what: "a glowing picture that streams",
        build: |db| papered(db, "emissiveColor", "rgb", &[]),
        features: &["MATERIALS", "TEXTURES", "EMISSION", "MESH_LIGHTS", "MESH_LIGHT_VALUES", "STREAMING"],
        passes: &[STREAM_PASSES, &["resolve_lights"]],
        buffers: &[
            OF_STREAMING,
            OF_MESH_LIGHTS,
            OF_MATERIALS,
            OF_TEXTURES,
            OF_RESOLVING,
            &["emission of mesh lights", "weights of mesh lights"],
        ],
        primvars: &["st"],
        also: Also::Streaming,
    },
    Row {
        what: "a scene that streams",
        features: &["STREAMING"],
        passes: &[STREAM_PASSES],
        buffers: &[OF_STREAMING],
        also: Also::Streaming,
        ..BARE
    },
    Row {
        what: "filtered albedo of a scene that streams",
        features: &["STREAMING", "SHADED_AOVS"],
        passes: &[STREAM_PASSES, &["shade_aovs", "sum_planes", "resolve_planes"]],
        buffers: &[OF_STREAMING, &["image albedo", "plane_values", "plane_sums"]],
        also: Also::StreamedFiltered,
        ..BARE
    },
    Row {
        what: "a primvar of a scene that streams",
        build: dusty,
        features: &["STREAMING", "SHADED_AOVS"],
        passes: &[STREAM_PASSES, &["generate_aov_rays", "shade_aovs"]],
        buffers: &[OF_STREAMING, &["image primvars:dust"]],
        primvars: &["dust"],
        also: Also::StreamedPrimvar,
    },
    Row {
        what: "a light path expression of a scene that streams",
        features: &["STREAMING", "PATH_EXPRESSIONS"],
        passes: &[STREAM_PASSES, &["sum_planes", "resolve_planes"]],
        buffers: &[OF_STREAMING, &["image lpe:C<RD>L", "plane_values", "plane_sums", "light_values"], OF_PARTS],
        also: Also::StreamedParts,
        ..BARE
    },
    Row {
        what: "rays that read geometry in host memory",
        features: &["STREAMING", "CHUNK_COUNTS"],
        passes: &[STREAM_PASSES],
        buffers: &[OF_STREAMING],
        also: Also::Mapped,
        ..BARE
    },
    Row {
        what: "roulette on loads",
        features: &["STREAMING", "ROULETTE"],
        passes: &[STREAM_PASSES, &["roulette_level", "roulette_worth", "roulette_play"]],
        buffers: &[OF_STREAMING, &["roulette", "worth", "worth sums", "verdicts 0", "verdicts 1"]],
        also: Also::Roulette,
        ..BARE
    },
    Row {
        what: "a report of chunks",
        features: &["STREAMING", "CHUNK_COUNTS"],
        passes: &[STREAM_PASSES],
        buffers: &[OF_STREAMING],
        also: Also::ChunkReport,
        ..BARE
    },
    Row {
        what: "a cutout that streams",
        build: |db| papered(db, "opacity", "r", &[("opacityThreshold", ParamValue::Float(0.5))]),
        features: &["MATERIALS", "TEXTURES", "CUTOUTS", "OPACITY_MASKS", "STREAMING"],
        passes: &[STREAM_PASSES, &["resolve_materials", "resolve_cutouts"]],
        buffers: &[
            OF_STREAMING,
            OF_MATERIALS,
            OF_TEXTURES,
            OF_RESOLVING,
            &["alpha_tests", "shadow_alpha_tests", "opacity masks"],
        ],
        primvars: &["st"],
        also: Also::Streaming,
    },
];
