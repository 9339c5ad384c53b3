// SPDX-License-Identifier: Apache-2.0
//! Math nodes.

use crate::expression::Val;
use crate::program::Op;
use crate::value::PortType;
use crate::walk::{BoundValue, NetworkWalker, NodeAddress};

/// What the operation of one operand is.
fn unary(category: &str) -> Option<Op> {
    Some(match category {
        "absval" => Op::Absolute,
        "sign" => Op::Sign,
        "floor" => Op::Floor,
        "ceil" => Op::Ceil,
        "round" => Op::Round,
        "fract" => Op::Fract,
        "sin" => Op::Sin,
        "cos" => Op::Cos,
        "tan" => Op::Tan,
        "asin" => Op::Asin,
        "acos" => Op::Acos,
        "sqrt" => Op::Sqrt,
        "ln" => Op::Ln,
        "exp" => Op::Exp,
        _ => return None,
    })
}

/// What the operation of two operands is.
fn binary(category: &str) -> Option<Op> {
    Some(match category {
        "add" => Op::Add,
        "subtract" => Op::Subtract,
        "multiply" => Op::Multiply,
        "divide" => Op::Divide,
        "modulo" => Op::Modulo,
        "power" => Op::Power,
        "min" => Op::Min,
        "max" => Op::Max,
        _ => return None,
    })
}

impl NetworkWalker<'_> {
    pub(super) fn math(&mut self, at: NodeAddress, category: &str) -> Option<Val> {
        if let Some(op) = unary(category) {
            let a = self.input_in(at);
            return Some(self.expressions.unary(op, a));
        }
        if let Some(op) = binary(category) {
            let [a, b] = self.pair(at);
            return Some(self.expressions.binary(op, a, b));
        }
        Some(match category {
            "atan2" => {
                // MaterialX 1.38 had other names.
                let older = self.is_said(at, "in1") || self.is_said(at, "in2");
                let y = self.number_or(at, if older { "in1" } else { "iny" }, 0.0);
                let x = self.number_or(at, if older { "in2" } else { "inx" }, 1.0);
                self.expressions.binary(Op::Atan2, y, x)
            }
            "invert" => {
                let (amount, a) = (self.number_or(at, "amount", 1.0), self.input_in(at));
                self.expressions.subtract(amount, a)
            }
            "clamp" => {
                let a = self.input_in(at);
                let (low, high) = (self.number_or(at, "low", 0.0), self.number_or(at, "high", 1.0));
                self.expressions.op(Op::Clamp, [a, low, high], 0)
            }
            "smoothstep" => {
                let a = self.input_in(at);
                let (low, high) = (self.number_or(at, "low", 0.0), self.number_or(at, "high", 1.0));
                self.expressions.op(Op::Smoothstep, [a, low, high], 0)
            }
            "remap" => self.remap(at),
            "dotproduct" => {
                let [a, b] = self.pair(at);
                let width = self.input_type(at, "in1").width();
                self.expressions.dot(a, b, width)
            }
            "crossproduct" => {
                let [a, b] = self.pair(at);
                self.expressions.binary(Op::Cross, a, b)
            }
            "normalize" => {
                let a = self.input_in(at);
                let width = self.input_type(at, "in").width();
                self.expressions.normalize(a, width)
            }
            "magnitude" => {
                let a = self.input_in(at);
                let width = self.input_type(at, "in").width();
                self.expressions.op(Op::Length, [a, Val::ZERO, Val::ZERO], width)
            }
            "transformmatrix" => self.transform_matrix(at),
            "rotate2d" => self.rotate2d(at),
            "rotate3d" => self.rotate3d(at),
            _ => return None,
        })
    }

    fn remap(&mut self, at: NodeAddress) -> Val {
        let a = self.input_in(at);
        let (in_low, in_high) = (self.number_or(at, "inlow", 0.0), self.number_or(at, "inhigh", 1.0));
        let (out_low, out_high) = (self.number_or(at, "outlow", 0.0), self.number_or(at, "outhigh", 1.0));
        let e = &mut self.expressions;
        let (off, range, width) = (e.subtract(a, in_low), e.subtract(out_high, out_low), e.subtract(in_high, in_low));
        let scaled = e.multiply(off, range);
        let share = e.divide(scaled, width);
        e.add(out_low, share)
    }

    /// in times the matrix; a vector that is shorter than its rows goes on with 1, as a point does. Of matrices that
    /// are worked out by other nodes nothing is known: a line, and the vector as it is.
    fn transform_matrix(&mut self, at: NodeAddress) -> Val {
        let a = self.input_in(at);
        let Some(BoundValue::Matrix(rows)) = self.input(at, "mat") else {
            let path = self.path(at);
            self.problem(format!("`transformmatrix` ({path}) changes nothing: its matrix is worked out by nodes"));
            return a;
        };
        let width = self.input_type(at, "in").width();
        let is_point = match self.input_type(at, "mat") {
            PortType::Matrix3 => width == 2,
            _ => width == 3,
        };
        let e = &mut self.expressions;
        let mut sum = if is_point { Val::Constant(rows[usize::from(width)]) } else { Val::ZERO };
        for (row, k) in rows.iter().zip(0..width) {
            let part = e.component(a, k);
            sum = e.op(Op::MultiplyAdd, [part, Val::Constant(*row), sum], 0);
        }
        sum
    }

    /// Sine and cosine of an angle in degrees.
    fn turn(&mut self, degrees: Val) -> [Val; 2] {
        let radians = self.expressions.multiply(degrees, Val::number(std::f32::consts::PI / 180.0));
        [self.expressions.unary(Op::Sin, radians), self.expressions.unary(Op::Cos, radians)]
    }

    /// (c x + s y, -s x + c y).
    fn rotate2d(&mut self, at: NodeAddress) -> Val {
        let (a, amount) = (self.input_in(at), self.number_or(at, "amount", 0.0));
        let [sine, cosine] = self.turn(amount);
        let e = &mut self.expressions;
        let minus = e.subtract(Val::ZERO, sine);
        let signed = e.combine(&[sine, minus, Val::ZERO, Val::ZERO]);
        let swapped = e.swizzle(a, [1, 0, 4, 4]);
        let crossed = e.multiply(swapped, signed);
        let straight = e.swizzle(a, [0, 1, 4, 4]);
        let straight = e.multiply(straight, cosine);
        e.add(straight, crossed)
    }

    /// Rodrigues' formula about -axis: `MaterialX`'s matrix is the transposed one.
    fn rotate3d(&mut self, at: NodeAddress) -> Val {
        let (a, amount) = (self.input_in(at), self.number_or(at, "amount", 0.0));
        let axis = self.number(at, "axis").unwrap_or(Val::Constant([0.0, 1.0, 0.0, 0.0]));
        let [sine, cosine] = self.turn(amount);
        let e = &mut self.expressions;
        let axis = e.normalize(axis, 3);
        let along = e.dot(axis, a, 3);
        let rest = e.complement(cosine);
        let along = e.multiply(along, rest);
        let along = e.multiply(axis, along);
        let across = e.binary(Op::Cross, a, axis);
        let across = e.multiply(across, sine);
        let straight = e.multiply(a, cosine);
        let sum = e.add(straight, across);
        e.add(sum, along)
    }
}
