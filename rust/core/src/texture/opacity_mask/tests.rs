// SPDX-License-Identifier: Apache-2.0
//! Masks against lookups in f64, at random places and widths.

#![expect(clippy::cast_possible_truncation, reason = "levels, cells and numbers of choices are small")]

use super::super::Sampler;
use super::*;

/// A generator of numbers (Steele et al. 2014, `SplitMix64`).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// From `low` up to `high`.
    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * ((self.bits() >> 40) as f32 / (1 << 24) as f32)
    }

    /// Below `count`.
    fn below(&mut self, count: u32) -> u32 {
        (self.bits() >> 32) as u32 % count
    }

    fn one_of<T: Copy, const N: usize>(&mut self, values: [T; N]) -> T {
        values[self.below(N as u32) as usize]
    }
}

/// An image with all its levels, each the mean of the finer one or anything.
fn levels(layout: &Layout, mut texel: impl FnMut(u32, u32, u32) -> f32) -> Vec<Vec<f32>> {
    (0..layout.levels())
        .map(|level| {
            let [w, h] = layout.level_size(level);
            (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).map(|(x, y)| texel(level, x, y)).collect()
        })
        .collect()
}

/// As `shaders/traversal/opacity_mask.glsl` reads it.
fn known(mask: &OpacityMask, layout: &Layout, st: [f32; 2], width: f64) -> Option<u32> {
    let [size, modes] = [mask.words[0], mask.words[1]];
    assert_eq!([size & 0xffff, size >> 16], layout.size());
    let (first, last) = (modes >> 8 & 0xff, modes >> 16);
    let pair = if width < 1.0 { 0 } else { (width.log2().floor() as u32).min(last) };
    let share = if width < 1.0 || pair == last { 0.0 } else { width / f64::from(1 << pair) - 1.0 };
    let at = 2 + 2 * pair.checked_sub(first)? as usize;
    let (begin, cut) = (mask.words[at], mask.words[at + 1]);
    let (columns, fine, bins) = (cut & 0xffff, cut >> 16 & 0xff, cut >> 24);
    let sides = layout.level_size(pair).map(|side| side << fine);
    let [x, y] = [0, 1].map(|axis| (st[axis] * sides[axis] as f32 + if fine == 0 { 0.5 } else { 0.0 }).floor() as u32);
    assert!(x < columns && x <= sides[0] && y <= sides[1], "a cell of the mask");
    let cell = begin + ((share * f64::from(1 << bins)) as u32 * (sides[1] + 1) + y) * columns + x;
    Some(mask.words[cell as usize / 16] >> (2 * (cell % 16)) & 3)
}

const WRAPS: [Wrap; 4] = [Wrap::Black, Wrap::Clamp, Wrap::Repeat, Wrap::Mirror];

/// Random queries of random images; the share of lookups whose answer was known.
fn agree(seed: u64, texel: impl Fn(&mut Random, [f32; 2]) -> f32) -> f64 {
    let mut random = Random(seed);
    let (mut asked, mut told) = (0_u32, 0_u32);
    for size in [[1, 1], [2, 1], [7, 3], [16, 16], [33, 64], [128, 128], [1024, 40]] {
        let layout = Layout::new(size, 4).expect("a layout");
        let values = levels(&layout, |level, x, y| {
            let [w, h] = layout.level_size(level).map(|side| side as f32);
            texel(&mut random, [(x as f32 + 0.5) / w, (y as f32 + 0.5) / h])
        });
        for case in 0..24 {
            let query = OpacityQuery {
                wrap: [WRAPS[case % 4], WRAPS[case / 4 % 4]],
                scale: random.one_of([1.0, -1.0, 0.7, 3.0]),
                bias: random.one_of([0.0, 1.0, -0.25]),
                threshold: random.one_of([0.0, 0.0, 0.25, 0.5, 0.999]),
            };
            let first = first_pair(&layout);
            let mask = OpacityMask::new(&layout, &values[first as usize..], &query).expect("a mask");
            let texel = |level: u32, x: u32, y: u32| {
                let at = y * layout.level_size(level)[0] + x;
                [f64::from(values[level as usize][at as usize]); 4]
            };
            let sampler = Sampler { layout, wrap: query.wrap, outside: [0.0; 4], texel };
            for _ in 0..1500 {
                let mut coordinate = |axis: usize| -> f32 {
                    let centre = random.below(2 * size[axis] + 1) as f32 / (2 * size[axis]) as f32;
                    let nudge = f32::from_bits(centre.to_bits() + random.below(3)).min(1.0);
                    let anywhere = random.between(0.0, 1.0);
                    random.one_of([anywhere, centre, nudge])
                };
                let st = [coordinate(0), coordinate(1)];
                let width = 2.0_f64.powf(random.between(-2.0, 12.0).into());
                let value = sampler.lookup(st.map(f64::from), width)[0];
                let opacity = value * f64::from(query.scale) + f64::from(query.bias);
                asked += 1;
                let Some(state) = known(&mask, &layout, st, width) else { continue };
                told += u32::from(state != 0);
                let threshold = f64::from(query.threshold);
                let text = || format!("{query:?}, {size:?}, {st:?}, {width}: {opacity} but {state}");
                match (state, query.threshold > 0.0) {
                    (1, true) => assert!(opacity < threshold, "{}", text()),
                    (2, true) => assert!(opacity >= threshold, "{}", text()),
                    (1, false) => assert!(opacity <= 0.0, "{}", text()),
                    (2, false) => assert!(opacity >= 1.0, "{}", text()),
                    (state, _) => assert_eq!(state, 0, "a state"),
                }
                assert!(!mask.is_opaque || state == 2, "{}", text());
            }
        }
    }
    f64::from(told) / f64::from(asked)
}

#[test]
fn mask_verdicts_agree_with_texture_lookups() {
    // A disc with a soft rim, as leaves are; noise; few values; one value.
    let disc = agree(1, |_, [s, t]: [f32; 2]| ((0.4 - (s - 0.5).hypot(t - 0.5)) * 40.0 + 0.5).clamp(0.0, 1.0));
    let noise = agree(2, |random, _| random.between(0.0, 1.0));
    let few = agree(3, |random, [s, _]| if s < 0.7 { 1.0 } else { random.one_of([0.0, 0.25, 0.5]) });
    let ones = agree(4, |_, _| 1.0);
    assert!(disc > 0.4 && few > 0.3 && ones > 0.5, "most of it is known: {disc} {few} {ones}");
    assert!(noise > 0.01 && noise < 0.6, "little of noise is: {noise}");
}

/// Texels that are there, there, not there and not there, and what the first and the last mix with beside the image.
#[test]
fn mask_verdicts_at_image_borders_follow_the_wrap_mode() {
    let layout = Layout::new([4, 1], 1).expect("a layout");
    let values = vec![vec![1.0, 1.0, 0.0, 0.0], vec![1.0, 0.0], vec![0.9]];
    // At the end, an eighth of a texel from it (half and half with what is beside), and well inside.
    for (wrap, first, last) in [
        (Wrap::Clamp, [2, 2, 2], [1, 1, 1]),
        (Wrap::Mirror, [2, 2, 2], [1, 1, 1]),
        (Wrap::Repeat, [0, 2, 2], [0, 1, 1]),
        (Wrap::Black, [0, 2, 2], [1, 1, 1]),
        (Wrap::UseMetadata, [0, 2, 2], [1, 1, 1]),
    ] {
        let query = OpacityQuery { wrap: [wrap, Wrap::Clamp], scale: 1.0, bias: 0.0, threshold: 0.5 };
        let mask = OpacityMask::new(&layout, &values, &query).expect("a mask");
        let at = |s: f32, width: f64| known(&mask, &layout, [s, 0.5], width).expect("a cell");
        assert_eq!([0.0, 0.04, 0.1].map(|s| at(s, 0.5)), first, "{wrap:?}");
        assert_eq!([1.0, 0.96, 0.9].map(|s| at(s, 0.5)), last, "{wrap:?}");
        // Half and half between both: not known so near, but beside.
        assert_eq!([0.5, 0.45, 0.55].map(|s| at(s, 0.5)), [0, 2, 1], "{wrap:?}");
        // One texel all over, and a little of what is finer.
        assert_eq!(at(0.3, 4.0), 2, "{wrap:?}");
    }
}

#[test]
fn a_constant_image_needs_no_mask() {
    let layout = Layout::new([32, 8], 1).expect("a layout");
    let ones = levels(&layout, |_, _, _| 1.0);
    let query = OpacityQuery { wrap: [Wrap::Repeat, Wrap::Clamp], scale: 1.0, bias: 0.0, threshold: 0.5 };
    let is_opaque =
        |query: &OpacityQuery, values: &[Vec<f32>]| OpacityMask::new(&layout, values, query).expect("a mask").is_opaque;
    assert!(is_opaque(&query, &ones));
    assert!(is_opaque(&OpacityQuery { threshold: 0.0, ..query }, &ones), "certain");
    assert!(!is_opaque(&OpacityQuery { scale: 0.9, threshold: 0.0, ..query }, &ones), "by chance");
    let beside = OpacityQuery { wrap: [Wrap::Repeat, Wrap::Black], ..query };
    assert!(!is_opaque(&beside, &ones), "nothing is beside it");
    let zeros = levels(&layout, |_, _, _| 0.0);
    assert!(is_opaque(&OpacityQuery { scale: -1.0, bias: 1.0, ..beside }, &zeros), "what is beside it is there");
    for hole in [0, 3, 5] {
        let mut holed = ones.clone();
        *holed[hole].last_mut().expect("a texel") = 0.0;
        assert!(!is_opaque(&query, &holed), "a texel of level {hole} is not there");
    }
    let mut broken = ones.clone();
    broken[1][3] = f32::NAN;
    assert!(!is_opaque(&query, &broken), "no number");
    assert!(OpacityMask::new(&layout, &ones[1..], &query).is_none(), "levels are missing");
}

/// A texel of the coarser level lies within a cell: what is known there is more than what is at the cell's corners.
#[test]
fn masks_include_coarser_texels_inside_a_cell() {
    let layout = Layout::new([128, 128], 4).expect("a layout");
    let values = levels(&layout, |level, x, y| if level == 1 && x % 4 == 2 && y % 4 == 2 { 0.0 } else { 1.0 });
    let query = OpacityQuery { wrap: [Wrap::Clamp; 2], scale: 1.0, bias: 0.0, threshold: 0.3 };
    let mask = OpacityMask::new(&layout, &values, &query).expect("a mask");
    let known = |at: [f32; 2]| known(&mask, &layout, at.map(|x| x / 64.0), 1.99).expect("a cell");
    // Half of a texel of the finer level, from the coarser one's centre, is 0.4375 of the way.
    assert_eq!([known([2.5, 6.5]), known([2.7, 6.3])], [0; 2], "some of the cell is not there");
    assert_eq!([known([4.5, 6.5]), known([4.4, 4.6])], [2; 2], "all of it is");
}

/// Levels of one value each, so that only the width says what is known: where it crosses the threshold within a pair of
/// levels at the end of a bin, and from one pair to the next.
#[test]
fn masks_tolerate_the_filter_width_error() {
    let mut random = Random(6);
    let layout = Layout::new([64, 64], 4).expect("a layout");
    for (cycle, threshold) in
        [(&[1.0, 0.0][..], 0.497), (&[1.0, 0.499, 0.0, 0.499], 0.5), (&[0.0, 0.501, 1.0, 0.501], 0.5)]
    {
        let values = levels(&layout, |level, _, _| cycle[level as usize % cycle.len()]);
        let query = OpacityQuery { wrap: [Wrap::Repeat; 2], scale: 1.0, bias: 0.0, threshold };
        let mask = OpacityMask::new(&layout, &values, &query).expect("a mask");
        let texel = |level: u32, _, _| [f64::from(cycle[level as usize % cycle.len()]); 4];
        let sampler = Sampler { layout, wrap: query.wrap, outside: [0.0; 4], texel };
        let mut told = 0;
        for _ in 0..4000 {
            let at = random.one_of([1.0, 1.25, 1.5, 1.75]) * 2.0_f64.powi(random.below(7) as i32);
            let mut near = |width: f64| width * (1.0 + f64::from(random.between(-0.99, 0.99)) / WIDTHS);
            let width = near(at);
            let off = near(width);
            let opacity = sampler.lookup([0.3, 0.6], width)[0];
            match known(&mask, &layout, [0.3, 0.6], off) {
                Some(1) => assert!(opacity < f64::from(threshold), "{cycle:?}, {width} {off}: {opacity}"),
                Some(2) => assert!(opacity >= f64::from(threshold), "{cycle:?}, {width} {off}: {opacity}"),
                _ => continue,
            }
            told += 1;
        }
        assert!(told > 1000, "{cycle:?}: {told}");
    }
}
