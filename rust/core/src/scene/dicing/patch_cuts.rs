// SPDX-License-Identifier: Apache-2.0
//! How finely the patches of a large surface near to the camera are cut, edge by edge. Pure.
//!
//! Each patch has a rate of its own, found and kept as that of a surface is (`found`); an edge gets the largest number
//! of pieces that the patches at it ask for, so faces beside each other agree whatever patches they are in. In a final
//! view an edge has just as many pieces as it needs. In a live view numbers of pieces are powers of two, and a patch
//! with too many triangles to be refined again in a short time is cut more coarsely.

use std::sync::Arc;

use glam::DAffine3;
use rayon::prelude::*;

use super::DicingCamera;
use super::camera::DicingDensity;
use super::found::SurfaceDensity;
use crate::mesh::{DicingRate, EdgeRates, MAX_REFINED_TRIANGLES, MeshPatches};
use crate::scene::entries::MeshEntry;
use crate::scene::mesh_outline::BoundingSphere;
use crate::scene::surface_cut::PatchCuts;

/// Triangles of a surface up to which it is refined as a whole: it is soon done, and one mesh.
const MAX_WHOLE: u64 = 1 << 18;
/// Largest number of triangles of a surface in patches in a final view. They are made one by one, so the limit is not
/// that of the memory of one build.
const MAX_PATCHED: u64 = 4 * MAX_REFINED_TRIANGLES;

/// Largest number of triangles of a patch in a live view, if its faces can have as few.
const MAX_LIVE_PATCH: u64 = 1 << 17;
/// A patch of a live view is cut more finely again when it then has so many of 8 parts of what it may have.
const ROOM_EIGHTHS: u64 = 6;

/// How the placements of a surface are seen, patch by patch.
#[derive(Debug, Default)]
pub(super) struct PatchDensities {
    all: Option<Arc<MeshPatches>>,
    /// As near placements need them.
    near: Vec<SurfaceDensity>,
    /// What the other placements need of all patches.
    far: DicingDensity,
    /// Some placements have not been gone into: there are many, and each would place every patch.
    is_scattered: bool,
}

impl PatchDensities {
    /// A near placement. `whole`: radius of the surface.
    pub(super) fn see(&mut self, camera: &DicingCamera, all: &Arc<MeshPatches>, whole: f64, map: &DAffine3) {
        self.all.get_or_insert_with(|| all.clone());
        self.near.resize_with(all.patches.len(), SurfaceDensity::default);
        for (found, patch) in self.near.iter_mut().zip(&all.patches) {
            let ball = BoundingSphere::of(&patch.bounds);
            found.see_patch(camera, &ball.placed(map), [ball.radius, whole], map);
        }
    }

    /// A placement that covers so many pixels a unit.
    pub(super) fn cover(&mut self, density: DicingDensity) {
        self.far = self.far.max(density);
    }

    /// There are placements that are not gone into.
    pub(super) fn scatter(&mut self) {
        self.is_scattered = true;
    }

    /// Adds what was found of a surface with the same content.
    pub(super) fn add(&mut self, other: Self) {
        self.cover(other.far);
        self.is_scattered |= other.is_scattered;
        self.all = self.all.take().or(other.all);
        if self.near.is_empty() {
            self.near = other.near;
        } else {
            self.near.iter_mut().zip(other.near).for_each(|(found, more)| found.add(more));
        }
    }

    /// How the patches are cut, where they were cut as `kept` in a live view; `None` if the surface is cut as a whole:
    /// where it is near nowhere, has many placements, or has few triangles and was not in patches before.
    pub(super) fn cut(
        &self,
        camera: &DicingCamera,
        entry: &MeshEntry,
        kept: Option<&Arc<PatchCuts>>,
    ) -> Option<Arc<PatchCuts>> {
        let all = self.all.as_ref().filter(|_| !self.is_scattered)?;
        let displaces = entry.demand().displaces(&entry.desc);
        let kept_of = |number: usize| kept.and_then(|kept| kept.dicing.get(number));
        let rate = |(number, found): (usize, &SurfaceDensity)| {
            let mut found = found.clone();
            found.cover(self.far);
            if camera.is_live { found.live_patch_dicing(camera, kept_of(number)) } else { found.patch_dicing(camera) }
        };
        let dicing: Vec<DicingRate> = self.near.iter().enumerate().map(rate).collect();
        if let Some(kept) = kept.filter(|kept| kept.dicing == dicing) {
            return Some(kept.clone());
        }
        let surface = CutSurface { all, entry, displaces, dicing: &dicing };
        let (rates, coarser, is_coarse) = match camera.is_live {
            true => surface.live(kept.map_or(&[], |kept| &kept.coarser)),
            false => surface.exact(),
        };
        let is_small = kept.is_none() && all.expected_triangles(&rates) <= MAX_WHOLE;
        (!is_small).then(|| Arc::new(PatchCuts { all: all.clone(), dicing, rates, coarser, is_coarse }))
    }
}

/// A surface whose patches have these rates.
struct CutSurface<'a> {
    all: &'a MeshPatches,
    entry: &'a MeshEntry,
    displaces: bool,
    dicing: &'a [DicingRate],
}

impl CutSurface<'_> {
    fn patches(&self) -> impl IndexedParallelIterator<Item = (usize, EdgeRates<'_>)> {
        let edges = |dicing| EdgeRates::new(&self.entry.desc, dicing, self.displaces);
        self.dicing.par_iter().map(edges).enumerate()
    }

    /// The rates of a final view, lower if there were too many triangles.
    fn exact(&self) -> (Vec<u16>, Vec<u8>, bool) {
        let wanted = |(patch, edges): (usize, EdgeRates<'_>)| {
            self.all.own_edges(&self.entry.desc, patch, |a, b| small(edges.pieces(a, b)))
        };
        let wanted: Vec<Vec<u16>> = self.patches().map(wanted).collect();
        let mut rates = self.all.rates(&wanted);
        let expected = self.all.expected_triangles(&rates);
        let is_coarse = expected > MAX_PATCHED && rates.iter().any(|rate| *rate > 1);
        if is_coarse {
            #[expect(clippy::cast_precision_loss, reason = "a ratio")]
            let share = (MAX_PATCHED as f64 / expected as f64).sqrt();
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "no more than before")]
            rates.iter_mut().for_each(|rate| *rate = ((f64::from(*rate) * share) as u16).max(1));
        }
        (rates, Vec::new(), is_coarse)
    }

    /// The rates of a live view, with the steps that patches leave out; `kept`: those that they left out before.
    fn live(&self, kept: &[u8]) -> (Vec<u16>, Vec<u8>, bool) {
        let octaves = |(patch, edges): (usize, EdgeRates<'_>)| {
            self.all.own_edges(&self.entry.desc, patch, |a, b| small(edges.octave(a, b)))
        };
        let octaves: Vec<Vec<u16>> = self.patches().map(octaves).collect();
        let mut most = MAX_LIVE_PATCH;
        loop {
            let (wanted, coarser): (Vec<Vec<u16>>, Vec<u8>) = self
                .patches()
                .zip(&octaves)
                .map(|((patch, edges), octaves)| {
                    self.within(patch, &edges, octaves, [most, kept.get(patch).copied().unwrap_or(0).into()])
                })
                .unzip();
            let rates = self.all.rates(&wanted);
            let is_within = self.all.expected_triangles(&rates) <= MAX_PATCHED;
            if is_within || most < MAX_LIVE_PATCH >> 8 {
                return (rates, coarser, !is_within || most < MAX_LIVE_PATCH);
            }
            most /= 4;
        }
    }

    /// The pieces of the edges of a patch, with at most so many triangles, and the steps that are left out for that.
    fn within(&self, patch: usize, edges: &EdgeRates<'_>, octaves: &[u16], [most, kept]: [u64; 2]) -> (Vec<u16>, u8) {
        let pieces = |coarser: u64| -> Vec<u16> {
            let coarser = i32::try_from(coarser).unwrap_or(i32::MAX);
            octaves.iter().map(|octave| small(edges.of_octave(i32::from(*octave) - coarser))).collect()
        };
        let count = |coarser: u64| self.all.own_triangles(patch, &pieces(coarser));
        let mut coarser = kept;
        while coarser > 0 && count(coarser - 1) <= most / 8 * ROOM_EIGHTHS {
            coarser -= 1;
        }
        while coarser < 16 && count(coarser) > most {
            coarser += 1;
        }
        (pieces(coarser), u8::try_from(coarser).unwrap_or(0))
    }
}

fn small(pieces: i32) -> u16 {
    u16::try_from(pieces).unwrap_or(1)
}

#[cfg(test)]
mod tests;
