// SPDX-License-Identifier: Apache-2.0
//! Rows of materials without textures.

use super::super::scenes::{bare, dressed, made_of, open_pbr, turning};
use super::{Also, BARE, OF_MATERIALS, OF_MESH_LIGHTS, Row};
use crate::materials::absorption::clear;
use crate::materials::cutouts::holed;
use crate::materials::hair::{curves, hair_of};
use crate::materials::materialx::noisy;
use crate::materials::mixtures::two_metals;
use crate::scenes::glow;
use glam::DMat4;
use oocpt_core::scene::{CurveBasis, MeshDesc, ParamValue, TransformSample};

pub(crate) const ROWS: &[Row] = &[
    Row {
        what: "a material",
        build: |db| dressed(db, &[]),
        features: &["MATERIALS"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "a coat",
        build: |db| dressed(db, &[("clearcoat", ParamValue::Float(1.0))]),
        features: &["MATERIALS", "COAT"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "glass",
        build: |db| dressed(db, &[("opacity", ParamValue::Float(0.5)), ("roughness", ParamValue::Float(0.0))]),
        features: &["MATERIALS", "TRANSMISSION"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "rough glass",
        build: |db| dressed(db, &[("opacity", ParamValue::Float(0.5)), ("roughness", ParamValue::Float(0.5))]),
        features: &["MATERIALS", "TRANSMISSION", "ROUGH_TRANSMISSION"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "OpenPBR",
        build: |db| open_pbr(db, &[]),
        features: &["MATERIALS", "OPEN_PBR"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "fuzz",
        build: |db| open_pbr(db, &[("fuzz_weight", ParamValue::Float(0.5))]),
        features: &["MATERIALS", "OPEN_PBR", "SHEEN"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "anisotropy",
        build: |db| open_pbr(db, &[("specular_roughness_anisotropy", ParamValue::Float(0.5))]),
        features: &["MATERIALS", "OPEN_PBR", "ANISOTROPY"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "a thin film",
        build: |db| open_pbr(db, &[("thin_film_weight", ParamValue::Float(1.0))]),
        features: &["MATERIALS", "OPEN_PBR", "THIN_FILM"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "a thin wall",
        build: |db| open_pbr(db, &clear("geometry_thin_walled", ParamValue::Bool(true))),
        features: &["MATERIALS", "OPEN_PBR", "TRANSMISSION", "THIN_WALLS"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "absorption",
        build: |db| open_pbr(db, &clear("transmission_depth", ParamValue::Float(2.0))),
        features: &["MATERIALS", "OPEN_PBR", "TRANSMISSION", "ABSORPTION"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "dispersion",
        build: |db| open_pbr(db, &clear("transmission_dispersion_scale", ParamValue::Float(0.5))),
        features: &["MATERIALS", "OPEN_PBR", "TRANSMISSION", "DISPERSION"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "rough diffuse reflection",
        build: |db| open_pbr(db, &[("base_diffuse_roughness", ParamValue::Float(0.5))]),
        features: &["MATERIALS", "OPEN_PBR", "ROUGH_DIFFUSE"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "hair",
        build: |db| {
            db.upsert_material(hair_of("/material", &[]));
            let line = vec![[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
            let fibre = curves("/fibre", CurveBasis::Linear, &[line], 0.2);
            db.upsert_mesh(MeshDesc { display_color: None, ..fibre });
        },
        features: &["MATERIALS", "OPEN_PBR", "HAIR", "ROUND"],
        buffers: &[OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "a lobe of tests",
        build: |db| dressed(db, &[]),
        features: &["MATERIALS", "TOY_LOBE"],
        buffers: &[OF_MATERIALS],
        also: Also::ToyLobe,
        ..BARE
    },
    Row {
        what: "a pattern",
        build: |db| made_of(db, noisy("/material")),
        features: &["MATERIALS", "OPEN_PBR", "PATTERNS"],
        buffers: &[OF_MATERIALS, &["pattern programs"]],
        ..BARE
    },
    Row {
        what: "a mixture",
        build: |db| made_of(db, two_metals("/material", 0.5)),
        features: &["MATERIALS", "OPEN_PBR", "PATTERNS", "MIXTURES"],
        buffers: &[OF_MATERIALS, &["pattern programs"]],
        ..BARE
    },
    Row {
        what: "a cutout by a program",
        build: |db| made_of(db, holed("/material")),
        features: &["MATERIALS", "OPEN_PBR", "CUTOUTS", "PATTERNS", "CUTOUT_PROGRAMS"],
        buffers: &[OF_MATERIALS, &["pattern programs"]],
        ..BARE
    },
    Row {
        what: "a glow",
        build: |db| made_of(db, glow("/material", [1.0; 3])),
        features: &["MATERIALS", "EMISSION", "MESH_LIGHTS"],
        buffers: &[OF_MESH_LIGHTS, OF_MATERIALS],
        ..BARE
    },
    Row {
        what: "a glow that moves",
        build: |db| {
            db.upsert_material(glow("/material", [1.0; 3]));
            let mut board = bare("/board");
            let turn = |time: f64| TransformSample { time, transform: DMat4::from_rotation_z(time) };
            board.prim.motion = vec![turn(0.0), turn(1.0)];
            db.upsert_mesh(MeshDesc { material: Some("/material".into()), ..board });
        },
        features: &["MATERIALS", "EMISSION", "MESH_LIGHTS", "MOTION", "MOVING_MESH_LIGHTS"],
        buffers: &[OF_MESH_LIGHTS, OF_MATERIALS, &["instance motion", "motion of mesh lights", "keys of mesh lights"]],
        ..BARE
    },
    Row {
        what: "a glow beside something that moves",
        build: |db| {
            turning(db);
            db.upsert_material(glow("/material", [1.0; 3]));
            db.upsert_mesh(MeshDesc { material: Some("/material".into()), prim_id: 2, ..bare("/still") });
        },
        features: &["MATERIALS", "EMISSION", "MESH_LIGHTS", "MOTION"],
        buffers: &[OF_MESH_LIGHTS, OF_MATERIALS, &["instance motion"]],
        ..BARE
    },
];
