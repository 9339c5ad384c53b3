// SPDX-License-Identifier: Apache-2.0
//! The cells of a texel: in what share of each a lookup at the finest level meets the surface. Between the centres of
//! four texels a lookup is bilinear, so a quarter of a texel lies in one such patch. Pure; any thread.

use super::{OpacityQuery, PLACE_SLACK};
use crate::texture::Wrap;

/// How much of an area is there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct OpacityCell {
    pub(super) share: f32,
    /// Some of it may be there, and some may not.
    pub(super) may_meet: bool,
    pub(super) may_miss: bool,
}

impl OpacityCell {
    /// 0 and 255 are sure.
    pub(super) fn byte(self) -> u8 {
        match [self.may_meet, self.may_miss] {
            [false, _] => 0,
            [true, false] => 255,
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 254; NaN is 0")]
            [true, true] => (self.share * 255.0).round().clamp(1.0, 254.0) as u8,
        }
    }

    /// Adds a part that covers `weight` of it.
    pub(super) fn add(&mut self, part: Self, weight: f32) {
        self.share += weight * part.share;
        self.may_meet |= part.may_meet;
        self.may_miss |= part.may_miss;
    }
}

/// Where all texels have this value.
pub(super) fn of_value(query: &OpacityQuery, value: f32) -> OpacityCell {
    of_equal(query, f64::from(value)).unwrap_or_else(|| {
        let share = shortened(query.share(value.into()));
        OpacityCell { share, may_meet: true, may_miss: true }
    })
}

/// Where all texels have this value, if they are sure to be there or not.
fn of_equal(query: &OpacityQuery, value: f64) -> Option<OpacityCell> {
    let [may_meet, may_miss] = query.may([value; 2], 0.0, value.abs());
    (may_meet != may_miss).then(|| OpacityCell { share: f32::from(u8::from(may_meet)), may_meet, may_miss })
}

#[expect(clippy::cast_possible_truncation, reason = "a share")]
fn shortened(share: f64) -> f32 {
    share as f32
}

/// The cells of a row of texels with the rows below and above, 2^fine along a texel: one row of cells after the other.
pub(super) fn of_row(query: &OpacityQuery, rows: [&[f32]; 3], fine: u32) -> Vec<OpacityCell> {
    let width = rows[1].len();
    let along = 1_usize << fine;
    let mut out = vec![OpacityCell::default(); width * along * along];
    let beside = |x: usize, is_next: bool| match query.wrap[0] {
        _ if is_next && x + 1 < width => Some(x + 1),
        _ if !is_next && x > 0 => Some(x - 1),
        Wrap::UseMetadata | Wrap::Black => None,
        Wrap::Clamp | Wrap::Mirror => Some(x),
        Wrap::Repeat if is_next => Some(0),
        Wrap::Repeat => Some(width - 1),
    };
    let mut cells = Vec::with_capacity(along * along);
    for x in 0..width {
        let columns = [beside(x, false), Some(x), beside(x, true)];
        let around = rows.map(|row| columns.map(|x| x.and_then(|x| row.get(x)).map_or(query.outside, |value| *value)));
        cells.clear();
        of_texel(query, around, fine, &mut cells);
        for (y, of_cells) in cells.chunks_exact(along).enumerate() {
            let begin = (y * width + x) * along;
            out[begin..begin + along].copy_from_slice(of_cells);
        }
    }
    out
}

/// Smallest and largest of some values, of which none is NaN.
fn hull(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let add = |[low, high]: [f64; 2], value: f64| match value.is_nan() {
        true => [f64::NEG_INFINITY, f64::INFINITY],
        false => [low.min(value), high.max(value)],
    };
    values.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], add)
}

/// The cells of the middle one of nine texels.
fn of_texel(query: &OpacityQuery, around: [[f32; 3]; 3], fine: u32, out: &mut Vec<OpacityCell>) {
    let around = around.map(|row| row.map(f64::from));
    let [low, high] = hull(around.as_flattened().iter().copied());
    let largest = low.abs().max(high.abs());
    let count = 1_usize << (2 * fine);
    let [may_meet, may_miss] = query.may([low, high], 0.0, largest);
    if may_meet != may_miss {
        out.extend(std::iter::repeat_n(
            OpacityCell { share: f32::from(u8::from(may_meet)), may_meet, may_miss },
            count,
        ));
        return;
    }
    // Along a side of the texel; a part lies in one patch.
    let parts = (1_usize << fine).max(2);
    let samples = (8 / parts).max(2);
    let mut whole = OpacityCell::default();
    for (y, x) in (0..parts).flat_map(|y| (0..parts).map(move |x| (y, x))) {
        let at = |i: usize| place(i as f64 / parts as f64);
        let corners = [y, y + 1].map(|y| [x, x + 1].map(|x| bilinear(&around, at(x), at(y))));
        let range = hull(corners.as_flattened().iter().copied());
        let [may_meet, may_miss] = query.may(range, PLACE_SLACK * (high - low), largest);
        let share = shortened(share_of(query, corners, samples));
        let cell = OpacityCell { share, may_meet, may_miss };
        match fine {
            0 => whole.add(cell, 1.0 / (parts * parts) as f32),
            _ => out.push(cell),
        }
    }
    if fine == 0 {
        out.push(whole);
    }
}

/// What of the texel before, at, and behind the middle one a place in that one has, from 0 to 1: which pair, and the
/// share of the second.
fn place(at: f64) -> (usize, f64) {
    if at < 0.5 { (0, at + 0.5) } else { (1, at - 0.5) }
}

fn mix(a: f64, b: f64, share: f64) -> f64 {
    a + share * (b - a)
}

fn bilinear(around: &[[f64; 3]; 3], (column, right): (usize, f64), (row, upper): (usize, f64)) -> f64 {
    let across = |row: usize| mix(around[row][column], around[row][column + 1], right);
    mix(across(row), across(row + 1), upper)
}

/// In what share of a rectangle a bilinear function with these values at its corners meets the surface.
fn share_of(query: &OpacityQuery, corners: [[f64; 2]; 2], samples: usize) -> f64 {
    let shares = corners.map(|row| row.map(|value| query.share(value)));
    let [low, high] = hull(shares.as_flattened().iter().copied());
    // A patch has its extremes at the corners, and what is inside of 0 and 1 is its own mean.
    let is_linear = query.is_chance() && low > 0.0 && high < 1.0;
    if low == high || is_linear {
        return shares.as_flattened().iter().sum::<f64>() / 4.0;
    }
    let at = |i: usize| (i as f64 + 0.5) / samples as f64;
    let places = (0..samples).flat_map(|y| (0..samples).map(move |x| (at(x), at(y))));
    let value = |(x, y)| mix(mix(corners[0][0], corners[0][1], x), mix(corners[1][0], corners[1][1], x), y);
    places.map(|place| query.share(value(place))).sum::<f64>() / (samples * samples) as f64
}
