// SPDX-License-Identifier: Apache-2.0
//! Moves bytes from the host to the device through two staging buffers used in turn.
//!
//! While the device copies from one, the host fills the other. Copies become visible to everything submitted after
//! [`Uploader::finish`].

use crate::error::RenderError;
use oocpt_gpu::{Buffer, Commands, DeviceRange, Gpu, GpuError, Submission, Usage};
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

/// Size of one staging buffer, bytes.
const STAGING_BYTES: usize = 16 << 20;
/// How long a copy of one staging buffer may take before the device counts as lost.
const COPY_TIMEOUT: Duration = Duration::from_secs(60);

/// One staging buffer and the copy that still reads it.
#[derive(Debug)]
struct Half {
    buffer: Buffer,
    busy: Option<Submission>,
}

/// An upload under way.
#[derive(Debug)]
pub(crate) struct Uploader {
    gpu: Arc<Gpu>,
    halves: [Half; 2],
    current: usize,
    used: usize,
    commands: Option<Commands>,
    bytes: u64,
}

impl Uploader {
    /// Makes the staging buffers.
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self, GpuError> {
        let half = |name| -> Result<Half, GpuError> {
            Ok(Half { buffer: Buffer::new(gpu, name, STAGING_BYTES as u64, Usage::Upload)?, busy: None })
        };
        let halves = [half("staging 0")?, half("staging 1")?];
        Ok(Self { gpu: Arc::clone(gpu), halves, current: 0, used: 0, commands: None, bytes: 0 })
    }

    /// Copies `data` to `target` at `offset`.
    pub(crate) fn write(&mut self, target: &dyn DeviceRange, offset: u64, data: &[u8]) -> Result<(), RenderError> {
        self.produce(target, offset, (data.len(), 1), |range, out| out.copy_from_slice(&data[range]))
    }

    /// Fills `target` from `offset` with `items.0` items of `items.1` bytes: `fill` is called with ranges of items, in
    /// order and without gaps, and writes each range's bytes straight into staging memory.
    pub(crate) fn produce(
        &mut self,
        target: &dyn DeviceRange,
        offset: u64,
        items: (usize, usize),
        mut fill: impl FnMut(Range<usize>, &mut [u8]),
    ) -> Result<(), RenderError> {
        let (count, stride) = items;
        let mut done = 0;
        while done < count {
            let room = (STAGING_BYTES - self.used) / stride;
            if room == 0 {
                self.flush()?;
                continue;
            }
            let n = room.min(count - done);
            let bytes = n * stride;
            let (start, half) = (self.used, &self.halves[self.current]);
            half.buffer.map(|all| fill(done..done + n, &mut all[start..start + bytes]))?;
            let commands = match &mut self.commands {
                Some(commands) => commands,
                none => none.insert(self.gpu.commands("upload")?),
            };
            commands.concurrent(|c| {
                c.copy(&half.buffer, start as u64, target, offset + (done * stride) as u64, bytes as u64);
            });
            // Keeps the next fill aligned for the plain structs it may write.
            self.used = (start + bytes).next_multiple_of(16);
            self.bytes += bytes as u64;
            done += n;
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), RenderError> {
        if let Some(commands) = self.commands.take() {
            self.halves[self.current].busy = Some(commands.submit()?);
        }
        self.current = 1 - self.current;
        self.used = 0;
        if let Some(busy) = self.halves[self.current].busy.take()
            && !busy.wait(COPY_TIMEOUT)?
        {
            return Err(RenderError::Internal("a staging copy did not finish".into()));
        }
        Ok(())
    }

    /// Hands the last copies to the device; the uploader can be used again. Returns the bytes handed over since the
    /// last call.
    pub(crate) fn finish(&mut self) -> Result<u64, RenderError> {
        self.flush()?;
        Ok(std::mem::take(&mut self.bytes))
    }
}
