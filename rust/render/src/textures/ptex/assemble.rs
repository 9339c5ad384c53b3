// SPDX-License-Identifier: Apache-2.0
//! Blocks of faces to tiles. Blocks of each class come in the order of faces; a tile goes out when no block of it is
//! still to come, so only about one tile for each class is held.

use super::super::convert::TileSink;
use super::super::image::ImageError;
use oocpt_abi::TILE_SIDE;
use oocpt_core::texture::{FaceLayout, TILE_TEXELS};
use std::collections::BTreeMap;

/// A class: where its texels are, and how far it has come.
#[derive(Clone, Copy, Debug)]
struct FaceClass {
    done: u64,
    end: u64,
}

/// See the module.
pub(super) struct FaceAssembler {
    texel_bytes: usize,
    texels: u64,
    classes: Vec<FaceClass>,
    /// Tiles under way.
    open: BTreeMap<u32, Vec<u8>>,
}

impl FaceAssembler {
    pub(super) fn new(layout: &FaceLayout, texel_bytes: usize) -> Self {
        let class = |class: u32| {
            let blocks = || (0..layout.faces()).filter_map(|face| layout.block(class, face));
            let end = |block: oocpt_core::texture::FaceBlock| u64::from(block.first) + u64::from(block.texels());
            FaceClass {
                done: blocks().next().map_or(0, |block| u64::from(block.first)),
                end: blocks().next_back().map_or(0, end),
            }
        };
        Self {
            texel_bytes,
            texels: u64::from(layout.texels()),
            classes: (0..layout.classes()).map(class).collect(),
            open: BTreeMap::new(),
        }
    }

    /// Takes the bytes of a block.
    pub(super) fn block(&mut self, class: u32, first: u32, bytes: &[u8]) -> Result<(), ImageError> {
        let texel = self.texel_bytes.max(1);
        let count = (bytes.len() / texel) as u64;
        let Some(of_class) = self.classes.get_mut(class as usize) else { return Err(outside()) };
        if u64::from(first) < of_class.done || u64::from(first) + count > of_class.end {
            return Err(outside());
        }
        of_class.done = u64::from(first) + count;
        let (mut at, mut rest) = (first, bytes);
        while !rest.is_empty() {
            let tile = at / TILE_TEXELS;
            let begin = (at % TILE_TEXELS) as usize * texel;
            let rows = self.rows(tile);
            let out = self.open.entry(tile).or_insert_with(|| vec![0; (rows * TILE_SIDE) as usize * texel]);
            let length = rest.len().min(out.len().saturating_sub(begin));
            let (now, later) = rest.split_at(length);
            let Some(out) = out.get_mut(begin..begin + length).filter(|_| length > 0) else { return Err(outside()) };
            out.copy_from_slice(now);
            at += u32::try_from(length / texel).unwrap_or(0);
            rest = later;
        }
        Ok(())
    }

    /// Gives away the tiles that are whole.
    pub(super) fn flush(&mut self, sink: &mut dyn TileSink) -> Result<(), ImageError> {
        let is_whole = |tile: u32| {
            let begin = u64::from(tile) * u64::from(TILE_TEXELS);
            let end = begin + u64::from(TILE_TEXELS);
            self.classes.iter().all(|class| class.done >= class.end || end <= class.done || begin >= class.end)
        };
        let whole: Vec<u32> = self.open.keys().copied().filter(|tile| is_whole(*tile)).collect();
        for tile in whole {
            if let Some(bytes) = self.open.remove(&tile) {
                self.give(tile, &bytes, sink)?;
            }
        }
        Ok(())
    }

    /// Gives away the rest.
    pub(super) fn finish(mut self, sink: &mut dyn TileSink) -> Result<(), ImageError> {
        for (tile, bytes) in std::mem::take(&mut self.open) {
            self.give(tile, &bytes, sink)?;
        }
        Ok(())
    }

    fn rows(&self, tile: u32) -> u32 {
        let begin = u64::from(tile) * u64::from(TILE_TEXELS);
        let texels = self.texels.saturating_sub(begin).min(u64::from(TILE_TEXELS));
        u32::try_from(texels).unwrap_or(TILE_TEXELS) / TILE_SIDE
    }

    fn give(&self, tile: u32, bytes: &[u8], sink: &mut dyn TileSink) -> Result<(), ImageError> {
        sink.tile(0, [0, tile * TILE_SIDE], [TILE_SIDE, self.rows(tile)], bytes)
    }
}

fn outside() -> ImageError {
    ImageError("has texels outside of it".into())
}
