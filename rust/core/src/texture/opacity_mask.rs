// SPDX-License-Identifier: Apache-2.0
//! What is known of a cutout without its texture: for every place and every width of a lookup, whether all that the
//! lookup could give means that the surface is there, or that it is not, or neither. After the states of opacity
//! micromaps (Gruen, Benthin and Woop 2020, "Sub-Triangle Opacity Masks for Faster Ray Tracing of Transparent
//! Objects"), but of the texture and by level, since a lookup here is as wide as its ray's cone.
//!
//! Words, u32: width | height << 16 of level 0; wrap modes of s and of t (two bits each) | first pair << 8 | last pair
//! << 16; for each pair the number of its first cell, and the cells of a row | [`Fineness::cells`] << 16 |
//! [`Fineness::bins`] << 24; cells, 16 to a word, lowest bits first. Pair k is of levels k and k + 1, the last one of
//! the coarsest level alone. Its cells are by the share of the coarser level (a bin is a part of 0 to 1), row, column.
//! With one cell to a texel, cell i is for places from texel centre i - 1 to i of level k; with more, all begin at
//! place 0. Either way there is one more than fit along a side.
//!
//! A width need be known to 1 / [`WIDTHS`] of itself only.
//!
//! Pure; any thread. `shaders/traversal/opacity_mask.glsl` reads it.

use super::{Layout, Wrap};

/// Levels with a longer side have no mask.
pub const MASK_SIDE: u32 = 512;
/// How exactly the width of a lookup has to be known.
pub(super) const WIDTHS: f64 = 256.0;
/// Of what a lookup can give, on either side, as a share of what the texels around can: the shader may be off by less
/// than that of a texel when it picks the cell.
const PLACE_SLACK: f64 = 1.0 / 1024.0;
/// The same, as a share of the largest texel: rounding of the mean of eight.
const ROUNDING: f64 = 1.0e-5;
/// A level with a longer side has one cell to a texel.
const FINE_SIDE: u32 = 128;

/// How a material asks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpacityQuery {
    /// Along s and t.
    pub wrap: [Wrap; 2],
    /// Factor of the texel's channel.
    pub scale: f32,
    /// Summand.
    pub bias: f32,
    /// As `Material::opacity_threshold`.
    pub threshold: f32,
}

/// What is known at a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// Nothing.
    Unknown = 0,
    /// The surface is not there.
    Never = 1,
    /// It is.
    Always = 2,
}

/// See the module.
#[derive(Clone, Debug, PartialEq)]
pub struct OpacityMask {
    /// What the shaders read.
    pub words: Vec<u32>,
    /// The surface is there whatever the place and the width.
    pub is_opaque: bool,
    /// Share of the cells that say nothing, the mean of all pairs.
    pub unknown: f32,
}

/// The first pair of levels that a mask is made for.
#[must_use]
pub fn first_pair(layout: &Layout) -> u32 {
    let is_small = |level: &u32| layout.level_size(*level).iter().all(|side| *side <= MASK_SIDE);
    (0..layout.levels()).find(is_small).unwrap_or(0)
}

/// How finely a pair of levels is cut, as powers of two.
#[derive(Clone, Copy, Debug)]
struct Fineness {
    /// Cells along a texel.
    cells: u32,
    /// Bins of the coarser level's share.
    bins: u32,
}

impl Fineness {
    /// Of a pair that begins with a level of this size.
    fn of(size: [u32; 2], has_coarser: bool) -> Self {
        let side = size[0].max(size[1]);
        let cells = (0..4).find(|cells| side << cells >= FINE_SIDE).unwrap_or(4);
        // The coarser the levels, the more they differ; and the fewer cells they have.
        let bins = match side {
            _ if !has_coarser => 0,
            0..=2 => 5,
            3..=8 => 4,
            9..=32 => 3,
            33..=128 => 2,
            129..=256 => 1,
            _ => 0,
        };
        Self { cells, bins }
    }
}

impl OpacityMask {
    /// Of an image whose levels from [`first_pair`] on have these values of the channel, row by row.
    #[must_use]
    pub fn new(layout: &Layout, values: &[Vec<f32>], query: &OpacityQuery) -> Option<Self> {
        let first = first_pair(layout);
        let last = layout.levels().checked_sub(1)?;
        let levels: Vec<Level<'_>> = (first..=last)
            .zip(values)
            .map(|(level, values)| Level { size: layout.level_size(level), values, wrap: query.wrap })
            .collect();
        let is_whole = levels.len() == (last - first + 1) as usize
            && levels.iter().all(|level| level.values.len() == level.size[0] as usize * level.size[1] as usize);
        let [width, height] = layout.size();
        if !is_whole || width > 0xffff || height > 0xffff {
            return None;
        }
        let mut words = vec![
            width | height << 16,
            wrap_bits(query.wrap[0]) | wrap_bits(query.wrap[1]) << 2 | first << 8 | last << 16,
        ];
        words.resize(2 + 2 * levels.len(), 0);
        let mut is_opaque = first == 0;
        let mut unknown = 0.0;
        for at in 0..levels.len() {
            let fineness = Fineness::of(levels[at].size, at + 1 < levels.len());
            let cells = Pair { levels: &levels, at, fineness, query, is_first: at == 0 && first > 0 }.cells();
            is_opaque &= cells.known.iter().all(|known| *known == Presence::Always);
            let of_pair = cells.known.iter().filter(|known| **known == Presence::Unknown).count();
            unknown += of_pair as f32 / (cells.known.len() * levels.len()) as f32;
            words[2 + 2 * at] = u32::try_from(16 * words.len()).ok()?;
            words[3 + 2 * at] = cells.columns | fineness.cells << 16 | fineness.bins << 24;
            words.extend(cells.known.chunks(16).map(|of_word| {
                of_word.iter().enumerate().fold(0, |word, (i, known)| word | (*known as u32) << (2 * i))
            }));
        }
        Some(Self { words, is_opaque, unknown })
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

impl OpacityQuery {
    /// What is known where a lookup gives `low` to `high` of texels from `least` to `most`.
    fn decide(&self, near: Hull, around: Hull) -> Presence {
        if !around.is_finite || !self.scale.is_finite() || !self.bias.is_finite() {
            return Presence::Unknown;
        }
        if around.low == around.high {
            // The mean of equal texels is that texel, and the rest is worked out as the shaders do.
            #[expect(clippy::cast_possible_truncation, reason = "a texel")]
            let opacity = around.low as f32 * self.scale + self.bias;
            return match self.threshold > 0.0 {
                true if opacity >= self.threshold => Presence::Always,
                true if opacity < self.threshold => Presence::Never,
                // Compared with a number from 0 up to but not 1.
                false if opacity >= 1.0 => Presence::Always,
                false if opacity <= 0.0 => Presence::Never,
                _ => Presence::Unknown,
            };
        }
        if self.threshold.is_nan() || self.threshold <= 0.0 {
            return Presence::Unknown;
        }
        let [scale, bias, threshold] = [self.scale, self.bias, self.threshold].map(f64::from);
        let largest = around.low.abs().max(around.high.abs());
        let slack = (around.high - around.low) * PLACE_SLACK + largest * ROUNDING;
        let [a, b] = [near.low - slack, near.high + slack].map(|value| value * scale + bias);
        let rounding = (largest * scale.abs() + bias.abs()) * ROUNDING;
        if a.min(b) - rounding >= threshold {
            Presence::Always
        } else if a.max(b) + rounding < threshold {
            Presence::Never
        } else {
            Presence::Unknown
        }
    }
}

mod cells;

use cells::{Hull, Level, Pair};

#[cfg(test)]
mod tests;
