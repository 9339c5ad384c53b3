// SPDX-License-Identifier: Apache-2.0
//! What a render reports about itself. Plain data, serialisable; any thread.

use serde::{Deserialize, Serialize};

use crate::scene::DroppedData;

/// A reading of a render in progress or done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stats {
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
    /// Placements of meshes, multiplied out.
    pub instances: u64,
    /// Triangles stored once per mesh.
    pub unique_triangles: u64,
    /// Triangles, multiplied out.
    pub triangles: u64,
    /// Unique meshes.
    pub meshes: u64,
}
