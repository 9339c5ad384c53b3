// SPDX-License-Identifier: Apache-2.0
//! The scene database: edits in, one commit, an immutable snapshot out.
//!
//! One thread owns a [`SceneDb`]; any thread may read its snapshots. The way of a mesh: [`SceneDb::upsert_mesh`] notes
//! it (`entries`), [`SceneDb::commit`] has [`crate::mesh`] build it and `resolve` sort it into a group, and a run of an
//! [`Assembly`] places it (`instancing`).

mod admission;
mod commit;
mod cover_store;
mod dicing;
mod entries;
mod identity;
mod lent;
mod light;
mod linked_prims;
mod linking;
mod mesh_lights;
mod mesh_outline;
mod mesh_placements;
mod mesh_store;
mod placement_motion;
mod prim_names;
mod primvar_uses;
mod report;
pub(crate) mod resolve;
pub mod snapshot;
mod summary;
mod surface_cut;
mod surfaces;
pub(crate) mod validate;

use oocpt_abi::Features;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::DVec3;

pub use crate::desc::{
    AssetRef, ConnectionDesc, CurveBasis, CurveWrap, CurvesDesc, DomeFormat, DroppedData, InstanceLinks, InstancedBy,
    InstancerDesc, InstancerMotion, InstancerPrototype, InstancerSample, Interpolation, LightDesc, LightKind,
    MaterialDesc, MaterialSync, MeshDesc, NamedPrimvar, NodeDesc, ParamDesc, ParamValue, PointsMotion, PointsSample,
    PrimDesc, PrimShape, Primvar, ShadowReach, ShapingCone, SolidDesc, SolidSize, Subdivision, SubdivisionTags,
    SubsetDesc, TransformSample,
};
pub use crate::instancing::instance_primvars::InstanceColumn;
pub use crate::instancing::motion::{MAX_KEYS, MotionKey, map_at};
pub use dicing::DicingCamera;
pub use identity::AssetContent;
pub use lent::LentBytes;
use lent::{LentArrays, instancer_arrays, mesh_arrays};
pub use resolve::MAX_NESTING;
pub use snapshot::{
    Aabb, Assembly, Attribute, Bvh2, BvhError, BvhNode, DomeTexture, IesError, IesProfile, InstanceRecord,
    InstanceTarget, Light, LightEmitter, LightMotion, LightShaping, LinkTable, LocalLight, LocalShape, MeshAsset,
    PrimRecord, SceneCounts, SceneMesh, SceneWarning, Snapshot, SnapshotError, SurfaceTables, Triangle, blackbody,
};

pub use mesh_lights::MESH_LIGHT;
pub use mesh_placements::{MeshPlacement, MeshPlacements};
pub use placement_motion::PlacementMotion;
pub use prim_names::{NamingPrimvar, PrimNames};
pub use summary::summary;

use crate::instancing::GroupId;
use crate::mesh::{BuildDemand, DicingRate, HostMemory, MeshFiles};
use crate::partition::{PartitionOptions, PartitionSource, PartitionStore, PartitionedWorld};
use crate::texture::{HeightCache, HeightFiles};
use commit::{AssemblyStore, CommittedAssets, visible_lights};
use dicing::dice;
use entries::{InstancerEntry, MeshEntry};
use mesh_lights::mesh_lights;
use mesh_store::{MeshStore, MootMeshes};
use report::CommitReports;
use resolve::{PlanGroup, PlanTarget, PrimHierarchy, ScenePrims, resolve};
use surfaces::{MaterialEntry, ShownMeshes, SurfaceStore};

/// The result of [`SceneDb::commit`].
#[derive(Clone, Debug)]
pub struct SceneCommit {
    /// The scene as of now; the same `Arc` as before if nothing changed.
    pub snapshot: Arc<Snapshot>,
    /// Warnings that the commit before did not give, in path order.
    pub warnings: Vec<SceneWarning>,
    /// True if the snapshot differs from that of the commit before.
    pub changed: bool,
}

/// The kinds of prims: a path has a prim of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PrimKind {
    Mesh,
    Instancer,
    Light,
    Material,
}

/// The scene under edit. Edits are only noted; [`SceneDb::commit`] does the work.
#[derive(Debug)]
pub struct SceneDb {
    meshes: BTreeMap<Arc<str>, MeshEntry>,
    instancers: BTreeMap<Arc<str>, InstancerEntry>,
    lights: BTreeMap<Arc<str>, LightDesc>,
    materials: BTreeMap<Arc<str>, MaterialEntry>,
    /// Counts edits of materials.
    material_edits: u64,
    /// Purposes that are shown, by [`canonical_purpose`]; empty: all.
    purposes: Vec<String>,
    /// True if something was edited since the last commit that ended.
    edited: bool,
    mesh_store: MeshStore,
    surface_store: SurfaceStore,
    assembly_store: AssemblyStore,
    partition: PartitionStore,
    dicing: DicingCamera,
    height_files: Option<Arc<dyn HeightFiles>>,
    /// The arrays that [`Self::lent`] counts, from its first call on.
    lent_arrays: Option<LentArrays>,
    /// The message of the last commit for each prim.
    last_warnings: BTreeMap<Arc<str>, String>,
    snapshot: Arc<Snapshot>,
}

impl Default for SceneDb {
    fn default() -> Self {
        Self::new()
    }
}

impl SceneDb {
    /// An empty scene; purposes "default" and "render" are shown.
    #[must_use]
    pub fn new() -> Self {
        Self {
            meshes: BTreeMap::new(),
            instancers: BTreeMap::new(),
            lights: BTreeMap::new(),
            materials: BTreeMap::new(),
            material_edits: 0,
            purposes: vec!["default".to_owned(), "render".to_owned()],
            edited: true,
            mesh_store: MeshStore::default(),
            surface_store: SurfaceStore::default(),
            assembly_store: AssemblyStore::default(),
            partition: PartitionStore::default(),
            dicing: DicingCamera::default(),
            height_files: None,
            lent_arrays: None,
            last_warnings: BTreeMap::new(),
            snapshot: Arc::new(Snapshot::empty()),
        }
    }

    /// Adds a mesh or replaces the prim of the same path. Cheap if the arrays are those given before.
    pub fn upsert_mesh(&mut self, desc: MeshDesc) {
        let path = desc.prim.path.clone();
        let replaced = self.remove_other_kinds(&path, PrimKind::Mesh);
        let (entry, changed) = MeshEntry::update(self.take_mesh(&path), desc);
        if let Some(lent_arrays) = &mut self.lent_arrays {
            lent_arrays.add(&path, mesh_arrays(&entry.desc));
        }
        self.meshes.insert(path, entry);
        self.edited |= changed | replaced;
    }

    /// Adds an instancer or replaces the prim of the same path. Arrays are compared with those given before (by
    /// address, else by content).
    pub fn upsert_instancer(&mut self, desc: InstancerDesc) {
        let path = desc.prim.path.clone();
        let replaced = self.remove_other_kinds(&path, PrimKind::Instancer);
        let (entry, changed) = InstancerEntry::update(self.take_instancer(&path), desc);
        if let Some(lent_arrays) = &mut self.lent_arrays {
            lent_arrays.add(&path, instancer_arrays(&entry.desc));
        }
        self.instancers.insert(path, entry);
        self.edited |= changed | replaced;
    }

    /// Adds a light or replaces the prim of the same path.
    pub fn upsert_light(&mut self, desc: LightDesc) {
        let path = desc.prim.path.clone();
        let replaced = self.remove_other_kinds(&path, PrimKind::Light);
        let changed = self.lights.get(&path) != Some(&desc);
        self.lights.insert(path, desc);
        self.edited |= changed | replaced;
    }

    /// Adds a material or replaces the prim of the same path.
    pub fn upsert_material(&mut self, desc: MaterialDesc) {
        let path = desc.path.clone();
        let replaced = self.remove_other_kinds(&path, PrimKind::Material);
        let (entry, changed) = MaterialEntry::update(self.materials.remove(&path), desc);
        self.materials.insert(path, entry);
        self.material_edits += u64::from(changed);
        self.edited |= changed | replaced;
    }

    /// All materials as they were given, in path order.
    pub fn materials(&self) -> impl Iterator<Item = &MaterialDesc> {
        self.materials.values().map(|entry| &entry.desc)
    }

    /// A number that changes with every edit of a material.
    #[must_use]
    pub fn material_edits(&self) -> u64 {
        self.material_edits
    }

    fn take_mesh(&mut self, path: &str) -> Option<MeshEntry> {
        let (path, entry) = self.meshes.remove_entry(path)?;
        if let Some(lent_arrays) = &mut self.lent_arrays {
            lent_arrays.remove(&path, mesh_arrays(&entry.desc));
        }
        Some(entry)
    }

    fn take_instancer(&mut self, path: &str) -> Option<InstancerEntry> {
        let (path, entry) = self.instancers.remove_entry(path)?;
        if let Some(lent_arrays) = &mut self.lent_arrays {
            lent_arrays.remove(&path, instancer_arrays(&entry.desc));
        }
        Some(entry)
    }

    /// Removes the prims at `path` that are not of `kind`. True if there were any.
    fn remove_other_kinds(&mut self, path: &str, kind: PrimKind) -> bool {
        (kind != PrimKind::Mesh && self.take_mesh(path).is_some())
            | (kind != PrimKind::Instancer && self.take_instancer(path).is_some())
            | (kind != PrimKind::Light && self.lights.remove(path).is_some())
            | (kind != PrimKind::Material && self.remove_material(path))
    }

    fn remove_material(&mut self, path: &str) -> bool {
        let removed = self.materials.remove(path).is_some();
        self.material_edits += u64::from(removed);
        removed
    }

    /// Removes the prims at `path` and below it.
    pub fn remove(&mut self, path: &str) {
        let materials = subtree(&self.materials, path);
        self.material_edits += u64::from(!materials.is_empty());
        materials.iter().for_each(|path| _ = self.materials.remove(path));
        let lights = subtree(&self.lights, path);
        lights.iter().for_each(|path| _ = self.lights.remove(path));
        let (meshes, instancers) = (subtree(&self.meshes, path), subtree(&self.instancers, path));
        meshes.iter().for_each(|path| _ = self.take_mesh(path));
        instancers.iter().for_each(|path| _ = self.take_instancer(path));
        self.edited |= [materials, lights, meshes, instancers].iter().any(|paths| !paths.is_empty());
    }

    /// Shows meshes of these purposes only; an empty list shows all. "", "geometry" and "default" are the same.
    pub fn set_purposes(&mut self, purposes: &[&str]) {
        let mut purposes: Vec<String> = purposes.iter().map(|p| canonical_purpose(p).to_owned()).collect();
        purposes.sort();
        purposes.dedup();
        self.edited |= purposes != self.purposes;
        self.purposes = purposes;
    }

    /// Sets how the scene is cut into chunks, from the next commit on.
    pub fn set_partition(&mut self, options: PartitionOptions) {
        self.edited |= self.partition.set_options(options);
    }

    /// Sets how many bytes of items, 24 for each placement that a commit sorts, a first partition holds at once, unless
    /// a sixteenth of all is more. Larger partitions are sorted in parts, which is slower and gives the same result.
    /// The default is 1 GiB.
    pub fn set_partition_memory(&mut self, bytes: u64) {
        self.partition.set_item_bytes(bytes);
    }

    /// Sets whether the scene is live, from the next commit on; it is not by default. A live scene holds chunks while
    /// their records move ([`crate::partition::Chunk::shape`]) and refits meshes that deform, so a commit costs less,
    /// and chunks and trees, with them the last bits of a picture, depend on the edits that led to the scene.
    pub fn set_live(&mut self, is_live: bool) {
        self.edited |= self.partition.set_holds(is_live);
        self.edited |= self.mesh_store.set_refits(&mut self.meshes, is_live);
    }

    /// Sets whether a live scene measures what moves late, from the next commit on; it does not by default. Then a
    /// commit in which many records of the root moved does not look where they are: somebody else measures their
    /// chunks ([`crate::partition::Chunk::set_bounds`], [`PartitionedWorld::measured`]) before rays use them, and
    /// whether they are cut anew or have become unusable is seen with the next commit that measures them.
    pub fn set_late(&mut self, is_late: bool) {
        self.partition.set_late(is_late);
    }

    /// Sets the primvars that images are wanted of, by name, from the next commit on: prims keep them although no
    /// material reads them ([`SurfaceTables::shown_primvars`]). None by default.
    pub fn show_primvars(&mut self, names: &[Arc<str>]) {
        self.edited |= self.surface_store.show_primvars(names);
    }

    /// Sets the camera that decides how finely subdivision surfaces are cut, from the next commit on. Before the first
    /// call they are cut as their refine levels say.
    pub fn set_dicing(&mut self, camera: DicingCamera) {
        if self.dicing != camera {
            let previous = std::mem::replace(&mut self.dicing, camera);
            // A mesh may change only if it is diced for one of both cameras; 0 pixels dice nothing.
            let rate =
                DicingRate { pixels: f64::max(previous.pixels(), self.dicing.pixels()), ..DicingRate::default() };
            let is_diced =
                |entry: &MeshEntry| BuildDemand { dicing: Some(&rate), ..entry.demand() }.refines(&entry.desc);
            self.edited |= self.meshes.values().any(is_diced);
        }
    }

    /// Meshes that commits have built so far, or found in files.
    #[must_use]
    pub fn meshes_made(&self) -> u64 {
        self.mesh_store.made
    }

    /// Of the meshes that commits have built, those that deformed and kept the shape of their hierarchy.
    #[must_use]
    pub fn meshes_refitted(&self) -> u64 {
        self.mesh_store.refitted
    }

    /// Sets the reader of textures for displacement and cutouts, for meshes that are built from now on. Without one,
    /// displacement textures have their fallback value.
    pub fn set_height_files(&mut self, files: Arc<dyn HeightFiles>) {
        self.height_files = Some(files);
    }

    /// For tests: with `true` bounds ignore cutouts, so that a triangle's box covers all of it. Changes no picture.
    pub fn set_whole_bounds(&mut self, are_whole: bool) {
        self.edited |= std::mem::replace(&mut self.surface_store.has_whole_bounds, are_whole) != are_whole;
    }

    /// Sets the files that take meshes when [`Self::mesh_memory`] is full, for meshes that are built from now on.
    pub fn set_mesh_files(&mut self, files: Option<Arc<dyn MeshFiles>>) {
        self.mesh_store.storage.files = files;
    }

    /// Sets the budget of host memory in bytes, from the next commit on. A mesh whose build needs more is left out,
    /// with a warning; all others are built in parallel as far as there is room ([`HostMemory::set_room`]). Unlimited
    /// before the first call. Changes nothing else of the result.
    pub fn set_host_budget(&mut self, bytes: u64) {
        let memory = &self.mesh_store.storage.memory;
        if memory.budget() != Some(bytes).filter(|bytes| *bytes < u64::MAX) {
            memory.set_budget(bytes);
            self.edited |= self.meshes.values().any(MeshEntry::is_left_out);
        }
    }

    /// The host memory that meshes take; unlimited by default.
    #[must_use]
    pub fn mesh_memory(&self) -> &Arc<HostMemory> {
        &self.mesh_store.storage.memory
    }

    /// The snapshot of the last commit; an empty scene before the first.
    #[must_use]
    pub fn snapshot(&self) -> &Arc<Snapshot> {
        &self.snapshot
    }

    /// Applies the edits since the last commit. New meshes are built on the rayon pool; everything else is shared with
    /// the last snapshot. After a panic the next commit does the same again.
    pub fn commit(&mut self) -> SceneCommit {
        // Nobody gives it up.
        self.commit_unless(&|_| false).unwrap_or_else(|| self.unchanged())
    }

    /// As [`Self::commit`], but gives up where `is_moot` says, between two meshes, that it is not worth while to build
    /// those of these prims: then the scene is that of the commit before, and the next commit finds the meshes that
    /// were built, if it needs them. `is_moot` is called on threads of the rayon pool, often.
    pub fn commit_unless(&mut self, is_moot: &(dyn Fn(&[Arc<str>]) -> bool + Sync)) -> Option<SceneCommit> {
        if !self.edited {
            return Some(self.unchanged());
        }
        let mut reports = CommitReports::default();
        let (plan, assets) = self.plan(&mut reports, is_moot)?;
        let (assemblies, origin, world) = self.arrange(&plan, &assets);
        for (group, assembly) in plan.iter().zip(&assemblies) {
            for (planned, member) in group.members.iter().zip(assembly.members()) {
                reports.add(&planned.path, member.run.dropped());
            }
        }
        let (lights, links) = visible_lights(&self.lights, &self.instancers, &mut reports);
        let dropped = reports.total();
        let CommittedAssets { meshes, surfaces, .. } = assets;
        let mut next = Snapshot { origin, meshes, assemblies, lights, links, surfaces, dropped, ..Snapshot::empty() };
        next.world = world;
        let changed = self.snapshot.version == 0 || !next.is_same(&self.snapshot);
        if changed {
            next.version = self.snapshot.version + 1;
            next.update_totals();
            self.snapshot = Arc::new(next);
        }
        self.mesh_store.forget_unused();
        self.edited = false;
        Some(SceneCommit { snapshot: self.snapshot.clone(), warnings: self.new_warnings(&reports), changed })
    }

    fn unchanged(&self) -> SceneCommit {
        SceneCommit { snapshot: self.snapshot.clone(), warnings: Vec::new(), changed: false }
    }

    /// Makes the assemblies and their partition, and decides the origin. What moved is measured now only where its
    /// chunks cannot be held.
    fn arrange(
        &mut self,
        plan: &[PlanGroup],
        assets: &CommittedAssets,
    ) -> (Vec<Arc<Assembly>>, DVec3, Arc<PartitionedWorld>) {
        let groups: Vec<&GroupId> = plan.iter().map(|group| &group.id).collect();
        let mut late = self.partition.is_late();
        loop {
            let (made, origin) = self.assembly_store.make(plan, assets, (self.partition.item_bytes(), late));
            let (assemblies, buckets): (Vec<_>, Vec<_>) = made.into_iter().unzip();
            let source =
                PartitionSource { groups: &groups, meshes: &assets.meshes, assemblies: &assemblies, buckets: &buckets };
            match self.partition.update(source) {
                Some(world) => return (assemblies, origin, world),
                // Without runs that are late there is always one.
                None => late = false,
            }
        }
    }

    /// Builds the missing meshes and sorts all prims into groups. The order matters: materials say what primvars meshes
    /// keep, cameras how finely they are diced, and groups need the keys of built meshes. `None` if that was given up.
    fn plan(
        &mut self,
        reports: &mut CommitReports,
        is_moot: &MootMeshes<'_>,
    ) -> Option<(Vec<PlanGroup>, CommittedAssets)> {
        let purposes = &self.purposes;
        let shows = |p: &str| purposes.is_empty() || purposes.iter().any(|shown| shown == canonical_purpose(p));
        let prims = ScenePrims { meshes: &self.meshes, instancers: &self.instancers };
        let hierarchy = PrimHierarchy::new(prims, shows, reports);
        let reachable = hierarchy.reachable(prims, reports);
        self.surface_store.prepare(&mut self.materials, &mut self.meshes, &self.lights, &reachable, reports);
        self.surface_store.offer(&self.meshes, &mut self.instancers, &reachable, reports);
        self.mesh_store.set_options(&mut self.meshes, self.partition.options());
        let prims = ScenePrims { meshes: &self.meshes, instancers: &self.instancers };
        let cuts = dice(prims, &hierarchy, &reachable, &self.dicing);
        let heights = HeightCache::new(self.height_files.clone());
        if !self.mesh_store.build(&mut self.meshes, &reachable, cuts, (&heights, is_moot)) {
            return None;
        }
        for (path, entry) in self.meshes.iter().filter(|(path, _)| reachable.contains(*path)) {
            if let Some(built) = &entry.built {
                reports.add(path, &built.dropped);
                built.notes.iter().for_each(|note| reports.note(path, note.clone()));
            }
        }
        for (path, entry) in self.instancers.iter().filter(|(path, _)| reachable.contains(*path)) {
            reports.add(path, &entry.dropped);
            entry.notes.iter().for_each(|note| reports.note(path, note.clone()));
        }
        let named = linking::named(&self.lights);
        for (_, entry) in self.instancers.iter_mut().filter(|(path, _)| reachable.contains(*path)) {
            entry.classes.update(&entry.desc, &named);
        }
        let prims = ScenePrims { meshes: &self.meshes, instancers: &self.instancers };
        let (plan, linked) = resolve(prims, &hierarchy, reports);
        let mut used = Vec::new();
        for member in plan.iter().flat_map(|group| &group.members) {
            if let PlanTarget::Mesh { key, .. } = member.target {
                used.push(key);
            }
        }
        let (meshes, indices) = self.mesh_store.assign(&used);
        let lights = mesh_lights(&self.lights, &self.meshes, reports);
        let meshes_shown = ShownMeshes { meshes: &self.meshes, lights: &lights, paths: &reachable, linked: &linked };
        let mut surfaces = self.surface_store.tables(&self.materials, meshes_shown, reports);
        surfaces.trim();
        self.mesh_store.covers.retain(&surfaces.textures);
        Some((plan, CommittedAssets { meshes, indices, surfaces }))
    }

    /// The warnings that differ from the last commit's for the same prim.
    fn new_warnings(&mut self, reports: &CommitReports) -> Vec<SceneWarning> {
        let warnings = reports.warnings();
        let is_new = |warning: &&SceneWarning| self.last_warnings.get(&warning.path) != Some(&warning.message);
        let new = warnings.values().filter(is_new).cloned().collect();
        self.last_warnings = warnings.into_iter().map(|(path, warning)| (path, warning.message)).collect();
        new
    }
}

impl Snapshot {
    /// The empty scene before the first commit.
    fn empty() -> Self {
        Self {
            version: 0,
            origin: DVec3::ZERO,
            meshes: Vec::new(),
            assemblies: vec![Arc::new(Assembly::new(0, Vec::new(), false))],
            lights: Vec::new(),
            surfaces: SurfaceTables::default(),
            links: LinkTable::default(),
            features: Features::empty(),
            leaf_kinds: BTreeSet::new(),
            max_levels: 1,
            counts: SceneCounts { assemblies: 1, ..SceneCounts::default() },
            dropped: DroppedData::default(),
            world: Arc::new(PartitionedWorld::empty()),
        }
    }
}

/// The one name of a purpose with several.
fn canonical_purpose(purpose: &str) -> &str {
    if matches!(purpose, "" | "geometry") { "default" } else { purpose }
}

/// The paths of `prims` at `path` and below it.
fn subtree<T>(prims: &BTreeMap<Arc<str>, T>, path: &str) -> Vec<Arc<str>> {
    let prefix = format!("{}/", path.trim_end_matches('/'));
    let mut found: Vec<Arc<str>> = prims
        .range::<str, _>((std::ops::Bound::Included(prefix.as_str()), std::ops::Bound::Unbounded))
        .take_while(|(candidate, _)| candidate.starts_with(&prefix))
        .map(|(candidate, _)| candidate.clone())
        .collect();
    found.extend(prims.get_key_value(path).map(|(key, _)| key.clone()));
    found
}
