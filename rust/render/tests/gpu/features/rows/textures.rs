// SPDX-License-Identifier: Apache-2.0
//! Rows of textures.

use super::super::scenes::{made_of, papered};
use super::{BARE, OF_MATERIALS, OF_MESH_LIGHTS, OF_PRIMVARS, OF_TEXTURES, OF_TILES, Row};
use crate::lights::stripes;
use crate::materials::painted;
use oocpt_core::scene::{MaterialDesc, ParamValue};

pub(crate) const ROWS: &[Row] = &[
    Row {
        what: "a texture",
        build: |db| papered(db, "diffuseColor", "rgb", &[]),
        features: &["MATERIALS", "TEXTURES"],
        buffers: &[OF_MATERIALS, OF_TEXTURES, OF_TILES, OF_PRIMVARS],
        primvars: &["st"],
        ..BARE
    },
    Row {
        what: "Ptex",
        build: |db| made_of(db, painted("/material")),
        features: &["MATERIALS", "TEXTURES", "PTEX"],
        buffers: &[OF_MATERIALS, OF_TEXTURES, OF_TILES, &["Ptex directories"]],
        ..BARE
    },
    Row {
        what: "a cutout",
        build: |db| papered(db, "opacity", "r", &[("opacityThreshold", ParamValue::Float(0.5))]),
        features: &["MATERIALS", "TEXTURES", "CUTOUTS", "OPACITY_MASKS", "DEFERRED_CUTOUTS"],
        buffers: &[OF_MATERIALS, OF_TEXTURES, OF_TILES, OF_PRIMVARS, &["opacity masks", "settle_queue", "settle_hits"]],
        passes: &[&["settle_closest", "settle_shadow"]],
        primvars: &["st"],
        ..BARE
    },
    Row {
        what: "a glowing picture",
        build: |db| papered(db, "emissiveColor", "rgb", &[]),
        features: &["MATERIALS", "TEXTURES", "EMISSION", "MESH_LIGHTS", "MESH_LIGHT_VALUES"],
        buffers: &[
            OF_MESH_LIGHTS,
            OF_MATERIALS,
            OF_TEXTURES,
            OF_TILES,
            OF_PRIMVARS,
            &["emission of mesh lights", "weights of mesh lights"],
        ],
        primvars: &["st"],
        ..BARE
    },
    Row {
        what: "a glowing program",
        build: |db| made_of(db, MaterialDesc { path: "/material".into(), ..stripes("object") }),
        features: &[
            "MATERIALS",
            "OPEN_PBR",
            "PATTERNS",
            "EMISSION",
            "MESH_LIGHTS",
            "MESH_LIGHT_VALUES",
            "MESH_LIGHT_PROGRAMS",
        ],
        buffers: &[
            OF_MESH_LIGHTS,
            OF_MATERIALS,
            &["pattern programs", "emission of mesh lights", "weights of mesh lights", "corners of mesh lights"],
        ],
        ..BARE
    },
];
