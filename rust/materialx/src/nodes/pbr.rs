// SPDX-License-Identifier: Apache-2.0
//! Utility nodes of the PBR library: roughnesses and indices for closures.

use crate::expression::Val;
use crate::program::Op;
use crate::walk::{At, Walker};

impl Walker<'_> {
    pub(super) fn pbr(&mut self, at: At, category: &str, output: &str) -> Option<Val> {
        Some(match category {
            "roughness_anisotropy" => {
                let roughness = self.number_or(at, "roughness", 0.0);
                let anisotropy = self.number_or(at, "anisotropy", 0.0);
                let e = &mut self.expressions;
                let alpha = e.multiply(roughness, roughness);
                let less = e.op(Op::Clamp, [anisotropy, Val::ZERO, Val::number(0.98)], 0);
                let rest = e.complement(less);
                let aspect = e.unary(Op::Sqrt, rest);
                let (along, across) = (e.divide(alpha, aspect), e.multiply(alpha, aspect));
                let along = e.binary(Op::Min, along, Val::ONE);
                e.combine(&[along, across])
            }
            "roughness_dual" => {
                let roughness = self.number_or(at, "roughness", 0.0);
                self.expressions.multiply(roughness, roughness)
            }
            "artistic_ior" => self.artistic_ior(at, output == "extinction"),
            _ => return None,
        })
    }

    /// Index and extinction of a metal from its reflectance at normal incidence and at the edge (Gulbrandsen 2014,
    /// "Artist Friendly Metallic Fresnel").
    fn artistic_ior(&mut self, at: At, is_extinction: bool) -> Val {
        let (reflectivity, edge) = (self.number_or(at, "reflectivity", 0.8), self.number_or(at, "edge_color", 1.0));
        let e = &mut self.expressions;
        let r = e.op(Op::Clamp, [reflectivity, Val::ZERO, Val::number(0.99)], 0);
        let root = e.unary(Op::Sqrt, r);
        let ratio = |e: &mut crate::expression::Expressions, r: Val| {
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
