// SPDX-License-Identifier: Apache-2.0
//! The time that the parts of a render took, for benches and reports.

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

/// The state of a streamed render at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LeftMoment {
    /// Seconds since the first sample was begun.
    pub seconds: f64,
    /// Paths not finished yet.
    pub paths_left: u64,
    /// Loads that completed since the render began, tiles of textures among them.
    pub loads: u64,
    /// Bytes of these loads.
    pub bytes_paged: u64,
}

/// Trees over records of instances that were made for the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LevelCounts {
    /// Built from the boxes of their records.
    pub built: u64,
    /// Refitted: of the shape that they had before their records moved.
    pub refitted: u64,
    /// Records of these.
    pub refitted_records: u64,
    /// Of these, the records that the device placed by itself.
    pub placed_records: u64,
    /// Of the refitted ones, those whose records have moved so far that they wait to be built.
    pub worn: u64,
}

/// The time and counts of the current or last render.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderTimings {
    /// Seconds for preparing meshes, instance records and tables and handing them to the device.
    pub upload_secs: f64,
    /// Seconds for filling the tables that rays traverse.
    pub build_secs: f64,
    /// Seconds of waiting for tiles of textures that waves had asked for, in core.
    pub tile_secs: f64,
    /// Tiles of textures that were loaded in these waits.
    pub tiles: u64,
    /// Bytes of these tiles.
    pub tile_bytes: u64,
    /// Waves with paths that were traced again when their tiles had come.
    pub retraced_waves: u64,
    /// Seconds for compiling the passes for this scene; zero if they were compiled before.
    pub compile_secs: f64,
    /// Pipelines warmed up before the first wave: with a software driver, those that no submission had used.
    pub warmed_up_pipelines: u64,
    /// From the first wave's submission to the last wave's end, seconds.
    pub trace_secs: f64,
    /// Times that the tables of lights were made and sent: none where the lights are those of the frame before.
    pub light_tables: u64,
    /// Meshes, assemblies and chunks that were listed to find what the device lacks: none of a scene that it has, few
    /// after an edit in core.
    pub listed_assets: u64,
    /// Bytes of the scene's tables that were written in core, but for tiles of textures.
    pub table_bytes: u64,
    /// Bytes uploaded.
    pub uploaded_bytes: u64,
    /// Trees over records of instances.
    pub levels: LevelCounts,
    /// Camera and bounce rays traced.
    pub closest_rays: u64,
    /// Shadow rays traced.
    pub shadow_rays: u64,
    /// Paths started.
    pub paths: u64,
    /// Of pixels that a moved window had anew, paths that brought them to the samples of the others.
    pub caught_up_paths: u64,
    /// Waves submitted.
    pub waves: u64,
    /// The number of unfinished paths over time: the first moments at which at most 50, 10, 1, 0.1, 0.01, 0 % of them
    /// were left, and others. Only when streaming.
    pub left: Vec<LeftMoment>,
    /// GPU time by pass.
    pub passes: Vec<PassTime>,
}

impl RenderTimings {
    /// Adds the figures of these timings to `usage`.
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

    /// Adds the figures of a render that was another part of the same one.
    pub(crate) fn go_on(&mut self, next: Self) {
        self.upload_secs += next.upload_secs;
        self.build_secs += next.build_secs;
        self.tile_secs += next.tile_secs;
        self.tiles += next.tiles;
        self.tile_bytes += next.tile_bytes;
        self.retraced_waves += next.retraced_waves;
        self.compile_secs += next.compile_secs;
        self.warmed_up_pipelines += next.warmed_up_pipelines;
        self.trace_secs += next.trace_secs;
        self.light_tables += next.light_tables;
        self.listed_assets += next.listed_assets;
        self.table_bytes += next.table_bytes;
        self.uploaded_bytes += next.uploaded_bytes;
        self.levels.built += next.levels.built;
        self.levels.refitted += next.levels.refitted;
        self.levels.refitted_records += next.levels.refitted_records;
        self.levels.worn += next.levels.worn;
        self.closest_rays += next.closest_rays;
        self.shadow_rays += next.shadow_rays;
        self.paths += next.paths;
        self.waves += next.waves;
        self.left = next.left;
        for PassTime { name, secs, runs } in next.passes {
            match self.passes.iter_mut().find(|pass| pass.name == name) {
                Some(pass) => (pass.secs, pass.runs) = (pass.secs + secs, pass.runs + runs),
                None => self.passes.push(PassTime { name, secs, runs }),
            }
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
