// SPDX-License-Identifier: Apache-2.0
//! Settings: bounds, types, names.

use oocpt_core::pixel_filter::PixelFilterKind;
use oocpt_core::residency::PolicyKind;
use oocpt_core::settings::{FilmEffect, TraversalKind};
use oocpt_core::{SettingAudience, SettingError, SettingValue, Settings};

#[test]
fn samples_are_bounded_and_keep_their_value_on_error() {
    let mut settings = Settings::default();
    assert_eq!(settings.set("oocpt:samplesPerPixel", SettingValue::Int(256)), Ok(true));
    assert_eq!(settings.set("convergedSamplesPerPixel", SettingValue::Int(256)), Ok(false));
    for bad in [0, -1, (1 << 24) + 1, i64::MAX, i64::MIN] {
        let result = settings.set("oocpt:samplesPerPixel", SettingValue::Int(bad));
        assert!(matches!(result, Err(SettingError::Range { .. })), "{bad}: {result:?}");
    }
    assert_eq!(settings.samples_per_pixel, 256);
    assert_eq!(settings.set("oocpt:samplesPerPixel", SettingValue::Int(1 << 24)), Ok(true));
}

#[test]
fn sizes_of_chunks_and_geometry_are_bounded() {
    let mut settings = Settings::default();
    assert_eq!((settings.chunk_size_kib, settings.geometry_budget_kib), (8192, 0), "defaults");
    for bad in [0, 15, (1 << 20) + 1, -8192, i64::MAX] {
        let result = settings.set("oocpt:chunkSize", SettingValue::Int(bad));
        assert!(matches!(result, Err(SettingError::Range { .. })), "{bad}: {result:?}");
    }
    for bad in [-1, i64::from(u32::MAX) + 1] {
        let result = settings.set("oocpt:geometryBudget", SettingValue::Int(bad));
        assert!(matches!(result, Err(SettingError::Range { .. })), "{bad}: {result:?}");
    }
    assert_eq!(settings, Settings::default(), "what is refused changes nothing");
    for (key, good) in [("oocpt:chunkSize", 16), ("oocpt:chunkSize", 1 << 20), ("oocpt:geometryBudget", 1)] {
        assert_eq!(settings.set(key, SettingValue::Int(good)), Ok(true), "{key} = {good}");
        assert_eq!(settings.get(key), Some(SettingValue::Int(good)), "{key} = {good}");
    }
    assert_eq!((settings.chunk_size_kib, settings.geometry_budget_kib), (1 << 20, 1), "each has its field");
}

#[test]
fn policies_go_by_name_and_a_wrong_name_lists_the_right_ones() {
    let mut settings = Settings::default();
    assert_eq!(settings.policy, PolicyKind::Benefit, "the default");
    for (name, kind) in
        [("sweep", PolicyKind::Sweep), (" priority ", PolicyKind::Priority), ("benefit", PolicyKind::Benefit)]
    {
        assert_eq!(settings.set("oocpt:policy", SettingValue::Text(name.into())), Ok(true), "{name}");
        assert_eq!(settings.policy, kind, "{name}");
        assert_eq!(settings.get("oocpt:policy"), Some(SettingValue::Text(name.trim().into())), "{name}");
    }
    for bad in ["", "Benefit", "lru", "sweep,priority"] {
        let error = settings.set("oocpt:policy", SettingValue::Text(bad.into())).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("sweep, priority, benefit") && text.contains(&format!("{bad:?}")), "{text}");
    }
    let result = settings.set("oocpt:policy", SettingValue::Bool(true));
    assert!(matches!(result, Err(SettingError::Type { .. })), "{result:?}");
    assert_eq!(settings, Settings::default(), "a wrong policy changes nothing");
}

#[test]
fn traversal_goes_by_name_and_a_wrong_name_lists_the_right_ones() {
    let mut settings = Settings::default();
    assert_eq!(settings.traversal, TraversalKind::Auto, "the default");
    for (name, kind) in [("native", TraversalKind::Native), (" compute ", TraversalKind::Compute)] {
        assert_eq!(settings.set("oocpt:traversal", SettingValue::Text(name.into())), Ok(true), "{name}");
        assert_eq!(settings.traversal, kind, "{name}");
        assert_eq!(settings.get("oocpt:traversal"), Some(SettingValue::Text(name.trim().into())), "{name}");
    }
    let error = settings.set("oocpt:traversal", SettingValue::Text("embree".into())).unwrap_err();
    assert!(error.to_string().contains("auto, compute, native"), "{error}");
    assert_eq!(settings.traversal, TraversalKind::Compute, "a wrong name changes nothing");
}

#[test]
fn pixel_filters_go_by_name_and_their_width_is_bounded() {
    let mut settings = Settings::default();
    assert!(settings.filter().is_plain(), "the default");
    for kind in PixelFilterKind::ALL {
        settings.set("oocpt:pixelFilter", SettingValue::Text(kind.name().into())).expect("a name of the list");
        assert_eq!((settings.filter().kind, settings.filter().width), (kind, kind.usual_width()), "its usual width");
    }
    let error = settings.set("oocpt:pixelFilter", SettingValue::Text("sinc".into())).expect_err("none of them");
    assert!(error.to_string().contains("box, triangle, gaussian, blackman-harris, mitchell"), "{error}");
    assert_eq!(settings.set("oocpt:pixelFilterWidth", SettingValue::Float(1e-3)), Ok(true), "tiny");
    assert_eq!(settings.set("oocpt:pixelFilterWidth", SettingValue::Int(64)), Ok(true), "huge");
    let error = settings.set("oocpt:pixelFilterWidth", SettingValue::Float(64.5)).expect_err("too much");
    assert!(error.to_string().contains("outside 0 to 64"), "{error}");
    assert!((settings.filter().width - 64.0).abs() < 1e-6, "it stays");
}

#[test]
fn a_report_has_any_name() {
    let mut settings = Settings::default();
    assert_eq!(settings.set("oocpt:chunkReport", SettingValue::Text("/tmp/a b.json".into())), Ok(true), "any name");
    assert_eq!(settings.chunk_report, "/tmp/a b.json", "as given");
    assert_eq!(settings.set("oocpt:chunkReport", SettingValue::Text(String::new())), Ok(true), "and none");
}

/// The settings of this renderer, in their order.
const OURS: [&str; 40] = [
    "oocpt:samplesPerPixel",
    "oocpt:maxBounces",
    "oocpt:seed",
    "oocpt:clamp",
    "oocpt:timeLimit",
    "oocpt:memoryBudget",
    "oocpt:device",
    "oocpt:devices",
    "oocpt:traversal",
    "oocpt:hostMappedGeometry",
    "oocpt:policy",
    "oocpt:chunkSize",
    "oocpt:geometryBudget",
    "oocpt:hostMemoryBudget",
    "oocpt:dicingRate",
    "oocpt:chunkReport",
    "oocpt:materialReport",
    "oocpt:report",
    "oocpt:reference",
    "oocpt:targetError",
    "oocpt:stragglerRoulette",
    "oocpt:adaptiveSampling",
    "oocpt:textureCache",
    "oocpt:textureCacheSize",
    "oocpt:geometryCache",
    "oocpt:geometryCacheSize",
    "oocpt:pipelineCache",
    "oocpt:maxDiffuseBounces",
    "oocpt:maxSpecularBounces",
    "oocpt:maxTransmissionBounces",
    "oocpt:pixelFilter",
    "oocpt:pixelFilterWidth",
    "oocpt:filterAovs",
    "oocpt:denoise",
    "oocpt:denoiserLibrary",
    "oocpt:checkpoint",
    "oocpt:checkpointInterval",
    "oocpt:filmPart",
    "oocpt:sampleRange",
    "oocpt:products",
];

/// Hosts show them in this order; new settings come after the ones that hosts knew, before the names that all renderers
/// share.
#[test]
fn settings_are_listed_in_order() {
    let keys: Vec<&str> = Settings::descriptors().iter().map(|d| d.key).collect();
    assert_eq!(keys[..OURS.len()], OURS, "the order");
    assert!(keys[OURS.len()..].iter().all(|key| !key.starts_with("oocpt:")), "{keys:?}");
    let names = [
        "OOCPT_DEVICES",
        "OOCPT_TRAVERSAL",
        "OOCPT_HOST_MAPPED_GEOMETRY",
        "OOCPT_POLICY",
        "OOCPT_CHUNK_SIZE",
        "OOCPT_GEOMETRY_BUDGET",
        "OOCPT_HOST_MEMORY_BUDGET",
        "OOCPT_DICING_RATE",
        "OOCPT_CHUNK_REPORT",
        "OOCPT_MATERIAL_REPORT",
        "OOCPT_REPORT",
        "OOCPT_REFERENCE",
        "OOCPT_TARGET_ERROR",
        "OOCPT_STRAGGLER_ROULETTE",
        "OOCPT_ADAPTIVE_SAMPLING",
        "OOCPT_TEXTURE_CACHE",
        "OOCPT_TEXTURE_CACHE_SIZE",
        "OOCPT_GEOMETRY_CACHE",
        "OOCPT_GEOMETRY_CACHE_SIZE",
        "OOCPT_PIPELINE_CACHE",
        "OOCPT_MAX_DIFFUSE_BOUNCES",
        "OOCPT_MAX_SPECULAR_BOUNCES",
        "OOCPT_MAX_TRANSMISSION_BOUNCES",
        "OOCPT_PIXEL_FILTER",
        "OOCPT_PIXEL_FILTER_WIDTH",
        "OOCPT_FILTER_AOVS",
        "OOCPT_DENOISE",
        "OOCPT_DENOISER_LIBRARY",
        "OOCPT_CHECKPOINT",
        "OOCPT_CHECKPOINT_INTERVAL",
        "OOCPT_FILM_PART",
        "OOCPT_SAMPLE_RANGE",
        "OOCPT_PRODUCTS",
    ];
    assert_eq!(OURS[7..].iter().filter_map(|key| Settings::env_name(key)).collect::<Vec<_>>(), names, "variables");
}

#[test]
fn developers_have_six_settings_of_their_own() {
    let mut theirs = Settings::descriptors();
    theirs.retain(|descriptor| descriptor.audience == SettingAudience::Developer);
    let keys: Vec<&str> = theirs.iter().map(|descriptor| descriptor.key).collect();
    let ours = [
        "oocpt:traversal",
        "oocpt:hostMappedGeometry",
        "oocpt:policy",
        "oocpt:chunkReport",
        "oocpt:materialReport",
        "oocpt:reference",
    ];
    assert_eq!(keys, ours, "no host lists these");
}

#[test]
fn wrong_types_are_refused() {
    let mut settings = Settings::default();
    let cases = [
        ("oocpt:maxBounces", SettingValue::Float(1.5)),
        ("oocpt:maxBounces", SettingValue::Text("many".into())),
        ("oocpt:maxBounces", SettingValue::Bool(true)),
        ("oocpt:clamp", SettingValue::Text(String::new())),
        ("oocpt:device", SettingValue::Float(1.0)),
        ("oocpt:devices", SettingValue::Float(1.0)),
        ("enableInteractive", SettingValue::Int(2)),
        ("oocpt:chunkSize", SettingValue::Float(64.5)),
        ("oocpt:chunkReport", SettingValue::Bool(false)),
    ];
    for (key, value) in cases {
        let result = settings.set(key, value.clone());
        assert!(matches!(result, Err(SettingError::Type { .. })), "{key} {value:?}: {result:?}");
    }
    for value in [f64::NAN, f64::INFINITY, -1.0] {
        let result = settings.set("oocpt:clamp", SettingValue::Float(value));
        assert!(matches!(result, Err(SettingError::Range { .. })), "{value}: {result:?}");
    }
    let unknown = settings.set("oocpt:maxDifuseBounces", SettingValue::Int(1)).expect_err("no such setting");
    let said = "there is no setting oocpt:maxDifuseBounces; did you mean oocpt:maxDiffuseBounces?";
    assert_eq!(unknown.to_string(), said, "the nearest name");
    assert_eq!(settings, Settings::default());
}

#[test]
fn text_from_the_environment_is_parsed() {
    let mut settings = Settings::default();
    let text = |t: &str| SettingValue::Text(t.into());
    assert_eq!(settings.set("oocpt:samplesPerPixel", text(" 12 ")), Ok(true));
    assert_eq!(settings.set("oocpt:timeLimit", text("2.5")), Ok(true));
    assert_eq!(settings.set("enableInteractive", text("off")), Ok(true));
    assert_eq!(settings.set("oocpt:device", SettingValue::Int(1)), Ok(true));
    assert_eq!((settings.samples_per_pixel, settings.interactive, &*settings.device), (12, false, "1"));
    assert!((settings.time_limit_secs - 2.5).abs() < 1e-9);
}

#[test]
fn every_descriptor_can_be_set_to_its_default_and_has_an_own_variable() {
    let mut names = std::collections::BTreeSet::new();
    for descriptor in Settings::descriptors() {
        let mut settings = Settings::default();
        assert_eq!(settings.set(descriptor.key, descriptor.default.clone()), Ok(false), "{}", descriptor.key);
        let name = Settings::env_name(descriptor.key).unwrap();
        assert!(name.starts_with("OOCPT_") && names.insert(name), "{name}");
    }
    assert_eq!(names.len(), 44);
    assert_eq!(Settings::env_name("oocpt:samplesPerPixel"), Some("OOCPT_SAMPLES_PER_PIXEL"));
    assert_eq!(Settings::env_name("other"), None);
}

#[test]
fn settings_survive_serialisation_and_missing_fields() {
    let settings = Settings { seed: 9, device: "lava".into(), policy: PolicyKind::Sweep, ..Settings::default() };
    let text = serde_json::to_string(&settings).unwrap();
    assert_eq!(serde_json::from_str::<Settings>(&text).unwrap(), settings);
    assert_eq!(serde_json::from_str::<Settings>("{}").unwrap(), Settings::default());
}

/// Another value of a setting.
fn other_value(value: &SettingValue, key: &str) -> SettingValue {
    match (value, key) {
        (_, "oocpt:traversal") => SettingValue::Text("native".into()),
        (_, "oocpt:pixelFilter") => SettingValue::Text("mitchell".into()),
        (_, "oocpt:denoise") => SettingValue::Text("final".into()),
        (_, "oocpt:policy") => SettingValue::Text("sweep".into()),
        (_, "oocpt:hostMappedGeometry") => SettingValue::Text("off".into()),
        (SettingValue::Bool(value), _) => SettingValue::Bool(!value),
        (SettingValue::Int(value), _) if key.ends_with("Bounces") => SettingValue::Int(value - 1), // some are at most
        (SettingValue::Int(value), _) => SettingValue::Int(value + 1),
        (SettingValue::Float(value), _) => SettingValue::Float(value + 1.0),
        (_, "oocpt:sampleRange") => SettingValue::Text("2..7".into()),
        (SettingValue::Text(_), _) => SettingValue::Text("other".into()),
    }
}

#[test]
fn samples_depend_on_settings_as_the_rows_say() {
    let plain = Settings::default().of_samples();
    for setting in Settings::descriptors() {
        let mut settings = Settings::default();
        let changed = settings.set(setting.key, other_value(&setting.default, setting.key));
        assert_eq!(changed, Ok(true), "{}", setting.key);
        let begins_again = Settings::film_effect(setting.key) == Some(FilmEffect::BeginsAgain);
        assert_eq!(settings.of_samples() != plain, begins_again, "{}", setting.key);
    }
    let is_told = |key: &str| plain.contains_key(key);
    assert!(is_told("oocpt:seed") && is_told("oocpt:chunkSize"), "what changes samples");
    assert!(!is_told("oocpt:memoryBudget") && !is_told("oocpt:samplesPerPixel"), "what does not");
}

#[test]
fn a_film_goes_on_as_the_rows_say() {
    let mut goes_on = Vec::new();
    for setting in Settings::descriptors() {
        let mut settings = Settings::default();
        let changed = settings.set(setting.key, other_value(&setting.default, setting.key));
        assert_eq!(changed, Ok(true), "{}", setting.key);
        let is_kept = settings.goes_on_from(&Settings::default());
        assert_eq!(is_kept, Settings::film_effect(setting.key) == Some(FilmEffect::GoesOn), "{}", setting.key);
        if is_kept {
            goes_on.push(setting.key);
        }
    }
    let of_samples = ["oocpt:samplesPerPixel", "oocpt:timeLimit", "oocpt:materialReport", "oocpt:report"];
    let others = ["oocpt:reference", "oocpt:targetError", "oocpt:denoise", "oocpt:denoiserLibrary"];
    let last = ["oocpt:checkpoint", "oocpt:checkpointInterval", "oocpt:products", "convergedSamplesPerPixel"];
    let others = [&others[..], &last[..]].concat();
    assert_eq!(goes_on, [&of_samples[..], &others[..]].concat(), "what the samples depend on begins again");
    assert!(Settings::default().goes_on_from(&Settings::default()), "the same settings");
}

#[test]
fn a_sample_range_is_two_numbers_in_order() {
    let mut settings = Settings::default();
    let mut set = |text: &str| settings.set("oocpt:sampleRange", SettingValue::Text(text.into()));
    assert_eq!(set("3..17"), Ok(true), "a range");
    for wrong in ["3", "3..", "..3", "3..3", "7..3", "-1..3", "0..16777217", "a..b", "0..1..2"] {
        assert!(matches!(set(wrong), Err(SettingError::Choice { .. })), "{wrong}");
    }
    assert_eq!(settings.get("oocpt:sampleRange"), Some(SettingValue::Text("3..17".into())), "it stays");
    assert_eq!((settings.samples_per_pixel, settings.clone().with_span().samples_per_pixel), (64, 17));
    assert_eq!(settings.set("oocpt:sampleRange", SettingValue::Text(String::new())), Ok(true), "none");
    assert_eq!(settings.with_span().samples_per_pixel, 64, "all samples again");
}
