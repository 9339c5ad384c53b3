// SPDX-License-Identifier: Apache-2.0
//! Denoises a picture where the film has it on the device, if the denoiser reaches that memory: no image goes to the
//! host to be denoised, the denoised picture alone is copied there, as all images are.
//!
//! The colour is denoised in place: it is made of the film's sums whenever images are copied out, and nothing else
//! reads it.

use super::Film;
use crate::device::WAVE_TIMEOUT;
use crate::job::aov::AovKind;
use crate::sync::lock;
use oocpt_gpu::{
    Buffer, BufferUsage, DenoiseOptions, DenoiserDevice, DenoiserError, Gpu, GpuError, PictureBuffers, SharedFilters,
};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// How the images of a film are denoised where they are.
#[derive(Debug, Default)]
pub(super) struct FilmDenoiser {
    /// The colour is as it was made last.
    is_noisy: AtomicBool,
    state: Mutex<DenoiserState>,
}

#[derive(Debug, Default)]
struct DenoiserState {
    filters: Option<SharedFilters>,
    /// The denoised picture, where the host can read it.
    copied: Option<Buffer>,
    /// The denoiser does not reach the images, or has failed.
    is_refused: bool,
}

/// The memory of an image that a denoiser reads, if the picture is to be denoised.
pub(super) fn usage(kinds: &[AovKind], kind: AovKind) -> BufferUsage {
    let is_read = matches!(kind, AovKind::Color | AovKind::Albedo | AovKind::Normal);
    if is_read && kinds.contains(&AovKind::Denoised) { BufferUsage::Exported } else { BufferUsage::Device }
}

impl FilmDenoiser {
    /// The colour is about to be made anew.
    pub(super) fn is_made(&self) {
        self.is_noisy.store(true, Ordering::Relaxed);
    }

    /// Lends the denoised picture to `look`, if it was denoised here last.
    pub(super) fn look(&self, look: impl FnOnce(&[u8])) -> Result<(), GpuError> {
        lock(&self.state).copied.as_ref().map_or(Ok(()), |copied| copied.map(|bytes| look(bytes)))
    }
}

impl Film {
    /// Denoises the picture that was copied out last, of `size`, where it is; false if that cannot be done: then it is
    /// denoised from the host's memory.
    pub(crate) fn denoise(
        &self,
        denoiser: &DenoiserDevice,
        size: [u32; 2],
        options: DenoiseOptions,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<bool, DenoiserError> {
        let state = &mut *lock(&self.denoiser.state);
        // Another picture may be under way behind the one that was copied out, and be denoised in its place.
        if state.is_refused || !self.denoiser.is_noisy.swap(false, Ordering::Relaxed) {
            return Ok(false);
        }
        match self.denoise_shared(state, denoiser, size, options, goes_on) {
            Ok(is_done) => {
                state.is_refused = !is_done;
                Ok(is_done)
            }
            Err(InPlaceError::Denoiser(DenoiserError::Cancelled)) => Err(DenoiserError::Cancelled),
            Err(error) => {
                tracing::trace!(%error, "not denoised in place");
                *state = DenoiserState { is_refused: true, ..DenoiserState::default() };
                Ok(false)
            }
        }
    }

    fn denoise_shared(
        &self,
        state: &mut DenoiserState,
        denoiser: &DenoiserDevice,
        size: [u32; 2],
        options: DenoiseOptions,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<bool, InPlaceError> {
        let guide = |wanted| self.planes.iter().find(|(kind, _)| *kind == wanted).map(|(_, plane)| plane);
        let images = (self.color.as_ref(), guide(AovKind::Albedo), guide(AovKind::Normal));
        let (Some(color), Some(albedo), Some(normal)) = images else { return Ok(false) };
        if state.filters.as_ref().is_none_or(|filters| filters.options() != options) {
            state.filters = None;
            let picture = PictureBuffers { size: size.map(|side| side as usize), color, albedo, normal };
            state.filters = denoiser.share(&picture, options)?;
        }
        let Some(filters) = &mut state.filters else { return Ok(false) };
        self.gpu.wait_idle()?;
        filters.run(goes_on)?;
        let copied = copied(&self.gpu, &mut state.copied, color.size())?;
        let mut commands = self.gpu.commands("denoised")?;
        commands.copy(color, 0, copied, 0, color.size());
        Ok(commands.submit()?.wait(WAVE_TIMEOUT)?)
    }
}

/// The buffer for a picture of so many bytes.
fn copied<'a>(gpu: &Arc<Gpu>, have: &'a mut Option<Buffer>, bytes: u64) -> Result<&'a Buffer, GpuError> {
    match have {
        Some(buffer) => Ok(buffer),
        none => Ok(none.insert(Buffer::new(gpu, "denoised", bytes, BufferUsage::Readback)?)),
    }
}

/// Why a picture is not denoised in place.
#[derive(Debug, thiserror::Error)]
enum InPlaceError {
    #[error(transparent)]
    Denoiser(#[from] DenoiserError),
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_exported_of_what_a_denoiser_reads_and_only_where_one_is_asked_for() {
        let all = [AovKind::Color, AovKind::Albedo, AovKind::Normal, AovKind::Depth];
        assert_eq!(all.map(|kind| usage(&all, kind)), [BufferUsage::Device; 4]);
        let with = [&all[..], &[AovKind::Denoised]].concat();
        let exported = BufferUsage::Exported;
        assert_eq!(all.map(|kind| usage(&with, kind)), [exported, exported, exported, BufferUsage::Device]);
    }
}
