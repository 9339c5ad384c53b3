// SPDX-License-Identifier: Apache-2.0
//! Which value of a setting counts: what was given on the command line, else what the host set explicitly, else the
//! `OOCPT_*` variable, else the default.
//!
//! The variables are read once through the function given to [`SettingLayers::new`]. The command line is one per
//! process.

use crate::ffi::{ScalarTag, ScalarValue, SettingDescriptor};
use oocpt_core::settings::{SettingAudience, SettingError, SettingValue, Settings};
use std::sync::{Mutex, PoisonError};

/// What the command line of this process has set, checked, in the order given.
static COMMAND_LINE: Mutex<Vec<(String, SettingValue)>> = Mutex::new(Vec::new());

/// Sets a setting for all sessions that are opened from now on, above scene, host and environment. `name`: a key, with
/// or without `oocpt:` in front. A wrong name or value is an error, and nothing is set.
pub(crate) fn set_on_command_line(name: &str, text: &str) -> Result<(), SettingError> {
    let key = Settings::key_named(name)?;
    let mut checked = Settings::default();
    checked.set(key, SettingValue::Text(text.to_owned()))?;
    let value = checked.get(key).unwrap_or_else(|| SettingValue::Text(text.to_owned()));
    COMMAND_LINE.lock().unwrap_or_else(PoisonError::into_inner).push((key.to_owned(), value));
    Ok(())
}

/// The explicit settings and the environment's, by key.
#[derive(Debug, Default)]
pub(crate) struct SettingLayers {
    environment: Vec<(String, SettingValue)>,
    /// In the order in which they were set: of two keys for the same thing the later one counts.
    explicit: Vec<(String, SettingValue)>,
    command_line: Vec<(String, SettingValue)>,
}

impl SettingLayers {
    /// Reads the variable of every setting. Unreadable ones are skipped and named in the returned lines.
    pub(crate) fn new(variable: impl Fn(&str) -> Option<String>) -> (Self, Vec<String>) {
        let command_line = COMMAND_LINE.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let mut layers = Self { command_line, ..Self::default() };
        let mut complaints = Vec::new();
        let mut checked = Settings::default();
        for descriptor in Settings::descriptors() {
            let key = descriptor.key;
            let Some((name, text)) = Settings::env_name(key).and_then(|name| Some((name, variable(name)?))) else {
                continue;
            };
            match checked.set(key, SettingValue::Text(text.clone())) {
                Ok(_) => layers.environment.extend(checked.get(key).map(|value| (key.to_owned(), value))),
                Err(error) => complaints.push(format!("{name}=\"{text}\" is ignored: {error}")),
            }
        }
        (layers, complaints)
    }

    /// The settings as all layers give them.
    pub(crate) fn settings(&self) -> Settings {
        let mut settings = Settings::default();
        apply(&mut settings, self.environment.iter().chain(&self.explicit).chain(&self.command_line));
        settings
    }

    /// What the command line leaves of a change of `settings`: the value for the key, as a host would set it.
    pub(crate) fn left_of(
        &self,
        mut settings: Settings,
        key: &str,
        value: SettingValue,
    ) -> Result<SettingValue, SettingError> {
        settings.set(key, value.clone())?;
        apply(&mut settings, &self.command_line);
        Ok(settings.get(key).unwrap_or(value))
    }

    /// Every key with the value that counts, in the order in which to set them.
    pub(crate) fn resolved(&self) -> Vec<(String, SettingValue)> {
        let defaults = Settings::descriptors().into_iter().map(|entry| (entry.key.to_owned(), entry.default));
        let above = self.environment.iter().chain(&self.explicit).chain(&self.command_line);
        defaults.chain(above.cloned()).collect()
    }

    /// Notes an explicit value; the caller has checked it.
    pub(crate) fn set(&mut self, key: &str, value: SettingValue) {
        self.explicit.retain(|(have, _)| have != key);
        self.explicit.push((key.to_owned(), value));
    }

    /// Takes an explicit value back. True if there was one.
    pub(crate) fn clear(&mut self, key: &str) -> bool {
        let before = self.explicit.len();
        self.explicit.retain(|(have, _)| have != key);
        before != self.explicit.len()
    }

    /// What hosts list, which is what users need; the default shown is the environment's value where there is one.
    pub(crate) fn descriptors(&self) -> Vec<SettingDescriptor> {
        let mut settings = Settings::default();
        apply(&mut settings, &self.environment);
        Settings::descriptors()
            .into_iter()
            .filter(|descriptor| descriptor.audience == SettingAudience::User)
            .map(|descriptor| SettingDescriptor {
                key: descriptor.key.to_owned(),
                name: descriptor.name.to_owned(),
                default_value: scalar(&settings.get(descriptor.key).unwrap_or(descriptor.default)),
            })
            .collect()
    }
}

fn apply<'a>(settings: &mut Settings, values: impl IntoIterator<Item = &'a (String, SettingValue)>) {
    for (key, value) in values {
        if let Err(error) = settings.set(key, value.clone()) {
            tracing::warn!(key, %error, "a setting that was accepted before is refused now");
        }
    }
}

/// Whether OocPT has a setting of that name.
pub(crate) fn is_known(key: &str) -> bool {
    Settings::env_name(key).is_some()
}

/// A value as it comes over the boundary; `None` for a tag that this version does not know.
pub(crate) fn value(scalar: &ScalarValue) -> Option<SettingValue> {
    Some(match scalar.tag {
        ScalarTag::Bool => SettingValue::Bool(scalar.flag),
        ScalarTag::Int => SettingValue::Int(scalar.integer),
        ScalarTag::Float => SettingValue::Float(scalar.real),
        ScalarTag::Text => SettingValue::Text(scalar.text.clone()),
        _ => return None,
    })
}

/// A value as it goes over the boundary.
pub(crate) fn scalar(value: &SettingValue) -> ScalarValue {
    let empty = ScalarValue { tag: ScalarTag::Bool, flag: false, integer: 0, real: 0.0, text: String::new() };
    match value {
        SettingValue::Bool(flag) => ScalarValue { flag: *flag, ..empty },
        SettingValue::Int(integer) => ScalarValue { tag: ScalarTag::Int, integer: *integer, ..empty },
        SettingValue::Float(real) => ScalarValue { tag: ScalarTag::Float, real: *real, ..empty },
        SettingValue::Text(text) => ScalarValue { tag: ScalarTag::Text, text: text.clone(), ..empty },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLES: &str = "oocpt:samplesPerPixel";

    fn with_variable(name: &'static str, text: &'static str) -> (SettingLayers, Vec<String>) {
        SettingLayers::new(|wanted| (wanted == name).then(|| text.to_owned()))
    }

    #[test]
    fn the_environment_beats_the_default_and_the_host_beats_both() {
        let (mut layers, complaints) = with_variable("OOCPT_SAMPLES_PER_PIXEL", " 7 ");
        assert!(complaints.is_empty(), "{complaints:?}");
        assert_ne!(Settings::default().samples_per_pixel, 7, "the test needs another default");
        assert_eq!(layers.settings().samples_per_pixel, 7, "environment over default");
        layers.set(SAMPLES, SettingValue::Int(9));
        assert_eq!(layers.settings().samples_per_pixel, 9, "host over environment");
        assert!(layers.clear(SAMPLES), "there was an explicit value");
        assert_eq!(layers.settings().samples_per_pixel, 7, "the environment's value comes back");
        assert!(!layers.clear(SAMPLES), "there is none any more");
    }

    #[test]
    fn the_command_line_beats_the_host_by_any_key() {
        let (mut layers, _) = with_variable("OOCPT_SAMPLES_PER_PIXEL", "7");
        layers.command_line.push((SAMPLES.to_owned(), SettingValue::Int(11)));
        let now = layers.settings();
        assert_eq!(now.samples_per_pixel, 11, "over the environment");
        for key in [SAMPLES, "convergedSamplesPerPixel"] {
            let left = layers.left_of(now.clone(), key, SettingValue::Int(9)).expect("in range");
            assert_eq!(left, SettingValue::Int(11), "{key} stays");
            layers.set(key, SettingValue::Int(9));
            assert_eq!(layers.settings().samples_per_pixel, 11, "{key}: over the host");
        }
        let left = layers.left_of(now, "oocpt:seed", SettingValue::Int(9)).expect("in range");
        assert_eq!(left, SettingValue::Int(9), "what the command line does not say");
        assert_eq!(layers.resolved().last(), Some(&(SAMPLES.to_owned(), SettingValue::Int(11))), "it is set last");
    }

    #[test]
    fn wrong_settings_of_the_command_line_are_refused_with_the_nearest_name() {
        let refused = |name: &str, text: &str| set_on_command_line(name, text).expect_err("refused").to_string();
        assert!(refused("oocpt:samplePerPixels", "4").ends_with("did you mean oocpt:samplesPerPixel?"));
        assert!(refused("maxbounce", "4").ends_with("did you mean oocpt:maxBounces?"));
        assert!(refused("maxBounces", "many").contains("expected an integer"));
        assert!(refused("maxBounces", "1e9").contains("outside 0 to 1024"));
        assert!(COMMAND_LINE.lock().expect("no test panics").is_empty(), "nothing is set");
    }

    #[test]
    fn the_later_of_two_aliased_keys_wins() {
        let (mut layers, _) = SettingLayers::new(|_| None);
        layers.set("convergedSamplesPerPixel", SettingValue::Int(3));
        layers.set(SAMPLES, SettingValue::Int(4));
        assert_eq!(layers.settings().samples_per_pixel, 4, "the later key");
        layers.set("convergedSamplesPerPixel", SettingValue::Int(5));
        assert_eq!(layers.settings().samples_per_pixel, 5, "setting a key again makes it the later one");
    }

    #[test]
    fn an_unreadable_variable_is_named_and_skipped() {
        let (layers, complaints) = with_variable("OOCPT_SAMPLES_PER_PIXEL", "many");
        assert_eq!(layers.settings(), Settings::default(), "nothing may change");
        let named = |lines: &[String]| lines.len() == 1 && lines[0].starts_with("OOCPT_SAMPLES_PER_PIXEL=");
        assert!(named(&complaints), "{complaints:?}");
        let (layers, complaints) = with_variable("OOCPT_SAMPLES_PER_PIXEL", "-4");
        assert_eq!(layers.settings(), Settings::default(), "a value out of range may not change anything");
        assert!(named(&complaints), "{complaints:?}");
    }

    #[test]
    fn hosts_see_the_environment_as_the_default() {
        let (layers, _) = with_variable("OOCPT_SAMPLES_PER_PIXEL", "7");
        let list = layers.descriptors();
        let samples = list.iter().find(|entry| entry.key == SAMPLES).expect("the setting is listed");
        assert_eq!(samples.default_value.integer, 7, "the variable's value");
        let twin = list.iter().find(|entry| entry.key == "convergedSamplesPerPixel").expect("the setting is listed");
        assert_eq!(twin.default_value.integer, 7, "another key for the same thing must not bring the default back");
    }

    #[test]
    fn developer_settings_are_unlisted_but_can_be_set() {
        let (mut layers, complaints) = with_variable("OOCPT_POLICY", "sweep");
        assert!(complaints.is_empty(), "{complaints:?}");
        assert_eq!(layers.settings().policy.name(), "sweep", "by environment");
        layers.set("oocpt:policy", SettingValue::Text("priority".into()));
        assert_eq!(layers.settings().policy.name(), "priority", "by the host");
        let listed: Vec<String> = layers.descriptors().into_iter().map(|entry| entry.key).collect();
        let of = |audience| {
            let all = Settings::descriptors().into_iter();
            all.filter(move |entry| entry.audience == audience).map(|entry| entry.key).collect::<Vec<_>>()
        };
        assert_eq!(listed, of(SettingAudience::User), "what is listed");
        for key in of(SettingAudience::Developer) {
            assert!(is_known(key) && layers.resolved().iter().any(|(have, _)| have == key), "{key} still works");
        }
    }

    #[test]
    fn every_setting_type_round_trips_through_the_bridge() {
        for original in [
            SettingValue::Bool(true),
            SettingValue::Int(-3),
            SettingValue::Float(0.25),
            SettingValue::Text("llvmpipe".into()),
        ] {
            assert_eq!(value(&scalar(&original)), Some(original.clone()), "{original:?}");
        }
    }
}
