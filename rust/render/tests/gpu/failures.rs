// SPDX-License-Identifier: Apache-2.0
//! Fails well: one clear message, a converged session, and the next render works.

use crate::scenes::{dome, nested, prim, sphere};
use crate::support::{perspective, read_all, render, render_with_messages, request, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::settings::{Settings, Value};
use oocpt_render::{RenderRequest, Severity};

fn view(size: [u32; 2]) -> RenderRequest {
    request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::ZERO, 0.7, size))
}

#[test]
fn a_budget_too_small_is_one_error_and_a_larger_one_renders() {
    let session = session(Settings { memory_budget_mib: 4, ..settings(1, 0) });
    session.with_scene(|db| {
        db.upsert_mesh(sphere(prim("/ball", DMat4::IDENTITY), 1, 150, 0.5));
        db.upsert_light(dome([1.0; 3]));
    });
    let messages = render_with_messages(&session, &view([32, 32]));
    assert_eq!(messages.len(), 1, "one error: {messages:?}");
    assert_eq!(messages[0].severity, Severity::Error, "it is an error");
    assert!(messages[0].text.contains("budget"), "it names the budget: {}", messages[0].text);
    let changed = session.set_setting("oocpt:memoryBudget", Value::Int(2048)).expect("a valid budget");
    assert!(changed, "the budget is another one");
    render(&session, &view([32, 32]));
    let stats = session.stats();
    assert!(stats.gpu_bytes <= stats.gpu_budget_bytes, "the budget is kept: {stats:?}");
}

#[test]
fn an_unknown_device_is_one_error() {
    let session = session(Settings { device: "no such device".into(), ..settings(1, 0) });
    let messages = render_with_messages(&session, &view([8, 8]));
    assert_eq!(messages.len(), 1, "one error: {messages:?}");
    assert!(messages[0].text.contains("no such device"), "it repeats the name: {}", messages[0].text);
}

#[test]
fn absurd_image_sizes_are_refused() {
    let session = session(settings(1, 0));
    for (width, height) in [(0, 8), (8, 0), (u32::MAX, 1), (1 << 16, 1 << 16)] {
        let messages = render_with_messages(&session, &RenderRequest { width, height, ..view([8, 8]) });
        assert_eq!(messages.len(), 1, "{width} x {height}: {messages:?}");
        assert!(messages[0].text.contains("pixels"), "{}", messages[0].text);
    }
    render(&session, &view([8, 8]));
}

#[test]
fn a_camera_without_inverse_is_one_error() {
    let session = session(settings(1, 0));
    let mut request = view([8, 8]);
    request.camera.world_from_view = DMat4::ZERO;
    let messages = render_with_messages(&session, &request);
    assert_eq!(messages.len(), 1, "one error: {messages:?}");
    assert!(messages[0].text.contains("camera"), "{}", messages[0].text);
    session.with_scene(nested);
    render(&session, &view([8, 8]));
    assert!(!read_all(&session, &view([8, 8])).is_empty(), "the next render works");
}

#[test]
fn bad_geometry_is_dropped_with_one_warning_and_the_rest_renders() {
    let session = session(settings(1, 1));
    session.with_scene(|db| {
        nested(db);
        let mut bad = sphere(prim("/bad", DMat4::IDENTITY), 9, 6, 0.5);
        bad.points = oocpt_core::TypedArray::of(vec![[f32::NAN; 3]; bad.points.len()]);
        db.upsert_mesh(bad);
    });
    let messages = render_with_messages(&session, &view([24, 16]));
    assert_eq!(messages.len(), 1, "one warning: {messages:?}");
    assert_eq!(messages[0].severity, Severity::Warning, "dropping is a warning");
    assert!(messages[0].text.contains("/bad"), "with the prim path: {}", messages[0].text);
    session.restart();
    assert!(render_with_messages(&session, &view([24, 16])).is_empty(), "each problem is reported once");
}
