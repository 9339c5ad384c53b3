// SPDX-License-Identifier: Apache-2.0
//! Displacements of surfaces by a material: `displacement` of the `UsdPreviewSurface` at the material's displacement
//! terminal, along the normal, or the value of nodes of `MaterialX` there; in units of object space. Pure.
//!
//! Meshes depend on materials only through this type and [`super::Cutout`].

use std::hash::{Hash as _, Hasher};
use std::sync::Arc;

use oocpt_materialx::DisplacementOffset;
use oocpt_materialx::program::{Instruction, Program, ProgramLookup};
use rustc_hash::FxHasher;
use xxhash_rust::xxh3::Xxh3;

use super::compiler::NetworkCompiler;
use super::params::{NumberShape, connection, numbers};
use super::{InputValue, PTEX_SET, TextureRef, UvSet};
use crate::desc::MaterialDesc;

/// Amount and direction by which surfaces are moved.
#[derive(Clone, Debug, PartialEq)]
pub enum Displacement {
    /// An input of a `UsdPreviewSurface`, or a number.
    Preview(PreviewDisplacement),
    /// A program or a vector.
    Pattern(PatternDisplacement),
}

/// Amount by which surfaces are moved along their normals.
#[derive(Clone, Debug, PartialEq)]
pub struct PreviewDisplacement {
    /// Amount: the first of its components counts. Numbers of textures, sets and primvars are 0. It is never a
    /// register.
    pub(crate) amount: InputValue,
    /// Texture of `amount`.
    pub(crate) texture: Option<TextureRef>,
    /// Texture coordinates of `amount`.
    pub(crate) uv: Option<UvSet>,
    /// Primvar of `amount`.
    pub(crate) primvar: Option<Arc<str>>,
}

/// A displacement as a program, as [`oocpt_materialx::DisplacementProgram`].
#[derive(Clone, Debug, PartialEq)]
pub struct PatternDisplacement {
    pub(crate) offset: DisplacementOffset,
    /// True if it is a vector along tangent, bitangent and normal.
    pub(crate) is_vector: bool,
    /// True if the tangent or the bitangent matters.
    pub(crate) has_tangents: bool,
    pub(crate) program: Program,
    /// Textures, indexed by the numbers in its lookups.
    pub(crate) textures: Vec<TextureRef>,
    /// Sets of texture coordinates; tangents follow the first one.
    pub(crate) uv_sets: Vec<Arc<str>>,
    /// Names of primvars, and their values where the mesh does not have them.
    pub(crate) primvars: Vec<(Arc<str>, [f32; 4])>,
}

impl Displacement {
    /// A displacement by a number, along the normals.
    pub(super) fn along_normals(value: [f32; 4]) -> Self {
        Self::Preview(PreviewDisplacement {
            amount: InputValue::Constant(value),
            texture: None,
            uv: None,
            primvar: None,
        })
    }

    /// Returns true if it can be evaluated on a part of a mesh: the level of a program's textures depends on all of it.
    pub(crate) fn is_local(&self) -> bool {
        match self {
            Self::Preview(_) => true,
            Self::Pattern(pattern) => pattern.textures.is_empty(),
        }
    }

    /// Returns true if it reads the primvar `name`.
    #[must_use]
    pub fn reads(&self, name: &str) -> bool {
        match self {
            Self::Preview(preview) => preview.primvar_name().is_some_and(|read| &**read == name),
            Self::Pattern(PatternDisplacement { uv_sets, primvars, .. }) => {
                uv_sets.iter().chain(primvars.iter().map(|(read, _)| read)).any(|read| &**read == name)
            }
        }
    }

    /// Adds everything that the displaced mesh depends on to the hash.
    pub(crate) fn hash(&self, hasher: &mut Xxh3) {
        match self {
            Self::Preview(preview) => preview.hash(hasher),
            Self::Pattern(pattern) => pattern.hash(hasher),
        }
    }
}

/// Adds everything that the values of a texture depend on to the hash.
fn hash_texture(texture: &TextureRef, hasher: &mut Xxh3) {
    let TextureRef { prim: _, asset, wrap, color_space, fallback, has_border, is_ptex: _ } = texture;
    let mut rest = FxHasher::default();
    (asset, wrap, color_space, fallback.map(f32::to_bits), has_border).hash(&mut rest);
    hasher.update(&rest.finish().to_le_bytes());
    hasher.update(asset.resolved.as_bytes());
}

impl PreviewDisplacement {
    /// Name of the primvar that it reads.
    pub(crate) fn primvar_name(&self) -> Option<&Arc<str>> {
        self.uv.as_ref().map(|uv| &uv.name).or(self.primvar.as_ref())
    }

    fn hash(&self, hasher: &mut Xxh3) {
        let mut add = |numbers: &[f32]| numbers.iter().for_each(|number| hasher.update(&number.to_le_bytes()));
        let tag: u8 = match &self.amount {
            InputValue::Constant(value) => {
                add(value);
                0
            }
            InputValue::Texture { scale, bias, transform, .. } => {
                [&scale[..], &bias[..], transform.as_flattened()].into_iter().for_each(&mut add);
                self.uv.iter().for_each(|uv| add(&uv.fallback));
                1
            }
            InputValue::Primvar { fallback, .. } => {
                add(fallback);
                2
            }
            InputValue::Register(_) => 3,
        };
        hasher.update(&[tag, u8::from(self.uv.is_some())]);
        if let InputValue::Texture { channel, .. } = &self.amount {
            hasher.update(&[channel.unwrap_or(0)]);
        }
        self.texture.iter().for_each(|texture| hash_texture(texture, hasher));
        self.primvar_name().into_iter().for_each(|name| hasher.update(name.as_bytes()));
    }
}

impl PatternDisplacement {
    fn hash(&self, hasher: &mut Xxh3) {
        let Self { offset, is_vector, has_tangents: _, program, textures, uv_sets, primvars } = self;
        let Program { instructions, constants, lookups } = program;
        let counts = [instructions.len(), constants.len(), lookups.len(), textures.len(), uv_sets.len()];
        hasher.update(&[4, u8::from(*is_vector)]);
        counts.iter().for_each(|count| hasher.update(&(*count as u64).to_le_bytes()));
        let mut add = |numbers: &[f32]| numbers.iter().for_each(|number| hasher.update(&number.to_le_bytes()));
        if let DisplacementOffset::Constant(value) = offset {
            add(value);
        }
        constants.iter().for_each(|constant| add(constant));
        for ProgramLookup { transform, scale, bias, .. } in lookups {
            [transform.as_flattened(), scale, bias].into_iter().for_each(&mut add);
        }
        primvars.iter().for_each(|(_, fallback)| add(fallback));
        for ProgramLookup { texture, uv, .. } in lookups {
            hasher.update(&texture.to_le_bytes());
            hasher.update(&[uv.unwrap_or(u8::MAX)]);
        }
        if let DisplacementOffset::Register(register) = offset {
            hasher.update(&[*register]);
        }
        for word in instructions.iter().flat_map(Instruction::pack) {
            hasher.update(&word.to_le_bytes());
        }
        textures.iter().for_each(|texture| hash_texture(texture, hasher));
        for name in uv_sets.iter().chain(primvars.iter().map(|(name, _)| name)) {
            hasher.update(&(name.len() as u64).to_le_bytes());
            hasher.update(name.as_bytes());
        }
    }
}

impl NetworkCompiler<'_> {
    /// The displacement at the displacement terminal. It uses none of the slots that the surface may read.
    pub(super) fn displacement(&mut self, desc: &MaterialDesc) -> Option<Displacement> {
        let Some(node) = desc.displacement.and_then(|at| self.nodes.get(at)) else {
            let surface = desc.surface.and_then(|at| self.nodes.get(at))?;
            let [amount, ..] = numbers(surface, "displacement", NumberShape::Scalar, [0.0; 4], &mut self.problems);
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
        let amount = self.input(node, "displacement", NumberShape::Scalar, [0.0; 4]);
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
        let is_flat = matches!(amount, InputValue::Constant([value, ..]) if value == 0.0);
        (!is_flat).then_some(Displacement::Preview(PreviewDisplacement { amount, texture, uv, primvar }))
    }
}
