// SPDX-License-Identifier: Apache-2.0
//! Same seed, same bits: twice, whatever the cuts between waves; another seed gives other bits.

use crate::scenes::{features, nested};
use crate::support::{images, perspective, read_all, render, request, session, settings};
use glam::DVec3;
use oocpt_core::settings::Settings;
use oocpt_render::{AovKind, AovRequest, RenderRequest, Session, SessionOptions};

fn view(size: [u32; 2]) -> RenderRequest {
    request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, size))
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_does_not() {
    let request = view([48, 32]);
    let first = images(features, settings(8, 3), &request);
    let second = images(features, settings(8, 3), &request);
    assert!(first == second, "two renders of one scene differ");
    let other = images(features, Settings { seed: 1, ..settings(8, 3) }, &request);
    assert!(first[0] != other[0], "another seed must give other noise");
    // Images of the samples' spread are noise too.
    let of_noise = [AovKind::Color, AovKind::Variance, AovKind::Error, AovKind::Shadow];
    for (AovRequest { kind, .. }, (first, other)) in request.aovs.iter().zip(first.iter().zip(&other)) {
        assert!(of_noise.contains(kind) || first == other, "and the same {kind:?}");
    }
}

#[test]
fn a_restart_gives_the_same_bits_although_waves_have_grown_meanwhile() {
    // Waves start at 16 384 paths on a processor and grow: the second render cuts its paths elsewhere.
    let request = view([160, 120]);
    let session = session(settings(6, 2));
    session.with_scene(nested);
    render(&session, &request);
    let first = read_all(&session, &request);
    session.restart();
    render(&session, &request);
    assert!(first == read_all(&session, &request), "the picture depends on how it was cut");
}

#[test]
fn bits_do_not_depend_on_paths_in_flight() {
    let request = view([160, 120]);
    let of = |in_flight| {
        let options = SessionOptions { validation: true, in_flight: Some(in_flight), ..SessionOptions::default() };
        let session = Session::with_options(settings(4, 2), options);
        session.with_scene(nested);
        render(&session, &request);
        (session.stats().inventory.paths, read_all(&session, &request))
    };
    let (few, many) = (of(1 << 12), of(1 << 16));
    assert_eq!((few.0, many.0), (1 << 12, 1 << 16), "as many as were asked for");
    assert!(few.1 == many.1, "the picture depends on the paths in flight");
}

#[test]
fn fewer_samples_are_a_prefix_of_more() {
    // Sample s of a pixel does not depend on the number of samples: 4 samples then 4 more average to 8.
    let request = view([32, 24]);
    let pictures: Vec<Vec<f32>> = [4, 8]
        .map(|samples| images(nested, settings(samples, 2), &request).swap_remove(0))
        .iter()
        .map(|bytes| bytemuck::pod_collect_to_vec(bytes))
        .collect();
    let differ = pictures[0].iter().zip(&pictures[1]).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
    assert!(differ > 0, "more samples must change the noise");
    let bound = pictures[0].iter().zip(&pictures[1]).all(|(four, eight)| *eight >= 0.5 * four - 1e-6);
    assert!(bound, "eight samples hold the first four: their mean is at least half of the mean of four");
}
