// SPDX-License-Identifier: Apache-2.0
//! Adaptive sampling on the device: the list of the pixels that get samples in an epoch, and the variance estimates
//! from which `oocpt_core::adaptive` decides the next epoch. Made only with `oocpt:adaptiveSampling`.
//!
//! Lists and estimates are copied only between epochs: an epoch is decided when all its samples are in the film, and no
//! path of the next one begins before. Render thread only.

use crate::device::WAVE_TIMEOUT;
use crate::error::RenderError;
use crate::sync::lock;
use crate::wave::{Wave, WavePiece};
use oocpt_abi::{AdaptiveSampling as Block, ESTIMATE_RING, PushConstants};
use oocpt_core::adaptive::{AdaptiveSchedule, AdaptiveUsage, STREAMS, VarianceEstimate};
use oocpt_gpu::{Buffer, BufferUsage, Gpu, GpuError};
use rayon::prelude::*;
use std::sync::{Arc, Mutex};

/// See the module.
#[derive(Debug)]
pub(crate) struct AdaptiveBuffers {
    gpu: Arc<Gpu>,
    pixels: u64,
    block: Buffer,
    entries: Buffer,
    estimates: Buffer,
    schedule: Mutex<Option<AdaptiveSchedule>>,
    /// Planted: each stream decides for itself.
    #[cfg(feature = "faults")]
    pub(crate) is_naive: bool,
}

impl AdaptiveBuffers {
    /// Bytes of device memory for each pixel.
    pub(crate) const BYTES: u64 = STREAMS as u64 * (8 + 4 * ESTIMATE_RING as u64);

    /// Memory for an image of so many pixels, [`Self::BYTES`] each.
    pub(crate) fn new(gpu: &Arc<Gpu>, pixels: u64) -> Result<Self, GpuError> {
        let streams = pixels * STREAMS as u64;
        Ok(Self {
            gpu: Arc::clone(gpu),
            pixels,
            block: Buffer::new(gpu, "adaptive", size_of::<Block>() as u64, BufferUsage::Device)?,
            entries: Buffer::new(gpu, "entries", streams * 8, BufferUsage::Device)?,
            estimates: Buffer::new(gpu, "estimates", streams * 4 * u64::from(ESTIMATE_RING), BufferUsage::Device)?,
            schedule: Mutex::new(None),
            #[cfg(feature = "faults")]
            is_naive: false,
        })
    }

    /// Device address of the block that the passes read.
    pub(crate) fn address(&self) -> u64 {
        self.block.address()
    }

    /// The device buffers of adaptive sampling, apart from the film.
    pub(crate) fn buffers(&self) -> impl Iterator<Item = &Buffer> {
        [&self.block, &self.entries, &self.estimates].into_iter()
    }

    /// Begins a render with its first epoch.
    pub(crate) fn begin(&mut self, size: [u32; 2], samples: u32) -> Result<(), RenderError> {
        let schedule = AdaptiveSchedule::new(size, samples);
        self.send(&schedule)?;
        *lock(&self.schedule) = Some(schedule);
        Ok(())
    }

    /// Goes on to the next epoch, if there is one.
    pub(crate) fn advance(&self) -> Result<(), RenderError> {
        let mut schedule = lock(&self.schedule);
        let Some(schedule) = schedule.as_mut() else { return Ok(()) };
        let estimates = self.answers(schedule.deciding_octave())?;
        let estimates = [estimates[0].as_slice(), estimates[1].as_slice()];
        #[cfg(feature = "faults")]
        let goes_on = if self.is_naive { schedule.advance_by(estimates) } else { schedule.advance(estimates) };
        #[cfg(not(feature = "faults"))]
        let goes_on = schedule.advance(estimates);
        if goes_on {
            let usage = schedule.usage();
            tracing::debug!(?usage, bands = schedule.epoch().bands.len(), "next epoch");
            self.send(schedule)?;
        }
        Ok(())
    }

    /// Reads the variance estimates of the samples up to an octave, by stream and pixel.
    fn answers(&self, octave: u32) -> Result<[Vec<VarianceEstimate>; STREAMS], RenderError> {
        let bytes = self.pixels * STREAMS as u64 * 4;
        let target = Buffer::new(&self.gpu, "answers", bytes, BufferUsage::Readback)?;
        let mut commands = self.gpu.commands("answers")?;
        commands.copy(&self.estimates, u64::from(octave % ESTIMATE_RING) * bytes, &target, 0, bytes);
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
    fn send(&self, schedule: &AdaptiveSchedule) -> Result<(), RenderError> {
        let epoch = schedule.epoch();
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

    /// Returns true if samples of the epoch under way will decide where others go. What happens to both streams at
    /// once, as roulette on loads does, must not happen to those: the counts of one stream would depend on its own
    /// samples.
    pub(crate) fn decides_more(&self) -> bool {
        lock(&self.schedule).as_ref().is_some_and(|schedule| !schedule.is_last())
    }

    /// One behind the last path that is decided.
    pub(crate) fn end(&self) -> u64 {
        lock(&self.schedule).as_ref().map_or(0, |schedule| schedule.epoch().end)
    }

    /// Paths that no wave may go across: the ends of the bands.
    pub(crate) fn cuts(&self) -> Vec<u64> {
        lock(&self.schedule).iter().flat_map(|schedule| schedule.epoch().bands.iter().map(|band| band.end())).collect()
    }

    /// How samples are spent when the epoch under way is done.
    pub(crate) fn usage(&self) -> Option<AdaptiveUsage> {
        lock(&self.schedule).as_ref().map(AdaptiveSchedule::usage)
    }

    /// The push constants of a wave, which lies in one band, and the number of that band's entries.
    pub(crate) fn push(&self, frame: u64, wave: Wave) -> (PushConstants, u32) {
        let schedule = lock(&self.schedule);
        let bands = schedule.as_ref().map_or(&[][..], |schedule| schedule.epoch().bands.as_slice());
        let found = (0_u32..).zip(bands).find(|(_, band)| (band.first..band.end()).contains(&wave.first));
        let Some((number, band)) = found else { return (PushConstants::wave(frame, 0, 0, 1), 0) };
        let push = PushConstants::wave(frame, wave.first - band.first, wave.count, band.width);
        (push.in_band(number, band.row), band.width)
    }

    /// The wave as one piece, cut off at `end`; it completes an octave if an epoch ends with it.
    pub(crate) fn piece(&self, wave: Wave, end: u64) -> Option<WavePiece> {
        let left = end.saturating_sub(wave.first).min(u64::from(wave.count));
        let count = u32::try_from(left).unwrap_or(u32::MAX);
        let schedule = lock(&self.schedule);
        let epoch = schedule.as_ref()?.epoch();
        let completes = (wave.first + left == epoch.end).then_some(epoch.octave);
        (count > 0).then_some(WavePiece { wave: Wave { first: wave.first, count }, offset: 0, completes })
    }
}
