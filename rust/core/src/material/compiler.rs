// SPDX-License-Identifier: Apache-2.0
//! What the nodes of a network add to while it is read. Pure.

use super::params::ProblemList;
use super::{PrimvarSlot, TextureRef, UvSet};
use crate::desc::NodeDesc;

/// Most nodes of a network.
pub const MAX_NODES: usize = 4096;

/// While a network is read.
pub(super) struct NetworkCompiler<'a> {
    pub(super) nodes: &'a [NodeDesc],
    pub(super) problems: ProblemList,
    pub(super) textures: Vec<TextureRef>,
    pub(super) uv_sets: Vec<UvSet>,
    pub(super) primvars: Vec<PrimvarSlot>,
}

impl NetworkCompiler<'_> {
    /// Notes that nodes of this kind are not understood. Hosts hand over no kind for nodes that they have no definition
    /// of, such as shaders in a language of a renderer.
    pub(super) fn unsupported(&mut self, node: &NodeDesc) {
        let (kind, path) = (&node.kind, &node.path);
        self.problems.add(if kind.is_empty() {
            format!("the host has no definition of {path}")
        } else {
            format!("nodes of kind `{kind}` ({path}) are not supported")
        });
    }
}
