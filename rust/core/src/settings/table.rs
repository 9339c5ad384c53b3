// SPDX-License-Identifier: Apache-2.0
//! One row per setting: its names, whom it is for, and who may set it.

/// Whom a setting is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Audience {
    /// People who render: hosts list it.
    User,
    /// People who develop the renderer: hosts do not list it.
    Developer,
}

/// What a setting is about, which says who may set it. Scenes come from strangers: what a machine has and keeps is not
/// for them to say. The environment and the host's own settings set all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// What the picture is: a scene may set it.
    Scene,
    /// How an application shows it: a scene may set it.
    Host,
    /// The machine's device, memory, files and folders: a scene may not set it.
    Machine,
}

impl Scope {
    /// As the book calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scene => "scene",
            Self::Host => "host",
            Self::Machine => "machine",
        }
    }
}

/// A setting's names.
pub(super) struct Row {
    /// Hydra's key. Several keys may share a field.
    pub(super) key: &'static str,
    /// Environment variable.
    pub(super) variable: &'static str,
    /// Name for people.
    pub(super) name: &'static str,
    /// One line of help.
    pub(super) help: &'static str,
    /// Whom it is for.
    pub(super) audience: Audience,
    /// Who may set it.
    pub(super) scope: Scope,
}

impl Row {
    const fn host(mut self) -> Self {
        self.scope = Scope::Host;
        self
    }

    const fn machine(mut self) -> Self {
        self.scope = Scope::Machine;
        self
    }
}

const fn user(key: &'static str, variable: &'static str, name: &'static str, help: &'static str) -> Row {
    Row { key, variable, name, help, audience: Audience::User, scope: Scope::Scene }
}

const fn developer(key: &'static str, variable: &'static str, name: &'static str, help: &'static str) -> Row {
    Row { key, variable, name, help, audience: Audience::Developer, scope: Scope::Scene }
}

/// In the order in which hosts show them.
pub(super) const TABLE: &[Row] = &[
    user("oocpt:samplesPerPixel", "OOCPT_SAMPLES_PER_PIXEL", "Samples per pixel", "Samples per pixel to converge at"),
    user("oocpt:maxBounces", "OOCPT_MAX_BOUNCES", "Max bounces", "Indirect bounces; 0 = direct light only"),
    user("oocpt:seed", "OOCPT_SEED", "Seed", "Seed of all random numbers"),
    user("oocpt:clamp", "OOCPT_CLAMP", "Clamp", "Largest indirect contribution of a sample; 0 = no limit"),
    user("oocpt:timeLimit", "OOCPT_TIME_LIMIT", "Time limit", "Stop after this many seconds; 0 = no limit"),
    user(
        "oocpt:memoryBudget",
        "OOCPT_MEMORY_BUDGET",
        "Memory budget",
        "Hard limit of device memory in MiB; 0 = automatic",
    ).machine(),
    user("oocpt:device", "OOCPT_DEVICE", "Device", "Device by index or part of its name; empty = best").machine(),
    developer(
        "oocpt:traversal",
        "OOCPT_TRAVERSAL",
        "Traversal",
        "Who walks the rays: auto, compute (the device) or native (the host, where the device is a processor)",
    ).machine(),
    developer(
        "oocpt:hostMappedGeometry",
        "OOCPT_HOST_MAPPED_GEOMETRY",
        "Host-mapped geometry",
        "Whether rays read geometry in host memory where the device has no room: auto, on or off",
    ).machine(),
    developer("oocpt:policy", "OOCPT_POLICY", "Policy", "Which chunks to load first: sweep, priority or benefit").machine(),
    user("oocpt:chunkSize", "OOCPT_CHUNK_SIZE", "Chunk size", "Device memory of a chunk of the scene in KiB").machine(),
    user(
        "oocpt:geometryBudget",
        "OOCPT_GEOMETRY_BUDGET",
        "Geometry budget",
        "Hard limit of device memory for geometry and textures in KiB; 0 = what the memory budget leaves",
    ).machine(),
    user(
        "oocpt:hostMemoryBudget",
        "OOCPT_HOST_MEMORY_BUDGET",
        "Host memory budget",
        "Most MiB of host memory for all that the renderer counts; 0 = shares of what is free",
    ).machine(),
    user(
        "oocpt:dicingRate",
        "OOCPT_DICING_RATE",
        "Dicing rate",
        "Longest edge of subdivision surfaces in pixels; 0 = as the complexity says",
    ),
    developer(
        "oocpt:chunkReport",
        "OOCPT_CHUNK_REPORT",
        "Chunk report",
        "File for a report about the chunks; empty = none",
    ).machine(),
    developer(
        "oocpt:materialReport",
        "OOCPT_MATERIAL_REPORT",
        "Material report",
        "File for the networks, inputs and programs of all materials; empty = none",
    ).machine(),
    user(
        "oocpt:report",
        "OOCPT_REPORT",
        "Report",
        "File for a report of error against time, a JSON object a line; empty = none",
    ).machine(),
    developer(
        "oocpt:reference",
        "OOCPT_REFERENCE",
        "Reference",
        "EXR picture for the report to compare with; empty = none",
    ).machine(),
    user(
        "oocpt:targetError",
        "OOCPT_TARGET_ERROR",
        "Target error",
        "Stop when the relative mean squared error is below this, by the upper end of its interval; 0 = no limit",
    ),
    developer(
        "oocpt:carry",
        "OOCPT_CARRY",
        "Carry",
        "Features to compile in although the scene does not need them, to measure what they cost: names, or all; empty = none",
    ).machine(),
    user(
        "oocpt:stragglerRoulette",
        "OOCPT_STRAGGLER_ROULETTE",
        "Straggler roulette",
        "Russian roulette on rays that wait for expensive loads: unbiased, but other bits at each budget and run",
    ),
    user(
        "oocpt:adaptiveSampling",
        "OOCPT_ADAPTIVE_SAMPLING",
        "Adaptive sampling",
        "Spend samples where the error is largest; as many in all, and no bias",
    ),
    user(
        "oocpt:textureCache",
        "OOCPT_TEXTURE_CACHE",
        "Texture cache",
        "Folder in which decoded textures are kept; 0 = none; empty = oocpt/textures in the user's cache folder",
    ).machine(),
    user(
        "oocpt:textureCacheSize",
        "OOCPT_TEXTURE_CACHE_SIZE",
        "Texture cache size",
        "Most MiB of decoded textures on disk; those not used for longest are removed",
    ).machine(),
    user(
        "oocpt:geometryCache",
        "OOCPT_GEOMETRY_CACHE",
        "Geometry cache",
        "Folder in which built geometry is kept for the next render; 0 = none, everything stays in memory; empty = \
         none, what exceeds the host memory budget goes to oocpt/geometry in the user's cache folder while it is needed",
    ).machine(),
    user(
        "oocpt:geometryCacheSize",
        "OOCPT_GEOMETRY_CACHE_SIZE",
        "Geometry cache size",
        "Most MiB of the geometry cache; files not used for longest are removed",
    ).machine(),
    user(
        "oocpt:pipelineCache",
        "OOCPT_PIPELINE_CACHE",
        "Pipeline cache",
        "Folder in which the driver's compiled passes are kept; 0 = none; empty = oocpt/pipelines in the user's cache folder",
    )
    .machine(),
    user(
        "convergedSamplesPerPixel",
        "OOCPT_CONVERGED_SAMPLES_PER_PIXEL",
        "Converged samples",
        "As oocpt:samplesPerPixel",
    ).host(),
    user(
        "enableInteractive",
        "OOCPT_ENABLE_INTERACTIVE",
        "Interactive",
        "Show images while rendering; off = only the last one",
    ).host(),
    user(
        "domeLightCameraVisibility",
        "OOCPT_DOME_LIGHT_CAMERA_VISIBILITY",
        "Dome light camera visibility",
        "Camera rays see the dome light",
    ).host(),
    user("enableSceneLights", "OOCPT_ENABLE_SCENE_LIGHTS", "Scene lights", "Use the lights of the scene").host(),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of the rows of the book's tables, by the key that they begin with.
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
            let page = if row.audience == Audience::User { users } else { developers };
            let begin = ["", &format!("`{}`", row.key), &format!("`{}`", row.variable), row.scope.name()];
            assert_eq!(cells(page, row.key).get(..4), Some(&begin[..]), "the row of {} begins so", row.key);
        }
    }

    #[test]
    fn machine_settings_are_files_folders_memory_and_devices() {
        for row in TABLE {
            let named = ["File", "file", "Folder", "KiB", "MiB", "Device ", "EXR"];
            let is_of_machine = named.iter().any(|word| row.help.contains(word));
            assert!(!is_of_machine || row.scope == Scope::Machine, "{}: {}", row.key, row.help);
        }
    }
}
