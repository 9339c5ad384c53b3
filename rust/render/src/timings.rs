// SPDX-License-Identifier: Apache-2.0
//! Where the time of a render went, for benches and reports.

use oocpt_core::stats::RenderUsage;

/// GPU time of one pass over a whole render; only measured when the session profiles.
#[derive(Clone, Debug, PartialEq)]
pub struct PassTime {
    /// The pass's name, which is also its shader's file name.
    pub name: String,
    /// Seconds of GPU time, all waves together.
    pub secs: f64,
    /// Times it ran.
    pub runs: u64,
}

/// A moment of a render that streams.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LeftMoment {
    /// Since the first sample was begun.
    pub seconds: f64,
    /// Paths not finished yet.
    pub paths_left: u64,
    /// Loads that completed since the render began, tiles of textures among them.
    pub loads: u64,
    /// Their bytes.
    pub bytes_paged: u64,
}

/// Where the time of the current or last render went.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderTimings {
    /// Making meshes, instance records and tables ready and handing them to the device, seconds.
    pub upload_secs: f64,
    /// Filling the tables that rays go through, seconds.
    pub build_secs: f64,
    /// Waiting for tiles of textures that waves had asked for, in core, seconds.
    pub tile_secs: f64,
    /// Tiles that came so.
    pub tiles: u64,
    /// Their bytes.
    pub tile_bytes: u64,
    /// Waves of which paths were traced again when their tiles were there.
    pub retraced_waves: u64,
    /// Compiling the passes for this scene, seconds; zero when they were compiled before.
    pub compile_secs: f64,
    /// Pipelines that the driver was made to translate before the first wave: on a software renderer, those that were
    /// never used.
    pub translated: u64,
    /// From the first wave's submission to the last wave's end, seconds.
    pub trace_secs: f64,
    /// Times that the tables of lights were made and sent: none where the lights are those of the frame before.
    pub light_tables: u64,
    /// Bytes uploaded.
    pub uploaded_bytes: u64,
    /// Camera and bounce rays traced.
    pub closest_rays: u64,
    /// Shadow rays traced.
    pub shadow_rays: u64,
    /// Paths started.
    pub paths: u64,
    /// Waves submitted.
    pub waves: u64,
    /// How the paths ran out: the first moments at which at most 50, 10, 1, 0.1, 0.01, 0 % of them were left, and
    /// others. Only when streaming.
    pub left: Vec<LeftMoment>,
    /// GPU time by pass.
    pub passes: Vec<PassTime>,
}

impl RenderTimings {
    /// `usage` with what these timings say of it.
    pub(crate) fn add_to(&self, usage: RenderUsage) -> RenderUsage {
        RenderUsage {
            seconds_uploading: self.upload_secs,
            seconds_compiling: self.compile_secs,
            seconds_texture_tiles: self.tile_secs,
            waves: self.waves,
            waves_retraced: self.retraced_waves,
            ..usage
        }
    }

    /// Adds one measured pass.
    pub(crate) fn add_pass(&mut self, name: &str, secs: f64) {
        match self.passes.iter_mut().find(|pass| pass.name == name) {
            Some(pass) => {
                pass.secs += secs;
                pass.runs += 1;
            }
            None => self.passes.push(PassTime { name: name.into(), secs, runs: 1 }),
        }
    }
}
