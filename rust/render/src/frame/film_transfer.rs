// SPDX-License-Identifier: Apache-2.0
//! The way of the film's records between device and host, a few MiB at a time. Nothing else is under way meanwhile.

use crate::device::WAVE_TIMEOUT;
use oocpt_gpu::{Buffer, BufferUsage, CommandList, Gpu, GpuError, Submission};
use rayon::prelude::*;
use std::sync::Arc;

/// Bytes of a buffer in which records lie on their way; there are two.
const STAGED: usize = 4 << 20;
/// Bytes that a thread copies at a time.
const PORTION: usize = 256 << 10;

/// See the module.
#[derive(Debug)]
pub(crate) struct FilmTransfer {
    gpu: Arc<Gpu>,
    staged: [Buffer; 2],
}

impl FilmTransfer {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self, GpuError> {
        let staged = || Buffer::new(gpu, "film transfer", STAGED as u64, BufferUsage::Readback);
        Ok(Self { gpu: Arc::clone(gpu), staged: [staged()?, staged()?] })
    }

    fn submit(&self, record: impl FnOnce(&mut CommandList)) -> Result<Submission, GpuError> {
        let mut commands = self.gpu.commands("film transfer")?;
        record(&mut commands);
        commands.submit()
    }

    fn run(&self, record: impl FnOnce(&mut CommandList)) -> Result<(), GpuError> {
        self.wait(&self.submit(record)?)
    }

    fn wait(&self, submission: &Submission) -> Result<(), GpuError> {
        if submission.wait(WAVE_TIMEOUT)? {
            return Ok(());
        }
        let message = format!("a copy did not finish within {} s", WAVE_TIMEOUT.as_secs());
        Err(GpuError::Usage { name: self.staged[0].name().to_owned(), message })
    }

    /// Copies from place `at` of a buffer. The device fills one staging buffer while the host empties the other.
    pub(crate) fn take(&self, source: &Buffer, mut at: u64, bytes: &mut [u8]) -> Result<(), GpuError> {
        let mut filled: Option<(Submission, &Buffer, &mut [u8])> = None;
        for (staged, chunk) in self.staged.iter().cycle().zip(bytes.chunks_mut(STAGED)) {
            let submission = self.submit(|commands| commands.copy(source, at, staged, 0, chunk.len() as u64))?;
            at += chunk.len() as u64;
            if let Some((earlier, staged, chunk)) = filled.replace((submission, staged, chunk)) {
                self.empty(&earlier, staged, chunk)?;
            }
        }
        filled.map_or(Ok(()), |(last, staged, chunk)| self.empty(&last, staged, chunk))
    }

    /// Copies the first bytes of a buffer, all of it at most, to `bytes`, which get as long.
    pub(crate) fn take_all(&self, source: &Buffer, length: u64, bytes: &mut Vec<u8>) -> Result<(), GpuError> {
        let length = usize::try_from(length.min(source.size())).unwrap_or(usize::MAX);
        if bytes.len() != length {
            // Zeroed by the system as it is touched, not here.
            *bytes = vec![0; length];
        }
        self.take(source, 0, bytes)
    }

    /// Copies what a submission put into a staging buffer; all threads copy, which also spreads the page faults of
    /// memory that is new.
    fn empty(&self, submission: &Submission, staged: &Buffer, chunk: &mut [u8]) -> Result<(), GpuError> {
        self.wait(submission)?;
        let portions = chunk.par_chunks_mut(PORTION).enumerate();
        portions.into_par_iter().try_for_each(|(number, portion)| staged.read((number * PORTION) as u64, portion))
    }

    /// Puts bytes at the beginning of a buffer.
    pub(crate) fn put(&self, target: &Buffer, bytes: &[u8]) -> Result<(), GpuError> {
        let staged = Buffer::new(&self.gpu, "film upload", STAGED.min(bytes.len()) as u64, BufferUsage::Upload)?;
        let mut at = 0;
        for chunk in bytes.chunks(STAGED) {
            staged.write(0, chunk)?;
            self.run(|commands| commands.copy(&staged, 0, target, at, chunk.len() as u64))?;
            at += chunk.len() as u64;
        }
        Ok(())
    }

    /// Writes zeros from place `at` of a buffer on.
    pub(crate) fn clear(&self, target: &Buffer, at: u64) -> Result<(), GpuError> {
        self.run(|commands| commands.fill(target, at, target.size() - at, 0))
    }
}
