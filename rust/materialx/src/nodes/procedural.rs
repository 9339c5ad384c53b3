// SPDX-License-Identifier: Apache-2.0
//! Procedural nodes: ramps, splits, noise.

use crate::expression::Val;
use crate::program::Op;
use crate::value::PortType;
use crate::walk::{NetworkWalker, NodeAddress};

impl NetworkWalker<'_> {
    pub(super) fn procedural(&mut self, at: NodeAddress, category: &str, ty: PortType) -> Option<Val> {
        Some(match category {
            "ramplr" | "ramptb" => {
                let along = self.along(at, category);
                let share = self.expressions.op(Op::Clamp, [along, Val::ZERO, Val::ONE], 0);
                self.two(at, category, share)
            }
            "splitlr" | "splittb" => {
                let along = self.along(at, category);
                let center = self.number_or(at, "center", 0.5);
                let share = self.expressions.binary(Op::GreaterEqual, along, center);
                self.two(at, category, share)
            }
            "noise2d" => self.noise(at, "texcoord", ty, [Op::Noise2, Op::Noise2Vector]),
            "noise3d" => self.noise(at, "position", ty, [Op::Noise3, Op::Noise3Vector]),
            "fractal3d" => self.fractal(at, "position", ty, Op::Fractal3),
            "fractal2d" => self.fractal(at, "texcoord", ty, Op::Fractal2),
            "cellnoise2d" => {
                let place = self.number_or(at, "texcoord", 0.0);
                self.expressions.unary(Op::CellNoise2, place)
            }
            "cellnoise3d" => {
                let place = self.number_or(at, "position", 0.0);
                self.expressions.unary(Op::CellNoise3, place)
            }
            "worleynoise2d" => self.worley(at, "texcoord", ty, Op::Worley2),
            "worleynoise3d" => self.worley(at, "position", ty, Op::Worley3),
            _ => return None,
        })
    }

    /// The coordinate along which a ramp goes.
    fn along(&mut self, at: NodeAddress, category: &str) -> Val {
        let place = self.number_or(at, "texcoord", 0.0);
        self.expressions.component(place, u16::from(category.ends_with("tb")))
    }

    /// The value at the left or top, mixed with the other.
    fn two(&mut self, at: NodeAddress, category: &str, share: Val) -> Val {
        let names = if category.ends_with("lr") { ["valuel", "valuer"] } else { ["valuet", "valueb"] };
        let [a, b] = names.map(|name| self.number_or(at, name, 0.0));
        self.expressions.mix(a, b, share)
    }

    /// Perlin noise, times the amplitude, plus the pivot.
    fn noise(&mut self, at: NodeAddress, place: &str, ty: PortType, [single, vector]: [Op; 2]) -> Val {
        let place = self.number_or(at, place, 0.0);
        let (amplitude, pivot) = (self.number_or(at, "amplitude", 1.0), self.number_or(at, "pivot", 0.0));
        let value = self.expressions.unary(if ty == PortType::Float { single } else { vector }, place);
        let scaled = self.expressions.multiply(value, amplitude);
        self.expressions.add(scaled, pivot)
    }

    fn fractal(&mut self, at: NodeAddress, place: &str, ty: PortType, op: Op) -> Val {
        let place = self.number_or(at, place, 0.0);
        let amplitude = self.number_or(at, "amplitude", 1.0);
        let octaves = self.number_or(at, "octaves", 3.0);
        let (lacunarity, diminish) = (self.number_or(at, "lacunarity", 2.0), self.number_or(at, "diminish", 0.5));
        let kind = match ty {
            PortType::Float => 0,
            PortType::Vector2 => 2,
            _ => 1,
        };
        let knobs = self.expressions.combine(&[octaves, lacunarity, diminish]);
        let value = self.expressions.op(op, [place, knobs, Val::ZERO], kind);
        self.expressions.multiply(value, amplitude)
    }

    fn worley(&mut self, at: NodeAddress, place: &str, ty: PortType, op: Op) -> Val {
        let place = self.number_or(at, place, 0.0);
        let jitter = self.number_or(at, "jitter", 1.0);
        // Style 0: distances; 1: the cell of the nearest point.
        let style = self.number_or(at, "style", 0.0);
        let e = &mut self.expressions;
        let mut of = |kind: u16| e.op(op, [place, jitter, Val::ZERO], kind);
        let (distances, cell) = (ty.width().max(1) - 1, if ty == PortType::Float { 3 } else { 4 });
        match style.constant() {
            Some([style, ..]) => of(if style == 0.0 { distances } else { cell }),
            None => {
                let [distances, cell] = [distances, cell].map(of);
                self.expressions.op(Op::Select, [cell, distances, style], 0)
            }
        }
    }
}
