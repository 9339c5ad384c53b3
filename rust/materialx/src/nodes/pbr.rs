// SPDX-License-Identifier: Apache-2.0
//! Utility nodes of the PBR library: roughnesses and indices for closures.

use crate::expression::Val;
use crate::program::Op;
use crate::walk::{NetworkWalker, NodeAddress};

/// Least square of a roughness.
const MIN_ALPHA: f32 = 1.0e-8;

impl NetworkWalker<'_> {
    pub(super) fn pbr(&mut self, at: NodeAddress, category: &str, output: &str) -> Option<Val> {
        Some(match category {
            "roughness_anisotropy" => {
                let roughness = self.number_or(at, "roughness", 0.0);
                let anisotropy = self.number_or(at, "anisotropy", 0.0);
                let e = &mut self.expressions;
                let alpha = e.multiply(roughness, roughness);
                let alpha = e.op(Op::Clamp, [alpha, Val::number(MIN_ALPHA), Val::ONE], 0);
                let less = e.op(Op::Clamp, [anisotropy, Val::ZERO, Val::number(0.98)], 0);
                if less.is(0.0, 1) {
                    return Some(alpha);
                }
                let rest = e.complement(less);
                let aspect = e.unary(Op::Sqrt, rest);
                let (along, across) = (e.divide(alpha, aspect), e.multiply(alpha, aspect));
                let along = e.binary(Op::Min, along, Val::ONE);
                e.combine(&[along, across])
            }
            "roughness_dual" => {
                let roughness = self.number_or(at, "roughness", 0.0);
                let e = &mut self.expressions;
                let [along, across] = [0, 1].map(|axis| e.component(roughness, axis));
                // A negative second roughness means the first.
                let is_negative = e.binary(Op::Greater, Val::ZERO, across);
                let across = e.op(Op::Select, [along, across, is_negative], 0);
                let both = e.combine(&[along, across]);
                let square = e.multiply(both, both);
                e.op(Op::Clamp, [square, Val::number(MIN_ALPHA), Val::ONE], 0)
            }
            "blackbody" => self.blackbody(at),
            "artistic_ior" => self.artistic_ior(at, output == "extinction"),
            _ => return None,
        })
    }

    /// The colour of a black body in linear Rec. 709 for a luminance of 1, from 1667 to 25 000 K: cubic splines of its
    /// chromaticity (Kim et al. 2002, US patent 7024034), as `MaterialX` has them.
    fn blackbody(&mut self, at: NodeAddress) -> Val {
        let kelvin = self.number_or(at, "temperature", 5000.0);
        let e = &mut self.expressions;
        let kelvin = e.op(Op::Clamp, [kelvin, Val::number(1667.0), Val::number(25_000.0)], 0);
        let t = e.divide(Val::number(1000.0), kelvin);
        let cubic = |e: &mut crate::expression::ExpressionGraph, x: Val, [a, b, c, d]: [f32; 4]| {
            let first = e.op(Op::MultiplyAdd, [Val::number(a), x, Val::number(b)], 0);
            let second = e.op(Op::MultiplyAdd, [first, x, Val::number(c)], 0);
            e.op(Op::MultiplyAdd, [second, x, Val::number(d)], 0)
        };
        let [is_warm, is_red] = [4000.0, 2222.0].map(|limit| e.binary(Op::Greater, Val::number(limit), kelvin));
        let warm = cubic(e, t, [-0.266_123_9, -0.234_358, 0.877_695_6, 0.179_91]);
        let cold = cubic(e, t, [-3.025_847, 2.107_037_9, 0.222_634_7, 0.240_39]);
        let x = e.op(Op::Select, [warm, cold, is_warm], 0);
        let red = cubic(e, x, [-1.106_381_4, -1.348_110_2, 2.185_558_3, -0.202_196_83]);
        let warm = cubic(e, x, [-0.954_947_6, -1.374_185_9, 2.091_37, -0.167_488_67]);
        let cold = cubic(e, x, [3.081_758, -5.873_387, 3.751_13, -0.370_014_83]);
        let y = e.op(Op::Select, [warm, cold, is_warm], 0);
        let y = e.op(Op::Select, [red, y, is_red], 0);
        let big_x = e.divide(x, y);
        let rest = e.complement(x);
        let rest = e.subtract(rest, y);
        let big_z = e.divide(rest, y);
        let rows = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.204, 1.057]];
        let parts = rows.map(|[a, b, c]| {
            let sum = e.op(Op::MultiplyAdd, [big_x, Val::number(a), Val::number(b)], 0);
            let sum = e.op(Op::MultiplyAdd, [big_z, Val::number(c), sum], 0);
            e.binary(Op::Max, sum, Val::ZERO)
        });
        e.combine(&parts)
    }

    /// Index and extinction of a metal from its reflectance at normal incidence and at the edge (Gulbrandsen 2014,
    /// "Artist Friendly Metallic Fresnel").
    fn artistic_ior(&mut self, at: NodeAddress, is_extinction: bool) -> Val {
        let (reflectivity, edge) = (self.number_or(at, "reflectivity", 0.8), self.number_or(at, "edge_color", 1.0));
        let e = &mut self.expressions;
        let r = e.op(Op::Clamp, [reflectivity, Val::ZERO, Val::number(0.99)], 0);
        let root = e.unary(Op::Sqrt, r);
        let ratio = |e: &mut crate::expression::ExpressionGraph, r: Val| {
            let (less, more) = (e.complement(r), e.add(Val::ONE, r));
            (less, more)
        };
        let (less, more) = ratio(e, r);
        let least = e.divide(less, more);
        let (less_root, more_root) = ratio(e, root);
        let most = e.divide(more_root, less_root);
        let index = e.mix(most, least, edge);
        if !is_extinction {
            return index;
        }
        let (above, below) = (e.add(index, Val::ONE), e.subtract(index, Val::ONE));
        let (above, below) = (e.multiply(above, above), e.multiply(below, below));
        let product = e.multiply(r, above);
        let off = e.subtract(product, below);
        let square = e.divide(off, less);
        let square = e.binary(Op::Max, square, Val::ZERO);
        e.unary(Op::Sqrt, square)
    }
}
