// SPDX-License-Identifier: Apache-2.0
//! Buffers that the host sees at the addresses of the device, where the device is a processor. While the host looks at
//! them, nothing that is retired may go. Any thread.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::device::mapped::MappedPointer;
use crate::device::raw_buffer::{RawBuffer, RetiredBuffer};
use crate::device::retire::RetireQueue;
use crate::instance::lane::TimelinePoints;

/// All mapped buffers of a device, and how many views of them there are.
#[derive(Debug, Default)]
pub(crate) struct HostMemory(Mutex<HostMemoryState>);

#[derive(Debug, Default)]
struct HostMemoryState {
    /// By device address: bytes, and where they are.
    spans: BTreeMap<u64, (u64, MappedPointer)>,
    views: usize,
}

impl HostMemory {
    fn lock(&self) -> MutexGuard<'_, HostMemoryState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes a new buffer, if the host sees it.
    pub(crate) fn add(&self, raw: &RawBuffer) {
        if let Some(at) = raw.seen {
            self.lock().spans.insert(raw.address, (raw.bytes, at));
        }
    }

    /// Takes what may go once the lanes have come as far as `completed`, and forgets it: nothing while there are views.
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

    /// Whether the host looks at memory now.
    pub(crate) fn has_views(&self) -> bool {
        self.lock().views > 0
    }

    /// Starts a view: device address, bytes and place of each buffer, in the order of addresses.
    pub(crate) fn look(&self) -> Vec<(u64, u64, MappedPointer)> {
        let mut state = self.lock();
        state.views += 1;
        state.spans.iter().map(|(&start, &(bytes, at))| (start, bytes, at)).collect()
    }

    /// Ends a view; true if there is no other.
    pub(crate) fn look_away(&self) -> bool {
        let mut state = self.lock();
        state.views -= 1;
        state.views == 0
    }
}
