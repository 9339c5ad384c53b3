// SPDX-License-Identifier: Apache-2.0
//! Bounds against lookups in f64: whatever a lookup meets lies in them.

#![expect(clippy::cast_possible_truncation, reason = "numbers of choices are small")]

use std::sync::Arc;

use super::*;
use crate::desc::AssetRef;
use crate::material::TextureRef;
use crate::texture::{ColorSpace, HeightImage, OpacityQuery, TextureSampler, TileLayout};

/// A generator of numbers (Steele et al. 2014, `SplitMix64`).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.bits() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    pub(crate) fn one_of<T: Copy, const N: usize>(&mut self, values: [T; N]) -> T {
        values[(self.bits() >> 32) as usize % N]
    }
}

/// Members of a set, or with number 0 a file.
#[derive(Clone, Debug)]
pub(crate) struct Files(pub(crate) Vec<(u32, Picture)>);

#[derive(Clone, Debug)]
pub(crate) struct Picture {
    size: [u32; 2],
    texels: Vec<f32>,
}

impl Picture {
    pub(crate) fn new(size: [u32; 2], mut texel: impl FnMut([f64; 2]) -> f64) -> Self {
        let at = |i: u32, side: u32| (f64::from(i) + 0.5) / f64::from(side);
        let all = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [at(x, size[0]), at(y, size[1])]));
        Self { size, texels: all.map(|st| texel(st) as f32).collect() }
    }

    /// The probability that a lookup meets something.
    pub(crate) fn share(&self, query: &OpacityQuery, st: [f64; 2]) -> f64 {
        let layout = TileLayout::new(self.size, 4).expect("a layout");
        let texel = |_, x: u32, y: u32| [f64::from(self.texels[(y * self.size[0] + x) as usize]); 4];
        let sampler = TextureSampler { layout, wrap: query.wrap, outside: [query.outside.into(); 4], texel };
        let opacity = sampler.bilinear(st, 0)[0] * f64::from(query.scale) + f64::from(query.bias);
        if query.threshold > 0.0 { f64::from(u8::from(opacity >= query.threshold.into())) } else { opacity.max(0.0) }
    }
}

impl HeightImage for Picture {
    fn layout(&self) -> TileLayout {
        TileLayout::new(self.size, 4).expect("a layout")
    }

    fn wrap(&self) -> Option<[Wrap; 2]> {
        None
    }

    fn channel(&self, level: u32, _: u8) -> Result<Vec<f32>, String> {
        if level == 0 { Ok(self.texels.clone()) } else { Err("level 0 is asked for".to_owned()) }
    }
}

impl HeightFiles for Files {
    fn open(&self, _: &TextureRef, member: u32) -> Result<Option<Arc<dyn HeightImage>>, String> {
        let found = self.0.iter().find(|(number, _)| *number == member);
        Ok(found.map(|(_, picture)| Arc::new(picture.clone()) as Arc<dyn HeightImage>))
    }
}

pub(crate) fn cut(file: &str, wrap: [Wrap; 2], [scale, bias, threshold]: [f32; 3], outside: f32) -> CutoutImage {
    let asset = AssetRef { authored: file.into(), resolved: file.into() };
    let (fallback, has_border) = ([outside; 4], true);
    let (color_space, prim) = (ColorSpace::Raw, "/m".into());
    let texture = TextureRef { prim, asset, wrap, color_space, fallback, has_border, is_ptex: false };
    CutoutImage { texture, channel: 0, scale, bias, threshold }
}

fn disc([s, t]: [f64; 2]) -> f64 {
    ((0.3 - (s - 0.4).hypot(t - 0.6)) * 40.0 + 0.5).clamp(0.0, 1.0)
}

/// Any wrap mode, factor, summand, threshold and what is around.
pub(crate) fn any_cut(random: &mut Random, file: &str) -> CutoutImage {
    const WRAPS: [Wrap; 5] = [Wrap::UseMetadata, Wrap::Black, Wrap::Clamp, Wrap::Repeat, Wrap::Mirror];
    let numbers = [
        random.one_of([1.0, 1.0, -1.0, 0.7, 3.0]),
        random.one_of([0.0, 0.0, 1.0, -0.25]),
        random.one_of([0.0, 0.25, 0.5, 0.999]),
    ];
    let wrap = [random.one_of(WRAPS), random.one_of(WRAPS)];
    cut(file, wrap, numbers, random.one_of([0.0, 0.0, 0.0, 1.0, 0.3]))
}

/// Pictures of which little is there.
pub(crate) fn any_picture(random: &mut Random) -> Picture {
    let size = random.one_of([[1, 1], [2, 1], [7, 3], [16, 16], [33, 64], [130, 200], [600, 40]]);
    let corner = [random.between(-0.2, 1.0), random.between(-0.2, 1.0)];
    let rare = random.one_of([0.0, 0.0, 0.02]);
    match random.one_of([0, 1, 2]) {
        0 => Picture::new(size, disc),
        1 => Picture::new(size, |st| {
            f64::from(u8::from([0, 1].iter().all(|i| (0.0..0.2).contains(&(st[*i] - corner[*i])))))
        }),
        _ => Picture::new(size, |_| f64::from(u8::from(random.between(0.0, 1.0) < rare))),
    }
}

#[test]
fn bounds_hold_every_place_that_a_lookup_meets() {
    let mut random = Random(1);
    let (mut met, mut smaller, mut nothing) = (0, 0, 0);
    for _ in 0..600 {
        let (image, picture) = (any_cut(&mut random, "a"), any_picture(&mut random));
        let Some(covered) = CoveredImage::read(&image, &Files(vec![(0, picture.clone())])) else { continue };
        let query = image.query(image.texture.wrap);
        for _ in 0..20 {
            let far = random.one_of([0.5, 2.5]);
            let low = [random.between(-far, far + 0.5), random.between(-far, far + 0.5)];
            let size = [random.one_of([0.0, 0.01, 0.2, 1.0, 1.5]), random.one_of([0.0, 0.01, 0.2, 1.0, 1.5])];
            let region = [low, [low[0] + size[0], low[1] + size[1]]];
            let found = covered.within(region, [0.0; 2]);
            nothing += i32::from(found.is_none());
            smaller += i32::from(found.is_some_and(|found| found != region));
            for _ in 0..40 {
                let st = [random.between(low[0], region[1][0]), random.between(low[1], region[1][1])];
                if picture.share(&query, st) <= 0.0 {
                    continue;
                }
                met += 1;
                let is_inside = |[a, b]: UvRegion| (0..2).all(|i| a[i] - 1.0e-9 <= st[i] && st[i] <= b[i] + 1.0e-9);
                assert!(found.is_some_and(is_inside), "{image:?} {:?} {st:?}: {found:?}", picture.size);
            }
        }
    }
    assert!(met > 20_000 && smaller > 1000 && nothing > 1000, "all of it was tried: {met} {smaller} {nothing}");
}

#[test]
fn bounds_are_those_of_the_cells_that_a_footprint_meets() {
    // Two leaves of an atlas.
    let leaf = |[s, t]: [f64; 2]| (0.1..0.3).contains(&s) && ((0.1..0.2).contains(&t) || (0.7..0.9).contains(&t));
    let picture = Picture::new([1024, 512], |st| f64::from(u8::from(leaf(st))));
    let image = cut("a", [Wrap::Repeat; 2], [1.0, 0.0, 0.5], 0.0);
    let covered = CoveredImage::read(&image, &Files(vec![(0, picture)])).expect("something is cut out");
    let is_near = |region: UvRegion, [low, high]: UvRegion| {
        let found = covered.within(region, [0.0; 2]).expect("a leaf");
        let off = (0..2).map(|i| (found[0][i] - low[i]).abs().max((found[1][i] - high[i]).abs())).fold(0.0, f64::max);
        // A cell, and half a texel that a lookup reaches farther.
        assert!(off < 2.0 / 256.0, "{region:?}: {found:?}, not {:?}", [low, high]);
    };
    is_near([[0.0, 0.0], [1.0, 0.5]], [[0.1, 0.1], [0.3, 0.2]]);
    is_near([[0.0, 0.5], [1.0, 1.0]], [[0.1, 0.7], [0.3, 0.9]]);
    is_near([[0.0, 0.0], [1.0, 1.0]], [[0.1, 0.1], [0.3, 0.9]]);
    is_near([[0.2, 0.0], [1.0, 0.5]], [[0.2, 0.1], [0.3, 0.2]]);
    is_near([[7.0, -2.0], [8.0, -1.5]], [[7.1, -1.9], [7.3, -1.8]]);
    for nothing in
        [[[0.0, 0.3], [1.0, 0.6]], [[0.4, 0.0], [1.0, 1.0]], [[0.4, 0.0], [1.05, 1.0]], [[5.5, 3.5], [5.5, 3.5]]]
    {
        assert_eq!(covered.within(nothing, [0.0; 2]), None, "{nothing:?}");
    }
    let opaque = Files(vec![(0, Picture::new([8, 8], |_| 1.0))]);
    assert!(CoveredImage::read(&image, &opaque).is_none(), "all of it is there");
    assert!(CoveredImage::read(&image, &Files(Vec::new())).is_none(), "it cannot be read");
}

/// A leaf that begins at the edge of a picture that repeats: its other edge is half of it, and beyond that is the next
/// one.
#[test]
fn edges_of_repeated_pictures_do_not_count() {
    let corner = |[s, t]: [f64; 2]| f64::from(u8::from(s < 0.5 && t < 0.5));
    for side in [16, 128, 512, 1024] {
        let files = Files(vec![(0, Picture::new([side; 2], corner))]);
        let within = |threshold: f32| {
            let image = cut("a", [Wrap::Repeat; 2], [1.0, 0.0, threshold], 0.0);
            let covered = CoveredImage::read(&image, &files).expect("something is cut out");
            covered.within([[-1.0e-6; 2], [1.0 + 1.0e-6; 2]], [2.0e-6; 2]).expect("a leaf")
        };
        let half = 0.5 + 1.1 / f64::from(side.min(256));
        assert!(within(0.5)[1].iter().all(|end| *end <= half), "{side}: {:?}", within(0.5));
        assert!(within(0.25)[1].iter().all(|end| *end >= 1.0), "{side}: more than half of a texel is there");
    }
}

#[test]
fn sets_of_files_have_bounds_of_their_own() {
    let half = |side: usize| Picture::new([16, 16], move |st| f64::from(u8::from(st[side] < 0.5)));
    let image = cut("a.<UDIM>.png", [Wrap::Black; 2], [1.0, 0.0, 0.5], 0.0);
    let files = Files(vec![(1001, half(0)), (1012, half(1)), (1002, Picture::new([4, 4], |_| 1.0))]);
    let covered = CoveredImage::read(&image, &files).expect("something is cut out");
    let within = |s: f64, t: f64| covered.within([[s + 0.1, t + 0.1], [s + 0.9, t + 0.9]], [0.0; 2]);
    let is_cut = |found: Option<UvRegion>, axis: usize| found.is_some_and(|found| found[1][axis].fract() < 0.6);
    assert!(is_cut(within(0.0, 0.0), 0) && !is_cut(within(0.0, 0.0), 1), "1001");
    assert!(is_cut(within(1.0, 1.0), 1) && !is_cut(within(1.0, 1.0), 0), "1012");
    for unknown in [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [10.0, 0.0], [0.0, 10.0]] {
        let [s, t] = unknown;
        assert_eq!(within(s, t), Some([[s + 0.1, t + 0.1], [s + 0.9, t + 0.9]]), "{unknown:?}: not known");
    }
}

#[test]
fn bounds_of_hostile_places_are_whole() {
    let image = cut("a", [Wrap::Repeat; 2], [1.0, 0.0, 0.5], 0.0);
    let covered = CoveredImage::read(&image, &Files(vec![(0, Picture::new([16, 16], disc))])).expect("a disc");
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    for region in
        [[[0.0, 0.0], [1.0e30, 1.0]], [[-inf, 0.0], [inf, 1.0]], [[1.0e9, 0.0], [1.0e9, 0.0]], [[nan, 0.0], [nan, 1.0]]]
    {
        let found = covered.within(region, [0.0; 2]).expect("whole");
        assert!(found == region || region[0][0].is_nan(), "{region:?}: {found:?}");
    }
}
