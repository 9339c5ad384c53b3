// SPDX-License-Identifier: Apache-2.0
//! What is known of a cutout without its texture: how much of each part of the picture is there. The threshold comes
//! before the filter: a cell says in what share of its area the texture, looked up at its finest level, is at or above
//! the threshold, or what its opacity is there in the mean. The cell that a ray meets decides, however wide the ray is:
//! where nothing of it is there or all is, that is sure; else a wide lookup has the cell's probability, a narrow one is
//! made at the finest level. So coverage is the same from every distance, by the rays of a pixel, and what lies
//! outside of cells that have something is there for no ray: bounds may leave it out.
//!
//! Words, u32: width | height << 16 of level 0; a word of modes; cells, a byte each, row by row. Modes: wrap of s and
//! of t (two bits each), a bit that is `MASK_SET`'s, the fineness (3 bits from 4 on), the level (5 bits from 8 on), and
//! from 24 on the byte of what is around the picture. Cells are texels of the level: level 0 with 2^fine cells along a
//! texel, or the first one whose sides are short enough. A byte is 0 only where nothing is there, but for a rim of no
//! area to speak of, which then is not there; 255 only where all is, whatever rounds.
//!
//! A record of a set of files has modes `MASK_SET` and, for each of 100 parts, the distance of its mask in units of 16
//! bytes from the first word, or 0.
//!
//! Pure; any thread. `shaders/traversal/opacity_mask.glsl` and `oocpt_traverse` read it.

use super::{TileLayout, Wrap};
use cells::OpacityCell;
use grid::GridReduction;
use rayon::prelude::*;

/// Cells along a side of level 0 that are parts of a texel.
const FINE_SIDE: u32 = 256;
/// Of what a lookup can give, on either side, as a share of what the texels around can: the shader may be off by less
/// than that of a texel when it picks the cell.
const PLACE_SLACK: f64 = 1.0 / 1024.0;
/// What is there of a cell in no more than this part of the range of its values is not there.
const RIM: f64 = 1.0 / 1024.0;
/// The same, as a share of the largest texel: rounding of the mean of four.
const ROUNDING: f64 = 1.0e-5;

/// How a material asks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpacityQuery {
    /// Along s and t.
    pub wrap: [Wrap; 2],
    /// The texel around a picture that is not continued.
    pub outside: f32,
    /// Factor of the texel's channel.
    pub scale: f32,
    /// Summand.
    pub bias: f32,
    /// As `Material::opacity_threshold`; 0: the opacity is a probability.
    pub threshold: f32,
}

impl OpacityQuery {
    fn is_chance(&self) -> bool {
        self.threshold <= 0.0
    }

    /// The probability that a lookup which gives `value` meets the surface.
    fn share(&self, value: f64) -> f64 {
        let opacity = value * f64::from(self.scale) + f64::from(self.bias);
        match self.is_chance() {
            true if opacity.is_nan() => 0.0,
            true => opacity.clamp(0.0, 1.0),
            false => f64::from(u8::from(opacity >= f64::from(self.threshold))),
        }
    }

    /// Whether lookups that give `low` to `high` may meet the surface, and whether they may miss it. `largest`: of the
    /// texels around. `rim`: what they may be off where the place is, in one patch; 0: there may be several.
    fn may(&self, [low, high]: [f64; 2], rim: f64, largest: f64) -> [bool; 2] {
        if !largest.is_finite() || !self.scale.is_finite() || !self.bias.is_finite() || self.threshold.is_nan() {
            return [true; 2];
        }
        // There from this opacity on, and missed below the other one: a number from 0 up to but not 1 is compared.
        let [least, sure] = if self.is_chance() { [0.0, 1.0] } else { [self.threshold; 2] }.map(f64::from);
        let factor = f64::from(self.scale).abs();
        let rounding = 2.0 * ROUNDING * (largest * factor + f64::from(self.bias).abs());
        let is_exact = low == high && rim == 0.0;
        let (a, b) = match is_exact {
            // The mean of equal texels is that texel, and the rest is worked out as the shaders do.
            #[expect(clippy::cast_possible_truncation, reason = "a texel")]
            true => [f64::from(low as f32 * self.scale + self.bias); 2].into(),
            false => {
                let [a, b] = [low, high].map(|value| value * f64::from(self.scale) + f64::from(self.bias));
                (a.min(b), a.max(b))
            }
        };
        let off = if is_exact { 0.0 } else { rounding + rim * factor };
        // As at the edge of a picture that repeats: half of what is there on its other side.
        let is_steep = RIM * (b - a) > rounding;
        let is_below = b + rounding < least || (is_steep && b <= least + RIM * (b - a));
        let is_rim = rim > 0.0 && a < least && is_below;
        let may_meet = if self.is_chance() { b + off > least } else { b + off >= least };
        [may_meet && !is_rim, a - off < sure]
    }
}

/// See the module.
#[derive(Clone, Debug, PartialEq)]
pub struct OpacityMask {
    /// What the shaders read.
    pub words: Vec<u32>,
    /// The surface is there whatever the place and the width.
    pub is_opaque: bool,
}

impl OpacityMask {
    /// Cells along both sides, and the cells row by row.
    pub(super) fn cells(&self) -> Option<([u32; 2], &[u8])> {
        let [size, modes, cells @ ..] = self.words.as_slice() else { return None };
        let sides = [size & 0xffff, size >> 16].map(|side| (side >> (modes >> 8 & 31)).max(1) << (modes >> 4 & 7));
        // Shaders read little-endian bytes; so are those of all hosts that have a device.
        let cells: &[u8] = bytemuck::cast_slice(cells);
        Some((sides, cells.get(..sides[0] as usize * sides[1] as usize)?))
    }

    /// The byte of what is around the picture.
    pub(super) fn around(&self) -> u8 {
        self.words.get(1).map_or(u8::MAX, |modes| modes.to_le_bytes()[3])
    }
}

/// What is kept of an image.
#[derive(Clone, Copy, Debug)]
struct KeptLevel {
    level: u32,
    fine: u32,
}

impl KeptLevel {
    /// The first level of at most `most_side` texels a side.
    fn new(layout: &TileLayout, most_side: u32) -> Self {
        let is_small = |level: &u32| layout.level_size(*level).iter().all(|side| *side <= most_side);
        let last = layout.levels().saturating_sub(1);
        let level = (0..=last).find(is_small).unwrap_or(last);
        let [width, height] = layout.size();
        let most = FINE_SIDE.min(most_side);
        let fine = match level {
            0 => (0..=4).rev().find(|fine| width.max(height) << fine <= most).unwrap_or(0),
            _ => 0,
        };
        Self { level, fine }
    }

    fn cells(self, layout: &TileLayout) -> [u32; 2] {
        layout.level_size(self.level).map(|side| side << self.fine)
    }
}

/// Bytes of the mask of an image, of at most `most_side` texels a side.
#[must_use]
pub fn mask_bytes(layout: &TileLayout, most_side: u32) -> usize {
    2 * size_of::<u32>()
        + KeptLevel::new(layout, most_side).cells(layout).map(|side| side as usize).iter().product::<usize>()
}

/// A mask that is made of the rows of level 0 as they come, from the bottom: what is held of them are four.
#[derive(Debug)]
pub struct OpacityMaskMaker {
    query: OpacityQuery,
    layout: TileLayout,
    kept: KeptLevel,
    base: GridReduction,
    /// Rows that came.
    rows: u32,
    /// The first two, and the last two.
    opening: Vec<Vec<f32>>,
    recent: Vec<Vec<f32>>,
}

impl OpacityMaskMaker {
    /// Of an image, of at most `most_side` texels a side; none where its sides are too long for a mask.
    #[must_use]
    pub fn new(layout: &TileLayout, query: &OpacityQuery, most_side: u32) -> Option<Self> {
        let size = layout.size();
        if layout.is_flat() || size.iter().any(|side| *side > 0xffff) {
            return None;
        }
        let kept = KeptLevel::new(layout, most_side);
        let base = GridReduction::new(size.map(|side| side << kept.fine), kept.cells(layout));
        let rows = Vec::new();
        Some(Self { query: *query, layout: *layout, kept, base, rows: 0, opening: rows.clone(), recent: rows })
    }

    /// Takes the next rows, whole ones of one channel; what is more than the image has is left out.
    pub fn push(&mut self, values: &[f32]) {
        let [width, height] = self.layout.size();
        let left = height.saturating_sub(self.rows) as usize;
        let new: Vec<&[f32]> = values.chunks_exact(width as usize).take(left).collect();
        let missing = 2_usize.saturating_sub(self.opening.len());
        self.opening.extend(new.iter().take(missing).map(|row| row.to_vec()));
        let before = std::mem::take(&mut self.recent);
        let rows: Vec<&[f32]> = before.iter().map(Vec::as_slice).chain(new.iter().copied()).collect();
        let begin = self.rows as usize - before.len();
        let cells: Vec<_> =
            rows.par_windows(3).map(|around| self.cells_of([around[0], around[1], around[2]])).collect();
        for (y, of_row) in (begin + 1..).zip(cells) {
            self.add(y, &of_row);
        }
        self.rows += u32::try_from(new.len()).unwrap_or(0);
        self.recent = rows[rows.len().saturating_sub(2)..].iter().map(|row| row.to_vec()).collect();
    }

    /// The cells of a row of texels, those along a texel's side one row after the other.
    fn cells_of(&self, rows: [&[f32]; 3]) -> Vec<OpacityCell> {
        cells::of_row(&self.query, rows, self.kept.fine)
    }

    fn add(&mut self, y: usize, cells: &[OpacityCell]) {
        let stride = (self.layout.size()[0] as usize) << self.kept.fine;
        for (row, cells) in (y << self.kept.fine..).zip(cells.chunks_exact(stride)) {
            self.base.push(row, cells);
        }
    }

    /// The mask; none before all rows have come.
    #[must_use]
    pub fn finish(mut self) -> Option<OpacityMask> {
        let [width, height] = self.layout.size();
        if self.rows != height {
            return None;
        }
        let outside = vec![self.query.outside; width as usize];
        let (opening, recent) = (std::mem::take(&mut self.opening), std::mem::take(&mut self.recent));
        let (bottom, top) = (opening.first()?.as_slice(), recent.last()?.as_slice());
        let [below, above] = match self.query.wrap[1] {
            Wrap::UseMetadata | Wrap::Black => [outside.as_slice(); 2],
            Wrap::Clamp | Wrap::Mirror => [bottom, top],
            Wrap::Repeat => [top, bottom],
        };
        let second = opening.get(1).map_or(above, Vec::as_slice);
        let cells = self.cells_of([below, bottom, second]);
        self.add(0, &cells);
        if let [before, _] = recent.as_slice() {
            let cells = self.cells_of([before, top, above]);
            self.add(height as usize - 1, &cells);
        }
        Some(self.packed())
    }

    fn packed(self) -> OpacityMask {
        let Self { query, layout, kept: KeptLevel { level, fine }, base, .. } = self;
        let cells = base.grid.cells;
        let is_opaque = cells.iter().all(|cell| !cell.may_miss);
        let around = cells::of_value(&query, query.outside).byte();
        let [width, height] = layout.size();
        let [s, t] = query.wrap.map(wrap_bits);
        let mut words = vec![width | height << 16, s | t << 2 | fine << 4 | level << 8 | u32::from(around) << 24];
        let mut bytes: Vec<u8> = cells.iter().map(|cell| cell.byte()).collect();
        bytes.resize(bytes.len().next_multiple_of(size_of::<u32>()), 0);
        words.extend(bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)));
        OpacityMask { words, is_opaque }
    }
}

/// As `WRAP_*` of the shaders.
fn wrap_bits(wrap: Wrap) -> u32 {
    match wrap {
        Wrap::UseMetadata | Wrap::Black => 0,
        Wrap::Clamp => 1,
        Wrap::Repeat => 2,
        Wrap::Mirror => 3,
    }
}

mod cells;
mod grid;

#[cfg(test)]
mod tests;
