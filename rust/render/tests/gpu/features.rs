// SPDX-License-Identifier: Apache-2.0
//! Leave out what a scene does not need: for every feature a scene that needs it, held against a bare one. Passes,
//! pipelines, buffers and primvars of each are exactly those of the bare scene and what is written in its row; a
//! feature without a row fails.

use crate::lights::{TestFiles, light};
use crate::materials::cutouts::holed;
use crate::materials::inside::clear;
use crate::materials::materialx::noisy;
use crate::materials::{Ramps, board, coordinates, material, node, painted, plain, textured, with};
use crate::scenes::{constant, dome, glow, instanced, instancer, prim, sun};
use crate::support::{self, orthographic, read, request, settings};
use glam::{DMat4, DQuat, DVec3};
use oocpt_core::array::TypedArray;
use oocpt_core::inventory::Inventory;
use oocpt_core::scene::{
    Interpolation, LightDesc, LightKind, MeshDesc, NamedPrimvar, ParamValue, Primvar, SceneDb, Shape, Shaping,
    Subdivision, TransformSample,
};
use oocpt_core::settings::Settings;
use oocpt_core::{DomeFormat, Element};
use oocpt_render::{AovKind, Session, SessionOptions};
use std::collections::BTreeSet;
use std::sync::Arc;

/// What a row says: names of features, of passes, of buffers and of primvars that are there because of it.
type Names = &'static [&'static str];

/// A scene that needs something.
struct Row {
    what: &'static str,
    build: fn(&mut SceneDb),
    features: Names,
    passes: Names,
    buffers: Names,
    primvars: Names,
    /// Of the request, the settings or the session, where it is none of the scene.
    also: Also,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Also {
    Nothing,
    Lens,
    Moves,
    Adaptive,
    Depth,
    Counts,
    Streaming,
    Roulette,
    ChunkReport,
}

const NONE: Names = &[];
const OF_MATERIALS: Names = &["lighting", "material table", "prim table", "material slots", "BSDF tables"];
const OF_STREAMING: Names = &[
    "progress",
    "places",
    "free_slots",
    "pending",
    "shadow_pending",
    "surfaces",
    "deferred 0",
    "deferred 1",
    "segments",
    "demand",
    "sort_counts",
    "sort_sums",
    "chunk_rays",
    "streaming",
    "steps 0",
    "steps 1",
    "geometry and textures, at most",
];
const STREAM_PASSES: Names =
    &["record_surfaces", "sort_deferred_count", "sort_deferred_scan", "sort_deferred_scatter", "count_demand"];

/// A board that nothing is known of: no colour, no normals, no material.
fn bare(path: &str) -> MeshDesc {
    MeshDesc { display_color: None, material: None, ..board(path, 1, "") }
}

fn shown(db: &mut SceneDb) {
    db.upsert_mesh(bare("/board"));
}

fn lit(db: &mut SceneDb, light: LightDesc) {
    shown(db);
    db.upsert_light(light);
}

fn ball() -> LightDesc {
    light(LightKind::Sphere { radius: 0.2, treat_as_point: false }, DMat4::from_translation(DVec3::Z * 3.0))
}

fn dressed(db: &mut SceneDb, params: &[(&str, ParamValue)]) {
    db.upsert_material(plain("/material", params));
    db.upsert_mesh(MeshDesc { material: Some("/material".into()), ..bare("/board") });
}

fn open_pbr(db: &mut SceneDb, params: &[(&str, ParamValue)]) {
    db.upsert_material(material("/material", vec![node("ND_open_pbr_surface_surfaceshader", params, &[])]));
    db.upsert_mesh(MeshDesc { material: Some("/material".into()), ..bare("/board") });
}

fn papered(db: &mut SceneDb, input: &str, output: &str, params: &[(&str, ParamValue)]) {
    db.upsert_material(textured("/material", input, output, params));
    let mesh = MeshDesc { material: Some("/material".into()), ..bare("/board") };
    db.upsert_mesh(with(mesh, "st", Interpolation::Vertex, coordinates(|st| st)));
}

/// A row of two boards in an instancer, with a primvar of a value for each.
fn placed<T: Element + std::fmt::Debug>(db: &mut SceneDb, name: &str, values: Vec<T>) {
    let mesh = bare("/row/board");
    db.upsert_mesh(MeshDesc { prim: instanced(mesh.prim.clone(), "/row"), ..mesh });
    let places = [-0.5, 0.5].map(|x| (DVec3::X * x, DQuat::IDENTITY, DVec3::splat(0.4)));
    let mut row = instancer(prim("/row", DMat4::IDENTITY), "/row/board", &places);
    let primvar = Primvar { interpolation: Interpolation::Instance, values: TypedArray::of(values), indices: None };
    row.primvars.push(NamedPrimvar { name: name.into(), primvar });
    db.upsert_instancer(row);
}

/// Two levels of instancers, the inner one with too many records for the outer one's.
fn nested(db: &mut SceneDb) {
    let grid = |count: u32, size: f64| -> Vec<(DVec3, DQuat, DVec3)> {
        (0..count).map(|k| (DVec3::X * size * f64::from(k), DQuat::IDENTITY, DVec3::splat(0.01))).collect()
    };
    db.upsert_instancer(instancer(prim("/outer", DMat4::IDENTITY), "/outer/inner", &grid(40, 0.02)));
    let inner = instanced(prim("/outer/inner", DMat4::IDENTITY), "/outer");
    db.upsert_instancer(instancer(inner, "/outer/inner/board", &grid(40, 2.0)));
    let mesh = bare("/outer/inner/board");
    db.upsert_mesh(MeshDesc { prim: instanced(mesh.prim.clone(), "/outer/inner"), ..mesh });
}

/// A board that turns.
fn turning(db: &mut SceneDb) {
    let mut mesh = bare("/board");
    let turned = mesh.prim.transform * DMat4::from_rotation_z(0.5);
    mesh.prim.motion = [(0.0, mesh.prim.transform), (1.0, turned)]
        .map(|(time, transform)| TransformSample { time, transform })
        .to_vec();
    db.upsert_mesh(mesh);
}

const BARE: Row = Row {
    what: "a bare board",
    build: shown,
    features: NONE,
    passes: NONE,
    buffers: NONE,
    primvars: NONE,
    also: Also::Nothing,
};

#[rustfmt::skip]
const ROWS: &[Row] = &[
    Row { what: "a dome", build: |db| lit(db, dome([1.0; 3])), features: &["DOME", "DOME_SHADOW_RAYS"], ..BARE },
    Row { what: "points", build: |db| db.upsert_mesh(MeshDesc { shape: Shape::Points, ..bare("/board") }), features: &["ROUND"], ..BARE },
    Row { what: "a sun", build: |db| lit(db, sun(1.0, 1.0, DMat4::IDENTITY)), features: &["DISTANT"], ..BARE },
    Row { what: "normals", build: |db| db.upsert_mesh(MeshDesc { subdivision: Subdivision::CatmullClark, ..bare("/board") }),
          features: &["NORMALS"], buffers: &["mesh normals", "mesh corners"], ..BARE },
    Row { what: "a colour", build: |db| db.upsert_mesh(MeshDesc { display_color: constant([0.5_f32; 3]), ..bare("/board") }),
          features: &["COLORS"], buffers: &["mesh displayColor"], primvars: &["displayColor"], ..BARE },
    Row { what: "an opacity", build: |db| db.upsert_mesh(MeshDesc { display_opacity: constant(0.5_f32), ..bare("/board") }),
          features: &["OPACITY"], buffers: &["mesh displayOpacity"], primvars: &["displayOpacity"], ..BARE },
    Row { what: "something that moves", build: turning, features: &["MOTION"], buffers: &["instance motion"], ..BARE },
    Row { what: "a camera that moves", features: &["CAMERA_MOTION"], buffers: &["camera motion"], also: Also::Moves, ..BARE },
    Row { what: "a lens", features: &["LENS"], also: Also::Lens, ..BARE },
    Row { what: "depth", passes: &["generate_aov_rays", "shade_aovs"], buffers: &["image depth"], also: Also::Depth, ..BARE },
    Row { what: "sample counts", passes: &["count_samples"], buffers: &["image sampleCount"], also: Also::Counts, ..BARE },
    Row { what: "adaptive sampling", features: &["ADAPTIVE"], buffers: &["adaptive", "entries", "said"], also: Also::Adaptive, ..BARE },
    Row { what: "nesting", build: nested, features: &["INSTANCING"], ..BARE },
    Row { what: "a primvar by instance", build: |db| placed(db, "displayColor", vec![[0.5_f32; 3]; 2]),
          features: &["INSTANCE_PRIMVARS"], buffers: &["instance primvars"], primvars: &["displayColor"], ..BARE },
    Row { what: "opacity by instance", build: |db| placed(db, "displayOpacity", vec![0.5_f32; 2]),
          features: &["OPACITY", "INSTANCE_PRIMVARS", "INSTANCE_OPACITY"], buffers: &["instance primvars"], primvars: &["displayOpacity"], ..BARE },
    Row { what: "a primvar by instance that nothing reads", build: |db| placed(db, "unread", vec![0.5_f32; 2]), ..BARE },
    Row { what: "a primvar that nothing reads",
          build: |db| db.upsert_mesh(with(bare("/board"), "st", Interpolation::Vertex, coordinates(|st| st))), ..BARE },
    Row { what: "a lamp", build: |db| lit(db, ball()), features: &["LIGHT_TABLE", "LOCAL_LIGHTS"],
          buffers: &["light_paths", "lighting", "local lights", "light tree"], ..BARE },
    Row { what: "a lamp for gloss", build: |db| lit(db, LightDesc { diffuse: 0.5, ..ball() }),
          features: &["LIGHT_TABLE", "LOCAL_LIGHTS", "LIGHT_LOBES"], buffers: &["light_paths", "lighting", "local lights", "light tree"], ..BARE },
    Row { what: "a lamp under a grey sky", build: |db| { lit(db, ball()); db.upsert_light(dome([1.0; 3])); },
          features: &["LIGHT_TABLE", "LOCAL_LIGHTS", "DOME", "DOME_SHADOW_RAYS"],
          buffers: &["light_paths", "lighting", "local lights", "light tree", "lights at infinity"], ..BARE },
    Row { what: "a shaped lamp", build: |db| lit(db, LightDesc { shaping: Some(Shaping { cone_angle_degrees: 40.0, ..Shaping::default() }), ..ball() }),
          features: &["LIGHT_TABLE", "LOCAL_LIGHTS", "SHAPING"],
          buffers: &["light_paths", "lighting", "local lights", "light tree", "light shapings"], ..BARE },
    Row { what: "a profile",
          build: |db| lit(db, LightDesc { shaping: Some(Shaping { ies: Some(TestFiles::asset("cosine.ies")), ..Shaping::default() }), ..ball() }),
          features: &["LIGHT_TABLE", "LOCAL_LIGHTS", "SHAPING", "IES"],
          buffers: &["light_paths", "lighting", "local lights", "light tree", "light shapings", "IES profiles"], ..BARE },
    Row { what: "a sky", build: |db| lit(db, light(LightKind::Dome { texture: Some(TestFiles::asset("halves")), format: DomeFormat::Latlong }, DMat4::IDENTITY)),
          features: &["LIGHT_TABLE", "DOME", "DOME_TEXTURE"],
          buffers: &["lighting", "lights at infinity", "light maps", "light picture", "dome distribution"], ..BARE },
    Row { what: "a picture of a lamp",
          build: |db| lit(db, light(LightKind::Rect { width: 1.0, height: 1.0, texture: Some(TestFiles::asset("halves")) }, DMat4::from_translation(DVec3::Z * 3.0))),
          features: &["LIGHT_TABLE", "LOCAL_LIGHTS", "LIGHT_TEXTURE"],
          buffers: &["light_paths", "lighting", "local lights", "light tree", "light maps", "light picture"], ..BARE },
    Row { what: "a link",
          build: |db| {
              lit(db, LightDesc { light_link: Some("some".into()), ..ball() });
              db.upsert_mesh(MeshDesc { categories: vec!["some".into()], ..bare("/board") });
          },
          features: &["LIGHT_TABLE", "LOCAL_LIGHTS", "LIGHT_LINKS"],
          buffers: &["light_paths", "lighting", "local lights", "light tree", "light links", "light links of prims"], ..BARE },
    Row { what: "a material", build: |db| dressed(db, &[]), features: &["LIGHT_TABLE", "MATERIALS"], buffers: OF_MATERIALS, ..BARE },
    Row { what: "a coat", build: |db| dressed(db, &[("clearcoat", ParamValue::Float(1.0))]), features: &["LIGHT_TABLE", "MATERIALS", "COAT"], buffers: OF_MATERIALS, ..BARE },
    Row { what: "glass", build: |db| dressed(db, &[("opacity", ParamValue::Float(0.5)), ("roughness", ParamValue::Float(0.0))]), features: &["LIGHT_TABLE", "MATERIALS", "TRANSMISSION"], buffers: OF_MATERIALS, ..BARE },
    Row { what: "rough glass", build: |db| dressed(db, &[("opacity", ParamValue::Float(0.5)), ("roughness", ParamValue::Float(0.5))]), features: &["LIGHT_TABLE", "MATERIALS", "TRANSMISSION", "ROUGH_TRANSMISSION"], buffers: OF_MATERIALS, ..BARE },
    Row { what: "a texture", build: |db| papered(db, "diffuseColor", "rgb", &[]), features: &["LIGHT_TABLE", "MATERIALS", "TEXTURES"],
          buffers: &["lighting", "material table", "prim table", "material slots", "BSDF tables", "cones", "texture table",
                     "texture pages", "sRGB table", "texture tiles, at most", "incomplete_paths", "texture feedback",
                     "requested tiles", "wanted tiles", "texture feedback copy", "mesh primvars", "mesh corners"], primvars: &["st"], ..BARE },
    Row { what: "Ptex",
          build: |db| { db.upsert_material(painted("/material")); db.upsert_mesh(MeshDesc { material: Some("/material".into()), ..bare("/board") }); },
          features: &["LIGHT_TABLE", "MATERIALS", "TEXTURES", "PTEX"],
          buffers: &["lighting", "material table", "prim table", "material slots", "BSDF tables", "cones", "texture table", "texture pages",
                     "sRGB table", "Ptex directories", "texture tiles, at most", "incomplete_paths", "texture feedback", "requested tiles",
                     "wanted tiles", "texture feedback copy"], ..BARE },
    Row { what: "a cutout", build: |db| papered(db, "opacity", "r", &[("opacityThreshold", ParamValue::Float(0.5))]),
          features: &["LIGHT_TABLE", "MATERIALS", "TEXTURES", "CUTOUTS"],
          buffers: &["lighting", "material table", "prim table", "material slots", "BSDF tables", "cones", "texture table",
                     "texture pages", "sRGB table", "texture tiles, at most", "incomplete_paths", "texture feedback",
                     "requested tiles", "wanted tiles", "texture feedback copy", "mesh primvars", "mesh corners"], primvars: &["st"], ..BARE },
    Row { what: "OpenPBR", build: |db| open_pbr(db, &[]), features: &["LIGHT_TABLE", "MATERIALS", "OPEN_PBR"], buffers: OF_MATERIALS, ..BARE },
    Row { what: "fuzz", build: |db| open_pbr(db, &[("fuzz_weight", ParamValue::Float(0.5))]), features: &["LIGHT_TABLE", "MATERIALS", "OPEN_PBR", "SHEEN"], buffers: OF_MATERIALS, ..BARE },
    Row { what: "anisotropy", build: |db| open_pbr(db, &[("specular_roughness_anisotropy", ParamValue::Float(0.5))]), features: &["LIGHT_TABLE", "MATERIALS", "OPEN_PBR", "ANISOTROPY"], buffers: OF_MATERIALS, ..BARE },
    Row { what: "a thin film", build: |db| open_pbr(db, &[("thin_film_weight", ParamValue::Float(1.0))]), features: &["LIGHT_TABLE", "MATERIALS", "OPEN_PBR", "THIN_FILM"], buffers: OF_MATERIALS, ..BARE },
    Row { what: "a thin wall", build: |db| open_pbr(db, &clear("geometry_thin_walled", ParamValue::Bool(true))), features: &["LIGHT_TABLE", "MATERIALS", "OPEN_PBR", "TRANSMISSION", "THIN_WALLS"], buffers: OF_MATERIALS, ..BARE },
    Row { what: "absorption", build: |db| open_pbr(db, &clear("transmission_depth", ParamValue::Float(2.0))), features: &["LIGHT_TABLE", "MATERIALS", "OPEN_PBR", "TRANSMISSION", "ABSORPTION"], buffers: OF_MATERIALS, ..BARE },
    Row { what: "a pattern",
          build: |db| { db.upsert_material(noisy("/material")); db.upsert_mesh(MeshDesc { material: Some("/material".into()), ..bare("/board") }); },
          features: &["LIGHT_TABLE", "MATERIALS", "OPEN_PBR", "PATTERNS"],
          buffers: &["lighting", "material table", "prim table", "material slots", "BSDF tables", "pattern programs"], ..BARE },
    Row { what: "a cutout by a program", build: |db| { db.upsert_material(holed("/material")); db.upsert_mesh(MeshDesc { material: Some("/material".into()), ..bare("/board") }); },
          features: &["LIGHT_TABLE", "MATERIALS", "OPEN_PBR", "CUTOUTS", "PATTERNS", "CUTOUT_PROGRAMS"], buffers: &["lighting", "material table", "prim table", "material slots", "BSDF tables", "pattern programs"], ..BARE },
    Row { what: "a glow",
          build: |db| { db.upsert_material(glow("/material", [1.0; 3])); db.upsert_mesh(MeshDesc { material: Some("/material".into()), ..bare("/board") }); },
          features: &["LIGHT_TABLE", "MATERIALS", "EMISSION", "MESH_LIGHTS"],
          buffers: &["light_paths", "lighting", "material table", "prim table", "material slots", "BSDF tables", "mesh lights", "meshes of mesh lights",
                     "trees of mesh lights", "leaves of mesh lights", "triangles of mesh lights", "faces of mesh lights"], ..BARE },
    Row { what: "a glowing picture", build: |db| papered(db, "emissiveColor", "rgb", &[]),
          features: &["LIGHT_TABLE", "MATERIALS", "TEXTURES", "EMISSION", "MESH_LIGHTS", "MESH_LIGHT_VALUES"],
          buffers: &["light_paths", "lighting", "material table", "prim table", "material slots", "BSDF tables", "cones", "texture table",
                     "texture pages", "sRGB table", "texture tiles, at most", "incomplete_paths", "texture feedback",
                     "requested tiles", "wanted tiles", "texture feedback copy", "mesh primvars", "mesh corners", "mesh lights", "meshes of mesh lights",
                     "trees of mesh lights", "leaves of mesh lights", "triangles of mesh lights", "faces of mesh lights",
                     "emission of mesh lights", "weights of mesh lights"], primvars: &["st"], ..BARE },
    Row { what: "a glowing picture that streams", build: |db| papered(db, "emissiveColor", "rgb", &[]),
          features: &["LIGHT_TABLE", "MATERIALS", "TEXTURES", "EMISSION", "MESH_LIGHTS", "MESH_LIGHT_VALUES", "STREAMING"],
          passes: &["record_surfaces", "sort_deferred_count", "sort_deferred_scan", "sort_deferred_scatter", "count_demand",
                    "resolve_lights"],
          buffers: &["light_paths", "lighting", "material table", "prim table", "material slots", "BSDF tables", "cones", "texture table",
                     "texture pages", "sRGB table", "progress", "places", "free_slots", "pending", "shadow_pending", "surfaces", "deferred 0",
                     "deferred 1", "segments", "demand", "sort_counts", "sort_sums", "chunk_rays", "streaming", "steps 0", "steps 1",
                     "geometry and textures, at most", "surface materials", "resolve_queue", "resolved", "resolve_progress",
                     "mesh lights", "meshes of mesh lights", "trees of mesh lights", "leaves of mesh lights", "triangles of mesh lights",
                     "faces of mesh lights", "emission of mesh lights", "weights of mesh lights"],
          primvars: &["st"], also: Also::Streaming },
    Row { what: "a scene that streams", features: &["STREAMING"], passes: STREAM_PASSES, buffers: OF_STREAMING, also: Also::Streaming, ..BARE },
    Row { what: "roulette on loads", features: &["STREAMING", "ROULETTE"],
          passes: &["record_surfaces", "sort_deferred_count", "sort_deferred_scan", "sort_deferred_scatter", "count_demand",
                    "roulette_level", "roulette_worth", "roulette_play"],
          buffers: &["progress", "places", "free_slots", "pending", "shadow_pending", "surfaces", "deferred 0", "deferred 1", "segments", "demand",
                     "sort_counts", "sort_sums", "chunk_rays", "streaming", "steps 0", "steps 1", "geometry and textures, at most",
                     "roulette", "worth", "worth sums", "verdicts 0", "verdicts 1"], also: Also::Roulette, ..BARE },
    Row { what: "a report of chunks", features: &["STREAMING", "CHUNK_COUNTS"], passes: STREAM_PASSES, buffers: OF_STREAMING,
          also: Also::ChunkReport, ..BARE },
    Row { what: "a cutout that streams", build: |db| papered(db, "opacity", "r", &[("opacityThreshold", ParamValue::Float(0.5))]),
          features: &["LIGHT_TABLE", "MATERIALS", "TEXTURES", "CUTOUTS", "STREAMING"],
          passes: &["record_surfaces", "sort_deferred_count", "sort_deferred_scan", "sort_deferred_scatter", "count_demand",
                    "resolve_materials", "resolve_cutouts"],
          buffers: &["lighting", "material table", "prim table", "material slots", "BSDF tables", "cones", "texture table",
                     "texture pages", "sRGB table", "progress", "places", "free_slots", "pending", "shadow_pending", "surfaces", "deferred 0",
                     "deferred 1", "segments", "demand", "sort_counts", "sort_sums", "chunk_rays", "streaming", "steps 0", "steps 1",
                     "geometry and textures, at most", "surface materials", "resolve_queue", "resolved", "resolve_progress",
                     "questions", "shadow_questions"],
          primvars: &["st"], also: Also::Streaming },
];

/// Renders a row; gives what it was made of and its images.
fn render(row: &Row, carry: &str) -> (Inventory, Vec<Vec<u8>>) {
    let streams = matches!(row.also, Also::Streaming | Also::Roulette);
    let report = std::env::temp_dir().join(format!("oocpt-features-{}.json", std::process::id()));
    let chunk_report =
        if row.also == Also::ChunkReport { report.to_string_lossy().into_owned() } else { String::new() };
    let settings = Settings {
        adaptive_sampling: row.also == Also::Adaptive,
        carry: carry.into(),
        chunk_report,
        straggler_roulette: row.also == Also::Roulette,
        ..settings(4, 2)
    };
    let options = SessionOptions { validation: true, force_streaming: streams, ..SessionOptions::default() };
    let session = Session::with_options(settings, options).with_images(Arc::new(Ramps));
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(row.build);
    let mut camera = orthographic(DVec3::Z * 5.0, DVec3::ZERO, 2.0, [16, 16]);
    if row.also == Also::Lens {
        (camera.lens_radius, camera.focus_distance) = (0.1, 4.0);
    }
    if row.also == Also::Moves {
        let aside = camera.world_from_view * DMat4::from_translation(DVec3::X * 0.1);
        camera.motion = [(0.0, camera.world_from_view), (1.0, aside)]
            .map(|(time, transform)| TransformSample { time, transform })
            .to_vec();
    }
    let mut request = request(camera);
    let more = match row.also {
        Also::Depth => AovKind::Depth,
        Also::Counts => AovKind::SampleCount,
        _ => AovKind::Color,
    };
    request.aovs.retain(|aov| aov.kind == AovKind::Color || aov.kind == more);
    support::render(&session, &request);
    if row.also == Also::ChunkReport {
        std::fs::remove_file(report).expect("the report was written");
    }
    let kinds: Vec<AovKind> = request.aovs.iter().map(|aov| aov.kind).collect();
    let images = kinds.into_iter().map(|kind| read::<u8>(&session, &request, kind)).collect();
    (session.stats().inventory, images)
}

/// Names of what there is: features, passes, buffers, primvars.
fn made(inventory: &Inventory) -> [BTreeSet<String>; 4] {
    let Inventory { features, passes, buffers, primvars, .. } = inventory;
    [
        features.iter().filter(|f| f.present).map(|f| f.name.clone()).collect(),
        passes.iter().filter(|p| p.made).map(|p| p.name.clone()).collect(),
        buffers.iter().filter(|b| b.bytes > 0).map(|b| b.name.clone()).collect(),
        primvars.iter().filter(|p| p.made > 0).map(|p| p.name.clone()).collect(),
    ]
}

/// Rows that are rendered with everything carried along too, one for each kind of need: compiling everything takes long
/// on a software renderer.
const CARRIED: Names = &[
    "a bare board",
    "a sun",
    "a lens",
    "opacity by instance",
    "a lamp",
    "a glow",
    "a cutout",
    "a cutout that streams",
];

/// Both checks of a row in one test, so that the passes it has compiled are there when it is rendered with everything
/// carried along.
fn check(rows: &[Row]) {
    let bare = made(&render(&BARE, "").0);
    for row in rows {
        let (inventory, picture) = render(row, "");
        what_is_made_is_what_the_row_says(row, &inventory, &bare);
        if CARRIED.contains(&row.what) {
            what_is_carried_along_does_not_change_the_picture(row, &inventory, &picture);
        }
    }
}

#[test]
fn a_bare_scene_carries_nothing() {
    let (inventory, picture) = render(&BARE, "");
    every_feature_has_a_row(&inventory);
    let [features, _, _, primvars] = made(&inventory);
    assert!(features.is_empty() && primvars.is_empty(), "a bare board needs no feature: {features:?}, {primvars:?}");
    what_is_carried_along_does_not_change_the_picture(&BARE, &inventory, &picture);
    let known = |what: &&&str| **what == BARE.what || ROWS.iter().any(|row| row.what == **what);
    assert_eq!(CARRIED.iter().filter(known).count(), CARRIED.len(), "a name that no row has");
}

#[test]
fn a_scene_carries_what_it_needs_and_nothing_else() {
    check(&ROWS[..ROWS.len() / 2]);
}

/// The rest, so that no test takes minutes.
#[test]
fn other_scenes_carry_what_they_need_and_nothing_else() {
    check(&ROWS[ROWS.len() / 2..]);
}

fn what_is_made_is_what_the_row_says(row: &Row, inventory: &Inventory, bare: &[BTreeSet<String>; 4]) {
    // What only a scene in core lists: while streaming, geometry comes and goes.
    let of_assets = ["mesh nodes", "mesh triangles", "instance records", "instance trees", "rounding of assets"];
    let given = made(inventory);
    for (at, kind) in ["features", "passes", "buffers", "primvars"].into_iter().enumerate() {
        let wanted = [row.features, row.passes, row.buffers, row.primvars][at];
        let mut expected: BTreeSet<String> = bare[at].iter().cloned().collect();
        expected.extend(wanted.iter().map(|name| (*name).to_owned()));
        if row.features.contains(&"STREAMING") {
            expected.retain(|name| !of_assets.contains(&name.as_str()));
        }
        let mut given = given[at].clone();
        // How bytes are rounded is not what this is about, nor the passes that build trees: they are the device's.
        for set in [&mut given, &mut expected] {
            set.retain(|name| name != "rounding of assets" && !name.starts_with("lbvh_"));
        }
        assert_eq!(given, expected, "{kind} of {}", row.what);
    }
    let sum: u64 = inventory.buffers.iter().map(|buffer| buffer.bytes).sum();
    assert_eq!(sum, inventory.bytes(), "{}", row.what);
}

fn every_feature_has_a_row(inventory: &Inventory) {
    for feature in &inventory.features {
        assert!(ROWS.iter().any(|row| row.features.contains(&feature.name.as_str())), "{} is not tested", feature.name);
    }
    let left_out = inventory.passes.iter().filter(|pass| !pass.made && !pass.name.starts_with("lbvh_"));
    for pass in left_out.map(|pass| pass.name.as_str()) {
        assert!(ROWS.iter().any(|row| row.passes.contains(&pass)), "the pass {pass} is in no row");
    }
}

/// `lean` and `picture` are the row's own.
fn what_is_carried_along_does_not_change_the_picture(row: &Row, lean: &Inventory, picture: &[Vec<u8>]) {
    let (laden, same) = render(row, "all");
    assert!(picture == same, "{}: another picture with all features", row.what);
    let carried: BTreeSet<&str> =
        laden.features.iter().filter(|feature| feature.carried).map(|feature| feature.name.as_str()).collect();
    let [needed, ..] = made(lean);
    assert!(carried.iter().all(|name| !needed.contains(*name)), "{}: {carried:?} and {needed:?}", row.what);
    let always = ["OPACITY", "NORMALS", "COLORS", "LENS", "INSTANCING", "INSTANCE_PRIMVARS", "INSTANCE_OPACITY"];
    for name in always {
        assert!(carried.contains(name) || needed.contains(name), "{}: {name} is not carried: {carried:?}", row.what);
    }
    if needed.contains("LIGHT_TABLE") {
        for name in ["LOCAL_LIGHTS", "SHAPING", "IES", "DOME_TEXTURE", "LIGHT_TEXTURE", "MESH_LIGHTS"] {
            assert!(carried.contains(name) || needed.contains(name), "{}: {name} is not carried", row.what);
        }
    }
    if !needed.contains("STREAMING") {
        assert_eq!((lean.max_levels.min(2), laden.max_levels), (lean.max_levels, 16), "{}", row.what);
        let hits = |inventory: &Inventory| inventory.buffers.iter().find(|b| b.name == "hits").cloned().expect("hits");
        let (few, many) = (hits(lean), hits(&laden));
        assert_eq!((few.bytes + few.saved, 0), (many.bytes, many.saved), "{}: what was said to be saved", row.what);
    }
}

#[test]
fn what_is_no_feature_is_one_warning() {
    let session = support::session(Settings { carry: "COAT nonsense".into(), ..settings(1, 0) });
    session.with_scene(shown);
    let messages = support::render_with_messages(&session, &request(orthographic(DVec3::Z, DVec3::ZERO, 2.0, [4, 4])));
    assert!(messages.len() == 1 && messages[0].text.contains("\"nonsense\" is no feature"), "{messages:?}");
    let carried = session.stats().inventory.features.into_iter().filter(|feature| feature.carried).count();
    assert_eq!(carried, 0, "no coat without materials");
}
