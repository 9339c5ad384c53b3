// SPDX-License-Identifier: Apache-2.0
//! The lights of a frame, kept for the next one of the same scene: where only the camera moved, nothing of them is
//! read, built or sent again. Render thread only.

use super::LightTable;
use crate::job::RenderJob;
use crate::job::light_files::LightFiles;
use oocpt_abi::Features;
use oocpt_core::scene::Snapshot;
use std::sync::{Arc, Weak};

/// What lights are made of. Of the snapshot only its identity is kept, not its memory.
#[derive(Clone, Debug)]
pub(crate) struct LightSource {
    snapshot: Weak<Snapshot>,
    files: Arc<dyn LightFiles>,
    has_scene_lights: bool,
    is_dome_visible: bool,
}

impl LightSource {
    pub(crate) fn of(job: &RenderJob) -> Self {
        Self {
            snapshot: Arc::downgrade(&job.snapshot),
            files: Arc::clone(&job.files),
            has_scene_lights: job.settings.enable_scene_lights,
            is_dome_visible: job.settings.dome_light_camera_visible,
        }
    }

    fn is(&self, other: &Self) -> bool {
        self.snapshot.ptr_eq(&other.snapshot)
            && Arc::ptr_eq(&self.files, &other.files)
            && self.has_scene_lights == other.has_scene_lights
            && self.is_dome_visible == other.is_dome_visible
    }
}

/// Lights whose tables are on the device.
#[derive(Debug)]
pub(crate) struct KeptLights {
    pub(crate) source: LightSource,
    pub(crate) table: LightTable,
    /// What the table has that is carried although the scene does not need it.
    pub(crate) carried: Features,
    /// What is said of them with each frame.
    pub(crate) warnings: Vec<String>,
}

impl KeptLights {
    /// Whether they serve a frame too.
    pub(crate) fn serve(&self, source: &LightSource) -> bool {
        self.source.is(source)
    }
}
