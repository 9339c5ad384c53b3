// SPDX-License-Identifier: Apache-2.0
//! Pause, resume, stop, restart, time limit; many sessions.

use crate::scenes::{dome, nested, prim, sphere};
use crate::support::{TIMEOUT, perspective, read, render, request, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::settings::Settings;
use oocpt_render::{AovKind, AovRequest, RenderRequest, Session, SessionOptions};
use std::time::{Duration, Instant};

fn view(size: [u32; 2]) -> RenderRequest {
    request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::ZERO, 0.7, size))
}

/// A session in the middle of a render that would take minutes.
fn long_render() -> Session {
    let session = session(settings(1 << 20, 3));
    session.with_scene(nested);
    session.render(view([128, 96]));
    let end = Instant::now() + TIMEOUT;
    while session.stats().percent_done <= 0.0 {
        assert!(Instant::now() < end, "no wave was done in time: {:?}", session.take_messages());
        std::thread::sleep(Duration::from_millis(5));
    }
    session
}

#[test]
fn stop_converges_with_the_samples_so_far() {
    let session = long_render();
    assert!(!session.is_converged(), "a million samples take longer than that");
    session.stop(true);
    assert!(session.is_converged() && session.is_stopped(), "stopped is converged");
    let color: Vec<[f32; 4]> = read(&session, &view([128, 96]), AovKind::Color);
    assert!(color.iter().any(|c| c[3] > 0.0), "the image so far was published");
    session.restart();
    assert!(!session.is_converged() && !session.is_stopped(), "a restart renders again");
}

#[test]
fn a_pause_holds_the_samples_still() {
    let session = long_render();
    session.pause();
    assert!(session.is_paused() && !session.is_converged(), "paused is not converged");
    // The waves under way end; on a busy machine that takes a while. Then nothing may move.
    let end = Instant::now() + TIMEOUT;
    let mut held = -1.0;
    while (session.stats().percent_done - held).abs() > 0.0 {
        assert!(Instant::now() < end, "samples keep coming in a pause");
        held = session.stats().percent_done;
        std::thread::sleep(Duration::from_millis(500));
    }
    std::thread::sleep(Duration::from_millis(500));
    assert!((session.stats().percent_done - held).abs() < f32::EPSILON, "no wave may start in a pause");
    session.resume();
    let end = Instant::now() + TIMEOUT;
    while session.stats().percent_done <= held {
        assert!(Instant::now() < end, "the render did not go on");
        std::thread::sleep(Duration::from_millis(5));
    }
    session.pause();
    session.stop(true);
    assert!(session.is_converged(), "stop works in a pause");
}

#[test]
fn a_time_limit_ends_the_render_with_an_image() {
    let session = session(Settings { time_limit_secs: 0.5, ..settings(1 << 20, 3) });
    session.with_scene(nested);
    render(&session, &view([64, 48]));
    let stats = session.stats();
    assert!(stats.percent_done < 100.0, "a million samples do not fit the limit: {stats:?}");
    let color: Vec<[f32; 4]> = read(&session, &view([64, 48]), AovKind::Color);
    assert!(color.iter().any(|c| c[3] > 0.0), "what was rendered is published");
}

#[test]
fn a_render_that_ends_early_has_whole_samples() {
    let session = long_render();
    let end = Instant::now() + TIMEOUT;
    let before = session.generation() - 1;
    assert_eq!(session.finish_early(before + 1), None, "no job is newer than that one");
    let early = loop {
        if let Some(early) = session.finish_early(before) {
            break early;
        }
        assert!(Instant::now() < end, "no sample of each pixel is done: {:?}", session.take_messages());
        std::thread::sleep(Duration::from_millis(5));
    };
    assert!(session.wait_converged(Duration::from_secs(20)), "it ends soon");
    let reached = session.reached(before).expect("it is the same job");
    assert!(early.samples >= 1 && reached.samples >= early.samples && reached.target == 1 << 20, "{reached:?}");
    assert_eq!(reached.samples, session.stats().samples_completed, "as the stats say");
    assert!(session.stats().percent_done < 100.0 && !session.is_stopped(), "not to the end, and not given up");
    let request =
        RenderRequest { aovs: vec![AovRequest { kind: AovKind::SampleCount, clear: [0.0; 4] }], ..view([128, 96]) };
    assert!(read::<[f32; 4]>(&session, &view([128, 96]), AovKind::Color).iter().any(|c| c[3] > 0.0), "it is there");
    session.render(request);
    assert!(!session.is_converged() && session.reached(before).is_none(), "another job begins at its beginning");
    session.stop(true);
}

#[test]
fn a_newer_request_replaces_the_one_under_way() {
    let session = long_render();
    assert!(
        session.set_setting("oocpt:samplesPerPixel", oocpt_core::settings::SettingValue::Int(2)).expect("valid"),
        "changed"
    );
    render(&session, &view([16, 12]));
    assert_eq!(session.stats().samples_completed, 2, "the new request was rendered to its end");
}

#[test]
fn an_interactive_render_shows_images_before_its_end_and_a_batch_render_does_not() {
    for interactive in [true, false] {
        let session = session(Settings { interactive, ..settings(1 << 20, 3) });
        session.with_scene(nested);
        let request = view([128, 96]);
        session.render(request.clone());
        let mut pixels = vec![0_u8; 128 * 96 * 16];
        let mut shown = false;
        let end = Instant::now() + if interactive { TIMEOUT } else { Duration::from_secs(2) };
        while !shown && Instant::now() < end {
            shown = session.read_aov(AovKind::Color, &mut pixels);
            std::thread::sleep(Duration::from_millis(10));
        }
        assert!(!session.is_converged(), "a million samples take longer than that");
        assert_eq!(shown, interactive, "images before the end are for interactive renders");
    }
}

#[test]
fn scene_lights_can_be_switched_off() {
    let session = session(Settings { enable_scene_lights: false, ..settings(2, 1) });
    session.with_scene(nested);
    let request = view([16, 12]);
    render(&session, &request);
    let color: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    assert!(color.iter().all(|c| c[..3] == [0.0; 3]), "no light, no radiance");
    assert!(color.iter().any(|c| c[3] > 0.0), "the geometry still covers pixels");
}

#[test]
fn a_request_for_depth_alone_traces_no_paths() {
    let session = session(settings(1 << 20, 3));
    session.with_scene(nested);
    let mut request = view([16, 12]);
    request.aovs = vec![AovRequest { kind: AovKind::Depth, clear: [1.0, 0.0, 0.0, 0.0] }];
    render(&session, &request);
    let depth: Vec<f32> = read(&session, &request, AovKind::Depth);
    assert!(depth.iter().any(|d| *d < 1.0), "the scene is in view");
    assert_eq!(session.stats().rays_traced, 0, "no path is traced for an image without colour");
}

/// After another render: memory of a device is not zero when it is used again.
#[test]
fn a_request_without_images_converges_at_once() {
    for force_streaming in [false, true] {
        let options = SessionOptions { validation: true, force_streaming, ..SessionOptions::default() };
        let other = Session::with_options(settings(4, 1), options);
        other.with_scene(nested);
        render(&other, &view([64, 48]));
        let session = Session::with_options(settings(4, 1), options);
        session.with_scene(nested);
        session.render(RenderRequest { aovs: Vec::new(), ..view([16, 12]) });
        assert!(session.wait_converged(TIMEOUT), "nothing to do is done");
        let messages = session.take_messages();
        assert!(messages.is_empty(), "and no fault: {messages:?}");
        let stats = session.stats();
        assert_eq!((stats.rays_traced, stats.nonfinite_samples), (0, 0), "no path is traced for no image");
    }
}

#[test]
fn sessions_come_and_go_without_growing_device_memory() {
    let mut used = Vec::new();
    for _ in 0..20 {
        // A budget that no other test asks for: a device of its own, whose memory only these sessions use.
        let session = session(Settings { memory_budget_mib: 1537, ..settings(1, 0) });
        session.with_scene(|db| {
            db.upsert_mesh(sphere(prim("/ball", DMat4::IDENTITY), 1, 20, 0.5));
            db.upsert_light(dome([1.0; 3]));
        });
        render(&session, &view([8, 8]));
        used.push(session.stats().gpu_bytes);
    }
    assert_eq!(used[2], used[19], "device memory grows with each session: {used:?}");
}

/// More pixels than the first slice of `trace_planes` has.
#[test]
fn every_pixel_of_a_large_image_gets_its_first_hit() {
    let session = session(settings(1, 0));
    session.with_scene(nested);
    let request = view([400, 300]);
    render(&session, &request);
    let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
    let depth: Vec<f32> = read(&session, &request, AovKind::CameraDepth);
    assert!(ids.contains(&-1), "background somewhere");
    let wrong = ids.iter().zip(&depth).filter(|(id, depth)| (**id < 0) != (**depth == 0.0)).count();
    assert_eq!(wrong, 0, "pixels whose id and depth disagree, of {}", ids.len());
}
