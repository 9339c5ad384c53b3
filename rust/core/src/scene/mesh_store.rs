// SPDX-License-Identifier: Apache-2.0
//! Stores mesh assets, shared by content.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use xxhash_rust::xxh3::{Xxh3, xxh3_128};

use super::admission::run_within;
use super::cover_store::CoverStore;
use super::entries::MeshEntry;
use super::surface_cut::SurfaceCut;
use crate::mesh::{
    BuildDemand, BuildFootprint, BuildGrant, CutoutCover, KeptMesh, MeshPatch, MeshRecipe, MeshRefit, MeshStorage,
    SceneMesh, SlotCovers, mesh_key_with, too_large,
};
use crate::partition::PartitionOptions;
use crate::texture::HeightCache;

/// Says whether meshes of these prims are no longer wanted while they are built: see [`super::SceneDb::commit_unless`].
pub(crate) type MootMeshes<'a> = dyn Fn(&[Arc<str>]) -> bool + Sync + 'a;

/// Number of clusters that are stored together, for each thread: with fewer, threads would wait for each other.
const BATCHES: usize = 4;

/// A mesh, or a patch of one, that is to be built.
#[derive(Clone)]
struct NewMesh<'a> {
    key: u128,
    entry: &'a MeshEntry,
    covers: &'a [Option<CutoutCover>],
    patch: Option<MeshPatch>,
    /// True if the mesh deforms: its shape is used and kept.
    refits: bool,
}

impl<'a> NewMesh<'a> {
    /// The parts of a prim: all of its mesh, or each of its patches.
    fn of(entry: &'a MeshEntry, covers: &'a [Option<CutoutCover>], refits: bool) -> Vec<Self> {
        let demand = BuildDemand { covers, ..entry.demand() };
        let Some(cuts) = &entry.cuts else {
            let (content, refits) = (mesh_key_with(&entry.desc, &demand), refits && entry.deforms);
            let shape = entry.shape.as_ref().filter(|_| refits);
            let key = shape.map_or(content, |shape| xxh3_128(bytemuck::cast_slice::<u128, u8>(&[content, shape.key])));
            return vec![NewMesh { key, entry, covers, patch: None, refits }];
        };
        let content = entry.outline().content;
        let part = |patch: MeshPatch| {
            let mut hasher = Xxh3::new();
            hasher.update(&content.to_le_bytes());
            demand.hash_covers(&mut hasher);
            patch.hash(&mut hasher);
            NewMesh { key: hasher.digest128(), entry, covers, patch: Some(patch), refits: false }
        };
        cuts.patches(demand.displaces(&entry.desc)).map(part).collect()
    }
}

/// Assets by content hash, and their indices in the snapshots.
#[derive(Debug, Default)]
pub(crate) struct MeshStore {
    built: FxHashMap<u128, Arc<KeptMesh>>,
    /// Content hash at each mesh index of the last snapshot.
    slots: Vec<u128>,
    /// Partition options that `built` was made with.
    options: PartitionOptions,
    /// Meshes that were built or found in files so far.
    pub(crate) made: u64,
    /// Of these, the ones that were refitted.
    pub(crate) refitted: u64,
    /// Whether meshes that deform are refitted.
    refits: bool,
    /// Where assets are put.
    pub(crate) storage: MeshStorage,
    /// Images that cut meshes out.
    pub(crate) covers: CoverStore,
}

impl MeshStore {
    /// Forgets the assets that would be built differently with `options`: those in pieces, and large ones.
    pub(crate) fn set_options(&mut self, meshes: &mut BTreeMap<Arc<str>, MeshEntry>, options: PartitionOptions) {
        if std::mem::replace(&mut self.options, options) == options {
            return;
        }
        // Splitting uses expected bytes, which are within a fifth of the real ones.
        let stays = |b: &KeptMesh| {
            let bytes = b.asset.as_ref().map_or(0, |a| a.device_bytes());
            b.clusters.is_empty() && bytes < options.mesh_limit() / 2
        };
        self.built.retain(|_, built| stays(built));
        for entry in meshes.values_mut() {
            entry.built = entry.built.take().filter(|built| stays(built));
        }
    }

    /// Sets whether meshes that deform are refitted; returns true if some were and are to be built now.
    pub(crate) fn set_refits(&mut self, meshes: &mut BTreeMap<Arc<str>, MeshEntry>, refits: bool) -> bool {
        if std::mem::replace(&mut self.refits, refits) == refits || refits {
            return false;
        }
        let had_shape = |built: &Arc<KeptMesh>| built.refit.as_ref().is_some_and(|refit| refit.had_shape);
        self.built.retain(|_, built| !had_shape(built));
        let mut must_build = false;
        for entry in meshes.values_mut() {
            (entry.deforms, entry.shape) = (false, None);
            must_build |= entry.built.as_ref().is_some_and(had_shape);
            entry.built = entry.built.take().filter(|built| !had_shape(built));
        }
        must_build
    }

    /// Ensures that every mesh of `wanted` is built, with subdivision surfaces cut by `cuts` and displaced by
    /// `heights`; missing ones are built in parallel. False if `is_moot` said so before they were all there: what was
    /// built until then is found by the next call.
    pub(crate) fn build(
        &mut self,
        meshes: &mut BTreeMap<Arc<str>, MeshEntry>,
        wanted: &FxHashSet<Arc<str>>,
        mut cuts: FxHashMap<Arc<str>, SurfaceCut>,
        (heights, is_moot): (&HeightCache, &MootMeshes<'_>),
    ) -> bool {
        // The budget may have changed.
        self.built.retain(|_, built| !built.is_left_out);
        for (path, entry) in meshes.iter_mut() {
            entry.cut(cuts.remove(path).unwrap_or_default());
            entry.built = entry.built.take().filter(|built| !built.is_left_out);
        }
        let mut missing: Vec<&mut MeshEntry> =
            meshes.iter_mut().filter(|(path, e)| e.built.is_none() && wanted.contains(*path)).map(|(_, e)| e).collect();
        self.covers.read(missing.iter().map(|entry| &entry.cutouts), heights.files());
        let covers: Vec<SlotCovers> = missing.iter().map(|entry| self.covers.of(&entry.cutouts)).collect();
        let all = missing.par_iter().zip(&covers);
        // In files a recipe stands for a mesh that is built.
        let refits = self.refits && self.storage.files.is_none() && self.storage.memory.budget().is_none();
        let parts: Vec<Vec<NewMesh<'_>>> = all.map(|(entry, covers)| NewMesh::of(entry, covers, refits)).collect();
        let keys: Vec<Vec<u128>> = parts.iter().map(|parts| parts.iter().map(|part| part.key).collect()).collect();
        let mut begun: FxHashSet<u128> = FxHashSet::default();
        let new: Vec<NewMesh<'_>> = parts
            .into_iter()
            .flatten()
            .filter(|part| !self.built.contains_key(&part.key) && begun.insert(part.key))
            .collect();
        let building: Vec<Arc<str>> = new.iter().map(|part| Arc::clone(&part.entry.desc.prim.path)).collect();
        let left = AtomicBool::new(false);
        let is_left = || {
            let is_left = left.load(Ordering::Relaxed) || is_moot(&building);
            left.fetch_or(is_left, Ordering::Relaxed) || is_left
        };
        let built = self.make(&new, heights, &is_left);
        self.made += built.len() as u64;
        let is_refitted = |(_, built): &&(u128, Arc<KeptMesh>)| built.refit.as_ref().is_some_and(|r| r.is_refitted);
        self.refitted += built.iter().filter(is_refitted).count() as u64;
        self.built.extend(built);
        if !new.iter().all(|part| self.built.contains_key(&part.key)) {
            return false;
        }
        for (keys, entry) in keys.iter().zip(&mut missing) {
            let parts = || keys.iter().filter_map(|key| self.built.get(key).cloned());
            entry.built = match &entry.cuts {
                Some(cuts) => {
                    let content = entry.outline().content;
                    Some(Arc::new(KeptMesh::of_patches(content, parts().collect(), cuts.is_coarse)))
                }
                None => parts().next(),
            };
        }
        true
    }

    /// Finds meshes in files or builds them, in parallel; none from when `is_left` says so.
    fn make(
        &self,
        new: &[NewMesh<'_>],
        heights: &HeightCache,
        is_left: &(impl Fn() -> bool + Sync),
    ) -> Vec<(u128, Arc<KeptMesh>)> {
        let (limit_bytes, cluster_bytes) = (self.options.mesh_limit(), self.options.chunk_bytes());
        let recipe = |NewMesh { key, entry, covers, patch, .. }: &NewMesh<'_>| {
            Arc::new(MeshRecipe {
                desc: entry.desc.clone(),
                wanted: entry.wanted.clone(),
                dicing: entry.dicing.clone(),
                displacements: entry.displacements.clone(),
                covers: covers.to_vec(),
                height_files: heights.files().cloned(),
                patch: patch.clone(),
                key: *key,
                limit_bytes,
                cluster_bytes,
            })
        };
        let find = |new| KeptMesh::find(&recipe(new), &self.storage);
        let refit = |new: &NewMesh<'_>| new.refits.then(|| MeshRefit::new(new.entry.shape.clone()));
        let build =
            |new: &NewMesh<'_>, grant| KeptMesh::build(&recipe(new), heights, &self.storage, (grant, refit(new)));
        let all = new.par_iter().with_max_len(1);
        let made: Vec<Option<KeptMesh>> = match self.storage.memory.budget() {
            Some(budget) => {
                let found: Vec<Option<KeptMesh>> = all.map(find).collect();
                let footprint = |(new, found): (_, &Option<KeptMesh>)| match found {
                    Some(_) => BuildFootprint::default(),
                    None => recipe(new).footprint(),
                };
                let footprints: Vec<BuildFootprint> = new.par_iter().zip(&found).map(footprint).collect();
                let build = |at: usize, grant| Some(build(new.get(at).filter(|_| !is_left())?, grant));
                self.build_within(budget, &footprints, found, build)
            }
            None => {
                // Clusters are stored in batches: all of them together would take as much memory as the mesh itself.
                let at_once = BATCHES * rayon::current_num_threads();
                let grant = || BuildGrant { reserved: None, at_once };
                all.map(|new| find(new).or_else(|| (!is_left()).then(|| build(new, grant())))).collect()
            }
        };
        new.iter().zip(made).filter_map(|(new, made)| Some((new.key, Arc::new(made?)))).collect()
    }

    /// Builds the meshes that were not found, in parallel as far as there is room. A mesh that needs more than the
    /// budget is left out.
    fn build_within(
        &self,
        budget: u64,
        footprints: &[BuildFootprint],
        found: Vec<Option<KeptMesh>>,
        build: impl Fn(usize, BuildGrant) -> Option<KeptMesh> + Sync,
    ) -> Vec<Option<KeptMesh>> {
        let fits = |footprint: &BuildFootprint| footprint.least() <= budget;
        let missing = found.iter().zip(footprints).zip(0_usize..);
        let missing = missing.filter(|((found, footprint), _)| found.is_none() && fits(footprint));
        let (numbers, of_missing): (Vec<usize>, Vec<BuildFootprint>) = missing.map(|((_, f), at)| (at, *f)).unzip();
        let build = |at: usize, grant| numbers.get(at).and_then(|at| build(*at, grant));
        let built = run_within(&self.storage.memory, &of_missing, build);
        let mut made = found;
        for (at, built) in numbers.iter().zip(built) {
            if let Some(slot) = made.get_mut(*at) {
                *slot = built.flatten();
            }
        }
        let left_out = |footprint: &BuildFootprint| KeptMesh::left_out(too_large(footprint.least(), budget));
        let all = made.into_iter().zip(footprints);
        all.map(|(made, footprint)| made.or_else(|| (!fits(footprint)).then(|| left_out(footprint)))).collect()
    }

    /// Assigns mesh indices to the assets in use, moving as few as possible: freed indices go to new assets first, then
    /// to the last ones. Returns the assets by index, and the index of each content hash.
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
