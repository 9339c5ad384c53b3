// SPDX-License-Identifier: Apache-2.0
//! Coarser levels by box filter, row by row: a row of level 0 goes in, finished rows of all coarser levels come out.
//!
//! A texel of a level is the mean of what it covers of the level before, weighted by area (for sides that are not even
//! three texels share: "polyphase" box, NVIDIA 2002, Guthe and Heckbert 2005). Memory: two rows of sums a level, 4/3 of
//! a row of level 0 in all for each channel. Values are decoded ones; whoever stores rows encodes them.

use super::TileLayout;

/// The texels of a side of `fine` that texel `at` of the next coarser level covers: the first one, and the weights of
/// three.
pub fn weights(fine: u32, at: u32) -> (u32, [f64; 3]) {
    if fine == 1 {
        return (0, [1.0, 0.0, 0.0]);
    }
    let coarse = fine / 2;
    if fine.is_multiple_of(2) {
        return (2 * at, [0.5, 0.5, 0.0]);
    }
    let (n, k) = (f64::from(coarse), f64::from(at));
    let whole = f64::from(fine);
    (2 * at, [(n - k) / whole, n / whole, (k + 1.0) / whole])
}

/// A level under way.
#[derive(Debug)]
struct PyramidLevel {
    size: [u32; 2],
    /// Rows of the finer level that came in.
    taken: u32,
    /// Rows that went out.
    done: u32,
    /// Sums of rows `done` and `done + 1`.
    sums: [Vec<f32>; 2],
}

/// See the module.
#[derive(Debug)]
pub struct TexturePyramid {
    channels: usize,
    base: [u32; 2],
    levels: Vec<PyramidLevel>,
}

impl TexturePyramid {
    /// Of an image of `layout` with so many channels.
    pub fn new(layout: &TileLayout, channels: usize) -> Self {
        let level = |level| {
            let size = layout.level_size(level);
            let row = || vec![0.0; size[0] as usize * channels];
            PyramidLevel { size, taken: 0, done: 0, sums: [row(), row()] }
        };
        Self { channels, base: layout.size(), levels: (1..layout.levels()).map(level).collect() }
    }

    /// Takes the next row of level 0, from the bottom; gives (level, row number, row) of what it finishes. Rows of
    /// another length are taken as far as they reach.
    pub fn push(&mut self, row: &[f32], out: &mut impl FnMut(u32, u32, &[f32])) {
        self.push_to(0, row, out);
    }

    /// Takes the next row of level 1 from whoever has halved two rows of level 0 himself; for images whose sides are
    /// even, in place of two calls of [`Self::push`].
    pub fn push_halved(&mut self, row: &[f32], out: &mut impl FnMut(u32, u32, &[f32])) {
        let Some(level) = self.levels.first_mut() else { return };
        level.taken += 2;
        let done = level.done;
        level.done += 1;
        out(1, done, row);
        self.push_to(1, row, out);
    }

    fn push_to(&mut self, index: usize, row: &[f32], out: &mut impl FnMut(u32, u32, &[f32])) {
        let fine = if index == 0 { self.base } else { self.levels[index - 1].size };
        let channels = self.channels;
        let Some(level) = self.levels.get_mut(index) else { return };
        let y = level.taken;
        level.taken += 1;
        let narrow = narrowed(row, fine[0], level.size[0], channels);
        // The two rows that may cover this one.
        for k in 0..2 {
            let (first, parts) = weights(fine[1], level.done + k);
            let part = y.checked_sub(first).and_then(|at| parts.get(at as usize)).copied().unwrap_or(0.0);
            if part > 0.0 && level.done + k < level.size[1] {
                for (sum, value) in level.sums[k as usize].iter_mut().zip(&narrow) {
                    #[expect(clippy::cast_possible_truncation, reason = "a weight")]
                    let part = part as f32;
                    *sum += part * value;
                }
            }
        }
        let (first, parts) = weights(fine[1], level.done);
        let last = first + if parts[2] > 0.0 { 2 } else { u32::from(parts[1] > 0.0) };
        if y < last || level.done >= level.size[1] {
            return;
        }
        let done = level.done;
        level.done += 1;
        level.sums.swap(0, 1);
        let mut finished = std::mem::take(&mut level.sums[1]);
        out(u32::try_from(index).unwrap_or(0) + 1, done, &finished);
        self.push_to(index + 1, &finished, out);
        finished.fill(0.0);
        self.levels[index].sums[1] = finished;
    }
}

/// A row of `fine` texels made one of `coarse`.
fn narrowed(row: &[f32], fine: u32, coarse: u32, channels: usize) -> Vec<f32> {
    let mut out = vec![0.0; coarse as usize * channels];
    // Most sides are even; the same sums as below.
    match channels {
        _ if fine == 1 || !fine.is_multiple_of(2) => {}
        1 => return halved::<1>(row, out),
        2 => return halved::<2>(row, out),
        3 => return halved::<3>(row, out),
        4 => return halved::<4>(row, out),
        _ => {}
    }
    for (at, texel) in (0..coarse).zip(out.chunks_exact_mut(channels.max(1))) {
        let (first, parts) = weights(fine, at);
        for (k, part) in (0..).zip(parts) {
            let begin = (first + k) as usize * channels;
            let Some(from) = row.get(begin..begin + channels) else { break };
            if part == 0.0 {
                break;
            }
            for (sum, value) in texel.iter_mut().zip(from) {
                #[expect(clippy::cast_possible_truncation, reason = "a weight")]
                let part = part as f32;
                *sum += part * value;
            }
        }
    }
    out
}

/// Means of two neighbours each.
fn halved<const CHANNELS: usize>(row: &[f32], mut out: Vec<f32>) -> Vec<f32> {
    let pairs = row.as_chunks::<CHANNELS>().0.as_chunks::<2>().0;
    for (to, [left, right]) in out.as_chunks_mut::<CHANNELS>().0.iter_mut().zip(pairs) {
        for k in 0..CHANNELS {
            to[k] = 0.5 * left[k] + 0.5 * right[k];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels_of(size: [u32; 2], texel: impl Fn(u32, u32) -> f32) -> Vec<Vec<f32>> {
        let layout = TileLayout::new(size, 4).expect("supported");
        let mut made: Vec<Vec<f32>> = vec![Vec::new(); layout.levels() as usize];
        let mut pyramid = TexturePyramid::new(&layout, 1);
        for y in 0..size[1] {
            let row: Vec<f32> = (0..size[0]).map(|x| texel(x, y)).collect();
            pyramid.push(&row, &mut |level, at, row| {
                let made = &mut made[level as usize];
                assert_eq!(made.len(), at as usize * row.len(), "rows come in order");
                made.extend_from_slice(row);
            });
        }
        for (level, made) in (0..).zip(&made).skip(1) {
            assert_eq!(
                u32::try_from(made.len()).unwrap_or(u32::MAX),
                layout.level_size(level).iter().product::<u32>(),
                "level {level} of {size:?}"
            );
        }
        made
    }

    #[test]
    fn pyramid_levels_keep_the_mean_at_every_size() {
        for size in [[8, 8], [7, 5], [1, 9], [13, 1], [3, 3], [64, 33], [31, 31]] {
            let texel = |x: u32, y: u32| ((x * 7 + y * 13) % 11) as f32;
            let mean = |values: &[f32]| values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64;
            let all: Vec<f32> = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| texel(x, y))).collect();
            for (level, made) in levels_of(size, texel).iter().enumerate().skip(1) {
                assert!(
                    (mean(made) - mean(&all)).abs() < 1e-4,
                    "level {level} of {size:?}: {} {}",
                    mean(made),
                    mean(&all)
                );
            }
        }
    }

    #[test]
    fn the_even_size_path_matches_the_general_one_bit_for_bit() {
        for channels in 1..=4 {
            let row: Vec<f32> = (0..64 * channels).map(|k| ((k * k * 7919) % 1013) as f32 / 1013.0).collect();
            let coarse = (0..32).flat_map(|at| (0..channels).map(move |c| (at, c)));
            let general = |(at, c): (usize, usize)| {
                let (first, parts) = weights(64, u32::try_from(at).expect("small"));
                assert_eq!(parts, [0.5, 0.5, 0.0]);
                (0..2).fold(0.0_f32, |sum, k| sum + 0.5 * row[(first as usize + k) * channels + c])
            };
            let expected: Vec<f32> = coarse.map(general).collect();
            assert_eq!(narrowed(&row, 64, 32, channels), expected, "{channels} channels");
        }
    }

    #[test]
    fn known_texels_of_coarser_levels() {
        let made = levels_of([4, 2], |x, y| (x + 10 * y) as f32);
        assert_eq!(made[1..], [vec![5.5, 7.5], vec![6.5]], "means of four, then of two");
        let made = levels_of([3, 1], |x, _| [0.0, 3.0, 9.0][x as usize]);
        assert_eq!(made[1], [4.0], "a third each");
        let ramp = levels_of([5, 1], |x, _| x as f32);
        assert_eq!(ramp[1], [(0.0 * 2.0 + 2.0 + 2.0) / 5.0, (2.0 + 3.0 * 2.0 + 4.0 * 2.0) / 5.0], "by area");
    }
}
