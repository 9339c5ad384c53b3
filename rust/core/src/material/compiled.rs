// SPDX-License-Identifier: Apache-2.0
//! What became of a network. Plain data.

use std::sync::Arc;

use super::displacement::Displacement;
use super::{Material, TextureRef};

/// What became of a network.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CompiledMaterial {
    /// The material; none where the surface cannot be understood: its meshes look as if they had none.
    pub material: Option<Material>,
    /// Textures by the numbers that the inputs have.
    pub textures: Vec<TextureRef>,
    /// How it displaces its surfaces, if it does.
    pub displacement: Option<Arc<Displacement>>,
    /// What was left out, one line each.
    pub problems: Vec<String>,
}

impl CompiledMaterial {
    /// One line about everything that was left out.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        (!self.problems.is_empty()).then(|| self.problems.join("; "))
    }
}
