// SPDX-License-Identifier: Apache-2.0
//! Denoised pictures: nearer to the truth, for whoever asks for them, and nothing of it for whoever does not. The
//! library is the one that `cargo xtask test` names.

use crate::scenes::nested;
use crate::support::{self, color_request, filtering, perspective, read, render, render_with_messages, settings};
use glam::DVec3;
use oocpt_core::settings::{DenoiseMode, SettingValue, Settings};
use oocpt_render::picture::PictureAttribute;
use oocpt_render::{AovKind, AovRequest, PixelWindow, PlantedFaults, RenderRequest, Session, SessionOptions, Severity};

const SIZE: [u32; 2] = [96, 72];

fn view() -> RenderRequest {
    color_request(perspective(DVec3::new(0.0, 3.0, 8.0), DVec3::new(0.0, 0.5, 0.0), 0.7, SIZE))
}

fn asking(kinds: &[AovKind]) -> RenderRequest {
    let aovs = kinds.iter().map(|&kind| AovRequest { kind, clear: [0.0; 4] }).collect();
    RenderRequest { aovs, ..view() }
}

fn denoising(denoise: DenoiseMode, samples: u32) -> Settings {
    let file = std::env::var("OOCPT_DENOISER_LIBRARY").expect("a file, which `cargo xtask test` names");
    Settings { denoise, denoiser_library: file, ..filtering(settings(samples, 1)) }
}

fn session(settings: Settings) -> Session {
    let session = support::session(settings);
    session.with_scene(nested);
    session
}

/// Mean squared difference of two colours.
fn difference(a: &[f32], b: &[f32]) -> f64 {
    let squares: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    squares / f64::from(u32::try_from(a.len()).expect("small"))
}

#[test]
fn the_denoised_layer_is_nearer_to_the_truth_and_the_colour_stays() {
    let truth = session(settings(1024, 1));
    render(&truth, &view());
    let truth = read::<f32>(&truth, &view(), AovKind::Color);
    let plain = session(filtering(settings(4, 1)));
    render(&plain, &view());
    let noisy = read::<f32>(&plain, &view(), AovKind::Color);
    let session = session(denoising(DenoiseMode::Off, 4));
    let request = asking(&[AovKind::Color, AovKind::Denoised]);
    render(&session, &request);
    assert_eq!(read::<f32>(&session, &request, AovKind::Color), noisy, "the colour has its bits");
    let denoised = read::<f32>(&session, &request, AovKind::Denoised);
    let [before, after] = [difference(&noisy, &truth), difference(&denoised, &truth)];
    assert!(after < 0.5 * before, "{after} of {before}");
    for (a, b) in denoised.chunks_exact(4).zip(noisy.chunks_exact(4)) {
        assert_eq!(a[3], b[3], "alpha is not denoised");
    }
    let stats = session.stats();
    let usage = stats.denoised.expect("what denoised it");
    assert!(usage.by.starts_with("Open Image Denoise 2.") && !usage.replaces_color, "{usage:?}");
    let said = session.picture_attributes();
    let value = said.iter().find(|(name, _)| name == "denoised").map(|(_, value)| value);
    assert_eq!(value, Some(&PictureAttribute::Text("layer".into())));
}

#[test]
fn the_setting_denoises_the_colour_and_its_layer_alike() {
    let session = session(denoising(DenoiseMode::Final, 4));
    let request = asking(&[AovKind::Color, AovKind::Denoised]);
    render(&session, &request);
    let [color, denoised] = [AovKind::Color, AovKind::Denoised].map(|kind| read::<f32>(&session, &request, kind));
    assert_eq!(color, denoised);
    let plain = self::session(filtering(settings(4, 1)));
    render(&plain, &view());
    let noisy = read::<f32>(&plain, &view(), AovKind::Color);
    assert!(difference(&color, &noisy) > 0.0, "something was filtered");
    assert_eq!(session.stats().denoised.map(|usage| usage.replaces_color), Some(true));
    let made = plain.stats().inventory;
    assert_eq!(plain.stats().denoised, None);
    let has_guide = made.buffers.iter().any(|buffer| buffer.name == "image albedo" && buffer.bytes > 0);
    assert!(!has_guide, "no guide where nobody denoises");
}

#[test]
fn images_are_denoised_where_they_are_with_the_bits_of_copies() {
    let request = asking(&[AovKind::Color, AovKind::Denoised, AovKind::Albedo, AovKind::Normal]);
    // Images of pixel centres are made once: a filter that wrote them would be seen in the next picture.
    for filter_aovs in [true, false] {
        let [in_place, copied] = [false, true].map(|denoises_by_host| {
            let faults = PlantedFaults { denoises_by_host, ..PlantedFaults::default() };
            let options = SessionOptions { validation: true, faults, ..SessionOptions::default() };
            let settings = Settings { filter_aovs, ..denoising(DenoiseMode::Off, 2) };
            let session = Session::with_options(settings, options);
            session.with_scene(nested);
            let images = |request: &RenderRequest| {
                let usage = session.stats().denoised.expect("denoised");
                assert_eq!(usage.in_place, !denoises_by_host, "{usage:?}");
                request.aovs.iter().map(|aov| read::<u8>(&session, request, aov.kind)).collect::<Vec<_>>()
            };
            render(&session, &request);
            let first = images(&request);
            assert!(session.set_setting("oocpt:samplesPerPixel", SettingValue::Int(4)).expect("a setting"));
            assert!(session.wait_converged(support::TIMEOUT));
            let second = images(&request);
            assert_eq!(session.take_messages(), []);
            // The film has samples, and a colour that nobody was to denoise.
            let plain = asking(&[AovKind::Color]);
            render(&session, &plain);
            render(&session, &request);
            [first, second, images(&request)]
        });
        assert!(in_place == copied, "the same bits");
        let [first, second, third] = &in_place;
        assert!(first[0] != first[1] && second[1] != first[1] && third == second);
        assert!(first[2] != second[2] || !filter_aovs, "albedo is filtered with the samples, or the same");
        assert!(filter_aovs || first[2..] == second[2..], "images of pixel centres stay");
    }
}

#[test]
fn a_window_is_denoised_as_itself() {
    let window = PixelWindow { x: 20, y: 10, width: 40, height: 30 };
    let request = RenderRequest { window: Some(window), ..view() };
    let session = session(denoising(DenoiseMode::Final, 2));
    render(&session, &request);
    let color = read::<f32>(&session, &request, AovKind::Color);
    let inside = |at: usize| {
        let (x, y) = (at % 96, at / 96);
        (20..60).contains(&x) && (10..40).contains(&y)
    };
    let lit = |pixel: &[f32]| pixel[0] > 0.0;
    let (mut bright, mut outside) = (0, 0);
    for (at, pixel) in color.chunks_exact(4).enumerate() {
        match (inside(at), lit(pixel)) {
            (true, true) => bright += 1,
            (false, true) => outside += 1,
            _ => {}
        }
    }
    assert!(bright > 1000 && outside == 0, "{bright} inside, {outside} outside");
}

#[test]
fn a_film_in_windows_is_denoised_as_a_whole() {
    let faults = PlantedFaults { film_window: Some(96 * 20), ..PlantedFaults::default() };
    let request = asking(&[AovKind::Color, AovKind::Denoised, AovKind::CryptoObject]);
    let kinds = [AovKind::Denoised, AovKind::CryptoObject];
    let [whole, windows] = [PlantedFaults::default(), faults].map(|faults| {
        let options = SessionOptions { validation: true, faults, ..SessionOptions::default() };
        let session = Session::with_options(denoising(DenoiseMode::Off, 4), options);
        session.with_scene(nested);
        render(&session, &request);
        (kinds.map(|kind| read::<u8>(&session, &request, kind)), session.stats().film_windows)
    });
    assert!(whole.1 == 0 && windows.1 > 2, "{} {}", whole.1, windows.1);
    assert!(whole.0 == windows.0, "the same bits");
}

#[test]
fn a_library_that_is_not_there_is_told_once_and_the_picture_stays() {
    let library = "/nowhere/libOpenImageDenoise.so".to_owned();
    let session = session(Settings { denoiser_library: library, ..denoising(DenoiseMode::Final, 2) });
    let messages = render_with_messages(&session, &view());
    assert_eq!(messages.len(), 1, "{messages:?}");
    let said = &messages[0];
    let names_both = said.text.contains("/nowhere/") && said.text.contains("pip install pyoidn");
    assert!(said.severity == Severity::Warning && names_both, "{said:?}");
    let plain = self::session(filtering(settings(2, 1)));
    render(&plain, &view());
    assert_eq!(
        read::<f32>(&session, &view(), AovKind::Color),
        read::<f32>(&plain, &view(), AovKind::Color),
        "the picture as it is"
    );
    session.restart();
    assert!(session.wait_converged(support::TIMEOUT));
    assert_eq!(session.take_messages(), [], "once");
    assert_eq!(session.stats().denoised, None);
}
