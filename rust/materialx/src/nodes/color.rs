// SPDX-License-Identifier: Apache-2.0
//! Adjustment and compositing nodes.

use crate::expression::Val;
use crate::program::Op;
use crate::value::PortType;
use crate::walk::{NetworkWalker, NodeAddress};

impl NetworkWalker<'_> {
    pub(super) fn color(&mut self, at: NodeAddress, category: &str, ty: PortType) -> Option<Val> {
        Some(match category {
            "rgbtohsv" | "hsvtorgb" => {
                let a = self.input_in(at);
                self.expressions.unary(if category == "rgbtohsv" { Op::RgbToHsv } else { Op::HsvToRgb }, a)
            }
            "luminance" => {
                let a = self.input_in(at);
                let weights = self.number(at, "lumacoeffs").unwrap_or(Val::Constant([
                    0.272_228_7,
                    0.674_081_8,
                    0.053_689_5,
                    0.0,
                ]));
                let sum = self.expressions.dot(a, weights, 3);
                if ty == PortType::Color4 { self.expressions.splice(sum, 3, a) } else { sum }
            }
            "premult" => {
                let a = self.input_in(at);
                let alpha = self.expressions.component(a, 3);
                let scaled = self.expressions.multiply(a, alpha);
                self.expressions.splice(scaled, 3, a)
            }
            "unpremult" => {
                let a = self.input_in(at);
                let alpha = self.expressions.component(a, 3);
                let scaled = self.expressions.divide(a, alpha);
                self.expressions.splice(scaled, 3, a)
            }
            "mix" => {
                let (front, back) = (self.number_or(at, "fg", 0.0), self.number_or(at, "bg", 0.0));
                let share = self.number_or(at, "mix", 0.0);
                self.expressions.mix(back, front, share)
            }
            "inside" | "outside" => {
                let (a, mask) = (self.input_in(at), self.number_or(at, "mask", 1.0));
                let mask = if category == "inside" { mask } else { self.expressions.complement(mask) };
                self.expressions.multiply(a, mask)
            }
            _ => return self.composite(at, category),
        })
    }

    /// What `fg` and `bg` give, mixed into `bg` by `mix`.
    #[expect(clippy::too_many_lines, reason = "a line or two of algebra for each operation")]
    fn composite(&mut self, at: NodeAddress, category: &str) -> Option<Val> {
        if !matches!(
            category,
            "plus"
                | "minus"
                | "difference"
                | "burn"
                | "dodge"
                | "screen"
                | "over"
                | "in"
                | "out"
                | "mask"
                | "matte"
                | "disjointover"
        ) {
            return None;
        }
        let (front, back) = (self.number_or(at, "fg", 0.0), self.number_or(at, "bg", 0.0));
        let share = self.number_or(at, "mix", 1.0);
        let e = &mut self.expressions;
        let alphas = |e: &mut crate::expression::ExpressionGraph| [e.component(front, 3), e.component(back, 3)];
        let whole = match category {
            "plus" => e.add(back, front),
            "minus" => e.subtract(back, front),
            "difference" => {
                let off = e.subtract(back, front);
                e.unary(Op::Absolute, off)
            }
            // 1 - (1 - bg) / fg; 0, not mixed, where there is nothing to divide by.
            "burn" => {
                let rest = e.complement(back);
                let quotient = e.divide(rest, front);
                let value = e.complement(quotient);
                let mixed = e.mix(back, value, share);
                return Some(e.op(Op::Select, [mixed, Val::ZERO, front], 0));
            }
            "dodge" => {
                let rest = e.complement(front);
                let value = e.divide(back, rest);
                let mixed = e.mix(back, value, share);
                return Some(e.op(Op::Select, [mixed, Val::ZERO, rest], 0));
            }
            "screen" => {
                let (a, b) = (e.complement(front), e.complement(back));
                let product = e.multiply(a, b);
                e.complement(product)
            }
            "over" | "matte" => {
                let [alpha, _] = alphas(e);
                let rest = e.complement(alpha);
                let below = e.multiply(back, rest);
                let above = if category == "over" {
                    front
                } else {
                    let scaled = e.multiply(front, alpha);
                    e.splice(scaled, 3, front)
                };
                e.add(above, below)
            }
            "in" => {
                let [_, alpha] = alphas(e);
                e.multiply(front, alpha)
            }
            "out" => {
                let [_, alpha] = alphas(e);
                let rest = e.complement(alpha);
                e.multiply(front, rest)
            }
            "mask" => {
                let [alpha, _] = alphas(e);
                e.multiply(back, alpha)
            }
            _ => {
                // disjointover: where the alphas are more than 1 together, the back has what the front leaves.
                let [alpha, below] = alphas(e);
                let sum = e.add(alpha, below);
                let rest = e.complement(alpha);
                let part = e.divide(rest, below);
                let is_full = e.binary(Op::Greater, sum, Val::ONE);
                let factor = e.op(Op::Select, [part, Val::ONE, is_full], 0);
                let scaled = e.multiply(back, factor);
                let color = e.add(front, scaled);
                // A back without alpha cannot be divided by: then there is no colour.
                let is_known = e.op(Op::Select, [below, Val::ONE, is_full], 0);
                let color = e.op(Op::Select, [color, Val::ZERO, is_known], 0);
                let opaque = e.binary(Op::Min, sum, Val::ONE);
                e.splice(color, 3, opaque)
            }
        };
        Some(e.mix(back, whole, share))
    }
}
