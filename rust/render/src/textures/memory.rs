// SPDX-License-Identifier: Apache-2.0
//! Decoded images in host memory, for where there is no texture cache on disk.
//!
//! The bound: the levels of all images together take at most what the settings say ([`crate::host_memory::images`]), or
//! those of a single image if they are more. The oldest are dropped, and decoded again when they are needed again.

use super::convert::TileSink;
use super::image::ImageError;
use crate::host_memory;
use crate::sync::lock;
use oocpt_core::settings::Settings;
use oocpt_core::texture::TileLayout;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, Weak};

/// Levels of an image, stored as the file's texels are, rows from the bottom up.
#[derive(Debug)]
pub(super) struct StoredLevels {
    first: u32,
    texel_bytes: usize,
    levels: Vec<([u32; 2], Vec<u8>)>,
}

impl StoredLevels {
    /// Room for the levels `first ..` of an image.
    pub(super) fn new(layout: &TileLayout, texel_bytes: usize, first: u32) -> Self {
        let level = |level| {
            let size = layout.level_size(level);
            (size, vec![0; size[0] as usize * size[1] as usize * texel_bytes])
        };
        Self { first, texel_bytes, levels: (first..layout.levels()).map(level).collect() }
    }

    /// The finest level that is there.
    pub(super) fn first(&self) -> u32 {
        self.first
    }

    fn bytes(&self) -> u64 {
        self.levels.iter().map(|(_, level)| level.len() as u64).sum()
    }

    /// Copies a rectangle of a level.
    pub(super) fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        let missing = || ImageError("has no such texels".into());
        let index = level.checked_sub(self.first).ok_or_else(missing)?;
        let (whole, texels) = self.levels.get(index as usize).ok_or_else(missing)?;
        let stride = whole[0] as usize * self.texel_bytes;
        let (from, length) = (at[0] as usize * self.texel_bytes, size[0] as usize * self.texel_bytes);
        let rows = texels.chunks_exact(stride.max(1)).skip(at[1] as usize);
        for (row, out) in rows.zip(out.chunks_exact_mut(length.max(1))) {
            out.copy_from_slice(row.get(from..from + length).ok_or_else(missing)?);
        }
        Ok(())
    }
}

impl TileSink for StoredLevels {
    fn tile(&mut self, level: u32, at: [u32; 2], size: [u32; 2], texels: &[u8]) -> Result<(), ImageError> {
        let outside = || ImageError("has a tile outside of it".into());
        let Some(index) = level.checked_sub(self.first) else { return Ok(()) };
        let (whole, level) = self.levels.get_mut(index as usize).ok_or_else(outside)?;
        let stride = whole[0] as usize * self.texel_bytes;
        let (from, length) = (at[0] as usize * self.texel_bytes, size[0] as usize * self.texel_bytes);
        let rows = level.chunks_exact_mut(stride.max(1)).skip(at[1] as usize);
        for (row, texels) in rows.zip(texels.chunks_exact(length.max(1))) {
            row.get_mut(from..from + length).ok_or_else(outside)?.copy_from_slice(texels);
        }
        Ok(())
    }
}

/// An image that keeps levels in memory.
pub(super) trait DroppableLevels: Send + Sync {
    /// Lets go of them, unless somebody is at work on them.
    fn drop_levels(&self) -> bool;
}

/// Remembers which images have levels in memory, the oldest first.
pub(crate) struct MemoryStore {
    held: Mutex<VecDeque<(Weak<dyn DroppableLevels>, u64)>>,
    /// Most bytes.
    most: AtomicU64,
}

impl Default for MemoryStore {
    fn default() -> Self {
        Self { held: Mutex::default(), most: AtomicU64::new(host_memory::images(&Settings::default())) }
    }
}

impl std::fmt::Debug for MemoryStore {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("MemoryStore").field("images", &lock(&self.held).len()).finish()
    }
}

impl MemoryStore {
    /// From now on at most so many bytes; what is held stays until more comes.
    pub(crate) fn limit(&self, bytes: u64) {
        self.most.store(bytes, Ordering::Relaxed);
    }

    /// Takes note of an image's levels; drops older ones if there are too many bytes.
    pub(super) fn added(&self, image: Weak<dyn DroppableLevels>, levels: &StoredLevels) {
        let (bytes, most) = (levels.bytes(), self.most.load(Ordering::Relaxed));
        let mut held = lock(&self.held);
        held.retain(|(old, _)| old.strong_count() > 0 && !Weak::ptr_eq(old, &image));
        let mut sum = held.iter().map(|(_, bytes)| bytes).sum::<u64>().saturating_add(bytes);
        held.retain(|(old, bytes)| {
            if sum <= most {
                return true;
            }
            let gone = old.upgrade().is_none_or(|old| old.drop_levels());
            if gone {
                sum = sum.saturating_sub(*bytes);
            }
            !gone
        });
        held.push_back((image, bytes));
    }
}
