// SPDX-License-Identifier: Apache-2.0
//! Where the radiance of ended paths waits for its turn in the film: how many places there are, and in which memory.
//!
//! Segments go into the film in the order of their paths, so the oldest straggler holds all later ones back. The more
//! places there are, the longer new paths can begin all the same. A place is written once and read once, so it may lie
//! across the bus: decisions/0002. Render thread only.

use oocpt_gpu::{Buffer, BufferUsage, Gpu, GpuError};
use std::sync::Arc;

/// Segments as large as all slots together.
const SEGMENTS_PER_FILL: u32 = 64;
/// Most places for every slot in the memory that the slots are in.
const PER_SLOT: u32 = 8;
/// Most places for every slot in host memory, and how many places make more than [`PER_SLOT`] too many.
const PER_SLOT_HOST: u32 = 64;
const ENOUGH: u64 = 1 << 26;
/// Bytes of a place: the radiance of a path.
const PLACE_BYTES: u64 = 16;

/// What bounds the places.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaceBounds {
    /// Paths of the render.
    pub(super) total: u64,
    /// Bytes of host memory; on unified devices it does not count.
    pub(super) host_bytes: u64,
}

/// See the module.
#[derive(Debug)]
pub(crate) struct RadiancePlaces {
    pub(super) segment_count: u32,
    pub(super) segment_size: u32,
    /// f32x4 by place.
    pub(super) radiance: Buffer,
}

impl RadiancePlaces {
    /// Places for `capacity` slots (a power of two); fewer where memory is short.
    pub(super) fn new(gpu: &Arc<Gpu>, capacity: u32, bounds: PlaceBounds) -> Result<Self, GpuError> {
        Self::in_memory(gpu, if gpu.is_unified() { BufferUsage::Device } else { BufferUsage::Shared }, capacity, bounds)
    }

    fn in_memory(gpu: &Arc<Gpu>, usage: BufferUsage, capacity: u32, bounds: PlaceBounds) -> Result<Self, GpuError> {
        let segment_size = (capacity / SEGMENTS_PER_FILL).max(1);
        let mut per_slot = per_slot(capacity, bounds, usage, gpu.limits().max_allocation_bytes);
        loop {
            let segment_count = capacity / segment_size * per_slot;
            let bytes = u64::from(segment_count) * u64::from(segment_size) * PLACE_BYTES;
            match Buffer::new(gpu, "ended_radiance", bytes, usage) {
                Err(GpuError::OutOfMemory { .. }) if per_slot > 1 && usage != BufferUsage::Device => per_slot /= 2,
                radiance => return Ok(Self { segment_count, segment_size, radiance: radiance? }),
            }
        }
    }
}

/// Bytes of device memory that the places of a slot take, at most.
pub(super) fn device_bytes(gpu: &Gpu) -> u64 {
    if gpu.is_unified() { PLACE_BYTES * u64::from(PER_SLOT) } else { 0 }
}

/// Places for each of `capacity` slots: no more than the render has paths, than the driver gives in one piece, nor than
/// there is host memory.
fn per_slot(capacity: u32, bounds: PlaceBounds, usage: BufferUsage, max_allocation_bytes: u64) -> u32 {
    let slots = u64::from(capacity).max(1);
    let (most, bytes) = match usage {
        BufferUsage::Device => (u64::from(PER_SLOT), max_allocation_bytes),
        BufferUsage::Upload | BufferUsage::Readback | BufferUsage::Shared => {
            let enough = (ENOUGH / slots).clamp(u64::from(PER_SLOT), u64::from(PER_SLOT_HOST));
            (enough, max_allocation_bytes.min(bounds.host_bytes))
        }
    };
    let most = most.min(bounds.total.div_ceil(slots)).min(bytes / PLACE_BYTES / slots);
    u32::try_from(most).unwrap_or(PER_SLOT).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_gpu::{DriverCall, OpenOptions, PlantedFailure};

    const NVIDIA: u64 = 4_292_870_144; // what an H200's driver gives in one piece
    const MANY: PlaceBounds = PlaceBounds { total: 1 << 40, host_bytes: 1 << 40 };

    #[test]
    fn deferred_places_are_bounded_by_paths_and_driver_limits() {
        let on_device =
            |capacity, total| per_slot(capacity, PlaceBounds { total, ..MANY }, BufferUsage::Device, NVIDIA);
        assert_eq!(on_device(1 << 22, 1 << 40), 8, "eight for each slot when there is room");
        assert_eq!(on_device(1 << 25, 1 << 40), 7, "one piece of memory");
        assert_eq!(on_device(1 << 25, 28_114_944), 1, "a place for each path is enough");
        assert_eq!(on_device(1 << 12, 5), 1, "at least one");
    }

    #[test]
    fn more_deferred_places_fit_in_host_memory() {
        let on_host = |capacity, bounds| per_slot(capacity, bounds, BufferUsage::Readback, NVIDIA);
        assert_eq!(on_host(1 << 19, MANY), 64, "many");
        assert_eq!(on_host(1 << 22, MANY), 16, "2^26");
        assert_eq!(on_host(1 << 25, MANY), 7, "eight, but for the driver");
        assert_eq!(on_host(1 << 19, PlaceBounds { total: 28_114_944, ..MANY }), 54, "a place for each path is enough");
        assert_eq!(on_host(1 << 19, PlaceBounds { host_bytes: 96 << 20, ..MANY }), 12, "96 MiB");
        assert_eq!(on_host(1 << 19, PlaceBounds { host_bytes: 0, ..MANY }), 1, "at least one");
    }

    #[test]
    fn fewer_deferred_places_when_host_memory_runs_out() {
        let selector = std::env::var("OOCPT_TEST_DEVICE").ok();
        let gpu = Gpu::open(&OpenOptions { selector, ..OpenOptions::default() }).expect("a device");
        let made = |usage, times| {
            gpu.plant_failure(PlantedFailure {
                call: DriverCall::Buffer,
                after: if times == 0 { u64::MAX } else { 0 },
                times,
            });
            let made = RadiancePlaces::in_memory(&gpu, usage, 1 << 10, MANY);
            // What was not struck is not to strike somebody else.
            gpu.plant_failure(PlantedFailure { call: DriverCall::Buffer, after: u64::MAX, times: 1 });
            made.map(|places| (places.segment_count, places.radiance.size()))
        };
        assert_eq!(made(BufferUsage::Readback, 0).expect("memory"), (64 * 64, 64 << 14), "64 a slot");
        assert_eq!(made(BufferUsage::Readback, 2).expect("memory"), (64 * 16, 16 << 14), "halved twice");
        made(BufferUsage::Readback, 7).expect_err("not one a slot");
        made(BufferUsage::Device, 1).expect_err("paths in slots have to be fewer");
    }
}
