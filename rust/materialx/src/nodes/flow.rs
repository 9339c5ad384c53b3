// SPDX-License-Identifier: Apache-2.0
//! Conditional and logical nodes.

use crate::expression::Val;
use crate::program::Op;
use crate::walk::{NetworkWalker, NodeAddress};

/// Inputs of a switch.
const SWITCH: [&str; 10] = ["in1", "in2", "in3", "in4", "in5", "in6", "in7", "in8", "in9", "in10"];

impl NetworkWalker<'_> {
    pub(super) fn flow(&mut self, at: NodeAddress, category: &str) -> Option<Val> {
        let compare = match category {
            "ifgreater" => Some(Op::Greater),
            "ifgreatereq" => Some(Op::GreaterEqual),
            "ifequal" => Some(Op::Equal),
            _ => None,
        };
        if let Some(op) = compare {
            return Some(self.condition(at, op));
        }
        Some(match category {
            "switch" => self.switch(at),
            "and" => {
                let [a, b] = self.pair(at);
                self.expressions.multiply(a, b)
            }
            "or" => {
                let [a, b] = self.pair(at);
                self.expressions.binary(Op::Max, a, b)
            }
            "xor" => {
                let [a, b] = self.pair(at);
                let off = self.expressions.subtract(a, b);
                self.expressions.unary(Op::Absolute, off)
            }
            "not" => {
                let a = self.input_in(at);
                self.expressions.complement(a)
            }
            _ => return None,
        })
    }

    /// in1 where the comparison holds, else in2; a comparison alone is 1 or 0.
    fn condition(&mut self, at: NodeAddress, op: Op) -> Val {
        let (a, b) = (self.number_or(at, "value1", 1.0), self.number_or(at, "value2", 0.0));
        let holds = self.expressions.binary(op, a, b);
        if let Some([holds, ..]) = holds.constant() {
            // What is not taken is not worked out.
            return match (self.input_type(at, "in1").width(), holds != 0.0) {
                (0, _) => Val::number(holds),
                (_, true) => self.number_or(at, "in1", 0.0),
                (_, false) => self.number_or(at, "in2", 0.0),
            };
        }
        if self.input_type(at, "in1").width() == 0 {
            return holds;
        }
        let [taken, other] = self.pair(at);
        self.expressions.op(Op::Select, [taken, other, holds], 0)
    }

    /// Input `which`, rounded down; 0 beyond the last.
    fn switch(&mut self, at: NodeAddress) -> Val {
        let which = self.number_or(at, "which", 0.0);
        if let Some([which, ..]) = which.constant() {
            let found = SWITCH.iter().zip(0_u8..).find(|(_, at)| {
                let low = f32::from(*at);
                which < low + 1.0 && which >= low || *at == 0 && which < 0.0
            });
            return found.and_then(|(name, _)| self.number(at, name)).unwrap_or(Val::ZERO);
        }
        let mut whole = Val::ZERO;
        for (name, limit) in SWITCH.iter().zip(0_u8..10).rev() {
            let Some(value) = self.number(at, name) else { continue };
            if limit > 0 && !self.is_said(at, name) {
                continue;
            }
            let beyond = self.expressions.binary(Op::GreaterEqual, which, Val::number(f32::from(limit) + 1.0));
            whole = self.expressions.op(Op::Select, [whole, value, beyond], 0);
        }
        whole
    }
}
