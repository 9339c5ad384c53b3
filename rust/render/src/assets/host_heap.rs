// SPDX-License-Identifier: Apache-2.0
//! Allocates the blocks of the host heap ahead of their use, on a thread of its own: the driver allocates and pins
//! pages at a few gigabytes a second (measured: decisions/0050), and no step of streaming is to wait for that. The heap
//! holds the geometry that rays read across the bus.

use crate::device::Device;
use crate::error::RenderError;
use crate::sync::lock;
use oocpt_gpu::Heap;
use std::sync::{Arc, Condvar, Mutex, PoisonError};

/// Bytes of a block of the heap.
const BLOCK_BYTES: u64 = 64 << 20;
/// Free bytes that are kept ready.
const RESERVE_BYTES: u64 = 512 << 20;

/// Bytes of heap that surely hold `bytes` of assets of up to `largest` bytes. An asset that does not fit at the end of
/// a block leaves a gap there; one that is larger than half a block gets an allocation of its own.
pub(crate) fn bytes_with_gaps(bytes: u64, largest: u64) -> u64 {
    let gap = largest.min(BLOCK_BYTES / 2);
    bytes + bytes.div_ceil(BLOCK_BYTES - gap) * gap
}

/// What the thread is told.
#[derive(Debug, Default)]
struct FillerState {
    is_enabled: bool,
    /// The heap has been used since the thread last looked at it.
    is_used: bool,
    is_stopped: bool,
}

/// The state, and its changes.
#[derive(Debug, Default)]
struct FillerSignal {
    state: Mutex<FillerState>,
    changed: Condvar,
}

impl FillerSignal {
    fn set(&self, change: impl FnOnce(&mut FillerState)) {
        change(&mut lock(&self.state));
        self.changed.notify_one();
    }

    /// Waits until the heap has been used; returns false when the thread is to end.
    fn wait(&self) -> bool {
        let is_idle = |state: &mut FillerState| !(state.is_stopped || state.is_enabled && state.is_used);
        let state = self.changed.wait_while(lock(&self.state), is_idle);
        let mut state = state.unwrap_or_else(PoisonError::into_inner);
        state.is_used = false;
        !state.is_stopped
    }

    fn is_stopped(&self) -> bool {
        lock(&self.state).is_stopped
    }
}

/// Owns the thread that allocates blocks, which ends when this is dropped. It allocates from the first
/// [`Self::enable`] on.
#[derive(Debug)]
pub(crate) struct HostHeapFiller {
    signal: Arc<FillerSignal>,
}

impl HostHeapFiller {
    /// Starts the thread. It allocates at most `limit` bytes in all. Without a thread the heap allocates on demand.
    pub(crate) fn start(device: &Device, limit: u64) -> Result<Self, RenderError> {
        let heap = Arc::clone(device.host_heap()?);
        heap.set_limit(Some(limit));
        let signal = Arc::new(FillerSignal::default());
        let watched = Arc::clone(&signal);
        let fill = move || while watched.wait() && fill(&heap, limit, &watched) {};
        if let Err(error) = std::thread::Builder::new().name("oocpt-host-heap".into()).spawn(fill) {
            tracing::warn!(%error, "no thread makes memory for geometry of the host");
        }
        Ok(Self { signal })
    }

    /// Lets the thread allocate.
    pub(crate) fn enable(&self) {
        self.signal.set(|state| (state.is_enabled, state.is_used) = (true, true));
    }

    /// Lets the thread, once it is enabled, make up for memory that was taken.
    pub(crate) fn note_use(&self) {
        self.signal.set(|state| state.is_used = true);
    }
}

impl Drop for HostHeapFiller {
    fn drop(&mut self) {
        self.signal.set(|state| state.is_stopped = true);
    }
}

/// Allocates blocks until enough is free; returns false when there are no more to allocate.
fn fill(heap: &Heap, limit: u64, signal: &FillerSignal) -> bool {
    while !signal.is_stopped() {
        let stats = heap.stats();
        let left = limit.saturating_sub(stats.arena_bytes + stats.dedicated_bytes);
        if left == 0 {
            return false;
        }
        if stats.arena_bytes.saturating_sub(stats.used_bytes) >= RESERVE_BYTES {
            return true;
        }
        match heap.reserve(left.min(BLOCK_BYTES)) {
            Ok(0) => return false,
            Ok(_) => {}
            Err(error) => {
                tracing::debug!(%error, "no more memory for geometry of the host");
                return false;
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;
    use std::time::Duration;

    #[test]
    fn the_filler_looks_at_the_heap_only_after_it_was_used() {
        let signal = Arc::new(FillerSignal::default());
        let filler = HostHeapFiller { signal: Arc::clone(&signal) };
        let (looks, seen) = mpsc::channel();
        let thread = std::thread::spawn(move || while signal.wait() && looks.send(()).is_ok() {});
        let soon = Duration::from_millis(50);
        filler.note_use();
        assert!(seen.recv_timeout(soon).is_err(), "not before it is enabled");
        for wake in [HostHeapFiller::enable, HostHeapFiller::note_use] {
            wake(&filler);
            assert!(seen.recv_timeout(Duration::from_secs(60)).is_ok(), "once it was used");
            assert!(seen.recv_timeout(soon).is_err(), "no second time");
        }
        drop(filler);
        thread.join().expect("it ends with its owner");
    }

    #[test]
    fn host_heap_fits_assets_beside_block_end_gaps() {
        let mib = 1 << 20;
        for (largest, count) in [(10 * mib, 80_u64), (32 * mib, 5), (22 * mib, 7), (1, 100), (63 * mib, 3)] {
            let limit = bytes_with_gaps(largest * count, largest);
            // One after the other into whole blocks, as the heap may; the last block may be a smaller one.
            let per_block = BLOCK_BYTES / largest;
            let taken =
                if largest > BLOCK_BYTES / 2 { largest * count } else { count.div_ceil(per_block) * BLOCK_BYTES };
            assert!(limit + BLOCK_BYTES > taken, "{count} of {largest} bytes: {limit} for {taken}");
            assert!(limit <= 2 * largest * count + BLOCK_BYTES, "{count} of {largest} bytes: {limit}");
        }
        assert_eq!(bytes_with_gaps(0, 0), 0);
    }
}
