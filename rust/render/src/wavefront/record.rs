// SPDX-License-Identifier: Apache-2.0
//! Records the work of the device on paths, from the camera to the film.
//!
//! A round is [`WavefrontRecorder::trace`], then [`WavefrontRecorder::shade`]. A wave in core has all its rounds one
//! after the other; a step of streaming has some, between waking rays and counting demand (`streaming/record.rs`).
//! Passes that a frame does not have are skipped.

use super::{NativeTraversal, TracedRays, WavefrontPasses};
use crate::film::{Film, error_groups};
use crate::wave::Wave;
use oocpt_abi::{
    AOV_ESCAPED, AOV_SURFACES, PREPARE_RESOLVE, PREPARE_SETTLE, PREPARE_SHADE, PREPARE_TRACE, PushConstants, PushFlags,
    WavefrontCounters, groups,
};
use oocpt_gpu::{Buffer, CommandList};
use oocpt_shaders::{DispatchSize, Pass};

/// The purpose of paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PathKind {
    /// First hits through pixel centres; a path is a pixel.
    Aovs,
    /// Samples of the colour.
    Samples,
}

/// See the module.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WavefrontRecorder<'a> {
    pub(crate) passes: &'a WavefrontPasses,
    pub(crate) film: &'a Film,
    pub(crate) counters: &'a Buffer,
    /// Device address of the frame block.
    pub(crate) frame: u64,
    pub(crate) pixels: u32,
    /// Native traversal, if the host walks the rays.
    pub(crate) native: Option<NativeTraversal<'a>>,
}

impl WavefrontRecorder<'_> {
    /// The push constants of passes over all paths in flight.
    pub(crate) fn push(&self, kind: PathKind) -> PushConstants {
        let push = PushConstants::wave(self.frame, 0, 0, self.pixels);
        if kind == PathKind::Aovs { push.flagged(PushFlags::AOVS) } else { push }
    }

    /// The push constants of passes over the paths of `wave`.
    pub(crate) fn push_of(&self, kind: PathKind, wave: Wave) -> PushConstants {
        match kind {
            PathKind::Aovs => {
                PushConstants::wave(self.frame, wave.first, wave.count, self.pixels).flagged(PushFlags::AOVS)
            }
            PathKind::Samples => self.film.push(self.frame, wave).0,
        }
    }

    /// Starts `count` paths; `push` is that of their wave or segment.
    pub(crate) fn generate(&self, commands: &mut CommandList, kind: PathKind, push: PushConstants, count: u32) {
        let pass = match kind {
            PathKind::Aovs => Pass::GenerateAovRays,
            PathKind::Samples => Pass::GenerateCameraRays,
        };
        self.direct(commands, pass, push, count);
    }

    /// Traces the rays of a round.
    pub(crate) fn trace(&self, commands: &mut CommandList, q: PushConstants, round: u32, traced: TracedRays) {
        self.direct(commands, Pass::PrepareDispatch, q.with(round, PREPARE_TRACE), 1);
        if let Some(native) = self.native {
            return native.trace(commands, q.with(round, 0), traced);
        }
        commands.concurrent(|c| {
            if traced != TracedRays::Shadow {
                self.indirect(c, Pass::IntersectClosest, q.with(round, 0));
            }
            if traced != TracedRays::Closest {
                self.indirect(c, Pass::IntersectShadow, q.with(round, 0));
            }
        });
        if self.has(Pass::SettleClosest) {
            self.direct(commands, Pass::PrepareDispatch, q.with(round, PREPARE_SETTLE), 1);
            commands.concurrent(|c| {
                self.indirect(c, Pass::SettleClosest, q.with(round, 0));
                self.indirect(c, Pass::SettleShadow, q.with(round, 0));
            });
        }
    }

    /// Shades what the rays of a round met; with streaming also those of earlier rounds whose last ray is done now.
    pub(crate) fn shade(&self, commands: &mut CommandList, kind: PathKind, q: PushConstants, round: u32) {
        let resolve = [Pass::ResolveMaterials, Pass::ResolveLights].into_iter().find(|pass| self.has(*pass));
        let first = if resolve.is_some() { PREPARE_RESOLVE } else { PREPARE_SHADE };
        commands.concurrent(|c| {
            self.direct(c, Pass::PrepareDispatch, q.with(round, first), 1);
            self.indirect(c, Pass::RecordSurfaces, q.with(round, 0));
        });
        if let Some(resolve) = resolve {
            self.indirect(commands, resolve, q.with(round, 0));
            self.direct(commands, Pass::PrepareDispatch, q.with(round, PREPARE_SHADE), 1);
        }
        // In core only the first round has camera rays; while streaming any may have some.
        let is_first = round == 0 || self.has(Pass::RecordSurfaces);
        if kind == PathKind::Aovs || is_first && self.film.filters_first_hits() {
            commands.concurrent(|c| {
                self.indirect_by(c, Pass::ShadeAovs, q.with(round, AOV_SURFACES), WavefrontCounters::SURFACE_ARGS);
                self.indirect_by(c, Pass::ShadeAovs, q.with(round, AOV_ESCAPED), WavefrontCounters::ESCAPED_ARGS);
            });
        }
        if kind == PathKind::Samples && self.film.has_light() {
            commands.concurrent(|c| {
                self.indirect(c, Pass::ShadeBackground, q.with(round, 0));
                self.indirect(c, Pass::ShadeSurface, q.with(round, 0));
            });
        }
    }

    /// Adds the samples of a wave to the film, measuring on the way; `push` is the wave's, `arg0` its first place.
    /// Returns the octaves measured.
    pub(crate) fn accumulate(&self, commands: &mut CommandList, push: PushConstants, wave: Wave) -> Vec<u32> {
        let mut octaves = Vec::new();
        for piece in self.film.pieces(wave, u64::MAX) {
            let (q, apart) = self.film.push(push.frame, piece.wave);
            let q = PushConstants { flags: push.flags, ..q }.with(push.round, push.arg0 + piece.offset);
            // It reads how many samples there were.
            commands.concurrent(|c| {
                self.direct(c, Pass::SumPlanes, q, piece.wave.count.min(apart));
                self.direct(c, Pass::RankIds, q, piece.wave.count.min(apart));
                self.direct(c, Pass::MergeDeep, q, piece.wave.count.min(apart));
            });
            commands.concurrent(|c| {
                self.direct(c, Pass::Accumulate, q, piece.wave.count.min(apart));
                self.direct(c, Pass::SumExact, q, piece.wave.count.min(apart));
            });
            if let Some(octave) = piece.completes {
                self.measure(commands, octave);
                octaves.push(octave);
            }
        }
        octaves
    }

    /// Measures the film's error; the result goes to `slot`.
    pub(crate) fn measure(&self, commands: &mut CommandList, slot: u32) {
        let groups = [error_groups(u64::from(self.pixels)), 1, 1];
        let [first_pixel, path_count] = self.film.measured();
        let push = PushConstants { first_pixel, path_count, ..self.push(PathKind::Samples) };
        self.workgroups(commands, Pass::MeasureError, push, groups);
        self.film.copy_error(commands, self.counters, slot);
    }

    /// Resolves the film to the picture, and copies all images to buffers that the host can read.
    pub(crate) fn copy_out(&self, commands: &mut CommandList) {
        if self.film.has_color() {
            commands.concurrent(|c| {
                self.direct(c, Pass::Resolve, self.push(PathKind::Samples), self.pixels);
                self.direct(c, Pass::CountSamples, self.push(PathKind::Samples), self.pixels);
                self.direct(c, Pass::ResolvePlanes, self.push(PathKind::Samples), self.pixels);
                self.direct(c, Pass::ResolveIds, self.push(PathKind::Samples), self.pixels);
                self.direct(c, Pass::ResolveDeep, self.push(PathKind::Samples), self.pixels);
                let scaled = self.push(PathKind::Samples).with(0, self.film.error_scale());
                self.direct(c, Pass::TellSpread, scaled, self.pixels);
            });
        }
        self.film.copy_out(commands, self.counters);
    }

    /// Returns true if the frame has a pass.
    pub(crate) fn has(&self, pass: Pass) -> bool {
        self.passes.get(pass).is_some()
    }

    /// Records a pass with so many threads.
    pub(crate) fn direct(&self, commands: &mut CommandList, pass: Pass, push: PushConstants, threads: u32) {
        self.workgroups(commands, pass, push, groups(u64::from(threads)));
    }

    /// Records a pass with so many workgroups.
    pub(crate) fn workgroups(&self, commands: &mut CommandList, pass: Pass, push: PushConstants, groups: [u32; 3]) {
        if let Some(pipeline) = self.passes.get(pass) {
            commands.dispatch(pipeline, bytemuck::bytes_of(&push), groups);
        }
    }

    /// Records a pass whose number of threads is in the counters, at the member that its row names.
    pub(crate) fn indirect(&self, commands: &mut CommandList, pass: Pass, push: PushConstants) {
        if let DispatchSize::Indirect(arguments) = pass.info().launch {
            self.indirect_by(commands, pass, push, arguments);
        }
    }

    fn indirect_by(&self, commands: &mut CommandList, pass: Pass, push: PushConstants, arguments: u64) {
        if let Some(pipeline) = self.passes.get(pass) {
            commands.dispatch_indirect(pipeline, bytemuck::bytes_of(&push), self.counters, arguments);
        }
    }
}
