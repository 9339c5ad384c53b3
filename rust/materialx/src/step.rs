// SPDX-License-Identifier: Apache-2.0
//! Opacity that is there or not by one number of one texel, is told by trying it, as `told` does: such an expression is
//! that texture with a threshold, whatever it is made of (comparisons, curves before a threshold). A threshold is worth
//! more than a program: it is compared before the texture is filtered, with what masks know of it.

use crate::assemble::{InputSource, ProgramAssembler};
use crate::expression::Val;

/// Values of the number that tell whether it is a step, beside those from 0 to 1.
const BEYOND: [f32; 4] = [-8.0, -0.5, 1.5, 8.0];
/// From 0 to 1 in so many.
const STEPS: u8 = 64;
/// What the other numbers of the texel are meanwhile: of any two of them each is the larger one at some time, so that
/// what depends on their differences shows.
const OTHERS: [[f32; 4]; 6] =
    [[0.3125; 4], [0.0; 4], [1.0; 4], [0.0, 0.3125, 0.75, 1.0], [1.0, 0.75, 0.3125, 0.0], [0.5, 1.0, 0.0, 0.75]];

impl ProgramAssembler<'_> {
    /// The texture and the threshold, if the surface is there where a number of a texel is not below one value, or
    /// nowhere else. `threshold`: of the opacity; at 0 it is a probability, which has to be 0 or 1.
    pub(crate) fn step(&self, val: Val, threshold: f32) -> Option<(InputSource, f32)> {
        let leaves = self.expressions.leaves(val);
        if leaves.geometry != 0 || leaves.lookups.count_ones() != 1 {
            return None;
        }
        let (mut lookup, is_placed) = self.lookup(leaves.lookups.trailing_zeros())?;
        if !is_placed {
            return None; // its place has to be worked out
        }
        let is_there = |texel: [f32; 4]| match self.expressions.value(val, &|_| [0.0; 4], &move |_| texel)[0] {
            opacity if threshold > 0.0 => Some(opacity >= threshold),
            opacity if opacity >= 1.0 => Some(true),
            opacity if opacity <= 0.0 => Some(false),
            _ => None,
        };
        (0..4_u8).find_map(|channel| {
            let of = |value: f32, mut texel: [f32; 4]| {
                texel[usize::from(channel)] = value;
                is_there(texel)
            };
            let (from, rises) = step_of(of)?;
            let (scale, bias, threshold) = match rises {
                true => (1.0, 0.0, from),
                // There below it: the difference of two numbers is 0 only where they are the same.
                false => (-1.0, from, f32::MIN_POSITIVE),
            };
            (lookup.scale, lookup.bias) = ([scale; 4], [bias; 4]);
            Some((InputSource::Texture(lookup, Some(channel)), threshold))
        })
    }
}

/// The least value that is on the other side than 0 is, and whether the surface is there from it on; none where it is
/// no single step. `of`: of a value and what else the texel has.
fn step_of(of: impl Fn(f32, [f32; 4]) -> Option<bool>) -> Option<(f32, bool)> {
    let rises = of(1.0, OTHERS[0])?;
    if of(0.0, OTHERS[0])? == rises {
        return None;
    }
    // Numbers from 0 on are in the order of their bits; the smallest ones may be 0 on a device.
    let (mut below, mut from) = (f32::MIN_POSITIVE.to_bits() - 1, 1.0_f32.to_bits());
    while from - below > 1 {
        let middle = u32::midpoint(below, from);
        if of(f32::from_bits(middle), OTHERS[0])? == rises { from = middle } else { below = middle }
    }
    let from = f32::from_bits(from);
    let values = (0..=STEPS).map(|step| f32::from(step) / f32::from(STEPS)).chain(BEYOND);
    let all = values.flat_map(|value| OTHERS.map(|others| (value, others)));
    let mut follows = all.map(|(value, others)| of(value, others) == Some((value >= from) == rises));
    follows.all(|is_so| is_so).then_some((from, rises))
}
