// SPDX-License-Identifier: Apache-2.0
//! The path engine: one host loop for scenes that are resident as a whole and for those that stream.
//!
//! [`render`] runs the stages of a frame (first hits through pixel centres, then samples) over a [`PathSource`], which
//! says which paths go to the device next: [`WaveSource`] cuts them into waves, `streaming::Stage` into segments whose
//! rays may wait for chunks. Both record by one [`WavefrontRecorder`], with the passes and the frame block of one
//! [`WavefrontTracer`]. Render thread only.

mod drive;
mod tiles;
mod waves;

pub(crate) use drive::{InFlightSubmission, PathSource, StreamingEnd, SubmittedWork};
pub(crate) use tiles::FrameTiles;
pub(crate) use waves::WaveSource;

use crate::device::PassSpecialisation;
use crate::error::RenderError;
use crate::film::filtered::FilteredPlanes;
use crate::frame::block::frame_block;
use crate::frame::context::{FrameContext, is_cpu, limits_kinds, maps_host};
use crate::frame::inventory::{self, CompiledPasses};
use crate::frame::progress::FrameProgress;
use crate::frame::specialise;
use crate::frame::{automaton_block, camera_blocks};
use crate::job::shared::FrameGate;
use crate::job::timings::RenderTimings;
use crate::wave::LAST_SLOT;
use crate::wavefront::{NativeTraversal, PathBuffers, PathKind, TraversalBackend, WavefrontPasses, WavefrontRecorder};
use crate::{assets::SceneView, device::WAVE_TIMEOUT};
use drive::{StageOutcome, run};
use oocpt_abi::{Features, FrameConstants};
use oocpt_core::inventory::RenderInventory;
use oocpt_core::settings::TraversalKind;
use oocpt_gpu::{Buffer, BufferUsage, CommandList, Submission};

/// Where the word that cancels is in the buffer of the frame block.
const CANCELLED: u64 = size_of::<FrameConstants>() as u64;

/// What every submission of a frame refers to.
#[derive(Debug)]
pub(crate) struct WavefrontTracer<'a> {
    pub(crate) context: &'a FrameContext<'a>,
    pub(crate) paths: &'a PathBuffers,
    passes: WavefrontPasses,
    special: PassSpecialisation,
    backend: TraversalBackend,
    /// What the trace passes write.
    written: Vec<&'a Buffer>,
    /// The frame block, and behind it the word that cancels.
    frame: Buffer,
    can_cancel: bool,
    /// Keys of a camera that moves, its clipping planes, the filter of its pixels: the frame block has their addresses.
    _camera: [Option<Buffer>; 3],
    /// The automaton of light path expressions.
    _automaton: Option<Buffer>,
}

/// What a frame is compiled for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompiledFeatures {
    /// What is compiled in.
    pub(crate) features: Features,
    /// Of that, what the scene does not need.
    pub(crate) carried: Features,
}

impl CompiledFeatures {
    /// What a scene needs, and what is carried beside that.
    pub(crate) fn new(context: &FrameContext<'_>, view: &SceneView, streams: bool) -> Self {
        let FrameContext { job, lights, rays, film, .. } = *context;
        let mut needed = specialise::features(&job.snapshot, lights, rays, view);
        #[cfg(feature = "faults")]
        needed.set(
            Features::OPACITY_MASKS,
            needed.contains(Features::OPACITY_MASKS) && !job.options.faults.no_opacity_masks,
        );
        #[cfg(feature = "faults")]
        needed.insert(job.options.faults.more_features);
        needed.set(Features::CAMERA_MOTION, context.camera_motion.is_some());
        let moves = needed.intersects(Features::MOTION | Features::DEFORMATION | Features::CAMERA_MOTION);
        needed.set(Features::MOTION_VECTORS, moves && film.has_motion());
        needed.set(Features::SHADED_AOVS, film.has_shaded_planes());
        needed.set(Features::ID_RANKS, film.filtered().is_some_and(FilteredPlanes::has_ids));
        needed.set(Features::DEEP, film.filtered().is_some_and(FilteredPlanes::has_deep));
        needed.set(Features::CLIPPING, !context.clip_planes.is_empty());
        needed.set(Features::ADAPTIVE, film.adaptive().is_some());
        needed.set(Features::PIXEL_FILTER, film.has_color() && !job.settings.filter().is_plain());
        needed.set(Features::PATH_EXPRESSIONS, !film.expressions().is_empty());
        needed.set(Features::SHADOW_SUMS, film.has_shadows());
        needed.set(Features::LOAD_WAITS, film.filtered().is_some_and(FilteredPlanes::has_waits));
        needed.set(Features::BOUNCE_KINDS, limits_kinds(&job.settings));
        needed.set(Features::STREAMING, streams);
        // While streaming a ray waits for the texture of a cutout as it does for chunks.
        let walks_natively = is_cpu(context.device) && job.settings.traversal != TraversalKind::Compute;
        let defers = !streams && !walks_natively && needed.contains(Features::OPACITY_MASKS);
        #[cfg(feature = "faults")]
        let defers = defers && !job.options.faults.no_deferred_cutouts;
        if defers && view.masks_answer_most {
            needed.insert(Features::DEFERRED_CUTOUTS);
        }
        let counts = !job.settings.chunk_report.is_empty() || maps_host(context.device, &job.settings);
        needed.set(Features::CHUNK_COUNTS, streams && counts);
        needed.set(Features::ROULETTE, streams && job.settings.straggler_roulette);
        let carried = context.carry.possible(needed, context.allowed_by_lights);
        Self { features: needed | carried, carried }
    }

    /// What the passes are compiled for, and what traces.
    pub(crate) fn compiled_for(
        self,
        context: &FrameContext<'_>,
        view: &SceneView,
    ) -> Result<(PassSpecialisation, TraversalBackend), RenderError> {
        let special = specialise::specialisation(self.features, view);
        #[cfg(feature = "faults")]
        let special = PassSpecialisation { fault: context.job.options.faults.lost_chunks, ..special };
        let wanted = context.job.settings.traversal;
        Ok((special, TraversalBackend::choose(wanted, context.device, &special, view)?))
    }
}

impl<'a> WavefrontTracer<'a> {
    /// Compiles the passes and tells the stats what the frame is made of; the scene, the paths and what else there is
    /// have `listed` what they hold. `bind` writes addresses of memory into the frame block.
    pub(crate) fn new(
        context: &'a FrameContext<'a>,
        paths: &'a PathBuffers,
        (view, parts): (&SceneView, CompiledFeatures),
        mut listed: RenderInventory,
        bind: impl FnOnce(&mut FrameConstants),
        progress: &mut FrameProgress<'_>,
    ) -> Result<Self, RenderError> {
        let FrameContext { device, film, .. } = *context;
        let CompiledFeatures { features, carried } = parts;
        progress.stage("compiling passes");
        let (special, backend) = parts.compiled_for(context, view)?;
        let passes = WavefrontPasses::new(device, (special, backend), film, &mut progress.timings)?;
        let mut block = frame_block(context, view);
        [block.bsdf_tables, block.sheen_tables] = device.bsdf_tables(features)?; // before the list of what there is
        let camera = camera_blocks::upload(context, features, &mut block, &mut listed)?;
        let automaton = automaton_block::upload(context, &mut block, &mut listed)?;
        let inventory =
            inventory::of_frame(context, CompiledPasses { passes: &passes, special, carried, backend }, listed);
        progress.made_of(specialise::left_out(features, film.has_planes()), inventory);
        paths.bind(&mut block);
        bind(&mut block);
        let frame = Buffer::new(&device.gpu, "frame", CANCELLED + 4, BufferUsage::Upload)?;
        let can_cancel = context.job.settings.interactive && !features.contains(Features::STREAMING);
        if can_cancel {
            block.cancelled = frame.address() + CANCELLED;
            frame.write(CANCELLED, &[0; 4])?;
        }
        frame.write(0, bytemuck::bytes_of(&block))?;
        let written = paths.written();
        Ok(Self {
            context,
            paths,
            passes,
            special,
            backend,
            written,
            frame,
            can_cancel,
            _camera: camera,
            _automaton: automaton,
        })
    }

    /// Has rounds that the device has not begun do nothing, for a picture that is given up; false if it cannot.
    pub(crate) fn cancel(&self) -> Result<bool, RenderError> {
        if self.can_cancel {
            self.frame.write(CANCELLED, &1_u32.to_ne_bytes())?;
        }
        Ok(self.can_cancel)
    }

    /// Says what the trace passes write besides what belongs to the paths.
    pub(crate) fn traces_into(&mut self, buffers: Vec<&'a Buffer>) {
        self.written.extend(buffers);
    }

    /// Compiles the passes anew, for deeper stacks.
    pub(crate) fn deepen(&mut self, stack_size: u32, timings: &mut RenderTimings) -> Result<(), RenderError> {
        self.special.stack_size = stack_size;
        let special = (self.special, self.backend);
        self.passes = WavefrontPasses::new(self.context.device, special, self.context.film, timings)?;
        Ok(())
    }

    pub(crate) fn recorder(&self) -> WavefrontRecorder<'_> {
        let gpu = &self.context.device.gpu;
        let native = || NativeTraversal::new(gpu, &self.written, &self.special, self.backend);
        WavefrontRecorder {
            native: self.backend.is_native.then(native),
            passes: &self.passes,
            film: self.context.film,
            counters: &self.paths.counters,
            frame: self.frame.address(),
            // The request was validated: at most 2^28 pixels.
            pixels: u32::try_from(self.context.job.request.pixels()).unwrap_or(u32::MAX),
        }
    }

    pub(crate) fn commands(&self, label: &str) -> Result<CommandList, RenderError> {
        let mut commands = self.context.device.gpu.commands(label)?;
        commands.profile(self.context.job.options.profile);
        Ok(commands)
    }

    /// Publishes the images as they are, and what the film says of its error.
    fn end(&self, progress: &mut FrameProgress<'_>) -> Result<(), RenderError> {
        let film = self.context.film;
        let measures = film.has_color() && progress.ends_between_octaves();
        let mut commands = self.commands("resolve")?;
        self.recorder().copy_out(&mut commands);
        if measures || film.has_errors() {
            self.recorder().measure(&mut commands, LAST_SLOT);
        }
        finish(&commands.submit()?, progress)?;
        progress.publish_last(film)?;
        if film.has_color() {
            progress.error_at_end(film, measures)?;
        }
        if film.has_errors() {
            // The errors of the pixels are shares of what is told of the picture.
            progress.scale_errors(film)?;
            let mut commands = self.commands("resolve errors")?;
            self.recorder().copy_out(&mut commands);
            finish(&commands.submit()?, progress)?;
            progress.publish_last(film)?;
        }
        progress.finish()
    }
}

/// Runs the stages of a frame until `gate` says no; publishes images and stats on the way. Gives where another path
/// source is to go on, if this one left off.
pub(crate) fn render<F: PathSource>(
    source: &mut F,
    gate: &FrameGate<'_>,
    progress: &mut FrameProgress<'_>,
) -> Result<Option<u64>, RenderError> {
    progress.stage("rendering");
    let film = source.tracer().context.film;
    let goes_on = source.goes_on() && !progress.lacks_planes();
    let (has_planes, has_color) = (film.has_planes() && !goes_on, film.has_color());
    if has_planes || !has_color {
        // Without an image nothing is traced, but the counters that are read at the end have to be cleared.
        source.begin(PathKind::Aovs, progress)?;
    }
    if has_planes && run(source, gate, progress)? == StageOutcome::GivenUp {
        return Ok(None);
    }
    progress.has_planes();
    if has_color {
        source.begin(PathKind::Samples, progress)?;
        if !progress.has_left_off() {
            progress.trace_started();
        }
        let outcome = run(source, gate, progress)?;
        if let Some(StreamingEnd { first, counters }) = source.left_off().filter(|_| outcome == StageOutcome::Done) {
            progress.left_off(&counters);
            return Ok(Some(first));
        }
        progress.trace_ended();
    }
    if !gate.is_superseded() && !source.tracer().context.job.catches_up {
        source.tracer().end(progress)?;
    }
    source.end()?;
    Ok(None)
}

/// Waits for a submission and notes the times of its passes.
pub(crate) fn finish(submission: &Submission, progress: &mut FrameProgress<'_>) -> Result<(), RenderError> {
    if !submission.wait(WAVE_TIMEOUT)? {
        let secs = WAVE_TIMEOUT.as_secs();
        return Err(RenderError::Internal(format!("a submission did not finish within {secs} s")));
    }
    for (pass, secs) in submission.timings() {
        progress.timings.add_pass(&pass, secs);
    }
    Ok(())
}
