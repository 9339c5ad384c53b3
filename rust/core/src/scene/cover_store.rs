// SPDX-License-Identifier: Apache-2.0
//! The images of cutouts, each read once. An image is kept as long as the scene shows its file, which is as long as
//! tiles of it are kept, so that both come from the same file.

use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::entries::SlotCutouts;
use crate::material::{Cutout, CutoutImage, TextureRef};
use crate::mesh::{CutoutCover, SlotCovers};
use crate::texture::{CoveredImage, HeightFiles};

/// Largest number of images; an image has 8 KiB, and each part of a set is an image.
const MAX_IMAGES: usize = 4096;

/// The images of cutouts that the scene uses.
#[derive(Debug, Default)]
pub(crate) struct CoverStore {
    /// Images by cutout; `None` if the image could not be had.
    images: FxHashMap<CutoutImage, Option<Arc<CoveredImage>>>,
}

fn image_of(cutout: &Arc<Cutout>) -> Option<&CutoutImage> {
    match &**cutout {
        Cutout::Texture { image, .. } => Some(image),
        Cutout::Primvar { .. } => None,
    }
}

impl CoverStore {
    /// Reads the unknown images of meshes, in parallel.
    pub(crate) fn read<'a>(
        &mut self,
        meshes: impl Iterator<Item = &'a SlotCutouts>,
        files: Option<&Arc<dyn HeightFiles>>,
    ) {
        let Some(files) = files else { return };
        let images = meshes.flatten().flatten().filter_map(image_of);
        let mut seen: FxHashSet<&CutoutImage> = FxHashSet::default();
        let left = MAX_IMAGES.saturating_sub(self.images.len());
        let unknown = images.filter(|image| !self.images.contains_key(image) && seen.insert(image));
        let unknown: Vec<&CutoutImage> = unknown.take(left).collect();
        let read = |image: &CutoutImage| (image.clone(), CoveredImage::read(image, &**files).map(Arc::new));
        let read: Vec<_> = unknown.into_par_iter().with_max_len(1).map(read).collect();
        self.images.extend(read);
    }

    /// The facts about the cutouts of a mesh; empty if nothing is known.
    pub(crate) fn of(&self, cutouts: &SlotCutouts) -> SlotCovers {
        let cover = |cutout: &Arc<Cutout>| {
            let image = match image_of(cutout) {
                Some(image) => Some(self.images.get(image)?.clone()?),
                None => None,
            };
            Some(CutoutCover { cutout: Arc::clone(cutout), image })
        };
        let mut covers: SlotCovers = cutouts.iter().map(|cutout| cover(cutout.as_ref()?)).collect();
        if covers.iter().all(Option::is_none) {
            covers.clear();
        }
        covers
    }

    /// Forgets images of files that the scene does not show.
    pub(crate) fn retain(&mut self, shown: &[TextureRef]) {
        let shown: FxHashSet<&str> = shown.iter().map(|texture| &*texture.asset.resolved).collect();
        self.images.retain(|image, _| shown.contains(&*image.texture.asset.resolved));
    }
}
