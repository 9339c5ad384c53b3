// SPDX-License-Identifier: Apache-2.0
//! Errors about settings.

use super::SettingValue;

/// Reason why a setting was not taken; it keeps its value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingError {
    /// There is no setting of this name.
    #[error("there is no setting {name}; did you mean {nearest}?")]
    Unknown {
        /// The name as given.
        name: String,
        /// Key of the setting with the nearest name.
        nearest: &'static str,
    },
    /// The value has the wrong type.
    #[error("setting {key}: expected {expected}, got {value}")]
    Type {
        /// The key as given.
        key: String,
        /// The type that it takes.
        expected: &'static str,
        /// The value as given.
        value: SettingValue,
    },
    /// The text is not one of those that the setting knows.
    #[error("setting {key}: {value:?} is none of {}", .allowed.join(", "))]
    Choice {
        /// The key as given.
        key: String,
        /// The text as given.
        value: String,
        /// The texts that it takes.
        allowed: Vec<&'static str>,
    },
    /// The value is out of bounds.
    #[error("setting {key}: {value} is outside {min} to {max}")]
    Range {
        /// The key as given.
        key: String,
        /// The value as given.
        value: f64,
        /// Smallest accepted value.
        min: f64,
        /// Largest accepted value.
        max: f64,
    },
}
