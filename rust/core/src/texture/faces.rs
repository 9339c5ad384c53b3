// SPDX-License-Identifier: Apache-2.0
//! Arranges the texels of a Ptex file in one row: blocks of faces and of their reductions. The shaders' twin is in
//! `texture/texture.glsl`.
//!
//! A face has `2^u` by `2^v` texels. Its reduction of class `c` halves both sides until the longer one has `2^c`
//! texels, the shorter one at least 1. Each reduction is a block of (width + 2) x (height + 2) texels, row by row from
//! v = 0: the border of one texel repeats those of the neighbours, so that a bilinear lookup needs no other block
//! (`McDonald` and Burley 2011, "Per-Face Texture Mapping for Real-time Rendering"). Blocks of a class lie together,
//! the coarsest class first, so that a distant view needs few tiles. A tile has [`TILE_TEXELS`] texels; a block that
//! fits a tile lies in one. Pure.

use super::layout::LayoutError;
use oocpt_abi::TILE_SIDE;

/// Number of texels of a tile.
pub const TILE_TEXELS: u32 = TILE_SIDE * TILE_SIDE;
/// Largest number of texels along a side of a face, as a power of two.
pub const MAX_FACE_LOG2: u8 = 14;

/// The texels of one reduction of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaceBlock {
    /// Number of its first texel, which is the lower left one of the border.
    pub first: u32,
    /// Texels along u and v, without the border.
    pub size: [u32; 2],
}

impl FaceBlock {
    /// Texels of the block, with the border.
    #[must_use]
    pub fn texels(&self) -> u32 {
        (self.size[0] + 2) * (self.size[1] + 2)
    }
}

/// Positions of the texels of all faces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FaceLayout {
    log2: Vec<[u8; 2]>,
    /// First texels of blocks by class, then by face; 0 if the face has no such reduction.
    first: Vec<u32>,
    classes: u32,
    texels: u32,
}

impl FaceLayout {
    /// The layout of faces with these sizes, as powers of two.
    ///
    /// # Errors
    /// There is no face, one is too large, or all have more than 2^32 texels.
    pub fn new(log2: Vec<[u8; 2]>) -> Result<Self, LayoutError> {
        let largest = log2.iter().flatten().copied().max().ok_or(LayoutError::NoFaces)?;
        if largest > MAX_FACE_LOG2 {
            return Err(LayoutError::Face(largest));
        }
        let classes = u32::from(largest) + 1;
        let mut first = Vec::with_capacity(log2.len() * classes as usize);
        let mut next = 0_u64;
        for class in 0..classes {
            for face in &log2 {
                let Some(size) = class_size(*face, class) else {
                    first.push(0);
                    continue;
                };
                let texels = u64::from(FaceBlock { first: 0, size }.texels());
                let tile = u64::from(TILE_TEXELS);
                if next % tile + texels > tile {
                    next = next.next_multiple_of(tile);
                }
                first.push(u32::try_from(next).map_err(|_too_many| LayoutError::Texels)?);
                next += texels;
            }
        }
        let texels =
            u32::try_from(next.next_multiple_of(u64::from(TILE_SIDE))).map_err(|_too_many| LayoutError::Texels)?;
        Ok(Self { log2, first, classes, texels })
    }

    /// Number of faces.
    #[must_use]
    pub fn faces(&self) -> u32 {
        u32::try_from(self.log2.len()).unwrap_or(u32::MAX)
    }

    /// Number of classes.
    #[must_use]
    pub fn classes(&self) -> u32 {
        self.classes
    }

    /// Number of texels of all blocks and of the gaps between them, a multiple of [`TILE_SIDE`].
    #[must_use]
    pub fn texels(&self) -> u32 {
        self.texels
    }

    /// The block of a face in a class; `None` if it has none.
    #[must_use]
    pub fn block(&self, class: u32, face: u32) -> Option<FaceBlock> {
        let size = class_size(*self.log2.get(face as usize)?, class)?;
        let first = *self.first.get(class as usize * self.log2.len() + face as usize)?;
        Some(FaceBlock { first, size })
    }

    /// The words that the shaders read: for each face log2 of its texels along u and, from bit 8 on, along v; then the
    /// first texels of blocks, by class and face.
    #[must_use]
    pub fn directory(&self) -> Vec<u32> {
        let sizes = self.log2.iter().map(|[u, v]| u32::from(*u) | u32::from(*v) << 8);
        sizes.chain(self.first.iter().copied()).collect()
    }

    /// Words of [`Self::directory`].
    #[must_use]
    pub fn directory_words(&self) -> usize {
        self.log2.len() + self.first.len()
    }
}

/// Texels along the sides of a face's reduction of a class; `None` above its own size.
#[must_use]
pub fn class_size(log2: [u8; 2], class: u32) -> Option<[u32; 2]> {
    let level = u32::from(log2[0].max(log2[1])).checked_sub(class)?;
    Some(log2.map(|log2| 1 << u32::from(log2).saturating_sub(level)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_do_not_overlap_and_lie_in_one_tile_if_they_fit() {
        let log2: Vec<[u8; 2]> = (0..300_u32).map(|k| [(k % 8) as u8, (k * k % 9) as u8]).collect();
        let layout = FaceLayout::new(log2.clone()).expect("small");
        let mut used = vec![false; layout.texels() as usize];
        for (face, log2) in (0..).zip(&log2) {
            let own = u32::from(log2[0].max(log2[1]));
            for class in 0..layout.classes() {
                let Some(block) = layout.block(class, face) else {
                    assert!(class > own, "face {face} has no class {class}");
                    continue;
                };
                assert_eq!(block.size.iter().copied().max(), Some(1 << class), "the longer side");
                if class == own {
                    assert_eq!(block.size, log2.map(|log2| 1 << log2), "all of the face");
                }
                let end = block.first + block.texels();
                let tiles = (end - 1) / TILE_TEXELS - block.first / TILE_TEXELS;
                assert!(tiles == 0 || block.texels() > TILE_TEXELS, "face {face}, class {class}: two tiles");
                for texel in &mut used[block.first as usize..end as usize] {
                    assert!(!std::mem::replace(texel, true), "face {face}, class {class}: a texel of another block");
                }
            }
        }
        let directory = layout.directory();
        assert_eq!(directory.len(), layout.directory_words());
        assert_eq!(directory[7], u32::from(log2[7][0]) | u32::from(log2[7][1]) << 8);
        assert_eq!(directory[300 * (1 + 3) + 7], layout.block(3, 7).expect("it has one").first, "class 3, face 7");
    }

    #[test]
    fn oversized_ptex_layouts_are_refused() {
        assert_eq!(FaceLayout::new(Vec::new()), Err(LayoutError::NoFaces));
        assert_eq!(FaceLayout::new(vec![[3, MAX_FACE_LOG2 + 1]]), Err(LayoutError::Face(15)));
        assert_eq!(FaceLayout::new(vec![[14, 14]; 16]), Err(LayoutError::Texels));
        assert!(FaceLayout::new(vec![[14, 14]; 11]).is_ok(), "2^32 texels are not reached");
    }
}
