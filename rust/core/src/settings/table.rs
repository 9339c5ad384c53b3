// SPDX-License-Identifier: Apache-2.0
//! The table of settings, one row each: its field, type, default and range, its names, its audience, and who may set
//! it.

use serde::{Deserialize, Serialize};

use super::sample_span::MAX_SAMPLES;
use super::{DenoiseMode, HostMapped, SampleSpan, SettingError, TraversalKind};
use crate::pixel_filter::{PixelFilter, PixelFilterKind};
use crate::residency::PolicyKind;

/// The users to whom a setting is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SettingAudience {
    /// Users who render: hosts list it.
    User,
    /// Developers of the renderer: hosts do not list it.
    Developer,
}

/// The subject of a setting, which decides who may set it. Scenes come from strangers, so they may not set what a
/// machine has and keeps. The environment and the host's own settings may set all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SettingScope {
    /// The content of the picture: a scene may set it.
    Scene,
    /// The way in which an application shows it: a scene may set it.
    Host,
    /// The machine's device, memory, files and folders: a scene may not set it.
    Machine,
}

impl SettingScope {
    /// Name in the book.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scene => "scene",
            Self::Host => "host",
            Self::Machine => "machine",
        }
    }
}

/// What becomes of the samples of a picture when a setting changes while nothing else does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmEffect {
    /// They are samples of the new picture too, which goes on with them.
    GoesOn,
    /// The picture begins again, with the same samples: another process may go on with them.
    SameSamples,
    /// The picture begins again, with other samples.
    BeginsAgain,
}

/// The names of a setting.
pub(super) struct Row {
    /// Hydra's key. Several keys may share a field.
    pub(super) key: &'static str,
    /// Environment variable.
    pub(super) variable: &'static str,
    /// Label for user interfaces.
    pub(super) name: &'static str,
    /// Help text of one line.
    pub(super) help: &'static str,
    /// Users to whom it is shown.
    pub(super) audience: SettingAudience,
    /// Hosts that may set it.
    pub(super) scope: SettingScope,
    /// What another value does to the samples that are there.
    pub(super) film: FilmEffect,
}

/// The place of a value, with its check.
pub(super) enum SettingField<'a> {
    Bool(&'a mut bool),
    Int(&'a mut u32, u32, u32),
    Float(&'a mut f32, f32, f32),
    Text(&'a mut String),
    Policy(&'a mut PolicyKind),
    Traversal(&'a mut TraversalKind),
    Denoise(&'a mut DenoiseMode),
    HostMapped(&'a mut HostMapped),
    PixelFilter(&'a mut PixelFilterKind),
    Span(&'a mut SampleSpan),
}

/// Most characters of an unknown name that are compared with those of settings.
const LONGEST_NAME: usize = 64;

/// Largest number of bounces, of any kind and of all together.
const MAX_BOUNCES: u32 = 1024;

/// The error about a name that no setting has: it says the key that is nearest to it.
pub(super) fn unknown(name: &str) -> SettingError {
    let bare = |key: &str| key.strip_prefix("oocpt:").unwrap_or(key).to_lowercase();
    // Names come from strangers, and the distance takes time by their length.
    let wanted: String = bare(name).chars().take(LONGEST_NAME).collect();
    let distance = |row: &&Row| strsim::damerau_levenshtein(&bare(row.key), &wanted);
    let nearest = TABLE.iter().min_by_key(distance).map_or("", |row| row.key);
    SettingError::Unknown { name: name.to_owned(), nearest }
}

/// Declares the settings. A row is the only declaration of a setting: its check, its field, type, default and the parts
/// that its help leaves out (a second key of a field has none), its audience, who may set it, what becomes of the
/// picture's samples when it changes, Hydra's key, the environment variable, a label for users, one line of help.
macro_rules! settings {
    ($(
        $kind:ident($field:ident $(, $bound:expr)*)$(: $type:ty = $default:expr $(, $more:literal)?)?;
        $audience:ident $scope:ident $film:ident $key:literal $variable:literal $name:literal
        $help:literal;
    )+) => {
        /// All settings. Values stay inside their bounds if they are changed through [`Settings::set`] only.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(default)]
        pub struct Settings {
            $($(
                #[doc = concat!($help, "." $(, " ", $more)?)]
                pub $field: $type,
            )?)+
        }

        impl Default for Settings {
            fn default() -> Self {
                Self { $($($field: $default,)?)+ }
            }
        }

        impl Settings {
            /// The place of the value of a key, with its check.
            pub(super) fn field(&mut self, key: &str) -> Result<SettingField<'_>, SettingError> {
                Ok(match key {
                    $($key => SettingField::$kind(&mut self.$field $(, $bound)*),)+
                    _ => return Err(unknown(key)),
                })
            }
        }

        /// The rows of all settings, in the order in which hosts show them.
        pub(super) const TABLE: &[Row] = &[$(Row {
            key: $key,
            variable: $variable,
            name: $name,
            help: $help,
            audience: SettingAudience::$audience,
            scope: SettingScope::$scope,
            film: FilmEffect::$film,
        },)+];
    };
}

settings! {
    Int(samples_per_pixel, 1, MAX_SAMPLES): u32 = 64;
        User Scene GoesOn "oocpt:samplesPerPixel" "OOCPT_SAMPLES_PER_PIXEL" "Samples per pixel"
        "Samples per pixel to converge at";
    Int(max_bounces, 0, MAX_BOUNCES): u32 = 5;
        User Scene BeginsAgain "oocpt:maxBounces" "OOCPT_MAX_BOUNCES" "Max bounces"
        "Indirect bounces; 0 = direct light only";
    Int(seed, 0, u32::MAX): u32 = 0;
        User Scene BeginsAgain "oocpt:seed" "OOCPT_SEED" "Seed"
        "Seed of all random numbers";
    Float(clamp, 0.0, 1e30): f32 = 0.0;
        User Scene BeginsAgain "oocpt:clamp" "OOCPT_CLAMP" "Clamp"
        "Largest indirect contribution of a sample; 0 = no limit";
    Float(time_limit_secs, 0.0, 1e9): f32 = 0.0;
        User Scene GoesOn "oocpt:timeLimit" "OOCPT_TIME_LIMIT" "Time limit"
        "Stop after this many seconds; 0 = no limit";
    Int(memory_budget_mib, 0, 1 << 24): u32 = 0;
        User Machine SameSamples "oocpt:memoryBudget" "OOCPT_MEMORY_BUDGET" "Memory budget"
        "Hard limit of device memory in MiB; 0 = automatic";
    Text(device): String = String::new();
        User Machine SameSamples "oocpt:device" "OOCPT_DEVICE" "Device"
        "Device by index or part of its name; empty = best";
    Text(devices): String = String::new();
        User Machine SameSamples "oocpt:devices" "OOCPT_DEVICES" "Devices"
        "Devices that render a picture together: all, or indices and parts of names between commas; empty = one";
    Traversal(traversal): TraversalKind = TraversalKind::Auto;
        Developer Machine SameSamples "oocpt:traversal" "OOCPT_TRAVERSAL" "Traversal"
        "Who walks the rays: auto, compute (the device) or native (the host, where the device is a processor)";
    HostMapped(host_mapped): HostMapped = HostMapped::Auto;
        Developer Machine SameSamples "oocpt:hostMappedGeometry" "OOCPT_HOST_MAPPED_GEOMETRY" "Host-mapped geometry"
        "Whether rays read geometry in host memory where the device has no room: auto, on or off";
    Policy(policy): PolicyKind = PolicyKind::Benefit;
        Developer Machine SameSamples "oocpt:policy" "OOCPT_POLICY" "Policy"
        "Which chunks to load first: sweep, priority or benefit";
    Int(chunk_size_kib, 16, 1 << 20): u32 = 8192, "Another size is another partition of the scene.";
        User Machine BeginsAgain "oocpt:chunkSize" "OOCPT_CHUNK_SIZE" "Chunk size"
        "Device memory of a chunk of the scene in KiB";
    Int(geometry_budget_kib, 0, u32::MAX): u32 = 0;
        User Machine SameSamples "oocpt:geometryBudget" "OOCPT_GEOMETRY_BUDGET" "Geometry budget"
        "Hard limit of device memory for geometry and textures in KiB; 0 = what the memory budget leaves";
    Int(host_memory_budget_mib, 0, 1 << 24): u32 = 0,
        "Arrays that the host lends, tables of instances and images come first, then shares for built meshes, \
         encoded instances and ended paths (`host_memory.rs` of the renderer).";
        User Machine SameSamples "oocpt:hostMemoryBudget" "OOCPT_HOST_MEMORY_BUDGET" "Host memory budget"
        "Most MiB of host memory for all that the renderer counts; 0 = shares of what is free";
    Float(dicing_rate, 0.0, 1e6): f32 = 2.0;
        User Scene BeginsAgain "oocpt:dicingRate" "OOCPT_DICING_RATE" "Dicing rate"
        "Longest edge of subdivision surfaces in pixels; 0 = as the complexity says";
    Text(chunk_report): String = String::new();
        Developer Machine SameSamples "oocpt:chunkReport" "OOCPT_CHUNK_REPORT" "Chunk report"
        "File for a report about the chunks; empty = none";
    Text(material_report): String = String::new();
        Developer Machine GoesOn "oocpt:materialReport" "OOCPT_MATERIAL_REPORT" "Material report"
        "File for the networks, inputs and programs of all materials; empty = none";
    Text(report): String = String::new();
        User Machine GoesOn "oocpt:report" "OOCPT_REPORT" "Report"
        "File for a report of error against time, a JSON object a line; empty = none";
    Text(reference): String = String::new();
        Developer Machine GoesOn "oocpt:reference" "OOCPT_REFERENCE" "Reference"
        "EXR picture for the report to compare with; empty = none";
    Float(target_error, 0.0, 1e9): f32 = 0.0;
        User Scene GoesOn "oocpt:targetError" "OOCPT_TARGET_ERROR" "Target error"
        "Stop when the relative mean squared error is below this, by the upper end of its interval; 0 = no limit";
    Bool(straggler_roulette): bool = false, "See `residency::roulette`.";
        User Scene BeginsAgain "oocpt:stragglerRoulette" "OOCPT_STRAGGLER_ROULETTE" "Straggler roulette"
        "Russian roulette on rays that wait for expensive loads: unbiased, but other bits at each budget and run";
    Bool(adaptive_sampling): bool = false;
        User Scene BeginsAgain "oocpt:adaptiveSampling" "OOCPT_ADAPTIVE_SAMPLING" "Adaptive sampling"
        "Spend samples where the error is largest; as many in all, and no bias";
    Text(texture_cache): String = String::new();
        User Machine SameSamples "oocpt:textureCache" "OOCPT_TEXTURE_CACHE" "Texture cache"
        "Folder in which decoded textures are kept; 0 = none; empty = oocpt/textures in the user's cache folder";
    Int(texture_cache_mib, 1, u32::MAX): u32 = 32 << 10;
        User Machine SameSamples "oocpt:textureCacheSize" "OOCPT_TEXTURE_CACHE_SIZE" "Texture cache size"
        "Most MiB of decoded textures on disk; those not used for longest are removed";
    Text(geometry_cache): String = String::new();
        User Machine SameSamples "oocpt:geometryCache" "OOCPT_GEOMETRY_CACHE" "Geometry cache"
        "Folder in which built geometry is kept for the next render; 0 = none, everything stays in memory; empty = \
         none, what exceeds the host memory budget goes to oocpt/geometry in the user's cache folder while it is \
         needed";
    Int(geometry_cache_mib, 1, u32::MAX): u32 = 32 << 10;
        User Machine SameSamples "oocpt:geometryCacheSize" "OOCPT_GEOMETRY_CACHE_SIZE" "Geometry cache size"
        "Most MiB of the geometry cache; files not used for longest are removed";
    Text(pipeline_cache): String = String::new();
        User Machine SameSamples "oocpt:pipelineCache" "OOCPT_PIPELINE_CACHE" "Pipeline cache"
        "Folder in which the driver's compiled passes are kept; 0 = none; empty = oocpt/pipelines in the user's \
         cache folder";
    Int(max_diffuse_bounces, 0, MAX_BOUNCES): u32 = MAX_BOUNCES;
        User Scene BeginsAgain "oocpt:maxDiffuseBounces" "OOCPT_MAX_DIFFUSE_BOUNCES" "Max diffuse bounces"
        "Most bounces of a path off diffuse lobes, of those that oocpt:maxBounces allows";
    Int(max_specular_bounces, 0, MAX_BOUNCES): u32 = MAX_BOUNCES;
        User Scene BeginsAgain "oocpt:maxSpecularBounces" "OOCPT_MAX_SPECULAR_BOUNCES" "Max specular bounces"
        "Most bounces of a path off specular lobes, of those that oocpt:maxBounces allows";
    Int(max_transmission_bounces, 0, MAX_BOUNCES): u32 = MAX_BOUNCES;
        User Scene BeginsAgain "oocpt:maxTransmissionBounces" "OOCPT_MAX_TRANSMISSION_BOUNCES" "Max transmission bounces"
        "Most bounces of a path through surfaces, of those that oocpt:maxBounces allows";
    PixelFilter(pixel_filter): PixelFilterKind = PixelFilterKind::Box;
        User Scene BeginsAgain "oocpt:pixelFilter" "OOCPT_PIXEL_FILTER" "Pixel filter"
        "Filter of the pixels: box, triangle, gaussian, blackman-harris or mitchell";
    Float(pixel_filter_width, 0.0, 64.0): f32 = 0.0;
        User Scene BeginsAgain "oocpt:pixelFilterWidth" "OOCPT_PIXEL_FILTER_WIDTH" "Pixel filter width"
        "Full width of the filter in pixels; 0 = 1, 2, 3, 3 or 4, as usual for it";
    Bool(filter_aovs): bool = true;
        User Scene SameSamples "oocpt:filterAovs" "OOCPT_FILTER_AOVS" "Filter AOVs"
        "Normals, positions and albedo are averaged over the samples, as the colour; if off, they are those at pixel \
         centres";
    Denoise(denoise): DenoiseMode = DenoiseMode::Off;
        User Scene GoesOn "oocpt:denoise" "OOCPT_DENOISE" "Denoise"
        "Which pictures Open Image Denoise filters: off, final or interactive";
    Text(denoiser_library): String = String::new();
        User Machine GoesOn "oocpt:denoiserLibrary" "OOCPT_DENOISER_LIBRARY" "Denoiser library"
        "File of Open Image Denoise 2; empty = that of the host, of the system or of the Python package pyoidn";
    Text(checkpoint): String = String::new();
        User Machine GoesOn "oocpt:checkpoint" "OOCPT_CHECKPOINT" "Checkpoint"
        "File in which a render keeps its samples, and from which a later one goes on; empty = none";
    Float(checkpoint_secs, 0.0, 1e9): f32 = 60.0;
        User Machine GoesOn "oocpt:checkpointInterval" "OOCPT_CHECKPOINT_INTERVAL" "Checkpoint interval"
        "Seconds from one checkpoint to the next; the first comes after 5, or sooner";
    Text(film_part): String = String::new();
        User Machine SameSamples "oocpt:filmPart" "OOCPT_FILM_PART" "Film part"
        "File for the samples as a film that merges with others; empty = none";
    Span(span): SampleSpan = SampleSpan::default();
        User Machine SameSamples "oocpt:sampleRange" "OOCPT_SAMPLE_RANGE" "Sample range"
        "Samples to render, A..B, of a picture of B samples; empty = all";
    Bool(write_products): bool = true;
        User Machine GoesOn "oocpt:products" "OOCPT_PRODUCTS" "Render products"
        "Batch renders write the files that the active render settings ask for";
    Int(samples_per_pixel, 1, MAX_SAMPLES);
        User Host GoesOn "convergedSamplesPerPixel" "OOCPT_CONVERGED_SAMPLES_PER_PIXEL" "Converged samples"
        "As oocpt:samplesPerPixel";
    Bool(interactive): bool = true;
        User Host BeginsAgain "enableInteractive" "OOCPT_ENABLE_INTERACTIVE" "Interactive"
        "Show images while rendering; off = only the last one";
    Bool(dome_light_camera_visible): bool = true;
        User Host BeginsAgain "domeLightCameraVisibility" "OOCPT_DOME_LIGHT_CAMERA_VISIBILITY" "Dome light camera visibility"
        "Camera rays see the dome light";
    Bool(enable_scene_lights): bool = true;
        User Host BeginsAgain "enableSceneLights" "OOCPT_ENABLE_SCENE_LIGHTS" "Scene lights"
        "Use the lights of the scene";
}

impl Settings {
    /// The filter of the pixels.
    #[must_use]
    pub fn filter(&self) -> PixelFilter {
        PixelFilter::new(self.pixel_filter, self.pixel_filter_width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells<'a>(page: &'a str, key: &str) -> Vec<&'a str> {
        let begin = format!("| `{key}` |");
        let row = page.lines().find(|line| line.starts_with(&begin));
        row.map_or_else(Vec::new, |row| row.split('|').map(str::trim).collect())
    }

    #[test]
    fn the_book_lists_who_may_set_each_setting() {
        let users = include_str!("../../../book/src/settings.md");
        let developers = include_str!("../../../book/src/developer-settings.md");
        for row in TABLE {
            let page = if row.audience == SettingAudience::User { users } else { developers };
            let begin = ["", &format!("`{}`", row.key), &format!("`{}`", row.variable), row.scope.name()];
            assert_eq!(cells(page, row.key).get(..4), Some(&begin[..]), "the row of {} begins so", row.key);
        }
    }

    #[test]
    fn machine_settings_are_files_folders_memory_and_devices() {
        for row in TABLE {
            let named = ["File", "file", "Folder", "KiB", "MiB", "Device ", "EXR"];
            let is_of_machine = named.iter().any(|word| row.help.contains(word));
            assert!(!is_of_machine || row.scope == SettingScope::Machine, "{}: {}", row.key, row.help);
        }
    }
}
