// SPDX-License-Identifier: Apache-2.0
//! The user's settings: defaults, bounds, names. Core reads no environment; [`Settings::env_name`] says what to read.

use serde::{Deserialize, Serialize};

/// All settings. Values are inside their bounds as long as they are changed through [`Settings::set`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// Samples per pixel to converge at, 1 to 2^24.
    pub samples_per_pixel: u32,
    /// Indirect bounces, 0 (direct light only) to 1024.
    pub max_bounces: u32,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Largest contribution of one sample, 0 = no limit.
    pub clamp: f32,
    /// Stop after this many seconds, 0 = no limit.
    pub time_limit_secs: f32,
    /// Hard limit of device memory in MiB, 0 = 90 % of what is free.
    pub memory_budget_mib: u32,
    /// Device by index or part of its name, empty = best.
    pub device: String,
    /// Show coarse images early (`enableInteractive`).
    pub interactive: bool,
    /// Dome lights are seen by camera rays.
    pub dome_light_camera_visible: bool,
    /// Use the lights of the scene.
    pub enable_scene_lights: bool,
}

/// A setting's value as hosts give it.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Also accepted as the integers 0 and 1.
    Bool(bool),
    /// Also accepted where a float is wanted.
    Int(i64),
    /// Accepted for integers when it is whole.
    Float(f64),
    /// Parsed where another type is wanted (environment variables).
    Text(String),
}

/// Why a setting was not taken; it keeps its value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingError {
    /// No setting of this name.
    #[error("unknown setting {0:?}")]
    Unknown(String),
    /// The value has the wrong type.
    #[error("setting {key}: expected {expected}, got {value:?}")]
    Type {
        /// The key as given.
        key: String,
        /// What it takes.
        expected: &'static str,
        /// What came.
        value: Value,
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

/// A setting as hosts list it.
#[derive(Clone, Debug, PartialEq)]
pub struct Descriptor {
    /// Hydra key.
    pub key: &'static str,
    /// Name for people.
    pub name: &'static str,
    /// Default value.
    pub default: Value,
    /// One line of help.
    pub doc: &'static str,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            samples_per_pixel: 64,
            max_bounces: 5,
            seed: 0,
            clamp: 0.0,
            time_limit_secs: 0.0,
            memory_budget_mib: 0,
            device: String::new(),
            interactive: true,
            dome_light_camera_visible: true,
            enable_scene_lights: true,
        }
    }
}

impl Settings {
    /// Sets one value by its Hydra key. Gives whether it changed.
    ///
    /// # Errors
    /// See [`SettingError`]; the setting keeps its value.
    pub fn set(&mut self, key: &str, value: Value) -> Result<bool, SettingError> {
        let _ = value;
        Err(SettingError::Unknown(key.to_owned()))
    }

    /// All settings for the host's user interface.
    #[must_use]
    pub fn descriptors() -> Vec<Descriptor> {
        Vec::new()
    }

    /// The environment variable that sets `key`, e.g. `OOCPT_SAMPLES_PER_PIXEL`; `None` for an unknown key.
    #[must_use]
    pub fn env_name(key: &str) -> Option<String> {
        let _ = key;
        None
    }
}
