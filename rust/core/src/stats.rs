// SPDX-License-Identifier: Apache-2.0
//! What a render reports about itself. Plain data, serialisable; any thread.

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
    /// Samples per pixel wanted.
    pub samples_target: u32,
    /// Device memory in use, bytes.
    pub gpu_bytes: u64,
    /// Its maximum so far, bytes.
    pub gpu_peak_bytes: u64,
    /// Its hard limit, bytes.
    pub gpu_budget_bytes: u64,
    /// Host memory of scene data that we hold (not the host's own arrays), bytes.
    pub host_bytes: u64,
    /// The most memory that the process has held so far, the host's own data included, bytes; 0: unknown.
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
    /// One line for the user.
    pub annotation: String,
    /// Parts of the pipeline that this scene does not need and that were left out.
    pub features_left_out: Vec<String>,
    /// Passes, their seconds on the device in this render and how often they ran; only when profiled.
    #[serde(default)]
    pub passes: Vec<(String, f64, u64)>,
    /// What it consists of, and what was left out; empty until the passes are compiled.
    #[serde(default)]
    pub inventory: RenderInventory,
    /// Placements of meshes, multiplied out.
    pub instances: u64,
    /// Triangles stored once per mesh.
    pub unique_triangles: u64,
    /// Meshes that the session has built so far, or found in files.
    pub meshes_made: u64,
    /// Triangles, multiplied out.
    pub triangles: u64,
    /// Unique meshes.
    pub meshes: u64,
    /// What went on between host and device.
    #[serde(default)]
    pub streaming: StreamingStats,
    /// What the last look at the picture's error said.
    #[serde(default)]
    pub error: Option<ErrorRow>,
    /// With adaptive sampling: how the samples so far were spent.
    #[serde(default)]
    pub adaptive: Option<AdaptiveUsage>,
}

/// The picture's error at one moment; also a line of the report that `oocpt:report` names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ErrorRow {
    /// Samples of every pixel, at least.
    pub samples: u32,
    /// Since the render began, seconds; comparing with a reference is not counted.
    pub seconds: f64,
    /// Of these, while the device traced, seconds.
    pub seconds_tracing: f64,
    /// Rays traced, all kinds.
    pub rays: u64,
    /// Estimated relMSE with its interval (see [`crate::convergence`]); none while nothing can be said.
    pub estimate: Option<ErrorEstimate>,
    /// The pixels that are worst, by the same estimate: at most one of every workgroup that measured, worst first.
    pub worst: Vec<WorstPixel>,
    /// Bytes of geometry and textures sent to the device so far while rendering.
    pub bytes_paged: u64,
    /// Against the reference, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<TrueError>,
    /// No further sample was to come.
    #[serde(default)]
    pub is_last: bool,
}

/// What a render has used by its end; also a line of the report that `oocpt:report` names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct RenderUsage {
    /// Wall clock since the render began, seconds.
    pub seconds_total: f64,
    /// The most device memory that was in use, bytes.
    pub gpu_peak_bytes: u64,
    /// The most that the driver said, bytes ([`StreamingStats::driver_peak_bytes`]).
    pub driver_peak_bytes: u64,
    /// Host memory of scene data that the renderer holds, bytes.
    pub host_bytes: u64,
    /// The most memory that the process has held, bytes ([`RenderStats::host_peak_bytes`]).
    #[serde(default)]
    pub host_peak_bytes: u64,
    /// Nothing was streamed: all of the scene is on the device.
    pub in_core: bool,
    /// Bytes that all of the scene would take on the device, of these bytes of textures, and bytes of tiles of
    /// textures that are there.
    pub scene_bytes: u64,
    /// See above.
    pub texture_scene_bytes: u64,
    /// See above.
    pub texture_bytes: u64,
    /// Tiles of textures that were loaded while rendering, and their bytes; 0 where all were loaded before.
    pub texture_loads: u64,
    /// See above.
    pub texture_bytes_paged: u64,
    /// Rays traced, all kinds.
    #[serde(default)]
    pub rays_traced: u64,
    /// Chunks of the scene, loads of them and of tiles, and of these loads of what had been there before.
    #[serde(default)]
    pub chunks: u64,
    /// See above.
    #[serde(default)]
    pub loads: u64,
    /// See above.
    #[serde(default)]
    pub reloads: u64,
    /// Bytes copied to the device for them.
    #[serde(default)]
    pub bytes_paged: u64,
    /// The most bytes of geometry and textures that were on the device, and their limit; 0 where nothing was streamed.
    #[serde(default)]
    pub geometry_peak_bytes: u64,
    /// See above.
    #[serde(default)]
    pub geometry_budget_bytes: u64,
    /// Bytes of geometry and of tiles of textures that rays read in host memory.
    #[serde(default)]
    pub mapped_bytes: u64,
    /// The last paths were traced by passes without streaming ([`StreamingStats::is_split`]).
    #[serde(default)]
    pub is_split: bool,
    /// Seconds during which a load was in flight, and during which the device only waited for loads.
    #[serde(default)]
    pub seconds_loading: f64,
    /// See above.
    #[serde(default)]
    pub seconds_waiting: f64,
    /// Seconds before the first ray: reading geometry and sending it to the device, and compiling passes for the scene.
    #[serde(default)]
    pub seconds_uploading: f64,
    /// See above.
    #[serde(default)]
    pub seconds_compiling: f64,
    /// Seconds in which a scene in core waited for tiles of textures; waves traced, and waves traced again for tiles.
    #[serde(default)]
    pub seconds_texture_tiles: f64,
    /// See above.
    #[serde(default)]
    pub waves: u64,
    /// See above.
    #[serde(default)]
    pub waves_retraced: u64,
}

impl RenderUsage {
    /// What these stats say of it.
    #[must_use]
    pub fn of(stats: &RenderStats) -> Self {
        let streaming = &stats.streaming;
        Self {
            seconds_total: stats.seconds_total,
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
            ..Self::default()
        }
    }
}

/// A pixel and its relative squared error, estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct WorstPixel {
    /// From the left.
    pub x: u32,
    /// From the top.
    pub y: u32,
    /// Relative squared error.
    pub error: f64,
}

/// How a picture differs from a reference.
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

/// How the scene got to the device. Counts and seconds are totals since the render began unless they say "now".
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StreamingStats {
    /// All of the scene fits and nothing is streamed: what follows about loads and rays stays 0.
    pub in_core: bool,
    /// Chunks of the scene.
    pub chunks: u64,
    /// Placements of chunks in the top level.
    pub chunk_instances: u64,
    /// Chunks usable on the device now.
    pub resident_chunks: u64,
    /// Chunks that were resident at least once.
    pub chunks_touched: u64,
    /// Chunks whose load completed.
    pub loads: u64,
    /// Of these, chunks that had been resident before.
    pub reloads: u64,
    /// Chunks evicted.
    pub evictions: u64,
    /// Loads that failed for lack of memory and were tried again.
    pub failed_loads: u64,
    /// Bytes copied to the device for chunks, their meshes and assemblies.
    pub bytes_paged: u64,
    /// Of these, bytes that had been on the device before.
    pub reloaded_bytes: u64,
    /// Visits of rays to chunks that found the chunk resident, divided by all that wanted one; 0 to 1.
    pub hit_rate: f64,
    /// Rays that wait for a chunk now.
    pub waiting_rays: u64,
    /// Paths still alive in the oldest unfinished segment now.
    pub stragglers: u64,
    /// Bytes of geometry and textures (chunks, meshes, assemblies, tiles) on the device or on their way now.
    pub geometry_bytes: u64,
    /// Hard limit of these, bytes.
    pub geometry_budget_bytes: u64,
    /// The most `geometry_bytes` has been.
    pub geometry_peak_bytes: u64,
    /// Bytes of geometry in host memory where rays read it across the bus.
    pub mapped_bytes: u64,
    /// All of the scene is on the device or in host memory that rays read, and the last paths were traced by passes
    /// that have no streaming in them.
    pub is_split: bool,
    /// Of these passes, how many were compiled while others traced.
    pub compiled_ahead: u32,
    /// How often passes were compiled anew because a walk needs a deeper stack than foreseen.
    pub recompilations: u32,
    /// The most that the driver said, after a wave or a step, this process uses of device memory, its own share
    /// included; 0 = a driver that does not say, or a software renderer.
    pub driver_peak_bytes: u64,
    /// Bytes that the whole scene would take on the device.
    pub scene_bytes: u64,
    /// Share of the free device memory that no largest chunk fits into, 0 to 1, now.
    pub fragmentation: f64,
    /// Seconds during which the device traced or shaded.
    pub seconds_tracing: f64,
    /// Seconds during which a load was in flight.
    pub seconds_loading: f64,
    /// Seconds during which the device did nothing but wait for loads.
    pub seconds_waiting: f64,
    /// Seconds during which it traced and loaded at once.
    pub seconds_overlapped: f64,
    /// Paths not finished yet of the samples begun, now.
    pub paths_left: u64,
    /// Paths that roulette on loads has ended.
    pub roulette_paths: u64,
    /// Shadow rays that it has.
    pub roulette_shadow_rays: u64,
    /// Loads that it has saved: nobody waited for the chunk any more.
    pub roulette_loads_saved: u64,
    /// Of `scene_bytes`, bytes of textures.
    pub texture_scene_bytes: u64,
    /// Of `geometry_bytes`, bytes of tiles of textures on the device now.
    pub texture_bytes: u64,
    /// Of `loads`, tiles of textures.
    pub texture_loads: u64,
    /// Of `reloads`, tiles of textures.
    pub texture_reloads: u64,
    /// Of `bytes_paged`, bytes of tiles of textures.
    pub texture_bytes_paged: u64,
}
