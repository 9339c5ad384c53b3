// SPDX-License-Identifier: Apache-2.0
//! One row per setting: its names, and whom it is for.

/// Whom a setting is for. All of them work wherever a setting can be given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Audience {
    /// People who render: hosts list it.
    User,
    /// People who develop the renderer: hosts do not list it.
    Developer,
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
}

const fn user(key: &'static str, variable: &'static str, name: &'static str, help: &'static str) -> Row {
    Row { key, variable, name, help, audience: Audience::User }
}

const fn developer(key: &'static str, variable: &'static str, name: &'static str, help: &'static str) -> Row {
    Row { key, variable, name, help, audience: Audience::Developer }
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
    ),
    user("oocpt:device", "OOCPT_DEVICE", "Device", "Device by index or part of its name; empty = best"),
    developer(
        "oocpt:traversal",
        "OOCPT_TRAVERSAL",
        "Traversal",
        "Who walks the rays: auto, compute (the device) or native (the host, where the device is a processor)",
    ),
    developer(
        "oocpt:hostMappedGeometry",
        "OOCPT_HOST_MAPPED_GEOMETRY",
        "Host-mapped geometry",
        "Whether rays read geometry in host memory where the device has no room: auto, on or off",
    ),
    developer("oocpt:policy", "OOCPT_POLICY", "Policy", "Which chunks to load first: sweep, priority or benefit"),
    user("oocpt:chunkSize", "OOCPT_CHUNK_SIZE", "Chunk size", "Device memory of a chunk of the scene in KiB"),
    user(
        "oocpt:geometryBudget",
        "OOCPT_GEOMETRY_BUDGET",
        "Geometry budget",
        "Hard limit of device memory for geometry and textures in KiB; 0 = what the memory budget leaves",
    ),
    user(
        "oocpt:hostMemoryBudget",
        "OOCPT_HOST_MEMORY_BUDGET",
        "Host memory budget",
        "Most MiB of host memory for built geometry and ended paths; 0 = as much as is free",
    ),
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
    ),
    developer(
        "oocpt:materialReport",
        "OOCPT_MATERIAL_REPORT",
        "Material report",
        "File for the networks, inputs and programs of all materials; empty = none",
    ),
    user(
        "oocpt:report",
        "OOCPT_REPORT",
        "Report",
        "File for a report of error against time, a JSON object a line; empty = none",
    ),
    developer(
        "oocpt:reference",
        "OOCPT_REFERENCE",
        "Reference",
        "EXR picture for the report to compare with; empty = none",
    ),
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
    ),
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
    ),
    user(
        "oocpt:textureCacheSize",
        "OOCPT_TEXTURE_CACHE_SIZE",
        "Texture cache size",
        "Most MiB of decoded textures on disk; those not used for longest are removed",
    ),
    user(
        "oocpt:geometryCache",
        "OOCPT_GEOMETRY_CACHE",
        "Geometry cache",
        "Folder in which built geometry is kept for the next render; 0 = none, everything stays in memory; empty = \
         none, what exceeds the host memory budget goes to oocpt/geometry in the user's cache folder while it is needed",
    ),
    user(
        "oocpt:geometryCacheSize",
        "OOCPT_GEOMETRY_CACHE_SIZE",
        "Geometry cache size",
        "Most MiB of the geometry cache; files not used for longest are removed",
    ),
    user(
        "convergedSamplesPerPixel",
        "OOCPT_CONVERGED_SAMPLES_PER_PIXEL",
        "Converged samples",
        "As oocpt:samplesPerPixel",
    ),
    user(
        "enableInteractive",
        "OOCPT_ENABLE_INTERACTIVE",
        "Interactive",
        "Show images while rendering; off = only the last one",
    ),
    user(
        "domeLightCameraVisibility",
        "OOCPT_DOME_LIGHT_CAMERA_VISIBILITY",
        "Dome light camera visibility",
        "Camera rays see the dome light",
    ),
    user("enableSceneLights", "OOCPT_ENABLE_SCENE_LIGHTS", "Scene lights", "Use the lights of the scene"),
];
