// SPDX-License-Identifier: Apache-2.0
//! What the database keeps per prim, and the store of mesh assets shared by content.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::array_motion::ArrayMotion;
use super::dicing::Outline;
use super::instance_primvars::{InstancePrimvar, MemberPrimvar};
use super::placement::InstanceArrays;
use crate::array::ArrayView;
use crate::desc::DroppedData;
use crate::desc::{InstancerDesc, MeshDesc};
use crate::mesh::{
    BuiltMesh, Demand, Dicing, Displacements, MeshAsset, WantedPrimvar, build_mesh_with, is_same_mesh, mesh_key_with,
};
use crate::partition::PartitionOptions;
use crate::texture::Heights;

/// A mesh prim.
#[derive(Debug)]
pub(crate) struct MeshEntry {
    pub(crate) desc: MeshDesc,
    /// The asset, once the prim was needed; none again when the arrays change.
    pub(crate) built: Option<Arc<BuiltMesh>>,
    /// How finely its limit surface is cut.
    pub(crate) dicing: Dicing,
    /// What [`super::dicing`] has to know of it, once that was asked for; none again when the arrays or `wanted`
    /// change.
    pub(crate) outline: OnceLock<Outline>,
    /// Primvars that materials read.
    pub(crate) wanted: Vec<WantedPrimvar>,
    /// How materials displace it.
    pub(crate) displacements: Displacements,
    /// Numbers of the primvars that are read here and that the mesh does not have.
    pub(crate) lacks: Vec<u32>,
}

impl MeshEntry {
    /// A new entry, or `old` with what changed. Gives whether anything did.
    pub(crate) fn update(old: Option<Self>, desc: MeshDesc) -> (Self, bool) {
        match old {
            Some(old) if is_same_mesh(&old.desc, &desc, &old.wanted) => {
                let changed = old.desc.prim != desc.prim
                    || old.desc.prim_id != desc.prim_id
                    || !is_dressed_alike(&old.desc, &desc);
                (Self { desc, ..old }, changed)
            }
            _ => {
                let entry = Self {
                    desc,
                    built: None,
                    dicing: Dicing::default(),
                    outline: OnceLock::new(),
                    wanted: Vec::new(),
                    displacements: Vec::new(),
                    lacks: Vec::new(),
                };
                (entry, true)
            }
        }
    }
}

impl MeshEntry {
    /// What it is built for.
    pub(crate) fn demand(&self) -> Demand<'_> {
        let Self { wanted, dicing, displacements, .. } = self;
        Demand { wanted, dicing: Some(dicing), displacements, heights: None }
    }

    /// Notes what materials ask for; forgets what was made for something else.
    pub(crate) fn ask(&mut self, wanted: Vec<WantedPrimvar>, displacements: Displacements) {
        if self.wanted != wanted || self.displacements != displacements {
            self.wanted = wanted;
            self.displacements = displacements;
            self.built = None;
            self.outline = OnceLock::new();
        }
    }
}

/// True when bindings and collections are equal, and there are primvars of the same names.
fn is_dressed_alike(a: &MeshDesc, b: &MeshDesc) -> bool {
    a.material == b.material
        && a.categories == b.categories
        && a.subsets.iter().map(|s| &s.material).eq(b.subsets.iter().map(|s| &s.material))
        && a.primvars.iter().map(|p| &p.name).eq(b.primvars.iter().map(|p| &p.name))
}

/// An instancer prim.
#[derive(Debug)]
pub(crate) struct InstancerEntry {
    /// Its arrays are the ones of `arrays` (kept while their contents are the same).
    pub(crate) desc: InstancerDesc,
    pub(crate) arrays: Arc<InstanceArrays>,
    /// False when an array has the wrong type.
    pub(crate) is_usable: bool,
    pub(crate) dropped: DroppedData,
    /// What else is to be said of it.
    pub(crate) notes: Vec<String>,
    /// Its instance-rate primvars.
    pub(crate) primvars: Vec<Arc<InstancePrimvar>>,
    /// Of these, the usable ones that some mesh lacks.
    pub(crate) offers: Vec<MemberPrimvar>,
}

impl InstancerEntry {
    /// A new entry; arrays whose contents did not change are taken over from `old`, so that what was made from them
    /// stays valid. Gives whether anything changed.
    pub(crate) fn update(old: Option<Self>, mut desc: InstancerDesc) -> (Self, bool) {
        let mut dropped = DroppedData::default();
        let mut arrays = InstanceArrays::of(&desc);
        let is_usable = arrays.check_types(&mut dropped);
        let mut notes = Vec::new();
        match ArrayMotion::of(&desc, &arrays) {
            Ok(motion) => arrays.motion = motion.filter(|_| is_usable).map(Arc::new),
            Err(why) => notes.push(format!("its instances do not move: {why}")),
        }
        let mut arrays = Arc::new(arrays);
        let known = old.as_ref().map_or(&[][..], |old| &old.primvars);
        let primvars = InstancePrimvar::all_of(&desc, known);
        let Some(old) = old else {
            return (Self { desc, arrays, is_usable, dropped, notes, primvars, offers: Vec::new() }, true);
        };
        let mut changed = desc.prim != old.desc.prim || desc.prototypes.len() != old.desc.prototypes.len();
        if old.arrays.same_contents(&arrays) {
            arrays = old.arrays;
        } else {
            changed = true;
        }
        for (new, old) in desc.prototypes.iter_mut().zip(&old.desc.prototypes) {
            changed |= new.root != old.root;
            if new.indices.same_contents(&old.indices) {
                new.indices = old.indices.clone();
            } else {
                changed = true;
            }
        }
        changed |= dropped != old.dropped || notes != old.notes;
        changed |= primvars.len() != old.primvars.len()
            || primvars.iter().zip(&old.primvars).any(|(new, old)| !Arc::ptr_eq(new, old));
        (Self { desc, arrays, is_usable, dropped, notes, primvars, offers: old.offers }, changed)
    }
}

impl InstancerEntry {
    /// Instances that a primvar must have values for.
    pub(crate) fn instance_count(&self) -> usize {
        match self.arrays.len() {
            usize::MAX => {
                let indices = self.desc.prototypes.iter().map(|prototype| prototype.indices.view());
                let last = |view: ArrayView<'_>| (0..view.len()).filter_map(|at| view.index(at)).max();
                let last = indices.filter_map(last).max().unwrap_or(-1);
                usize::try_from(i64::from(last) + 1).unwrap_or(0)
            }
            count => count,
        }
    }
}

/// Assets by content hash, and their indices in the snapshots.
#[derive(Debug, Default)]
pub(crate) struct MeshStore {
    built: FxHashMap<u128, Arc<BuiltMesh>>,
    /// Content hash at each mesh index of the last snapshot.
    slots: Vec<u128>,
    /// What `built` was made for.
    options: PartitionOptions,
}

impl MeshStore {
    /// Forgets the assets that would not be built like that with `options`: those in pieces, and large ones.
    pub(crate) fn set_options(&mut self, meshes: &mut BTreeMap<Arc<str>, MeshEntry>, options: PartitionOptions) {
        if std::mem::replace(&mut self.options, options) == options {
            return;
        }
        // Splitting goes by expected bytes, which are within a fifth of the real ones.
        let stays = |b: &BuiltMesh| {
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
            let demand = Demand { heights: Some(heights), ..entry.demand() };
            Arc::new(build_mesh_with(&entry.desc, &demand, key, limit, cluster))
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
        let built: Vec<(u128, Arc<BuiltMesh>)> =
            new.into_par_iter().with_max_len(1).map(|(key, e)| (key, build(key, e))).collect();
        self.built.extend(built);
        for (key, entry) in keys.iter().zip(&mut missing) {
            entry.built = self.built.get(key).cloned();
        }
    }

    /// Assigns mesh indices to the assets in use, moving as few as possible: freed indices go to new assets first, then
    /// to the last ones. Gives the assets by index, and the index of each content hash.
    pub(crate) fn assign(&mut self, used: &[u128]) -> (Vec<Arc<MeshAsset>>, FxHashMap<u128, u32>) {
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
        let mut clusters: FxHashMap<u128, &Arc<MeshAsset>> = FxHashMap::default();
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
