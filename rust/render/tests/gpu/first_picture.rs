// SPDX-License-Identifier: Apache-2.0
//! What a live host sees while its camera moves: whole pictures, the first at a part of the resolution.

use crate::scenes::{dome, nested, prim, sphere};
use crate::support::{TIMEOUT, filtering, images, perspective, read, read_all, request, settings};
use glam::{DMat4, DVec3};
use oocpt_core::settings::Settings;
use oocpt_render::{AovKind, PlantedFaults, RenderRequest, Session, SessionOptions};
use std::time::{Duration, Instant};

/// No multiple of what the sides are divided by.
const SIZE: [u32; 2] = [100, 76];

fn view(turn: f64) -> RenderRequest {
    request(perspective(DVec3::new(6.0 * turn.sin(), 4.0, 6.0 * turn.cos()), DVec3::ZERO, 0.7, SIZE))
}

/// A session that shows images on the way, the first with sides divided by `factor`.
fn live(samples: u32, faults: PlantedFaults) -> Session {
    let options = SessionOptions { validation: true, faults, ..SessionOptions::default() };
    let session = Session::with_options(Settings { interactive: true, ..filtering(settings(samples, 2)) }, options);
    session.with_scene(nested);
    session
}

fn render(session: &Session, request: &RenderRequest) {
    session.render(request.clone());
    assert!(session.wait_converged(TIMEOUT), "it ends");
    assert!(session.take_messages().is_empty(), "without a message");
}

/// Pixels through whose middle go the rays of a first picture with a third of the sides.
fn middles() -> impl Iterator<Item = (usize, usize)> {
    let [width, height] = SIZE.map(|side| side as usize);
    (0..height / 3).flat_map(move |y| (0..width / 3).map(move |x| (3 * x + 1, 3 * y + 1)))
}

#[test]
fn the_first_picture_is_the_view_in_wider_pixels() {
    let session =
        live(1, PlantedFaults { first_picture: Some(3), first_picture_alone: true, ..PlantedFaults::default() });
    render(&session, &view(0.4));
    let width = SIZE[0] as usize;
    let whole = Session::with_options(settings(1, 2), SessionOptions::default());
    whole.with_scene(nested);
    render(&whole, &view(0.4));
    for kind in [AovKind::PrimId, AovKind::InstanceId, AovKind::ElementId] {
        let [coarse, fine] = [&session, &whole].map(|session| read::<i32>(session, &view(0.4), kind));
        let same = middles().filter(|(x, y)| coarse[y * width + x] == fine[y * width + x]).count();
        // Rays along an edge may go either way.
        assert!(same * 100 >= middles().count() * 99, "{kind:?}: {same} of {}", middles().count());
        let filled = |(x, y): &(usize, usize)| {
            (0..9).all(|k| coarse[(y - 1 + k / 3) * width + x - 1 + k % 3] == coarse[y * width + x])
        };
        assert!(middles().all(|place| filled(&place)), "{kind:?}: each pixel fills the nine around it");
        assert!(fine.iter().any(|id| *id >= 0) && coarse[..].iter().any(|id| *id >= 0), "{kind:?}: something is seen");
    }
    let depths = [&session, &whole].map(|session| read::<f32>(session, &view(0.4), AovKind::CameraDepth));
    let near = |(x, y): &(usize, usize)| (depths[0][y * width + x] - depths[1][y * width + x]).abs() < 1e-3;
    assert!(middles().filter(near).count() * 100 >= middles().count() * 99, "depths are those of the whole picture");
}

#[test]
fn the_colour_of_the_first_picture_lies_where_its_ids_do() {
    let session = Session::with_options(
        Settings { interactive: true, ..settings(1, 2) },
        SessionOptions {
            validation: true,
            faults: PlantedFaults { first_picture: Some(3), first_picture_alone: true, ..PlantedFaults::default() },
            ..SessionOptions::default()
        },
    );
    session.with_scene(|db| {
        db.upsert_mesh(sphere(prim("/ball", DMat4::from_scale(DVec3::splat(2.5))), 1, 20, 0.5));
        db.upsert_light(dome([1.0; 3]));
    });
    render(&session, &view(0.4));
    let color: Vec<[f32; 4]> = read(&session, &view(0.4), AovKind::Color);
    let ids: Vec<i32> = read(&session, &view(0.4), AovKind::PrimId);
    let [width, height] = SIZE.map(|side| side as usize);
    let is_hit = |x: usize, y: usize| ids[y * width + x] >= 0;
    // Samples are anywhere in their pixel: away from the silhouette they hit what its middle does.
    let inner: Vec<(usize, usize)> = middles()
        .filter(|(x, y)| (4..width - 4).contains(x) && (4..height - 4).contains(y))
        .filter(|(x, y)| (0..9).all(|k| is_hit(x + 3 * (k % 3) - 3, y + 3 * (k / 3) - 3) == is_hit(*x, *y)))
        .collect();
    assert!(inner.len() > 500 && inner.iter().filter(|(x, y)| is_hit(*x, *y)).count() > 100, "{} places", inner.len());
    for (x, y) in inner {
        // A convex body of albedo 0.5 in a furnace of radiance 1.
        assert_eq!(color[y * width + x][0] < 0.75, is_hit(x, y), "at {x}, {y}");
    }
}

#[test]
fn what_is_shown_of_a_camera_that_moves_is_whole_and_moves() {
    for first_picture in [Some(4), Some(1), None] {
        // A sample takes longer than a move.
        let session = live(1 << 16, PlantedFaults { first_picture, ..PlantedFaults::default() });
        render_whole(&session);
        let (mut known, mut shown, mut generations) = (0, 0, Vec::new());
        let mut counts = vec![0.0_f32; (SIZE[0] * SIZE[1]) as usize];
        let end = Instant::now() + Duration::from_secs(60);
        let mut step = 0;
        while step < 60 || shown < 10 {
            step += 1;
            assert!(Instant::now() < end, "frozen: {shown} pictures in {step} moves with {first_picture:?}");
            session.render(view(0.4 + 0.01 * f64::from(step)));
            std::thread::sleep(Duration::from_millis(4));
            let generation = session.shown_generation();
            let version = session.read_new_aov(AovKind::SampleCount, known, bytemuck::cast_slice_mut(&mut counts));
            assert_ne!(version, 0, "a picture is there at all times");
            shown += u32::from(version != known);
            known = version;
            assert!(counts.iter().all(|count| *count >= 1.0), "each pixel has a sample, with {first_picture:?}");
            generations.push(generation);
        }
        assert!(generations.is_sorted(), "no older picture after a newer one");
        assert!(session.take_messages().is_empty(), "without a message");
        session.stop(true);
    }
}

/// Waits for the first picture.
fn render_whole(session: &Session) {
    session.render(view(0.4));
    let end = Instant::now() + TIMEOUT;
    while session.shown_generation() == 0 {
        assert!(Instant::now() < end, "no first picture: {:?}", session.take_messages());
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_picture_after_moves_is_that_of_a_session_that_never_moved() {
    for first_picture in [Some(2), None] {
        let session = live(3, PlantedFaults { first_picture, ..PlantedFaults::default() });
        for step in 0..8 {
            session.render(view(0.1 * f64::from(step)));
            std::thread::sleep(Duration::from_millis(3));
        }
        render(&session, &view(0.8));
        assert_eq!(session.shown_generation(), session.generation(), "the newest job is shown");
        let alone = images(nested, filtering(settings(3, 2)), &view(0.8));
        assert!(read_all(&session, &view(0.8)) == alone, "the same bits, with {first_picture:?}");
    }
}
