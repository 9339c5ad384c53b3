// SPDX-License-Identifier: Apache-2.0
//! The nodes that are no graphs of others, as `MaterialX` 1.39 specifies them; and some that are, where a shorter way
//! is known. One file for each group of the specification.

mod channel;
mod color;
mod flow;
mod geometric;
mod hair;
mod height;
mod math;
mod older;
mod pbr;
mod procedural;
mod texture;

use std::sync::Arc;

use crate::expression::Val;
use crate::value::PortType;
use crate::walk::{BoundValue, NetworkWalker, NodeAddress};

impl NetworkWalker<'_> {
    /// The output of a node of `category`, whose type is `ty`; `None` where it is not one of these.
    pub(crate) fn node(
        &mut self,
        at: NodeAddress,
        category: &str,
        ty: PortType,
        output: &Arc<str>,
    ) -> Option<BoundValue> {
        if matches!(category, "dot" | "constant") {
            return self.input(at, if category == "dot" { "in" } else { "value" });
        }
        self.value_node(at, category, ty, output).map(BoundValue::Number)
    }

    fn value_node(&mut self, at: NodeAddress, category: &str, ty: PortType, output: &Arc<str>) -> Option<Val> {
        if let Some(found) = self.math(at, category) {
            return Some(found);
        }
        if let Some(found) = self.channel(at, category, ty, output) {
            return Some(found);
        }
        if let Some(found) = self.color(at, category, ty) {
            return Some(found);
        }
        if let Some(found) = self.flow(at, category) {
            return Some(found);
        }
        if let Some(found) = self.geometric(at, category, ty) {
            return Some(found);
        }
        if let Some(found) = self.procedural(at, category, ty) {
            return Some(found);
        }
        if let Some(found) = self.pbr(at, category, output) {
            return Some(found);
        }
        if let Some(found) = self.hair_node(at, category, output) {
            return Some(found);
        }
        if let Some(found) = self.older(at, category, ty) {
            return Some(found);
        }
        self.texture_node(at, category, ty, output)
    }

    /// `in`.
    fn input_in(&mut self, at: NodeAddress) -> Val {
        self.number_or(at, "in", 0.0)
    }

    /// `in1` and `in2`.
    fn pair(&mut self, at: NodeAddress) -> [Val; 2] {
        [self.number_or(at, "in1", 0.0), self.number_or(at, "in2", 0.0)]
    }
}
