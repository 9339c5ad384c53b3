// SPDX-License-Identifier: Apache-2.0
//! The recipe of a mesh and the storage of its assets: with both, a mesh is built, and built again.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use xxhash_rust::xxh3::xxh3_128;

use super::build::{BuiltAsset, ClusterLimits, build_mesh_into, build_patch_into};
use super::cover::SlotCovers;
use super::demand::{BuildDemand, SlotDisplacements};
use super::dicing::DicingRate;
use super::footprint::BuildFootprint;
use super::host_memory::HostMemory;
use super::patch::MeshPatch;
use super::refit::MeshRefit;
use super::store::MeshFiles;
use super::{MeshAsset, WantedPrimvar};
use crate::desc::MeshDesc;
use crate::texture::{HeightCache, HeightFiles};

/// Part of the keys of entries. Raise it when a mesh is built to other bits or stored in another way: entries of older
/// versions are then not found.
const FORMAT_VERSION: u32 = 6;

/// What a mesh is built from.
#[derive(Debug)]
pub(crate) struct MeshRecipe {
    pub(crate) desc: MeshDesc,
    pub(crate) wanted: Vec<WantedPrimvar>,
    pub(crate) dicing: DicingRate,
    pub(crate) displacements: SlotDisplacements,
    pub(crate) covers: SlotCovers,
    pub(crate) height_files: Option<Arc<dyn HeightFiles>>,
    /// The part of the mesh that is built; `None`: all of it.
    pub(crate) patch: Option<MeshPatch>,
    /// [`super::mesh_key_with`] of the fields above.
    pub(crate) key: u128,
    /// A mesh of more bytes on the device is split into clusters.
    pub(crate) limit_bytes: u64,
    /// Bytes of a cluster on the device.
    pub(crate) cluster_bytes: u64,
}

impl MeshRecipe {
    fn demand(&self) -> BuildDemand<'_> {
        let Self { wanted, dicing, displacements, covers, .. } = self;
        BuildDemand { wanted, dicing: Some(dicing), displacements, covers, heights: None }
    }

    /// Builds the mesh. One that is split gives its clusters to `put`, `at_once` of them built in parallel.
    /// `refit`: of a mesh that deforms.
    pub(super) fn build(
        &self,
        heights: &HeightCache,
        at_once: usize,
        refit: Option<&mut MeshRefit>,
        put: &mut dyn FnMut(MeshAsset),
    ) -> BuiltAsset {
        let demand = BuildDemand { heights: Some(heights), ..self.demand() };
        let limits = ClusterLimits { limit_bytes: self.limit_bytes, cluster_bytes: self.cluster_bytes, at_once };
        match &self.patch {
            Some(patch) => build_patch_into((&self.desc, patch), &demand, self.key, limits, put),
            None => build_mesh_into(&self.desc, &demand, self.key, limits, (refit, put)),
        }
    }

    /// The host memory that building takes.
    pub(crate) fn footprint(&self) -> BuildFootprint {
        let (demand, limits) = (self.demand(), [self.limit_bytes, self.cluster_bytes]);
        match &self.patch {
            Some(patch) => BuildFootprint::of_patch(&self.desc, &demand, patch, limits),
            None => BuildFootprint::of(&self.desc, &demand, self.limit_bytes, self.cluster_bytes),
        }
    }

    /// Key of its entry in files; none for a displaced mesh: the key covers the description alone, and the textures may
    /// have changed when another process reads the entry.
    pub(super) fn entry_key(&self) -> Option<u128> {
        let words = [FORMAT_VERSION.into(), self.key, self.limit_bytes.into(), self.cluster_bytes.into()];
        (!self.demand().displaces(&self.desc)).then(|| xxh3_128(bytemuck::cast_slice::<u128, u8>(&words)))
    }
}

/// Where assets are stored.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeshStorage {
    pub(crate) memory: Arc<HostMemory>,
    pub(crate) files: Option<Arc<dyn MeshFiles>>,
    /// The last read failed with all its retries, so that the next one fails without waiting.
    pub(crate) is_unreadable: Arc<AtomicBool>,
}
