// SPDX-License-Identifier: Apache-2.0
//! Renders the statistics as the key-value pairs that hosts look for in `GetRenderStats`.
//!
//! Keys without prefix are read by usdview, Houdini, husk and others (`numCompletedSamples`, `gpuMemoryUsed`,
//! `percentDone`…); those under `oocpt:` are ours. Pure; any thread.

use crate::ffi::{NamedValue, ScalarTag, ScalarValue};
use oocpt_core::adaptive::AdaptiveUsage;
use oocpt_core::inventory::RenderInventory;
use oocpt_core::stats::{DeviceUsage, ErrorRow, RenderStats, StreamingStats};
use oocpt_render::CommitProgress;

/// The list of pairs, sorted as below. Memory in bytes, times in seconds.
pub(crate) fn named_values(stats: &RenderStats) -> Vec<NamedValue> {
    let dropped = stats.dropped.message().unwrap_or_default();
    let mut values = vec![
        text("rendererName", "OocPT"),
        text("rendererVersion", env!("CARGO_PKG_VERSION")),
        real("percentDone", f64::from(stats.percent_done)),
        real("fractionDone", f64::from(stats.percent_done) / 100.0),
        real("totalClockTime", stats.seconds_total),
        integer("numCompletedSamples", u64::from(stats.samples_completed)),
        integer("oocpt:samplesKept", u64::from(stats.samples_kept)),
        integer("oocpt:filmWindows", u64::from(stats.film_windows)),
        text("renderProgressAnnotation", &stats.annotation),
        text("rendererStage", stage(stats)),
        integer("gpuMemoryUsed", stats.gpu_bytes),
        integer("totalMemory", stats.gpu_bytes.saturating_add(stats.host_bytes)),
        integer("peakMemory", stats.gpu_peak_bytes.saturating_add(stats.host_bytes)),
        integer("oocpt:samplesTarget", u64::from(stats.samples_target)),
        integer("oocpt:gpuMemoryPeak", stats.gpu_peak_bytes),
        integer("oocpt:gpuMemoryBudget", stats.gpu_budget_bytes),
        integer("oocpt:hostMemory", stats.host_bytes),
        integer("oocpt:hostPeakMemory", stats.host_peak_bytes),
        integer("oocpt:raysTraced", stats.rays_traced),
        real("oocpt:raysPerSecond", stats.rays_per_second),
        integer("oocpt:nonFiniteSamples", stats.nonfinite_samples),
        integer("oocpt:instances", stats.instances),
        integer("oocpt:triangles", stats.triangles),
        integer("oocpt:uniqueTriangles", stats.unique_triangles),
        integer("oocpt:meshesMade", stats.meshes_made),
        integer("oocpt:meshesRefitted", stats.meshes_refitted),
        integer("oocpt:meshes", stats.meshes),
        text("oocpt:featuresLeftOut", &stats.features_left_out.join("; ")),
        integer("oocpt:dropped", stats.dropped.total()),
        text("oocpt:droppedData", &dropped),
        list("oocpt:deviceShares", stats.devices.iter().map(device_share)),
        list("oocpt:passSeconds", stats.passes.iter().map(|(name, secs, runs)| format!("{name} {secs:.6} {runs}"))),
    ];
    values.extend(inventory(&stats.inventory));
    values.extend(streaming(&stats.streaming));
    values.extend(stats.error.iter().flat_map(error));
    values.extend(stats.adaptive.iter().flat_map(adaptive));
    values
}

/// What a device did for a picture that several render: its index, samples, most bytes and budget, name.
fn device_share(device: &DeviceUsage) -> String {
    let DeviceUsage { index, samples, gpu_peak_bytes, gpu_budget_bytes, name, failure, .. } = device;
    let failure = failure.as_ref().map_or_else(String::new, |failure| format!(" ({failure})"));
    format!("{index} {samples} {gpu_peak_bytes} {gpu_budget_bytes} {name}{failure}")
}

/// What the render is made of, and what was left out for it, as lists parted by semicolons.
fn inventory(inventory: &RenderInventory) -> [NamedValue; 14] {
    let RenderInventory { features, passes, buffers, primvars, .. } = inventory;
    let with_bytes = |name: &str, bytes: u64| format!("{name} {bytes}");
    let features_present = features.iter().filter(|f| f.present).map(|f| f.name.clone());
    let passes_made = passes.iter().filter(|p| p.made).map(|p| p.name.clone());
    let passes_left_out = passes.iter().filter(|p| !p.made).map(|p| p.name.clone());
    let made = buffers.iter().filter(|b| b.bytes > 0).map(|b| with_bytes(&b.name, b.bytes));
    let left_out = buffers.iter().filter(|b| b.bytes == 0).map(|b| with_bytes(&b.name, b.saved));
    let read = primvars.iter().filter(|p| p.made > 0).map(|p| with_bytes(&p.name, p.bytes));
    let unread = primvars.iter().filter(|p| p.left_out > 0).map(|p| with_bytes(&p.name, p.saved));
    [
        list("oocpt:features", features_present),
        list("oocpt:passes", passes_made),
        list("oocpt:passesLeftOut", passes_left_out),
        list("oocpt:buffers", made),
        list("oocpt:buffersLeftOut", left_out),
        list("oocpt:primvars", read),
        list("oocpt:primvarsLeftOut", unread),
        integer("oocpt:pipelines", inventory.pipelines() as u64),
        integer("oocpt:bufferBytes", inventory.bytes()),
        integer("oocpt:bytesLeftOut", inventory.saved()),
        integer("oocpt:maxLevels", u64::from(inventory.max_levels)),
        integer("oocpt:stackSize", u64::from(inventory.stack_size)),
        text("oocpt:traversalBackend", &inventory.traversal.backend),
        text("oocpt:traversalReason", &inventory.traversal.why),
    ]
}

/// The newest job, and the one whose picture is shown.
pub(crate) fn jobs([newest, shown]: [u64; 2]) -> [NamedValue; 2] {
    [integer("oocpt:job", newest), integer("oocpt:shownJob", shown)]
}

/// How far the commits of the scene are.
pub(crate) fn commits(progress: &CommitProgress) -> [NamedValue; 3] {
    [
        integer("oocpt:commits", progress.ended),
        integer("oocpt:commitsInHostThread", progress.in_host_thread),
        flag("oocpt:commitPending", progress.is_pending),
    ]
}

/// How samples were spent at that look.
fn adaptive(usage: &AdaptiveUsage) -> [NamedValue; 4] {
    [
        integer("oocpt:adaptiveEpochs", u64::from(usage.epochs)),
        integer("oocpt:adaptiveFewestSamples", u64::from(usage.fewest)),
        integer("oocpt:adaptiveMostSamples", u64::from(usage.most)),
        real("oocpt:adaptiveDecidedShare", usage.decided),
    ]
}

/// The last measurement of the picture's error; the row's time and samples are those of the measurement, not of the
/// call.
fn error(row: &ErrorRow) -> Vec<NamedValue> {
    let worst: Vec<String> = row.worst.iter().map(|pixel| format!("({}, {})", pixel.x, pixel.y)).collect();
    let mut values = vec![
        integer("oocpt:errorSamples", u64::from(row.samples)),
        real("oocpt:errorSeconds", row.seconds),
        real("oocpt:errorSecondsTracing", row.seconds_tracing),
        integer("oocpt:errorRays", row.rays),
        integer("oocpt:errorBytesPaged", row.bytes_paged),
        text("oocpt:errorWorstPixels", &worst.join(" ")),
    ];
    if let Some(estimate) = row.estimate {
        values.push(real("oocpt:errorEstimate", estimate.rel_mse));
        values.push(real("oocpt:errorLow", estimate.low));
        values.push(real("oocpt:errorHigh", estimate.high));
    }
    if let Some(truth) = row.truth {
        values.push(real("oocpt:errorRelMse", truth.rel_mse));
        values.push(real("oocpt:errorRmse", truth.rmse));
        values.push(real("oocpt:errorFlip", truth.flip));
    }
    values
}

/// The figures about chunks, memory and the overlap of tracing and loading.
fn streaming(stats: &StreamingStats) -> [NamedValue; 40] {
    [
        flag("oocpt:inCore", stats.in_core),
        integer("oocpt:chunks", stats.chunks),
        integer("oocpt:chunkInstances", stats.chunk_instances),
        integer("oocpt:treesBuilt", stats.trees_built),
        integer("oocpt:treesRefitted", stats.trees_refitted),
        integer("oocpt:residentChunks", stats.resident_chunks),
        integer("oocpt:chunksTouched", stats.chunks_touched),
        integer("oocpt:loads", stats.loads),
        integer("oocpt:reloads", stats.reloads),
        integer("oocpt:evictions", stats.evictions),
        integer("oocpt:failedLoads", stats.failed_loads),
        integer("oocpt:bytesPaged", stats.bytes_paged),
        integer("oocpt:reloadedBytes", stats.reloaded_bytes),
        real("oocpt:hitRate", stats.hit_rate),
        integer("oocpt:waitingRays", stats.waiting_rays),
        integer("oocpt:waits", stats.waits),
        integer("oocpt:stragglers", stats.stragglers),
        integer("oocpt:geometryBytes", stats.geometry_bytes),
        integer("oocpt:geometryBudgetBytes", stats.geometry_budget_bytes),
        integer("oocpt:geometryPeakBytes", stats.geometry_peak_bytes),
        integer("oocpt:mappedBytes", stats.mapped_bytes),
        flag("oocpt:isSplit", stats.is_split),
        integer("oocpt:compiledAhead", u64::from(stats.compiled_ahead)),
        integer("oocpt:recompilations", u64::from(stats.recompilations)),
        integer("oocpt:driverPeakBytes", stats.driver_peak_bytes),
        integer("oocpt:sceneBytes", stats.scene_bytes),
        real("oocpt:fragmentation", stats.fragmentation),
        real("oocpt:secondsTracing", stats.seconds_tracing),
        real("oocpt:secondsLoading", stats.seconds_loading),
        real("oocpt:secondsWaiting", stats.seconds_waiting),
        real("oocpt:secondsOverlapped", stats.seconds_overlapped),
        integer("oocpt:pathsLeft", stats.paths_left),
        integer("oocpt:roulettePaths", stats.roulette_paths),
        integer("oocpt:rouletteShadowRays", stats.roulette_shadow_rays),
        integer("oocpt:rouletteLoadsSaved", stats.roulette_loads_saved),
        integer("oocpt:textureSceneBytes", stats.texture_scene_bytes),
        integer("oocpt:textureBytes", stats.texture_bytes),
        integer("oocpt:textureLoads", stats.texture_loads),
        integer("oocpt:textureReloads", stats.texture_reloads),
        integer("oocpt:textureBytesPaged", stats.texture_bytes_paged),
    ]
}

fn stage(stats: &RenderStats) -> &'static str {
    if stats.samples_target > 0 && stats.samples_completed >= stats.samples_target { "done" } else { "rendering" }
}

fn list(key: &str, entries: impl Iterator<Item = String>) -> NamedValue {
    text(key, &entries.collect::<Vec<_>>().join("; "))
}

fn empty() -> ScalarValue {
    ScalarValue { tag: ScalarTag::Bool, flag: false, integer: 0, real: 0.0, text: String::new() }
}

fn flag(key: &str, flag: bool) -> NamedValue {
    NamedValue { key: key.to_owned(), value: ScalarValue { flag, ..empty() } }
}

fn integer(key: &str, number: u64) -> NamedValue {
    let integer = i64::try_from(number).unwrap_or(i64::MAX);
    NamedValue { key: key.to_owned(), value: ScalarValue { tag: ScalarTag::Int, integer, ..empty() } }
}

fn real(key: &str, real: f64) -> NamedValue {
    NamedValue { key: key.to_owned(), value: ScalarValue { tag: ScalarTag::Float, real, ..empty() } }
}

fn text(key: &str, text: &str) -> NamedValue {
    NamedValue { key: key.to_owned(), value: ScalarValue { tag: ScalarTag::Text, text: text.to_owned(), ..empty() } }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_core::inventory::PassUse;

    #[test]
    fn stats_have_the_keys_that_hosts_read() {
        let stats = RenderStats {
            percent_done: 25.0,
            samples_completed: 16,
            samples_target: 64,
            gpu_bytes: 1 << 20,
            annotation: "16 of 64 samples".into(),
            passes: vec![("resolve".into(), 0.25, 3), ("accumulate".into(), 1.5, 12)],
            ..RenderStats::default()
        };
        let values = named_values(&stats);
        let find = |key: &str| &values.iter().find(|entry| entry.key == key).expect(key).value;
        assert!((find("percentDone").real - 25.0).abs() < 1e-9, "percent");
        assert!((find("fractionDone").real - 0.25).abs() < 1e-9, "fraction");
        assert_eq!(find("numCompletedSamples").integer, 16, "samples");
        assert_eq!(find("gpuMemoryUsed").integer, 1 << 20, "bytes");
        assert_eq!(find("renderProgressAnnotation").text, "16 of 64 samples", "annotation");
        assert_eq!(find("rendererName").text, "OocPT", "name");
        let passes = "resolve 0.250000 3; accumulate 1.500000 12";
        assert_eq!(find("oocpt:passSeconds").text, passes, "seconds by pass");
    }

    /// Each number of the streaming statistics is listed under its own name, with the prefix and in camel case.
    #[test]
    fn streaming_stats_are_reported_under_their_names() {
        let mut fields = serde_json::to_value(StreamingStats::default()).expect("plain data");
        let fields = fields.as_object_mut().expect("fields");
        let names: Vec<String> = fields.keys().cloned().collect();
        for (name, value) in names.iter().zip(1..) {
            let field = fields.get_mut(name).expect(name);
            *field = if field.is_boolean() { true.into() } else { value.into() };
        }
        let streaming: StreamingStats = serde_json::from_value(fields.clone().into()).expect("the same fields");
        let values = named_values(&RenderStats { streaming, ..RenderStats::default() });
        for (name, number) in names.iter().zip(1_i32..) {
            let mut words = name.split('_');
            let first = words.next().unwrap_or_default().to_owned();
            let key = words.fold(format!("oocpt:{first}"), |key, word| key + &word[..1].to_uppercase() + &word[1..]);
            let value = &values.iter().find(|entry| entry.key == key).expect(&key).value;
            match value.tag {
                ScalarTag::Bool => assert!(value.flag, "{key}"),
                ScalarTag::Int => assert_eq!(value.integer, i64::from(number), "{key}"),
                _ => assert!((value.real - f64::from(number)).abs() < 1e-9, "{key} is {}", value.real),
            }
        }
    }

    #[test]
    fn inventory_keys_separate_present_from_omitted_parts() {
        let mut stats = RenderStats::default();
        stats.inventory.add("rays", 640);
        stats.inventory.leave_out("cones", 80);
        stats.inventory.leave_out("hits", 16);
        stats.inventory.add("hits", 32);
        let pass = |name: &str, made| PassUse { name: name.into(), made, compile_secs: 0.5 };
        stats.inventory.passes = vec![pass("resolve", true), pass("count_demand", false)];
        let values = named_values(&stats);
        let find = |key: &str| &values.iter().find(|entry| entry.key == key).expect(key).value;
        assert_eq!(find("oocpt:buffers").text, "rays 640; hits 32", "what is there");
        assert_eq!(find("oocpt:buffersLeftOut").text, "cones 80", "what is not");
        assert_eq!((find("oocpt:bufferBytes").integer, find("oocpt:bytesLeftOut").integer), (672, 96), "sums");
        assert_eq!((&*find("oocpt:passes").text, &*find("oocpt:passesLeftOut").text), ("resolve", "count_demand"));
        assert_eq!(find("oocpt:pipelines").integer, 1, "one pipeline for each pass");
    }

    #[test]
    fn keys_are_distinct_and_huge_counts_saturate() {
        let values = named_values(&RenderStats { rays_traced: u64::MAX, ..RenderStats::default() });
        let mut keys: Vec<&str> = values.iter().map(|entry| entry.key.as_str()).collect();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), values.len(), "a key appears twice");
        let rays = values.iter().find(|entry| entry.key == "oocpt:raysTraced").expect("rays are listed");
        assert_eq!(rays.value.integer, i64::MAX, "a count beyond i64 must not wrap");
    }
}
