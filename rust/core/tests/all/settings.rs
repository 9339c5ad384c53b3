// SPDX-License-Identifier: Apache-2.0
//! Settings: bounds, types, names.

use oocpt_core::{SettingError, Settings, Value};

#[test]
fn samples_are_bounded_and_keep_their_value_on_error() {
    let mut settings = Settings::default();
    assert_eq!(settings.set("oocpt:samplesPerPixel", Value::Int(256)), Ok(true));
    assert_eq!(settings.set("convergedSamplesPerPixel", Value::Int(256)), Ok(false));
    for bad in [0, -1, (1 << 24) + 1, i64::MAX, i64::MIN] {
        let result = settings.set("oocpt:samplesPerPixel", Value::Int(bad));
        assert!(matches!(result, Err(SettingError::Range { .. })), "{bad}: {result:?}");
    }
    assert_eq!(settings.samples_per_pixel, 256);
    assert_eq!(settings.set("oocpt:samplesPerPixel", Value::Int(1 << 24)), Ok(true));
}

#[test]
fn wrong_types_are_refused() {
    let mut settings = Settings::default();
    let cases = [
        ("oocpt:maxBounces", Value::Float(1.5)),
        ("oocpt:maxBounces", Value::Text("many".into())),
        ("oocpt:maxBounces", Value::Bool(true)),
        ("oocpt:clamp", Value::Text(String::new())),
        ("oocpt:device", Value::Float(1.0)),
        ("enableInteractive", Value::Int(2)),
    ];
    for (key, value) in cases {
        let result = settings.set(key, value.clone());
        assert!(matches!(result, Err(SettingError::Type { .. })), "{key} {value:?}: {result:?}");
    }
    for value in [f64::NAN, f64::INFINITY, -1.0] {
        let result = settings.set("oocpt:clamp", Value::Float(value));
        assert!(matches!(result, Err(SettingError::Range { .. })), "{value}: {result:?}");
    }
    assert_eq!(settings.set("oocpt:nothing", Value::Int(1)), Err(SettingError::Unknown("oocpt:nothing".into())));
    assert_eq!(settings, Settings::default());
}

#[test]
fn text_from_the_environment_is_parsed() {
    let mut settings = Settings::default();
    let text = |t: &str| Value::Text(t.into());
    assert_eq!(settings.set("oocpt:samplesPerPixel", text(" 12 ")), Ok(true));
    assert_eq!(settings.set("oocpt:timeLimit", text("2.5")), Ok(true));
    assert_eq!(settings.set("enableInteractive", text("off")), Ok(true));
    assert_eq!(settings.set("oocpt:device", Value::Int(1)), Ok(true));
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
    assert_eq!(names.len(), 11);
    assert_eq!(Settings::env_name("oocpt:samplesPerPixel"), Some("OOCPT_SAMPLES_PER_PIXEL"));
    assert_eq!(Settings::env_name("other"), None);
}

#[test]
fn settings_survive_serialisation_and_missing_fields() {
    let settings = Settings { seed: 9, device: "lava".into(), ..Settings::default() };
    let text = serde_json::to_string(&settings).unwrap();
    assert_eq!(serde_json::from_str::<Settings>(&text).unwrap(), settings);
    assert_eq!(serde_json::from_str::<Settings>("{}").unwrap(), Settings::default());
}
