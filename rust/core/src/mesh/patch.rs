// SPDX-License-Identifier: Apache-2.0
//! One patch of a mesh, with the rates of its edges: what a recipe needs to refine it. Pure.

use std::sync::Arc;

use oocpt_subdiv::{LimitSurface, MAX_RATE};
use rustc_hash::FxHashMap;
use xxhash_rust::xxh3::Xxh3;

use super::cage::SubdivisionCage;
use super::demand::BuildDemand;
use super::patch_desc::PatchDesc;
use super::patches::{MeshPatches, RINGS};
use super::topology::MeshTopology;
use crate::desc::MeshDesc;

/// A patch that is refined with given rates. Equal meshes, numbers and rates are equal content, whatever camera the
/// rates come from.
#[derive(Clone, Debug)]
pub(crate) struct MeshPatch {
    all: Arc<MeshPatches>,
    number: usize,
    /// Faces up to this ring are cut.
    ring: u8,
    /// Pieces of the edges at the corners of these faces, face by face.
    rates: Vec<u16>,
}

/// Size of a patch, for the estimate of the memory that it takes.
pub(super) struct PatchSize {
    pub(super) faces: u64,
    pub(super) corners: u64,
    /// Triangles, rings included.
    pub(super) triangles: u64,
}

impl MeshPatch {
    /// Patch `number` of a mesh whose edges have these rates.
    pub(crate) fn new(all: &Arc<MeshPatches>, number: usize, displaces: bool, rates: &[u16]) -> Self {
        let ring = if displaces { RINGS - 1 } else { 1 };
        Self { all: all.clone(), number, ring, rates: all.rates_at(number, ring, rates) }
    }

    /// Adds everything that tells it from other patches of the same mesh to the hash.
    pub(crate) fn hash(&self, hasher: &mut Xxh3) {
        hasher.update(b"patch");
        hasher.update(&(self.number as u64).to_le_bytes());
        hasher.update(bytemuck::cast_slice(&self.rates));
    }

    /// It and its rings as a mesh.
    pub(super) fn take(&self, desc: &MeshDesc, demand: &BuildDemand<'_>) -> Option<PatchDesc> {
        PatchDesc::take(desc, demand, &self.all, self.number, self.ring)
    }

    pub(super) fn size(&self) -> PatchSize {
        let mut size = PatchSize { faces: 0, corners: 0, triangles: 0 };
        let mut rates = self.rates.iter().map(|rate| u64::from(*rate));
        let Some(patch) = self.all.patches.get(self.number) else { return size };
        for face in patch.within(self.ring + 1) {
            size.faces += 1;
            size.corners += self.all.corners(face).1.len() as u64;
        }
        for face in patch.within(self.ring) {
            let corners = self.all.corners(face).1.len();
            let most = rates.by_ref().take(corners).max().unwrap_or(1);
            // As in `super::footprint`: faces with other than four corners are first cut at their middles.
            let of_face = match corners {
                4 => 2 * most * most,
                _ => 2 * corners as u64 * most.div_ceil(2) * most.div_ceil(2),
            };
            size.triangles = size.triangles.saturating_add(of_face + 4 * most);
        }
        size
    }
}

/// A patch that has been taken out of its mesh.
#[derive(Clone, Copy)]
pub(super) struct TakenPatch<'a> {
    pub(super) patch: &'a MeshPatch,
    /// The ring of each face.
    pub(super) rings: &'a [u8],
}

impl TakenPatch<'_> {
    /// The number of pieces of each edge of `surface`.
    pub(super) fn rates(&self, surface: &LimitSurface, topology: &MeshTopology, cage: &SubdivisionCage) -> Vec<i32> {
        let mut by_ends: FxHashMap<[u32; 2], i32> = FxHashMap::default();
        let mut most = vec![1; self.rings.len()];
        let mut rates = self.patch.rates.iter().map(|rate| i32::from(*rate));
        for face in &topology.faces {
            let at = face.index as usize;
            if self.rings.get(at).is_none_or(|ring| *ring > self.patch.ring) {
                continue;
            }
            let corners = topology.face_corners(face);
            let next = corners.iter().cycle().skip(1);
            for ((a, b), rate) in corners.iter().zip(next).zip(rates.by_ref()) {
                by_ends.insert(ends(*a, *b), rate);
                most.iter_mut().skip(at).take(1).for_each(|most| *most = rate.max(*most));
            }
        }
        // The diagonals of faces that are triangulated: no longer than half of the outline.
        let mut first = 0;
        for (&count, &face) in cage.counts.iter().zip(&cage.faces) {
            let count = usize::try_from(count).unwrap_or(0);
            let points = cage.points.get(first..first + count).unwrap_or_default();
            first += count;
            let authored = topology.faces.get(face as usize).map_or(4, |face| i32::try_from(face.count).unwrap_or(4));
            let rate = most.get(face as usize).map_or(1, |most| (most * ((authored + 1) / 2)).min(MAX_RATE));
            for (a, b) in points.iter().zip(points.iter().cycle().skip(1)) {
                by_ends.entry(ends(a.cast_unsigned(), b.cast_unsigned())).or_insert(rate);
            }
        }
        let rate = |[a, b]: &[i32; 2]| by_ends.get(&ends(a.cast_unsigned(), b.cast_unsigned())).copied().unwrap_or(1);
        surface.edges().iter().map(rate).collect()
    }

    /// Leaves the patch's own faces alone.
    pub(super) fn keep_own(&self, topology: &mut MeshTopology) {
        topology.faces.retain(|face| self.rings.get(face.index as usize) == Some(&0));
    }
}

fn ends(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}
