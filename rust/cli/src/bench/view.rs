// SPDX-License-Identifier: Apache-2.0
//! The island as several benches render it: which one, from where, and with how many samples.

use super::common;
use crate::scene::island::{self, Parameters};
use oocpt_core::stats::Stats;
use oocpt_render::{RenderRequest, Session, SessionOptions};
use serde::Serialize;

/// Options of a bench.
#[derive(clap::Args)]
pub(crate) struct View {
    #[command(flatten)]
    pub(crate) island: Parameters,
    /// Image width, pixels.
    #[arg(long, default_value_t = 1024)]
    width: u32,
    /// Image height, pixels.
    #[arg(long, default_value_t = 429)]
    height: u32,
    /// Samples per pixel.
    #[arg(long, default_value_t = 64)]
    pub(crate) samples: u32,
    /// Indirect bounces.
    #[arg(long, default_value_t = 5)]
    bounces: u32,
    /// Host memory for built meshes and while streaming, MiB (`oocpt:hostMemoryBudget`); 0 = as much as is free.
    #[arg(long, default_value_t = 0)]
    host_memory: u32,
    /// Folder in which built meshes are kept (`oocpt:geometryCache`); 0 = none; empty = what memory has no room for.
    #[arg(long, default_value = "")]
    geometry_cache: String,
}

/// What a report says of it.
#[derive(Debug, Serialize)]
pub(crate) struct Seen {
    width: u32,
    height: u32,
    samples: u32,
    bounces: u32,
    instances: u64,
    unique_quads: u64,
    copies: u32,
    flatten: bool,
    distinct: bool,
    seed: u64,
    chunks: u64,
    pub(crate) scene_bytes: u64,
}

impl View {
    /// A session without a scene, on a device: an index or a part of its name.
    pub(crate) fn session(&self, device: &str) -> Session {
        let mut settings = common::plain_settings(self.samples, self.bounces, device);
        settings.host_memory_budget_mib = self.host_memory;
        settings.geometry_cache.clone_from(&self.geometry_cache);
        Session::with_options(settings, SessionOptions::default())
    }

    pub(crate) fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    pub(crate) fn request(&self) -> RenderRequest {
        common::color_request(self.width, self.height, island::camera(&self.island, self.width, self.height))
    }

    /// After the scene was rendered.
    pub(crate) fn seen(&self, stats: &Stats) -> Seen {
        let Self { width, height, samples, bounces, .. } = *self;
        let Parameters { unique_quads, copies, flatten, distinct, seed, .. } = self.island;
        let (instances, chunks, scene_bytes) = (stats.instances, stats.streaming.chunks, stats.streaming.scene_bytes);
        Seen {
            width,
            height,
            samples,
            bounces,
            instances,
            unique_quads,
            copies,
            flatten,
            distinct,
            seed,
            chunks,
            scene_bytes,
        }
    }
}

impl std::fmt::Display for Seen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { width, height, samples, bounces, instances, unique_quads, chunks, scene_bytes, .. } = self;
        #[expect(clippy::cast_precision_loss, reason = "a size")]
        let mib = *scene_bytes as f64 / f64::from(1 << 20);
        write!(
            f,
            "{width} x {height} px, {samples} samples, {bounces} bounces; {instances} instances, {unique_quads} unique \
             quads; {chunks} chunks, {mib:.1} MiB"
        )
    }
}
