// SPDX-License-Identifier: Apache-2.0
//! Where the value of an input comes from. Pure.

use super::InputValue;
use super::compiler::NetworkCompiler;
use super::params::{NumberShape, connection, numbers};
use super::reader::READER;
use super::texture::is_texture;
use crate::desc::NodeDesc;

impl<'a> NetworkCompiler<'a> {
    /// One input: what it is connected to, else what is authored, else the default.
    pub(super) fn input(
        &mut self,
        node: &'a NodeDesc,
        name: &str,
        shape: NumberShape,
        default: [f32; 4],
    ) -> InputValue {
        if let Some(source) = connection(node, name) {
            let found = match self.nodes.get(source.node) {
                Some(next) if is_texture(next) => self.texture(next, &source.output),
                Some(next) if next.kind.starts_with(READER) => self.reader(next),
                Some(next) => {
                    self.unsupported(next);
                    None
                }
                None => {
                    self.problems.add(format!("`{name}` is connected to nothing"));
                    None
                }
            };
            if let Some(input) = found {
                return input;
            }
        }
        InputValue::Constant(numbers(node, name, shape, default, &mut self.problems))
    }
}
