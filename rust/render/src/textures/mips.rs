// SPDX-License-Identifier: Apache-2.0
//! Levels that a file lacks: made once, from one pass over the coarsest level that it has, by the worker that first needs one.
//!
//! Host memory, the bound: the made levels of all images together take at most [`MOST_BYTES`], or those of a single image if they are
//! more (a third of its level 0: 341 MiB for 16 384 x 16 384 texels of 4 bytes). Older ones are dropped and made again when they are needed
//! again. While making, a worker holds one band of rows, [`BAND_BYTES`] or a row, and 8/3 rows of floats.

use super::image::{Image, ImageError};
use super::tiles::Texels;
use crate::sync::lock;
use oocpt_core::texture::{Layout, Pyramid};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, TryLockError, Weak};

/// Most bytes of made levels.
const MOST_BYTES: u64 = 512 << 20;
/// Bytes of rows that are read at a time.
const BAND_BYTES: usize = 8 << 20;

/// The made levels of an image, stored as they will be on the device.
#[derive(Debug)]
pub(super) struct Made {
    /// The first one's level.
    first: u32,
    levels: Vec<Vec<u8>>,
}

impl Made {
    /// Rows of a level.
    pub(super) fn level(&self, level: u32) -> &[u8] {
        let index = level.checked_sub(self.first).map(|index| index as usize);
        index.and_then(|index| self.levels.get(index)).map_or(&[], Vec::as_slice)
    }

    fn bytes(&self) -> u64 {
        self.levels.iter().map(|level| level.len() as u64).sum()
    }
}

/// Where an image keeps its made levels.
pub(super) type Slot = Arc<Mutex<Option<Arc<Made>>>>;

/// Made levels of an image that may be gone, and their bytes.
type Held = (Weak<Mutex<Option<Arc<Made>>>>, u64);

/// Remembers which images have made levels, the oldest first.
#[derive(Debug, Default)]
pub(crate) struct MipStore {
    held: Mutex<VecDeque<Held>>,
}

impl MipStore {
    /// The made levels of an image, from level `first` on.
    pub(super) fn levels(
        &self,
        slot: &Slot,
        image: &dyn Image,
        texels: &Texels,
        layout: &Layout,
        first: u32,
    ) -> Result<Arc<Made>, ImageError> {
        // Whoever else needs them waits here.
        let mut mine = lock(slot);
        if let Some(made) = &*mine {
            return Ok(Arc::clone(made));
        }
        let made = Arc::new(make(image, texels, layout, first)?);
        *mine = Some(Arc::clone(&made));
        self.note(slot, made.bytes());
        Ok(made)
    }

    fn note(&self, slot: &Slot, bytes: u64) {
        let mut held = lock(&self.held);
        let mut sum: u64 = bytes + held.iter().map(|(_, bytes)| bytes).sum::<u64>();
        held.retain(|(old, bytes)| {
            let Some(old) = old.upgrade() else {
                sum -= bytes;
                return false;
            };
            if sum <= MOST_BYTES {
                return true;
            }
            match old.try_lock() {
                Ok(mut made) => *made = None,
                Err(TryLockError::Poisoned(made)) => *made.into_inner() = None,
                // Somebody is at work on it.
                Err(TryLockError::WouldBlock) => return true,
            }
            sum -= bytes;
            false
        });
        held.push_back((Arc::downgrade(slot), bytes));
    }
}

/// Makes levels `first ..` from the one before.
fn make(image: &dyn Image, texels: &Texels, layout: &Layout, first: u32) -> Result<Made, ImageError> {
    let base = first - 1;
    let [width, height] = layout.level_size(base);
    let bottom = Layout::new([width, height], layout.texel_bytes()).map_err(|error| ImageError(error.to_string()))?;
    let mut levels: Vec<Vec<u8>> = (1..bottom.levels())
        .map(|level| {
            let [width, height] = bottom.level_size(level);
            Vec::with_capacity((width as usize * height as usize * bottom.texel_bytes() as usize).next_multiple_of(4))
        })
        .collect();
    let row_bytes = width as usize * texels.file_bytes();
    let band = u32::try_from((BAND_BYTES / row_bytes).max(1)).unwrap_or(1).min(height);
    let mut raw = vec![0; row_bytes * band as usize];
    let mut values = vec![0.0; width as usize * texels.channels()];
    let mut pyramid = Pyramid::new(&bottom, texels.channels());
    for y in (0..height).step_by(band as usize) {
        let rows = band.min(height - y);
        let raw = &mut raw[..row_bytes * rows as usize];
        image.read(base, [0, y], [width, rows], raw)?;
        for row in raw.chunks_exact(row_bytes) {
            texels.decode(row, &mut values);
            pyramid.push(&values, &mut |level, _, row| {
                if let Some(level) = levels.get_mut(level as usize - 1) {
                    texels.encode(row, level);
                }
            });
        }
    }
    Ok(Made { first, levels })
}
