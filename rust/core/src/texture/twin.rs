// SPDX-License-Identifier: Apache-2.0
//! The filter of `shaders/texture/texture.glsl` in f64, for tests.
//!
//! Widths of filters are in texels of level 0 (`footprint.rs`). Between widths of 2^l and 2^(l+1) texels the levels l
//! and l + 1 are mixed linearly in the width (the usual choice is linear in its logarithm;
//! the two agree at powers of two and differ by at most 0.086 of a level; this one needs no transcendental function).

use super::{FaceLayout, TileLayout, Wrap};

/// The finer level and the share of the next coarser one, for a filter that is `width` texels of level 0 wide.
pub fn select_level(width: f64, levels: u32) -> (u32, f64) {
    let coarsest = levels.max(1) - 1;
    let (mut level, mut scale) = (0, 1.0);
    if width.is_nan() || width <= 1.0 {
        return (0, 0.0);
    }
    while level < coarsest && width >= 2.0 * scale {
        level += 1;
        scale *= 2.0;
    }
    if level == coarsest { (level, 0.0) } else { (level, width / scale - 1.0) }
}

/// Steps along u and v of a packed Ptex place.
const PTEX_STEPS: f64 = oocpt_abi::PTEX_STEPS as f64;

/// A place in a Ptex file as two floats, `pack_ptex` of `shaders/texture/ptex.glsl`: 26 bits for the face, 17 each for
/// u and v in 0 to 1.
pub fn pack_ptex(face: u32, uv: [f64; 2]) -> [f32; 2] {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 2^17 - 1")]
    let [u, v] = uv.map(|x| (x * PTEX_STEPS).clamp(0.0, PTEX_STEPS - 1.0) as u32);
    let float = |bits: u32| f32::from_bits((bits >> 29) << 31 | 0x2000_0000 | (bits & 0x1fff_ffff));
    [float(face | (u >> 13) << 26), float((u & 0x1fff) | v << 13)]
}

/// Face, u and v of what [`pack_ptex`] gave: in the middle of a step.
pub fn unpack_ptex(st: [f32; 2]) -> (u32, [f64; 2]) {
    let [x, y] = st.map(|v| (v.to_bits() >> 31) << 29 | (v.to_bits() & 0x1fff_ffff));
    let steps = [(x >> 26) << 13 | (y & 0x1fff), y >> 13];
    (x & 0x03ff_ffff, steps.map(|step| (f64::from(step) + 0.5) / PTEX_STEPS))
}

/// A Ptex file and its texels, by their numbers in the layout.
#[derive(Clone, Copy, Debug)]
pub struct PtexSampler<'a, T> {
    /// Where texels are.
    pub layout: &'a FaceLayout,
    /// The decoded texel of a number.
    pub texel: T,
}

impl<T: Fn(u32) -> [f64; 4]> PtexSampler<'_, T> {
    /// The value at a place of a face, by a filter of `width` texels of its own size; `None` for a face that is not
    /// there.
    pub fn lookup(&self, face: u32, uv: [f64; 2], width: f64) -> Option<[f64; 4]> {
        let own = (0..self.layout.classes()).rev().find(|class| self.layout.block(*class, face).is_some())?;
        let (level, blend) = select_level(width, own + 1);
        let fine = self.bilinear(face, uv, own - level)?;
        if blend == 0.0 {
            return Some(fine);
        }
        Some(mix(fine, self.bilinear(face, uv, own - level - 1)?, blend))
    }

    /// The value at a place of a reduction of a face.
    pub fn bilinear(&self, face: u32, uv: [f64; 2], class: u32) -> Option<[f64; 4]> {
        let block = self.layout.block(class, face)?;
        let place = |axis: usize| {
            let x = uv[axis] * f64::from(block.size[axis]) + 0.5;
            (x.floor(), x - x.floor())
        };
        let ((x, fx), (y, fy)) = (place(0), place(1));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the block")]
        let at = |dx: u32, dy: u32| (self.texel)(block.first + (y as u32 + dy) * (block.size[0] + 2) + x as u32 + dx);
        Some(mix(mix(at(0, 0), at(1, 0), fx), mix(at(0, 1), at(1, 1), fx), fy))
    }
}

/// An image and how to look it up.
#[derive(Clone, Copy, Debug)]
pub struct TextureSampler<T> {
    /// Levels.
    pub layout: TileLayout,
    /// Along s and t.
    pub wrap: [Wrap; 2],
    /// The texels around the image, where it is not continued.
    pub outside: [f64; 4],
    /// The decoded texel (x, y) of a level.
    pub texel: T,
}

impl<T: Fn(u32, u32, u32) -> [f64; 4]> TextureSampler<T> {
    /// The value at `st`, by a filter of `width`.
    pub fn lookup(&self, st: [f64; 2], width: f64) -> [f64; 4] {
        let (level, blend) = select_level(width, self.layout.levels());
        let fine = self.bilinear(st, level);
        if blend == 0.0 {
            return fine;
        }
        let coarse = self.bilinear(st, level + 1);
        mix(fine, coarse, blend)
    }

    /// The value at `st` of a level.
    pub fn bilinear(&self, st: [f64; 2], level: u32) -> [f64; 4] {
        let size = self.layout.level_size(level);
        let place = |axis: usize| {
            let x = if st[axis].is_finite() { st[axis] } else { 0.0 } * f64::from(size[axis]) - 0.5;
            (x.floor(), x - x.floor())
        };
        let ((x, fx), (y, fy)) = (place(0), place(1));
        let at =
            |dx: f64, dy: f64| match (wrapped(x + dx, size[0], self.wrap[0]), wrapped(y + dy, size[1], self.wrap[1])) {
                (Some(x), Some(y)) => (self.texel)(level, x, y),
                _ => self.outside,
            };
        mix(mix(at(0.0, 0.0), at(1.0, 0.0), fx), mix(at(0.0, 1.0), at(1.0, 1.0), fx), fy)
    }
}

fn mix(a: [f64; 4], b: [f64; 4], t: f64) -> [f64; 4] {
    [0, 1, 2, 3].map(|i: usize| a[i] + (b[i] - a[i]) * t)
}

/// The texel that stands for texel `x` of `size`; `None` is what lies around the image.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a non-negative integer below size")]
fn wrapped(x: f64, size: u32, wrap: Wrap) -> Option<u32> {
    let n = f64::from(size);
    let inside = match wrap {
        Wrap::Black | Wrap::UseMetadata if x < 0.0 || x >= n => return None,
        Wrap::Black | Wrap::UseMetadata => x,
        Wrap::Clamp => x.clamp(0.0, n - 1.0),
        Wrap::Repeat => x.rem_euclid(n),
        Wrap::Mirror => {
            let m = x.rem_euclid(2.0 * n);
            if m < n { m } else { 2.0 * n - 1.0 - m }
        }
    };
    Some(inside as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_ptex_coordinates_round_trip() {
        for (face, u, v) in [(0, 0.0, 0.0), (1, 1.0, 1.0), ((1 << 26) - 1, 0.3, 0.999), (12345, 0.5, 1e-9)] {
            let packed = pack_ptex(face, [u, v]);
            assert!(packed.iter().all(|v| v.is_normal()), "nothing on its way changes {packed:?}");
            let (back, uv) = unpack_ptex(packed);
            assert_eq!(back, face);
            assert!((uv[0] - u).abs() <= 1.0 / 131_072.0 && (uv[1] - v).abs() <= 1.0 / 131_072.0, "{uv:?}");
        }
    }

    #[test]
    fn mip_level_follows_the_filter_width() {
        assert_eq!(select_level(0.3, 5), (0, 0.0), "finer than the image");
        assert_eq!(select_level(1.0, 5), (0, 0.0), "a texel");
        assert_eq!(select_level(3.0, 5), (1, 0.5), "half way from 2 to 4");
        assert_eq!(select_level(16.0, 5), (4, 0.0), "the coarsest");
        assert_eq!(select_level(1e30, 5), (4, 0.0), "and no further");
        assert_eq!(select_level(f64::NAN, 5), (0, 0.0), "nonsense");
    }

    #[test]
    fn wrap_modes_of_a_row_of_four_texels() {
        let row = |wrap: Wrap| {
            (-6..10).map(|x| wrapped(f64::from(x), 4, wrap)).map(|x| x.map_or(9, |x| x)).collect::<Vec<_>>()
        };
        assert_eq!(row(Wrap::Repeat), [2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1], "repeat");
        assert_eq!(row(Wrap::Mirror), [2, 3, 3, 2, 1, 0, 0, 1, 2, 3, 3, 2, 1, 0, 0, 1], "mirror");
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 3, 3, 3, 3, 3, 3], "clamp");
        assert_eq!(row(Wrap::Black), [9, 9, 9, 9, 9, 9, 0, 1, 2, 3, 9, 9, 9, 9, 9, 9], "black");
    }
}
