// SPDX-License-Identifier: Apache-2.0
//! What an expression is, is told by trying it: one that depends on one texel alone is worked out for a few texels, and
//! where it multiplies and adds by channel it is that texture with scale and bias. Coordinates of a lookup that are an
//! affine function of one set are told in the same way.

use crate::assemble::{InputSource, ProgramAssembler};
use crate::expression::Val;
use crate::program::{Geometry, ProgramLookup};
use crate::uses::LookupUse;

/// Texels that tell what an expression does with them, after black.
const PROBES: [[f32; 4]; 6] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
    [0.25, 0.625, 0.875, 0.5],
    [0.75, 0.125, 0.375, 1.0],
];

/// Whether two numbers are the same but for rounding.
fn near(a: f32, b: f32) -> bool {
    (a - b).abs() <= 2.0e-6 * (1.0 + a.abs().max(b.abs()))
}

impl ProgramAssembler<'_> {
    /// A constant, a texture or a primvar, if it is one in its first `width` components.
    pub(crate) fn simple(&self, val: Val, width: usize) -> Option<InputSource> {
        if let Val::Constant(value) = val {
            return Some(InputSource::Constant(value));
        }
        let leaves = self.expressions.leaves(val);
        if leaves.geometry == 0 && leaves.lookups.count_ones() == 1 {
            return self.texture(val, width, leaves.lookups.trailing_zeros());
        }
        let slot = match leaves.geometry {
            g if g == 1 << Geometry::Primvar0 as u32 => 0,
            g if g == 1 << Geometry::Primvar1 as u32 => 1,
            _ => return None,
        };
        let given = [0.25, 0.5, 0.75, 1.0];
        let value = self.expressions.value(val, &|_| given, &|_| [0.0; 4]);
        let is_it = value.iter().zip(given).take(width).all(|(a, b)| *a == b);
        (leaves.lookups == 0 && is_it).then_some(InputSource::Primvar(slot))
    }

    fn texture(&self, val: Val, width: usize, lookup: u32) -> Option<InputSource> {
        let mut lookup = self.lookup(lookup)?;
        if !lookup.1 {
            return None; // its place has to be worked out
        }
        let of = |texel: [f32; 4]| self.expressions.value(val, &|_| [0.0; 4], &move |_| texel);
        let black = of([0.0; 4]);
        let answers = PROBES.map(of);
        let (mut scale, mut bias) = ([0.0; 4], [0.0; 4]);
        let follows = |scale: [f32; 4], bias: [f32; 4], channel: Option<usize>| {
            PROBES.iter().zip(&answers).all(|(texel, answer)| {
                (0..width).all(|k| near(texel[channel.unwrap_or(k)] * scale[k] + bias[k], answer[k]))
            })
        };
        for k in 0..4 {
            bias[k] = black[k];
            scale[k] = answers[k][k] - black[k];
        }
        let is_finite = |scale: [f32; 4]| scale.iter().chain(&bias).all(|v| v.is_finite());
        if width > 1 && is_finite(scale) && follows(scale, bias, None) {
            (lookup.0.scale, lookup.0.bias) = (scale, bias);
            return Some(InputSource::Texture(lookup.0, None));
        }
        for channel in 0..4_u8 {
            let at = usize::from(channel);
            let scale: [f32; 4] = std::array::from_fn(|k| answers[at][k] - black[k]);
            let is_one = (1..width).all(|k| scale[k] == scale[0] && bias[k] == bias[0]);
            if is_one && is_finite(scale) && follows(scale, bias, Some(at)) {
                (lookup.0.scale, lookup.0.bias) = ([scale[0]; 4], [bias[0]; 4]);
                return Some(InputSource::Texture(lookup.0, Some(channel)));
            }
        }
        None
    }

    /// A lookup, and whether its place is told by its set and transform alone.
    pub(crate) fn lookup(&self, number: u32) -> Option<(ProgramLookup, bool)> {
        let LookupUse { texture, place } = *self.lookups.get(number as usize)?;
        let mut lookup = ProgramLookup { texture, uv: None, transform: [[0.0; 3]; 2], scale: [1.0; 4], bias: [0.0; 4] };
        let leaves = self.expressions.leaves(place);
        let (uv0, uv1) = (1 << Geometry::Uv0 as u32, 1 << Geometry::Uv1 as u32);
        let set = match leaves.geometry & (uv0 | uv1) {
            0 => None,
            g if g & uv0 != 0 => Some(0_u8),
            _ => Some(1),
        };
        let of = |u: f32, v: f32| {
            let [s, t, ..] = self.expressions.value(place, &|_| [u, v, 0.0, 0.0], &|_| [0.5; 4]);
            [s, t]
        };
        let Some(set) = set else {
            if leaves.geometry == 0 && leaves.lookups == 0 {
                let at = of(0.0, 0.0);
                lookup.transform = at.map(|at| [0.0, 0.0, at]);
                return Some((lookup, true));
            }
            return Some((lookup, false));
        };
        lookup.uv = Some(set);
        let is_alone = leaves.lookups == 0 && leaves.geometry.count_ones() == 1;
        let (origin, along, up) = (of(0.0, 0.0), of(1.0, 0.0), of(0.0, 1.0));
        let rows: [[f32; 3]; 2] = std::array::from_fn(|k| [along[k] - origin[k], up[k] - origin[k], origin[k]]);
        let follows = [[0.375, -1.75], [13.25, 7.5], [-3.125, 0.0625], [0.5, 0.5]].into_iter().all(|[u, v]| {
            let at = of(u, v);
            (0..2).all(|k| near(rows[k][0] * u + rows[k][1] * v + rows[k][2], at[k]))
        });
        // Of huge coordinates differences are no numbers: then there is no filter.
        let finite = |row: [f32; 3]| row.map(|v| if v.is_finite() { v } else { 0.0 });
        lookup.transform = rows.map(finite);
        if is_alone && follows {
            return Some((lookup, true));
        }
        // For the filter: how it grows near the middle.
        let (u, v, h) = (0.375, 0.4375, 1.0 / 1024.0);
        let (at, along, up) = (of(u, v), of(u + h, v), of(u, v + h));
        lookup.transform = std::array::from_fn(|k| finite([(along[k] - at[k]) / h, (up[k] - at[k]) / h, 0.0]));
        Some((lookup, false))
    }
}
