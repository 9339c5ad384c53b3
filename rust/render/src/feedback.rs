// SPDX-License-Identifier: Apache-2.0
//! The tiles of textures that waves lacked, in core: the block that the passes write (`oocpt_abi::TextureFeedback`),
//! and its way to the host. Each wave ends with a copy to one of a few small buffers that the host reads when the wave
//! is done. Render thread only.

use oocpt_abi::{TextureFeedback, WavefrontCounters};
use oocpt_core::inventory::RenderInventory;
use oocpt_gpu::{Buffer, BufferUsage, CommandList, Gpu, GpuError};
use std::mem::offset_of;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Most tiles that are requested at a time; the rest is requested again by a later wave.
const MAX_REQUESTED_TILES: u32 = 1 << 14;
/// Copies that may be under way; waves in flight are two.
const COPIES: usize = 4;
/// Offset of the copied range, which begins with the last four words of the block.
const COUNTS: u64 = offset_of!(TextureFeedback, request_capacity) as u64;
/// Bytes of the copied words; the list follows.
const COUNT_BYTES: u64 = size_of::<TextureFeedback>() as u64 - COUNTS;

/// The device block of missing tiles, and the buffers through which the host reads it.
#[derive(Debug)]
pub(crate) struct FeedbackBuffers {
    block: Buffer,
    requested: Buffer,
    wanted: Buffer,
    copies: Vec<Buffer>,
    next: AtomicUsize,
    incomplete_paths: u64,
}

/// A copy that was recorded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FeedbackCopy(usize);

/// Bytes of a bit for each tile.
fn requested_bytes(tiles: usize) -> u64 {
    (tiles.div_ceil(32) as u64 * 4).max(16)
}

impl FeedbackBuffers {
    /// Allocates the buffers for a scene of `tiles` tiles and paths whose flags are at `incomplete_paths`.
    pub(crate) fn new(gpu: &Arc<Gpu>, tiles: usize, incomplete_paths: u64) -> Result<Self, GpuError> {
        let device = |name: &str, bytes: u64| Buffer::new(gpu, name, bytes, BufferUsage::Device);
        let readback = |_| {
            Buffer::new(
                gpu,
                "texture feedback copy",
                COUNT_BYTES + u64::from(MAX_REQUESTED_TILES) * 4,
                BufferUsage::Readback,
            )
        };
        Ok(Self {
            block: device("texture feedback", size_of::<TextureFeedback>() as u64)?,
            requested: device("requested tiles", requested_bytes(tiles))?,
            wanted: device("wanted tiles", u64::from(MAX_REQUESTED_TILES) * 4)?,
            copies: (0..COPIES).map(readback).collect::<Result<_, _>>()?,
            next: AtomicUsize::new(0),
            incomplete_paths,
        })
    }

    /// Whether they are for a scene of so many tiles, and for these flags of paths.
    pub(crate) fn are_of(&self, tiles: usize, incomplete_paths: u64) -> bool {
        self.requested.size() == requested_bytes(tiles) && self.incomplete_paths == incomplete_paths
    }

    /// Address of the block, for `FrameConstants::texture_feedback`.
    pub(crate) fn address(&self) -> u64 {
        self.block.address()
    }

    /// The buffers that the trace passes write if cutouts are looked up, besides the paths' flags.
    pub(crate) fn written(&self) -> [&Buffer; 3] {
        [&self.block, &self.requested, &self.wanted]
    }

    /// Lists the buffers in the inventory.
    pub(crate) fn list(&self, inventory: &mut RenderInventory) {
        for buffer in [&self.block, &self.requested, &self.wanted].into_iter().chain(&self.copies) {
            inventory.add(buffer.name(), buffer.size());
        }
    }

    /// Records commands that clear the list of missing tiles.
    pub(crate) fn reset(&self, commands: &mut CommandList) {
        let block = TextureFeedback {
            requested: self.requested.address(),
            incomplete_paths: self.incomplete_paths,
            wanted: self.wanted.address(),
            request_capacity: MAX_REQUESTED_TILES,
            ..TextureFeedback::default()
        };
        commands.concurrent(|c| {
            c.update(&self.block, 0, bytemuck::bytes_of(&block));
            c.fill(&self.requested, 0, self.requested.size(), 0);
        });
    }

    /// Records commands that empty the ray queue: a wave behind an incomplete one starts no rays.
    pub(crate) fn empty_queue(&self, commands: &mut CommandList, counters: &Buffer) {
        commands.fill(counters, WavefrontCounters::RAY_COUNT, 4, 0);
    }

    /// Records a copy of the tiles that have been missing so far.
    pub(crate) fn copy_out(&self, commands: &mut CommandList) -> FeedbackCopy {
        let number = self.next.fetch_add(1, Ordering::Relaxed) % COPIES;
        if let Some(copy) = self.copies.get(number) {
            commands.concurrent(|c| {
                c.copy(&self.block, COUNTS, copy, 0, COUNT_BYTES);
                c.copy(&self.wanted, 0, copy, COUNT_BYTES, self.wanted.size());
            });
        }
        FeedbackCopy(number)
    }

    /// The tiles that were missing when a copy was made, in ascending order, once its commands are done; `None` if none
    /// was.
    pub(crate) fn read(&self, copy: FeedbackCopy) -> Result<Option<Vec<u32>>, GpuError> {
        let Some(copy) = self.copies.get(copy.0) else { return Ok(None) };
        copy.map(|bytes| {
            let words: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
            let [_, count, is_incomplete, _] = [0, 1, 2, 3].map(|at| words.get(at).copied().unwrap_or(0));
            let listed = words.get(4..).unwrap_or_default();
            let mut tiles: Vec<u32> = listed.iter().copied().take(count as usize).collect();
            tiles.sort_unstable();
            (is_incomplete != 0).then_some(tiles)
        })
    }
}
