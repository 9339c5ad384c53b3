// SPDX-License-Identifier: Apache-2.0
//! Utility nodes of the PBR library for hair: roughness and absorption from what artists say.

use crate::expression::Val;
use crate::program::Op;
use crate::walk::{NetworkWalker, NodeAddress};

impl NetworkWalker<'_> {
    pub(super) fn hair_node(&mut self, at: NodeAddress, category: &str, output: &str) -> Option<Val> {
        Some(match category {
            "chiang_hair_roughness" => self.hair_roughness(at, output),
            "chiang_hair_absorption_from_color" => self.absorption_of_color(at),
            "deon_hair_absorption_from_melanin" => self.absorption_of_melanin(at),
            _ => return None,
        })
    }

    /// A polynomial of `x`; first the coefficient of the highest power.
    fn polynomial(&mut self, x: Val, coefficients: &[f32]) -> Val {
        let e = &mut self.expressions;
        let sum = |sum: Val, c: &f32| e.op(Op::MultiplyAdd, [sum, x, Val::number(*c)], 0);
        coefficients.iter().fold(Val::ZERO, sum)
    }

    /// Variance along the fibre and scale of the logistic across it (Chiang et al. 2016, eq. 7 and 8); TT and TRT are
    /// as much narrower and wider as is said (Marschner et al. 2003).
    fn hair_roughness(&mut self, at: NodeAddress, output: &str) -> Val {
        let scale = match output {
            "roughness_TT" => self.number_or(at, "scale_TT", 0.5),
            "roughness_TRT" => self.number_or(at, "scale_TRT", 2.0),
            _ => Val::ONE,
        };
        let [along, across] = [("longitudinal", 0.1), ("azimuthal", 0.2)].map(|(name, default)| {
            let said = self.number_or(at, name, default);
            self.expressions.op(Op::Clamp, [said, Val::number(0.001), Val::ONE], 0)
        });
        let [along, across] = [(along, [0.812, 0.726, 0.0], [3.7, 20.0]), (across, [1.194, 0.265, 0.0], [5.372, 22.0])]
            .map(|(x, low, [factor, power])| {
                let low = self.polynomial(x, &low);
                let e = &mut self.expressions;
                let high = e.binary(Op::Power, x, Val::number(power));
                e.op(Op::MultiplyAdd, [high, Val::number(factor), low], 0)
            });
        let e = &mut self.expressions;
        let root = e.multiply(along, scale);
        let variance = e.multiply(root, root);
        e.combine(&[variance, across])
    }

    /// (ln(color) / polynomial)^2 (Chiang et al. 2016, eq. 9).
    fn absorption_of_color(&mut self, at: NodeAddress) -> Val {
        let color = self.number_or(at, "color", 1.0);
        let across = self.number_or(at, "azimuthal_roughness", 0.2);
        let below = self.polynomial(across, &[0.245, 5.574, -10.73, 2.532, -0.215, 5.969]);
        let e = &mut self.expressions;
        let some = e.op(Op::Clamp, [color, Val::number(0.001), Val::ONE], 0);
        let logarithm = e.unary(Op::Ln, some);
        let root = e.divide(logarithm, below);
        e.multiply(root, root)
    }

    /// Absorption of eumelanin and pheomelanin (d'Eon et al. 2011), by their colours, which are exp(-absorption).
    fn absorption_of_melanin(&mut self, at: NodeAddress) -> Val {
        let concentration = self.number_or(at, "melanin_concentration", 0.25);
        let redness = self.number_or(at, "melanin_redness", 0.5);
        let [dark, red] = [
            ("eumelanin_color", [0.657_704, 0.498_077, 0.254_107, 0.0]),
            ("pheomelanin_color", [0.829_444, 0.670_32, 0.349_938, 0.0]),
        ]
        .map(|(name, default)| {
            let color = self.number(at, name).unwrap_or(Val::Constant(default));
            let e = &mut self.expressions;
            let some = e.binary(Op::Max, color, Val::number(1.0e-6));
            let logarithm = e.unary(Op::Ln, some);
            e.subtract(Val::ZERO, logarithm)
        });
        let e = &mut self.expressions;
        let rest = e.complement(concentration);
        let rest = e.binary(Op::Max, rest, Val::number(0.0001));
        let logarithm = e.unary(Op::Ln, rest);
        let melanin = e.subtract(Val::ZERO, logarithm);
        let mixed = e.mix(dark, red, redness);
        let absorption = e.multiply(melanin, mixed);
        e.binary(Op::Max, absorption, Val::ZERO)
    }
}
