// SPDX-License-Identifier: Apache-2.0
//! The store of mesh assets shared by content.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::entries::MeshEntry;
use crate::mesh::{Dicing, KeptMesh, Recipe, SceneMesh, Shelf, mesh_key_with};
use crate::partition::PartitionOptions;
use crate::texture::Heights;

/// Assets by content hash, and their indices in the snapshots.
#[derive(Debug, Default)]
pub(crate) struct MeshStore {
    built: FxHashMap<u128, Arc<KeptMesh>>,
    /// Content hash at each mesh index of the last snapshot.
    slots: Vec<u128>,
    /// What `built` was made for.
    options: PartitionOptions,
    /// Where assets are put.
    pub(crate) shelf: Shelf,
}

impl MeshStore {
    /// Forgets the assets that would not be built like that with `options`: those in pieces, and large ones.
    pub(crate) fn set_options(&mut self, meshes: &mut BTreeMap<Arc<str>, MeshEntry>, options: PartitionOptions) {
        if std::mem::replace(&mut self.options, options) == options {
            return;
        }
        // Splitting goes by expected bytes, which are within a fifth of the real ones.
        let stays = |b: &KeptMesh| {
            let bytes = b.asset.as_ref().map_or(0, |a| a.device_bytes());
            b.clusters.is_empty() && bytes < options.mesh_limit() / 2
        };
        self.built.retain(|_, built| stays(built));
        for entry in meshes.values_mut() {
            entry.built = entry.built.take().filter(|built| stays(built));
        }
    }

    /// Makes sure that every mesh of `wanted` is built, subdivision surfaces cut as `cuts` says and displaced by
    /// `heights`, the missing ones in parallel.
    pub(crate) fn build(
        &mut self,
        meshes: &mut BTreeMap<Arc<str>, MeshEntry>,
        wanted: &FxHashSet<Arc<str>>,
        mut cuts: FxHashMap<Arc<str>, Dicing>,
        heights: &Heights,
    ) {
        for (path, entry) in meshes.iter_mut() {
            let dicing = cuts.remove(path).unwrap_or_default();
            if entry.dicing != dicing {
                entry.dicing = dicing;
                entry.built = None;
            }
        }
        let (limit, cluster) = (self.options.mesh_limit(), self.options.chunk_bytes());
        let build = |key, entry: &MeshEntry| {
            let recipe = Recipe {
                desc: entry.desc.clone(),
                wanted: entry.wanted.clone(),
                dicing: entry.dicing.clone(),
                displacements: entry.displacements.clone(),
                height_files: heights.files().cloned(),
                key,
                limit_bytes: limit,
                cluster_bytes: cluster,
            };
            Arc::new(KeptMesh::make(recipe, heights, &self.shelf))
        };
        let mut missing: Vec<&mut MeshEntry> =
            meshes.iter_mut().filter(|(path, e)| e.built.is_none() && wanted.contains(*path)).map(|(_, e)| e).collect();
        let keys: Vec<u128> = missing.par_iter().map(|e| mesh_key_with(&e.desc, &e.demand())).collect();
        let mut begun: FxHashSet<u128> = FxHashSet::default();
        let new: Vec<(u128, &MeshEntry)> = keys
            .iter()
            .zip(&missing)
            .filter(|(key, _)| !self.built.contains_key(key) && begun.insert(**key))
            .map(|(key, entry)| (*key, &**entry))
            .collect();
        let built: Vec<(u128, Arc<KeptMesh>)> =
            new.into_par_iter().with_max_len(1).map(|(key, e)| (key, build(key, e))).collect();
        self.built.extend(built);
        for (key, entry) in keys.iter().zip(&mut missing) {
            entry.built = self.built.get(key).cloned();
        }
    }

    /// Assigns mesh indices to the assets in use, moving as few as possible: freed indices go to new assets first, then
    /// to the last ones. Gives the assets by index, and the index of each content hash.
    pub(crate) fn assign(&mut self, used: &[u128]) -> (Vec<Arc<SceneMesh>>, FxHashMap<u128, u32>) {
        let in_use: FxHashSet<u128> = used.iter().copied().collect();
        let known: FxHashSet<u128> = self.slots.iter().copied().filter(|k| in_use.contains(k)).collect();
        let mut seen = known.clone();
        let mut new = used.iter().copied().filter(|k| seen.insert(*k));
        let mut at = 0;
        while at < self.slots.len() {
            if in_use.contains(&self.slots[at]) {
                at += 1;
            } else if let Some(key) = new.next() {
                self.slots[at] = key;
                at += 1;
            } else {
                self.slots.swap_remove(at);
            }
        }
        self.slots.extend(new);
        let mut clusters: FxHashMap<u128, &Arc<SceneMesh>> = FxHashMap::default();
        #[expect(clippy::iter_over_hash_type, reason = "from one map to another")]
        for built in self.built.values() {
            clusters.extend(built.clusters.iter().map(|c| (c.key, c)));
        }
        let asset = |key: &u128| {
            let whole = self.built.get(key).and_then(|b| b.asset.as_ref());
            whole.or_else(|| clusters.get(key).copied()).cloned()
        };
        // Every used hash comes from a built asset, so no slot is lost here.
        let assets: Vec<_> = self.slots.iter().filter_map(asset).collect();
        let indices = assets.iter().zip(0..).map(|(asset, index)| (asset.key, index)).collect();
        (assets, indices)
    }

    /// Forgets assets that no prim has any more.
    pub(crate) fn forget_unused(&mut self) {
        self.built.retain(|_, built| Arc::strong_count(built) > 1);
    }
}
