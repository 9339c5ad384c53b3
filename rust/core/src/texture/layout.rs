// SPDX-License-Identifier: Apache-2.0
//! Levels and tiles of an image. The shaders' twin is `texture/texture.glsl`.
//!
//! Level `l` has `max(1, size >> l)` texels a side, down to 1 x 1. A tile is up to 128 x 128 texels of one level,
//! numbered row by row, level by level, the finest first; at the right and upper border it is cut to what there is. All
//! levels of at most 64 x 64 share the last tile, one after the other, each at a multiple of 4 bytes.
//!
//! A layout of rows has one level, 128 texels wide and of any height: tile `i` has its texels `i * 128 * 128` and
//! following (`FaceLayout` numbers them).

use oocpt_abi::{TAIL_SIDE, TILE_SIDE};

/// Longest side of an image, texels.
pub const MAX_SIDE: u32 = 1 << 16;

/// How an image is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TileLayout {
    size: [u32; 2],
    texel_bytes: u32,
    /// One level, whatever its size, and no shared tile.
    is_flat: bool,
}

/// Why an image cannot be a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayoutError {
    /// No texel, or too many.
    #[error("an image of {width} x {height} texels is not supported (1 to {MAX_SIDE} a side)")]
    Size {
        /// Texels along s.
        width: u32,
        /// Texels along t.
        height: u32,
    },
    /// A Ptex file without faces.
    #[error("it has no faces")]
    NoFaces,
    /// A face of too many texels.
    #[error("a face of 2^{0} texels a side is not supported (2^14)")]
    Face(u8),
    /// Faces of too many texels in all.
    #[error("its faces have more than 2^32 texels")]
    Texels,
    /// Not 1 to 16 bytes.
    #[error("texels of {0} bytes are not supported")]
    Texel(u32),
}

/// Texels of one level: all of a tile, or a level of the tail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TilePiece {
    /// Level.
    pub level: u32,
    /// The lowest left texel.
    pub at: [u32; 2],
    /// Texels along s and t.
    pub size: [u32; 2],
    /// Where it begins in the tile, bytes.
    pub offset: u64,
}

impl TileLayout {
    /// The layout of an image of `size` texels of `texel_bytes` each.
    pub fn new(size: [u32; 2], texel_bytes: u32) -> Result<Self, LayoutError> {
        let [width, height] = size;
        if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
            return Err(LayoutError::Size { width, height });
        }
        if !matches!(texel_bytes, 1 | 2 | 4 | 8 | 16) {
            return Err(LayoutError::Texel(texel_bytes));
        }
        Ok(Self { size, texel_bytes, is_flat: false })
    }

    /// The layout of `texels` texels in rows of [`TILE_SIDE`].
    pub fn of_rows(texels: u32, texel_bytes: u32) -> Result<Self, LayoutError> {
        let height = texels.div_ceil(TILE_SIDE).max(1);
        Ok(Self { size: [TILE_SIDE, height], is_flat: true, ..Self::new([1, 1], texel_bytes)? })
    }

    /// Whether it has one level of rows ([`Self::of_rows`]).
    pub fn is_flat(&self) -> bool {
        self.is_flat
    }

    /// Texels of level 0.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Bytes of a texel.
    pub fn texel_bytes(&self) -> u32 {
        self.texel_bytes
    }

    /// Number of levels.
    pub fn levels(&self) -> u32 {
        if self.is_flat { 1 } else { 32 - self.size[0].max(self.size[1]).leading_zeros() }
    }

    /// Texels of a level.
    pub fn level_size(&self, level: u32) -> [u32; 2] {
        self.size.map(|side| side.checked_shr(level).unwrap_or(0).max(1))
    }

    /// The first level of the last tile.
    pub fn tail(&self) -> u32 {
        if self.is_flat {
            return 1;
        }
        (0..self.levels()).find(|&level| self.level_size(level).iter().all(|&side| side <= TAIL_SIDE)).unwrap_or(0)
    }

    /// Tiles of a level before the tail, along s and t.
    pub fn tiles_of(&self, level: u32) -> [u32; 2] {
        self.level_size(level).map(|side| side.div_ceil(TILE_SIDE))
    }

    /// Number of the first tile of a level.
    pub fn first_tile(&self, level: u32) -> u32 {
        (0..level.min(self.tail())).map(|level| self.tiles_of(level).iter().product::<u32>()).sum()
    }

    /// Number of the tile of texel `at` of `level`.
    pub fn tile(&self, level: u32, at: [u32; 2]) -> u32 {
        let first = self.first_tile(level);
        if level >= self.tail() {
            return first;
        }
        first + at[1] / TILE_SIDE * self.tiles_of(level)[0] + at[0] / TILE_SIDE
    }

    /// Number of tiles.
    pub fn tile_count(&self) -> u32 {
        self.first_tile(self.tail()) + u32::from(!self.is_flat)
    }

    /// What a tile consists of.
    pub fn pieces(&self, tile: u32) -> Vec<TilePiece> {
        let mut first = 0;
        for level in 0..self.tail() {
            let [columns, rows] = self.tiles_of(level);
            if tile < first + columns * rows {
                let at = [(tile - first) % columns * TILE_SIDE, (tile - first) / columns * TILE_SIDE];
                let whole = self.level_size(level);
                let size = [0, 1].map(|axis: usize| TILE_SIDE.min(whole[axis].saturating_sub(at[axis])));
                return vec![TilePiece { level, at, size, offset: 0 }];
            }
            first += columns * rows;
        }
        let mut offset = 0;
        let mut pieces = Vec::new();
        for level in self.tail()..self.levels() {
            let size = self.level_size(level);
            pieces.push(TilePiece { level, at: [0, 0], size, offset });
            offset += self.bytes_of(size);
        }
        pieces
    }

    /// Bytes of a tile, a multiple of 4.
    pub fn tile_bytes(&self, tile: u32) -> u64 {
        self.pieces(tile).last().map_or(0, |piece| piece.offset + self.bytes_of(piece.size))
    }

    /// Bytes of every tile, in their order.
    pub fn all_tile_bytes(&self) -> impl Iterator<Item = u64> + '_ {
        let of_level = move |level: u32| {
            let (size, tiles) = (self.level_size(level), self.tiles_of(level));
            let side = move |axis: usize, at: u32| TILE_SIDE.min(size[axis].saturating_sub(at * TILE_SIDE));
            (0..tiles[1])
                .flat_map(move |row| (0..tiles[0]).map(move |column| self.bytes_of([side(0, column), side(1, row)])))
        };
        let shared = (!self.is_flat).then(|| self.tile_bytes(self.tile_count() - 1));
        (0..self.tail()).flat_map(of_level).chain(shared)
    }

    /// Bytes of so many texels, rounded up to 4.
    fn bytes_of(&self, size: [u32; 2]) -> u64 {
        let texels = u64::from(size[0]) * u64::from(size[1]);
        (texels * u64::from(self.texel_bytes)).next_multiple_of(4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(width: u32, height: u32) -> TileLayout {
        TileLayout::new([width, height], 4).expect("supported")
    }

    #[test]
    fn every_texel_of_every_level_is_in_one_tile() {
        for (width, height) in [(1, 1), (1, 300), (64, 64), (65, 3), (128, 128), (129, 257), (500, 1000)] {
            let layout = layout(width, height);
            let mut seen: Vec<Vec<u32>> = (0..layout.levels())
                .map(|level| vec![0; layout.level_size(level).iter().product::<u32>() as usize])
                .collect();
            for tile in 0..layout.tile_count() {
                for piece in layout.pieces(tile) {
                    for y in piece.at[1]..piece.at[1] + piece.size[1] {
                        for x in piece.at[0]..piece.at[0] + piece.size[0] {
                            assert_eq!(layout.tile(piece.level, [x, y]), tile, "{width} x {height}: {piece:?}");
                            seen[piece.level as usize][(y * layout.level_size(piece.level)[0] + x) as usize] += 1;
                        }
                    }
                }
            }
            assert!(seen.iter().flatten().all(|&count| count == 1), "{width} x {height}: each texel once");
        }
    }

    #[test]
    fn total_tile_bytes_are_the_sum_over_tiles() {
        for (width, height, texel) in [(1, 1, 1), (300, 257, 4), (128, 128, 8), (1000, 3, 2), (129, 640, 16)] {
            let layout = TileLayout::new([width, height], texel).expect("supported");
            let each: Vec<u64> = (0..layout.tile_count()).map(|tile| layout.tile_bytes(tile)).collect();
            assert_eq!(layout.all_tile_bytes().collect::<Vec<_>>(), each, "{width} x {height}, {texel} bytes");
        }
    }

    #[test]
    fn known_layout_of_a_large_image() {
        let layout = layout(16384, 16384);
        assert_eq!((layout.levels(), layout.tail()), (15, 8), "levels of 16384 down to 1, of 64 and less together");
        let tiles: u32 = (0..8).map(|level| (128_u32 >> level).pow(2)).sum();
        assert_eq!(layout.tile_count(), tiles + 1, "tiles of eight levels and the tail");
        assert_eq!(layout.tile_bytes(0), 64 << 10, "a whole tile");
        assert_eq!(layout.tile_bytes(tiles), 4 * (0..7).map(|level| (64_u64 >> level).pow(2)).sum::<u64>(), "the tail");
    }

    #[test]
    fn row_layouts_have_one_level_and_unshared_tiles() {
        for (texels, bytes) in [(128, 4), (128 * 300, 1), (128 * 128, 8), (1 << 31, 4)] {
            let rows = TileLayout::of_rows(texels, bytes).expect("supported");
            let tiles = texels.div_ceil(128 * 128);
            assert_eq!((rows.levels(), rows.tile_count()), (1, tiles), "{texels} texels");
            let last = u64::from(texels - (tiles - 1) * 128 * 128) * u64::from(bytes);
            assert_eq!(rows.tile_bytes(tiles - 1), last, "{texels} texels: the last tile");
            assert_eq!(rows.pieces(tiles - 1)[0].at, [0, (tiles - 1) * 128], "{texels} texels: where it begins");
            assert_eq!(rows.all_tile_bytes().count(), tiles as usize, "{texels} texels");
        }
    }

    #[test]
    fn tail_levels_are_word_aligned() {
        let bytes = TileLayout::new([3, 1], 1).expect("supported");
        let offsets: Vec<u64> = bytes.pieces(0).iter().map(|piece| piece.offset).collect();
        assert_eq!((offsets, bytes.tile_bytes(0)), (vec![0, 4], 8), "three bytes and one, each in a word");
    }

    #[test]
    fn bad_sizes_are_refused() {
        assert!(TileLayout::new([0, 5], 4).is_err() && TileLayout::new([5, MAX_SIDE + 1], 4).is_err(), "sides");
        assert_eq!(TileLayout::new([5, 5], 3), Err(LayoutError::Texel(3)), "three channels become four before");
    }
}
