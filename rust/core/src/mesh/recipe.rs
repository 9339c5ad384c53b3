// SPDX-License-Identifier: Apache-2.0
//! What a mesh is built from, where its assets are put, and how one is built again.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use xxhash_rust::xxh3::xxh3_128;

use super::build::{BuiltAsset, ClusterLimits, build_mesh_into};
use super::cover::SlotCovers;
use super::demand::{BuildDemand, SlotDisplacements};
use super::dicing::DicingRate;
use super::footprint::BuildFootprint;
use super::host_memory::HostMemory;
use super::store::MeshFiles;
use super::{MeshAsset, WantedPrimvar};
use crate::desc::MeshDesc;
use crate::texture::{HeightCache, HeightFiles};

/// Raised whenever a description is built to other bits than before, or they are stored otherwise: entries of other
/// versions are not found.
const VERSION: u32 = 6;

/// What a mesh is built from.
#[derive(Debug)]
pub(crate) struct MeshRecipe {
    pub(crate) desc: MeshDesc,
    pub(crate) wanted: Vec<WantedPrimvar>,
    pub(crate) dicing: DicingRate,
    pub(crate) displacements: SlotDisplacements,
    pub(crate) covers: SlotCovers,
    pub(crate) height_files: Option<Arc<dyn HeightFiles>>,
    /// [`super::mesh_key_with`] of all that.
    pub(crate) key: u128,
    /// A larger mesh is split.
    pub(crate) limit_bytes: u64,
    /// Into clusters of so many bytes.
    pub(crate) cluster_bytes: u64,
}

impl MeshRecipe {
    fn demand(&self) -> BuildDemand<'_> {
        let Self { wanted, dicing, displacements, covers, .. } = self;
        BuildDemand { wanted, dicing: Some(dicing), displacements, covers, heights: None }
    }

    /// The mesh, and its clusters to `put`, of which `at_once` are made side by side.
    pub(super) fn build(&self, heights: &HeightCache, at_once: usize, put: &mut dyn FnMut(MeshAsset)) -> BuiltAsset {
        let demand = BuildDemand { heights: Some(heights), ..self.demand() };
        let cuts = ClusterLimits { limit_bytes: self.limit_bytes, cluster_bytes: self.cluster_bytes, at_once };
        build_mesh_into(&self.desc, &demand, self.key, cuts, put)
    }

    /// What building takes.
    pub(crate) fn footprint(&self) -> BuildFootprint {
        BuildFootprint::of(&self.desc, &self.demand(), self.limit_bytes, self.cluster_bytes)
    }

    /// What tells its entry in files; none where it depends on more than the description: the textures of displacements
    /// may have changed when another process reads it.
    pub(super) fn entry_key(&self) -> Option<u128> {
        let words = [VERSION.into(), self.key, self.limit_bytes.into(), self.cluster_bytes.into()];
        (!self.demand().displaces(&self.desc)).then(|| xxh3_128(bytemuck::cast_slice::<u128, u8>(&words)))
    }
}

/// Where assets are put.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeshStorage {
    pub(crate) memory: Arc<HostMemory>,
    pub(crate) files: Option<Arc<dyn MeshFiles>>,
    /// The last read failed, all tries of it.
    pub(crate) is_unreadable: Arc<AtomicBool>,
}
