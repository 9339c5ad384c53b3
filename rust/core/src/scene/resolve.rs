// SPDX-License-Identifier: Apache-2.0
//! Resolves placement: turns the prims' `instanced_by` references into groups (the world and the prototypes with more
//! than one member), children before parents. Keeps nesting, finds cycles, reads no array. Pure.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DAffine3;
use rustc_hash::{FxHashMap, FxHashSet};

use super::entries::{InstancerEntry, MeshEntry};
use super::linked_prims::{LinkedPrims, MAX_LINKED_PRIMS};
use super::linking::{LinkCategories, LinkClass, union};
use super::report::CommitReports;
use crate::desc::{InstancedBy, InstancerPrototype, PrimDesc, TransformSample};
use crate::instancing::GroupId;
use crate::instancing::affine::usable_affine;
use crate::instancing::array_motion::transform_motion;
use crate::instancing::instance_primvars::MemberPrimvar;
use crate::instancing::motion::{MotionKey, PlacementKeys};
use crate::instancing::run::{PrototypeInstances, TransformKey};
use crate::mesh::SceneMesh;

/// Largest depth of nested instancers.
pub const MAX_NESTING: u32 = 32;

/// The target of a planned member.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum PlanTarget {
    /// The asset with this content hash.
    Mesh { key: u128, prim_id: i32 },
    /// A group before this one in the plan.
    Group(usize),
}

/// One prim's contribution to a group.
#[derive(Clone, Debug)]
pub(crate) struct PlanMember {
    /// Path of the mesh or the instancer.
    pub(crate) path: Arc<str>,
    /// Index of the prototype of the instancer; from the number of prototypes on, that of a prototype in a set of
    /// collections; 0 for meshes.
    pub(crate) slot: usize,
    /// Group frame from the prim's frame.
    pub(crate) before: DAffine3,
    /// Instance frame from the target's frame.
    pub(crate) after: DAffine3,
    /// Instances; `None` if it is placed once.
    pub(crate) instances: Option<PrototypeInstances>,
    /// The mesh or group that is placed.
    pub(crate) target: PlanTarget,
    /// Primvars of the instancer that something below reads.
    pub(crate) primvars: Vec<MemberPrimvar>,
    /// Numbers of the primvars that are read below, and that nothing from here down has, sorted.
    pub(crate) lacks: Vec<u32>,
    /// Values of `before` at times of the shutter, for a moving member that is placed once.
    pub(crate) motion: Option<Arc<Vec<TransformKey>>>,
}

/// A group to be made into an assembly.
#[derive(Clone, Debug)]
pub(crate) struct PlanGroup {
    pub(crate) id: GroupId,
    /// Members, sorted by path and slot.
    pub(crate) members: Vec<PlanMember>,
    /// Longest chain of records down to a mesh.
    pub(crate) levels: u32,
    /// Primvars that its members read and do not have themselves, sorted.
    pub(crate) lacks: Vec<u32>,
}

/// Prims of a group by path.
#[derive(Debug, Default)]
pub(crate) struct GroupContent {
    pub(crate) meshes: Vec<Arc<str>>,
    pub(crate) instancers: Vec<Arc<str>>,
}

/// All groups that prims refer to, with their content. Hidden prims are left out.
#[derive(Debug, Default)]
pub(crate) struct PrimHierarchy {
    groups: FxHashMap<GroupId, GroupContent>,
    nothing: GroupContent,
}

/// The database's prims as the resolver sees them.
#[derive(Clone, Copy)]
pub(crate) struct ScenePrims<'a> {
    pub(crate) meshes: &'a BTreeMap<Arc<str>, MeshEntry>,
    pub(crate) instancers: &'a BTreeMap<Arc<str>, InstancerEntry>,
}

impl PrimHierarchy {
    /// Sorts the prims into groups. `shows` tells which purposes are shown.
    pub(crate) fn new(prims: ScenePrims<'_>, shows: impl Fn(&str) -> bool, reports: &mut CommitReports) -> Self {
        let mut hierarchy = Self::default();
        for entry in prims.meshes.values().filter(|e| e.desc.prim.visible && shows(&e.desc.prim.purpose)) {
            hierarchy.add(prims, &entry.desc.prim, reports, |content| &mut content.meshes);
        }
        for entry in prims.instancers.values().filter(|e| e.desc.prim.visible) {
            hierarchy.add(prims, &entry.desc.prim, reports, |content| &mut content.instancers);
        }
        hierarchy
    }

    fn add(
        &mut self,
        prims: ScenePrims<'_>,
        prim: &PrimDesc,
        reports: &mut CommitReports,
        list: fn(&mut GroupContent) -> &mut Vec<Arc<str>>,
    ) {
        if usable_affine(&prim.transform).is_none() {
            reports.of(&prim.path).prim_transforms += 1;
            return;
        }
        if prim.instanced_by.is_empty() {
            list(self.groups.entry(GroupId::Root).or_default()).push(prim.path.clone());
        }
        for (k, parent) in prim.instanced_by.iter().enumerate() {
            let instancer = prims.instancers.get(&parent.instancer);
            if !instancer.is_some_and(|i| i.desc.prototypes.iter().any(|p| p.root == parent.prototype_root)) {
                reports.of(&prim.path).missing_instancers += 1;
            } else if !prim.instanced_by[..k].contains(parent) {
                let id = GroupId::Prototype(parent.clone());
                list(self.groups.entry(id).or_default()).push(prim.path.clone());
            }
        }
    }

    pub(crate) fn content(&self, id: &GroupId) -> &GroupContent {
        self.groups.get(id).unwrap_or(&self.nothing)
    }

    /// Paths of the meshes and instancers that can be reached from the world, and the instancers that cannot because
    /// they contain themselves.
    pub(crate) fn reachable(&self, prims: ScenePrims<'_>, reports: &mut CommitReports) -> FxHashSet<Arc<str>> {
        let mut reached: FxHashSet<Arc<str>> = FxHashSet::default();
        let mut open = vec![&GroupId::Root];
        let mut ids: FxHashMap<&str, Vec<&GroupId>> = FxHashMap::default();
        #[expect(clippy::iter_over_hash_type, reason = "the order inside a bucket does not matter here")]
        for id in self.groups.keys() {
            if let GroupId::Prototype(by) = id {
                ids.entry(&by.instancer).or_default().push(id);
            }
        }
        while let Some(id) = open.pop() {
            let content = self.content(id);
            reached.extend(content.meshes.iter().cloned());
            for path in &content.instancers {
                if reached.insert(path.clone()) {
                    open.extend(ids.get(&**path).into_iter().flatten());
                }
            }
        }
        self.report_cycles(prims, &reached, reports);
        reached
    }

    /// Removes the unreached instancers whose parents are all reached, missing or removed; the remaining ones are on a
    /// cycle or below one.
    fn report_cycles(&self, prims: ScenePrims<'_>, reached: &FxHashSet<Arc<str>>, reports: &mut CommitReports) {
        let mut waits: BTreeMap<&Arc<str>, usize> = BTreeMap::new();
        let mut children: FxHashMap<&Arc<str>, Vec<&Arc<str>>> = FxHashMap::default();
        let unreached = |path: &Arc<str>| prims.instancers.contains_key(path) && !reached.contains(path);
        for (path, entry) in prims.instancers.iter().filter(|(path, _)| !reached.contains(*path)) {
            let parents = entry.desc.prim.instanced_by.iter().map(|by| &by.instancer).filter(|p| unreached(p));
            let mut count = 0;
            for parent in parents {
                children.entry(parent).or_default().push(path);
                count += 1;
            }
            waits.insert(path, count);
        }
        let mut free: Vec<&Arc<str>> = waits.iter().filter(|(_, n)| **n == 0).map(|(p, _)| *p).collect();
        while let Some(path) = free.pop() {
            waits.remove(path);
            for child in children.get(path).into_iter().flatten() {
                if let Some(count) = waits.get_mut(*child) {
                    *count -= 1;
                    if *count == 0 {
                        free.push(child);
                    }
                }
            }
        }
        for path in waits.keys() {
            reports.of(path).instancer_cycles += 1;
        }
    }
}

/// Result of resolving a group.
#[derive(Clone, Debug)]
enum GroupOutcome {
    /// The group is being resolved further up: meeting it again is a cycle.
    Open,
    /// The group has nothing visible.
    Nothing,
    /// Exactly one mesh, placed by the members of the parents directly.
    OneMesh(Box<PlanMember>),
    /// The group is an assembly of its own.
    Group(usize),
}

/// Makes the plan, in which all meshes that have assets are placed; and the list of prims seen in collections besides
/// their own.
pub(crate) fn resolve(
    prims: ScenePrims<'_>,
    hierarchy: &PrimHierarchy,
    reports: &mut CommitReports,
) -> (Vec<PlanGroup>, LinkedPrims) {
    let mut resolver = SceneResolver {
        prims,
        hierarchy,
        reports,
        outcomes: FxHashMap::default(),
        plan: Vec::new(),
        split: FxHashMap::default(),
        linked: LinkedPrims::default(),
    };
    let members = resolver.members(&GroupId::Root, &LinkCategories::default(), 0);
    resolver.push(GroupId::Root, members);
    (resolver.plan, resolver.linked)
}

/// The name of a group in the collections of the instances above it.
fn linked_id(id: GroupId, categories: &LinkCategories) -> GroupId {
    if categories.is_empty() { id } else { GroupId::Linked(Box::new(id), Arc::clone(categories)) }
}

struct SceneResolver<'a> {
    prims: ScenePrims<'a>,
    hierarchy: &'a PrimHierarchy,
    reports: &'a mut CommitReports,
    outcomes: FxHashMap<GroupId, GroupOutcome>,
    plan: Vec<PlanGroup>,
    /// Groups of clusters: by [`crate::mesh::KeptMesh::group`] and the prim id.
    split: FxHashMap<(u128, i32), usize>,
    linked: LinkedPrims,
}

impl SceneResolver<'_> {
    fn push(&mut self, id: GroupId, mut members: Vec<PlanMember>) -> usize {
        members.sort_by(|a, b| (&a.path, a.slot).cmp(&(&b.path, b.slot)));
        let below = members.iter().map(|m| self.levels_of(&m.target)).max().unwrap_or(0);
        let mut lacks: Vec<u32> = members.iter().flat_map(|m| m.lacks.iter().copied()).collect();
        lacks.sort_unstable();
        lacks.dedup();
        self.plan.push(PlanGroup { id, members, levels: below + 1, lacks });
        self.plan.len() - 1
    }

    fn levels_of(&self, target: &PlanTarget) -> u32 {
        match target {
            PlanTarget::Mesh { .. } => 0,
            PlanTarget::Group(index) => self.plan.get(*index).map_or(0, |g| g.levels),
        }
    }

    /// The members of a group below instances that are in `above`, at `depth` records below the root. Depth is bounded,
    /// so the recursion is.
    fn members(&mut self, id: &GroupId, above: &LinkCategories, depth: u32) -> Vec<PlanMember> {
        let (prims, content) = (self.prims, self.hierarchy.content(id));
        let mut members: Vec<PlanMember> =
            content.meshes.iter().filter_map(|path| self.mesh_member(prims.meshes.get(path)?, above)).collect();
        for path in &content.instancers {
            let Some(entry) = prims.instancers.get(path).filter(|e| e.is_usable) else {
                continue;
            };
            let Some(before) = usable_affine(&entry.desc.prim.transform) else {
                continue;
            };
            // Its instances are in a frame of their own, which moves as a whole: their keys are those of one placement.
            let motion = self.motion(&entry.desc.prim);
            let moves = motion.is_some();
            let depth = depth + u32::from(moves);
            let mut placed = Vec::new();
            let inner = if moves { DAffine3::IDENTITY } else { before };
            for (slot, prototype, class, chosen) in placed_apart(entry) {
                let by = InstancedBy { instancer: path.clone(), prototype_root: prototype.root.clone() };
                let here = union(above, &class.categories);
                let (after, target, mut lacks) = match self.outcome(&GroupId::Prototype(by), &here, depth + 1) {
                    GroupOutcome::Open | GroupOutcome::Nothing => continue,
                    GroupOutcome::OneMesh(mesh) => (mesh.before, mesh.target, mesh.lacks),
                    GroupOutcome::Group(index) => {
                        let lacks = self.plan.get(index).map(|group| group.lacks.clone()).unwrap_or_default();
                        (DAffine3::IDENTITY, PlanTarget::Group(index), lacks)
                    }
                };
                if depth + 1 + self.levels_of(&target) > MAX_NESTING {
                    self.reports.of(path).deep_instancers += 1;
                    continue;
                }
                let (arrays, indices) = (entry.arrays.clone(), prototype.indices.clone());
                let instances = Some(PrototypeInstances { arrays, indices, chosen });
                let offers = entry.offers.iter().filter(|offer| lacks.contains(&offer.id));
                let primvars: Vec<MemberPrimvar> = offers.cloned().collect();
                lacks.retain(|id| primvars.iter().all(|primvar| primvar.id != *id));
                let (path, before) = (path.clone(), inner);
                let member = PlanMember { path, slot, before, after, instances, target, primvars, lacks, motion: None };
                placed.push(member);
            }
            if moves && !placed.is_empty() {
                let within = Box::new(linked_id(id.clone(), above));
                let group = self.push(GroupId::Moving(path.clone(), within), placed);
                let lacks = self.plan.get(group).map(|group| group.lacks.clone()).unwrap_or_default();
                members.push(PlanMember {
                    path: path.clone(),
                    slot: 0,
                    before,
                    after: DAffine3::IDENTITY,
                    instances: None,
                    target: PlanTarget::Group(group),
                    primvars: Vec::new(),
                    lacks,
                    motion,
                });
            } else {
                members.append(&mut placed);
            }
        }
        members
    }

    fn outcome(&mut self, plain: &GroupId, above: &LinkCategories, depth: u32) -> GroupOutcome {
        let id = linked_id(plain.clone(), above);
        match self.outcomes.get(&id) {
            Some(GroupOutcome::Open) => {
                if let GroupId::Prototype(by) = plain {
                    self.reports.of(&by.instancer).instancer_cycles += 1;
                }
                return GroupOutcome::Nothing;
            }
            Some(known) => return known.clone(),
            None => {}
        }
        if depth >= MAX_NESTING {
            if let GroupId::Prototype(by) = plain {
                self.reports.of(&by.instancer).deep_instancers += 1;
            }
            return GroupOutcome::Nothing;
        }
        self.outcomes.insert(id.clone(), GroupOutcome::Open);
        let mut members = self.members(plain, above, depth);
        // A target that moves by itself, or turns about a point other than its own origin, keeps its own record: only
        // then do its keys describe its path.
        let turns = match plain {
            GroupId::Prototype(by) => {
                self.prims.instancers.get(&by.instancer).is_some_and(|entry| entry.arrays.motion.is_some())
            }
            _ => false,
        };
        let joins = |m: &PlanMember| {
            m.instances.is_none() && m.motion.is_none() && !(turns && m.before.translation != glam::DVec3::ZERO)
        };
        let one_mesh = members.len() == 1 && members.iter().all(joins);
        let outcome = match members.pop() {
            None => GroupOutcome::Nothing,
            Some(member) if one_mesh => GroupOutcome::OneMesh(Box::new(member)),
            Some(member) => {
                members.push(member);
                GroupOutcome::Group(self.push(id.clone(), members))
            }
        };
        self.outcomes.insert(id, outcome.clone());
        outcome
    }

    fn mesh_member(&mut self, entry: &MeshEntry, above: &LinkCategories) -> Option<PlanMember> {
        let built = entry.built.as_ref()?;
        let prim_id = self.linked.prim_id(self.prims.meshes, entry, above).unwrap_or_else(|| {
            let most = format!("limits of the renderer: {MAX_LINKED_PRIMS} prims in other collections than their own");
            self.reports.note(&entry.desc.prim.path, format!("{most}; links of some instances are ignored"));
            entry.desc.prim_id
        });
        let target = match &built.asset {
            Some(asset) => PlanTarget::Mesh { key: asset.key, prim_id },
            None => PlanTarget::Group(self.clusters(built.group()?, prim_id, &built.clusters, &entry.lacks)),
        };
        Some(PlanMember {
            path: entry.desc.prim.path.clone(),
            slot: 0,
            before: usable_affine(&entry.desc.prim.transform)?,
            after: DAffine3::IDENTITY,
            instances: None,
            target,
            primvars: Vec::new(),
            lacks: entry.lacks.clone(),
            motion: self.motion(&entry.desc.prim),
        })
    }

    /// The motion of a prim. An unusable motion is reported, and the prim stays where it is.
    fn motion(&mut self, prim: &PrimDesc) -> Option<Arc<Vec<TransformKey>>> {
        match transform_keys(prim) {
            Ok(keys) => keys.map(Arc::new),
            Err(why) => {
                self.reports.note(&prim.path, format!("does not move: {why}"));
                None
            }
        }
    }

    /// The group of a split mesh: every cluster is placed untransformed.
    fn clusters(&mut self, name: u128, prim_id: i32, clusters: &[Arc<SceneMesh>], lacks: &[u32]) -> usize {
        if let Some(&known) = self.split.get(&(name, prim_id)) {
            return known;
        }
        let nowhere: Arc<str> = "".into();
        let members = clusters.iter().enumerate().map(|(slot, cluster)| PlanMember {
            path: nowhere.clone(),
            slot,
            before: DAffine3::IDENTITY,
            after: DAffine3::IDENTITY,
            instances: None,
            target: PlanTarget::Mesh { key: cluster.key, prim_id },
            primvars: Vec::new(),
            lacks: lacks.to_vec(),
            motion: None,
        });
        let group = self.push(GroupId::Clusters(name, prim_id), members.collect());
        self.split.insert((name, prim_id), group);
        group
    }
}

/// The prototypes of an instancer, each once for each set of collections that instances of it are in; with its slot,
/// and the positions in the prototype's indices.
fn placed_apart(
    entry: &InstancerEntry,
) -> impl Iterator<Item = (usize, &InstancerPrototype, &LinkClass, Option<Arc<Vec<u32>>>)> {
    let prototypes = &entry.desc.prototypes;
    entry.classes.all().iter().enumerate().flat_map(move |(number, class)| {
        prototypes.iter().enumerate().filter_map(move |(prototype, described)| {
            let chosen = class.chosen(prototype)?;
            Some((prototype + number * prototypes.len(), described, class, chosen))
        })
    })
}

/// The transforms of a moving prim at times of the shutter; `None` if it does not move; an error with the reason if
/// they cannot be used.
#[expect(clippy::cast_possible_truncation, reason = "keys have times in single precision")]
fn transform_keys(prim: &PrimDesc) -> Result<Option<Vec<TransformKey>>, String> {
    let Some(samples) = transform_motion(&prim.motion)? else { return Ok(None) };
    let key = |sample: &TransformSample| {
        Some(TransformKey { time: sample.time as f32, before: usable_affine(&sample.transform)? })
    };
    let Some(transforms) = samples.iter().map(key).collect::<Option<Vec<TransformKey>>>() else {
        return Err("a sample of its transform is singular or not finite".to_owned());
    };
    let mut keys = PlacementKeys::new();
    if !transforms.iter().all(|at| MotionKey::of(at.time, &at.before).is_some_and(|key| keys.push(key))) {
        return Err("its transform is turned inside out between two samples".to_owned());
    }
    Ok(Some(transforms))
}
