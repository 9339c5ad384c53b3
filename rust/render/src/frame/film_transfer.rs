// SPDX-License-Identifier: Apache-2.0
//! The way of the film's records between device and host, a few MiB at a time. Nothing else is under way meanwhile.

use crate::device::WAVE_TIMEOUT;
use oocpt_gpu::{Buffer, BufferUsage, CommandList, Gpu, GpuError};
use std::ops::Range;
use std::sync::Arc;

/// Bytes of the buffer in which records lie on their way.
const STAGED: u64 = 8 << 20;

/// See the module.
#[derive(Debug)]
pub(crate) struct FilmTransfer {
    gpu: Arc<Gpu>,
    staged: Buffer,
}

impl FilmTransfer {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self, GpuError> {
        let staged = Buffer::new(gpu, "film transfer", STAGED, BufferUsage::Readback)?;
        Ok(Self { gpu: Arc::clone(gpu), staged })
    }

    fn run(&self, record: impl FnOnce(&mut CommandList)) -> Result<(), GpuError> {
        let mut commands = self.gpu.commands("film transfer")?;
        record(&mut commands);
        if !commands.submit()?.wait(WAVE_TIMEOUT)? {
            return Err(GpuError::Usage {
                name: self.staged.name().to_owned(),
                message: format!("a copy did not finish within {} s", WAVE_TIMEOUT.as_secs()),
            });
        }
        Ok(())
    }

    /// Copies a range of a buffer.
    pub(crate) fn take(&self, source: &Buffer, range: Range<u64>, bytes: &mut Vec<u8>) -> Result<(), GpuError> {
        bytes.resize(usize::try_from(range.end - range.start).unwrap_or(usize::MAX), 0);
        let mut at = range.start;
        for chunk in bytes.chunks_mut(usize::try_from(STAGED).unwrap_or(usize::MAX)) {
            self.run(|commands| commands.copy(source, at, &self.staged, 0, chunk.len() as u64))?;
            self.staged.read(0, chunk)?;
            at += chunk.len() as u64;
        }
        Ok(())
    }

    /// Puts bytes at the beginning of a buffer.
    pub(crate) fn put(&self, target: &Buffer, bytes: &[u8]) -> Result<(), GpuError> {
        let staged = Buffer::new(&self.gpu, "film upload", STAGED.min(bytes.len() as u64), BufferUsage::Upload)?;
        let mut at = 0;
        for chunk in bytes.chunks(usize::try_from(STAGED).unwrap_or(usize::MAX)) {
            staged.write(0, chunk)?;
            self.run(|commands| commands.copy(&staged, 0, target, at, chunk.len() as u64))?;
            at += chunk.len() as u64;
        }
        Ok(())
    }

    /// Writes zeros to a range of a buffer.
    pub(crate) fn clear(&self, target: &Buffer, range: Range<u64>) -> Result<(), GpuError> {
        self.run(|commands| commands.fill(target, range.start, range.end - range.start, 0))
    }
}
