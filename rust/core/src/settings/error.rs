// SPDX-License-Identifier: Apache-2.0
//! Why a setting is not taken.

use super::SettingValue;

/// Why a setting was not taken; it keeps its value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingError {
    /// No setting of this name.
    #[error("unknown setting {0:?}")]
    Unknown(String),
    /// No setting of this name, and the one whose name is nearest.
    #[error("there is no setting {name}; did you mean {nearest}?")]
    Misspelt {
        /// The name as given.
        name: String,
        /// A key.
        nearest: &'static str,
    },
    /// The value has the wrong type.
    #[error("setting {key}: expected {expected}, got {value}")]
    Type {
        /// The key as given.
        key: String,
        /// What it takes.
        expected: &'static str,
        /// What came.
        value: SettingValue,
    },
    /// The text is not one of those that the setting knows.
    #[error("setting {key}: {value:?} is none of {}", .allowed.join(", "))]
    Choice {
        /// The key as given.
        key: String,
        /// What came.
        value: String,
        /// What it takes.
        allowed: Vec<&'static str>,
    },
    /// The value is out of bounds.
    #[error("setting {key}: {value} is outside {min} to {max}")]
    Range {
        /// The key as given.
        key: String,
        /// What came.
        value: f64,
        /// Smallest accepted value.
        min: f64,
        /// Largest accepted value.
        max: f64,
    },
}
