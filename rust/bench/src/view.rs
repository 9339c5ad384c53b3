// SPDX-License-Identifier: Apache-2.0
//! A scene as several benches render it: which one, from where, and with how many samples.

use super::common;
use anyhow::Result;
use oocpt_core::camera::Camera;
use oocpt_core::scene::SceneDb;
use oocpt_core::stats::RenderStats;
use oocpt_render::{RenderRequest, Session, SessionOptions};
use oocpt_scenes::{island, pictures::Pictures, woods};
use serde::Serialize;
use std::sync::Arc;

/// A scene that is made from a few numbers, which are options of a bench.
pub(crate) trait Made: clap::Args + Copy + Serialize {
    /// What reports call it.
    const NAME: &'static str;

    /// Fills an empty scene.
    fn build(&self, db: &mut SceneDb) -> Result<()>;

    /// The scene's own view of an image, pixels.
    fn camera(&self, width: u32, height: u32) -> Camera;
}

impl Made for island::Parameters {
    const NAME: &'static str = "island";

    fn build(&self, db: &mut SceneDb) -> Result<()> {
        island::build(db, self).map(drop)
    }

    fn camera(&self, width: u32, height: u32) -> Camera {
        island::camera(self, width, height)
    }
}

impl Made for woods::Parameters {
    const NAME: &'static str = "woods";

    fn build(&self, db: &mut SceneDb) -> Result<()> {
        woods::build(db, self)
    }

    fn camera(&self, width: u32, height: u32) -> Camera {
        woods::camera(width, height)
    }
}

/// Options of a bench.
#[derive(clap::Args)]
pub(crate) struct View<S: Made> {
    #[command(flatten)]
    pub(crate) scene: S,
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
pub(crate) struct Seen<S> {
    width: u32,
    height: u32,
    samples: u32,
    bounces: u32,
    scene: S,
    instances: u64,
    instanced_triangles: u64,
    chunks: u64,
    pub(crate) scene_bytes: u64,
}

impl<S: Made> View<S> {
    /// A session without a scene, on a device: an index or a part of its name.
    pub(crate) fn session(&self, device: &str) -> Session {
        let mut settings = common::plain_settings(self.samples, self.bounces, device);
        settings.host_memory_budget_mib = self.host_memory;
        settings.geometry_cache.clone_from(&self.geometry_cache);
        Session::with_options(settings, SessionOptions::default()).with_images(Arc::new(Pictures))
    }

    pub(crate) fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    pub(crate) fn request(&self) -> RenderRequest {
        common::color_request(self.width, self.height, self.scene.camera(self.width, self.height))
    }

    /// After the scene was rendered.
    pub(crate) fn seen(&self, stats: &RenderStats) -> Seen<S> {
        let Self { width, height, samples, bounces, scene, .. } = *self;
        Seen {
            width,
            height,
            samples,
            bounces,
            scene,
            instances: stats.instances,
            instanced_triangles: stats.triangles,
            chunks: stats.streaming.chunks,
            scene_bytes: stats.streaming.scene_bytes,
        }
    }
}

impl<S> std::fmt::Display for Seen<S> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { width, height, samples, bounces, instances, instanced_triangles, chunks, scene_bytes, .. } = self;
        #[expect(clippy::cast_precision_loss, reason = "a size")]
        let mib = *scene_bytes as f64 / f64::from(1 << 20);
        write!(
            f,
            "{width} x {height} px, {samples} samples, {bounces} bounces; {instances} instances, {instanced_triangles} \
             triangles of instances; {chunks} chunks, {mib:.1} MiB"
        )
    }
}
