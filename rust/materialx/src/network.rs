// SPDX-License-Identifier: Apache-2.0
//! A network as a scene delivers it: nodes by the names of their definitions, what is authored of them, connections.

use std::sync::Arc;

use crate::value::PortValue;

/// Most nodes of a network.
pub const MAX_NODES: usize = 4096;

/// A node.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkNode {
    /// Its path.
    pub path: Arc<str>,
    /// Name of its definition: `ND_multiply_color3`.
    pub kind: Arc<str>,
    /// What is authored: name and value.
    pub values: Vec<(Arc<str>, PortValue)>,
    /// What is connected: name of the input, number of the node, name of its output.
    pub connections: Vec<(Arc<str>, usize, Arc<str>)>,
}

impl NetworkNode {
    /// What is authored of an input.
    #[must_use]
    pub fn value(&self, name: &str) -> Option<&PortValue> {
        self.values.iter().find(|(known, _)| &**known == name).map(|(_, value)| value)
    }

    /// What an input is connected to.
    #[must_use]
    pub fn connection(&self, name: &str) -> Option<(usize, &Arc<str>)> {
        let found = self.connections.iter().find(|(known, ..)| &**known == name);
        found.map(|(_, node, output)| (*node, output))
    }
}

/// A network.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Network {
    /// Its nodes, at most [`MAX_NODES`].
    pub nodes: Vec<NetworkNode>,
    /// Number of the surface's node.
    pub surface: usize,
    /// Number of the displacement's node.
    pub displacement: Option<usize>,
}
