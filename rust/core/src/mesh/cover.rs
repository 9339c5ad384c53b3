// SPDX-License-Identifier: Apache-2.0
//! What is known of the cutouts of a mesh. Plain data.

use std::sync::Arc;

use xxhash_rust::xxh3::Xxh3;

use crate::material::Cutout;
use crate::texture::CoveredImage;

/// Facts about a cutout that bound the part of a surface that it keeps.
#[derive(Clone, Debug)]
pub struct CutoutCover {
    pub(crate) cutout: Arc<Cutout>,
    /// Coarse image of a cutout by a texture.
    pub(crate) image: Option<Arc<CoveredImage>>,
}

/// Cutouts by slot, as [`super::SlotDisplacements`]. Empty if nothing is cut out, or nothing is known of it.
pub type SlotCovers = Vec<Option<CutoutCover>>;

impl CutoutCover {
    /// Adds everything that the mesh depends on to the hash.
    pub(crate) fn hash(&self, hasher: &mut Xxh3) {
        let (name, numbers): (_, Vec<f32>) = match &*self.cutout {
            Cutout::Texture { set, transform, .. } => (set, transform.as_flattened().to_vec()),
            Cutout::Primvar { name, threshold } => (name, vec![*threshold]),
        };
        hasher.update(&(name.len() as u64).to_le_bytes());
        hasher.update(name.as_bytes());
        hasher.update(&[u8::from(self.image.is_some())]);
        hasher.update(bytemuck::cast_slice(&numbers));
        self.image.iter().for_each(|image| image.hash(hasher));
    }
}
