// SPDX-License-Identifier: Apache-2.0
//! How a material displaces its surfaces: `displacement` of the `UsdPreviewSurface` at the material's displacement
//! terminal, along the normal, in units of the object's space. Pure.
//!
//! Other nodes at that terminal come here, too, once they are understood: meshes know nothing but [`Displacement`].

use std::hash::{Hash as _, Hasher};
use std::sync::Arc;

use rustc_hash::FxHasher;
use xxhash_rust::xxh3::Xxh3;

use super::compile::Compiler;
use super::params::{Shape, connection, numbers};
use super::{Input, PTEX_SET, TextureRef, UvSet};
use crate::desc::MaterialDesc;

/// How far surfaces are moved along their normals.
#[derive(Clone, Debug, PartialEq)]
pub struct Displacement {
    /// The first of its components counts. Numbers of textures, sets and primvars are 0.
    pub(crate) amount: Input,
    /// The texture of `amount`.
    pub(crate) texture: Option<TextureRef>,
    /// The texture coordinates of `amount`.
    pub(crate) uv: Option<UvSet>,
    /// The primvar of `amount`.
    pub(crate) primvar: Option<Arc<str>>,
}

impl Displacement {
    /// Name of the primvar that it reads.
    #[must_use]
    pub fn primvar_name(&self) -> Option<&Arc<str>> {
        self.uv.as_ref().map(|uv| &uv.name).or(self.primvar.as_ref())
    }

    /// Adds everything that the displaced mesh depends on.
    pub(crate) fn hash(&self, hasher: &mut Xxh3) {
        let mut add = |numbers: &[f32]| numbers.iter().for_each(|number| hasher.update(&number.to_le_bytes()));
        let tag: u8 = match &self.amount {
            Input::Constant(value) => {
                add(value);
                0
            }
            Input::Texture { scale, bias, transform, .. } => {
                [&scale[..], &bias[..], transform.as_flattened()].into_iter().for_each(&mut add);
                self.uv.iter().for_each(|uv| add(&uv.fallback));
                1
            }
            Input::Primvar { fallback, .. } => {
                add(fallback);
                2
            }
            // Only surfaces have programs.
            Input::Register(_) => 3,
        };
        hasher.update(&[tag, u8::from(self.uv.is_some())]);
        if let Input::Texture { channel, .. } = &self.amount {
            hasher.update(&[channel.unwrap_or(0)]);
        }
        if let Some(TextureRef { prim: _, asset, wrap, color_space, fallback, is_ptex: _ }) = &self.texture {
            let mut rest = FxHasher::default();
            (asset, wrap, color_space, fallback.map(f32::to_bits)).hash(&mut rest);
            hasher.update(&rest.finish().to_le_bytes());
            hasher.update(asset.resolved.as_bytes());
        }
        self.primvar_name().into_iter().for_each(|name| hasher.update(name.as_bytes()));
    }
}

impl Compiler<'_> {
    /// What the displacement terminal says. Takes nothing of what a surface may read.
    pub(super) fn displacement(&mut self, desc: &MaterialDesc) -> Option<Displacement> {
        let Some(node) = desc.displacement.and_then(|at| self.nodes.get(at)) else {
            let surface = desc.surface.and_then(|at| self.nodes.get(at))?;
            let [amount, ..] = numbers(surface, "displacement", Shape::Scalar, [0.0; 4], &mut self.problems);
            if amount != 0.0 || connection(surface, "displacement").is_some() {
                let problem = "`displacement` is left out: the material's displacement output is not connected";
                self.problems.add(problem.to_owned());
            }
            return None;
        };
        if &*node.kind != "UsdPreviewSurface" {
            self.problems.add(format!("displacement by nodes of kind `{}` is not supported", node.kind));
            return None;
        }
        let amount = self.input(node, "displacement", Shape::Scalar, [0.0; 4]);
        let textures = std::mem::take(&mut self.textures);
        let uv = std::mem::take(&mut self.uv_sets).into_iter().next();
        let primvar = std::mem::take(&mut self.primvars).into_iter().next().map(|slot| slot.name);
        if uv.as_ref().is_some_and(|uv| &*uv.name == PTEX_SET) {
            self.problems.add("displacement by Ptex is not supported".to_owned());
            return None;
        }
        let mut texture = textures.into_iter().next();
        if let Some(texture) = &mut texture {
            texture.prim = desc.named(&texture.prim);
        }
        let is_flat = matches!(amount, Input::Constant([value, ..]) if value == 0.0);
        (!is_flat).then_some(Displacement { amount, texture, uv, primvar })
    }
}
