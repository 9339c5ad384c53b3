// SPDX-License-Identifier: Apache-2.0
//! The emission of a picture by place, with which triangles that show it are weighted. Only choices depend on it, never
//! radiance.
//!
//! Bounds: a map has at most 256 x 256 cells and a third more; making it reads at most [`MAX_PICTURE_BYTES`] of a
//! picture, from the coarsest level that is fine enough, in evenly spaced rows if that level is larger. Render thread
//! only.

use super::emission_weight;
use crate::textures::{ImageError, SourceImage};
use half::f16;
use oocpt_core::texture::{TexelFormat, TextureRef, Wrap, expand, is_srgb, linear_from_srgb};

/// Most cells along an axis.
const SIDE: u32 = 256;
/// Most bytes read of a picture.
const MAX_PICTURE_BYTES: u64 = 64 << 20;
/// Most samples along an edge of a triangle.
pub(super) const LATTICE: u32 = 8;
/// Share of the mean that counts everywhere: light that cells do not show is found all the same.
const FLOOR: f64 = 0.05;
/// Largest value of a channel that counts.
pub(super) const MAX_RADIANCE: f64 = 1e30;

/// The operations of an input on a texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TexelFinish {
    pub(super) channel: Option<u8>,
    pub(super) scale: [f32; 4],
    pub(super) bias: [f32; 4],
}

impl TexelFinish {
    /// The colour, not negative. `is_texel`: true if it is not a fallback, to which no scale and bias apply.
    pub(super) fn color(&self, texel: [f64; 4], is_texel: bool) -> [f64; 3] {
        let at = |k: usize| {
            let value = if is_texel { texel[k] * f64::from(self.scale[k]) + f64::from(self.bias[k]) } else { texel[k] };
            if value > 0.0 { value.min(MAX_RADIANCE) } else { 0.0 }
        };
        match self.channel {
            Some(channel) => [at(usize::from(channel.min(3))); 3],
            None => [at(0), at(1), at(2)],
        }
    }
}

/// A level of the map.
#[derive(Clone, Debug)]
struct MapLevel {
    size: [u32; 2],
    /// Mean weight of each cell, the lowest row first.
    cells: Vec<f32>,
}

/// A pyramid of mean weights.
#[derive(Clone, Debug)]
pub(super) struct EmissionMap {
    /// The levels, the finest first; the last has one cell.
    levels: Vec<MapLevel>,
    wrap: [Wrap; 2],
    /// The weight where the picture is not continued.
    outside: f64,
    mean: f64,
    /// A number that is different for each map ever made.
    pub(super) number: u64,
}

impl EmissionMap {
    /// The map of an image as `texture` reads it.
    pub(super) fn of_image(
        image: &dyn SourceImage,
        texture: &TextureRef,
        finish: &TexelFinish,
        number: u64,
    ) -> Result<Self, ImageError> {
        let info = image.info();
        let texel_bytes = info.channels as usize * info.format.bytes() as usize;
        let is_enough = |size: &[u32; 2]| size[0] >= SIDE || size[1] >= SIDE;
        let level = info.levels.iter().rposition(is_enough).unwrap_or(0);
        let [width, height] = info.levels.get(level).copied().unwrap_or_default();
        let row_bytes = u64::from(width) * texel_bytes as u64;
        if row_bytes == 0 || height == 0 || row_bytes > MAX_PICTURE_BYTES {
            return Err(ImageError(format!("{width} x {height} texels")));
        }
        let rows = u32::try_from(MAX_PICTURE_BYTES / row_bytes).unwrap_or(u32::MAX).min(height);
        let is_encoded = is_srgb(&texture.color_space, info.is_srgb, info.format, info.channels);
        let size = [width, rows].map(|n| 1 << n.min(SIDE).ilog2());
        let mut sums = vec![[0.0_f64; 2]; (size[0] * size[1]) as usize];
        let level = u32::try_from(level).unwrap_or(0);
        // One pass over the level: in a file without tiles each row would cost all those above it.
        image.decode(level, &mut |top, band| {
            for (top, row) in (top..height).zip(band.chunks_exact(width as usize * texel_bytes)) {
                let Some(y) = sampled_row(height - 1 - top, rows, height) else { continue };
                let line = y * u64::from(size[1]) / u64::from(rows) * u64::from(size[0]);
                for (x, texel) in (0_u64..).zip(row.chunks_exact(texel_bytes)) {
                    let cell = line + x * u64::from(size[0]) / u64::from(width);
                    let color = finish.color(decode(texel, info.format, is_encoded), true);
                    if let Some(sum) = usize::try_from(cell).ok().and_then(|cell| sums.get_mut(cell)) {
                        *sum = [sum[0] + emission_weight(color), sum[1] + 1.0];
                    }
                }
            }
            true
        })?;
        #[expect(clippy::cast_possible_truncation, reason = "at most 1e31")]
        let cells = sums.iter().map(|[sum, count]| (sum / count.max(1.0)) as f32).collect();
        let metadata = info.wrap.unwrap_or([Wrap::Black; 2]);
        let wrap = [0, 1].map(|k| match texture.wrap[k] {
            Wrap::UseMetadata => metadata[k],
            wrap => wrap,
        });
        let border = texture.has_border.then(|| emission_weight(finish.color(texture.fallback.map(f64::from), true)));
        Ok(Self { outside: border.unwrap_or(0.0), ..Self::of_cells(MapLevel { size, cells }, wrap, number) })
    }

    /// A map that is the same everywhere.
    pub(super) fn even(weight: f64, number: u64) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "at most 1e31")]
        let cells = vec![weight as f32];
        Self::of_cells(MapLevel { size: [1, 1], cells }, [Wrap::Clamp; 2], number)
    }

    fn of_cells(finest: MapLevel, wrap: [Wrap; 2], number: u64) -> Self {
        let mut levels = vec![finest];
        while let Some(next) = levels.last().and_then(MapLevel::coarser) {
            levels.push(next);
        }
        let mean = levels.last().and_then(|level| level.cells.first()).copied().map_or(0.0, f64::from);
        Self { levels, wrap, outside: 0.0, mean, number }
    }

    /// The mean weight of the whole map.
    pub(super) fn mean(&self) -> f64 {
        self.mean
    }

    /// Mean weight over the triangle with these places in the picture: a lattice of points, in cells as large as its
    /// steps. Never 0 where the picture emits anything.
    pub(super) fn over(&self, st: [[f64; 2]; 3]) -> f64 {
        let [a, b, c] = st;
        let longest = [(a, b), (b, c), (c, a)].map(|(p, q)| (p[0] - q[0]).abs().max((p[1] - q[1]).abs()));
        let longest = longest.into_iter().fold(0.0, f64::max);
        let finest = self.levels.first().map_or(1, |level| level.size[0].max(level.size[1]));
        let across = longest * f64::from(finest);
        let mut level = 0;
        let mut steps = across;
        while steps > f64::from(LATTICE) && level + 1 < self.levels.len() {
            steps *= 0.5;
            level += 1;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let n = (steps.ceil() as u32).clamp(1, LATTICE);
        let Some(level) = self.levels.get(level) else { return self.mean };
        let place = |[u, v]: [f64; 2]| [0, 1].map(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
        let sum: f64 = lattice(n).map(|weights| level.at(place(weights), self.wrap).unwrap_or(self.outside)).sum();
        let mean = sum / f64::from(n * n);
        (1.0 - FLOOR) * mean + FLOOR * self.mean
    }

    /// The weight at a place.
    pub(super) fn at(&self, st: [f64; 2]) -> f64 {
        self.levels.first().map_or(self.mean, |level| level.at(st, self.wrap).unwrap_or(self.outside))
    }
}

/// The middles of the parts of a triangle whose edges are cut in n: weights of the second and the third corner, n * n
/// of them.
pub(super) fn lattice(n: u32) -> impl Iterator<Item = [f64; 2]> {
    let place = move |i: u32, j: u32, off: f64| [i, j].map(|at| (f64::from(at) + off) / f64::from(n));
    (0..n).flat_map(move |i| (0..n - i).map(move |j| (i, j))).flat_map(move |(i, j)| {
        let upper = (i + j + 1 < n).then(|| place(i, j, 2.0 / 3.0));
        std::iter::once(place(i, j, 1.0 / 3.0)).chain(upper)
    })
}

impl MapLevel {
    /// The next level with half as many cells along each axis; `None` after the last.
    fn coarser(&self) -> Option<Self> {
        if self.size == [1, 1] {
            return None;
        }
        let size = self.size.map(|n| (n / 2).max(1));
        let step = [self.size[0] / size[0], self.size[1] / size[1]];
        let mut cells = Vec::with_capacity((size[0] * size[1]) as usize);
        for y in 0..size[1] {
            for x in 0..size[0] {
                let (mut sum, mut count) = (0.0, 0.0);
                for (dx, dy) in (0..step[0]).flat_map(|dx| (0..step[1]).map(move |dy| (dx, dy))) {
                    let at = (y * step[1] + dy) * self.size[0] + x * step[0] + dx;
                    sum += self.cells.get(at as usize).copied().unwrap_or(0.0);
                    count += 1.0;
                }
                cells.push(sum / count);
            }
        }
        Some(Self { size, cells })
    }

    /// The cell at a place; `None` outside of the picture.
    fn at(&self, st: [f64; 2], wrap: [Wrap; 2]) -> Option<f64> {
        let mut cell = [0_u32; 2];
        for k in 0..2 {
            let inside = wrapped(st[k], wrap[k])?;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and the size")]
            let at = (inside * f64::from(self.size[k])) as u32;
            cell[k] = at.min(self.size[k] - 1);
        }
        Some(self.cells.get((cell[1] * self.size[0] + cell[0]) as usize).copied().map_or(0.0, f64::from))
    }
}

/// A coordinate wrapped into [0, 1]; `None` if the picture is not continued there.
fn wrapped(s: f64, wrap: Wrap) -> Option<f64> {
    if !s.is_finite() {
        return None;
    }
    match wrap {
        Wrap::Repeat => Some(s - s.floor()),
        Wrap::Mirror => Some(1.0 - ((s - 2.0 * (0.5 * s).floor()) - 1.0).abs()),
        Wrap::Clamp => Some(s.clamp(0.0, 1.0)),
        Wrap::Black | Wrap::UseMetadata => (0.0..=1.0).contains(&s).then_some(s),
    }
}

/// The index of row `from` among `rows` rows spread evenly over `height`, if it is one of them.
fn sampled_row(from: u32, rows: u32, height: u32) -> Option<u64> {
    let (from, rows, height) = (u64::from(from), u64::from(rows), u64::from(height));
    let y = (from * rows).div_ceil(height);
    (y < rows && y * height / rows == from).then_some(y)
}

/// A texel in linear colours; what is not finite is 0.
fn decode(bytes: &[u8], format: TexelFormat, is_encoded: bool) -> [f64; 4] {
    let mut values = [0.0_f64; 4];
    let count = (bytes.len() / format.bytes() as usize).min(4);
    for (value, bytes) in values.iter_mut().zip(bytes.chunks_exact(format.bytes() as usize)) {
        let raw = match format {
            TexelFormat::U8 => f64::from(bytes[0]) / 255.0,
            TexelFormat::F16 => bytemuck::pod_read_unaligned::<f16>(bytes).to_f64(),
            TexelFormat::F32 => f64::from(bytemuck::pod_read_unaligned::<f32>(bytes)),
        };
        *value = if raw.is_finite() { raw } else { 0.0 };
    }
    let [r, g, b, a] = expand(&values[..count]);
    let [r, g, b] = [r, g, b].map(|v| if is_encoded { linear_from_srgb(v) } else { v });
    [r, g, b, a]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(size: [u32; 2], cells: Vec<f32>, wrap: Wrap) -> EmissionMap {
        EmissionMap::of_cells(MapLevel { size, cells }, [wrap; 2], 0)
    }

    #[test]
    fn sampled_rows_are_spread_evenly() {
        for (rows, height) in [(1, 1), (1, 7), (3, 7), (7, 7), (100, 1001), (4096, 16384)] {
            let expected: Vec<u64> = (0..u64::from(rows)).map(|y| y * u64::from(height) / u64::from(rows)).collect();
            let found: Vec<(u64, u64)> =
                (0..height).filter_map(|from| Some((sampled_row(from, rows, height)?, from.into()))).collect();
            assert!(found.iter().map(|row| row.0).eq(0..u64::from(rows)), "{rows} of {height}: each once, in order");
            assert!(found.iter().map(|row| row.1).eq(expected), "{rows} of {height}: where they are");
        }
    }

    const WHOLE: [[f64; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

    #[test]
    fn triangle_emission_is_the_mean_of_covered_cells() {
        // The left half of 256 x 256 cells is bright.
        let cells = (0..256 * 256).map(|at| if at % 256 < 128 { 1.0 } else { 0.0 }).collect();
        let map = map([256, 256], cells, Wrap::Black);
        assert!((map.mean() - 0.5).abs() < 1e-6, "mean {}", map.mean());
        let floor = FLOOR * 0.5;
        // Three quarters of the triangle are in the left half.
        assert!((map.over(WHOLE) - (0.95 * 0.75 + floor)).abs() < 0.05, "{}", map.over(WHOLE));
        let small = |s: f64| [[s, 0.4], [s + 0.01, 0.4], [s, 0.41]];
        assert!((map.over(small(0.2)) - (0.95 + floor)).abs() < 1e-6, "in the light: {}", map.over(small(0.2)));
        assert!((map.over(small(0.7)) - floor).abs() < 1e-6, "in the dark: {}", map.over(small(0.7)));
        assert!((map.over(small(1.2)) - floor).abs() < 1e-6, "outside: {}", map.over(small(1.2)));
    }

    #[test]
    fn emission_outside_the_image_follows_the_wrap_mode() {
        let cells = vec![1.0, 0.0];
        for (wrap, outside) in [(Wrap::Repeat, 1.0), (Wrap::Mirror, 0.0), (Wrap::Clamp, 0.0), (Wrap::Black, 0.0)] {
            let map = map([2, 1], cells.clone(), wrap);
            let there = [[1.2, 0.5], [1.21, 0.5], [1.2, 0.51]];
            let given = map.over(there);
            assert!((given - (0.95 * outside + 0.025)).abs() < 1e-6, "{wrap:?}: {given}");
        }
        let bordered = EmissionMap { outside: 3.0, ..map([2, 1], cells, Wrap::Black) };
        let given = bordered.over([[1.2, 0.5], [1.21, 0.5], [1.2, 0.51]]);
        assert!((given - (0.95 * 3.0 + 0.025)).abs() < 1e-6, "a border: {given}");
    }

    #[test]
    fn emission_applies_channel_scale_and_bias_and_clamps_at_zero() {
        let finish = TexelFinish { channel: None, scale: [2.0, 1.0, 1.0, 1.0], bias: [0.0, -1.0, 0.5, 0.0] };
        assert_eq!(finish.color([1.0, 0.5, 0.25, 1.0], true), [2.0, 0.0, 0.75], "each channel for itself");
        assert_eq!(finish.color([1.0, 0.5, 0.25, 1.0], false), [1.0, 0.5, 0.25], "a fallback stays as it is");
        let one = TexelFinish { channel: Some(3), ..finish };
        assert_eq!(one.color([1.0, 0.5, 0.25, 0.75], true), [0.75; 3], "one channel for all");
    }
}
