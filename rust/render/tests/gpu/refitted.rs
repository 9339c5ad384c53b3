// SPDX-License-Identifier: Apache-2.0
//! What moves in a live view is refitted, not cut and built; its picture is that of the scene, at every budget, and
//! where the view is no longer live, that of a fresh render bit for bit.

use crate::scenes::{dome, instanced, instancer, prim, sphere, square, sun};
use crate::support::{perspective, read, read_all, render, request, session, settings};
use glam::{DMat4, DQuat, DVec3};
use oocpt_core::array::TypedArray;
use oocpt_core::partition::HELD_FROM;
use oocpt_core::scene::{InstancerDesc, MeshDesc, SceneDb};
use oocpt_core::settings::{SettingValue, Settings};
use oocpt_render::{AovKind, RenderRequest, Session};

/// Instances: enough to be held.
const COUNT: usize = HELD_FROM + 800;

/// Balls in a slab, each near its place of rest.
fn crowd(frame: u32) -> InstancerDesc {
    let place = |n: usize| {
        let [x, y, z, turn] = oocpt_abi::sampler::sample_4d(u32::try_from(n).expect("few"), 0, 3).map(f64::from);
        let at = f64::from(frame) * 0.4 + turn * std::f64::consts::TAU;
        let rest = DVec3::new(8.0 * x - 4.0, y, 8.0 * z - 4.0);
        let moved = if frame == 0 { DVec3::ZERO } else { 0.1 * DVec3::new(at.cos(), at.sin(), 0.0) };
        (rest + moved, DQuat::from_rotation_y(at), DVec3::splat(0.03 + 0.04 * turn))
    };
    let places: Vec<_> = (0..COUNT).map(place).collect();
    instancer(prim("/crowd", DMat4::IDENTITY), "/crowd/ball", &places)
}

fn build(db: &mut SceneDb, frame: u32) {
    db.upsert_mesh(square(prim("/ground", DMat4::from_scale(DVec3::splat(6.0))), 1, 0.5));
    db.upsert_mesh(sphere(instanced(prim("/crowd/ball", DMat4::IDENTITY), "/crowd"), 2, 4, 0.7));
    db.upsert_instancer(crowd(frame));
    db.upsert_light(dome([0.4, 0.5, 0.6]));
    db.upsert_light(sun(2.0, 1.0, DMat4::from_rotation_x(-0.9)));
}

fn view() -> RenderRequest {
    request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, [40, 28]))
}

fn live() -> Settings {
    Settings { interactive: true, chunk_size_kib: 64, ..settings(2, 2) }
}

/// Shows the next frames of a live view; returns its trees that were built and refitted in each.
fn play(session: &Session, frames: std::ops::RangeInclusive<u32>) -> Vec<(u64, u64)> {
    let shown = frames.map(|frame| {
        session.with_scene(|db| db.upsert_instancer(crowd(frame)));
        render(session, &view());
        let levels = session.timings().levels;
        let stats = session.stats().streaming;
        assert_eq!((stats.trees_built, stats.trees_refitted), (levels.built, levels.refitted), "as statistics tell");
        (levels.built, levels.refitted)
    });
    shown.collect()
}

#[test]
fn moving_instances_are_refitted_and_a_batch_picture_does_not_depend_on_it() {
    let session = session(live());
    session.with_scene(|db| build(db, 0));
    render(&session, &view());
    let chunks = session.with_scene(|db| db.snapshot().world.chunks.len()) as u64;
    assert!(chunks > 10, "{chunks} chunks");
    assert_eq!(session.timings().levels.built, chunks, "nothing is known yet");
    let first = session.timings().uploaded_bytes;
    // The ground's chunk stays. The device places what moves; from the second move on it has what it needs for that.
    let moving = chunks - 1;
    let trees = play(&session, 1..=5);
    assert_eq!(trees, [(0, moving); 5]);
    let (moved, timings) = (COUNT as u64, session.timings());
    assert_eq!(timings.levels.placed_records, moved, "all that moved");
    assert!(timings.uploaded_bytes < first / 2, "the arrays, and neither records nor trees");
    let [shown, color] = [AovKind::InstanceId, AovKind::Color].map(|kind| read::<u32>(&session, &view(), kind));
    let fresh = crate::support::images(|db| build(db, 5), Settings { interactive: false, ..live() }, &view());
    session.set_setting("enableInteractive", SettingValue::Bool(false)).expect("a setting");
    render(&session, &view());
    assert!(read_all(&session, &view()) == fresh, "a batch picture of the same scene");
    // Frames of chunks differ, with them the last bits of distances: hardly a sample sees another ball for it.
    let other = shown.iter().zip(read::<u32>(&session, &view(), AovKind::InstanceId)).filter(|(a, b)| **a != *b);
    assert!(other.count() <= 2, "other balls");
    let value = |bits: &u32| f64::from(f32::from_bits(*bits));
    let batch = read::<u32>(&session, &view(), AovKind::Color);
    let far = color.iter().zip(&batch).filter(|(a, b)| (value(a) - value(b)).abs() > 0.02 * (1.0 + value(b)));
    assert!(far.count() <= color.len() / 50, "other colours");
}

#[test]
fn refitted_chunks_show_the_same_bits_at_every_budget() {
    let play_within = |budget: u32| {
        let session = session(Settings { geometry_budget_kib: budget, ..live() });
        session.with_scene(|db| build(db, 0));
        render(&session, &view());
        play(&session, 1..=3);
        let stats = session.stats().streaming;
        assert_eq!(stats.in_core, budget == 0, "{budget} KiB");
        assert!(stats.geometry_peak_bytes <= u64::from(budget) << 10 || budget == 0, "the budget holds");
        (read_all(&session, &view()), stats.trees_refitted)
    };
    let (in_core, _) = play_within(0);
    let (streamed, refitted) = play_within(320);
    assert!(refitted > 5, "{refitted} trees were refitted");
    assert!(streamed == in_core, "the same picture");
}

#[test]
fn what_is_torn_apart_gets_new_trees() {
    let session = session(live());
    session.with_scene(|db| build(db, 0));
    render(&session, &view());
    play(&session, 1..=2);
    // Everything changes places within the slab: chunks are cut anew, and their trees are not of the old shapes.
    session.with_scene(|db| {
        let mut mixed = crowd(3);
        let points = mixed.translations.as_ref().expect("places");
        let mut places: Vec<[f32; 3]> =
            (0..COUNT).filter_map(|n| points.vec3(n)).map(|p| p.as_vec3().to_array()).collect();
        places.rotate_left(COUNT / 2);
        mixed.translations = Some(TypedArray::of(places));
        db.upsert_instancer(mixed);
    });
    render(&session, &view());
    let chunks = session.with_scene(|db| db.snapshot().world.chunks.len()) as u64;
    let levels = session.timings().levels;
    assert_eq!((levels.built, levels.refitted), (chunks - 1, 0), "all are built but the ground's");
}

/// The crowd of a frame, of which each hundredth instance is where it is in another frame.
fn mixed(frame: u32, other: u32) -> InstancerDesc {
    let places = |frame: u32| crowd(frame).translations.expect("places");
    let (rest, moved) = (places(frame), places(other));
    let step = other as usize;
    let place = |n: usize| if (n + step / 2).is_multiple_of(100) { moved.vec3(n) } else { rest.vec3(n) };
    let mut desc = crowd(frame);
    let places: Vec<[f32; 3]> = (0..COUNT).filter_map(place).map(|p| p.as_vec3().to_array()).collect();
    desc.translations = Some(TypedArray::of(places));
    desc
}

#[test]
fn few_moves_send_what_moved() {
    let session = session(live());
    session.with_scene(|db| build(db, 0));
    render(&session, &view());
    play(&session, 1..=3);
    // Turns and sizes are those of the frame; an array that is the same is not sent. Others move than before, too, and
    // what moved before is back.
    for other in [4, 5, 6, 7] {
        session.with_scene(|db| db.upsert_instancer(mixed(3, other)));
        render(&session, &view());
        let timings = session.timings();
        // Of two frames: what moves, and what is back.
        let (moved, described) = (2 * COUNT.div_ceil(100) * 16, 1 << 15);
        let sent = timings.uploaded_bytes;
        assert!(sent <= (moved + described) as u64, "frame {other}: {sent} bytes");
        assert!(timings.levels.placed_records > 0 && timings.levels.built == 0, "frame {other}");
        // What is placed in part is what is placed as a whole, by a view that was never told before.
        let fresh = crate::support::session(live());
        fresh.with_scene(|db| build(db, 0));
        render(&fresh, &view());
        play(&fresh, 1..=3);
        fresh.with_scene(|db| db.upsert_instancer(crowd(20)));
        render(&fresh, &view());
        fresh.with_scene(|db| db.upsert_instancer(mixed(3, other)));
        render(&fresh, &view());
        assert!(read_all(&session, &view()) == read_all(&fresh, &view()), "frame {other}: the same picture");
    }
}

/// The crowd of a frame with instances that cannot be placed, others in each frame.
fn hostile(frame: u32) -> InstancerDesc {
    let mut desc = crowd(frame);
    let values = [f32::NAN, f32::INFINITY, 1e30, -1e19, 0.0, f32::NEG_INFINITY];
    let spoil = |array: &TypedArray, first: usize| {
        let mut all: Vec<[f32; 3]> = (0..COUNT).filter_map(|n| array.vec3(n)).map(|v| v.as_vec3().to_array()).collect();
        for (k, value) in values.into_iter().cycle().take(60).enumerate() {
            // A scale of 0 is singular, a place at 0 is none of these.
            all[(first + k * 131) % COUNT][k % 3] = value;
        }
        TypedArray::of(all)
    };
    let at = frame as usize * 17;
    desc.scales = desc.scales.as_ref().map(|scales| spoil(scales, at));
    if frame.is_multiple_of(2) {
        desc.translations = desc.translations.as_ref().map(|points| spoil(points, at + 5));
    }
    desc
}

#[test]
fn instances_that_cannot_be_placed_are_found_by_no_ray_after_many_moves() {
    let session = session(live());
    session.with_scene(|db| build(db, 0));
    render(&session, &view());
    play(&session, 1..=3);
    let mut placed = 0;
    for frame in 4..12 {
        session.with_scene(|db| db.upsert_instancer(hostile(frame)));
        drop(crate::support::render_with_messages(&session, &view()));
        placed += session.timings().levels.placed_records;
        let shown = [AovKind::InstanceId, AovKind::Color].map(|kind| read::<u32>(&session, &view(), kind));
        let fresh = crate::support::session(Settings { interactive: false, ..live() });
        fresh.with_scene(|db| {
            build(db, 0);
            db.upsert_instancer(hostile(frame));
        });
        // It says which instances it leaves out.
        assert!(!crate::support::render_with_messages(&fresh, &view()).is_empty(), "frame {frame}");
        let batch = [AovKind::InstanceId, AovKind::Color].map(|kind| read::<u32>(&fresh, &view(), kind));
        let other = shown[0].iter().zip(&batch[0]).filter(|(a, b)| a != b).count();
        assert!(other <= 2, "frame {frame}: {other} other balls");
        let value = |bits: &u32| f64::from(f32::from_bits(*bits));
        assert!(shown[1].iter().all(|bits| value(bits).is_finite()), "frame {frame}");
        let far = shown[1].iter().zip(&batch[1]).filter(|(a, b)| (value(a) - value(b)).abs() > 0.02 * (1.0 + value(b)));
        assert!(far.count() <= shown[1].len() / 50, "frame {frame}: other colours");
    }
    assert!(placed > 0, "some of it was placed by the device");
}

/// A ball whose points are elsewhere in each frame.
fn jelly(frame: u8) -> MeshDesc {
    let ball = sphere(prim("/jelly", DMat4::IDENTITY), 3, 24, 0.7);
    let bent = |at: usize| {
        let [x, y, z] = ball.points.vec3(at).expect("a point").as_vec3().to_array();
        let push = 0.1 * f32::from(frame);
        [x + push * (3.0 * y).sin(), y * (1.0 - 0.5 * push), z + push * (2.0 * x).cos()]
    };
    let points: Vec<[f32; 3]> = (0..ball.points.len()).map(bent).collect();
    MeshDesc { points: TypedArray::of(points), ..ball.clone() }
}

#[test]
fn a_mesh_that_deforms_shows_the_picture_of_one_that_is_built() {
    let set = |db: &mut SceneDb, frame: u8| {
        db.upsert_mesh(jelly(frame));
        db.upsert_mesh(square(prim("/ground", DMat4::from_scale(DVec3::splat(6.0))), 1, 0.5));
        db.upsert_light(dome([0.4, 0.5, 0.6]));
    };
    let session = session(live());
    for frame in 0..5 {
        session.with_scene(|db| set(db, frame));
        render(&session, &view());
    }
    let (made, refitted) = (session.stats().meshes_made, session.stats().meshes_refitted);
    assert_eq!((made, refitted), (6, 3), "all from the second deformation on");
    let fresh = crate::support::images(|db| set(db, 4), live(), &view());
    assert!(read_all(&session, &view()) == fresh, "the same triangles are met");
}
