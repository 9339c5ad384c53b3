// SPDX-License-Identifier: Apache-2.0
//! `UsdPrimvarReader_*`: what a material reads from its mesh. Pure.

use std::sync::Arc;

use super::compiler::Compiler;
use super::params::{Shape, numbers, text};
use super::{Input, MAX_PRIMVARS, MAX_UV_SETS, PrimvarSlot, UvSet};
use crate::desc::NodeDesc;

/// What all kinds of readers begin with.
pub(super) const READER: &str = "UsdPrimvarReader_";

impl<'a> Compiler<'a> {
    /// Name of the primvar of a reader.
    fn variable(&mut self, node: &'a NodeDesc) -> Option<Arc<str>> {
        match text(node, "varname", &mut self.problems) {
            Some(name) if !name.is_empty() => Some(name.into()),
            _ => {
                self.problems.add(format!("{} names no primvar", node.path));
                None
            }
        }
    }

    /// The value of a reader.
    pub(super) fn reader(&mut self, node: &'a NodeDesc) -> Option<Input> {
        let shape = match node.kind.strip_prefix(READER)? {
            "float" => Shape::Scalar,
            "float2" => Shape::Pair,
            "float3" | "normal" | "point" | "vector" => Shape::Color,
            "float4" => Shape::Four,
            _ => {
                self.unsupported(node);
                return None;
            }
        };
        let fallback = numbers(node, "fallback", shape, [0.0; 4], &mut self.problems);
        let Some(name) = self.variable(node) else { return Some(Input::Constant(fallback)) };
        let known = self.primvars.iter().position(|slot| slot.name == name);
        let slot = known.unwrap_or(self.primvars.len());
        if slot >= MAX_PRIMVARS {
            self.problems.add(format!("more than {MAX_PRIMVARS} primvars: {name} is left out"));
            return Some(Input::Constant(fallback));
        }
        if known.is_none() {
            self.primvars.push(PrimvarSlot { name, id: 0, fallback });
        }
        Some(Input::Primvar { slot: u8::try_from(slot).unwrap_or_default(), fallback })
    }

    /// The texture coordinate set of a reader, or else the coordinates that it gives.
    pub(super) fn coordinate_reader(&mut self, node: &'a NodeDesc) -> Result<u8, [f32; 2]> {
        let [s, t, ..] = numbers(node, "fallback", Shape::Pair, [0.0; 4], &mut self.problems);
        let fallback = [s, t];
        let name = self.variable(node).ok_or(fallback)?;
        let known = self.uv_sets.iter().position(|set| set.name == name && set.fallback == fallback);
        let set = known.unwrap_or(self.uv_sets.len());
        if set >= MAX_UV_SETS {
            self.problems.add(format!("more than {MAX_UV_SETS} sets of texture coordinates: {name} is left out"));
            return Err(fallback);
        }
        if known.is_none() {
            self.uv_sets.push(UvSet { name, id: 0, fallback });
        }
        Ok(u8::try_from(set).unwrap_or_default())
    }
}
