// SPDX-License-Identifier: Apache-2.0
//! Of lights.

use super::super::scenes::{ball, bare, lit};
use super::{BARE, OF_LIGHTS, Row};
use crate::lights::{TestFiles, light};
use crate::scenes::{dome, sun};
use glam::{DMat4, DVec3};
use oocpt_core::DomeFormat;
use oocpt_core::scene::{LightDesc, LightKind, MeshDesc, ShadowReach, ShapingCone, TransformSample};

pub(crate) const ROWS: &[Row] = &[
    Row {
        what: "a dome",
        build: |db| lit(db, dome([1.0; 3])),
        features: &["DOME", "DOME_SHADOW_RAYS"],
        buffers: &[&["lights at infinity"]],
        ..BARE
    },
    Row {
        what: "a sun",
        build: |db| lit(db, sun(1.0, 1.0, DMat4::IDENTITY)),
        features: &["DISTANT"],
        buffers: &[&["lights at infinity"]],
        ..BARE
    },
    Row { what: "a lamp", build: |db| lit(db, ball()), features: &["LOCAL_LIGHTS"], buffers: &[OF_LIGHTS], ..BARE },
    Row {
        what: "a lamp that moves",
        build: |db| {
            let mut lamp = ball();
            let place = lamp.prim.transform;
            let next = DMat4::from_translation(DVec3::X) * place;
            lamp.prim.motion =
                [(0.0, place), (1.0, next)].map(|(time, transform)| TransformSample { time, transform }).to_vec();
            lit(db, lamp);
        },
        features: &["LOCAL_LIGHTS", "MOVING_LIGHTS"],
        buffers: &[OF_LIGHTS, &["light keys", "motion of local lights"]],
        ..BARE
    },
    Row {
        what: "a sun that moves",
        build: |db| {
            let mut own = sun(1.0, 1.0, DMat4::IDENTITY);
            let turn = |time: f64| TransformSample { time, transform: DMat4::from_rotation_x(time) };
            own.prim.motion = vec![turn(0.0), turn(1.0)];
            lit(db, own);
        },
        features: &["DISTANT", "MOVING_LIGHTS"],
        buffers: &[&["lighting", "lights at infinity", "light keys", "motion of lights at infinity"]],
        ..BARE
    },
    Row {
        what: "a lamp for gloss",
        build: |db| lit(db, LightDesc { diffuse: 0.5, ..ball() }),
        features: &["LOCAL_LIGHTS", "LIGHT_LOBES"],
        buffers: &[OF_LIGHTS],
        ..BARE
    },
    Row {
        what: "a lamp under a grey sky",
        build: |db| {
            lit(db, ball());
            db.upsert_light(dome([1.0; 3]));
        },
        features: &["LOCAL_LIGHTS", "DOME", "DOME_SHADOW_RAYS"],
        buffers: &[OF_LIGHTS, &["lights at infinity"]],
        ..BARE
    },
    Row {
        what: "a shaped lamp",
        build: |db| {
            lit(
                db,
                LightDesc {
                    shaping: Some(ShapingCone { cone_angle_degrees: 40.0, ..ShapingCone::default() }),
                    ..ball()
                },
            )
        },
        features: &["LOCAL_LIGHTS", "SHAPING"],
        buffers: &[OF_LIGHTS, &["light shapings"]],
        ..BARE
    },
    Row {
        what: "a profile",
        build: |db| {
            lit(
                db,
                LightDesc {
                    shaping: Some(ShapingCone { ies: Some(TestFiles::asset("cosine.ies")), ..ShapingCone::default() }),
                    ..ball()
                },
            )
        },
        features: &["LOCAL_LIGHTS", "SHAPING", "IES"],
        buffers: &[OF_LIGHTS, &["light shapings", "IES profiles"]],
        ..BARE
    },
    Row {
        what: "a sky",
        build: |db| {
            lit(
                db,
                light(
                    LightKind::Dome { texture: Some(TestFiles::asset("halves")), format: DomeFormat::Latlong },
                    DMat4::IDENTITY,
                ),
            )
        },
        features: &["DOME", "DOME_TEXTURE"],
        buffers: &[&["lighting", "lights at infinity", "light maps", "light picture", "dome distribution"]],
        ..BARE
    },
    Row {
        what: "a picture of a lamp",
        build: |db| {
            lit(
                db,
                light(
                    LightKind::Rect { width: 1.0, height: 1.0, texture: Some(TestFiles::asset("halves")) },
                    DMat4::from_translation(DVec3::Z * 3.0),
                ),
            )
        },
        features: &["LOCAL_LIGHTS", "LIGHT_TEXTURE"],
        buffers: &[OF_LIGHTS, &["light maps", "light picture"]],
        ..BARE
    },
    Row {
        what: "a link",
        build: |db| {
            lit(db, LightDesc { light_link: Some("some".into()), ..ball() });
            db.upsert_mesh(MeshDesc { categories: vec!["some".into()], ..bare("/board") });
        },
        features: &["LOCAL_LIGHTS", "LIGHT_LINKS"],
        buffers: &[OF_LIGHTS, &["light links", "light links of prims"]],
        ..BARE
    },
    Row {
        what: "a shadow that ends",
        build: |db| {
            let reach = ShadowReach { distance: 1.0, falloff: 0.5, gamma: 2.0 };
            lit(db, LightDesc { shadow_reach: Some(reach), ..ball() });
        },
        features: &["LOCAL_LIGHTS", "SHADOW_REACH"],
        buffers: &[OF_LIGHTS, &["reach of shadows"]],
        ..BARE
    },
];
