// SPDX-License-Identifier: Apache-2.0
//! Allocates the blocks of the host heap ahead of their use, on a thread of its own: the driver allocates and pins
//! pages at a few gigabytes a second (measured: decisions/0050), and no step of streaming is to wait for that. The heap
//! holds the geometry that rays read across the bus.

use crate::device::Device;
use crate::error::RenderError;
use oocpt_gpu::Heap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};
use std::time::Duration;

/// Bytes of a block of the heap.
const BLOCK_BYTES: u64 = 64 << 20;
/// Free bytes that are kept ready.
const RESERVE_BYTES: u64 = 512 << 20;
/// Time between two looks at the heap.
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// Bytes of heap that surely hold `bytes` of assets of up to `largest` bytes. An asset that does not fit at the end of
/// a block leaves a gap there; one that is larger than half a block gets an allocation of its own.
pub(crate) fn bytes_with_gaps(bytes: u64, largest: u64) -> u64 {
    let gap = largest.min(BLOCK_BYTES / 2);
    bytes + bytes.div_ceil(BLOCK_BYTES - gap) * gap
}

/// Owns the thread that allocates blocks, which ends when this is dropped. It allocates from the first
/// [`Self::enable`] on.
#[derive(Debug)]
pub(crate) struct HostHeapFiller {
    is_enabled: Arc<AtomicBool>,
}

impl HostHeapFiller {
    /// Starts the thread. It allocates at most `limit` bytes in all. Without a thread the heap allocates on demand.
    pub(crate) fn start(device: &Device, limit: u64) -> Result<Self, RenderError> {
        let heap = Arc::clone(device.host_heap()?);
        heap.set_limit(Some(limit));
        let is_enabled = Arc::new(AtomicBool::new(false));
        let watched = Arc::downgrade(&is_enabled);
        let fill = move || fill(&heap, limit, &watched);
        if let Err(error) = std::thread::Builder::new().name("oocpt-host-heap".into()).spawn(fill) {
            tracing::warn!(%error, "no thread makes memory for geometry of the host");
        }
        Ok(Self { is_enabled })
    }

    /// Lets the thread allocate.
    pub(crate) fn enable(&self) {
        self.is_enabled.store(true, Ordering::Relaxed);
    }
}

/// Allocates blocks until the limit is reached or the owner of `is_enabled` is dropped.
fn fill(heap: &Heap, limit: u64, is_enabled: &Weak<AtomicBool>) {
    while let Some(is_enabled) = is_enabled.upgrade().map(|flag| flag.load(Ordering::Relaxed)) {
        if !is_enabled {
            std::thread::sleep(POLL_INTERVAL);
            continue;
        }
        let stats = heap.stats();
        let left = limit.saturating_sub(stats.arena_bytes + stats.dedicated_bytes);
        if left == 0 {
            return;
        }
        let is_short = stats.arena_bytes.saturating_sub(stats.used_bytes) < RESERVE_BYTES;
        if !is_short {
            std::thread::sleep(POLL_INTERVAL);
            continue;
        }
        match heap.reserve(left.min(BLOCK_BYTES)) {
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
