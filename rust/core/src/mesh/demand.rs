// SPDX-License-Identifier: Apache-2.0
//! What materials and the camera ask of a mesh. Pure.

use std::sync::Arc;

use xxhash_rust::xxh3::Xxh3;

use super::WantedPrimvar;
use super::cover::CutoutCover;
use super::dicing::DicingRate;
use super::refine::is_refined;
use crate::desc::{MeshDesc, PrimShape};
use crate::material::Displacement;
use crate::texture::HeightCache;

/// Displacements by slot: that of the mesh's own material, then those of its subsets. Empty where nothing is displaced.
pub type SlotDisplacements = Vec<Option<Arc<Displacement>>>;

/// What a mesh is built for, besides what its description says.
#[derive(Clone, Copy, Debug, Default)]
pub struct BuildDemand<'a> {
    /// Primvars that become those of the asset.
    pub wanted: &'a [WantedPrimvar],
    /// How finely it is cut; none: as its refine level says.
    pub dicing: Option<&'a DicingRate>,
    /// As [`SlotDisplacements`].
    pub displacements: &'a [Option<Arc<Displacement>>],
    /// What is there of surfaces that are cut out, as [`super::SlotCovers`].
    pub covers: &'a [Option<CutoutCover>],
    /// Reads the textures of displacements; none: they have their fallbacks.
    pub heights: Option<&'a HeightCache>,
}

impl BuildDemand<'_> {
    /// True where a mesh is cut into small pieces.
    pub(crate) fn refines(&self, desc: &MeshDesc) -> bool {
        self.displaces(desc) || is_refined(desc, self.dicing.map_or(0.0, |dicing| dicing.pixels))
    }

    /// True where some faces of a mesh are displaced. Curves and points are not.
    pub(crate) fn displaces(&self, desc: &MeshDesc) -> bool {
        matches!(desc.shape, PrimShape::Mesh) && self.displacements.iter().any(Option::is_some)
    }

    /// Adds what decides how a mesh is cut.
    pub(crate) fn hash(&self, desc: &MeshDesc, hasher: &mut Xxh3) {
        self.dicing.unwrap_or(&DicingRate::default()).hash(hasher);
        if self.displaces(desc) {
            for displacement in self.displacements {
                hasher.update(&[u8::from(displacement.is_some())]);
                displacement.iter().for_each(|displacement| displacement.hash(hasher));
            }
        }
    }

    /// Adds what decides what is there of a mesh.
    pub(crate) fn hash_covers(&self, hasher: &mut Xxh3) {
        for (slot, cover) in (0_u64..).zip(self.covers) {
            if let Some(cover) = cover {
                hasher.update(&slot.to_le_bytes());
                cover.hash(hasher);
            }
        }
    }

    /// True where the surface has to evaluate a primvar.
    pub(crate) fn reads(&self, name: &str) -> bool {
        self.wanted.iter().any(|wanted| &*wanted.name == name)
            || self.displacements.iter().flatten().any(|displacement| displacement.reads(name))
    }
}
