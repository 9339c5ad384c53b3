// SPDX-License-Identifier: Apache-2.0
//! The settings of a render: names, defaults and ranges. This crate reads no environment; [`Settings::env_name`] gives
//! the variable that the caller reads.

mod denoise;
mod error;
mod host_mapped;
mod sample_span;
mod table;
mod traversal;

use crate::pixel_filter::PixelFilterKind;
use crate::residency::PolicyKind;
pub use denoise::DenoiseMode;
pub use error::SettingError;
pub use host_mapped::HostMapped;
pub use sample_span::SampleSpan;
pub use table::{FilmEffect, SettingAudience, SettingScope, Settings};
use table::{SettingField, TABLE, unknown};
pub use traversal::TraversalKind;

use std::collections::BTreeMap;

/// A setting's value as hosts give it.
#[derive(Clone, Debug, PartialEq)]
pub enum SettingValue {
    /// A bool; the integers 0 and 1 are accepted too.
    Bool(bool),
    /// Also accepted where a float is wanted.
    Int(i64),
    /// Accepted for integers when it is whole.
    Float(f64),
    /// Parsed where another type is wanted (environment variables).
    Text(String),
}

/// Description of a setting, as hosts list it.
#[derive(Clone, Debug, PartialEq)]
pub struct SettingInfo {
    /// Hydra key.
    pub key: &'static str,
    /// Label for user interfaces.
    pub name: &'static str,
    /// Default value.
    pub default: SettingValue,
    /// Help text of one line.
    pub doc: &'static str,
    /// Audience; hosts list only settings for users.
    pub audience: SettingAudience,
    /// Hosts that may set it.
    pub scope: SettingScope,
}

impl Settings {
    /// Sets one value by its Hydra key. Returns true if it changed.
    ///
    /// # Errors
    /// See [`SettingError`]; the setting keeps its value.
    pub fn set(&mut self, key: &str, value: SettingValue) -> Result<bool, SettingError> {
        let before = self.clone();
        let wrong = |expected| SettingError::Type { key: key.to_owned(), expected, value: value.clone() };
        let check = |value: f64, min: f64, max: f64| {
            // NaN fails this as well.
            if value >= min && value <= max {
                Ok(value)
            } else {
                Err(SettingError::Range { key: key.to_owned(), value, min, max })
            }
        };
        match self.field(key)? {
            SettingField::Bool(field) => *field = value.as_bool().ok_or_else(|| wrong("a bool"))?,
            SettingField::Int(field, min, max) => {
                let number = value.as_integer().ok_or_else(|| wrong("an integer"))?;
                *field = whole(check(number, f64::from(min), f64::from(max))?);
            }
            SettingField::Float(field, min, max) => {
                let number = value.as_float().ok_or_else(|| wrong("a number"))?;
                *field = narrow(check(number, f64::from(min), f64::from(max))?);
            }
            SettingField::Text(field) => *field = value.as_text().ok_or_else(|| wrong("text"))?,
            SettingField::Policy(field) => *field = policy_named(key, &value.as_text().ok_or_else(|| wrong("text"))?)?,
            SettingField::Traversal(field) => {
                *field =
                    choice(key, &value, TraversalKind::named, || TraversalKind::ALL.map(TraversalKind::name).to_vec())?;
            }
            SettingField::Denoise(field) => {
                *field = choice(key, &value, DenoiseMode::named, || DenoiseMode::ALL.map(DenoiseMode::name).to_vec())?;
            }
            SettingField::HostMapped(field) => {
                *field = choice(key, &value, HostMapped::named, || HostMapped::ALL.map(HostMapped::name).to_vec())?;
            }
            SettingField::Span(field) => {
                *field = choice(key, &value, SampleSpan::named, || vec!["A..B, with A below B and B at most 2^24"])?;
            }
            SettingField::PixelFilter(field) => {
                let allowed = || PixelFilterKind::ALL.map(PixelFilterKind::name).to_vec();
                *field = choice(key, &value, PixelFilterKind::named, allowed)?;
            }
        }
        Ok(*self != before)
    }

    /// The value of `key` as hosts give it; `None` for an unknown key.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<SettingValue> {
        let mut copy = self.clone();
        Some(match copy.field(key).ok()? {
            SettingField::Bool(v) => SettingValue::Bool(*v),
            SettingField::Int(v, ..) => SettingValue::Int(i64::from(*v)),
            SettingField::Float(v, ..) => SettingValue::Float(f64::from(*v)),
            SettingField::Text(v) => SettingValue::Text(v.clone()),
            SettingField::Policy(v) => SettingValue::Text(v.name().to_owned()),
            SettingField::Traversal(v) => SettingValue::Text(v.name().to_owned()),
            SettingField::Denoise(v) => SettingValue::Text(v.name().to_owned()),
            SettingField::HostMapped(v) => SettingValue::Text(v.name().to_owned()),
            SettingField::Span(v) => SettingValue::Text(v.to_string()),
            SettingField::PixelFilter(v) => SettingValue::Text(v.name().to_owned()),
        })
    }

    /// All settings with their defaults, in the order in which hosts show those for users.
    #[must_use]
    pub fn descriptors() -> Vec<SettingInfo> {
        let defaults = Self::default();
        TABLE
            .iter()
            .filter_map(|row| {
                let (key, name, doc) = (row.key, row.name, row.help);
                let (audience, scope) = (row.audience, row.scope);
                Some(SettingInfo { key, name, default: defaults.get(key)?, doc, audience, scope })
            })
            .collect()
    }

    /// The key of the setting that a user means by `name`: the key itself, or the key without `oocpt:`.
    ///
    /// # Errors
    /// [`SettingError::Unknown`] with the nearest key.
    pub fn key_named(name: &str) -> Result<&'static str, SettingError> {
        let bare = |key: &'static str| key.strip_prefix("oocpt:").unwrap_or(key);
        if let Some(row) = TABLE.iter().find(|row| row.key == name || bare(row.key) == name) {
            return Ok(row.key);
        }
        Err(unknown(name))
    }

    /// The scope of the setting `key`; `None` for an unknown key.
    #[must_use]
    pub fn scope(key: &str) -> Option<SettingScope> {
        TABLE.iter().find(|row| row.key == key).map(|row| row.scope)
    }

    /// What another value of the setting `key` does to the samples that are there; `None` for an unknown key.
    #[must_use]
    pub fn film_effect(key: &str) -> Option<FilmEffect> {
        TABLE.iter().find(|row| row.key == key).map(|row| row.film)
    }

    /// Returns true if samples taken with `other` are samples of a picture with these settings, as far as there are no
    /// more than it is to have.
    #[must_use]
    pub fn goes_on_from(&self, other: &Self) -> bool {
        let is_same = |row: &table::Row| self.get(row.key) == other.get(row.key);
        TABLE.iter().filter(|row| row.film != FilmEffect::GoesOn).all(is_same)
    }

    /// These settings with as many samples as a picture has that ends where the span of samples does.
    #[must_use]
    pub fn with_span(self) -> Self {
        let samples_per_pixel = if self.span.is_empty() { self.samples_per_pixel } else { self.span.end };
        Self { samples_per_pixel, ..self }
    }

    /// The settings that samples depend on, by key, as a user would type them. Pictures of a scene that differ in none
    /// of these have the same samples, as far as there are as many.
    #[must_use]
    pub fn of_samples(&self) -> BTreeMap<String, String> {
        let rows = TABLE.iter().filter(|row| row.film == FilmEffect::BeginsAgain);
        rows.filter_map(|row| Some((row.key.to_owned(), self.get(row.key)?.to_string()))).collect()
    }

    /// The environment variable that sets `key`, e.g. `OOCPT_SAMPLES_PER_PIXEL`; `None` for an unknown key.
    #[must_use]
    pub fn env_name(key: &str) -> Option<&'static str> {
        TABLE.iter().find(|row| row.key == key).map(|row| row.variable)
    }
}

impl std::fmt::Display for SettingValue {
    /// Writes the value as a user would type it.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Bool(value) => write!(f, "{value}"),
            Self::Int(value) => write!(f, "{value}"),
            Self::Float(value) => write!(f, "{value}"),
            Self::Text(value) => write!(f, "{value:?}"),
        }
    }
}

impl SettingValue {
    fn as_bool(&self) -> Option<bool> {
        match self {
            Self::Bool(b) => Some(*b),
            Self::Int(0) => Some(false),
            Self::Int(1) => Some(true),
            Self::Text(text) => match text.trim().to_ascii_lowercase().as_str() {
                "1" | "true" | "on" | "yes" => Some(true),
                "0" | "false" | "off" | "no" => Some(false),
                _ => None,
            },
            Self::Int(_) | Self::Float(_) => None,
        }
    }

    /// A whole number; every value that passes the bounds afterwards is exact.
    fn as_integer(&self) -> Option<f64> {
        let number = match self {
            Self::Bool(_) => None,
            #[expect(clippy::cast_precision_loss, reason = "all bounds are far below 2^53")]
            Self::Int(i) => Some(*i as f64),
            Self::Float(f) => Some(*f),
            Self::Text(text) => text.trim().parse().ok(),
        }?;
        (number.fract() == 0.0).then_some(number)
    }

    fn as_float(&self) -> Option<f64> {
        match self {
            Self::Bool(_) => None,
            #[expect(clippy::cast_precision_loss, reason = "the setting is a float")]
            Self::Int(i) => Some(*i as f64),
            Self::Float(f) => Some(*f),
            Self::Text(text) => text.trim().parse().ok(),
        }
    }

    fn as_text(&self) -> Option<String> {
        match self {
            Self::Text(text) => Some(text.clone()),
            // A device index.
            Self::Int(i) => Some(i.to_string()),
            Self::Bool(_) | Self::Float(_) => None,
        }
    }
}

fn policy_named(key: &str, text: &str) -> Result<PolicyKind, SettingError> {
    let allowed = || PolicyKind::ALL.map(PolicyKind::name).to_vec();
    let wrong = |_| SettingError::Choice { key: key.to_owned(), value: text.to_owned(), allowed: allowed() };
    text.trim().parse().map_err(wrong)
}

/// The one of several choices that a value names.
fn choice<T>(
    key: &str,
    value: &SettingValue,
    named: impl Fn(&str) -> Option<T>,
    allowed: impl Fn() -> Vec<&'static str>,
) -> Result<T, SettingError> {
    let wrong = || SettingError::Type { key: key.to_owned(), expected: "text", value: value.clone() };
    let text = value.as_text().ok_or_else(wrong)?;
    let unknown = || SettingError::Choice { key: key.to_owned(), value: text.clone(), allowed: allowed() };
    named(text.trim()).ok_or_else(unknown)
}

/// A whole number that was checked before, as u32.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked against bounds inside u32")]
fn whole(value: f64) -> u32 {
    value as u32
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to the setting's precision")]
fn narrow(value: f64) -> f32 {
    value as f32
}
