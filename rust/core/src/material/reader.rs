// SPDX-License-Identifier: Apache-2.0
//! `UsdPrimvarReader_*`: what a material reads from its mesh. Pure.

use std::sync::Arc;

use super::compile::NetworkCompiler;
use super::params::{NumberShape, numbers, text};
use super::{InputValue, MAX_PRIMVARS, MAX_UV_SETS, PrimvarSlot, UvSet};
use crate::desc::NodeDesc;

/// What all kinds of readers begin with.
pub(super) const READER: &str = "UsdPrimvarReader_";

impl<'a> NetworkCompiler<'a> {
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
    pub(super) fn reader(&mut self, node: &'a NodeDesc) -> Option<InputValue> {
        let shape = match node.kind.strip_prefix(READER)? {
            "float" => NumberShape::Scalar,
            "float2" => NumberShape::Pair,
            "float3" | "normal" | "point" | "vector" => NumberShape::Color,
            "float4" => NumberShape::Four,
            _ => {
                self.unsupported(node);
                return None;
            }
        };
        let fallback = numbers(node, "fallback", shape, [0.0; 4], &mut self.problems);
        let Some(name) = self.variable(node) else { return Some(InputValue::Constant(fallback)) };
        let known = self.primvars.iter().position(|slot| slot.name == name);
        let slot = known.unwrap_or(self.primvars.len());
        if slot >= MAX_PRIMVARS {
            self.problems.add(format!("more than {MAX_PRIMVARS} primvars: {name} is left out"));
            return Some(InputValue::Constant(fallback));
        }
        if known.is_none() {
            self.primvars.push(PrimvarSlot { name, id: 0, fallback });
        }
        Some(InputValue::Primvar { slot: u8::try_from(slot).unwrap_or_default(), fallback })
    }

    /// The texture coordinate set of a reader, or else the coordinates that it gives.
    pub(super) fn coordinate_reader(&mut self, node: &'a NodeDesc) -> Result<u8, [f32; 2]> {
        let [s, t, ..] = numbers(node, "fallback", NumberShape::Pair, [0.0; 4], &mut self.problems);
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
