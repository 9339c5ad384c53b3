// SPDX-License-Identifier: Apache-2.0
//! The image of sample counts: known numbers without adaptive sampling, the decided ones with it, and no counts unless
//! they are requested.

use crate::error_estimate::{mirror, view};
use crate::scenes::nested;
use crate::support::{read, render, settings};
use oocpt_core::settings::Settings;
use oocpt_render::{AovKind, AovRequest, RenderRequest, Session, SessionOptions};

const SIZE: [u32; 2] = [24, 18];

fn asking(kinds: &[AovKind]) -> RenderRequest {
    let aovs = kinds.iter().map(|&kind| AovRequest { kind, clear: [7.0; 4] }).collect();
    RenderRequest { aovs, ..view(SIZE) }
}

#[test]
fn uniform_sampling_counts_equal_the_setting() {
    for streams in [false, true] {
        let options = SessionOptions { force_streaming: streams, validation: true, ..SessionOptions::default() };
        let session = Session::with_options(settings(5, 1), options);
        session.with_scene(nested);
        // With other images, and without: samples are taken for it alone too.
        for kinds in [&[AovKind::Color, AovKind::SampleCount, AovKind::Depth][..], &[AovKind::SampleCount]] {
            let view = asking(kinds);
            render(&session, &view);
            let counts = read::<f32>(&session, &view, AovKind::SampleCount);
            assert!(counts == vec![5.0; (SIZE[0] * SIZE[1]) as usize], "streams: {streams}, {kinds:?}: {counts:?}");
        }
        let mut color = vec![0_u8; (SIZE[0] * SIZE[1]) as usize * 16];
        assert!(!session.read_aov(AovKind::Color, &mut color), "nobody asked for colour");
    }
}

#[test]
fn adaptive_sample_counts_match_the_decisions() {
    let session = Session::with_options(
        Settings { adaptive_sampling: true, ..settings(64, 2) },
        SessionOptions { validation: true, ..SessionOptions::default() },
    );
    session.with_scene(mirror);
    let view = asking(&[AovKind::Color, AovKind::SampleCount]);
    render(&session, &view);
    let usage = session.stats().adaptive.expect("it is told what was spent");
    let counts: Vec<f64> = read::<f32>(&session, &view, AovKind::SampleCount).into_iter().map(f64::from).collect();
    let (least, most) = counts.iter().fold((f64::MAX, 0.0_f64), |(a, b), count| (a.min(*count), b.max(*count)));
    assert!(least < most, "a caustic is not the same everywhere");
    assert_eq!((least, most), (f64::from(usage.fewest), f64::from(usage.most)), "as the stats say: {usage:?}");
    // What is left when no pixel can be given twice as many is not spent.
    let mean = counts.iter().sum::<f64>() / f64::from(SIZE[0] * SIZE[1]);
    assert!((62.0..=64.0).contains(&mean), "64 on average: {mean}");
    // Each stream has a power of two.
    let of_two =
        |count: f64| (3..24).any(|k| (3..24).any(|l| (f64::from(1 << k) + f64::from(1 << l) - count).abs() < 0.5));
    assert!(counts.iter().all(|count| of_two(*count)), "{counts:?}");
}

#[test]
fn sample_count_buffers_exist_only_on_request() {
    let session = Session::with_options(settings(2, 1), SessionOptions::default());
    session.with_scene(nested);
    let made = |kinds: &[AovKind]| {
        render(&session, &asking(kinds));
        let inventory = session.stats().inventory;
        let pass = inventory.passes.iter().any(|pass| pass.name == "count_samples" && pass.made);
        let image = inventory.buffers.iter().any(|buffer| buffer.name == "image sampleCount" && buffer.bytes > 0);
        (pass, image)
    };
    assert_eq!(made(&[AovKind::Color]), (false, false), "left out");
    assert_eq!(made(&[AovKind::Color, AovKind::SampleCount]), (true, true), "made");
}
