// SPDX-License-Identifier: Apache-2.0
//! Work of the host in the middle of a command list.

use std::time::{Duration, Instant};

use super::CommandList;
use crate::error::GpuError;
use crate::instance::lane::TimelinePoints;
use crate::submit::queue::InFlight;
use crate::submit::recorder::CommandRecorder;

impl CommandList {
    /// Submits what is recorded so far, waits for it and for all that was submitted before, and runs `work` on this
    /// thread; what is recorded afterwards sees what it wrote. So a list with such work is not in flight as a whole,
    /// and its `submit` hands over only the rest. An error of `work` is one of the list.
    pub fn host(&mut self, name: &str, timeout: Duration, work: impl FnOnce() -> Result<(), GpuError>) {
        if self.error.is_some() {
            return;
        }
        let timing = self.recorder.is_timing();
        let run = || {
            let started = Instant::now();
            work().map(|()| started.elapsed().as_secs_f64())
        };
        match self.flush(timeout).and_then(|()| run()) {
            Ok(secs) if timing => self.timings.push((name.to_owned(), secs)),
            Ok(_) => {}
            Err(error) => self.fail(error),
        }
    }

    /// Runs what is recorded to its end, and goes on with an empty list.
    fn flush(&mut self, timeout: Duration) -> Result<(), GpuError> {
        if self.is_flushed && !self.recorder.has_operations() {
            return Ok(());
        }
        let device = std::sync::Arc::clone(&self.recorder.device);
        let (lane, timing) = (self.recorder.lane, self.recorder.is_timing());
        device.check_alive()?;
        self.recorder.finish()?;
        let Some(slot) = self.slot.take() else {
            return Err(GpuError::Usage { name: self.label.clone(), message: "submitted twice".to_owned() });
        };
        let timer = self.recorder.timer.take().map(std::sync::Arc::new);
        let work = InFlight {
            value: 0,
            slot,
            // The list goes on, and keeps what it keeps until its end.
            kept: Vec::new(),
            timer: timer.clone(),
            waits: self.waits,
        };
        let marks = std::mem::take(&mut self.recorder.marks);
        let value = self.gpu.opened().queue(lane).submit(&device, work, (self.label.clone(), marks))?;
        let timeout_ns = u64::try_from(timeout.as_nanos()).unwrap_or(u64::MAX);
        if !device.wait(lane, value, timeout_ns)? {
            let message = format!("did not finish within {} s", timeout.as_secs());
            return Err(GpuError::Usage { name: self.label.clone(), message });
        }
        if let Some(timer) = timer {
            self.timings.extend(timer.read()?);
        }
        self.gpu.opened().collect();
        let slot = self.gpu.opened().queue(lane).slot(&device)?;
        match CommandRecorder::begin(&device, lane, slot.buffer, &self.label) {
            Ok(recorder) => self.recorder = recorder,
            Err(error) => {
                slot.destroy(&device.raw);
                return Err(error);
            }
        }
        self.recorder.set_timing(timing);
        self.slot = Some(slot);
        self.waits = TimelinePoints::START;
        self.is_flushed = true;
        Ok(())
    }
}
