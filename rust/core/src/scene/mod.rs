// SPDX-License-Identifier: Apache-2.0
//! The scene database: edits in, one commit, an immutable snapshot out.
//!
//! One thread owns a [`SceneDb`]; the snapshots it gives may be read anywhere. Follow a mesh: [`SceneDb::upsert_mesh`]
//! (`entries`), [`SceneDb::commit`] (`commit`): built by [`crate::mesh`], put into a group by `resolve`, placed by a
//! run of an [`Assembly`] (`instancing`).

mod admission;
mod commit;
mod cover_store;
mod dicing;
mod entries;
mod lent;
mod light;
mod linking;
mod mesh_lights;
mod mesh_placements;
mod mesh_store;
mod placement_motion;
mod primvar_uses;
mod report;
pub(crate) mod resolve;
pub mod snapshot;
mod summary;
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
pub use lent::LentBytes;
use lent::{LentArrays, of_instancer, of_mesh};
pub use resolve::MAX_NESTING;
pub use snapshot::{
    Aabb, Assembly, Attribute, Bvh2, BvhError, BvhNode, DomeTexture, IesError, IesProfile, InstanceFlags,
    InstanceRecord, InstanceTarget, Light, LightEmitter, LightMotion, LightShaping, LinkTable, LocalLight, LocalShape,
    MeshAsset, SceneCounts, SceneMesh, SceneWarning, Snapshot, SnapshotError, SurfaceTables, Triangle, blackbody,
};

pub use mesh_lights::MESH_LIGHT;
pub use mesh_placements::{MeshPlacement, MeshPlacements};
pub use placement_motion::PlacementMotion;
pub use summary::summary;
pub use surfaces::PrimRecord;

use crate::instancing::GroupId;
use crate::mesh::{BuildDemand, DicingRate, HostMemory, MeshFiles};
use crate::partition::{PartitionOptions, PartitionSource, PartitionStore, PartitionedWorld};
use crate::texture::{HeightCache, HeightFiles};
use commit::{AssemblyStore, CommittedAssets, shining};
use dicing::dice;
use entries::{InstancerEntry, MeshEntry};
use mesh_lights::mesh_lights;
use mesh_store::MeshStore;
use report::CommitReports;
use resolve::{PlanGroup, PlanTarget, PrimHierarchy, ScenePrims, resolve};
use surfaces::{MaterialEntry, ShownMeshes, SurfaceStore};

/// The result of [`SceneDb::commit`].
#[derive(Clone, Debug)]
pub struct SceneCommit {
    /// The scene as of now; the same `Arc` as before when nothing changed.
    pub snapshot: Arc<Snapshot>,
    /// Warnings that were not given before, in path order.
    pub warnings: Vec<SceneWarning>,
    /// True when the snapshot differs from the one of the commit before.
    pub changed: bool,
}

/// What a prim can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PrimKind {
    Mesh,
    Instancer,
    Light,
    Material,
}

/// The scene under edit. Edits are cheap and only noted; [`SceneDb::commit`] does the work.
#[derive(Debug)]
pub struct SceneDb {
    meshes: BTreeMap<Arc<str>, MeshEntry>,
    instancers: BTreeMap<Arc<str>, InstancerEntry>,
    lights: BTreeMap<Arc<str>, LightDesc>,
    materials: BTreeMap<Arc<str>, MaterialEntry>,
    /// Edits of materials so far.
    material_edits: u64,
    /// Normalised; empty = all.
    purposes: Vec<String>,
    /// True when something was edited since the last commit.
    edited: bool,
    mesh_store: MeshStore,
    surface_store: SurfaceStore,
    assembly_store: AssemblyStore,
    partition: PartitionStore,
    dicing: DicingCamera,
    height_files: Option<Arc<dyn HeightFiles>>,
    /// The count of [`Self::lent`], once somebody asked for it.
    lending: Option<LentArrays>,
    /// Last message given for each prim.
    warned: BTreeMap<Arc<str>, String>,
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
            lending: None,
            warned: BTreeMap::new(),
            snapshot: Arc::new(Snapshot::nothing()),
        }
    }

    /// Adds a mesh or replaces the prim of the same path. Cheap when the arrays are the ones given before.
    pub fn upsert_mesh(&mut self, desc: MeshDesc) {
        let path = desc.prim.path.clone();
        let others = self.remove_other(&path, PrimKind::Mesh);
        let (entry, changed) = MeshEntry::update(self.take_mesh(&path), desc);
        if let Some(lending) = &mut self.lending {
            lending.add(&path, of_mesh(&entry.desc));
        }
        self.meshes.insert(path, entry);
        self.edited |= changed | others;
    }

    /// Adds an instancer or replaces the prim of the same path. Arrays are compared with the ones given before (by
    /// address, else by content).
    pub fn upsert_instancer(&mut self, desc: InstancerDesc) {
        let path = desc.prim.path.clone();
        let others = self.remove_other(&path, PrimKind::Instancer);
        let (entry, changed) = InstancerEntry::update(self.take_instancer(&path), desc);
        if let Some(lending) = &mut self.lending {
            lending.add(&path, of_instancer(&entry.desc));
        }
        self.instancers.insert(path, entry);
        self.edited |= changed | others;
    }

    /// Adds a light or replaces the prim of the same path.
    pub fn upsert_light(&mut self, desc: LightDesc) {
        let path = desc.prim.path.clone();
        let others = self.remove_other(&path, PrimKind::Light);
        let changed = self.lights.get(&path) != Some(&desc);
        self.lights.insert(path, desc);
        self.edited |= changed | others;
    }

    /// Adds a material or replaces the prim of the same path.
    pub fn upsert_material(&mut self, desc: MaterialDesc) {
        let path = desc.path.clone();
        let others = self.remove_other(&path, PrimKind::Material);
        let (entry, changed) = MaterialEntry::update(self.materials.remove(&path), desc);
        self.materials.insert(path, entry);
        self.material_edits += u64::from(changed);
        self.edited |= changed | others;
    }

    /// The networks of all materials as they arrived, in the order of their paths.
    pub fn materials(&self) -> impl Iterator<Item = &MaterialDesc> {
        self.materials.values().map(|entry| &entry.desc)
    }

    /// Differs after any edit of materials.
    #[must_use]
    pub fn material_edits(&self) -> u64 {
        self.material_edits
    }

    fn take_mesh(&mut self, path: &str) -> Option<MeshEntry> {
        let (path, entry) = self.meshes.remove_entry(path)?;
        if let Some(lending) = &mut self.lending {
            lending.remove(&path, of_mesh(&entry.desc));
        }
        Some(entry)
    }

    fn take_instancer(&mut self, path: &str) -> Option<InstancerEntry> {
        let (path, entry) = self.instancers.remove_entry(path)?;
        if let Some(lending) = &mut self.lending {
            lending.remove(&path, of_instancer(&entry.desc));
        }
        Some(entry)
    }

    /// Removes a prim of this path that is of another kind. Gives whether there was one.
    fn remove_other(&mut self, path: &str, kind: PrimKind) -> bool {
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

    /// Removes the prim at `path` and all below it.
    pub fn remove(&mut self, path: &str) {
        let materials = below(&self.materials, path);
        self.material_edits += u64::from(!materials.is_empty());
        materials.iter().for_each(|path| _ = self.materials.remove(path));
        let lights = below(&self.lights, path);
        lights.iter().for_each(|path| _ = self.lights.remove(path));
        let (meshes, instancers) = (below(&self.meshes, path), below(&self.instancers, path));
        meshes.iter().for_each(|path| _ = self.take_mesh(path));
        instancers.iter().for_each(|path| _ = self.take_instancer(path));
        self.edited |= [materials, lights, meshes, instancers].iter().any(|paths| !paths.is_empty());
    }

    /// Shows meshes of these purposes only; an empty list shows all. "", "geometry" and "default" are the same.
    pub fn set_purposes(&mut self, purposes: &[&str]) {
        let mut purposes: Vec<String> = purposes.iter().map(|p| plain_purpose(p).to_owned()).collect();
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
    /// a sixteenth of all is more. What is larger is sorted in parts: slower, with the same result. 1 GiB before the
    /// first call.
    pub fn set_partition_memory(&mut self, bytes: u64) {
        self.partition.set_item_bytes(bytes);
    }

    /// Sets the camera that decides how finely subdivision surfaces are cut, from the next commit on. Before the first
    /// call they are cut as their refine levels say.
    pub fn set_dicing(&mut self, camera: DicingCamera) {
        if self.dicing != camera {
            let was = std::mem::replace(&mut self.dicing, camera);
            let rate = DicingRate { pixels: f64::max(was.pixels(), self.dicing.pixels()), ..DicingRate::default() };
            let is_cut = |entry: &MeshEntry| BuildDemand { dicing: Some(&rate), ..entry.demand() }.refines(&entry.desc);
            self.edited |= self.meshes.values().any(is_cut);
        }
    }

    /// Meshes that commits have built so far, or found in files.
    #[must_use]
    pub fn meshes_made(&self) -> u64 {
        self.mesh_store.made
    }

    /// Says who opens the textures that displace surfaces or cut them out, for meshes that are built from now on.
    /// Without, the former have their fallbacks.
    pub fn set_height_files(&mut self, files: Arc<dyn HeightFiles>) {
        self.height_files = Some(files);
    }

    /// For tests: whether the boxes of triangles that are cut out are those of all of them. Changes no picture.
    pub fn set_whole_bounds(&mut self, are_whole: bool) {
        self.edited |= std::mem::replace(&mut self.surface_store.has_whole_bounds, are_whole) != are_whole;
    }

    /// Says where meshes that are built from now on are kept when [`Self::mesh_memory`] is full.
    pub fn set_mesh_files(&mut self, files: Option<Arc<dyn MeshFiles>>) {
        self.mesh_store.shelf.files = files;
    }

    /// Sets what host memory there may be in all, bytes, from the next commit on. A mesh that needs more to be built is
    /// left out, with a warning; all others are built side by side as far as there is room
    /// ([`HostMemory::set_room`]). No limit before the first call. Changes nothing else of the result.
    pub fn set_host_budget(&mut self, bytes: u64) {
        let memory = &self.mesh_store.shelf.memory;
        if memory.budget() != Some(bytes).filter(|bytes| *bytes < u64::MAX) {
            memory.set_budget(bytes);
            self.edited |= self.meshes.values().any(MeshEntry::is_left_out);
        }
    }

    /// The host memory that meshes take; without a limit unless one is set.
    #[must_use]
    pub fn mesh_memory(&self) -> &Arc<HostMemory> {
        &self.mesh_store.shelf.memory
    }

    /// The snapshot of the last commit; an empty scene before the first.
    #[must_use]
    pub fn snapshot(&self) -> &Arc<Snapshot> {
        &self.snapshot
    }

    /// Works out the edits since the last commit. Builds what is new on the rayon pool; everything else is shared with
    /// the snapshot before.
    pub fn commit(&mut self) -> SceneCommit {
        if !std::mem::take(&mut self.edited) {
            return SceneCommit { snapshot: self.snapshot.clone(), warnings: Vec::new(), changed: false };
        }
        let mut reports = CommitReports::default();
        let (plan, assets) = self.plan(&mut reports);
        let (made, origin) = self.assembly_store.make(&plan, &assets, self.partition.item_bytes());
        let (assemblies, buckets): (Vec<_>, Vec<_>) = made.into_iter().unzip();
        for (group, assembly) in plan.iter().zip(&assemblies) {
            for (planned, member) in group.members.iter().zip(assembly.members()) {
                reports.add(&planned.path, member.run.dropped());
            }
        }
        let (lights, links) = shining(&self.lights, &self.instancers, &mut reports);
        let dropped = reports.total();
        let CommittedAssets { meshes, surfaces, .. } = assets;
        let mut next = Snapshot { origin, meshes, assemblies, lights, links, surfaces, dropped, ..Snapshot::nothing() };
        let groups: Vec<&GroupId> = plan.iter().map(|group| &group.id).collect();
        let (meshes, assemblies) = (&next.meshes[..], &next.assemblies[..]);
        next.world = self.partition.update(PartitionSource { groups: &groups, meshes, assemblies, buckets: &buckets });
        let changed = self.snapshot.version == 0 || !next.is_same(&self.snapshot);
        if changed {
            next.version = self.snapshot.version + 1;
            next.sum_up();
            self.snapshot = Arc::new(next);
        }
        self.mesh_store.forget_unused();
        SceneCommit { snapshot: self.snapshot.clone(), warnings: self.new_warnings(&reports), changed }
    }

    /// Builds the missing meshes and sorts all prims into groups.
    fn plan(&mut self, reports: &mut CommitReports) -> (Vec<PlanGroup>, CommittedAssets) {
        let purposes = &self.purposes;
        let shows = |p: &str| purposes.is_empty() || purposes.iter().any(|shown| shown == plain_purpose(p));
        let prims = ScenePrims { meshes: &self.meshes, instancers: &self.instancers };
        let hierarchy = PrimHierarchy::new(prims, shows, reports);
        let reachable = hierarchy.reachable(prims, reports);
        self.surface_store.prepare(&mut self.materials, &mut self.meshes, &self.lights, &reachable, reports);
        self.surface_store.offer(&self.meshes, &mut self.instancers, &reachable, reports);
        self.mesh_store.set_options(&mut self.meshes, self.partition.options());
        let prims = ScenePrims { meshes: &self.meshes, instancers: &self.instancers };
        let cuts = dice(prims, &hierarchy, &reachable, &self.dicing);
        let heights = HeightCache::new(self.height_files.clone());
        self.mesh_store.build(&mut self.meshes, &reachable, cuts, &heights);
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
        (plan, CommittedAssets { meshes, indices, surfaces })
    }

    /// The warnings that say something else than the last one for the same prim.
    fn new_warnings(&mut self, reports: &CommitReports) -> Vec<SceneWarning> {
        let warnings = reports.warnings();
        let is_new = |warning: &&SceneWarning| self.warned.get(&warning.path) != Some(&warning.message);
        let new = warnings.values().filter(is_new).cloned().collect();
        self.warned = warnings.into_iter().map(|(path, warning)| (path, warning.message)).collect();
        new
    }
}

impl Snapshot {
    /// The scene of nothing, before the first commit.
    fn nothing() -> Self {
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

fn plain_purpose(purpose: &str) -> &str {
    if matches!(purpose, "" | "geometry") { "default" } else { purpose }
}

/// A path and all paths below it that are there.
fn below<T>(prims: &BTreeMap<Arc<str>, T>, path: &str) -> Vec<Arc<str>> {
    let below = format!("{}/", path.trim_end_matches('/'));
    let mut found: Vec<Arc<str>> = prims
        .range::<str, _>((std::ops::Bound::Included(below.as_str()), std::ops::Bound::Unbounded))
        .take_while(|(candidate, _)| candidate.starts_with(&below))
        .map(|(candidate, _)| candidate.clone())
        .collect();
    found.extend(prims.get_key_value(path).map(|(key, _)| key.clone()));
    found
}
