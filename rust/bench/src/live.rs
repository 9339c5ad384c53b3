// SPDX-License-Identifier: Apache-2.0
//! A live session whose instancers are edited while a host looks: what `edits` and `moving` have in common.

use anyhow::{Context, Result, ensure};
use oocpt_core::camera::Camera;
use oocpt_core::mesh::level_node_count;
use oocpt_core::scene::{InstancerDesc, Snapshot};
use oocpt_core::settings::{SettingValue, Settings};
use oocpt_render::{RenderRequest, Session, SessionOptions};
use std::sync::Arc;
use std::time::Instant;

use super::common::{self, ReportOptions, finish};

/// Options of a live session.
#[derive(clap::Args)]
pub(crate) struct LiveOptions {
    /// Image width, pixels; one sample each, so that tracing does not hide the edit.
    #[arg(long, default_value_t = 256)]
    pub(crate) width: u32,
    /// Image height, pixels.
    #[arg(long, default_value_t = 108)]
    pub(crate) height: u32,
    /// Geometry budget, KiB; 0 = no limit.
    #[arg(long, default_value_t = 0)]
    geometry_budget: u32,
    #[command(flatten)]
    pub(crate) reported: ReportOptions,
}

/// What an edit took.
#[derive(Debug)]
pub(crate) struct EditCost {
    pub(crate) commit_secs: f64,
    /// From the edit to its first whole image, commit included.
    pub(crate) image_secs: f64,
    pub(crate) made: CommitCounts,
    pub(crate) after: Arc<Snapshot>,
}

/// What a commit made anew.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct CommitCounts {
    /// Chunks that the commit before did not have.
    pub(crate) chunks: usize,
    /// All of theirs.
    pub(crate) records: usize,
    /// Nodes of the trees of these, and of the top level where it is another one.
    pub(crate) nodes: usize,
    /// Meshes whose triangles or trees are another allocation than before.
    pub(crate) meshes: usize,
}

impl LiveOptions {
    /// A session without a scene. With `holds` chunks of what moves are held, as in a live view.
    pub(crate) fn session(&self, holds: bool) -> Result<Session> {
        let settings = Settings { interactive: holds, ..common::plain_settings(1, 1, &self.reported.device) };
        let session = Session::with_options(settings, SessionOptions::default());
        session.set_setting("oocpt:geometryBudget", SettingValue::Int(self.geometry_budget.into()))?;
        Ok(session)
    }

    /// What it shows; `camera` for a width and a height.
    pub(crate) fn request(&self, camera: impl FnOnce(u32, u32) -> Camera) -> RenderRequest {
        common::color_request(self.width, self.height, camera(self.width, self.height))
    }
}

/// Replaces an instancer, which must differ, and waits for the image.
pub(crate) fn edit(session: &Session, edited: InstancerDesc, request: RenderRequest) -> Result<EditCost> {
    let before = session.with_scene(|db| Arc::clone(db.snapshot()));
    let started = Instant::now();
    let after = session.with_scene(|db| {
        db.upsert_instancer(edited);
        db.commit().snapshot
    });
    let commit_secs = started.elapsed().as_secs_f64();
    ensure!(after.version != before.version, "the edit changed nothing");
    session.render(request);
    finish(session).context("render after an edit")?;
    let image_secs = started.elapsed().as_secs_f64();
    Ok(EditCost { commit_secs, image_secs, made: made(&before, &after), after })
}

/// What `after` has and `before` did not have.
pub(crate) fn made(before: &Snapshot, after: &Snapshot) -> CommitCounts {
    let mut known: Vec<u64> = before.world.chunks.iter().map(|chunk| chunk.key()).collect();
    known.sort_unstable();
    let new = after.world.chunks.iter().filter(|chunk| known.binary_search(&chunk.key()).is_err());
    let mut made = new.fold(CommitCounts::default(), |made, chunk| CommitCounts {
        chunks: made.chunks + 1,
        records: made.records + chunk.len(),
        nodes: made.nodes + level_node_count(chunk.len()),
        ..made
    });
    if before.world.top != after.world.top {
        made.nodes += after.world.top.nodes.len();
    }
    let same = |(old, new): (&Arc<_>, &Arc<_>)| Arc::ptr_eq(old, new);
    made.meshes = before.meshes.iter().zip(&after.meshes).filter(|pair| !same(*pair)).count();
    made
}
