// SPDX-License-Identifier: Apache-2.0
//! The demands of materials and of the camera on a mesh. Pure.

use std::sync::Arc;

use oocpt_abi::NAME_PTEX;
use xxhash_rust::xxh3::Xxh3;

use super::WantedPrimvar;
use super::cover::CutoutCover;
use super::dicing::DicingRate;
use super::leaf::round::is_of_lines;
use crate::desc::{CurveBasis, MeshDesc, PrimShape, Subdivision};
use crate::material::Displacement;
use crate::texture::HeightCache;

/// Displacements by slot: that of the mesh's own material, then those of its subsets. Empty if nothing is displaced.
pub type SlotDisplacements = Vec<Option<Arc<Displacement>>>;

/// The inputs of building a mesh besides its description.
#[derive(Clone, Copy, Debug, Default)]
pub struct BuildDemand<'a> {
    /// Primvars that become attributes of the asset.
    pub wanted: &'a [WantedPrimvar],
    /// Rate at which it is cut; `None`: as its refine level says.
    pub dicing: Option<&'a DicingRate>,
    /// Displacement of each slot, as in [`SlotDisplacements`].
    pub displacements: &'a [Option<Arc<Displacement>>],
    /// Facts about the cutout of each slot, as in [`super::SlotCovers`].
    pub covers: &'a [Option<CutoutCover>],
    /// Cache that reads the textures of displacements; `None`: they have their fallbacks.
    pub heights: Option<&'a HeightCache>,
}

impl BuildDemand<'_> {
    /// Returns true if a mesh is cut into small pieces.
    pub(crate) fn refines(&self, desc: &MeshDesc) -> bool {
        self.displaces(desc) || is_refined(desc, self.dicing.map_or(0.0, |dicing| dicing.pixels))
    }

    /// Returns true if some faces of a mesh are displaced. Curves and points are not.
    pub(crate) fn displaces(&self, desc: &MeshDesc) -> bool {
        matches!(desc.shape, PrimShape::Mesh) && self.displacements.iter().any(Option::is_some)
    }

    /// Adds everything that decides how a mesh is cut to the hash.
    pub(crate) fn hash(&self, desc: &MeshDesc, hasher: &mut Xxh3) {
        self.dicing.unwrap_or(&DicingRate::default()).hash(hasher);
        if self.displaces(desc) {
            for displacement in self.displacements {
                hasher.update(&[u8::from(displacement.is_some())]);
                displacement.iter().for_each(|displacement| displacement.hash(hasher));
            }
        }
    }

    /// Adds everything that decides which part of a mesh its cutouts keep to the hash.
    pub(crate) fn hash_covers(&self, hasher: &mut Xxh3) {
        for (slot, cover) in (0_u64..).zip(self.covers) {
            if let Some(cover) = cover {
                hasher.update(&slot.to_le_bytes());
                cover.hash(hasher);
            }
        }
    }

    /// Returns true if a material reads Ptex.
    pub(crate) fn reads_ptex(&self) -> bool {
        self.wanted.iter().any(|wanted| wanted.id == NAME_PTEX)
    }

    /// Returns true if the surface has to evaluate a primvar.
    pub(crate) fn reads(&self, name: &str) -> bool {
        self.wanted.iter().any(|wanted| &*wanted.name == name)
            || self.displacements.iter().flatten().any(|displacement| displacement.reads(name))
    }
}

/// True where a mesh is refined at all. Ptex is laid out for faces, not for what they are cut into: such meshes stay
/// as they are ([`crate::desc::DroppedData::unrefined_meshes`] counts them).
fn is_refined(desc: &MeshDesc, pixels: f64) -> bool {
    match (&desc.shape, desc.subdivision) {
        // Lines are as wide as a pixel.
        (PrimShape::Curves(_) | PrimShape::Points, _) if pixels > 0.0 && is_of_lines(desc) => true,
        // Cubic curves are cut; what nothing is cut of stays the same at any rate.
        (PrimShape::Curves(curves), _) => curves.basis != CurveBasis::Linear && (pixels > 0.0 || desc.refine_level > 0),
        // Flat where it is seen as flat: only who asks for more gets it.
        (PrimShape::Mesh, Subdivision::Bilinear) => desc.refine_level > 0,
        (PrimShape::Mesh, Subdivision::CatmullClark | Subdivision::Loop) => pixels > 0.0 || desc.refine_level > 0,
        _ => false,
    }
}
