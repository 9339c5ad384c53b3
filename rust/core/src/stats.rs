// SPDX-License-Identifier: Apache-2.0
//! Statistics that a render reports about itself. Plain data, serialisable; any thread.

use serde::{Deserialize, Serialize};

use crate::adaptive::AdaptiveUsage;
use crate::convergence::ErrorEstimate;
use crate::desc::DroppedData;
use crate::inventory::RenderInventory;

/// A reading of a render in progress or done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RenderStats {
    /// 0 to 100.
    pub percent_done: f32,
    /// Wall clock since the render began, seconds.
    pub seconds_total: f64,
    /// Samples per pixel finished.
    pub samples_completed: u32,
    /// Of these, samples that were there when the render began: it went on with a picture of fewer.
    #[serde(default)]
    pub samples_kept: u32,
    /// Samples per pixel wanted.
    pub samples_target: u32,
    /// Device memory in use, bytes.
    pub gpu_bytes: u64,
    /// Its maximum so far, bytes.
    pub gpu_peak_bytes: u64,
    /// Its hard limit, bytes.
    pub gpu_budget_bytes: u64,
    /// Host memory of scene data that the renderer holds (not the host's own arrays), bytes.
    pub host_bytes: u64,
    /// Maximum of the memory that the process has held so far, including the host's own data, bytes; 0: unknown.
    #[serde(default)]
    pub host_peak_bytes: u64,
    /// Rays traced, all kinds.
    pub rays_traced: u64,
    /// Rays per second of wall clock.
    pub rays_per_second: f64,
    /// Samples dropped because they were not finite.
    pub nonfinite_samples: u64,
    /// Scene data dropped because it was bad.
    pub dropped: DroppedData,
    /// Windows in which the picture is rendered one after the other, since its film would take too much of the device's
    /// memory; 0 if it is rendered as a whole.
    #[serde(default)]
    pub film_windows: u32,
    /// Status line for the user.
    pub annotation: String,
    /// Parts of the pipeline that this scene does not need and that were left out.
    pub features_left_out: Vec<String>,
    /// Passes with their seconds on the device in this render and the number of their runs; only when profiled.
    #[serde(default)]
    pub passes: Vec<(String, f64, u64)>,
    /// Parts of the render, and those that were left out; empty until the passes are compiled.
    #[serde(default)]
    pub inventory: RenderInventory,
    /// Placements of meshes, multiplied out.
    pub instances: u64,
    /// Triangles stored once per mesh.
    pub unique_triangles: u64,
    /// Meshes that the session has built so far, or found in files.
    pub meshes_made: u64,
    /// Of these, those that deformed and were refitted.
    #[serde(default)]
    pub meshes_refitted: u64,
    /// Triangles, multiplied out.
    pub triangles: u64,
    /// Unique meshes.
    pub meshes: u64,
    /// Transfers and residency of scene data.
    #[serde(default)]
    pub streaming: StreamingStats,
    /// The last estimate of the picture's error.
    #[serde(default)]
    pub error: Option<ErrorRow>,
    /// The denoiser that made the picture of its last image, and the seconds that took.
    #[serde(default)]
    pub denoised: Option<DenoiserUsage>,
    /// With adaptive sampling: the samples spent so far.
    #[serde(default)]
    pub adaptive: Option<AdaptiveUsage>,
    /// The devices of a picture that several render, in the order in which they are named; memory in the other fields
    /// is then that of the one that held most.
    #[serde(default)]
    pub devices: Vec<DeviceUsage>,
}

/// What one of several devices did for a picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct DeviceUsage {
    /// Its name.
    pub name: String,
    /// Its index in the driver's list.
    pub index: u32,
    /// Samples of each pixel that it rendered.
    pub samples: u32,
    /// Portions that it took them in.
    pub blocks: u32,
    /// Seconds in which it had a portion.
    pub seconds: f64,
    /// The most device memory that was in use, bytes.
    pub gpu_peak_bytes: u64,
    /// Its hard limit, bytes.
    pub gpu_budget_bytes: u64,
    /// Why it was left out, if it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

/// What denoised a picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct DenoiserUsage {
    /// The library with its version, and the kind of its device.
    pub by: String,
    /// Seconds, with those that opened it.
    pub seconds: f64,
    /// The colour that hosts see is denoised, and not only an image beside it.
    pub replaces_color: bool,
    /// The images were denoised where the device has them, not copied to the host before.
    pub in_place: bool,
    /// Its error against a reference picture.
    pub truth: Option<TrueError>,
}

/// The picture's error at one moment; also a line of the report that `oocpt:report` names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ErrorRow {
    /// Least number of samples of a pixel.
    pub samples: u32,
    /// Seconds since the render began, without comparisons with a reference.
    pub seconds: f64,
    /// Part of these seconds in which the device traced.
    pub seconds_tracing: f64,
    /// Rays traced, all kinds.
    pub rays: u64,
    /// Estimated relMSE with its interval (see [`crate::convergence`]); `None` while there is no estimate.
    pub estimate: Option<ErrorEstimate>,
    /// The worst pixels, by the same estimate: at most one of every workgroup that measured, worst first.
    pub worst: Vec<WorstPixel>,
    /// Bytes of geometry and textures sent to the device so far while rendering.
    pub bytes_paged: u64,
    /// Device memory in use, bytes; 0 in reports of older versions.
    #[serde(default)]
    pub gpu_bytes: u64,
    /// Maximum of the memory that the process has held so far, bytes ([`RenderStats::host_peak_bytes`]).
    #[serde(default)]
    pub host_peak_bytes: u64,
    /// Error against the reference, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<TrueError>,
    /// True if no further sample was to come.
    #[serde(default)]
    pub is_last: bool,
}

/// Totals of a render at its end; also a line of the report that `oocpt:report` names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct RenderUsage {
    /// Wall clock since the render began, seconds.
    pub seconds_total: f64,
    /// What denoised the picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub denoised: Option<DenoiserUsage>,
    /// The most device memory that was in use, bytes.
    pub gpu_peak_bytes: u64,
    /// Device memory of this process according to the driver, maximum in bytes ([`StreamingStats::driver_peak_bytes`]).
    pub driver_peak_bytes: u64,
    /// Host memory of scene data that the renderer holds, bytes.
    pub host_bytes: u64,
    /// Maximum of the memory that the process has held, bytes ([`RenderStats::host_peak_bytes`]).
    #[serde(default)]
    pub host_peak_bytes: u64,
    /// True if all of the scene was on the device and nothing was streamed.
    pub in_core: bool,
    /// Bytes that all of the scene would take on the device.
    pub scene_bytes: u64,
    /// Part of `scene_bytes` that is textures.
    pub texture_scene_bytes: u64,
    /// Bytes of texture tiles on the device.
    pub texture_bytes: u64,
    /// Texture tiles that were loaded while rendering; 0 if all were loaded before.
    pub texture_loads: u64,
    /// Bytes of these texture tiles.
    pub texture_bytes_paged: u64,
    /// Rays traced, all kinds.
    #[serde(default)]
    pub rays_traced: u64,
    /// Number of chunks of the scene.
    #[serde(default)]
    pub chunks: u64,
    /// Completed loads of chunks and tiles.
    #[serde(default)]
    pub loads: u64,
    /// Part of `loads` that had been on the device before.
    #[serde(default)]
    pub reloads: u64,
    /// Bytes copied to the device for these loads.
    #[serde(default)]
    pub bytes_paged: u64,
    /// Maximum of the bytes of geometry and textures on the device; 0 if nothing was streamed.
    #[serde(default)]
    pub geometry_peak_bytes: u64,
    /// Hard limit of these bytes; 0 if nothing was streamed.
    #[serde(default)]
    pub geometry_budget_bytes: u64,
    /// Bytes of geometry and of texture tiles that rays read in host memory.
    #[serde(default)]
    pub mapped_bytes: u64,
    /// True if the last paths were traced by passes without streaming ([`StreamingStats::is_split`]).
    #[serde(default)]
    pub is_split: bool,
    /// Seconds during which a load was in flight.
    #[serde(default)]
    pub seconds_loading: f64,
    /// Seconds during which the device only waited for loads.
    #[serde(default)]
    pub seconds_waiting: f64,
    /// Seconds before the first ray in which geometry was read and sent to the device.
    #[serde(default)]
    pub seconds_uploading: f64,
    /// Seconds before the first ray in which passes were compiled for the scene.
    #[serde(default)]
    pub seconds_compiling: f64,
    /// Seconds in which a scene in core waited for texture tiles.
    #[serde(default)]
    pub seconds_texture_tiles: f64,
    /// Number of waves traced.
    #[serde(default)]
    pub waves: u64,
    /// Number of waves traced again for texture tiles.
    #[serde(default)]
    pub waves_retraced: u64,
    /// The devices of a picture that several render ([`RenderStats::devices`]).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub devices: Vec<DeviceUsage>,
}

impl RenderUsage {
    /// The totals among these statistics.
    #[must_use]
    pub fn of(stats: &RenderStats) -> Self {
        let streaming = &stats.streaming;
        Self {
            seconds_total: stats.seconds_total,
            denoised: stats.denoised.clone(),
            gpu_peak_bytes: stats.gpu_peak_bytes,
            driver_peak_bytes: streaming.driver_peak_bytes,
            host_bytes: stats.host_bytes,
            host_peak_bytes: stats.host_peak_bytes,
            in_core: streaming.in_core,
            scene_bytes: streaming.scene_bytes,
            texture_scene_bytes: streaming.texture_scene_bytes,
            texture_bytes: streaming.texture_bytes,
            texture_loads: streaming.texture_loads,
            texture_bytes_paged: streaming.texture_bytes_paged,
            rays_traced: stats.rays_traced,
            chunks: streaming.chunks,
            loads: streaming.loads,
            reloads: streaming.reloads,
            bytes_paged: streaming.bytes_paged,
            geometry_peak_bytes: streaming.geometry_peak_bytes,
            geometry_budget_bytes: streaming.geometry_budget_bytes,
            mapped_bytes: streaming.mapped_bytes,
            is_split: streaming.is_split,
            seconds_loading: streaming.seconds_loading,
            seconds_waiting: streaming.seconds_waiting,
            devices: stats.devices.clone(),
            ..Self::default()
        }
    }
}

/// A pixel and its relative squared error, estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct WorstPixel {
    /// Column, counted from the left.
    pub x: u32,
    /// Row, counted from the top.
    pub y: u32,
    /// Relative squared error.
    pub error: f64,
}

/// Difference of a picture from a reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct TrueError {
    /// Mean of `(x - r)^2 / (r^2 + 0.01)` over pixels and colour channels.
    pub rel_mse: f64,
    /// Root of the mean of `(x - r)^2`.
    pub rmse: f64,
    /// Mean LDR-FLIP of both as sRGB in 8 bits, 0 to 1.
    pub flip: f64,
}

/// Streaming of the scene to the device. Counts and seconds are totals since the render began unless they say "now".
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StreamingStats {
    /// True if all of the scene fits and nothing is streamed: the following numbers about loads and rays stay 0.
    pub in_core: bool,
    /// Chunks of the scene.
    pub chunks: u64,
    /// Placements of chunks in the top level.
    pub chunk_instances: u64,
    /// Trees over records of instances that were built for the device, in core too.
    pub trees_built: u64,
    /// Those that were refitted in their place, since their records have moved.
    pub trees_refitted: u64,
    /// Chunks usable on the device now.
    pub resident_chunks: u64,
    /// Chunks that were resident at least once.
    pub chunks_touched: u64,
    /// Chunks whose load completed.
    pub loads: u64,
    /// How often a ray, or the materials of a hit, waited for a load.
    pub waits: u64,
    /// Part of `loads`: chunks that had been resident before.
    pub reloads: u64,
    /// Chunks evicted.
    pub evictions: u64,
    /// Loads that failed for lack of memory and were tried again.
    pub failed_loads: u64,
    /// Bytes copied to the device for chunks, their meshes and assemblies.
    pub bytes_paged: u64,
    /// Of these, bytes that had been on the device before.
    pub reloaded_bytes: u64,
    /// Visits of rays to resident chunks, divided by all visits; 0 to 1.
    pub hit_rate: f64,
    /// Rays that wait for a chunk now.
    pub waiting_rays: u64,
    /// Paths still alive in the oldest unfinished segment now.
    pub stragglers: u64,
    /// Bytes of geometry and textures (chunks, meshes, assemblies, tiles) that are resident or loading now.
    pub geometry_bytes: u64,
    /// Hard limit of `geometry_bytes`, bytes.
    pub geometry_budget_bytes: u64,
    /// Maximum of `geometry_bytes` so far.
    pub geometry_peak_bytes: u64,
    /// Bytes of geometry in host memory that rays read across the bus.
    pub mapped_bytes: u64,
    /// True if all of the scene is on the device or in host memory that rays read, and the last paths were traced by
    /// passes that have no streaming in them.
    pub is_split: bool,
    /// Number of these passes that were compiled while others traced.
    pub compiled_ahead: u32,
    /// Number of times that passes were compiled anew because a walk needed a deeper stack than foreseen.
    pub recompilations: u32,
    /// Maximum of the device memory that this process uses according to the driver, read after a wave or a step, bytes;
    /// 0 = the driver does not report it, or is a software renderer.
    pub driver_peak_bytes: u64,
    /// Bytes that the whole scene would take on the device.
    pub scene_bytes: u64,
    /// Share of the free device memory that is in pieces too small for the largest chunk, 0 to 1, now.
    pub fragmentation: f64,
    /// Seconds during which the device traced or shaded.
    pub seconds_tracing: f64,
    /// Seconds during which a load was in flight.
    pub seconds_loading: f64,
    /// Seconds during which the device did nothing but wait for loads.
    pub seconds_waiting: f64,
    /// Seconds during which the device traced and a load was in flight at the same time.
    pub seconds_overlapped: f64,
    /// Paths not finished yet of the samples begun, now.
    pub paths_left: u64,
    /// Paths that roulette on loads has ended.
    pub roulette_paths: u64,
    /// Shadow rays that roulette on loads has ended.
    pub roulette_shadow_rays: u64,
    /// Number of loads that roulette has saved: no ray waited for the chunk any more.
    pub roulette_loads_saved: u64,
    /// Part of `scene_bytes` that is textures.
    pub texture_scene_bytes: u64,
    /// Of `geometry_bytes`, bytes of tiles of textures on the device now.
    pub texture_bytes: u64,
    /// Part of `loads` that is tiles of textures.
    pub texture_loads: u64,
    /// Part of `reloads` that is tiles of textures.
    pub texture_reloads: u64,
    /// Part of `bytes_paged` that is tiles of textures.
    pub texture_bytes_paged: u64,
}

impl StreamingStats {
    /// Goes on with another window of the same picture: totals add up, the rest is as it is in the end.
    pub fn go_on(&mut self, next: &Self) {
        let before = std::mem::replace(self, next.clone());
        self.in_core &= before.in_core;
        self.is_split |= before.is_split;
        for (sum, earlier) in [
            (&mut self.trees_built, before.trees_built),
            (&mut self.trees_refitted, before.trees_refitted),
            (&mut self.loads, before.loads),
            (&mut self.reloads, before.reloads),
            (&mut self.evictions, before.evictions),
            (&mut self.failed_loads, before.failed_loads),
            (&mut self.bytes_paged, before.bytes_paged),
            (&mut self.reloaded_bytes, before.reloaded_bytes),
            (&mut self.roulette_paths, before.roulette_paths),
            (&mut self.roulette_shadow_rays, before.roulette_shadow_rays),
            (&mut self.roulette_loads_saved, before.roulette_loads_saved),
            (&mut self.texture_loads, before.texture_loads),
            (&mut self.texture_reloads, before.texture_reloads),
            (&mut self.texture_bytes_paged, before.texture_bytes_paged),
        ] {
            *sum += earlier;
        }
        for (sum, earlier) in [
            (&mut self.seconds_tracing, before.seconds_tracing),
            (&mut self.seconds_loading, before.seconds_loading),
            (&mut self.seconds_waiting, before.seconds_waiting),
            (&mut self.seconds_overlapped, before.seconds_overlapped),
        ] {
            *sum += earlier;
        }
        for (most, earlier) in [
            (&mut self.chunks_touched, before.chunks_touched),
            (&mut self.geometry_peak_bytes, before.geometry_peak_bytes),
            (&mut self.driver_peak_bytes, before.driver_peak_bytes),
        ] {
            *most = earlier.max(*most);
        }
        self.compiled_ahead = before.compiled_ahead.max(self.compiled_ahead);
        self.recompilations += before.recompilations;
    }
}
