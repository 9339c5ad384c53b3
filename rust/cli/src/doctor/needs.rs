// SPDX-License-Identifier: Apache-2.0
//! What is told about a scene.

use super::host::HostAnswer;
use anyhow::{Context as _, Result};
use oocpt_core::inventory::RenderInventory;
use serde::Serialize;

/// What a scene needs of the renderer, and what was left out for it.
#[derive(Clone, Debug, Serialize)]
pub(super) struct SceneNeeds {
    pub(super) scene: String,
    pub(super) device: String,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) pipelines: usize,
    pub(super) bytes: u64,
    /// Compiling all pipelines, one after the other, when they were first needed.
    pub(super) compile_secs: f64,
    /// Seconds that the device traced the small picture.
    pub(super) trace_secs: f64,
    pub(super) inventory: RenderInventory,
    /// What the host warned of: bad data by prim, files that are not there.
    pub(super) warnings: Vec<String>,
}

impl SceneNeeds {
    /// What a host answered about a scene.
    ///
    /// # Errors
    /// If its report has no inventory.
    pub(super) fn new(scene: &str, HostAnswer { report, warnings }: HostAnswer) -> Result<Self> {
        let inventory = report.inventory.context("the host's OocPT is older than this program: no inventory came")?;
        Ok(Self {
            scene: scene.to_owned(),
            device: report.header.device,
            width: report.header.width,
            height: report.header.height,
            pipelines: inventory.pipelines(),
            bytes: inventory.bytes(),
            compile_secs: inventory.passes.iter().map(|pass| pass.compile_secs).sum(),
            trace_secs: report.rows.last().map_or(0.0, |row| row.seconds_tracing),
            inventory,
            warnings,
        })
    }
}
