// SPDX-License-Identifier: Apache-2.0
//! The picture's error as the renderer states it: the same whatever the budget; a report that survives; stopping at a
//! target. Other tests use its scenes too.

use crate::lights::light;
use crate::scenes::{dome, nested, prim, sphere, square, sun};
use crate::support::{perspective, read, render, render_with_messages, request, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::LightKind;
use oocpt_core::scene::{MaterialDesc, NodeDesc, ParamDesc, ParamValue, SceneDb};
use oocpt_core::settings::Settings;
use oocpt_core::stats::ErrorRow;
use oocpt_render::error_report::ErrorReport;
use oocpt_render::{AovKind, AovRequest, RenderRequest, Session, SessionOptions, Severity};
use std::path::PathBuf;

pub(crate) const SIZE: [u32; 2] = [20, 14];

pub(crate) fn view(size: [u32; 2]) -> RenderRequest {
    let mut view = request(perspective(DVec3::new(2.0, 3.0, 5.0), DVec3::new(0.0, 0.5, 0.0), 0.8, size));
    view.aovs = vec![AovRequest { kind: AovKind::Color, clear: [0.0; 4] }];
    view
}

pub(crate) fn floor(db: &mut SceneDb) {
    db.upsert_mesh(square(prim("/floor", DMat4::from_scale(DVec3::splat(6.0))), 1, 0.5));
    db.upsert_mesh(sphere(prim("/ball", DMat4::from_translation(DVec3::Y)), 2, 10, 0.7));
}

pub(crate) fn overcast(db: &mut SceneDb) {
    floor(db);
    db.upsert_light(dome([0.6, 0.7, 0.8]));
}

pub(crate) fn low_sun(db: &mut SceneDb) {
    floor(db);
    db.upsert_light(sun(2.0, 12.0, DMat4::from_rotation_x(-0.4)));
}

pub(crate) fn lamp(db: &mut SceneDb, radius: f32, at: DVec3, number: u32) {
    let mut lamp = light(LightKind::Sphere { radius, treat_as_point: false }, DMat4::from_translation(at));
    lamp.prim.path = format!("/lamp_{number}").into();
    lamp.intensity = 0.4 / (radius * radius);
    db.upsert_light(lamp);
}

pub(crate) fn lamps(db: &mut SceneDb) {
    floor(db);
    for i in 0..24 {
        let angle = f64::from(i) * 2.4;
        lamp(db, 0.05, DVec3::new(3.0 * angle.cos(), 0.4 + 0.1 * f64::from(i), 3.0 * angle.sin()), i);
    }
}

pub(crate) fn window(db: &mut SceneDb) {
    floor(db);
    let kind = LightKind::Rect { width: 2.0, height: 1.0, texture: None };
    db.upsert_light(light(kind, DMat4::from_translation(DVec3::new(0.0, 3.0, 1.0)) * DMat4::from_rotation_x(-1.3)));
}

pub(crate) fn surface(path: &str, params: &[(&str, ParamValue)]) -> MaterialDesc {
    let param = |(name, value): &(&str, ParamValue)| ParamDesc { name: (*name).into(), value: value.clone() };
    let node = NodeDesc {
        path: format!("{path}/surface").into(),
        kind: "UsdPreviewSurface".into(),
        params: params.iter().map(param).collect(),
        connections: Vec::new(),
    };
    MaterialDesc { path: path.into(), nodes: vec![node], surface: Some(0), ..MaterialDesc::default() }
}

/// A small lamp and a ball of the given material: rays from the floor seldom find the lamp by way of the ball, which
/// gives fireflies.
fn caustic(db: &mut SceneDb, params: &[(&str, ParamValue)]) {
    floor(db);
    db.upsert_material(surface("/shiny", params));
    let mut ball = sphere(prim("/shiny_ball", DMat4::from_translation(DVec3::new(1.2, 0.8, 1.0))), 3, 12, 0.5);
    ball.material = Some("/shiny".into());
    db.upsert_mesh(ball);
    lamp(db, 0.12, DVec3::new(0.0, 2.5, 2.5), 0);
    db.upsert_light(dome([0.05; 3]));
}

pub(crate) fn mirror(db: &mut SceneDb) {
    caustic(db, &[("metallic", ParamValue::Float(1.0)), ("roughness", ParamValue::Float(0.05))]);
}

pub(crate) fn gloss(db: &mut SceneDb) {
    caustic(db, &[("metallic", ParamValue::Float(1.0)), ("roughness", ParamValue::Float(0.3))]);
}

fn error_of(session: &Session) -> ErrorRow {
    let row = session.stats().error.expect("there was an error to tell");
    let ErrorRow { samples, estimate, worst, truth, is_last, .. } = row;
    ErrorRow { samples, estimate, worst, truth, is_last, ..ErrorRow::default() }
}

#[test]
fn the_stated_error_does_not_depend_on_budget_or_wave_cuts() {
    let view = view([40, 30]);
    let told = |options: SessionOptions, report: &str| {
        let settings = Settings { report: report.into(), chunk_size_kib: 16, ..settings(21, 2) };
        let session = Session::with_options(settings, SessionOptions { validation: true, ..options });
        session.with_scene(nested);
        render(&session, &view);
        (error_of(&session), read::<f32>(&session, &view, AovKind::Color))
    };
    let plain = told(SessionOptions::default(), "");
    let streamed = told(SessionOptions { force_streaming: true, ..SessionOptions::default() }, "");
    let file = temporary("cuts");
    let cut = told(SessionOptions::default(), &file.to_string_lossy());
    std::fs::remove_file(&file).expect("the report was written");
    assert!(plain.0.samples == 21 && plain.0.is_last && plain.0.estimate.is_some(), "{:?}", plain.0);
    assert_eq!(plain, streamed, "streaming changes nothing");
    assert_eq!(plain, cut, "neither do waves that end with octaves");
}

fn temporary(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("oocpt-{name}-{}.jsonl", std::process::id()))
}

#[test]
fn a_report_has_a_row_at_each_power_of_two_and_at_the_end() {
    let file = temporary("rows");
    let session = session(Settings { report: file.to_string_lossy().into(), ..settings(24, 1) });
    session.with_scene(nested);
    let view = view(SIZE);
    render(&session, &view);
    session.restart();
    render(&session, &view);
    let reports = ErrorReport::read_all(&file).expect("a report");
    std::fs::remove_file(&file).expect("it is there");
    assert_eq!(reports.len(), 2, "two renders");
    let rows = &reports[0].rows;
    let samples: Vec<u32> = rows.iter().map(|row| row.samples).collect();
    assert_eq!(samples, [1, 2, 4, 8, 16, 24], "powers of two and the end");
    assert!(
        rows.windows(2).all(|pair| pair[0].seconds < pair[1].seconds && pair[0].rays < pair[1].rays),
        "time goes on"
    );
    assert!(
        rows[0].estimate.is_none() && rows[1..].iter().all(|row| row.estimate.is_some()),
        "two samples tell something"
    );
    assert!(rows.iter().all(|row| row.is_last == (row.samples == 24)), "the end is told");
    let peak = reports[0].usage.as_ref().map_or(0, |usage| usage.gpu_peak_bytes);
    assert!(rows.iter().all(|row| 0 < row.gpu_bytes && row.gpu_bytes <= peak), "device memory: {rows:?}");
    assert!(rows[0].host_peak_bytes > 0, "host memory");
    assert!(
        (2..=5).contains(&rows[5].worst.len()) && rows[5].worst.windows(2).all(|pair| pair[0].error >= pair[1].error),
        "{:?}",
        rows[5].worst
    );
    assert_eq!((reports[0].header.width, reports[0].header.samples_target), (SIZE[0], 24), "what was rendered");
}

#[test]
fn a_report_ends_with_what_streaming_used() {
    let file = temporary("usage");
    let settings = Settings { report: file.to_string_lossy().into(), chunk_size_kib: 16, ..settings(2, 1) };
    let forced = SessionOptions { force_streaming: true, validation: true, ..SessionOptions::default() };
    let session = Session::with_options(settings, forced);
    session.with_scene(nested);
    render(&session, &view(SIZE));
    let reports = ErrorReport::read_all(&file).expect("a report");
    std::fs::remove_file(&file).expect("it is there");
    let usage = reports[0].usage.as_ref().expect("the render ended");
    let stats = session.stats();
    let streaming = &stats.streaming;
    assert!(!usage.in_core && usage.loads > 0 && usage.bytes_paged > 0, "{usage:?}");
    assert_eq!((usage.loads, usage.reloads, usage.chunks), (streaming.loads, streaming.reloads, streaming.chunks));
    let seconds = (streaming.seconds_loading, streaming.seconds_waiting);
    assert_eq!((usage.seconds_loading, usage.seconds_waiting), seconds);
    assert_eq!((usage.bytes_paged, usage.rays_traced), (streaming.bytes_paged, stats.rays_traced));
    assert!(0 < usage.geometry_peak_bytes && usage.geometry_peak_bytes <= usage.geometry_budget_bytes, "{usage:?}");
}

#[test]
fn a_report_that_cannot_be_written_is_one_warning() {
    let session = session(Settings {
        report: "/nowhere/at/all.jsonl".into(),
        reference: "/nowhere/at/all.exr".into(),
        ..settings(4, 1)
    });
    session.with_scene(nested);
    let messages = render_with_messages(&session, &view(SIZE));
    let warned =
        |key: &str| messages.iter().filter(|m| m.text.starts_with(key) && m.severity == Severity::Warning).count();
    assert_eq!((warned("oocpt:report"), warned("oocpt:reference"), messages.len()), (1, 1, 2), "{messages:?}");
    assert!(session.stats().error.is_some(), "the picture is rendered and its error known");
}

#[test]
fn a_render_stops_at_its_target_at_the_same_samples_in_core_and_streaming() {
    let samples = |options: SessionOptions, target: f32| {
        let settings = Settings { target_error: target, chunk_size_kib: 16, ..settings(4096, 1) };
        let session = Session::with_options(settings, SessionOptions { validation: true, ..options });
        session.with_scene(nested);
        let view = view(SIZE);
        render(&session, &view);
        let row = error_of(&session);
        assert!(row.estimate.is_some_and(|e| e.high <= f64::from(target)), "{row:?}");
        (row, read::<f32>(&session, &view, AovKind::Color))
    };
    let coarse = samples(SessionOptions::default(), 0.02);
    let fine = samples(SessionOptions::default(), 0.0004);
    assert!(coarse.0.samples < fine.0.samples && fine.0.samples < 4096, "{:?} {:?}", coarse.0, fine.0);
    assert!(fine.0.samples.is_power_of_two(), "it is decided at powers of two: {}", fine.0.samples);
    let streamed = samples(SessionOptions { force_streaming: true, ..SessionOptions::default() }, 0.0004);
    assert_eq!(fine, streamed, "same samples, same bits");
}

/// One square of known brightness, seen through half of its samples.
#[test]
fn a_reference_gives_the_true_error() {
    let file = std::env::temp_dir().join(format!("oocpt-reference-{}.exr", std::process::id()));
    let view = view(SIZE);
    let of = |settings: Settings| {
        let session = session(settings);
        session.with_scene(overcast);
        render(&session, &view);
        (read::<f32>(&session, &view, AovKind::Color), error_of(&session))
    };
    let (reference, _) = of(Settings { seed: 5, ..settings(256, 2) });
    let (width, height) = (SIZE[0] as usize, SIZE[1] as usize);
    oocpt_judge::Image::from_data(width, height, 4, reference.clone())
        .and_then(|image| image.write_exr(&file))
        .expect("a picture");
    let path: String = file.to_string_lossy().into();
    let (picture, row) = of(Settings { reference: path.clone(), ..settings(16, 2) });
    let truth = row.truth.expect("there is a reference");
    let pairs = || picture.iter().zip(&reference).enumerate().filter(|(k, _)| k % 4 != 3).map(|(_, pair)| pair);
    let count = f64::from(3 * SIZE[0] * SIZE[1]);
    let mean =
        |of: &dyn Fn(f64, f64) -> f64| pairs().map(|(x, r)| of(f64::from(*x), f64::from(*r))).sum::<f64>() / count;
    let rel_mse = mean(&|x, r| (x - r).powi(2) / (r * r + 1e-2));
    let rmse = mean(&|x, r| (x - r).powi(2)).sqrt();
    assert!((truth.rel_mse / rel_mse - 1.0).abs() < 1e-9 && (truth.rmse / rmse - 1.0).abs() < 1e-9, "{truth:?}");
    assert!(truth.flip > 0.0 && truth.flip < 0.2, "noise of sixteen samples is seen a little: {}", truth.flip);
    let (_, same) = of(Settings { reference: path, seed: 5, ..settings(256, 2) });
    let none = same.truth.expect("there is a reference");
    assert!(none.rel_mse < 1e-12 && none.flip < 1e-6, "the same picture: {none:?}");
    std::fs::remove_file(file).expect("it is there");
}

/// Without their meshes the pictures above would be meaningless.
#[test]
fn the_error_scenes_are_not_empty() {
    let session = session(settings(4, 1));
    session.with_scene(mirror);
    let view = view(SIZE);
    render(&session, &view);
    let lit = read::<f32>(&session, &view, AovKind::Color).chunks_exact(4).filter(|p| p[0] > 1e-3).count();
    assert!(lit > 200, "{lit} pixels are lit");
}
