// SPDX-License-Identifier: Apache-2.0
//! The user's settings: defaults, bounds, names. Core reads no environment; [`Settings::env_name`] says what to read.

mod error;
mod host_mapped;
mod table;
mod traversal;

use serde::{Deserialize, Serialize};

use crate::residency::PolicyKind;
pub use error::SettingError;
pub use host_mapped::HostMapped;
use table::TABLE;
pub use table::{Audience, Scope};
pub use traversal::TraversalKind;

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
    /// Who walks the rays.
    pub traversal: TraversalKind,
    /// Whether rays read geometry in host memory where the device has no room for it.
    pub host_mapped: HostMapped,
    /// Which chunks the planner loads first when not all fit.
    pub policy: PolicyKind,
    /// Size of a chunk in KiB of device memory, 16 to 1048576. Another size is another partition of the scene.
    pub chunk_size_kib: u32,
    /// Hard limit of device memory for geometry in KiB, 0 = what the memory budget leaves.
    pub geometry_budget_kib: u32,
    /// Most MiB of host memory, for what the renderer counts: arrays that the host lends, tables of instances and
    /// images first, then shares for built meshes, encoded instances and ended paths (`host_memory.rs` of the
    /// renderer); 0 = shares of what is free.
    pub host_memory_budget_mib: u32,
    /// Folder in which decoded textures are kept, "0" = none, empty = the user's own.
    pub texture_cache: String,
    /// Most MiB of decoded textures in that folder.
    pub texture_cache_mib: u32,
    /// Folder in which built geometry is kept for the next render; "0": none, and it stays in memory; empty: none, and
    /// what exceeds the host memory budget goes to a file without a name in the user's cache folder.
    pub geometry_cache: String,
    /// Limit of the geometry cache, MiB.
    pub geometry_cache_mib: u32,
    /// Folder in which compiled pipelines are kept, "0" = none, empty = the user's own.
    pub pipeline_cache: String,
    /// Longest piece of an edge of a subdivision surface, in pixels; 0 = edges are cut as the refine level says.
    pub dicing_rate: f32,
    /// File to write a report about the chunks to, empty = none.
    pub chunk_report: String,
    /// File to write all materials to, as text for people, empty = none.
    pub material_report: String,
    /// File to write a report of error against time to, empty = none.
    pub report: String,
    /// EXR file to compare with, empty = none.
    pub reference: String,
    /// Stop when the estimated relMSE is below this with the confidence of its interval, 0 = no such limit.
    pub target_error: f32,
    /// Features of the passes to carry although the scene does not need them, by name; "all", or empty = none. For
    /// measuring.
    pub carry: String,
    /// Rays that wait for a load whose cost exceeds their expected contribution may end, unbiased
    /// (`residency::roulette`).
    pub straggler_roulette: bool,
    /// Spend samples where the picture's error is largest.
    pub adaptive_sampling: bool,
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

/// A setting as it is listed.
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
    /// Hosts list only what is for users.
    pub audience: Audience,
    /// Who may set it.
    pub scope: Scope,
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
            traversal: TraversalKind::Auto,
            host_mapped: HostMapped::Auto,
            policy: PolicyKind::Benefit,
            chunk_size_kib: 8192,
            geometry_budget_kib: 0,
            host_memory_budget_mib: 0,
            texture_cache: String::new(),
            texture_cache_mib: 32 << 10,
            geometry_cache: String::new(),
            geometry_cache_mib: 32 << 10,
            pipeline_cache: String::new(),
            dicing_rate: 2.0,
            chunk_report: String::new(),
            material_report: String::new(),
            report: String::new(),
            reference: String::new(),
            target_error: 0.0,
            carry: String::new(),
            straggler_roulette: false,
            adaptive_sampling: false,
            interactive: true,
            dome_light_camera_visible: true,
            enable_scene_lights: true,
        }
    }
}

/// How a value is checked and stored.
enum Field<'a> {
    Bool(&'a mut bool),
    Int(&'a mut u32, u32, u32),
    Float(&'a mut f32, f32, f32),
    Text(&'a mut String),
    Policy(&'a mut PolicyKind),
    Traversal(&'a mut TraversalKind),
    HostMapped(&'a mut HostMapped),
}

/// Most samples per pixel: sample indices stay exact in f32.
const MAX_SAMPLES: u32 = 1 << 24;

impl Settings {
    /// Sets one value by its Hydra key. Gives whether it changed.
    ///
    /// # Errors
    /// See [`SettingError`]; the setting keeps its value.
    pub fn set(&mut self, key: &str, value: Value) -> Result<bool, SettingError> {
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
            Field::Bool(field) => *field = value.as_bool().ok_or_else(|| wrong("a bool"))?,
            Field::Int(field, min, max) => {
                let number = value.as_integer().ok_or_else(|| wrong("an integer"))?;
                *field = whole(check(number, f64::from(min), f64::from(max))?);
            }
            Field::Float(field, min, max) => {
                let number = value.as_float().ok_or_else(|| wrong("a number"))?;
                *field = narrow(check(number, f64::from(min), f64::from(max))?);
            }
            Field::Text(field) => *field = value.as_text().ok_or_else(|| wrong("text"))?,
            Field::Policy(field) => *field = policy_named(key, &value.as_text().ok_or_else(|| wrong("text"))?)?,
            Field::Traversal(field) => {
                *field =
                    choice(key, &value, TraversalKind::named, || TraversalKind::ALL.map(TraversalKind::name).to_vec())?;
            }
            Field::HostMapped(field) => {
                *field = choice(key, &value, HostMapped::named, || HostMapped::ALL.map(HostMapped::name).to_vec())?;
            }
        }
        Ok(*self != before)
    }

    fn field(&mut self, key: &str) -> Result<Field<'_>, SettingError> {
        Ok(match key {
            "oocpt:samplesPerPixel" | "convergedSamplesPerPixel" => {
                Field::Int(&mut self.samples_per_pixel, 1, MAX_SAMPLES)
            }
            "oocpt:maxBounces" => Field::Int(&mut self.max_bounces, 0, 1024),
            "oocpt:seed" => Field::Int(&mut self.seed, 0, u32::MAX),
            "oocpt:clamp" => Field::Float(&mut self.clamp, 0.0, 1e30),
            "oocpt:timeLimit" => Field::Float(&mut self.time_limit_secs, 0.0, 1e9),
            "oocpt:memoryBudget" => Field::Int(&mut self.memory_budget_mib, 0, 1 << 24),
            "oocpt:device" => Field::Text(&mut self.device),
            "oocpt:traversal" => Field::Traversal(&mut self.traversal),
            "oocpt:hostMappedGeometry" => Field::HostMapped(&mut self.host_mapped),
            "oocpt:policy" => Field::Policy(&mut self.policy),
            "oocpt:chunkSize" => Field::Int(&mut self.chunk_size_kib, 16, 1 << 20),
            "oocpt:geometryBudget" => Field::Int(&mut self.geometry_budget_kib, 0, u32::MAX),
            "oocpt:hostMemoryBudget" => Field::Int(&mut self.host_memory_budget_mib, 0, 1 << 24),
            "oocpt:textureCache" => Field::Text(&mut self.texture_cache),
            "oocpt:textureCacheSize" => Field::Int(&mut self.texture_cache_mib, 1, u32::MAX),
            "oocpt:geometryCache" => Field::Text(&mut self.geometry_cache),
            "oocpt:geometryCacheSize" => Field::Int(&mut self.geometry_cache_mib, 1, u32::MAX),
            "oocpt:pipelineCache" => Field::Text(&mut self.pipeline_cache),
            "oocpt:dicingRate" => Field::Float(&mut self.dicing_rate, 0.0, 1e6),
            "oocpt:chunkReport" => Field::Text(&mut self.chunk_report),
            "oocpt:materialReport" => Field::Text(&mut self.material_report),
            "oocpt:report" => Field::Text(&mut self.report),
            "oocpt:reference" => Field::Text(&mut self.reference),
            "oocpt:targetError" => Field::Float(&mut self.target_error, 0.0, 1e9),
            "oocpt:carry" => Field::Text(&mut self.carry),
            "oocpt:stragglerRoulette" => Field::Bool(&mut self.straggler_roulette),
            "oocpt:adaptiveSampling" => Field::Bool(&mut self.adaptive_sampling),
            "enableInteractive" => Field::Bool(&mut self.interactive),
            "domeLightCameraVisibility" => Field::Bool(&mut self.dome_light_camera_visible),
            "enableSceneLights" => Field::Bool(&mut self.enable_scene_lights),
            _ => return Err(SettingError::Unknown(key.to_owned())),
        })
    }

    /// The value of `key` as hosts give it; `None` for an unknown key.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<Value> {
        let mut copy = self.clone();
        Some(match copy.field(key).ok()? {
            Field::Bool(v) => Value::Bool(*v),
            Field::Int(v, ..) => Value::Int(i64::from(*v)),
            Field::Float(v, ..) => Value::Float(f64::from(*v)),
            Field::Text(v) => Value::Text(v.clone()),
            Field::Policy(v) => Value::Text(v.name().to_owned()),
            Field::Traversal(v) => Value::Text(v.name().to_owned()),
            Field::HostMapped(v) => Value::Text(v.name().to_owned()),
        })
    }

    /// All settings with their defaults, in the order in which hosts show those that are for users.
    #[must_use]
    pub fn descriptors() -> Vec<Descriptor> {
        let defaults = Self::default();
        TABLE
            .iter()
            .filter_map(|row| {
                let (key, name, doc) = (row.key, row.name, row.help);
                let (audience, scope) = (row.audience, row.scope);
                Some(Descriptor { key, name, default: defaults.get(key)?, doc, audience, scope })
            })
            .collect()
    }

    /// The key of the setting that a person means by `name`: the key itself, or without `oocpt:` in front.
    ///
    /// # Errors
    /// [`SettingError::Misspelt`] with the nearest key.
    pub fn key_named(name: &str) -> Result<&'static str, SettingError> {
        let bare = |key: &'static str| key.strip_prefix("oocpt:").unwrap_or(key);
        if let Some(row) = TABLE.iter().find(|row| row.key == name || bare(row.key) == name) {
            return Ok(row.key);
        }
        let wanted = name.strip_prefix("oocpt:").unwrap_or(name).to_lowercase();
        let distance = |row: &&table::Row| strsim::damerau_levenshtein(&bare(row.key).to_lowercase(), &wanted);
        let nearest = TABLE.iter().min_by_key(distance).map_or("", |row| row.key);
        Err(SettingError::Misspelt { name: name.to_owned(), nearest })
    }

    /// What `key` is about; `None` for an unknown key.
    #[must_use]
    pub fn scope(key: &str) -> Option<Scope> {
        TABLE.iter().find(|row| row.key == key).map(|row| row.scope)
    }

    /// The environment variable that sets `key`, e.g. `OOCPT_SAMPLES_PER_PIXEL`; `None` for an unknown key.
    #[must_use]
    pub fn env_name(key: &str) -> Option<&'static str> {
        TABLE.iter().find(|row| row.key == key).map(|row| row.variable)
    }
}

impl std::fmt::Display for Value {
    /// As a person would write it.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Bool(value) => write!(f, "{value}"),
            Self::Int(value) => write!(f, "{value}"),
            Self::Float(value) => write!(f, "{value}"),
            Self::Text(value) => write!(f, "{value:?}"),
        }
    }
}

impl Value {
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

/// The one of several that a value names.
fn choice<T>(
    key: &str,
    value: &Value,
    named: impl Fn(&str) -> Option<T>,
    allowed: impl Fn() -> Vec<&'static str>,
) -> Result<T, SettingError> {
    let wrong = || SettingError::Type { key: key.to_owned(), expected: "text", value: value.clone() };
    let text = value.as_text().ok_or_else(wrong)?;
    let unknown = || SettingError::Choice { key: key.to_owned(), value: text.clone(), allowed: allowed() };
    named(text.trim()).ok_or_else(unknown)
}

/// A checked whole number as u32.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked against bounds inside u32")]
fn whole(value: f64) -> u32 {
    value as u32
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to the setting's precision")]
fn narrow(value: f64) -> f32 {
    value as f32
}
