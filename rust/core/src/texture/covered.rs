// SPDX-License-Identifier: Apache-2.0
//! Coarse images of cutouts, which bound the part of a surface around a position that a texture keeps. No ray hits the
//! surface in a cell that is left out, from whatever distance ([`super::opacity_mask`]). Pure but for the images that
//! it reads; any thread.

use xxhash_rust::xxh3::Xxh3;

use super::opacity_mask::{OpacityMask, OpacityMaskMaker, OpacityQuery};
use super::{HeightFiles, Wrap};
use crate::material::CutoutImage;

/// Largest number of cells along a side.
const MAX_SIDE: u32 = 256;
/// Longest side, in images, of a region that is looked up: most of a repeated picture is kept somewhere.
const MAX_REGION_SIDE: f64 = 1.5;
/// Largest coordinate that is looked up.
const FARTHEST: f64 = 1.0e5;
/// Number of parts of a set of files along a side.
const PARTS: usize = 10;
/// Number of the first file of a set.
const FIRST_MEMBER: u32 = 1001;

/// Corners of a rectangle in texture coordinates.
pub(crate) type UvRegion = [[f64; 2]; 2];

/// The cells that an image or a set of images keeps.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CoveredImage(CoveredParts);

#[derive(Clone, Debug, PartialEq)]
enum CoveredParts {
    One(CellBits),
    /// A set of images; a member that is missing is unknown.
    Set(Vec<Option<CellBits>>),
}

/// The cells of an image, one bit each.
#[derive(Clone, Debug, PartialEq)]
struct CellBits {
    size: [u32; 2],
    /// Number of words of a row.
    stride: usize,
    bits: Vec<u64>,
    wrap: [Wrap; 2],
    /// Width of the ring around a picture that is not continued in which lookups mix with it.
    ring: [f64; 2],
    /// True if something is kept around the picture.
    is_around: bool,
}

impl CutoutImage {
    /// The query about an image that is continued in this way.
    pub(crate) fn query(&self, wrap: [Wrap; 2]) -> OpacityQuery {
        let Self { texture, channel, scale, bias, threshold } = self;
        let border = if texture.has_border { texture.fallback } else { [0.0; 4] };
        let outside = border[usize::from(*channel & 3)];
        OpacityQuery { wrap, outside, scale: *scale, bias: *bias, threshold: *threshold }
    }
}

impl CoveredImage {
    /// Reads an image; `None` if nothing is known of it, or all of it is kept.
    pub(crate) fn read(image: &CutoutImage, files: &dyn HeightFiles) -> Option<Self> {
        if !image.texture.is_udim() {
            return CellBits::read(image, 0, files).map(|grid| Self(CoveredParts::One(grid)));
        }
        let members = (FIRST_MEMBER..).take(PARTS * PARTS);
        let parts: Vec<Option<CellBits>> = members.map(|member| CellBits::read(image, member, files)).collect();
        parts.iter().any(Option::is_some).then_some(Self(CoveredParts::Set(parts)))
    }

    /// Adds all bits to the hash.
    pub(crate) fn hash(&self, hasher: &mut Xxh3) {
        match &self.0 {
            CoveredParts::One(grid) => grid.hash(hasher),
            CoveredParts::Set(parts) => parts.iter().for_each(|part| match part {
                Some(grid) => grid.hash(hasher),
                None => hasher.update(&[u8::MAX]),
            }),
        }
    }

    /// Bounds of the kept part of a rectangle; `None` if nothing is kept. `seam`: parts narrower than this beyond the
    /// edge of an image are ignored.
    pub(crate) fn within(&self, region: UvRegion, seam: [f64; 2]) -> Option<UvRegion> {
        let [low, high] = region;
        let is_near = |axis: usize| {
            high[axis] - low[axis] <= MAX_REGION_SIDE && low[axis].abs() <= FARTHEST && high[axis].abs() <= FARTHEST
        };
        if !(is_near(0) && is_near(1)) {
            return Some(region);
        }
        if let CoveredParts::One(grid) = &self.0
            && grid.leaves(region)
        {
            return Some(region);
        }
        #[expect(clippy::cast_possible_truncation, reason = "not far away")]
        let units = |axis: usize| {
            let seam = seam[axis].min(0.5 * (high[axis] - low[axis]));
            let inner = ((low[axis] + seam).floor() as i64, (high[axis] - seam).ceil() as i64 - 1);
            let all = (low[axis].floor() as i64, high[axis].floor() as i64);
            let (first, last) = if inner.0 <= inner.1 { inner } else { all };
            first..=last
        };
        let all = units(1).flat_map(|t| units(0).map(move |s| [s, t]));
        all.filter_map(|unit| self.within_unit(region, unit)).reduce(union)
    }

    /// The kept part of a rectangle within a unit square.
    fn within_unit(&self, region: UvRegion, unit: [i64; 2]) -> Option<UvRegion> {
        match &self.0 {
            CoveredParts::One(grid) => grid.within(region, unit, grid.wrap),
            CoveredParts::Set(parts) => {
                let number = |at: i64| usize::try_from(at).ok().filter(|at| *at < PARTS);
                let part = number(unit[0]).zip(number(unit[1])).and_then(|(s, t)| parts.get(s + PARTS * t)?.as_ref());
                match part {
                    Some(grid) => grid.within(region, unit, [Wrap::Repeat; 2]),
                    None => Some(inside(region, unit)),
                }
            }
        }
    }
}

fn union([a, b]: UvRegion, [c, d]: UvRegion) -> UvRegion {
    [[0, 1].map(|i| a[i].min(c[i])), [0, 1].map(|i| b[i].max(d[i]))]
}

/// The part of a rectangle in a unit square.
#[expect(clippy::cast_precision_loss, reason = "not far away")]
fn inside([low, high]: UvRegion, unit: [i64; 2]) -> UvRegion {
    let unit = unit.map(|at| at as f64);
    [[0, 1].map(|i| low[i].max(unit[i])), [0, 1].map(|i| high[i].min(unit[i] + 1.0))]
}

/// Cells along an axis, and their positions.
#[derive(Clone, Copy)]
struct CellSpan {
    first: u32,
    last: u32,
    place: SpanPlace,
}

#[derive(Clone, Copy)]
enum SpanPlace {
    /// Cells are counted forwards from this coordinate.
    Forward(f64),
    /// Cells are counted backwards from this coordinate.
    Backward(f64),
    /// All cells are at this interval.
    Fixed([f64; 2]),
}

impl CellSpan {
    /// Ends of the interval of cells `first` to `last` of `count`.
    fn ends(self, [first, last]: [u32; 2], count: u32) -> [f64; 2] {
        let at = |cell: u32| f64::from(cell) / f64::from(count);
        match self.place {
            SpanPlace::Forward(from) => [from + at(first), from + at(last + 1)],
            SpanPlace::Backward(to) => [to - at(last + 1), to - at(first)],
            SpanPlace::Fixed(ends) => ends,
        }
    }
}

impl CellBits {
    fn read(image: &CutoutImage, member: u32, files: &dyn HeightFiles) -> Option<Self> {
        let file = files.open(&image.texture, member).ok()??;
        let metadata = file.wrap().unwrap_or([Wrap::Black; 2]);
        let wrap = [0, 1].map(|axis: usize| match image.texture.wrap[axis] {
            _ if member > 0 => Wrap::Clamp,
            Wrap::UseMetadata => metadata[axis],
            wrap => wrap,
        });
        let mut maker = OpacityMaskMaker::new(&file.layout(), &image.query(wrap), MAX_SIDE)?;
        // The reader of its tiles reports what is wrong with the file.
        file.rows(image.channel, &mut |rows| maker.push(rows)).ok()?;
        Self::new(&maker.finish()?, file.layout().size(), wrap)
    }

    fn new(mask: &OpacityMask, texels: [u32; 2], wrap: [Wrap; 2]) -> Option<Self> {
        if mask.is_opaque {
            return None;
        }
        let (size, cells) = mask.cells()?;
        let stride = size[0].div_ceil(u64::BITS) as usize;
        let mut bits = vec![0_u64; stride * size[1] as usize];
        for (row, words) in cells.chunks_exact(size[0] as usize).zip(bits.chunks_exact_mut(stride)) {
            for (cells, word) in row.chunks(u64::BITS as usize).zip(words) {
                *word = cells.iter().rev().fold(0, |word, cell| word << 1 | u64::from(*cell != 0));
            }
        }
        // A little more than half a texel.
        let ring = texels.map(|side| 0.501 / f64::from(side.max(1)));
        Some(Self { size, stride, bits, wrap, ring, is_around: mask.around() != 0 })
    }

    fn hash(&self, hasher: &mut Xxh3) {
        let Self { size, stride: _, bits, wrap, ring, is_around } = self;
        hasher.update(bytemuck::cast_slice(size));
        hasher.update(bytemuck::cast_slice(bits));
        hasher.update(&[wrap[0] as u8, wrap[1] as u8, u8::from(*is_around)]);
        hasher.update(bytemuck::cast_slice(ring));
    }

    /// Returns true if a rectangle extends to where something is kept around the picture.
    fn leaves(&self, [low, high]: UvRegion) -> bool {
        let is_out = |axis: usize| self.wrap[axis] == Wrap::Black && (low[axis] < 0.0 || high[axis] > 1.0);
        self.is_around && (is_out(0) || is_out(1))
    }

    /// Cells along an axis in the part of a range that lies in a unit; `None` if there is none.
    fn span(&self, axis: usize, [low, high]: [f64; 2], unit: i64, wrap: Wrap) -> Option<CellSpan> {
        let last = self.size[axis] - 1;
        #[expect(clippy::cast_precision_loss, reason = "not far away")]
        let from = unit as f64;
        let (a, b) = ((low - from).max(0.0), (high - from).min(1.0));
        if a > b {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in the image")]
        let cell = |at: f64| ((at * f64::from(self.size[axis])) as u32).min(last);
        let forward = CellSpan { first: cell(a), last: cell(b), place: SpanPlace::Forward(from) };
        let border = if unit < 0 { 0 } else { last };
        let fixed =
            |a: f64, b: f64| CellSpan { first: border, last: border, place: SpanPlace::Fixed([from + a, from + b]) };
        let ring = self.ring[axis];
        match wrap {
            Wrap::Mirror if unit.rem_euclid(2) == 1 => {
                Some(CellSpan { first: cell(1.0 - b), last: cell(1.0 - a), place: SpanPlace::Backward(from + 1.0) })
            }
            Wrap::Repeat | Wrap::Mirror => Some(forward),
            _ if unit == 0 => Some(forward),
            Wrap::Clamp => Some(fixed(a, b)),
            Wrap::Black | Wrap::UseMetadata => match unit {
                -1 if b >= 1.0 - ring => Some(fixed(a.max(1.0 - ring), b)),
                1 if a <= ring => Some(fixed(a, b.min(ring))),
                _ => None,
            },
        }
    }

    /// Bounds of the kept part of a rectangle within a unit square.
    fn within(&self, [low, high]: UvRegion, unit: [i64; 2], wrap: [Wrap; 2]) -> Option<UvRegion> {
        let span = |axis: usize| self.span(axis, [low[axis], high[axis]], unit[axis], wrap[axis]);
        let (across, up) = (span(0)?, span(1)?);
        let (begin, end) = (across.first / u64::BITS, across.last / u64::BITS);
        let (mut rows, mut any) = (None::<[u32; 2]>, [0_u64; (MAX_SIDE / u64::BITS) as usize]);
        for y in up.first..=up.last {
            let row = self.bits.get(y as usize * self.stride..)?.get(begin as usize..=end as usize)?;
            let mut is_there = false;
            for ((word, bits), any) in (begin..).zip(row).zip(&mut any) {
                let bits = bits & between(across.first, across.last, word);
                *any |= bits;
                is_there |= bits != 0;
            }
            if is_there {
                rows = Some([rows.map_or(y, |rows| rows[0]), y]);
            }
        }
        let numbered = || (begin..).zip(&any).filter(|(_, bits)| **bits != 0);
        let first = numbered().next().map(|(word, bits)| word * u64::BITS + bits.trailing_zeros())?;
        let last = numbered().last().map(|(word, bits)| word * u64::BITS + 63 - bits.leading_zeros())?;
        let [s, t] = [across.ends([first, last], self.size[0]), up.ends(rows?, self.size[1])];
        Some([[s[0], t[0]], [s[1], t[1]]])
    }
}

/// The bits of a word that are cells from `first` to `last`.
fn between(first: u32, last: u32, word: u32) -> u64 {
    let base = word * u64::BITS;
    let low = if first > base { u64::MAX << (first - base) } else { u64::MAX };
    let high = if last - base < u64::BITS - 1 { (1 << (last - base + 1)) - 1 } else { u64::MAX };
    low & high
}

#[cfg(test)]
pub(crate) mod tests;
