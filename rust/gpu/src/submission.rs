// SPDX-License-Identifier: Apache-2.0
//! Work that was handed to the GPU: is it done, wait for it, how long did it take. Any thread.

use std::sync::Arc;
use std::time::Duration;

use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::instance::lane::QueueLane;
use crate::submit::timer::QueryTimer;

/// One submitted command list. Dropping it does not wait and does not cancel.
#[derive(Debug)]
pub struct Submission {
    gpu: Arc<Gpu>,
    pub(crate) lane: QueueLane,
    pub(crate) value: u64,
    label: String,
    /// Of its parts that had run before it was submitted ([`CommandList::host`](crate::CommandList::host)).
    earlier: Vec<(String, f64)>,
    timer: Option<Arc<QueryTimer>>,
}

impl Submission {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        (lane, value): (QueueLane, u64),
        label: String,
        (earlier, timer): (Vec<(String, f64)>, Option<Arc<QueryTimer>>),
    ) -> Self {
        Self { gpu: Arc::clone(gpu), lane, value, label, earlier, timer }
    }

    pub(crate) fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// True once the GPU has finished it, and after the loss of the device (which [`Submission::wait`] reports).
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.gpu.device().completed().of(self.lane) >= self.value
    }

    /// Ok(true) once it has finished, Ok(false) when `timeout` passed first. Afterwards the host sees all it wrote.
    ///
    /// # Errors
    /// [`GpuError::DeviceLost`], or a failed call.
    pub fn wait(&self, timeout: Duration) -> Result<bool, GpuError> {
        let device = self.gpu.device();
        let timeout_ns = u64::try_from(timeout.as_nanos()).unwrap_or(u64::MAX);
        let done = device.wait(self.lane, self.value, timeout_ns)?;
        if done {
            self.gpu.opened().collect();
        }
        Ok(done)
    }

    /// Name and seconds of each operation and span, in recording order. Empty when not profiled, not done, or lost.
    /// Operations of a concurrent section overlap, so their times do not add up.
    #[must_use]
    pub fn timings(&self) -> Vec<(String, f64)> {
        let device = self.gpu.device();
        let mut timings = self.earlier.clone();
        match &self.timer {
            Some(timer) if self.is_done() && device.check_alive().is_ok() => {
                timings.extend(timer.read().unwrap_or_else(|error| {
                    tracing::warn!(%error, "timings of {} were lost", self.label);
                    Vec::new()
                }));
            }
            _ => {}
        }
        timings
    }

    /// The label of its command list.
    #[must_use]
    pub fn label(&self) -> &str {
        &self.label
    }
}
