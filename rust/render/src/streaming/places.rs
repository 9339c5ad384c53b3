// SPDX-License-Identifier: Apache-2.0
//! The places where the radiance of ended paths waits for its turn in the film: their number, and the memory that they
//! are in.
//!
//! Segments are added to the film in the order of their paths, so the oldest straggler holds all later ones back. The
//! more places there are, the longer new paths can begin all the same. A place is written once and read once, so it may
//! lie across the bus: decisions/0002. Render thread only.

use oocpt_gpu::{Buffer, BufferUsage, Gpu, GpuError};
use std::sync::Arc;

/// A segment is one part in so many of all slots together.
const SEGMENTS_PER_FILL: u32 = 64;
/// Most places for every slot in the memory that the slots are in.
const PER_SLOT: u32 = 8;
/// Most places for every slot in host memory.
const PER_SLOT_HOST: u32 = 64;
/// Number of places that is enough in host memory, unless [`PER_SLOT`] for every slot are more.
const ENOUGH: u64 = 1 << 26;
/// Bytes of a place for the radiance of a path.
const RADIANCE_BYTES: u64 = 16;

/// The bounds on the number of places.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaceBounds {
    /// The bounds on the number of places.
    pub(super) total: u64,
    /// Bytes of host memory; not used on unified devices.
    pub(super) host_bytes: u64,
    /// Values that a path has for filtered images.
    pub(super) plane_words: u32,
}

/// Bytes of a place for the values of filtered images.
fn plane_bytes(plane_words: u32) -> u64 {
    4 * u64::from(plane_words)
}

/// The buffer of the places.
#[derive(Debug)]
pub(crate) struct RadiancePlaces {
    pub(super) segment_count: u32,
    pub(super) segment_size: u32,
    /// Radiance as f32x4 by place.
    pub(super) radiance: Buffer,
    /// What first hits have for filtered images, by place; only with such images.
    pub(super) planes: Option<Buffer>,
}

impl RadiancePlaces {
    /// Allocates places for `capacity` slots (a power of two); fewer if memory is short.
    pub(super) fn new(gpu: &Arc<Gpu>, capacity: u32, bounds: PlaceBounds) -> Result<Self, GpuError> {
        Self::in_memory(gpu, if gpu.is_unified() { BufferUsage::Device } else { BufferUsage::Shared }, capacity, bounds)
    }

    fn in_memory(gpu: &Arc<Gpu>, usage: BufferUsage, capacity: u32, bounds: PlaceBounds) -> Result<Self, GpuError> {
        let segment_size = (capacity / SEGMENTS_PER_FILL).max(1);
        let mut per_slot = per_slot(capacity, bounds, usage, gpu.limits().max_allocation_bytes);
        loop {
            let segment_count = capacity / segment_size * per_slot;
            let places = u64::from(segment_count) * u64::from(segment_size);
            match buffers(gpu, usage, places, bounds.plane_words) {
                Err(GpuError::OutOfMemory { .. }) if per_slot > 1 && usage != BufferUsage::Device => per_slot /= 2,
                made => {
                    let (radiance, planes) = made?;
                    return Ok(Self { segment_count, segment_size, radiance, planes });
                }
            }
        }
    }

    pub(super) fn buffers(&self) -> impl Iterator<Item = &Buffer> {
        [&self.radiance].into_iter().chain(&self.planes)
    }
}

/// The buffers of so many places.
fn buffers(
    gpu: &Arc<Gpu>,
    usage: BufferUsage,
    places: u64,
    plane_words: u32,
) -> Result<(Buffer, Option<Buffer>), GpuError> {
    let radiance = Buffer::new(gpu, "ended_radiance", places * RADIANCE_BYTES, usage)?;
    let bytes = places * plane_bytes(plane_words);
    let planes = (bytes > 0).then(|| Buffer::new(gpu, "plane_values", bytes, usage)).transpose()?;
    Ok((radiance, planes))
}

/// Bytes of device memory that the places of a slot take, at most.
pub(super) fn device_bytes(gpu: &Gpu, plane_words: u32) -> u64 {
    if gpu.is_unified() { (RADIANCE_BYTES + plane_bytes(plane_words)) * u64::from(PER_SLOT) } else { 0 }
}

/// Places for each of `capacity` slots: no more than the render has paths, than the driver allocates in one piece, nor
/// than there is host memory.
fn per_slot(capacity: u32, bounds: PlaceBounds, usage: BufferUsage, max_allocation_bytes: u64) -> u32 {
    let slots = u64::from(capacity).max(1);
    let planes = plane_bytes(bounds.plane_words);
    // The largest of the pieces, and all of them together.
    let by_driver = max_allocation_bytes / planes.max(RADIANCE_BYTES);
    let (most, places) = match usage {
        BufferUsage::Device | BufferUsage::Exported => (u64::from(PER_SLOT), by_driver),
        BufferUsage::Upload | BufferUsage::Readback | BufferUsage::Shared => {
            let enough = (ENOUGH / slots).clamp(u64::from(PER_SLOT), u64::from(PER_SLOT_HOST));
            (enough, by_driver.min(bounds.host_bytes / (RADIANCE_BYTES + planes)))
        }
    };
    let most = most.min(bounds.total.div_ceil(slots)).min(places / slots);
    u32::try_from(most).unwrap_or(PER_SLOT).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_gpu::{DriverCall, OpenOptions, PlantedFailure};

    const NVIDIA: u64 = 4_292_870_144; // what an H200's driver gives in one piece
    const MANY: PlaceBounds = PlaceBounds { total: 1 << 40, host_bytes: 1 << 40, plane_words: 0 };

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
        let filtered = PlaceBounds { plane_words: 8, ..MANY };
        assert_eq!(on_host(1 << 19, PlaceBounds { host_bytes: 96 << 20, ..filtered }), 4, "three times as large");
        assert_eq!(on_host(1 << 25, filtered), 3, "the larger of two pieces");
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
            // A failure that was not triggered must not hit another test.
            gpu.plant_failure(PlantedFailure { call: DriverCall::Buffer, after: u64::MAX, times: 1 });
            made.map(|places| (places.segment_count, places.radiance.size()))
        };
        assert_eq!(made(BufferUsage::Readback, 0).expect("memory"), (64 * 64, 64 << 14), "64 a slot");
        assert_eq!(made(BufferUsage::Readback, 2).expect("memory"), (64 * 16, 16 << 14), "halved twice");
        made(BufferUsage::Readback, 7).expect_err("not one a slot");
        made(BufferUsage::Device, 1).expect_err("paths in slots have to be fewer");
    }
}
