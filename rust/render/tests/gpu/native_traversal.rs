// SPDX-License-Identifier: Apache-2.0
//! Both traversal backends on the same scenes: the same bits of every image, in core and streaming; and the choice of
//! the backend.
//!
//! All other tests pin the shaders. With `OOCPT_TEST_TRAVERSAL=native` they run on the host instead.

use crate::lights::TestFiles;
use crate::motion::{falling, mill};
use crate::scenes::{constant, deforming, dome, features, instanced, instancer, mesh, nested, prim};
use crate::streaming::{DEFORMING, MOVING, MOVING_BULBS, MOVING_LAMPS, SCENES, smallest_budget};
use crate::support::{self, perspective, read_all, render, request, settings};
use glam::{DMat4, DQuat, DVec3, DVec4};
use oocpt_abi::Features;
use oocpt_core::TypedArray;
use oocpt_core::inventory::TraversalUse;
use oocpt_core::scene::{CurveBasis, CurveWrap, CurvesDesc, Interpolation, MeshDesc, PrimShape, Primvar, SceneDb};
use oocpt_core::settings::{Settings, TraversalKind};
use oocpt_render::{ForcedFeatures, RenderRequest, Session, SessionOptions, Severity};
use std::sync::Arc;

/// All images of a scene, and the backend that walked its rays.
fn images(
    build: fn(&mut SceneDb),
    settings: Settings,
    streams: bool,
    request: &RenderRequest,
) -> (Vec<Vec<u8>>, TraversalUse, Session) {
    images_with(build, settings, streams, Features::empty(), request)
}

/// The same with these features compiled in although the scene does not need them.
fn images_with(
    build: fn(&mut SceneDb),
    settings: Settings,
    streams: bool,
    features: Features,
    request: &RenderRequest,
) -> (Vec<Vec<u8>>, TraversalUse, Session) {
    let forced_features = ForcedFeatures { features, levels: false };
    let options =
        SessionOptions { validation: true, force_streaming: streams, forced_features, ..SessionOptions::default() };
    let session = Session::with_options(settings, options);
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(build);
    render(&session, request);
    let stats = session.stats();
    assert_eq!(stats.streaming.in_core, !streams, "as asked for");
    (read_all(&session, request), stats.inventory.traversal, session)
}

/// Compares both backends; on a device with memory of its own, expects the message instead.
pub(crate) fn same_bits(
    what: &str,
    build: fn(&mut SceneDb),
    settings: &Settings,
    streams: bool,
    request: &RenderRequest,
) {
    let by = |traversal| support::filtering(Settings { traversal, ..settings.clone() });
    let (shaders, used, session) = images(build, by(TraversalKind::Compute), streams, request);
    assert_eq!(used.backend, "compute", "{what}: {used:?}");
    if !session.device_report().expect("a device").host_memory {
        return refused(build, by(TraversalKind::Native), request);
    }
    let (host, used, _) = images(build, by(TraversalKind::Native), streams, request);
    assert_eq!(used.backend, "native", "{what}: {used:?}");
    for (image, (a, b)) in shaders.iter().zip(&host).enumerate() {
        assert!(a == b, "{what}: image {image} differs");
    }
}

fn refused(build: fn(&mut SceneDb), settings: Settings, request: &RenderRequest) {
    let session = support::session(settings);
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(build);
    let messages = support::render_with_messages(&session, request);
    assert_eq!(messages.len(), 1, "one message: {messages:?}");
    let message = &messages[0];
    assert!(message.severity == Severity::Error && message.text.contains("oocpt:traversal"), "{message:?}");
}

fn view(eye: DVec3, target: DVec3) -> RenderRequest {
    request(perspective(eye, target, 0.8, [48, 32]))
}

#[test]
fn both_backends_agree_on_opacity_nesting_and_lights() {
    let request = view(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0));
    same_bits("features", features, &settings(8, 3), false, &request);
    same_bits("nested", nested, &settings(8, 3), false, &request);
    let adaptive = Settings { adaptive_sampling: true, ..settings(64, 2) };
    same_bits("adaptive", features, &adaptive, false, &request);
}

/// Forty squares in one place, by two levels of instances, each below a roof of its own height, so that those of higher
/// records are entered first. Of equally close hits the one of the lowest records is met, whichever thread finds it.
fn coincident(db: &mut SceneDb) {
    let heights = |count: i32| -> Vec<_> {
        (1 - count..=0).map(|i| (DVec3::ZERO, DQuat::IDENTITY, DVec3::new(1.0, 2f64.powi(i), 1.0))).collect()
    };
    db.upsert_light(dome([0.3, 0.4, 0.6]));
    db.upsert_instancer(instancer(prim("/outer", DMat4::IDENTITY), "/outer/clump", &heights(8)));
    let clump = instanced(prim("/outer/clump", DMat4::IDENTITY), "/outer");
    db.upsert_instancer(instancer(clump, "/outer/clump/mat", &heights(5)));
    let floor = [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]];
    let roof = [[0.8, 1.0, 0.8], [1.0, 1.0, 0.8], [1.0, 1.0, 1.0]];
    let points = floor.into_iter().chain(roof).collect();
    let mat = instanced(prim("/outer/clump/mat", DMat4::IDENTITY), "/outer/clump");
    let mat = mesh(mat, 1, points, &[vec![0, 1, 2, 3], vec![4, 5, 6]], 0.5);
    db.upsert_mesh(mat);
}

#[test]
fn both_backends_resolve_coincident_hits_alike() {
    let request = view(DVec3::new(0.3, 2.0, 0.4), DVec3::ZERO);
    same_bits("coincident", coincident, &settings(4, 3), false, &request);
}

#[test]
fn both_backends_agree_on_scenes_of_many_chunks() {
    for scene in &SCENES {
        let request = view(scene.eye, scene.target);
        let small = Settings { chunk_size_kib: 16, ..settings(4, 3) };
        same_bits(scene.name, scene.build, &small, false, &request);
        // Rays wait, chunks come and go.
        let tight = Settings { geometry_budget_kib: 2 * smallest_budget(scene), ..small };
        same_bits(scene.name, scene.build, &tight, true, &request);
    }
}

#[test]
fn both_backends_agree_on_motion() {
    let build = |db: &mut SceneDb| mill(db, 0.0, 1.0);
    let request = view(DVec3::new(0.0, 3.0, 9.0), DVec3::Y);
    same_bits("a mill", build, &settings(16, 3), false, &request);
    same_bits("adaptive", build, &Settings { adaptive_sampling: true, ..settings(64, 2) }, false, &request);
    // Of more than two keys.
    same_bits("falling", falling, &settings(64, 1), false, &view(DVec3::Z * 4.0, DVec3::ZERO));
    let request = view(MOVING.eye, MOVING.target);
    let small = Settings { chunk_size_kib: 16, ..settings(4, 3) };
    same_bits(MOVING.name, MOVING.build, &small, false, &request);
    let tight = Settings { geometry_budget_kib: 2 * smallest_budget(&MOVING), ..small };
    same_bits(MOVING.name, MOVING.build, &tight, true, &request);
}

#[test]
fn both_backends_agree_on_moving_lights() {
    for scene in [&MOVING_LAMPS, &MOVING_BULBS] {
        let request = view(scene.eye, scene.target);
        let small = Settings { chunk_size_kib: 16, ..settings(4, 3) };
        same_bits(scene.name, scene.build, &small, false, &request);
        let tight = Settings { geometry_budget_kib: 2 * smallest_budget(scene), ..small };
        same_bits(scene.name, scene.build, &tight, true, &request);
    }
}

#[test]
fn both_backends_agree_on_deformation_and_clipping() {
    let mut request = view(DEFORMING.eye, DEFORMING.target);
    let small = Settings { chunk_size_kib: 16, ..settings(4, 3) };
    same_bits(DEFORMING.name, DEFORMING.build, &small, false, &request);
    let tight = Settings { geometry_budget_kib: 2 * smallest_budget(&DEFORMING), ..small };
    same_bits(DEFORMING.name, DEFORMING.build, &tight, true, &request);
    request.camera.clip_planes = vec![DVec4::new(0.1, 0.0, -1.0, -14.0), DVec4::new(0.0, 0.2, 1.0, 19.0)];
    same_bits("planes", DEFORMING.build, &tight, true, &request);
}

/// Clouds of points: one with a width for all, one with widths and opacities of its own, and one that moves.
fn clouds(db: &mut SceneDb) {
    let points = |path: &str, id: i32, count: u16| {
        let part = |i: u16, step: f32| 2.0 * (f32::from(i + 1) * step).fract() - 1.0;
        let places = (0..count).map(|i| [part(i, 0.754_877_7), part(i, 0.569_840_3), part(i, 0.381_966)]);
        let shape = PrimShape::Points;
        MeshDesc {
            shape,
            widths: constant(0.08_f32),
            ..mesh(prim(path, DMat4::IDENTITY), id, places.collect(), &[], 0.5)
        }
    };
    let by_point = |values: Vec<f32>| {
        Some(Primvar { interpolation: Interpolation::Vertex, values: TypedArray::of(values), indices: None })
    };
    db.upsert_light(dome([0.3, 0.4, 0.6]));
    db.upsert_mesh(points("/same", 1, 301));
    db.upsert_mesh(MeshDesc {
        widths: by_point((0..203).map(|i| 0.02 + 0.001 * i as f32).collect()),
        display_opacity: by_point((0..203).map(|i| (i % 5) as f32 / 4.0).collect()),
        ..points("/own", 2, 203)
    });
    db.upsert_mesh(deforming(points("/moving", 3, 97), &[0.0, 1.0], &|p, time| {
        (p.as_dvec3() * (1.0 + 0.3 * time)).as_vec3()
    }));
}

#[test]
fn both_backends_agree_on_points() {
    let request = view(DVec3::new(1.5, 2.0, 3.0), DVec3::ZERO);
    let small = Settings { chunk_size_kib: 16, ..settings(4, 3) };
    same_bits("clouds", clouds, &small, false, &request);
    same_bits("clouds", clouds, &small, true, &request);
}

/// Tubes of many pieces and balls that rays go through by chance, at both of their surfaces, in instances, too.
fn veils(db: &mut SceneDb) {
    let along = |i: u16, k: u16| {
        let part = |step: f32| 2.0 * (f32::from(i + 1) * step).fract() - 1.0;
        let bend = 0.15 * f32::from(k * k) * part(0.381_966);
        [part(0.754_877_7) + bend, 0.4 * f32::from(k) - 0.8, part(0.569_840_3) - bend]
    };
    let curves = CurvesDesc {
        basis: CurveBasis::BSpline,
        wrap: CurveWrap::Pinned,
        counts: TypedArray::of(vec![5_i32; 40]),
        indices: None,
    };
    let tubes = MeshDesc {
        shape: PrimShape::Curves(curves),
        widths: constant(0.15_f32),
        display_opacity: constant(0.4_f32),
        points: TypedArray::of::<[f32; 3]>((0..40).flat_map(|i| (0..5).map(move |k| along(i, k))).collect()),
        ..mesh(prim("/tubes", DMat4::IDENTITY), 1, Vec::new(), &[], 0.5)
    };
    let balls = MeshDesc {
        shape: PrimShape::Points,
        widths: constant(0.3_f32),
        points: TypedArray::of::<[f32; 3]>((0..40).map(|i| along(i, i % 5)).collect()),
        prim: instanced(prim("/many/balls", DMat4::IDENTITY), "/many"),
        prim_id: 2,
        ..tubes.clone()
    };
    let places: Vec<_> =
        (0..3).map(|i| (DVec3::new(f64::from(i) - 1.0, 0.0, -1.0), DQuat::IDENTITY, DVec3::splat(0.5))).collect();
    db.upsert_light(dome([0.3, 0.4, 0.6]));
    db.upsert_instancer(instancer(prim("/many", DMat4::IDENTITY), "/many/balls", &places));
    db.upsert_mesh(balls);
    db.upsert_mesh(tubes);
}

#[test]
fn both_backends_agree_on_partial_opacity_of_round_leaves() {
    let request = view(DVec3::new(1.5, 2.0, 3.0), DVec3::ZERO);
    let small = Settings { chunk_size_kib: 16, ..settings(4, 3) };
    same_bits("veils", veils, &small, false, &request);
    same_bits("veils", veils, &small, true, &request);
}

#[test]
fn the_traversal_backend_is_reported_with_its_reason() {
    let request = view(SCENES[8].eye, SCENES[8].target);
    let by = |traversal| Settings { traversal, ..settings(1, 1) };
    let (_, used, session) = images(SCENES[8].build, by(TraversalKind::Auto), false, &request);
    let is_host = session.device_report().expect("a device").host_memory;
    assert_eq!(used.backend, if is_host { "native" } else { "compute" }, "{used:?}");
    assert!(used.why.contains("processor"), "{used:?}");
    if is_host {
        let inventory = session.stats().inventory;
        let of_trace = inventory.passes.iter().filter(|pass| pass.name.starts_with("intersect_"));
        assert!(of_trace.clone().count() == 2 && of_trace.clone().all(|pass| !pass.made), "not compiled for nothing");
        let natively = |features| images_with(SCENES[8].build, by(TraversalKind::Native), false, features, &request).1;
        let used = natively(Features::CUTOUTS);
        assert_eq!(used.backend, "native", "{used:?}");
        let used = natively(Features::CUTOUTS | Features::PATTERNS | Features::CUTOUT_PROGRAMS);
        assert!(used.backend == "compute" && used.why.contains("cutouts by programs"), "{used:?}");
    }
}
