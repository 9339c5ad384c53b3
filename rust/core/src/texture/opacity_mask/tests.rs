// SPDX-License-Identifier: Apache-2.0
//! Compares masks with lookups in f64: certain cells hold everywhere, and shares are those of the area.

#![expect(clippy::cast_possible_truncation, reason = "levels, cells and numbers of choices are small")]

use super::super::TextureSampler;
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

    /// A number from `low` up to `high`.
    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * ((self.bits() >> 40) as f32 / (1 << 24) as f32)
    }

    /// A number below `count`.
    fn below(&mut self, count: u32) -> u32 {
        (self.bits() >> 32) as u32 % count
    }

    fn one_of<T: Copy, const N: usize>(&mut self, values: [T; N]) -> T {
        values[self.below(N as u32) as usize]
    }
}

const CUT: OpacityQuery =
    OpacityQuery { wrap: [Wrap::Repeat, Wrap::Clamp], outside: 0.0, scale: 1.0, bias: 0.0, threshold: 0.5 };
/// Largest side of the levels of the masks here.
const MAX_SIDE: u32 = 512;
const WRAPS: [Wrap; 5] = [Wrap::UseMetadata, Wrap::Black, Wrap::Clamp, Wrap::Repeat, Wrap::Mirror];

/// Texels of level 0, from their positions.
fn texels(layout: &TileLayout, mut texel: impl FnMut([f32; 2]) -> f32) -> Vec<f32> {
    let [w, h] = layout.size();
    let at = |i: u32, side: u32| (i as f32 + 0.5) / side as f32;
    (0..h).flat_map(|y| (0..w).map(move |x| [at(x, w), at(y, h)])).map(&mut texel).collect()
}

/// A mask of texels that come in bands of `rows` rows.
fn banded(layout: &TileLayout, values: &[f32], query: &OpacityQuery, rows: usize) -> Option<OpacityMask> {
    let mut maker = OpacityMaskMaker::new(layout, query, MAX_SIDE)?;
    values.chunks(rows * layout.size()[0] as usize).for_each(|band| maker.push(band));
    maker.finish()
}

fn mask(layout: &TileLayout, values: &[f32], query: &OpacityQuery) -> OpacityMask {
    banded(layout, values, query, 7).expect("a mask")
}

/// Cells of a mask, as read from its words.
struct Read {
    size: [u32; 2],
    bytes: Vec<u8>,
}

impl Read {
    fn mean(&self) -> f64 {
        self.bytes.iter().map(|byte| f64::from(*byte)).sum::<f64>() / (255 * self.bytes.len()) as f64
    }

    /// The cell at a position.
    fn at(&self, st: [f32; 2]) -> u8 {
        let [x, y] = [0, 1].map(|i| ((st[i] * self.size[i] as f32) as u32).min(self.size[i] - 1));
        self.bytes[(y * self.size[0] + x) as usize]
    }
}

/// The cells, and their level.
fn cells(mask: &OpacityMask, layout: &TileLayout) -> (u32, Read) {
    let [size, modes] = [mask.words[0], mask.words[1]];
    assert_eq!([size & 0xffff, size >> 16], layout.size());
    let (fine, level) = (modes >> 4 & 7, modes >> 8 & 31);
    let bytes: Vec<u8> = mask.words[2..].iter().flat_map(|word| word.to_le_bytes()).collect();
    let size = layout.level_size(level).map(|side| side << fine);
    (level, Read { size, bytes: bytes[..(size[0] * size[1]) as usize].to_vec() })
}

/// A mask of any longest side.
fn sized(layout: &TileLayout, values: &[f32], query: &OpacityQuery, most_side: u32) -> OpacityMask {
    let mut maker = OpacityMaskMaker::new(layout, query, most_side).expect("a mask");
    maker.push(values);
    maker.finish().expect("a mask")
}

fn disc([s, t]: [f32; 2]) -> f32 {
    ((0.3 - (s - 0.5).hypot(t - 0.5)) * 40.0 + 0.5).clamp(0.0, 1.0)
}

#[test]
fn coverage_of_a_disc_is_the_same_whatever_the_size_of_its_cells() {
    let area = std::f64::consts::PI * 0.09;
    for size in [[64, 64], [300, 200], [512, 512], [777, 1031], [2048, 1024], [70, 33]] {
        let layout = TileLayout::new(size, 1).expect("a layout");
        let values = texels(&layout, disc);
        for (query, expected) in [
            (CUT, area),
            (OpacityQuery { scale: -1.0, bias: 1.0, ..CUT }, 1.0 - area),
            (OpacityQuery { threshold: 0.0, scale: 0.5, ..CUT }, 0.5 * area),
        ] {
            for most_side in [4096, 1024, 512, 128, 32, 8, 1] {
                let (_, cells) = cells(&sized(&layout, &values, &query, most_side), &layout);
                let mean = cells.mean();
                assert!(
                    (mean - expected).abs() < 0.01 * expected,
                    "{query:?} {:?}: {mean}, not {expected}",
                    cells.size
                );
            }
        }
    }
}

/// Mean result of lookups of level 0 over a cell.
fn share_by_lookups(
    sampler: &TextureSampler<impl Fn(u32, u32, u32) -> [f64; 4]>,
    query: &OpacityQuery,
    cell: [[f64; 2]; 2],
) -> f64 {
    let along = 24;
    let place =
        |axis: usize, i: usize| cell[0][axis] + (i as f64 + 0.5) / f64::from(along) * (cell[1][axis] - cell[0][axis]);
    let places = (0..along as usize).flat_map(|y| (0..along as usize).map(move |x| [place(0, x), place(1, y)]));
    places.map(|st| query.share(sampler.bilinear(st, 0)[0])).sum::<f64>() / f64::from(along * along)
}

fn query(random: &mut Random) -> OpacityQuery {
    OpacityQuery {
        wrap: [random.one_of(WRAPS), random.one_of(WRAPS)],
        outside: random.one_of([0.0, 0.0, 1.0, 0.4]),
        scale: random.one_of([1.0, -1.0, 0.7, 3.0]),
        bias: random.one_of([0.0, 1.0, -0.25]),
        threshold: random.one_of([0.0, 0.25, 0.5, 0.999]),
    }
}

/// Random queries of random images: certain cells hold at every position, and shares are those of the area.
fn agree(seed: u64, texel: impl Fn(&mut Random, [f32; 2]) -> f32) {
    let mut random = Random(seed);
    for size in [[1, 1], [2, 1], [7, 3], [16, 16], [33, 64], [200, 130], [1025, 40]] {
        let layout = TileLayout::new(size, 4).expect("a layout");
        let values = texels(&layout, |st| texel(&mut random, st));
        for _ in 0..12 {
            let query = query(&mut random);
            let of = |_, x: u32, y: u32| [f64::from(values[(y * size[0] + x) as usize]); 4];
            let sampler = TextureSampler { layout, wrap: query.wrap, outside: [query.outside.into(); 4], texel: of };
            let masks = [MAX_SIDE, 64, 16, 3, 1].map(|side| sized(&layout, &values, &query, side));
            let read = masks.each_ref().map(|mask| cells(mask, &layout));
            for _ in 0..400 {
                let at = random.below(5) as usize;
                let (mask, (_, level)) = (&masks[at], &read[at]);
                let cell = level.size.map(|side| random.below(side));
                let end = |more: u32| [0, 1].map(|i| f64::from(cell[i] + more) / f64::from(level.size[i]));
                let byte = level.bytes[(cell[1] * level.size[0] + cell[0]) as usize];
                let ends = [end(0), end(1)];
                let share = share_by_lookups(&sampler, &query, ends);
                let text = || format!("{query:?} {size:?} {cell:?} of {:?}: {byte}, not {share}", level.size);
                // For a part of a texel only certainty matters, and few samples are taken.
                let most = if level.size[0] > size[0] { 0.4 } else { 0.1 };
                assert!((f64::from(byte) / 255.0 - share).abs() < most, "{}", text());
                let at = |i: usize, part: f64| ends[0][i] + part * (ends[1][i] - ends[0][i]);
                // The rim of an empty cell may be kept.
                let parts = if byte == 0 { [4.0e-3, 1.0 - 4.0e-3, 1.0 / 3.0] } else { [0.0, 1.0, 0.5] };
                let st = [0, 1].map(|i| at(i, random.one_of(parts)));
                let opacity = query.share(sampler.bilinear(st, 0)[0]);
                match byte {
                    0 => assert!(opacity == 0.0, "{}: {opacity}", text()),
                    255 => assert!(opacity == 1.0, "{}: {opacity}", text()),
                    _ => assert!(!mask.is_opaque, "{}", text()),
                }
            }
            assert_eq!(read[0].0 == 0, size[0] <= MAX_SIDE, "all that is small is kept");
        }
    }
}

#[test]
fn cells_say_in_what_share_of_their_area_lookups_meet_the_surface() {
    agree(1, |_, st| disc(st));
    agree(2, |random, _| random.between(0.0, 1.0));
    agree(3, |random, [s, _]| if s < 0.7 { 1.0 } else { random.one_of([0.0, 0.25, 0.5]) });
    agree(4, |_, _| 1.0);
}

#[test]
fn most_cells_of_a_disc_are_sure() {
    for side in [16, 64, 128, 512, 1024] {
        let layout = TileLayout::new([side; 2], 1).expect("a layout");
        let values = texels(&layout, |[s, t]| if (s - 0.5).hypot(t - 0.5) < 0.3 { 1.0 } else { 0.0 });
        let (_, cells) = cells(&mask(&layout, &values, &CUT), &layout);
        let sure = cells.bytes.iter().filter(|byte| matches!(byte, 0 | 255)).count() as f64;
        assert!(sure / cells.bytes.len() as f64 > 0.9, "{side}: {sure} of {}", cells.bytes.len());
    }
}

/// Texels kept, kept, empty and empty, with the texels that the first and the last mix with beside the image.
#[test]
fn cells_at_image_borders_follow_the_wrap_mode() {
    let layout = TileLayout::new([4, 1], 1).expect("a layout");
    let values = [1.0, 1.0, 0.0, 0.0];
    for (wrap, outside, first, last) in [
        (Wrap::Clamp, 0.0, 255, 0),
        (Wrap::Mirror, 0.0, 255, 0),
        // Half of each cell is on the border, exactly at the threshold, where a rim has no area.
        (Wrap::Repeat, 0.0, 254, 0),
        (Wrap::Black, 0.0, 254, 0),
        (Wrap::Black, 1.0, 255, 0),
        (Wrap::UseMetadata, 0.0, 254, 0),
    ] {
        let query = OpacityQuery { wrap: [wrap, Wrap::Clamp], outside, ..CUT };
        let mask = mask(&layout, &values, &query);
        let (_, cells) = cells(&mask, &layout);
        let at = |s: f32| cells.at([s, 0.5]);
        assert_eq!([at(0.0), at(1.0)], [first, last], "{wrap:?} {outside}");
        assert_eq!([at(0.1), at(0.9)], [255, 0], "{wrap:?}");
        assert_eq!(mask.words[1] >> 24, if outside > 0.0 { 255 } else { 0 }, "around it");
    }
}

#[test]
fn a_constant_image_needs_no_mask() {
    let layout = TileLayout::new([32, 8], 1).expect("a layout");
    let ones = texels(&layout, |_| 1.0);
    let is_opaque = |query: &OpacityQuery, values: &[f32]| mask(&layout, values, query).is_opaque;
    assert!(is_opaque(&CUT, &ones));
    assert!(is_opaque(&OpacityQuery { threshold: 0.0, ..CUT }, &ones), "certain");
    assert!(!is_opaque(&OpacityQuery { scale: 0.9, threshold: 0.0, ..CUT }, &ones), "by chance");
    assert!(is_opaque(&OpacityQuery { scale: 0.5, ..CUT }, &ones), "at the threshold");
    let beside = OpacityQuery { wrap: [Wrap::Repeat, Wrap::Black], ..CUT };
    assert!(!is_opaque(&beside, &ones), "nothing is beside it");
    let zeros = texels(&layout, |_| 0.0);
    assert!(is_opaque(&OpacityQuery { scale: -1.0, bias: 1.0, ..beside }, &zeros), "what is beside it is there");
    for hole in [0, 77, 255] {
        let mut holed = ones.clone();
        holed[hole] = 0.0;
        assert!(!is_opaque(&CUT, &holed), "texel {hole} is not there");
        holed[hole] = f32::NAN;
        assert!(!is_opaque(&CUT, &holed), "no number");
    }
}

#[test]
fn a_mask_does_not_depend_on_how_rows_come() {
    let mut random = Random(9);
    for size in [[5, 1], [9, 2], [40, 3], [64, 33], [600, 70]] {
        let layout = TileLayout::new(size, 1).expect("a layout");
        let values = texels(&layout, |_| random.between(0.0, 1.0));
        let whole = banded(&layout, &values, &CUT, size[1] as usize).expect("a mask");
        for rows in [1, 2, 3, 16] {
            assert!(banded(&layout, &values, &CUT, rows).expect("a mask") == whole, "{size:?} by {rows} rows");
        }
    }
}

#[test]
fn masks_of_hostile_images_are_bounded() {
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    for size in [[1, 1], [1, 513], [0xffff, 1], [3, 5], [511, 513], [1023, 2]] {
        let layout = TileLayout::new(size, 4).expect("a layout");
        let count = (size[0] * size[1]) as usize;
        let mut random = Random(3);
        let values: Vec<f32> = (0..count).map(|_| random.one_of([nan, inf, -inf, 3.0e38, -3.0e38, 0.0, 1.0])).collect();
        for wrap in WRAPS {
            for [scale, bias, threshold] in [[1.0, 0.0, 0.5], [3.0e38, -3.0e38, 0.0], [nan, inf, nan], [0.0, 0.0, inf]]
            {
                let query = OpacityQuery { wrap: [wrap; 2], outside: nan, scale, bias, threshold };
                let mask = mask(&layout, &values, &query);
                let cells = cells(&mask, &layout).1.bytes.len();
                assert!(4 * mask.words.len() <= cells + 12 && cells <= 1 << 20, "{size:?}: {cells} cells");
                assert!(!mask.is_opaque, "{query:?}");
            }
        }
    }
    let layout = TileLayout::new([8, 8], 4).expect("a layout");
    assert!(banded(&layout, &[1.0; 56], &CUT, 1).is_none(), "a row is missing");
    assert!(banded(&layout, &[1.0; 80], &CUT, 1).is_some_and(|mask| mask.is_opaque), "rows too many are left out");
    let long = TileLayout::new([1 << 16, 1], 4).expect("a layout");
    assert!(OpacityMaskMaker::new(&long, &CUT, MAX_SIDE).is_none(), "too long");
}

/// With any longest side the mask has the predicted number of bytes, and coverage is the same.
#[test]
fn smaller_masks_cover_as_much() {
    for size in [[1, 1], [3, 2], [100, 64], [777, 300], [2048, 4]] {
        let layout = TileLayout::new(size, 1).expect("a layout");
        let values = texels(&layout, disc);
        let means = [1, 16, 128, 1024, 4096].map(|most_side| {
            let mask = sized(&layout, &values, &CUT, most_side);
            let expected = mask_bytes(&layout, most_side).next_multiple_of(size_of::<u32>());
            assert_eq!(size_of_val(mask.words.as_slice()), expected, "{size:?} {most_side}");
            let (_, cells) = cells(&mask, &layout);
            assert!(cells.size.iter().all(|side| *side <= most_side), "{:?}", cells.size);
            cells.mean()
        });
        for mean in means {
            assert!((mean - means[4]).abs() < 0.02, "{size:?}: {means:?}");
        }
    }
}
