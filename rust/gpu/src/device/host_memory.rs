// SPDX-License-Identifier: Apache-2.0
//! Buffers that the host accesses by device addresses, if the device is a processor. While the host accesses them,
//! retired buffers are not destroyed. Any thread.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::device::mapped::MappedPointer;
use crate::device::raw_buffer::{RawBuffer, RetiredBuffer};
use crate::device::retire::RetireQueue;
use crate::instance::lane::TimelinePoints;

/// All mapped buffers of a device, and the number of their views.
#[derive(Debug, Default)]
pub(crate) struct HostMemory(Mutex<HostMemoryState>);

#[derive(Debug, Default)]
struct HostMemoryState {
    /// Spans by device address: bytes, and the mapped pointer.
    spans: BTreeMap<u64, (u64, MappedPointer)>,
    views: usize,
}

impl HostMemory {
    fn lock(&self) -> MutexGuard<'_, HostMemoryState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a new buffer, if the host can access it.
    pub(crate) fn add(&self, raw: &RawBuffer) {
        if let Some(at) = raw.seen {
            self.lock().spans.insert(raw.address, (raw.bytes, at));
        }
    }

    /// Takes the buffers that may be destroyed once the lanes have reached `completed`, and forgets them: none while
    /// there are views.
    pub(crate) fn take_ready(
        &self,
        retired: &RetireQueue<RetiredBuffer>,
        completed: TimelinePoints,
    ) -> Vec<RetiredBuffer> {
        let mut state = self.lock();
        if state.views > 0 {
            return Vec::new();
        }
        let items = retired.take_ready(completed);
        for item in &items {
            if item.raw.seen.is_some() {
                state.spans.remove(&item.raw.address);
            }
        }
        items
    }

    /// Returns true if there is a view of the memory.
    pub(crate) fn has_views(&self) -> bool {
        self.lock().views > 0
    }

    /// Starts a view: device address, bytes and mapped pointer of each buffer, in the order of addresses.
    pub(crate) fn look(&self) -> Vec<(u64, u64, MappedPointer)> {
        let mut state = self.lock();
        state.views += 1;
        state.spans.iter().map(|(&start, &(bytes, at))| (start, bytes, at)).collect()
    }

    /// Ends a view; returns true if there is no other.
    pub(crate) fn look_away(&self) -> bool {
        let mut state = self.lock();
        state.views -= 1;
        state.views == 0
    }
}
