// SPDX-License-Identifier: Apache-2.0
//! What a material cuts out of its surfaces, as far as a mesh can know it: by a texture, or by a primvar. Pure.
//!
//! Meshes know nothing of materials but this and [`super::Displacement`].

use super::{CompiledMaterial, InputValue, PTEX_SET, TextureRef};
use oocpt_abi::{MaterialFlags, MaterialInput};
use std::hash::{Hash, Hasher};
use std::sync::Arc;

/// What is there of a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Cutout {
    /// As a texture says.
    Texture {
        /// The texture, and how it is compared.
        image: CutoutImage,
        /// Name of the texture coordinates.
        set: Arc<str>,
        /// Rows of the affine map from the set to the place in the texture.
        transform: [[f32; 3]; 2],
    },
    /// As a primvar says: where it is at or above the threshold, or above 0 where that is 0.
    Primvar {
        /// Its name.
        name: Arc<str>,
        /// See [`super::Material::opacity_threshold`].
        threshold: f32,
    },
}

/// A channel of a texture that is opacity.
#[derive(Clone, Debug, PartialEq)]
pub struct CutoutImage {
    pub(crate) texture: TextureRef,
    pub(crate) channel: u8,
    pub(crate) scale: f32,
    pub(crate) bias: f32,
    pub(crate) threshold: f32,
}

impl Eq for CutoutImage {}

impl Hash for CutoutImage {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let Self { texture, channel, scale, bias, threshold } = self;
        (&texture.asset, texture.wrap, channel, [scale, bias, threshold].map(|number| number.to_bits())).hash(state);
    }
}

impl CompiledMaterial {
    /// What the material cuts out; none where nothing can be told. Surfaces that emit are lights, of which all faces
    /// count.
    pub(crate) fn cutout(&self) -> Option<Cutout> {
        let material = self.material.as_ref()?;
        let is_asked = material.flags.contains(MaterialFlags::PRESENCE);
        let threshold = material.opacity_threshold;
        if !is_asked || material.flags.contains(MaterialFlags::EMISSIVE) || !threshold.is_finite() {
            return None;
        }
        match *material.input(MaterialInput::Opacity) {
            InputValue::Texture { texture, channel, scale, bias, uv, transform } => {
                let texture = self.textures.get(texture as usize).filter(|texture| !texture.is_ptex)?;
                let set = material.uv_sets.get(usize::from(uv?)).filter(|set| &*set.name != PTEX_SET)?;
                let channel = channel.unwrap_or(0) & 3;
                let [scale, bias] = [scale, bias].map(|four| four[usize::from(channel)]);
                let numbers = transform.as_flattened().iter().chain(&texture.fallback).chain([&scale, &bias]);
                let is_finite = numbers.copied().all(f32::is_finite);
                let image = CutoutImage { texture: texture.clone(), channel, scale, bias, threshold };
                is_finite.then(|| Cutout::Texture { image, set: set.name.clone(), transform })
            }
            InputValue::Primvar { slot, .. } => {
                let name = material.primvars.get(usize::from(slot))?.name.clone();
                Some(Cutout::Primvar { name, threshold })
            }
            InputValue::Constant(_) | InputValue::Register(_) => None,
        }
    }
}
