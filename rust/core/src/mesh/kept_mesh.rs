// SPDX-License-Identifier: Apache-2.0
//! Builds meshes and stores them: in host memory while there is room, else in files. A mesh that an earlier process has
//! left in persistent files is loaded instead of built.
//!
//! In files a whole mesh is one entry with one payload. A mesh in clusters has one entry for each cluster, written as
//! soon as the cluster is built, and a last entry without payload whose head describes all of them.

use std::sync::{Arc, OnceLock};

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_128;

use super::MeshAsset;
use super::build::BuiltAsset;
use super::host_memory::{HeldMemory, ReservedMemory};
use super::payload::{parts, payload_bytes, ptex_words};
use super::recipe::{MeshRecipe, MeshStorage};
use super::refit::MeshRefit;
use super::scene_mesh::{SceneMesh, StoredAsset};
use super::store::{MeshFiles, PayloadError, PayloadSource};
use super::summary::MeshSummary;
use crate::desc::DroppedData;
use crate::texture::HeightCache;

/// Key of the entry of a cluster of the mesh with this key.
fn cluster_key(key: u128, index: usize) -> u128 {
    xxh3_128(bytemuck::cast_slice::<u128, u8>(&[key, index as u128]))
}

/// The files in which a later process finds the mesh, and its key there; none if the files or the key do not last.
fn persistent_entry<'a>(recipe: &MeshRecipe, storage: &'a MeshStorage) -> Option<(&'a Arc<dyn MeshFiles>, u128)> {
    let files = storage.files.as_ref().filter(|files| files.is_persistent())?;
    Some((files, recipe.entry_key()?))
}

/// The resources that a build may take.
#[derive(Debug)]
pub(crate) struct BuildGrant {
    /// Host memory; none without a budget.
    pub(crate) reserved: Option<ReservedMemory>,
    /// Clusters that it may build in parallel.
    pub(crate) at_once: usize,
}

/// The head of an entry, which is read with it; the payload is read when the mesh is needed.
#[derive(Debug, Serialize, Deserialize)]
struct EntryHead {
    is_split: bool,
    meshes: Vec<MeshSummary>,
    dropped: DroppedData,
    notes: Vec<String>,
}

/// A built mesh whose assets are stored.
#[derive(Debug)]
pub(crate) struct KeptMesh {
    /// The whole mesh; none if it is in clusters or left out.
    pub(crate) asset: Option<Arc<SceneMesh>>,
    pub(crate) clusters: Vec<Arc<SceneMesh>>,
    pub(crate) dropped: DroppedData,
    pub(crate) notes: Vec<String>,
    /// The mesh was not built because it needs more than the host budget.
    pub(crate) is_left_out: bool,
    /// The patches that its clusters come from, and the content that they are patches of.
    patches: Option<(u128, Vec<Arc<Self>>)>,
    /// Of a mesh that deforms in a live scene.
    pub(crate) refit: Option<MeshRefit>,
}

impl KeptMesh {
    /// Loads the mesh from persistent files, if they have it. A damaged entry is reported and counts as absent.
    pub(crate) fn find(recipe: &Arc<MeshRecipe>, storage: &MeshStorage) -> Option<Self> {
        let (files, key) = persistent_entry(recipe, storage)?;
        match Self::load(&**files, recipe, storage, key) {
            Ok(mesh) => mesh,
            Err(error) => {
                files.damaged(Some(key), &error);
                None
            }
        }
    }

    /// Builds a mesh and stores it. `refit`: of a mesh that deforms; it must not be stored in files, where the same
    /// recipe stands for a mesh that is built.
    pub(crate) fn build(
        recipe: &Arc<MeshRecipe>,
        heights: &HeightCache,
        storage: &MeshStorage,
        (grant, mut refit): (BuildGrant, Option<MeshRefit>),
    ) -> Self {
        let entry = persistent_entry(recipe, storage);
        let key = entry.map(|(_, key)| key);
        let BuildGrant { mut reserved, at_once } = grant;
        let writer = AssetWriter { recipe, storage };
        let mut clusters = Vec::new();
        let mut put = |cluster: MeshAsset| {
            let index = clusters.len();
            let key = key.map(|key| cluster_key(key, index));
            let held = storage.memory.try_hold(cluster.host_bytes());
            clusters.push(writer.put(cluster, index, key, &[], held));
        };
        let BuiltAsset { asset, dropped, notes } = recipe.build(heights, at_once, refit.as_mut(), &mut put);
        let is_split = asset.is_none();
        let meshes = match &asset {
            Some(asset) => vec![MeshSummary::of(asset)],
            None => clusters.iter().map(|cluster| MeshSummary::clone(cluster)).collect(),
        };
        // A mesh whose head cannot be written has no entry that a later process would find and call damaged.
        let head = || postcard::to_allocvec(&EntryHead { is_split, meshes, dropped, notes: notes.clone() }).ok();
        let (key, head) = key.and_then(|key| Some((key, head()?))).unzip();
        let head = head.unwrap_or_default();
        let asset = asset.map(|asset| {
            let bytes = asset.host_bytes();
            let held =
                reserved.as_mut().map_or_else(|| storage.memory.try_hold(bytes), |reserved| reserved.keep(bytes));
            writer.put(asset, 0, key, &head, held)
        });
        if let Some((files, _)) = entry.filter(|_| is_split && key.is_some()) {
            files.add(key, &head, &[]);
        }
        Self { asset, clusters, dropped, notes, is_left_out: false, patches: None, refit }
    }

    /// A mesh in patches, which are its clusters. `content`: hash of the mesh; `is_coarse`: its rates are not what was
    /// asked for.
    pub(crate) fn of_patches(content: u128, patches: Vec<Arc<Self>>, is_coarse: bool) -> Self {
        let all = || patches.iter();
        let clusters: Vec<_> = all().flat_map(|patch| patch.asset.iter().chain(&patch.clusters)).cloned().collect();
        let mut dropped = DroppedData::default();
        all().for_each(|patch| dropped.add(&patch.dropped));
        // It is one mesh, and one of which some patches are holes is not empty.
        dropped.empty_meshes = u64::from(clusters.is_empty());
        dropped.unrefined_meshes = dropped.unrefined_meshes.min(1);
        dropped.coarse_meshes = u64::from(is_coarse);
        let mut notes: Vec<String> = all().flat_map(|patch| &patch.notes).cloned().collect();
        notes.sort();
        notes.dedup();
        let is_left_out = all().any(|patch| patch.is_left_out);
        Self { asset: None, clusters, dropped, notes, is_left_out, patches: Some((content, patches)), refit: None }
    }

    /// Names the group of its clusters: the mesh that patches are of, whatever their rates are, or else the first
    /// cluster.
    pub(crate) fn group(&self) -> Option<u128> {
        let content = self.patches.as_ref().map(|(content, _)| *content);
        self.clusters.first().map(|first| content.unwrap_or(first.key))
    }

    /// Stands for a mesh that is not built; `reason` is shown to the user.
    pub(crate) fn left_out(reason: String) -> Self {
        let notes = vec![reason];
        Self {
            asset: None,
            clusters: Vec::new(),
            dropped: DroppedData::default(),
            notes,
            is_left_out: true,
            patches: None,
            refit: None,
        }
    }

    /// The mesh under `key` in the files, if it is complete. Fails if its entry contradicts itself.
    fn load(
        files: &dyn MeshFiles,
        recipe: &Arc<MeshRecipe>,
        storage: &MeshStorage,
        key: u128,
    ) -> Result<Option<Self>, PayloadError> {
        let Some(entry) = files.find(key) else { return Ok(None) };
        let head: EntryHead = postcard::from_bytes(&entry.head).ok().ok_or(PayloadError::Damaged)?;
        let EntryHead { is_split, meshes, dropped, notes } = head;
        let mut payloads = entry.payloads;
        if is_split {
            for index in 0..meshes.len() {
                // The cluster may have gone to another file than this entry, one that was deleted.
                let Some(cluster) = files.find(cluster_key(key, index)) else { return Ok(None) };
                payloads.extend(cluster.payloads);
            }
        }
        let has_size =
            |(mesh, payload): (&MeshSummary, &Arc<dyn PayloadSource>)| payload_bytes(mesh) == Some(payload.size());
        if meshes.len() != payloads.len()
            || (!is_split && meshes.len() != 1)
            || !meshes.iter().zip(&payloads).all(has_size)
        {
            return Err(PayloadError::Damaged);
        }
        let mesh = |(index, (summary, payload)): (usize, (MeshSummary, Arc<dyn PayloadSource>))| {
            let key = if is_split { cluster_key(key, index) } else { key };
            let stored = Some(StoredAsset::new(payload, index, Some(key), recipe, storage));
            Arc::new(SceneMesh { summary, host: OnceLock::new(), stored })
        };
        let mut meshes: Vec<_> = meshes.into_iter().zip(payloads).enumerate().map(mesh).collect();
        let asset = if is_split { None } else { meshes.pop() };
        Ok(Some(Self { asset, clusters: meshes, dropped, notes, is_left_out: false, patches: None, refit: None }))
    }
}

/// Stores the assets of a recipe.
struct AssetWriter<'a> {
    recipe: &'a Arc<MeshRecipe>,
    storage: &'a MeshStorage,
}

impl AssetWriter<'_> {
    /// Stores an asset. It stays in host memory if memory is `held` for it or no file takes it. It is written to a file
    /// if no memory is held, and in any case to persistent files.
    fn put(
        &self,
        asset: MeshAsset,
        index: usize,
        key: Option<u128>,
        head: &[u8],
        held: Option<HeldMemory>,
    ) -> Arc<SceneMesh> {
        let Self { recipe, storage } = *self;
        let summary = MeshSummary::of(&asset);
        let files = storage.files.as_ref().filter(|files| files.is_persistent() || held.is_none());
        let stored = files.and_then(|files| {
            let ptex = ptex_words(&asset);
            let mut payloads = files.add(key, head, &[parts(&asset, &ptex)])?;
            payloads.pop().map(|payload| StoredAsset::new(payload, index, key, recipe, storage))
        });
        let host = OnceLock::new();
        if held.is_some() || stored.is_none() {
            let held = held.unwrap_or_else(|| storage.memory.hold(asset.host_bytes()));
            host.get_or_init(|| (Arc::new(asset), held));
        }
        Arc::new(SceneMesh { summary, host, stored })
    }
}
