// SPDX-License-Identifier: Apache-2.0
//! Host memory for what rays read across the bus, allocated ahead by a thread of its own: pages are allocated and
//! pinned at a few gigabytes a second (measured: decisions/0050), and no step should wait for that.

use crate::device::Device;
use crate::error::RenderError;
use oocpt_gpu::Heap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};
use std::time::Duration;

/// Bytes of one allocation.
const PIECE: u64 = 64 << 20;
/// Free bytes that are kept ready.
const AHEAD: u64 = 512 << 20;
/// The interval at which free memory is checked.
const PAUSE: Duration = Duration::from_millis(5);

/// Bytes of memory that surely hold `bytes` of assets of up to `largest` bytes: one that finds no room at the end of a
/// piece leaves a hole there. Those larger than half a piece have memory of their own.
pub(crate) fn bytes_with_holes(bytes: u64, largest: u64) -> u64 {
    let hole = largest.min(PIECE / 2);
    bytes + bytes.div_ceil(PIECE - hole) * hole
}

/// A thread that allocates ahead while this lives, once [`HostHeapFiller::want`] was called.
#[derive(Debug)]
pub(crate) struct HostHeapFiller {
    wanted: Arc<AtomicBool>,
}

impl HostHeapFiller {
    /// Starts the thread; it allocates at most `most` bytes in all.
    pub(crate) fn start(device: &Device, most: u64) -> Result<Self, RenderError> {
        let heap = Arc::clone(device.host_heap()?);
        heap.set_limit(Some(most));
        let wanted = Arc::new(AtomicBool::new(false));
        let watched = Arc::downgrade(&wanted);
        let fill = move || fill(&heap, most, &watched);
        if let Err(error) = std::thread::Builder::new().name("oocpt-host-heap".into()).spawn(fill) {
            tracing::warn!(%error, "no thread makes memory for geometry of the host");
        }
        Ok(Self { wanted })
    }

    /// Lets the thread begin to allocate.
    pub(crate) fn want(&self) {
        self.wanted.store(true, Ordering::Relaxed);
    }
}

fn fill(heap: &Heap, most: u64, wanted: &Weak<AtomicBool>) {
    while let Some(wanted) = wanted.upgrade() {
        if !wanted.load(Ordering::Relaxed) {
            drop(wanted);
            std::thread::sleep(PAUSE);
            continue;
        }
        drop(wanted);
        let stats = heap.stats();
        let left = most.saturating_sub(stats.arena_bytes + stats.dedicated_bytes);
        if left == 0 {
            return;
        }
        let is_short = stats.arena_bytes.saturating_sub(stats.used_bytes) < AHEAD;
        if !is_short {
            std::thread::sleep(PAUSE);
            continue;
        }
        match heap.reserve(left.min(PIECE)) {
            Ok(0) => return,
            Ok(_) => {}
            Err(error) => return tracing::debug!(%error, "no more memory for geometry of the host"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn host_heap_fits_assets_beside_block_end_gaps() {
        let mib = 1 << 20;
        for (largest, count) in [(10 * mib, 80_u64), (32 * mib, 5), (22 * mib, 7), (1, 100), (63 * mib, 3)] {
            let limit = bytes_with_holes(largest * count, largest);
            // Assets fill pieces one after the other, as the heap may place them.
            let a_piece = PIECE / largest;
            let taken = if largest > PIECE / 2 { largest * count } else { count.div_ceil(a_piece) * PIECE };
            assert!(limit + PIECE > taken, "{count} of {largest} bytes: {limit} for {taken}");
            assert!(limit <= 2 * largest * count + PIECE, "{count} of {largest} bytes: {limit}");
        }
        assert_eq!(bytes_with_holes(0, 0), 0);
    }
}
