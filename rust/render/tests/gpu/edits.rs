// SPDX-License-Identifier: Apache-2.0
//! An edited scene renders as if it had been built that way, and unedited assets stay on the device.

use crate::scenes::{constant, dome, instanced, instancer, nested, prim, sphere, square, sun};
use crate::support::{images, perspective, read_all, render, request, session, settings};
use glam::{DMat4, DQuat, DVec3};
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::Settings;
use oocpt_render::RenderRequest;

fn view() -> RenderRequest {
    request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, [40, 28]))
}

/// Renders [`nested`], edits, renders again; the result must equal a fresh render of the edited scene, and differ.
fn edit_equals_fresh(edit: fn(&mut SceneDb)) {
    let request = view();
    let session = session(settings(4, 2));
    session.with_scene(nested);
    render(&session, &request);
    let before = read_all(&session, &request);
    session.with_scene(edit);
    render(&session, &request);
    let after = read_all(&session, &request);
    let fresh = images(
        |db| {
            nested(db);
            edit(db);
        },
        settings(4, 2),
        &request,
    );
    assert!(before != after, "the edit must show");
    assert!(after == fresh, "an edited scene must look like a fresh one");
}

#[test]
fn moving_a_mesh_equals_a_fresh_render() {
    edit_equals_fresh(|db| {
        let down = DMat4::from_translation(DVec3::Y * -0.5) * DMat4::from_scale(DVec3::splat(6.0));
        db.upsert_mesh(square(prim("/ground", down), 1, 0.5));
    });
}

#[test]
fn editing_points_equals_a_fresh_render() {
    edit_equals_fresh(|db| db.upsert_mesh(sphere(prim("/ground", DMat4::from_scale(DVec3::splat(0.8))), 1, 6, 0.5)));
}

#[test]
fn editing_instances_equals_a_fresh_render() {
    edit_equals_fresh(|db| {
        let places = [(DVec3::new(0.5, 0.2, 0.4), DQuat::from_rotation_y(0.3), DVec3::splat(1.3))];
        db.upsert_instancer(instancer(prim("/outer", DMat4::IDENTITY), "/outer/clump", &places));
    });
}

#[test]
fn editing_a_light_equals_a_fresh_render() {
    edit_equals_fresh(|db| db.upsert_light(sun(0.5, 10.0, DMat4::from_rotation_x(-0.4))));
}

#[test]
fn removing_a_light_equals_a_fresh_render() {
    edit_equals_fresh(|db| db.remove("/sun"));
}

#[test]
fn hiding_a_prim_equals_a_fresh_render() {
    edit_equals_fresh(|db| {
        let mut hidden = prim("/ground", DMat4::from_scale(DVec3::splat(6.0)));
        hidden.visible = false;
        db.upsert_mesh(square(hidden, 1, 0.5));
    });
}

#[test]
fn editing_a_colour_equals_a_fresh_render() {
    edit_equals_fresh(|db| {
        let mut ground = square(prim("/ground", DMat4::from_scale(DVec3::splat(6.0))), 1, 0.5);
        ground.display_color = constant([0.9_f32, 0.1, 0.1]);
        db.upsert_mesh(ground);
    });
}

#[test]
fn removing_everything_equals_a_fresh_render() {
    edit_equals_fresh(|db| {
        db.remove("/outer");
        db.remove("/ground");
        db.upsert_light(dome([0.1, 0.2, 0.3]));
    });
}

#[test]
fn another_camera_uploads_nothing() {
    let session = session(settings(2, 1));
    session.with_scene(nested);
    render(&session, &view());
    let first = session.timings().uploaded_bytes;
    let other = request(perspective(DVec3::new(-3.0, 3.0, 6.0), DVec3::ZERO, 0.7, [40, 28]));
    render(&session, &other);
    let second = session.timings().uploaded_bytes;
    assert_eq!(session.timings().light_tables, 0, "nor the lights");
    session.with_scene(|db| db.upsert_light(dome([0.5; 3])));
    render(&session, &other);
    assert_eq!(session.timings().light_tables, 1, "another light is sent");
    assert!(first > 10_000, "the first render uploads the scene, not {first} bytes");
    assert_eq!(second, 0, "a camera move must not upload geometry");
}

#[test]
fn moving_one_mesh_uploads_records_but_no_mesh() {
    let session = session(settings(2, 1));
    session.with_scene(|db| {
        db.upsert_mesh(sphere(prim("/ball", DMat4::IDENTITY), 1, 40, 0.5));
        db.upsert_light(dome([1.0; 3]));
    });
    render(&session, &view());
    let first = session.timings().uploaded_bytes;
    session.with_scene(|db| {
        db.upsert_mesh(sphere(prim("/ball", DMat4::from_translation(DVec3::X * 0.5)), 1, 40, 0.5));
    });
    render(&session, &view());
    let second = session.timings().uploaded_bytes;
    assert!(first > 48 * 6240, "the sphere is uploaded first, its triangles at least: {first} bytes");
    assert!(second < 1000, "moving it uploads its record only, not {second} bytes");
}

/// A square crowd of balls in many chunks; `lifted`: balls at its corners that are not where they were.
fn crowd(db: &mut SceneDb, lifted: &[usize]) {
    const SIDE: usize = 90;
    let place = |number: usize| {
        let [x, z] = [number % SIDE, number / SIDE].map(|at| 0.1 * f64::from(u32::try_from(at).expect("few")) - 4.5);
        let y = if lifted.contains(&number) { 0.4 } else { 0.0 };
        (DVec3::new(x, y, z), DQuat::IDENTITY, DVec3::splat(0.05))
    };
    let places: Vec<_> = (0..SIDE * SIDE).map(place).collect();
    db.upsert_instancer(instancer(prim("/crowd", DMat4::IDENTITY), "/crowd/ball", &places));
}

#[test]
fn an_edit_costs_what_it_touches_in_a_scene_of_many_chunks() {
    let (request, settings) = (view(), Settings { chunk_size_kib: 16, ..settings(2, 2) });
    let build = |db: &mut SceneDb, lifted: &[usize]| {
        db.upsert_mesh(sphere(instanced(prim("/crowd/ball", DMat4::IDENTITY), "/crowd"), 2, 4, 0.7));
        db.upsert_mesh(square(prim("/ground", DMat4::from_scale(DVec3::splat(6.0))), 1, 0.5));
        crowd(db, lifted);
        db.upsert_light(dome([0.4, 0.5, 0.6]));
    };
    let session = session(settings.clone());
    session.with_scene(|db| build(db, &[]));
    render(&session, &request);
    let whole = session.timings();
    assert!(whole.listed_assets > 64, "all are listed first: {}", whole.listed_assets);
    assert!(whole.table_bytes > 64 * 100, "and all tables are written: {} bytes", whole.table_bytes);
    session.with_scene(|db| db.upsert_light(dome([0.5; 3])));
    render(&session, &request);
    let light = session.timings();
    assert_eq!((light.listed_assets, light.table_bytes), (0, 0), "a light is in no list and no table of the scene");
    // The second edit begins where the first has left tables and stacks.
    for lifted in [&[0][..], &[0, 8099]] {
        session.with_scene(|db| crowd(db, lifted));
        render(&session, &request);
        let placed = session.timings();
        assert!((1..=4).contains(&placed.listed_assets), "chunks that a ball leaves and enters: {placed:?}");
        let share = whole.table_bytes / 4;
        assert!((1..share).contains(&placed.table_bytes), "{} of {} bytes", placed.table_bytes, whole.table_bytes);
        assert!(placed.uploaded_bytes < whole.uploaded_bytes / 8, "{} bytes sent", placed.uploaded_bytes);
    }
    let edited = read_all(&session, &request);
    let fresh = |db: &mut SceneDb| {
        build(db, &[0, 8099]);
        db.upsert_light(dome([0.5; 3]));
    };
    assert!(edited == images(fresh, settings.clone(), &request), "the picture is that of a fresh render");
    // More than lights and places differs: everything is listed.
    session.with_scene(|db| db.upsert_mesh(square(prim("/ground", DMat4::from_scale(DVec3::splat(5.0))), 1, 0.2)));
    render(&session, &request);
    assert!(session.timings().listed_assets > 64, "another mesh");
}

/// Chunks that are replaced give their memory back: together they are larger than what a heap allocates at once.
#[test]
fn chunks_that_were_edited_hold_no_memory() {
    let (request, settings) = (view(), Settings { chunk_size_kib: 256, ..settings(1, 1) });
    let session = session(settings);
    let place = |height: f64| {
        let places: Vec<_> = (0..6400_u32)
            .map(|number| {
                let [x, z] = [number % 80, number / 80].map(|at| 0.1 * f64::from(at) - 4.0);
                let y = if number == 0 { height } else { 0.0 };
                (DVec3::new(x, y, z), DQuat::IDENTITY, DVec3::splat(0.05))
            })
            .collect();
        instancer(prim("/crowd", DMat4::IDENTITY), "/crowd/ball", &places)
    };
    session.with_scene(|db| {
        db.upsert_mesh(square(instanced(prim("/crowd/ball", DMat4::IDENTITY), "/crowd"), 1, 0.7));
        db.upsert_light(dome([0.5; 3]));
        db.upsert_instancer(place(0.0));
    });
    render(&session, &request);
    let mut held = Vec::new();
    for edit in 0..600_u32 {
        session.with_scene(|db| db.upsert_instancer(place(0.4 + 1e-3 * f64::from(edit))));
        render(&session, &request);
        assert_eq!(session.timings().listed_assets, 1, "one chunk is edited in place");
        held.push(session.stats().gpu_bytes);
    }
    assert_eq!(held[599], held[1], "bytes on the device");
}
