// SPDX-License-Identifier: Apache-2.0
//! Cutouts of a material that a mesh can evaluate: those by a texture or by a primvar. Pure.
//!
//! Meshes depend on materials only through this type and [`super::Displacement`].

use super::{CompiledMaterial, InputValue, PTEX_SET, TextureRef};
use oocpt_abi::{MaterialFlags, MaterialInput};
use std::hash::{Hash, Hasher};
use std::sync::Arc;

/// A cutout, which tells the part of a surface that exists.
#[derive(Clone, Debug, PartialEq)]
pub enum Cutout {
    /// A channel of a texture decides.
    Texture {
        /// The texture, and how its values are compared.
        image: CutoutImage,
        /// Name of the texture coordinates.
        set: Arc<str>,
        /// Rows of the affine map from the set to the position in the texture.
        transform: [[f32; 3]; 2],
    },
    /// A primvar decides: the surface exists where it is at or above the threshold, or above 0 if the threshold is 0.
    Primvar {
        /// Name of the primvar.
        name: Arc<str>,
        /// Threshold, as [`super::Material::opacity_threshold`].
        threshold: f32,
    },
}

/// A channel of a texture that is used as opacity.
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
    /// The cutout of the material; `None` if nothing is known of it. Surfaces that emit are lights, of which all faces
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
