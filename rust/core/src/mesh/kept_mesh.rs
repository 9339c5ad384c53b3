// SPDX-License-Identifier: Apache-2.0
//! How meshes are built and put away: in memory as far as it goes, else in files; those that files have from before are
//! found there.
//!
//! A mesh is an entry with one payload. One in clusters is an entry for each cluster, written as soon as that is made,
//! and an entry without payloads that sums them up.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_128;

use super::build::{BuiltAsset, ClusterLimits, build_mesh_into};
use super::cover::SlotCovers;
use super::demand::{BuildDemand, SlotDisplacements};
use super::dicing::DicingRate;
use super::footprint::BuildFootprint;
use super::host_memory::{HeldMemory, HostMemory, ReservedMemory};
use super::payload::{parts, payload_bytes, ptex_words};
use super::scene_mesh::{SceneMesh, StoredAsset};
use super::store::{MeshFiles, PayloadError, PayloadSource};
use super::summary::MeshSummary;
use super::{MeshAsset, WantedPrimvar};
use crate::desc::{DroppedData, MeshDesc};
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
    fn entry_key(&self) -> Option<u128> {
        let words = [VERSION.into(), self.key, self.limit_bytes.into(), self.cluster_bytes.into()];
        (!self.demand().displaces(&self.desc)).then(|| xxh3_128(bytemuck::cast_slice::<u128, u8>(&words)))
    }
}

/// What tells the entry of a cluster of the mesh with this key.
fn cluster_key(key: u128, number: usize) -> u128 {
    xxh3_128(bytemuck::cast_slice::<u128, u8>(&[key, number as u128]))
}

/// The files that a mesh is found in again, and what tells its entry there; none where it is not.
fn lasting<'a>(recipe: &MeshRecipe, shelf: &'a MeshStorage) -> Option<(&'a Arc<dyn MeshFiles>, u128)> {
    let files = shelf.files.as_ref().filter(|files| files.lasts())?;
    Some((files, recipe.entry_key()?))
}

/// Where assets are put.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeshStorage {
    pub(crate) memory: Arc<HostMemory>,
    pub(crate) files: Option<Arc<dyn MeshFiles>>,
    /// The last read failed, all tries of it.
    pub(crate) is_unreadable: Arc<AtomicBool>,
}

/// What a build may take.
#[derive(Debug)]
pub(crate) struct BuildGrant {
    /// Host memory; none where there is no budget.
    pub(crate) reserved: Option<ReservedMemory>,
    /// Clusters that it may make side by side.
    pub(crate) at_once: usize,
}

/// The head of an entry.
#[derive(Debug, Serialize, Deserialize)]
struct EntryHead {
    is_split: bool,
    meshes: Vec<MeshSummary>,
    dropped: DroppedData,
    notes: Vec<String>,
}

/// A built mesh whose assets are put away.
#[derive(Debug)]
pub(crate) struct KeptMesh {
    pub(crate) asset: Option<Arc<SceneMesh>>,
    pub(crate) clusters: Vec<Arc<SceneMesh>>,
    pub(crate) dropped: DroppedData,
    pub(crate) notes: Vec<String>,
    /// It was not built, for want of host memory.
    pub(crate) is_left_out: bool,
}

impl KeptMesh {
    /// The mesh as files have it from before.
    pub(crate) fn find(recipe: &Arc<MeshRecipe>, shelf: &MeshStorage) -> Option<Self> {
        let (files, key) = lasting(recipe, shelf)?;
        match Self::found(&**files, recipe, shelf, key) {
            Ok(found) => found,
            Err(error) => {
                files.damaged(Some(key), &error);
                None
            }
        }
    }

    /// Builds a mesh and puts it away.
    pub(crate) fn make(
        recipe: &Arc<MeshRecipe>,
        heights: &HeightCache,
        shelf: &MeshStorage,
        grant: BuildGrant,
    ) -> Self {
        let lasting = lasting(recipe, shelf);
        let key = lasting.map(|(_, key)| key);
        let BuildGrant { mut reserved, at_once } = grant;
        let putting = AssetWriter { recipe, shelf };
        let mut clusters = Vec::new();
        let mut put = |cluster: MeshAsset| {
            let number = clusters.len();
            let key = key.map(|key| cluster_key(key, number));
            let held = shelf.memory.try_hold(cluster.host_bytes());
            clusters.push(putting.put(cluster, number, key, &[], held));
        };
        let BuiltAsset { asset, dropped, notes } = recipe.build(heights, at_once, &mut put);
        let is_split = asset.is_none();
        let meshes = match &asset {
            Some(asset) => vec![MeshSummary::of(asset)],
            None => clusters.iter().map(|cluster| MeshSummary::clone(cluster)).collect(),
        };
        let head = || postcard::to_allocvec(&EntryHead { is_split, meshes, dropped, notes: notes.clone() });
        let head = key.and_then(|_| head().ok()).unwrap_or_default();
        let asset = asset.map(|asset| {
            let bytes = asset.host_bytes();
            let held = reserved.as_mut().map_or_else(|| shelf.memory.try_hold(bytes), |reserved| reserved.keep(bytes));
            putting.put(asset, 0, key, &head, held)
        });
        if let Some((files, key)) = lasting.filter(|_| is_split) {
            files.add(Some(key), &head, &[]);
        }
        Self { asset, clusters, dropped, notes, is_left_out: false }
    }

    /// A mesh that is not built, and why.
    pub(crate) fn left_out(why: String) -> Self {
        let notes = vec![why];
        Self { asset: None, clusters: Vec::new(), dropped: DroppedData::default(), notes, is_left_out: true }
    }

    /// The mesh that files have of a recipe, if they do. An error where an entry makes no sense.
    fn found(
        files: &dyn MeshFiles,
        recipe: &Arc<MeshRecipe>,
        shelf: &MeshStorage,
        key: u128,
    ) -> Result<Option<Self>, PayloadError> {
        let Some(entry) = files.find(key) else { return Ok(None) };
        let head: EntryHead = postcard::from_bytes(&entry.head).ok().ok_or(PayloadError::Damaged)?;
        let EntryHead { is_split, meshes, dropped, notes } = head;
        let mut payloads = entry.payloads;
        if is_split {
            for number in 0..meshes.len() {
                // They may have gone to another file than this entry, one that did not last.
                let Some(cluster) = files.find(cluster_key(key, number)) else { return Ok(None) };
                payloads.extend(cluster.payloads);
            }
        }
        let fits =
            |(mesh, payload): (&MeshSummary, &Arc<dyn PayloadSource>)| payload_bytes(mesh) == Some(payload.size());
        if meshes.len() != payloads.len() || (!is_split && meshes.len() != 1) || !meshes.iter().zip(&payloads).all(fits)
        {
            return Err(PayloadError::Damaged);
        }
        let mesh = |(number, (summary, payload)): (usize, (MeshSummary, Arc<dyn PayloadSource>))| {
            let key = if is_split { cluster_key(key, number) } else { key };
            let stored = Some(StoredAsset::new(payload, number, Some(key), recipe, shelf));
            Arc::new(SceneMesh { summary, host: OnceLock::new(), stored })
        };
        let mut meshes: Vec<_> = meshes.into_iter().zip(payloads).enumerate().map(mesh).collect();
        let asset = if is_split { None } else { meshes.pop() };
        Ok(Some(Self { asset, clusters: meshes, dropped, notes, is_left_out: false }))
    }
}

/// Puts assets of a recipe away.
struct AssetWriter<'a> {
    recipe: &'a Arc<MeshRecipe>,
    shelf: &'a MeshStorage,
}

impl AssetWriter<'_> {
    /// Keeps an asset in memory if there is some for it, else in a file; without a file it stays in memory. With a key
    /// it goes to a file in any case.
    fn put(
        &self,
        asset: MeshAsset,
        number: usize,
        key: Option<u128>,
        head: &[u8],
        held: Option<HeldMemory>,
    ) -> Arc<SceneMesh> {
        let Self { recipe, shelf } = *self;
        let summary = MeshSummary::of(&asset);
        let files = shelf.files.as_ref().filter(|files| files.lasts() || held.is_none());
        let stored = files.and_then(|files| {
            let ptex = ptex_words(&asset);
            let mut payloads = files.add(key, head, &[parts(&asset, &ptex)])?;
            payloads.pop().map(|payload| StoredAsset::new(payload, number, key, recipe, shelf))
        });
        let host = OnceLock::new();
        if held.is_some() || stored.is_none() {
            let held = held.unwrap_or_else(|| shelf.memory.hold(asset.host_bytes()));
            host.get_or_init(|| (Arc::new(asset), held));
        }
        Arc::new(SceneMesh { summary, host, stored })
    }
}
