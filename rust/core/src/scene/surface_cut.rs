// SPDX-License-Identifier: Apache-2.0
//! How finely a surface is cut: what dicing decides, and what meshes are built by. Pure.

use std::sync::Arc;

use crate::mesh::{DicingRate, MeshPatch, MeshPatches};

/// How finely a surface is cut.
#[derive(Clone, Debug, Default)]
pub(crate) struct SurfaceCut {
    pub(crate) dicing: DicingRate,
    /// The cuts of its patches; then `dicing` only says that it is refined.
    pub(crate) patches: Option<Arc<PatchCuts>>,
}

impl SurfaceCut {
    /// The cut of a surface in patches; `pixels` as in [`DicingRate`].
    pub(super) fn of_patches(pixels: f64, patches: Arc<PatchCuts>) -> Self {
        Self { dicing: DicingRate { pixels, ..DicingRate::default() }, patches: Some(patches) }
    }
}

/// How the patches of a surface are cut.
#[derive(Debug)]
pub(crate) struct PatchCuts {
    pub(super) all: Arc<MeshPatches>,
    /// The rate of each patch.
    pub(super) dicing: Vec<DicingRate>,
    /// Pieces of each edge.
    pub(super) rates: Vec<u16>,
    /// Steps of two by which each patch of a live view is cut more coarsely than asked.
    pub(super) coarser: Vec<u8>,
    /// Rates are lower than asked.
    pub(crate) is_coarse: bool,
}

impl PatchCuts {
    /// Returns true if both give the same triangles of the same mesh.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        self.is_coarse == other.is_coarse && self.rates == other.rates
    }

    /// All patches, with the rates of their edges.
    pub(crate) fn patches(&self, displaces: bool) -> impl Iterator<Item = MeshPatch> {
        (0..self.all.patches.len()).map(move |number| MeshPatch::new(&self.all, number, displaces, &self.rates))
    }
}
