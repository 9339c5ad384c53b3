// SPDX-License-Identifier: Apache-2.0
//! The cells of a mask's pair of levels: what lookups in a cell can give. Pure; any thread.

use super::{Fineness, OpacityQuery, Presence, WIDTHS};
use crate::texture::Wrap;
use std::ops::Range;

/// A level's texels, row by row.
pub(super) struct Level<'a> {
    pub(super) size: [u32; 2],
    pub(super) values: &'a [f32],
    pub(super) wrap: [Wrap; 2],
}

/// Smallest and largest of some values.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hull {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) is_finite: bool,
}

impl Hull {
    fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut hull = Self { low: f64::INFINITY, high: f64::NEG_INFINITY, is_finite: true };
        for value in values {
            hull.low = hull.low.min(value);
            hull.high = hull.high.max(value);
            hull.is_finite &= value.is_finite();
        }
        hull
    }

    fn joined(self, other: Self) -> Self {
        let is_finite = self.is_finite && other.is_finite;
        Self { low: self.low.min(other.low), high: self.high.max(other.high), is_finite }
    }

    /// Of `self` and up to `share` of `other`.
    fn mixed(self, other: Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + share * (b - a);
        let is_finite = self.is_finite && other.is_finite;
        Self { low: self.low.min(mix(self.low, other.low)), high: self.high.max(mix(self.high, other.high)), is_finite }
    }
}

/// The lower of the two texels around a place along an axis, and the share of the upper one.
#[derive(Clone, Copy)]
struct Tap {
    texel: i64,
    share: f64,
}

impl Level<'_> {
    /// Texel `x` of an axis, wherever it is; `None` is transparent black.
    fn wrapped(&self, axis: usize, x: i64) -> Option<usize> {
        let size = i64::from(self.size[axis]);
        let x = match self.wrap[axis] {
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

    /// At a place along an axis, from 0 to 1.
    fn tap(&self, axis: usize, place: f64) -> Tap {
        let x = place * f64::from(self.size[axis]) - 0.5;
        #[expect(clippy::cast_possible_truncation, reason = "from -1 to the side")]
        let texel = x.floor() as i64;
        Tap { texel, share: x - x.floor() }
    }

    /// What lookups give at all pairs of two lists of places, row by row.
    fn at(&self, [xs, ys]: [&[f64]; 2]) -> Vec<f64> {
        let columns: Vec<(Option<usize>, Option<usize>, f64)> = xs
            .iter()
            .map(|x| self.tap(0, *x))
            .map(|tap| (self.wrapped(0, tap.texel), self.wrapped(0, tap.texel + 1), tap.share))
            .collect();
        let across: Vec<f64> = self
            .values
            .chunks(self.size[0] as usize)
            .flat_map(|row| {
                let texel = |x: Option<usize>| x.and_then(|x| row.get(x)).map_or(0.0, |value| f64::from(*value));
                columns.iter().map(move |(a, b, share)| mix(texel(*a), texel(*b), *share))
            })
            .collect();
        let row = |y: i64| self.wrapped(1, y).and_then(|y| across.get(y * xs.len()..(y + 1) * xs.len()));
        let mut values = Vec::with_capacity(xs.len() * ys.len());
        for Tap { texel, share } in ys.iter().map(|y| self.tap(1, *y)) {
            let [lower, upper] = [row(texel), row(texel + 1)];
            let of = |row: Option<&[f64]>, x: usize| row.map_or(0.0, |row| row[x]);
            values.extend((0..xs.len()).map(|x| mix(of(lower, x), of(upper, x), share)));
        }
        values
    }

    /// Of the texels that lookups in each cell mix, and `beside` more on every side; row by row.
    fn hulls(&self, [columns, rows]: [&[Span]; 2], beside: i64) -> Vec<Hull> {
        let range = |axis: usize, span: &Span| {
            let [low, high] = span.ends.map(|place| self.tap(axis, place).texel);
            low - beside..=high + 1 + beside
        };
        let texels: Vec<Vec<Option<usize>>> =
            columns.iter().map(|span| range(0, span).map(|x| self.wrapped(0, x)).collect()).collect();
        let across: Vec<Hull> = self
            .values
            .chunks(self.size[0] as usize)
            .flat_map(|row| {
                let texel = |x: Option<usize>| x.and_then(|x| row.get(x)).map_or(0.0, |value| f64::from(*value));
                texels.iter().map(move |of_cell| Hull::of(of_cell.iter().map(|x| texel(*x))))
            })
            .collect();
        let outside = vec![Hull::of([0.0]); columns.len()];
        let row = |y: i64| self.wrapped(1, y).and_then(|y| across.get(y * columns.len()..(y + 1) * columns.len()));
        rows.iter()
            .flat_map(|span| {
                let mut joined = vec![Hull::of([]); columns.len()];
                for y in range(1, span) {
                    let of_row = row(y).unwrap_or(&outside);
                    joined.iter_mut().zip(of_row).for_each(|(hull, other)| *hull = hull.joined(*other));
                }
                joined
            })
            .collect()
    }
}

fn mix(a: f64, b: f64, share: f64) -> f64 {
    a + share * (b - a)
}

/// A pair of a mask.
pub(super) struct Pair<'a> {
    /// All levels of the mask.
    pub(super) levels: &'a [Level<'a>],
    /// The finer one of the pair.
    pub(super) at: usize,
    pub(super) fineness: Fineness,
    pub(super) query: &'a OpacityQuery,
    /// There are finer levels, which the mask does not know.
    pub(super) is_first: bool,
}

/// The cells of a pair.
pub(super) struct Cells {
    pub(super) columns: u32,
    /// By bin, row, column.
    pub(super) known: Vec<Presence>,
}

/// Of a cell, along an axis.
struct Span {
    ends: [f64; 2],
    /// Of the places between which lookups are linear, those from its one end to the other.
    places: Range<usize>,
}

/// What of the texels matters to the cells of a pair.
struct Around {
    /// Of the pair's levels, and one texel more on every side.
    pair: Vec<Hull>,
    /// Of the finer level before and the coarser one behind, which a width that is a little off may mean: what a
    /// lookup mixes, and with one texel more.
    beside: [Option<[Vec<Hull>; 2]>; 2],
}

impl Pair<'_> {
    pub(super) fn cells(&self) -> Cells {
        let [(columns, xs), (rows, ys)] = [0, 1].map(|axis| self.spans(axis));
        let (finer, coarser) = (&self.levels[self.at], self.levels.get(self.at + 1));
        let values = finer.at([&xs, &ys]);
        let coarse_values = coarser.map(|level| level.at([&xs, &ys]));
        let around = self.around([&columns, &rows]);
        let bins = 1_usize << self.fineness.bins;
        // What the two levels give at the places of a cell.
        let mut pairs = Vec::new();
        let mut known = vec![Presence::Unknown; bins * rows.len() * columns.len()];
        for (y, row) in rows.iter().enumerate() {
            for (x, column) in columns.iter().enumerate() {
                let cell = y * columns.len() + x;
                pairs.clear();
                for at in row.places.clone().map(|y| y * xs.len()) {
                    let coarse = |x: usize| coarse_values.as_ref().map_or(0.0, |values| values[at + x]);
                    pairs.extend(column.places.clone().map(|x| (values[at + x], coarse(x))));
                }
                let near =
                    |[from, to]: [f64; 2]| Hull::of(pairs.iter().flat_map(|&(a, b)| [mix(a, b, from), mix(a, b, to)]));
                // Most cells know the same of all bins.
                let of_all = self.decide(near([0.0, 1.0]), &around, cell, [true; 2]);
                for bin in 0..bins {
                    // A width that is a little off may be one of the finer pair.
                    if bin == 0 && self.is_first {
                        continue;
                    }
                    let ends = [bin == 0, bin + 1 == bins];
                    known[bin * rows.len() * columns.len() + cell] = match of_all {
                        Presence::Unknown => self.decide(near(self.shares(bin, bins)), &around, cell, ends),
                        of_all => of_all,
                    };
                }
            }
        }
        // A level of 512 texels has 513 columns.
        Cells { columns: u32::try_from(columns.len()).unwrap_or(u32::MAX), known }
    }

    /// Smallest and largest share of the coarser level in a bin, for widths that may be a little off.
    fn shares(&self, bin: usize, bins: usize) -> [f64; 2] {
        if self.at + 1 >= self.levels.len() {
            return [0.0; 2];
        }
        #[expect(clippy::cast_precision_loss, reason = "at most 32")]
        let ends = [bin, bin + 1].map(|bin| bin as f64 / bins as f64);
        [(ends[0] - 2.0 / WIDTHS).max(0.0), (ends[1] + 2.0 / WIDTHS).min(1.0)]
    }

    /// What is known of a cell where the two levels give `near`; `ends`: its bin is the first one, the last one.
    fn decide(&self, mut near: Hull, around: &Around, cell: usize, ends: [bool; 2]) -> Presence {
        let mut hull = around.pair[cell];
        for (beside, is_end) in around.beside.iter().zip(ends) {
            if let (Some([mixed, with_more]), true) = (beside, is_end) {
                near = near.mixed(mixed[cell], 2.0 / WIDTHS);
                hull = hull.joined(with_more[cell]);
            }
        }
        self.query.decide(near, hull)
    }

    fn around(&self, cells: [&[Span]; 2]) -> Around {
        let pair = self.levels.iter().skip(self.at).take(2).map(|level| level.hulls(cells, 1));
        let join = |a: Vec<Hull>, b: Vec<Hull>| a.into_iter().zip(b).map(|(a, b)| a.joined(b)).collect();
        let beside = [self.at.checked_sub(1), Some(self.at + 2)].map(|at| {
            let level = self.levels.get(at?)?;
            Some([0, 1].map(|beside| level.hulls(cells, beside)))
        });
        Around { pair: pair.reduce(join).unwrap_or_default(), beside }
    }

    /// The cells along an axis, and the places between which lookups in both levels are linear.
    fn spans(&self, axis: usize) -> (Vec<Span>, Vec<f64>) {
        let level = &self.levels[self.at];
        let size = f64::from(level.size[axis]);
        let fine = f64::from(1 << self.fineness.cells);
        let begin = if self.fineness.cells == 0 { 0.5 } else { 0.0 };
        let count = (level.size[axis] << self.fineness.cells) + 1;
        let place = |i: u32| ((f64::from(i) - begin) / (fine * size)).clamp(0.0, 1.0);
        let mut places = vec![place(0)];
        let spans = (0..count)
            .map(|i| {
                let ends = [place(i), place(i + 1)];
                let first = places.len() - 1;
                let mut centres = Vec::new();
                for level in self.levels.iter().skip(self.at).take(2) {
                    let side = f64::from(level.size[axis]);
                    let [first, last] = ends.map(|end| level.tap(axis, end).texel);
                    #[expect(clippy::cast_precision_loss, reason = "texels of a side")]
                    let all = (first..=last + 1).map(|texel| (texel as f64 + 0.5) / side);
                    centres.extend(all.filter(|centre| ends[0] < *centre && *centre < ends[1]));
                }
                centres.sort_by(f64::total_cmp);
                places.extend(centres);
                places.push(ends[1]);
                Span { ends, places: first..places.len() }
            })
            .collect();
        (spans, places)
    }
}
