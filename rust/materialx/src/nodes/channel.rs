// SPDX-License-Identifier: Apache-2.0
//! Channel nodes: extract, combine, convert, separate.

use std::sync::Arc;

use crate::expression::Val;
use crate::program::Op;
use crate::value::PortType;
use crate::walk::{NetworkWalker, NodeAddress};

impl NetworkWalker<'_> {
    pub(super) fn channel(&mut self, at: NodeAddress, category: &str, ty: PortType, output: &Arc<str>) -> Option<Val> {
        Some(match category {
            "extract" => {
                let a = self.input_in(at);
                let index = self.number_or(at, "index", 0.0).constant().map_or(0.0, |index| index[0]);
                self.expressions.component(a, channel_at(index))
            }
            "separate2" | "separate3" | "separate4" => {
                let a = self.input_in(at);
                let channel = match &**output {
                    "outg" | "outy" => 1,
                    "outb" | "outz" => 2,
                    "outa" | "outw" => 3,
                    _ => 0,
                };
                self.expressions.component(a, channel)
            }
            "combine2" | "combine3" | "combine4" => {
                // combine2 may have a colour or vector first, and what follows it.
                let first = self.input_type(at, "in1").width();
                let parts: Vec<Val> =
                    ["in1", "in2", "in3", "in4"].into_iter().filter_map(|name| self.number(at, name)).collect();
                match (first, &parts[..]) {
                    (2, [a, b]) => {
                        let moved = self.expressions.swizzle(*b, [4, 4, 0, 1]);
                        self.expressions.splice(*a, 2, moved)
                    }
                    (3, [a, b]) => self.expressions.splice(*a, 3, *b),
                    _ => self.expressions.combine(&parts),
                }
            }
            "convert" => {
                let a = self.input_in(at);
                let from = self.input_type(at, "in").width();
                let is_truth = self.definition(at).is_some_and(|definition| {
                    definition.outputs.first().is_some_and(|(.., name)| &**name == "boolean")
                });
                match (from, ty.width()) {
                    _ if is_truth => {
                        let is_zero = self.expressions.binary(Op::Equal, a, Val::ZERO);
                        self.expressions.complement(is_zero)
                    }
                    (3, 4) => self.expressions.swizzle(a, [0, 1, 2, 5]),
                    (2, 3) => self.expressions.swizzle(a, [0, 1, 4, 4]),
                    (2, 4) => self.expressions.swizzle(a, [0, 1, 4, 5]),
                    // A number is in all components; what is left out does not count.
                    _ => a,
                }
            }
            _ => return None,
        })
    }
}

/// The number of a channel.
fn channel_at(index: f32) -> u16 {
    match index {
        i if i >= 2.5 => 3,
        i if i >= 1.5 => 2,
        i if i >= 0.5 => 1,
        _ => 0,
    }
}
