// SPDX-License-Identifier: Apache-2.0
//! What is known of a cutout without its texture: for every place and every pair of levels that a lookup can mix,
//! whether all that the lookup could give means that the surface is there, or that it is not, or neither. After the
//! states of opacity micromaps (Gruen, Benthin and Woop 2020, "Sub-Triangle Opacity Masks for Faster Ray Tracing of
//! Transparent Objects"), but of the texture and by level, since a lookup here is as wide as its ray's cone.
//!
//! Words, u32: width | height << 16 of level 0; wrap modes of s and of t (two bits each) | first pair << 8 | last pair
//! << 16; for each pair the number of its first cell and the cells of a row; cells, 16 to a word, lowest bits first.
//! Pair k is of levels k and k + 1, the last one of the coarsest level alone. Its cell (i, j) is for places from texel
//! centre i - 1 to i and j - 1 to j of level k, so it has one more than the level has texels along either side.
//!
//! Pure; any thread. `shaders/traversal/opacity_mask.glsl` reads it.

use super::{Layout, Wrap};

/// Levels with a longer side have no mask.
pub const MASK_SIDE: u32 = 512;
/// Of what a lookup can give, on either side, as a share of what the texels around can: the shader may be off by less
/// than that of a texel when it picks the cell.
const PLACE_SLACK: f64 = 1.0 / 128.0;
/// The same, as a share of the largest texel: rounding of the mean of eight.
const ROUNDING: f64 = 1.0e-5;
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
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpacityMask {
    /// What the shaders read.
    pub words: Vec<u32>,
    /// The surface is there whatever the place and the width.
    pub is_opaque: bool,
}

/// The first pair of levels that a mask is made for.
#[must_use]
pub fn first_pair(layout: &Layout) -> u32 {
    let is_small = |level: &u32| layout.level_size(*level).iter().all(|side| *side <= MASK_SIDE);
    (0..layout.levels()).find(is_small).unwrap_or(0)
}

impl OpacityMask {
    /// Of an image whose levels from [`first_pair`] on have these values of the channel, row by row.
    #[must_use]
    pub fn new(layout: &Layout, values: &[Vec<f32>], query: &OpacityQuery) -> Option<Self> {
        let first = first_pair(layout);
        let last = layout.levels().checked_sub(1)?;
        let levels: Vec<Level<'_>> = (first..=last)
            .zip(values)
            .map(|(level, values)| Level { size: layout.level_size(level), values })
            .collect();
        let is_whole = levels.len() == (last - first + 1) as usize
            && levels.iter().all(|level| level.values.len() == level.size[0] as usize * level.size[1] as usize);
        let [width, height] = layout.size();
        if !is_whole || width > 0xffff || height > 0xffff {
            return None;
        }
        let pairs = levels.len();
        let mut cell = 16 * (2 + 2 * pairs);
        let mut words = vec![
            width | height << 16,
            wrap_bits(query.wrap[0]) | wrap_bits(query.wrap[1]) << 2 | first << 8 | last << 16,
        ];
        for level in &levels {
            let columns = level.size[0] + 1;
            words.extend([u32::try_from(cell).ok()?, columns]);
            cell += (columns as usize * (level.size[1] as usize + 1)).next_multiple_of(16);
        }
        // Cells at the rim have what lies beside the image.
        let mut is_opaque = first == 0;
        for (at, level) in levels.iter().enumerate() {
            let pair = Pair { finer: level, coarser: levels.get(at + 1), query };
            let (columns, rows) = (level.size[0] + 1, level.size[1] + 1);
            let mut word = 0;
            let mut count = 0;
            for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
                let known = pair.at([column, row]);
                is_opaque &= known == Presence::Always;
                word |= (known as u32) << (2 * (count % 16));
                count += 1;
                if count % 16 == 0 {
                    words.push(word);
                    word = 0;
                }
            }
            if count % 16 != 0 {
                words.push(word);
            }
        }
        Some(Self { words, is_opaque })
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

struct Level<'a> {
    size: [u32; 2],
    values: &'a [f32],
}

impl Level<'_> {
    /// Texel `x` of an axis, wherever it is; `None` is transparent black.
    fn wrapped(&self, axis: usize, x: i64, wrap: Wrap) -> Option<usize> {
        let size = i64::from(self.size[axis]);
        let x = match wrap {
            _ if (0..size).contains(&x) => x,
            Wrap::UseMetadata | Wrap::Black => return None,
            Wrap::Clamp => x.clamp(0, size - 1),
            Wrap::Repeat => x.rem_euclid(size),
            Wrap::Mirror => {
                let x = x.rem_euclid(2 * size);
                x.min(2 * size - 1 - x)
            }
        };
        usize::try_from(x).ok()
    }

    fn texel(&self, at: [i64; 2], wrap: [Wrap; 2]) -> f32 {
        match (self.wrapped(0, at[0], wrap[0]), self.wrapped(1, at[1], wrap[1])) {
            (Some(x), Some(y)) => self.values.get(y * self.size[0] as usize + x).copied().unwrap_or(f32::NAN),
            _ => 0.0,
        }
    }
}

/// Smallest and largest of some texels.
#[derive(Clone, Copy)]
struct Hull {
    low: f32,
    high: f32,
    is_finite: bool,
}

impl Hull {
    const EMPTY: Self = Self { low: f32::INFINITY, high: f32::NEG_INFINITY, is_finite: true };

    fn add(&mut self, value: f32) {
        self.low = self.low.min(value);
        self.high = self.high.max(value);
        self.is_finite &= value.is_finite();
    }
}

struct Pair<'a> {
    finer: &'a Level<'a>,
    coarser: Option<&'a Level<'a>>,
    query: &'a OpacityQuery,
}

impl Pair<'_> {
    fn at(&self, cell: [u32; 2]) -> Presence {
        // Of the texels that a lookup in the cell mixes, and of one more around, which it may if it is at the edge.
        let (mut near, mut around) = (Hull::EMPTY, Hull::EMPTY);
        let fine = cell.map(|i| (i64::from(i) - 1, i64::from(i)));
        self.add(self.finer, fine, &mut near, &mut around);
        if let Some(coarser) = self.coarser {
            let range = |axis: usize| {
                let (from, to) = (self.finer.size[axis], coarser.size[axis]);
                // In halves of texels of the finer level, from 0 to its whole side.
                let ends = [2 * i64::from(cell[axis]) - 1, 2 * i64::from(cell[axis]) + 1];
                // x * to / (2 from) - 1/2, rounded down.
                let [low, high] = ends.map(|end| {
                    let x = end.clamp(0, 2 * i64::from(from));
                    (x * i64::from(to) - i64::from(from)).div_euclid(2 * i64::from(from))
                });
                (low, high + 1)
            };
            self.add(coarser, [range(0), range(1)], &mut near, &mut around);
        }
        self.query.decide(near, around)
    }

    fn add(
        &self,
        level: &Level<'_>,
        [(left, right), (bottom, top)]: [(i64, i64); 2],
        near: &mut Hull,
        around: &mut Hull,
    ) {
        for (y, x) in (bottom - 1..=top + 1).flat_map(|y| (left - 1..=right + 1).map(move |x| (y, x))) {
            let value = level.texel([x, y], self.query.wrap);
            around.add(value);
            if (left..=right).contains(&x) && (bottom..=top).contains(&y) {
                near.add(value);
            }
        }
    }
}

impl OpacityQuery {
    fn decide(&self, near: Hull, around: Hull) -> Presence {
        if !around.is_finite || !self.scale.is_finite() || !self.bias.is_finite() {
            return Presence::Unknown;
        }
        if near.low == near.high && around.low == around.high {
            // The mean of equal texels is that texel, and the rest is worked out as the shaders do.
            let opacity = near.low * self.scale + self.bias;
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
        let [low, high, least, most] = [near.low, near.high, around.low, around.high].map(f64::from);
        let largest = least.abs().max(most.abs());
        let slack = (most - least) * PLACE_SLACK + largest * ROUNDING;
        let [a, b] = [low - slack, high + slack].map(|value| value * scale + bias);
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

#[cfg(test)]
#[path = "opacity_mask_tests.rs"]
mod tests;
