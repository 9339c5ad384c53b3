// SPDX-License-Identifier: Apache-2.0
//! Pictures that several devices render: the bits and the error of one device, however samples are divided, and
//! whatever becomes of a device. The devices are logical ones of the same physical device.

use crate::checkpoints::{Folder, by, view};
use crate::error_estimate::mirror;
use crate::scenes::{features, nested};
use crate::support::{TIMEOUT, color_request, read, render, render_with_messages};
use oocpt_core::pixel_filter::PixelFilterKind;
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{SampleSpan, Settings, TraversalKind};
use oocpt_core::stats::{DeviceUsage, RenderStats};
use oocpt_film::{FilmReader, picture};
use oocpt_gpu::{DriverCall, PlantedFailure};
use oocpt_render::{AovKind, AovRequest, Message, PlantedFaults, RenderRequest, Session, SessionOptions, Severity};

const SAMPLES: u32 = 22;

fn colour() -> RenderRequest {
    color_request(view().camera)
}

fn on(devices: &str) -> Settings {
    let plain = by(TraversalKind::Compute);
    Settings { devices: devices.to_owned(), samples_per_pixel: SAMPLES, ..plain }
}

fn open(build: fn(&mut SceneDb), settings: Settings, streams: bool, faults: PlantedFaults) -> Session {
    let options = SessionOptions { validation: true, force_streaming: streams, faults, ..SessionOptions::default() };
    let session = Session::with_options(settings, options);
    session.with_scene(build);
    session
}

fn bits(session: &Session) -> Vec<u32> {
    read(session, &colour(), AovKind::Color)
}

/// What is told of the error, but for times.
fn error(stats: &RenderStats) -> String {
    let row = stats.error.as_ref().expect("it is told");
    format!("{} {:?} {:?} {}", row.samples, row.estimate, row.worst, row.is_last)
}

/// Picture and error of a scene on these devices, without faults.
fn clean(build: fn(&mut SceneDb), settings: Settings, streams: bool) -> (Vec<u32>, String, Vec<DeviceUsage>) {
    let session = open(build, settings, streams, PlantedFaults::default());
    render(&session, &colour());
    let stats = session.stats();
    assert_eq!(stats.samples_completed, SAMPLES, "all of them");
    (bits(&session), error(&stats), stats.devices)
}

fn samples(devices: &[DeviceUsage]) -> Vec<u32> {
    devices.iter().map(|device| device.samples).collect()
}

/// The bits of one device through the file of a film, and its samples and error.
fn merged(build: fn(&mut SceneDb)) -> (Vec<u32>, String) {
    let folder = Folder::new("devices-merged");
    let file = folder.file("part");
    let film_part = file.to_string_lossy().into_owned();
    let span = SampleSpan { begin: 0, end: SAMPLES };
    render(&open(build, Settings { film_part, span, ..on("") }, false, PlantedFaults::default()), &colour());
    let film = picture(&[file], false).expect("a film");
    (film.rgba.iter().map(|value| value.to_bits()).collect(), format!("{} {:?}", film.samples, film.error()))
}

#[test]
fn two_devices_have_the_bits_and_the_error_of_one() {
    let (one, told, devices) = clean(features, on("0"), false);
    assert_eq!(samples(&devices), [SAMPLES], "one device");
    let (film, known) = merged(features);
    assert!(one == film, "those of a film");
    assert!(told.starts_with(&known), "{told}: of a film {known}");
    let (two, also_told, devices) = clean(features, on("0,0"), false);
    assert!(two == one, "other bits");
    assert_eq!(also_told, told, "the error");
    assert!(devices.iter().all(|device| device.samples > 0 && device.gpu_peak_bytes > 0), "both: {devices:?}");
    assert_eq!(samples(&devices).iter().sum::<u32>(), SAMPLES, "each sample once");
}

#[test]
fn budgets_hold_on_each_device_and_change_no_bit() {
    let (one, ..) = clean(nested, on("0"), false);
    let native = Settings { traversal: TraversalKind::Auto, ..on("0,0") };
    let tight = Settings { memory_budget_mib: 24, host_memory_budget_mib: 256, ..on("0, 0") };
    for (what, settings) in [("native", native), ("streamed", tight)] {
        let (two, _, devices) = clean(nested, settings, true);
        assert!(two == one, "{what}: other bits");
        let keeps = |device: &DeviceUsage| device.gpu_peak_bytes <= device.gpu_budget_bytes && device.samples > 0;
        assert!(devices.len() == 2 && devices.iter().all(keeps), "{what}: {devices:?}");
        if what == "streamed" {
            assert!(devices.iter().all(|device| device.gpu_budget_bytes == 24 << 20), "{devices:?}");
        }
    }
}

#[test]
fn a_device_that_fails_gives_its_samples_to_the_others() {
    let (one, told, _) = clean(nested, on("0"), false);
    let lost = |after| PlantedFailure { call: DriverCall::Submit, after, times: 1 };
    let short = PlantedFailure { call: DriverCall::Buffer, after: 0, times: u32::MAX };
    for (what, number, failure) in [("at once", 1, lost(0)), ("later", 0, lost(12)), ("memory", 1, short)] {
        let faults = PlantedFaults { team_failure: Some((Some(number), failure)), ..PlantedFaults::default() };
        let session = open(nested, on("0,0"), false, faults);
        let messages = render_with_messages(&session, &colour());
        let [Message { severity: Severity::Warning, text }] = &*messages else { panic!("{what}: {messages:?}") };
        assert!(text.contains("is left out") && text.contains("the others render"), "{what}: {text}");
        let stats = session.stats();
        let [failed, other] = [number, 1 - number].map(|number| &stats.devices[number as usize]);
        assert!(failed.failure.is_some() && other.failure.is_none(), "{what}: {:?}", stats.devices);
        assert_eq!(samples(&stats.devices).iter().sum::<u32>(), SAMPLES, "{what}: each sample once");
        assert!(bits(&session) == one, "{what}: other bits");
        assert_eq!(error(&stats), told, "{what}: the error");
    }
}

#[test]
fn a_picture_whose_devices_all_fail_is_an_error() {
    let failure = PlantedFailure { call: DriverCall::Submit, after: 0, times: 1 };
    let faults = PlantedFaults { team_failure: Some((None, failure)), ..PlantedFaults::default() };
    let session = open(nested, on("0,0"), false, faults);
    let messages = render_with_messages(&session, &colour());
    let [first, last] = &*messages else { panic!("two messages: {messages:?}") };
    assert!(first.severity == Severity::Warning && first.text.contains("is left out"), "{first:?}");
    assert!(last.severity == Severity::Error && last.text.contains("lost"), "{last:?}");
    assert_eq!(session.shown_generation(), 0, "no picture");
    session.restart();
    assert!(session.wait_converged(TIMEOUT), "the devices are opened again");
    assert!(bits(&session) == clean(nested, on("0"), false).0, "and render it");
}

/// Sums that merge take more than films do. One device alone has windows.
#[test]
fn a_film_that_is_too_large_for_each_device_is_rendered_by_one() {
    let large = RenderRequest { width: 1024, height: 1024, ..colour() };
    let settings = |devices: &str| Settings { memory_budget_mib: 192, samples_per_pixel: 1, ..on(devices) };
    let alone = open(nested, settings(""), false, PlantedFaults::default());
    render(&alone, &large);
    let session = open(nested, settings("0,0"), false, PlantedFaults::default());
    let messages = render_with_messages(&session, &large);
    let [left_out, Message { severity: Severity::Warning, text }] = &*messages else { panic!("{messages:?}") };
    assert!(left_out.text.contains("is left out"), "{left_out:?}");
    assert!(text.contains("no device has the memory") && text.contains("on one device"), "{text}");
    let [one, several] = [&alone, &session].map(|session| read::<u32>(session, &large, AovKind::Color));
    assert!(several == one, "the picture of one");
}

#[test]
fn a_slow_device_renders_less_and_no_other_bits() {
    let faults = PlantedFaults { slow_device: Some([1, 3]), ..PlantedFaults::default() };
    let session = open(nested, on("0,0"), false, faults);
    render(&session, &colour());
    let stats = session.stats();
    let [fast, slow] = &*stats.devices else { panic!("two devices: {:?}", stats.devices) };
    assert!(slow.samples > 0 && fast.samples > slow.samples && fast.blocks >= 3, "{:?}", stats.devices);
    assert!(bits(&session) == clean(nested, on("0"), false).0, "other bits");
}

#[test]
fn a_target_error_ends_it_at_the_same_samples() {
    let of = |devices| {
        let settings = Settings { samples_per_pixel: 1 << 12, target_error: 0.02, ..on(devices) };
        let session = open(mirror, settings, false, PlantedFaults::default());
        render(&session, &colour());
        let stats = session.stats();
        (stats.samples_completed, error(&stats), bits(&session))
    };
    let (one, two) = (of("0"), of("0,0"));
    assert!(one.0 >= 16 && one.0.is_power_of_two() && one.0 < 1 << 12, "{} samples", one.0);
    assert!((two.0, &two.1) == (one.0, &one.1), "{} samples and {}, not {} and {}", two.0, two.1, one.0, one.1);
    assert!(two.2 == one.2, "other bits");
}

#[test]
fn images_through_pixel_centres_come_from_one_device() {
    let mut request = colour();
    request.aovs.push(AovRequest { kind: AovKind::Depth, clear: [1.0; 4] });
    let of = |devices| {
        let session = open(nested, on(devices), false, PlantedFaults::default());
        render(&session, &request);
        (read::<u32>(&session, &request, AovKind::Depth), bits(&session))
    };
    let (plain, one, two) = (of(""), of("0"), of("0,0"));
    assert!(two.0 == plain.0 && one.0 == plain.0, "the depth of a plain render");
    assert!(two.1 == one.1, "the colour");
}

#[test]
fn a_part_of_a_film_is_rendered_by_several_devices_and_goes_on() {
    let folder = Folder::new("devices-part");
    let (one, two) = (folder.file("one"), folder.file("two"));
    let part = |devices: &str, file: &std::path::Path, begin, end| {
        let film_part = file.to_string_lossy().into_owned();
        let settings = Settings { film_part, span: SampleSpan { begin, end }, ..on(devices) };
        let session = open(nested, settings, false, PlantedFaults::default());
        render(&session, &colour());
        session.timings().paths / colour().pixels()
    };
    part("", &one, 3, 40);
    assert_eq!(part("0,0", &two, 3, 21), 18, "these samples");
    assert_eq!(part("0,0", &two, 3, 40), 19, "what the file lacks");
    let bits = |file| picture(&[file], true).expect("a film").rgba;
    assert_eq!(FilmReader::open(&two).expect("a film").header().samples().len(), 1, "no holes");
    assert!(bits(one) == bits(two), "the same bits");
}

#[test]
fn what_films_do_not_hold_is_rendered_on_one_device_with_one_message() {
    type RequestChange = fn(&mut RenderRequest);
    let all = |request: &mut RenderRequest| request.aovs.push(AovRequest { kind: AovKind::Variance, clear: [0.0; 4] });
    let none = |_: &mut RenderRequest| {};
    let cases: [(&str, Settings, RequestChange); 4] = [
        ("adaptiveSampling", Settings { adaptive_sampling: true, ..on("0,0") }, none),
        ("mitchell", Settings { pixel_filter: PixelFilterKind::Mitchell, ..on("0,0") }, none),
        ("shows images on the way", Settings { interactive: true, ..on("0,0") }, none),
        ("no image variance", on("0,0"), all),
    ];
    for (what, settings, change) in cases {
        let mut request = colour();
        change(&mut request);
        let plain =
            open(nested, Settings { devices: String::new(), ..settings.clone() }, false, PlantedFaults::default());
        render(&plain, &request);
        let session = open(nested, settings, false, PlantedFaults::default());
        let messages = render_with_messages(&session, &request);
        let [Message { severity: Severity::Warning, text }] = &*messages else { panic!("{what}: {messages:?}") };
        assert!(text.contains(what) && text.contains("on one device"), "{what}: {text}");
        assert!(session.stats().devices.is_empty() && bits(&session) == bits(&plain), "{what}: as without the setting");
    }
}

#[test]
fn devices_that_there_are_not_are_an_error_with_the_names_of_those_that_there_are() {
    let session = open(nested, on("0,no such device"), false, PlantedFaults::default());
    let messages = render_with_messages(&session, &colour());
    let [Message { severity: Severity::Error, text }] = &*messages else { panic!("one message: {messages:?}") };
    assert!(text.contains("\"no such device\" names no device; the devices are [0]"), "{text}");
}

#[test]
fn a_time_limit_ends_it_with_what_there_is() {
    let settings = Settings { samples_per_pixel: 1 << 20, time_limit_secs: 0.2, ..on("0,0") };
    let session = open(nested, settings, false, PlantedFaults::default());
    render(&session, &colour());
    let stats = session.stats();
    assert!(stats.samples_completed > 0 && stats.samples_completed < 1 << 20, "{}", stats.samples_completed);
    assert!(bits(&session).iter().any(|bits| *bits != 0), "a picture");
}
