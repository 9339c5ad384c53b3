// SPDX-License-Identifier: Apache-2.0
//! Adaptive sampling on the device: the list of who gets samples in an epoch, and the estimates that decide the
//! next one (`oocpt_core::adaptive` decides). Made only with `oocpt:adaptiveSampling`.
//!
//! Lists and answers cross while nothing of an epoch is under way: an epoch is decided when all its samples are in the
//! film, and no path of the next one begins before. Render thread only.

use crate::device::WAVE_TIMEOUT;
use crate::error::RenderError;
use crate::sync::lock;
use crate::wave::{Wave, WavePiece};
use oocpt_abi::{AdaptiveSampling as Block, PushConstants};
use oocpt_core::adaptive::{AdaptiveSchedule, AdaptiveUsage, RING, STREAMS, VarianceEstimate};
use oocpt_gpu::{Buffer, BufferUsage, Gpu, GpuError};
use rayon::prelude::*;
use std::sync::{Arc, Mutex};

// The rows that the core gives out are those that the passes take.
const _: () = assert!(oocpt_core::adaptive::BAND_SHIFT == oocpt_abi::BAND_SHIFT, "rows of bands differ");

/// See the module.
#[derive(Debug)]
pub(crate) struct AdaptiveBuffers {
    gpu: Arc<Gpu>,
    pixels: u64,
    block: Buffer,
    entries: Buffer,
    estimates: Buffer,
    course: Mutex<Option<AdaptiveSchedule>>,
    /// Planted: each stream decides for itself.
    #[cfg(feature = "faults")]
    pub(crate) is_naive: bool,
}

impl AdaptiveBuffers {
    /// Memory for an image of so many pixels: 80 bytes each.
    pub(crate) fn new(gpu: &Arc<Gpu>, pixels: u64) -> Result<Self, GpuError> {
        let streams = pixels * STREAMS as u64;
        Ok(Self {
            gpu: Arc::clone(gpu),
            pixels,
            block: Buffer::new(gpu, "adaptive", size_of::<Block>() as u64, BufferUsage::Device)?,
            entries: Buffer::new(gpu, "entries", streams * 8, BufferUsage::Device)?,
            estimates: Buffer::new(gpu, "estimates", streams * 4 * u64::from(RING), BufferUsage::Device)?,
            course: Mutex::new(None),
            #[cfg(feature = "faults")]
            is_naive: false,
        })
    }

    /// Address of the block.
    pub(crate) fn address(&self) -> u64 {
        self.block.address()
    }

    /// What is made for it on the device, apart from the film.
    pub(crate) fn buffers(&self) -> impl Iterator<Item = &Buffer> {
        [&self.block, &self.entries, &self.estimates].into_iter()
    }

    /// Begins a render with its first epoch.
    pub(crate) fn begin(&mut self, size: [u32; 2], samples: u32) -> Result<(), RenderError> {
        let course = AdaptiveSchedule::new(size, samples);
        self.send(&course)?;
        *lock(&self.course) = Some(course);
        Ok(())
    }

    /// Goes on to the next epoch, if there is one.
    pub(crate) fn advance(&self) -> Result<(), RenderError> {
        let mut course = lock(&self.course);
        let Some(course) = course.as_mut() else { return Ok(()) };
        let estimates = self.answers(course.decisive())?;
        let estimates = [estimates[0].as_slice(), estimates[1].as_slice()];
        #[cfg(feature = "faults")]
        let goes_on = if self.is_naive { course.advance_by(estimates) } else { course.advance(estimates) };
        #[cfg(not(feature = "faults"))]
        let goes_on = course.advance(estimates);
        if goes_on {
            let spent = course.spent();
            tracing::debug!(?spent, bands = course.epoch().bands.len(), "next epoch");
            self.send(course)?;
        }
        Ok(())
    }

    /// Estimates by the first samples up to an octave, by stream and pixel.
    fn answers(&self, octave: u32) -> Result<[Vec<VarianceEstimate>; STREAMS], RenderError> {
        let bytes = self.pixels * STREAMS as u64 * 4;
        let target = Buffer::new(&self.gpu, "answers", bytes, BufferUsage::Readback)?;
        let mut commands = self.gpu.commands("answers")?;
        commands.copy(&self.estimates, u64::from(octave % RING) * bytes, &target, 0, bytes);
        if !commands.submit()?.wait(WAVE_TIMEOUT)? {
            return Err(RenderError::Internal("the estimates of the samples did not come".into()));
        }
        Ok(target.map(|bytes| {
            let (one, other) = bytes.split_at(bytes.len() / 2);
            [one, other].map(|half| {
                half.par_chunks_exact(4)
                    .map(|word| VarianceEstimate::unpack(bytemuck::pod_read_unaligned(word)))
                    .collect()
            })
        })?)
    }

    /// Sends the list of an epoch.
    fn send(&self, course: &AdaptiveSchedule) -> Result<(), RenderError> {
        let epoch = course.epoch();
        let bytes: &[u8] = bytemuck::cast_slice(&epoch.entries);
        let mut block =
            Block { entries: self.entries.address(), estimates: self.estimates.address(), ..Block::default() };
        for (width, band) in block.width.iter_mut().zip(&epoch.bands) {
            *width = band.width;
        }
        if epoch.bands.len() > block.width.len() {
            return Err(RenderError::Internal("an epoch has more bands than the passes know".into()));
        }
        let staging = Buffer::new(&self.gpu, "entries to send", (bytes.len() as u64).max(8), BufferUsage::Upload)?;
        staging.write(0, bytes)?;
        let mut commands = self.gpu.commands("entries")?;
        commands.copy(&staging, 0, &self.entries, 0, bytes.len() as u64);
        commands.update(&self.block, 0, bytemuck::bytes_of(&block));
        if !commands.submit()?.wait(WAVE_TIMEOUT)? {
            return Err(RenderError::Internal("the list of an epoch was not taken".into()));
        }
        Ok(())
    }

    /// Whether samples of the epoch under way will decide where others go. What happens to both streams at once, as
    /// roulette on loads does, must not happen to those: the counts of one stream would depend on its own samples.
    pub(crate) fn decides_more(&self) -> bool {
        lock(&self.course).as_ref().is_some_and(|course| !course.is_last())
    }

    /// One behind the last path that is decided.
    pub(crate) fn end(&self) -> u64 {
        lock(&self.course).as_ref().map_or(0, |course| course.epoch().end)
    }

    /// Paths that no wave may go across: the ends of the bands.
    pub(crate) fn cuts(&self) -> Vec<u64> {
        lock(&self.course).iter().flat_map(|course| course.epoch().bands.iter().map(|band| band.end())).collect()
    }

    /// What has been spent when the epoch under way is done.
    pub(crate) fn spent(&self) -> Option<AdaptiveUsage> {
        lock(&self.course).as_ref().map(AdaptiveSchedule::spent)
    }

    /// The push constants of a wave, which is in one band; and the entries of that.
    pub(crate) fn push(&self, frame: u64, wave: Wave) -> (PushConstants, u32) {
        let course = lock(&self.course);
        let bands = course.as_ref().map_or(&[][..], |course| course.epoch().bands.as_slice());
        let found = (0_u32..).zip(bands).find(|(_, band)| (band.first..band.end()).contains(&wave.first));
        let Some((number, band)) = found else { return (PushConstants::wave(frame, 0, 0, 1), 0) };
        let push = PushConstants::wave(frame, wave.first - band.first, wave.count, band.width);
        (push.in_band(number, band.row), band.width)
    }

    /// The wave as one piece, but for what is beyond `end`; it completes an octave when an epoch ends with it.
    pub(crate) fn piece(&self, wave: Wave, end: u64) -> Option<WavePiece> {
        let left = end.saturating_sub(wave.first).min(u64::from(wave.count));
        let count = u32::try_from(left).unwrap_or(u32::MAX);
        let course = lock(&self.course);
        let epoch = course.as_ref()?.epoch();
        let completes = (wave.first + left == epoch.end).then_some(epoch.octave);
        (count > 0).then_some(WavePiece { wave: Wave { first: wave.first, count }, offset: 0, completes })
    }
}
