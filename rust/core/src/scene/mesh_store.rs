// SPDX-License-Identifier: Apache-2.0
//! The store of mesh assets shared by content.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::admission::run_within;
use super::cover_store::CoverStore;
use super::entries::MeshEntry;
use crate::mesh::{
    BuildDemand, BuildFootprint, BuildGrant, CutoutCover, DicingRate, KeptMesh, MeshRecipe, MeshStorage, SceneMesh,
    SlotCovers, mesh_key_with, too_large,
};
use crate::partition::PartitionOptions;
use crate::texture::HeightCache;

/// Clusters that are put away together, for each thread: fewer, and threads would wait for each other.
const BATCHES: usize = 4;

/// A mesh that is to be built.
#[derive(Clone, Copy)]
struct NewMesh<'a> {
    key: u128,
    entry: &'a MeshEntry,
    covers: &'a [Option<CutoutCover>],
}

/// Assets by content hash, and their indices in the snapshots.
#[derive(Debug, Default)]
pub(crate) struct MeshStore {
    built: FxHashMap<u128, Arc<KeptMesh>>,
    /// Content hash at each mesh index of the last snapshot.
    slots: Vec<u128>,
    /// What `built` was made for.
    options: PartitionOptions,
    /// Meshes that were built or found in files so far.
    pub(crate) made: u64,
    /// Where assets are put.
    pub(crate) shelf: MeshStorage,
    /// Images that cut meshes out.
    pub(crate) covers: CoverStore,
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
        mut cuts: FxHashMap<Arc<str>, DicingRate>,
        heights: &HeightCache,
    ) {
        // The budget may be another one now.
        self.built.retain(|_, built| !built.is_left_out);
        for (path, entry) in meshes.iter_mut() {
            let dicing = cuts.remove(path).unwrap_or_default();
            if entry.dicing != dicing || entry.is_left_out() {
                entry.dicing = dicing;
                entry.built = None;
            }
        }
        let mut missing: Vec<&mut MeshEntry> =
            meshes.iter_mut().filter(|(path, e)| e.built.is_none() && wanted.contains(*path)).map(|(_, e)| e).collect();
        self.covers.read(missing.iter().map(|entry| &entry.cutouts), heights.files());
        let covers: Vec<SlotCovers> = missing.iter().map(|entry| self.covers.of(&entry.cutouts)).collect();
        let demand = |entry: &'_ MeshEntry, covers: &'_ [Option<CutoutCover>]| {
            mesh_key_with(&entry.desc, &BuildDemand { covers, ..entry.demand() })
        };
        let keys: Vec<u128> = missing.par_iter().zip(&covers).map(|(entry, covers)| demand(entry, covers)).collect();
        let mut begun: FxHashSet<u128> = FxHashSet::default();
        let new: Vec<NewMesh<'_>> = keys
            .iter()
            .zip(missing.iter().zip(&covers))
            .filter(|(key, _)| !self.built.contains_key(key) && begun.insert(**key))
            .map(|(key, (entry, covers))| NewMesh { key: *key, entry, covers })
            .collect();
        self.made += new.len() as u64;
        let built = self.make(&new, heights);
        self.built.extend(built);
        for (key, entry) in keys.iter().zip(&mut missing) {
            entry.built = self.built.get(key).cloned();
        }
    }

    /// Finds meshes in files or builds them, side by side.
    fn make(&self, new: &[NewMesh<'_>], heights: &HeightCache) -> Vec<(u128, Arc<KeptMesh>)> {
        let (limit_bytes, cluster_bytes) = (self.options.mesh_limit(), self.options.chunk_bytes());
        let recipe = |NewMesh { key, entry, covers }: &NewMesh<'_>| {
            Arc::new(MeshRecipe {
                desc: entry.desc.clone(),
                wanted: entry.wanted.clone(),
                dicing: entry.dicing.clone(),
                displacements: entry.displacements.clone(),
                covers: covers.to_vec(),
                height_files: heights.files().cloned(),
                key: *key,
                limit_bytes,
                cluster_bytes,
            })
        };
        let find = |new| KeptMesh::find(&recipe(new), &self.shelf);
        let build = |new, grant| KeptMesh::make(&recipe(new), heights, &self.shelf, grant);
        let all = new.par_iter().with_max_len(1);
        let made: Vec<KeptMesh> = match self.shelf.memory.budget() {
            Some(budget) => {
                let found: Vec<Option<KeptMesh>> = all.map(find).collect();
                let footprint = |(new, found): (_, &Option<KeptMesh>)| match found {
                    Some(_) => BuildFootprint::default(),
                    None => recipe(new).footprint(),
                };
                let footprints: Vec<BuildFootprint> = new.par_iter().zip(&found).map(footprint).collect();
                self.build_within(budget, &footprints, found, |at, grant| Some(build(new.get(at)?, grant)))
            }
            None => {
                // Clusters are put away in batches: all of them together would take as much as the mesh itself.
                let at_once = BATCHES * rayon::current_num_threads();
                all.map(|new| find(new).unwrap_or_else(|| build(new, BuildGrant { reserved: None, at_once }))).collect()
            }
        };
        new.iter().zip(made).map(|(new, made)| (new.key, Arc::new(made))).collect()
    }

    /// Builds what was not found, side by side as far as there is room. What needs more than the budget is left out.
    fn build_within(
        &self,
        budget: u64,
        footprints: &[BuildFootprint],
        found: Vec<Option<KeptMesh>>,
        build: impl Fn(usize, BuildGrant) -> Option<KeptMesh> + Sync,
    ) -> Vec<KeptMesh> {
        let fits = |footprint: &BuildFootprint| footprint.least() <= budget;
        let missing = found.iter().zip(footprints).zip(0_usize..);
        let missing = missing.filter(|((found, footprint), _)| found.is_none() && fits(footprint));
        let (numbers, of_missing): (Vec<usize>, Vec<BuildFootprint>) = missing.map(|((_, f), at)| (at, *f)).unzip();
        let build = |at: usize, grant| numbers.get(at).and_then(|at| build(*at, grant));
        let built = run_within(&self.shelf.memory, &of_missing, build);
        let mut made = found;
        for (at, built) in numbers.iter().zip(built) {
            if let Some(slot) = made.get_mut(*at) {
                *slot = built.flatten();
            }
        }
        let left_out = |footprint: &BuildFootprint| KeptMesh::left_out(too_large(footprint.least(), budget));
        made.into_iter().zip(footprints).map(|(made, f)| made.unwrap_or_else(|| left_out(f))).collect()
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
