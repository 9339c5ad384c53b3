// SPDX-License-Identifier: Apache-2.0
//! Deep images: shares, depths and things by closed forms and by the colour; limits of samples; the same bits
//! everywhere; and nothing of them where nobody asks.

use crate::checkpoints::by;
use crate::filtered_images::{SAMPLES, SIZE, asking, blurred, card_depth, card_met, cards, disk, ray, session_of};
use crate::ranked_ids::{assert_kept_by_a_checkpoint, passes_and_sums};
use crate::scenes::{features, nested};
use crate::support::{filtering, perspective, read, render, settings};
use glam::DVec3;
use oocpt_abi::sampler::{pixel_seed, sample_4d};
use oocpt_abi::{DEEP_FAR, DeepSlot};
use oocpt_core::pixel_filter::PixelFilterKind;
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{Settings, TraversalKind};
use oocpt_render::{AovKind, DeepLimits, PlantedFaults, RenderRequest, Session, SessionOptions};

fn limits(samples: u8, tolerance: f32) -> DeepLimits {
    let usual = DeepLimits::default();
    usual.with_samples(samples).and_then(|limits| limits.with_depths(tolerance, 0.0)).expect("limits")
}

fn deep(samples: u8, tolerance: f32) -> AovKind {
    AovKind::Deep(limits(samples, tolerance))
}

/// The samples of each pixel.
fn samples(session: &Session, view: &RenderRequest) -> Vec<Vec<DeepSlot>> {
    let kind = view.aovs.iter().map(|aov| aov.kind).find(|kind| matches!(kind, AovKind::Deep(_))).expect("one");
    let all = read::<DeepSlot>(session, view, kind);
    let pixels = all.chunks_exact(kind.channels() / 8);
    pixels.map(|slots| slots.iter().copied().take_while(|slot| slot.weight > 0.0).collect()).collect()
}

fn view_of_nested(kinds: &[AovKind], size: [u32; 2]) -> RenderRequest {
    asking(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, size), kinds, [0.0; 4])
}

#[test]
fn samples_are_those_that_meet_a_thing_at_its_depth() {
    let camera = blurred();
    let view = asking(camera.clone(), &[deep(16, 1e-3)], [0.0; 4]);
    let session = session_of(Settings { dome_light_camera_visible: false, ..settings(SAMPLES, 0) }, false, cards);
    render(&session, &view);
    let (mut wrong, mut mixed) = (0, 0);
    for (at, slots) in (0..).zip(samples(&session, &view)) {
        let [x, y] = [at % SIZE[0], at / SIZE[0]];
        let mut counts = [0_u32; 2];
        let mut depths = [0.0; 2];
        for sample in 0..SAMPLES {
            let u = sample_4d(sample, 0, pixel_seed(x, y, 0));
            let p = [f64::from(x) + f64::from(u[0]), f64::from(y) + f64::from(u[1])];
            let ray = ray(&camera, p, disk([u[2], u[3]]));
            if let Some(card) = card_met(ray) {
                counts[card] += 1;
                depths[card] += card_depth(&camera, card, ray);
            }
        }
        for card in 0..2 {
            // A card that is seen at an angle may have several samples: depths of one are close to each other.
            let of_card: Vec<&DeepSlot> = slots.iter().filter(|slot| slot.id as usize == card + 1).collect();
            let share: f32 = of_card.iter().map(|slot| slot.weight).sum();
            let depth: f64 = of_card.iter().map(|slot| f64::from(slot.weight * slot.depth)).sum();
            let expected = depths[card] / f64::from(SAMPLES);
            let same_count = (f64::from(share) * f64::from(SAMPLES) - f64::from(counts[card])).abs() < 1e-3;
            wrong += u32::from(!same_count || (depth - expected).abs() > 1e-5 * expected.max(1.0));
        }
        mixed += u32::from(counts.iter().all(|count| *count > 0));
        assert!(slots.iter().all(|slot| (slot.alpha - slot.weight).abs() < 1e-6), "all are opaque: {slots:?}");
    }
    // A sample at an edge to the last bit may be on the other side in single precision.
    assert!(wrong <= 2, "{wrong} shares or depths differ");
    assert!(mixed > 10, "both cards are seen in some pixels: {mixed}");
}

/// Whatever the limits, the samples of a pixel have all of its colour and alpha, and are no more than the limit.
#[test]
fn samples_add_up_to_the_picture() {
    for (filter, adaptive, streams, most) in [
        (PixelFilterKind::Box, false, false, 16),
        (PixelFilterKind::Box, false, true, 3),
        (PixelFilterKind::Box, false, false, 1),
        (PixelFilterKind::Gaussian, true, false, 4),
    ] {
        let mut view = view_of_nested(&[AovKind::Color, deep(most, 1e-3)], SIZE);
        view.camera.exposure_scale = 2.5;
        let of = Settings {
            pixel_filter: filter,
            adaptive_sampling: adaptive,
            dome_light_camera_visible: most == 3,
            ..settings(32, 2)
        };
        let session = session_of(of, streams, nested);
        render(&session, &view);
        let color = read::<[f32; 4]>(&session, &view, AovKind::Color);
        let (mut full, mut several) = (0, 0);
        for (pixel, (color, slots)) in color.iter().zip(samples(&session, &view)).enumerate() {
            assert!(slots.len() <= usize::from(most));
            let mut sum = [0.0_f64; 4];
            for slot in &slots {
                let [r, g, b] = slot.color;
                sum = std::array::from_fn(|at| sum[at] + f64::from([r, g, b, slot.alpha][at]));
            }
            for (sum, color) in sum.iter().zip(color) {
                let apart = (sum - f64::from(*color)).abs();
                assert!(apart <= 1e-5 * sum.abs().max(1e-2), "{most}, {filter:?}, pixel {pixel}: {sum} of {color}");
            }
            full += usize::from(slots.len() == usize::from(most));
            several += usize::from(slots.len() > 1);
        }
        assert!(most == 16 || full > 50, "pixels at the limit of {most}: {full}");
        assert!(most == 1 || several > 50, "pixels with several samples: {several}");
    }
}

#[test]
fn samples_of_one_thing_are_apart_by_more_than_the_tolerance() {
    let view = |tolerance: f32| view_of_nested(&[deep(64, tolerance)], SIZE);
    let count = |tolerance: f32| {
        let view = view(tolerance);
        let session = session_of(Settings { dome_light_camera_visible: true, ..settings(16, 0) }, false, nested);
        render(&session, &view);
        let pixels = samples(&session, &view);
        let far = pixels.iter().flatten().filter(|slot| slot.depth.to_bits() == DEEP_FAR.to_bits());
        assert!(far.clone().count() > 10 && far.clone().all(|slot| slot.id == 0), "the sky is behind all");
        let things = |slots: &Vec<DeepSlot>| {
            slots.iter().map(|slot| (slot.id, slot.instance)).collect::<std::collections::BTreeSet<_>>().len()
        };
        let all: usize = pixels.iter().map(Vec::len).sum();
        (all, pixels.iter().map(things).sum::<usize>())
    };
    let [(none, things), (some, _), (wide, same_things)] = [0.0, 0.01, 10.0].map(count);
    assert_eq!((wide, same_things), (things, things), "one sample of each thing");
    assert!(none > 2 * some && some > 2 * wide, "{none}, {some}, {wide}");
}

fn in_windows(build: fn(&mut SceneDb), settings: Settings, windows: Option<u32>, streams: bool) -> Session {
    let faults = PlantedFaults { film_window: windows, ..PlantedFaults::default() };
    let options = SessionOptions { validation: true, force_streaming: streams, faults, ..SessionOptions::default() };
    let session = Session::with_options(settings, options);
    session.with_scene(build);
    session
}

#[test]
fn deep_images_have_the_same_bits_everywhere() {
    let small = Settings { geometry_budget_kib: 64, ..by(TraversalKind::Compute) };
    let ways = [
        ("shaders", by(TraversalKind::Compute), None, false),
        ("host", by(TraversalKind::Auto), None, false),
        ("streaming", by(TraversalKind::Compute), None, true),
        ("at a small budget", small, None, true),
        ("in windows", by(TraversalKind::Compute), Some(45 * 9), false),
    ];
    // Few samples, so that many pixels are full; beside other images whose values come before.
    let ids = [AovKind::CryptoObject, AovKind::CryptoMaterial];
    let kinds = [AovKind::Color, AovKind::Normal, ids[0], ids[1], deep(4, 1e-3)];
    let view = view_of_nested(&kinds, [45, 31]);
    for (name, build, samples) in [("nested", nested as fn(&mut SceneDb), 64), ("features", features, 9)] {
        let images = ways.clone().map(|(_, way, windows, streams)| {
            let of = filtering(Settings { samples_per_pixel: samples, ..way });
            let session = in_windows(build, of, windows, streams);
            render(&session, &view);
            kinds.map(|kind| read::<u8>(&session, &view, kind))
        });
        for ((way, ..), others) in ways.iter().zip(&images) {
            assert!(images[0] == *others, "{name}, {way}");
        }
        for (kinds, at) in [(&kinds[2..4], 2), (&kinds[4..], 4)] {
            let view = view_of_nested(kinds, [45, 31]);
            let session = in_windows(build, Settings { samples_per_pixel: samples, ..ways[0].1.clone() }, None, false);
            render(&session, &view);
            let alone = kinds.iter().map(|kind| read::<u8>(&session, &view, *kind));
            assert!(alone.eq(images[0][at..].iter().take(kinds.len()).cloned()), "{name}, {kinds:?} without others");
        }
    }
}

#[test]
fn a_checkpoint_holds_deep_samples() {
    assert_kept_by_a_checkpoint("deep-images", deep(8, 1e-3));
}

#[test]
fn deep_samples_exist_only_on_request() {
    let made = |kinds: &[AovKind]| passes_and_sums(kinds, ["merge_deep", "resolve_deep", "rank_ids"]);
    assert_eq!(made(&[AovKind::Color, AovKind::Depth]), ([false; 3], 0));
    let bytes = u64::from(SIZE[0] * SIZE[1]) * 5 * size_of::<DeepSlot>() as u64;
    assert_eq!(made(&[AovKind::Color, deep(5, 0.0)]), ([true, true, false], bytes));
}
