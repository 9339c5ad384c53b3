// SPDX-License-Identifier: Apache-2.0
//! Memory of a streaming render that only some scenes need: for textures, for roulette on loads.

use super::needs::StreamingNeeds;
use oocpt_abi::{CUTOUT_LOOKUPS, DeferredAlphaTest, RouletteStats, WORTH_SUMS};
use oocpt_core::inventory::RenderInventory;
use oocpt_gpu::{Buffer, BufferUsage, Gpu, GpuError};
use std::sync::Arc;

/// Bytes of the value of a lookup.
pub(super) const LOOKUP_BYTES: usize = 16;

/// The buffers that only textures need.
#[derive(Debug)]
pub(super) struct TextureBuffers {
    pub(super) resolve_queue: Buffer,
    pub(super) resolved: Buffer,
    pub(super) resolve_progress: Buffer,
    /// With cutouts: the deferred tests of the closest ray and of the shadow ray.
    pub(super) alpha_tests: Option<[Buffer; 2]>,
}

/// The buffers that only roulette on loads needs.
#[derive(Debug)]
pub(super) struct RouletteBuffers {
    pub(super) block: Buffer,
    pub(super) worth: Buffer,
    pub(super) worth_sums: Buffer,
    /// Used in turn by the steps under way.
    pub(super) verdicts: [Buffer; 2],
}

impl RouletteBuffers {
    pub(super) fn new(gpu: &Arc<Gpu>, units: u32) -> Result<Self, GpuError> {
        let table = |name: &str, usage| Buffer::new(gpu, name, 4 * u64::from(units), usage);
        Ok(Self {
            block: Buffer::new(gpu, "roulette", size_of::<RouletteStats>() as u64, BufferUsage::Device)?,
            worth: table("worth", BufferUsage::Device)?,
            worth_sums: Buffer::new(gpu, "worth sums", 4 * u64::from(WORTH_SUMS), BufferUsage::Device)?,
            verdicts: [table("verdicts 0", BufferUsage::Upload)?, table("verdicts 1", BufferUsage::Upload)?],
        })
    }
}

impl TextureBuffers {
    pub(super) fn new(
        needs: StreamingNeeds,
        slots: impl Fn(&str, usize) -> Result<Buffer, GpuError>,
    ) -> Result<Self, GpuError> {
        let bytes = alpha_test_bytes(needs);
        let alpha_tests = || Ok([slots("alpha_tests", bytes)?, slots("shadow_alpha_tests", bytes)?]);
        Ok(Self {
            resolve_queue: slots("resolve_queue", 4)?,
            resolved: slots("resolved", LOOKUP_BYTES * needs.lookups as usize)?,
            resolve_progress: slots("resolve_progress", 4)?,
            alpha_tests: needs.cutouts.then(alpha_tests).transpose()?,
        })
    }
}

/// Lists the deferred tests of cutouts, or that they are left out.
pub(super) fn list_alpha_tests(alpha_tests: Option<&[Buffer; 2]>, capacity: u64, inventory: &mut RenderInventory) {
    for (at, name) in ["alpha_tests", "shadow_alpha_tests"].into_iter().enumerate() {
        match alpha_tests {
            Some(alpha_tests) => inventory.add(name, alpha_tests[at].size()),
            None => inventory.leave_out(name, capacity * size_of::<DeferredAlphaTest>() as u64),
        }
    }
}

/// Bytes of a deferred test, with the values of programs behind all of them.
pub(super) fn alpha_test_bytes(needs: StreamingNeeds) -> usize {
    let kept = if needs.cutout_programs { LOOKUP_BYTES * (CUTOUT_LOOKUPS as usize - 1) } else { 0 };
    size_of::<DeferredAlphaTest>() + kept
}
