// SPDX-License-Identifier: Apache-2.0
//! What is known of the cutouts of a mesh. Plain data.

use std::sync::Arc;

use xxhash_rust::xxh3::Xxh3;

use crate::material::Cutout;
use crate::texture::CoveredImage;

/// What is known of a cutout.
#[derive(Clone, Debug)]
pub struct CutoutCover {
    pub(crate) cutout: Arc<Cutout>,
    /// Of a cutout by a texture.
    pub(crate) image: Option<Arc<CoveredImage>>,
}

/// By slot, as [`super::SlotDisplacements`]. Empty where nothing is cut out, or nothing is known of it.
pub type SlotCovers = Vec<Option<CutoutCover>>;

impl CutoutCover {
    /// Adds all that the mesh depends on.
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
