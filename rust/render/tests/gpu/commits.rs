// SPDX-License-Identifier: Apache-2.0
//! Commits beside the host's thread: what is rendered while one is under way, and what a host is told. By the order of
//! events: commits wait at a gate that the tests open.

use crate::scenes::{dome, prim, sphere};
use crate::support::{TIMEOUT, perspective, read, settings};
use glam::{DMat4, DVec3};
use oocpt_core::settings::Settings;
use oocpt_render::{AovKind, AovRequest, CommitGate, RenderRequest, SceneEdit, Session, SessionOptions, Severity};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A dome of this radiance, which is what the corners of a picture show.
fn lit(radiance: f32) -> SceneEdit {
    SceneEdit::upsert("/dome", move |db| db.upsert_light(dome([radiance; 3])))
}

/// A picture of this width: no two that these tests ask for have the same.
fn view(width: u32) -> RenderRequest {
    let camera = perspective(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO, 0.7, [width, 12]);
    let aovs = vec![AovRequest { kind: AovKind::Color, clear: [0.0; 4] }];
    RenderRequest { width, height: 12, camera, aovs, window: None }
}

/// What the corner of the picture shows, to a thousandth.
fn corner(session: &Session, width: u32) -> f32 {
    (1000.0 * read::<[f32; 4]>(session, &view(width), AovKind::Color)[0][0]).round() / 1000.0
}

/// A session that has rendered a dome of 0.25, 16 pixels wide, and its gate.
fn session(interactive: bool) -> (Session, Arc<CommitGate>) {
    let options = SessionOptions { validation: true, ..SessionOptions::default() };
    let session = Session::with_options(Settings { interactive, ..settings(2, 1) }, options);
    let ball = |db: &mut oocpt_core::scene::SceneDb| {
        db.upsert_mesh(sphere(prim("/ball", DMat4::IDENTITY), 1, 8, 0.5));
    };
    session.edit(vec![SceneEdit::upsert("/ball", ball), lit(0.25)]);
    session.render(view(16));
    finish(&session);
    assert_eq!(corner(&session, 16), 0.25, "the first picture");
    let gate = session.commit_gate();
    assert_eq!((gate.arrived(), session.generation()), (1, 1), "one commit, one job");
    (session, gate)
}

fn finish(session: &Session) {
    assert!(session.wait_converged(TIMEOUT), "it ends");
    assert_eq!(session.take_messages(), [], "without a message");
}

/// Begins a commit of a dome of this radiance, which waits at the closed gate.
fn begin(session: &Session, gate: &CommitGate, radiance: f32, width: u32) {
    gate.close();
    let arrived = gate.arrived();
    session.edit(vec![lit(radiance)]);
    session.render(view(width));
    assert!(gate.wait_for(arrived + 1, TIMEOUT), "the commit begins");
}

fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let end = Instant::now() + TIMEOUT;
    while !is_so() {
        assert!(Instant::now() < end, "{what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn committed(session: &Session) {
    wait_until("the commit ends", || !session.commit_progress().is_pending);
}

#[test]
fn a_host_does_not_wait_for_a_commit() {
    for interactive in [true, false] {
        let (session, gate) = session(interactive);
        begin(&session, &gate, 0.5, 17);
        session.edit(vec![lit(0.75)]);
        session.render(view(18));
        session.pause();
        session.resume();
        let states = [session.is_paused(), session.is_stopped(), session.is_converged()];
        assert_eq!(states, [false; 3], "a picture is to come");
        let _ = (session.stats(), session.settings(), session.take_messages());
        assert!(!session.wait_converged(Duration::from_millis(1)), "not converged while a commit is pending");
        assert!(session.commit_progress().is_pending && gate.passed() == 1, "all that before the commit was done");
        gate.open();
        finish(&session);
        assert_eq!(corner(&session, 18), 0.75, "the newest");
        let progress = session.commit_progress();
        assert_eq!((progress.ended, progress.in_host_thread, progress.is_pending), (3, 0, false), "{progress:?}");
        session.render(view(18));
        assert!(session.is_converged() && gate.arrived() == 3, "nothing new, no commit");
    }
}

#[test]
fn a_camera_that_moves_during_a_commit_shows_the_scene_of_before_and_then_that_of_after() {
    let (session, gate) = session(true);
    begin(&session, &gate, 0.5, 16);
    session.render(view(17));
    wait_until("a picture of the scene of before", || session.shown_generation() == 2);
    assert_eq!(corner(&session, 17), 0.25, "the scene of before");
    assert!(!session.is_converged() && gate.passed() == 1, "the commit is still under way");
    session.render(view(18));
    gate.admit(1);
    assert!(gate.wait_for(3, TIMEOUT), "the commit of the moves");
    let newest = session.generation();
    assert_eq!(newest, 4, "first, two moves, the scene of after");
    wait_until("the picture of the first commit", || session.shown_generation() == newest);
    assert_eq!(corner(&session, 18), 0.5, "the scene of after, and the camera that came during its commit");
    gate.open();
    finish(&session);
    assert_eq!((gate.arrived(), session.generation()), (3, newest), "both moves share a commit, which changes nothing");
    assert_eq!(session.shown_generation(), session.generation(), "the newest job is shown");
}

#[test]
fn pictures_do_not_wait_for_threads_that_build() {
    for comes_with_a_request in [true, false] {
        pictures_of_a_busy_commit_thread(comes_with_a_request);
    }
}

/// The commit thread takes edits that no request came after too, and pictures do not wait for those either.
fn pictures_of_a_busy_commit_thread(comes_with_a_request: bool) {
    let (session, gate) = session(true);
    gate.close();
    let [begun, held] = [Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(true))];
    let builds = {
        let (begun, held) = (Arc::clone(&begun), Arc::clone(&held));
        SceneEdit::other(move |_| {
            rayon::broadcast(|_| {
                begun.store(true, Ordering::Relaxed);
                let end = Instant::now() + TIMEOUT;
                while held.load(Ordering::Relaxed) && Instant::now() < end {
                    std::thread::sleep(Duration::from_millis(2));
                }
            });
        })
    };
    if comes_with_a_request {
        // Nothing is due while the scene is locked, so both are taken together.
        session.with_scene(|_| {
            session.edit(vec![builds]);
            session.render(view(16));
        });
    } else {
        session.edit(vec![builds]);
    }
    wait_until("the builds begin", || begun.load(Ordering::Relaxed));
    session.render(view(17));
    wait_until("a picture while all of them are busy", || session.shown_generation() == session.generation());
    assert_eq!((session.generation(), gate.passed()), (2, 1), "the commit is still under way");
    held.store(false, Ordering::Relaxed);
    gate.open();
    finish(&session);
}

#[test]
fn a_batch_session_and_a_first_commit_have_no_job_before_the_commit() {
    let (session, gate) = session(false);
    begin(&session, &gate, 0.5, 17);
    assert_eq!((session.generation(), session.shown_generation()), (1, 1), "no job with the scene of before");
    gate.open();
    finish(&session);
    assert_eq!((corner(&session, 17), session.generation()), (0.5, 2), "one job, of the scene of after");
    let session = Session::new(Settings { interactive: true, ..settings(2, 1) });
    let gate = session.commit_gate();
    begin(&session, &gate, 0.5, 17);
    assert!(session.generation() == 0 && !session.is_converged(), "no scene, no job");
    gate.open();
    finish(&session);
    assert_eq!(corner(&session, 17), 0.5, "the first picture");
}

#[test]
fn edits_take_effect_in_order_with_the_request_that_comes_after_them() {
    for interactive in [true, false] {
        let (session, gate) = session(interactive);
        begin(&session, &gate, 0.5, 16);
        session.edit(vec![lit(0.125), SceneEdit::Remove("/dome".into())]);
        session.edit(vec![SceneEdit::Remove("/dome".into()), lit(0.75)]);
        session.render(view(17));
        session.edit(vec![lit(4.0)]);
        gate.open();
        finish(&session);
        assert_eq!(corner(&session, 17), 0.75, "without the edit that no request came after");
        session.render(view(17));
        finish(&session);
        assert_eq!(corner(&session, 17), 4.0, "with it");
        session.edit(vec![lit(8.0)]);
        let seen = session.with_scene(|db| db.commit().snapshot.lights.len());
        session.render(view(17));
        finish(&session);
        assert_eq!((corner(&session, 17), seen), (8.0, 1), "edits at once come after those that wait");
    }
}

#[test]
fn a_stop_during_a_commit_holds_until_something_changes() {
    for interactive in [true, false] {
        let (session, gate) = session(interactive);
        begin(&session, &gate, 0.5, 16);
        session.stop(true);
        assert!(session.is_converged() && session.is_stopped() && gate.passed() == 1, "at once");
        gate.open();
        committed(&session);
        assert!(session.is_converged() && session.is_stopped(), "the commit does not end the stop");
        session.render(view(16));
        assert!(session.is_converged() && session.is_stopped(), "nor does a request that changes nothing");
        session.edit(vec![lit(0.5)]);
        session.render(view(16));
        committed(&session);
        assert!(session.is_converged() && session.is_stopped(), "nor an edit that changes nothing");
        assert_eq!(corner(&session, 16), 0.25, "the picture is that of before");
        session.restart();
        assert!(!session.is_stopped(), "a restart does");
        finish(&session);
        assert_eq!(corner(&session, 16), 0.5, "it has the edit");
        session.stop(false);
        begin(&session, &gate, 0.75, 17);
        assert!(!session.is_stopped() && !session.is_converged(), "a change does, before its commit is done");
        gate.open();
        finish(&session);
        assert_eq!(corner(&session, 17), 0.75, "and is rendered");
    }
}

#[test]
fn a_pause_and_a_restart_during_a_commit_hold_after_it() {
    for interactive in [true, false] {
        let (session, gate) = session(interactive);
        session.pause();
        begin(&session, &gate, 0.5, 16);
        gate.open();
        committed(&session);
        std::thread::sleep(Duration::from_millis(50));
        assert!(session.is_paused() && !session.is_converged(), "paused");
        assert_eq!((corner(&session, 16), session.shown_generation()), (0.25, 1), "nothing is rendered");
        session.resume();
        finish(&session);
        assert_eq!(corner(&session, 16), 0.5, "then it is");
        let before = session.generation();
        begin(&session, &gate, 0.5, 16);
        session.restart();
        assert!(!session.is_converged(), "the restart is to come");
        gate.open();
        finish(&session);
        assert_eq!(session.generation(), before + 1, "once, although the commit changed nothing");
        begin(&session, &gate, 0.75, 16);
        session.restart();
        session.stop(true);
        gate.open();
        committed(&session);
        assert!(session.is_stopped() && session.is_converged(), "the stop came last");
    }
}

#[test]
fn a_commit_that_fails_is_told_once_keeps_the_scene_and_is_tried_again() {
    for interactive in [true, false] {
        let (session, gate) = session(interactive);
        gate.fail(1);
        session.edit(vec![lit(0.5)]);
        session.render(view(17));
        assert!(session.wait_converged(TIMEOUT), "it ends");
        let messages = session.take_messages();
        assert_eq!(messages.len(), 1, "{messages:?}");
        assert_eq!(messages[0].severity, Severity::Error, "{messages:?}");
        assert!(messages[0].text.starts_with("the scene could not be committed"), "{messages:?}");
        assert_eq!(corner(&session, 17), 0.25, "the scene of before, as it is seen now");
        session.render(view(17));
        assert!(session.is_converged() && gate.arrived() == 2, "the same request does not try for ever");
        session.render(view(18));
        finish(&session);
        assert_eq!(corner(&session, 18), 0.5, "the next change tries again");
    }
    let session = Session::new(settings(2, 1));
    session.commit_gate().fail(1);
    session.edit(vec![lit(0.5)]);
    session.render(view(17));
    assert!(session.wait_converged(TIMEOUT) && session.generation() == 0, "no scene, no job");
    assert_eq!(session.take_messages().len(), 1, "told");
    session.restart();
    finish(&session);
    assert_eq!(corner(&session, 17), 0.5, "a restart tries again");
}

#[test]
fn an_edit_that_fails_is_told_and_leaves_the_others() {
    let (session, _) = session(true);
    let fails = SceneEdit::upsert("/bad", |_| std::panic::resume_unwind(Box::new("a planted failure")));
    session.edit(vec![fails, lit(0.5)]);
    session.render(view(16));
    assert!(session.wait_converged(TIMEOUT), "it ends");
    let messages = session.take_messages();
    assert!(messages.len() == 1 && messages[0].text.starts_with("/bad: an edit is lost"), "{messages:?}");
    assert_eq!(corner(&session, 16), 0.5, "the others count");
}

/// An edit of a mesh that a commit is about to build: its first state is built by nobody.
#[test]
fn a_commit_whose_mesh_is_edited_again_is_given_up() {
    let (session, gate) = session(true);
    let ball = |rings: i32| {
        SceneEdit::upsert("/ball", move |db| db.upsert_mesh(sphere(prim("/ball", DMat4::IDENTITY), 1, rings, 0.5)))
    };
    let made = session.stats().meshes_made;
    gate.close();
    session.edit(vec![ball(9), lit(0.5)]);
    session.render(view(17));
    assert!(gate.wait_for(2, TIMEOUT), "the commit begins");
    session.edit(vec![ball(10)]);
    session.render(view(18));
    gate.admit(1);
    assert!(gate.wait_for(3, TIMEOUT), "the next one begins");
    let progress = session.commit_progress();
    assert_eq!((progress.given_up, progress.ended, progress.is_pending), (1, 1, true), "{progress:?}");
    session.edit(vec![ball(11)]);
    session.render(view(19));
    gate.open();
    finish(&session);
    let progress = session.commit_progress();
    assert_eq!((progress.given_up, progress.ended), (1, 3), "never two in a row: {progress:?}");
    assert_eq!(session.stats().meshes_made - made, 2, "the first edit was not built");
    assert_eq!(corner(&session, 19), 0.5, "what else the first edit brought is there");
}

#[test]
fn a_session_that_ends_waits_for_its_commit() {
    let (session, gate) = session(true);
    begin(&session, &gate, 0.5, 17);
    let seen = Arc::clone(&gate);
    let ends = std::thread::spawn(move || {
        drop(session);
        seen.passed()
    });
    std::thread::sleep(Duration::from_millis(100));
    gate.open();
    assert_eq!(ends.join().expect("it ends"), 2, "commits that had passed when it was gone");
}
