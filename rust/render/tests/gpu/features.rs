// SPDX-License-Identifier: Apache-2.0
//! Scenes leave out what they do not need: for every feature there is a scene that needs it, compared with a bare one.
//! Passes, pipelines, buffers and primvars of each are exactly those of the bare scene and those in its row; a feature
//! without a row fails.

mod rows;
mod scenes;

use crate::lights::TestFiles;
use crate::materials::Ramps;
use crate::support::{self, orthographic, read, request, settings};
use glam::{DMat4, DVec3, DVec4};
use oocpt_abi::Features;
use oocpt_core::inventory::RenderInventory;
use oocpt_core::pixel_filter::PixelFilterKind;
use oocpt_core::scene::TransformSample;
use oocpt_core::settings::{HostMapped, Settings};
use oocpt_render::{AovKind, AovRequest, DeepLimits, ForcedFeatures, PlantedFaults, Session, SessionOptions};
use rows::{Also, BARE, Names, Row};
use std::collections::BTreeSet;
use std::sync::Arc;

/// The image that a row has rendered beside the colour.
fn image_of(also: Also) -> AovKind {
    match also {
        Also::Parts | Also::StreamedParts => AovKind::from_token("lpe:C<RD>L").expect("an expression"),
        Also::Depth => AovKind::Depth,
        Also::Albedo | Also::Filtered | Also::StreamedFiltered => AovKind::Albedo,
        Also::Primvar | Also::StreamedPrimvar => AovKind::from_token("primvars:dust").expect("a primvar"),
        Also::Ids => AovKind::CryptoObject,
        Also::Deep => AovKind::Deep(DeepLimits::default()),
        Also::Errors => AovKind::Error,
        Also::Counts => AovKind::SampleCount,
        Also::Shadows => AovKind::Shadow,
        Also::Motion => AovKind::Motion,
        Also::Waits => AovKind::LoadWaits,
        _ => AovKind::Color,
    }
}

fn settings_of(row: &Row) -> Settings {
    Settings {
        adaptive_sampling: row.also == Also::Adaptive,
        filter_aovs: matches!(row.also, Also::Filtered | Also::StreamedFiltered),
        pixel_filter: if row.also == Also::Filter { PixelFilterKind::Gaussian } else { PixelFilterKind::Box },
        max_diffuse_bounces: if row.also == Also::Kinds { 1 } else { Settings::default().max_diffuse_bounces },
        // Otherwise it would depend on the device.
        host_mapped: if row.also == Also::Mapped { HostMapped::On } else { HostMapped::Off },
        straggler_roulette: row.also == Also::Roulette,
        ..settings(4, 2)
    }
}

/// Renders a row; gives what it was made of and its images.
fn render(row: &Row, forced_features: ForcedFeatures) -> (RenderInventory, Vec<Vec<u8>>) {
    let streams = matches!(
        row.also,
        Also::Streaming
            | Also::Mapped
            | Also::Roulette
            | Also::StreamedFiltered
            | Also::StreamedPrimvar
            | Also::StreamedParts
    );
    let report = std::env::temp_dir().join(format!("oocpt-features-{}.json", std::process::id()));
    let chunk_report =
        if row.also == Also::ChunkReport { report.to_string_lossy().into_owned() } else { String::new() };
    let part = std::env::temp_dir().join(format!("oocpt-features-{}.film", std::process::id()));
    let film_part = if row.also == Also::FilmPart { part.to_string_lossy().into_owned() } else { String::new() };
    let settings = Settings { film_part, chunk_report, ..settings_of(row) };
    let more_features = if row.also == Also::ToyLobe { Features::TOY_LOBE } else { Features::empty() };
    let faults = PlantedFaults { more_features, ..PlantedFaults::default() };
    let options = SessionOptions {
        validation: true,
        force_streaming: streams,
        forced_features,
        faults,
        ..SessionOptions::default()
    };
    let session = Session::with_options(settings, options).with_images(Arc::new(Ramps));
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(row.build);
    let mut camera = orthographic(DVec3::Z * 5.0, DVec3::ZERO, 2.0, [16, 16]);
    if row.also == Also::Lens {
        (camera.lens_radius, camera.focus_distance) = (0.1, 4.0);
    }
    if matches!(row.also, Also::Moves | Also::Motion) {
        let aside = camera.world_from_view * DMat4::from_translation(DVec3::X * 0.1);
        camera.motion = [(0.0, camera.world_from_view), (1.0, aside)]
            .map(|(time, transform)| TransformSample { time, transform })
            .to_vec();
    }
    if row.also == Also::Clips {
        camera.clip_planes = vec![DVec4::new(1.0, 0.0, 0.0, 0.0)];
    }
    let mut request = request(camera);
    let more = image_of(row.also);
    request.aovs.push(AovRequest { kind: more, clear: [0.0; 4] });
    request.aovs.retain(|aov| aov.kind == AovKind::Color || aov.kind == more);
    request.aovs.dedup_by_key(|aov| aov.kind);
    support::render(&session, &request);
    if row.also == Also::ChunkReport {
        std::fs::remove_file(report).expect("the report was written");
    }
    if row.also == Also::FilmPart {
        std::fs::remove_file(part).expect("the part was written");
    }
    let kinds: Vec<AovKind> = request.aovs.iter().map(|aov| aov.kind).collect();
    let images = kinds.into_iter().map(|kind| read::<u8>(&session, &request, kind)).collect();
    (session.stats().inventory, images)
}

/// Names of the features, passes, buffers and primvars that exist.
fn made(inventory: &RenderInventory) -> [BTreeSet<String>; 4] {
    let RenderInventory { features, passes, buffers, primvars, .. } = inventory;
    [
        features.iter().filter(|f| f.present).map(|f| f.name.clone()).collect(),
        passes.iter().filter(|p| p.made).map(|p| p.name.clone()).collect(),
        buffers.iter().filter(|b| b.bytes > 0).map(|b| b.name.clone()).collect(),
        primvars.iter().filter(|p| p.made > 0).map(|p| p.name.clone()).collect(),
    ]
}

/// Features of lights with shadow rays.
const SHADOWED: Names = &["DOME", "DISTANT", "LOCAL_LIGHTS", "MESH_LIGHTS"];

/// Rows that are also rendered with all features carried, one for each kind of need. The first ones always: a scene in
/// core, and one that streams with a cutout. The others only with `--full`: compiling everything takes long on a
/// software renderer.
const CARRIED: Names = &[
    "a bare board",
    "a cutout that streams",
    "a lamp",
    "a cutout",
    "a sun",
    "a lens",
    "opacity by instance",
    "a glow",
];
const CARRIED_ALWAYS: usize = 2;

/// Runs both checks of a row in one test, so that the passes it has compiled are used again with all features carried.
fn check(rows: &[Row]) {
    let bare = made(&render(&BARE, ForcedFeatures::NONE).0);
    let carried = if support::is_full() { CARRIED } else { &CARRIED[..CARRIED_ALWAYS] };
    for row in rows {
        let (inventory, picture) = render(row, ForcedFeatures::NONE);
        what_is_made_is_what_the_row_says(row, &inventory, &bare);
        if carried.contains(&row.what) {
            what_is_carried_along_does_not_change_the_picture(row, &inventory, &picture);
        }
    }
}

#[test]
fn a_minimal_scene_enables_no_feature() {
    let (inventory, picture) = render(&BARE, ForcedFeatures::NONE);
    every_feature_has_a_row(&inventory);
    let [features, _, _, primvars] = made(&inventory);
    assert!(features.is_empty() && primvars.is_empty(), "a bare board needs no feature: {features:?}, {primvars:?}");
    what_is_carried_along_does_not_change_the_picture(&BARE, &inventory, &picture);
    let known = |what: &&&str| **what == BARE.what || rows::all().any(|row| row.what == **what);
    assert_eq!(CARRIED.iter().filter(known).count(), CARRIED.len(), "a name that no row has");
}

#[test]
fn geometry_enables_exactly_its_features() {
    check(rows::GEOMETRY);
}

#[test]
fn lights_enable_exactly_their_features() {
    check(rows::LIGHTS);
}

#[test]
fn materials_enable_exactly_their_features() {
    check(rows::MATERIALS);
}

#[test]
fn textures_enable_exactly_their_features() {
    check(rows::TEXTURES);
}

#[test]
fn streaming_enables_exactly_its_features() {
    check(rows::STREAMING);
}

fn what_is_made_is_what_the_row_says(row: &Row, inventory: &RenderInventory, bare: &[BTreeSet<String>; 4]) {
    // Only a scene in core lists these: while streaming, geometry is loaded and evicted.
    let of_assets = ["mesh nodes", "mesh triangles", "instance records", "instance trees", "rounding of assets"];
    let given = made(inventory);
    for (at, kind) in ["features", "passes", "buffers", "primvars"].into_iter().enumerate() {
        let (features, primvars) = ([row.features], [row.primvars]);
        let wanted = [&features[..], row.passes, row.buffers, &primvars][at];
        let mut expected: BTreeSet<String> = bare[at].iter().cloned().collect();
        expected.extend(wanted.iter().copied().flatten().map(|name| (*name).to_owned()));
        if row.features.contains(&"STREAMING") {
            expected.retain(|name| !of_assets.contains(&name.as_str()));
        }
        if at == 2 && SHADOWED.iter().any(|name| row.features.contains(name)) {
            let streamed = row.features.contains(&"STREAMING").then_some("shadow_pending");
            expected.extend(["shadow_rays", "shadow_queue"].into_iter().chain(streamed).map(String::from));
        }
        let mut given = given[at].clone();
        // The test ignores how bytes are rounded, and the passes that build trees, which depend on the device.
        for set in [&mut given, &mut expected] {
            set.retain(|name| name != "rounding of assets");
        }
        assert_eq!(given, expected, "{kind} of {}", row.what);
    }
    let sum: u64 = inventory.buffers.iter().map(|buffer| buffer.bytes).sum();
    assert_eq!(sum, inventory.bytes(), "{}", row.what);
}

fn every_feature_has_a_row(inventory: &RenderInventory) {
    for feature in &inventory.features {
        assert!(rows::all().any(|row| row.features.contains(&feature.name.as_str())), "{} is not tested", feature.name);
    }
    let left_out = inventory.passes.iter().filter(|pass| !pass.made);
    for pass in left_out.map(|pass| pass.name.as_str()) {
        assert!(
            rows::all().any(|row| row.passes.iter().any(|passes| passes.contains(&pass))),
            "the pass {pass} is in no row"
        );
    }
}

/// `lean` and `picture` are the row's own.
fn what_is_carried_along_does_not_change_the_picture(row: &Row, lean: &RenderInventory, picture: &[Vec<u8>]) {
    let (laden, same) = render(row, ForcedFeatures::ALL);
    assert!(picture == same, "{}: another picture with all features", row.what);
    let carried: BTreeSet<&str> =
        laden.features.iter().filter(|feature| feature.carried).map(|feature| feature.name.as_str()).collect();
    let [needed, ..] = made(lean);
    assert!(carried.iter().all(|name| !needed.contains(*name)), "{}: {carried:?} and {needed:?}", row.what);
    let always = ["OPACITY", "NORMALS", "COLORS", "LENS", "INSTANCING", "INSTANCE_PRIMVARS", "INSTANCE_OPACITY"];
    for name in always {
        assert!(carried.contains(name) || needed.contains(name), "{}: {name} is not carried: {carried:?}", row.what);
    }
    for name in ["LOCAL_LIGHTS", "SHAPING", "IES", "DOME_TEXTURE", "LIGHT_TEXTURE", "MESH_LIGHTS"] {
        assert!(carried.contains(name) || needed.contains(name), "{}: {name} is not carried", row.what);
    }
    if !needed.contains("STREAMING") {
        assert_eq!((lean.max_levels.min(2), laden.max_levels), (lean.max_levels, 16), "{}", row.what);
        let hits =
            |inventory: &RenderInventory| inventory.buffers.iter().find(|b| b.name == "hits").cloned().expect("hits");
        let (few, many) = (hits(lean), hits(&laden));
        assert_eq!((few.bytes + few.saved, 0), (many.bytes, many.saved), "{}: what was said to be saved", row.what);
    }
}
