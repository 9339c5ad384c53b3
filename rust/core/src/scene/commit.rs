// SPDX-License-Identifier: Apache-2.0
//! The steps of a commit: build missing meshes, plan the groups, make or reuse assemblies, sum up. Everything that did
//! not change is shared with the previous snapshot.

use oocpt_abi::{Features, NAME_DISPLAY_OPACITY};
use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::entries::InstancerEntry;
use super::light::{Light, LightEmitter, LightMotion, LinkTable, MAX_INSTANCED_LIGHTS, placements};
use super::report::CommitReports;
use super::resolve::{PlanGroup, PlanMember, PlanTarget};
use super::snapshot::{SceneCounts, Snapshot, SurfaceTables};
use crate::desc::{InstancedBy, LightDesc, LightKind, TransformSample};
use crate::instancing::GroupId;
use crate::instancing::assembly::{Assembly, AssemblyMember, InstanceTarget};
use crate::instancing::run::{InstanceRun, RunSpec, ScanOutput, TransformKey};
use crate::mesh::{Aabb, SceneMesh};
use crate::partition::{OrderBuckets, at_once, cuts_in_stretches};

/// The origin moves when the scene's centre is farther from it than this many times the scene's half size.
const FAR: f64 = 4.0;

/// Assemblies of the last commit by group.
#[derive(Debug, Default)]
pub(crate) struct AssemblyStore {
    groups: FxHashMap<GroupId, Arc<Assembly>>,
    next_key: u64,
    origin: DVec3,
}

fn run_of<'a>(known: &'a Assembly, member: &PlanMember) -> Option<&'a Arc<InstanceRun>> {
    let at = known.members().binary_search_by(|m| m.name().cmp(&(&member.path, member.slot))).ok()?;
    known.members().get(at).map(|m| &m.run)
}

/// An assembly, and the buckets that its scans used.
pub(crate) type MadeAssembly = (Arc<Assembly>, Option<OrderBuckets>);

/// Assets by index, and the index of each content hash.
pub(crate) struct CommittedAssets {
    pub(crate) meshes: Vec<Arc<SceneMesh>>,
    pub(crate) indices: FxHashMap<u128, u32>,
    pub(crate) surfaces: SurfaceTables,
}

impl AssemblyStore {
    /// Makes the assemblies of the plan, root last, and decides the origin. `item_bytes`: bytes that items may take at
    /// once; `late`: what the root places may be measured later.
    pub(crate) fn make(
        &mut self,
        plan: &[PlanGroup],
        assets: &CommittedAssets,
        (item_bytes, late): (u64, bool),
    ) -> (Vec<MadeAssembly>, DVec3) {
        let mut made: Vec<MadeAssembly> = Vec::with_capacity(plan.len());
        let mut groups = FxHashMap::default();
        for group in plan {
            let mut assembly = self.make_one(group, assets, &made, (item_bytes, late));
            if group.id == GroupId::Root
                && let Some(shift) = origin_shift(&assembly.0.bounds())
            {
                self.origin += shift;
                assembly = self.make_one(group, assets, &made, (item_bytes, late));
            }
            groups.insert(group.id.clone(), assembly.0.clone());
            made.push(assembly);
        }
        self.groups = groups;
        (made, self.origin)
    }

    fn make_one(
        &mut self,
        group: &PlanGroup,
        assets: &CommittedAssets,
        made: &[MadeAssembly],
        (item_bytes, late): (u64, bool),
    ) -> MadeAssembly {
        let known = self.groups.get(&group.id);
        // Boxes of other groups are part of those that place them.
        let late = late && group.id == GroupId::Root;
        let shift = if group.id == GroupId::Root { -self.origin } else { DVec3::ZERO };
        // Compares once for all prototypes, before they are visited in parallel.
        for plan in &group.members {
            if let Some(new) = &plan.instances
                && let Some(old) = known.and_then(|known| run_of(known, plan))
            {
                old.compare_arrays(new);
            }
        }
        let specs: Vec<(&PlanMember, InstanceTarget, i32, RunSpec)> = group
            .members
            .par_iter()
            .filter_map(|plan| {
                let (target, prim_id, target_bounds) = target_of(plan, assets, made)?;
                let before = DAffine3::from_translation(shift) * plan.before;
                let instances = plan.instances.clone();
                let shifted = |key: &TransformKey| TransformKey {
                    before: DAffine3::from_translation(shift) * key.before,
                    ..*key
                };
                let motion = plan.motion.as_ref().map(|keys| Arc::new(keys.iter().map(shifted).collect()));
                Some((plan, target, prim_id, RunSpec { before, after: plan.after, instances, target_bounds, motion }))
            })
            .collect();
        let reused: Vec<Option<Arc<InstanceRun>>> = specs
            .par_iter()
            .map(|(plan, .., spec)| InstanceRun::reuse(known.and_then(|known| run_of(known, plan)), spec, late))
            .collect();
        let fresh = specs.iter().zip(&reused).filter(|(_, run)| run.is_none());
        let fresh = fresh.map(|((.., spec), _)| spec.most_ranks()).sum();
        let buckets = buckets(&specs, fresh, item_bytes);
        let keep = match &buckets {
            Some(buckets) => ScanOutput::Buckets(buckets),
            // The root is always opened; others only if they are large. Results that were kept for nothing are freed
            // soon.
            None if group.id == GroupId::Root => ScanOutput::Items,
            None => ScanOutput::Nothing,
        };
        let members: Vec<AssemblyMember> = specs
            .into_par_iter()
            .zip(reused)
            .map(|((plan, target, prim_id, spec), reused)| {
                let run = reused.unwrap_or_else(|| Arc::new(InstanceRun::scan(spec, keep)));
                let (path, primvars) = (plan.path.clone(), plan.primvars.clone());
                AssemblyMember { run, target, prim_id, path, slot: plan.slot, primvars }
            })
            .collect();
        let assembly = match known {
            Some(known) if known.is_made_of(&members) => known.clone(),
            _ => {
                self.next_key += 1;
                Arc::new(Assembly::new(self.next_key, members, matches!(group.id, GroupId::Clusters(..))))
            }
        };
        (assembly, buckets)
    }
}

/// Buckets of a group's placements, if there are too many `fresh` ones to be items at once.
fn buckets(specs: &[(&PlanMember, InstanceTarget, i32, RunSpec)], fresh: u64, item_bytes: u64) -> Option<OrderBuckets> {
    let records: u64 = specs.iter().map(|(.., spec)| spec.most_ranks()).sum();
    let most = at_once(item_bytes, records);
    if !cuts_in_stretches(fresh, records, most) {
        return None;
    }
    let stride = OrderBuckets::stride(records);
    let samples: Vec<_> = specs.par_iter().flat_map_iter(|(.., spec)| spec.samples(stride)).collect();
    Some(OrderBuckets::of_samples(&samples, records, most))
}

/// Index, prim id and box of a member's target. An empty assembly keeps an empty box, and its run no placement.
fn target_of(
    plan: &PlanMember,
    assets: &CommittedAssets,
    made: &[MadeAssembly],
) -> Option<(InstanceTarget, i32, Aabb)> {
    match plan.target {
        PlanTarget::Mesh { key, prim_id } => {
            let index = *assets.indices.get(&key)?;
            Some((InstanceTarget::Mesh(index), prim_id, assets.meshes.get(index as usize)?.bounds))
        }
        PlanTarget::Group(group) => {
            Some((InstanceTarget::Assembly(u32::try_from(group).ok()?), -1, made.get(group)?.0.bounds()))
        }
    }
}

/// How far the origin must move so that the scene is not far from it; `None` if it need not move.
fn origin_shift(bounds: &Aabb) -> Option<DVec3> {
    let min = DVec3::from(bounds.min.map(f64::from));
    let max = DVec3::from(bounds.max.map(f64::from));
    let center = 0.5 * (min + max);
    let is_far = center.abs().max_element() > FAR * (0.5 * (max - min)).max_element();
    (!bounds.is_empty() && is_far).then_some(center)
}

/// The lights that emit, by path, those inside prototypes once for each of their placements; and the numbers of their
/// categories.
pub(crate) fn visible_lights(
    lights: &BTreeMap<Arc<str>, LightDesc>,
    instancers: &BTreeMap<Arc<str>, InstancerEntry>,
    reports: &mut CommitReports,
) -> (Vec<Light>, LinkTable) {
    let mut out = Vec::new();
    let mut links = LinkTable::default();
    let mut instanced = 0_usize;
    let is_own = |desc: &LightDesc| desc.prim.visible && !matches!(desc.kind, LightKind::Mesh { .. });
    for (path, desc) in lights.iter().filter(|(_, desc)| is_own(desc)) {
        let (light_link, shadow_link) =
            (links.category(desc.light_link.as_ref()), links.category(desc.shadow_link.as_ref()));
        let is_there = |by: &InstancedBy| {
            let entry = instancers.get(&by.instancer);
            entry.is_some_and(|entry| entry.desc.prototypes.iter().any(|p| p.root == by.prototype_root))
        };
        reports.of(path).missing_instancers += desc.prim.instanced_by.iter().filter(|by| !is_there(by)).count() as u64;
        let place = |transform: &DAffine3, out: &mut Vec<Light>, reports: &mut CommitReports| match Light::placed(
            desc, transform,
        ) {
            Some(light) if light.is_black() => {}
            Some(light) => out.push(Light { light_link, shadow_link, ..light }),
            None => reports.of(path).lights += 1,
        };
        let mut refused = None;
        let mut place_moving = |transform: &DAffine3, samples: &[TransformSample], reports: &mut CommitReports| {
            let placed_before = out.len();
            place(transform, &mut out, reports);
            for light in out.iter_mut().skip(placed_before) {
                match LightMotion::new(desc, light, samples) {
                    Ok(motion) => light.motion = motion.map(Arc::new),
                    Err(why) => refused = Some(why),
                }
            }
        };
        if desc.prim.instanced_by.is_empty() {
            place_moving(&DAffine3::from_mat4(desc.prim.transform), &desc.prim.motion, reports);
        } else {
            let (places, is_cut) = placements(&desc.prim, instancers, MAX_INSTANCED_LIGHTS - instanced);
            instanced += places.len();
            places.iter().for_each(|place| place_moving(&place.world, &place.samples, reports));
            reports.of(path).instanced_lights += u64::from(is_cut);
        }
        if let Some(why) = refused {
            reports.note(path, format!("the light does not move: {why}"));
        }
    }
    (out, links)
}

impl Snapshot {
    /// Fills features, kinds of leaves, levels and counts from the rest.
    pub(crate) fn update_totals(&mut self) {
        self.max_levels = self.find_levels();
        self.features = self.find_features();
        self.leaf_kinds = self.meshes.iter().map(|mesh| mesh.kind).collect();
        self.counts = self.count();
    }

    fn find_levels(&self) -> u32 {
        let mut levels: Vec<u32> = Vec::with_capacity(self.assemblies.len());
        for assembly in &self.assemblies {
            let below = assembly.members().iter().filter(|m| m.run.len() > 0).map(|m| match m.target {
                InstanceTarget::Mesh(_) => 0,
                InstanceTarget::Assembly(a) => levels.get(a as usize).copied().unwrap_or(0),
            });
            levels.push(1 + below.max().unwrap_or(0));
        }
        levels.last().copied().unwrap_or(1)
    }

    fn find_features(&self) -> Features {
        let mut features = Features::empty();
        for light in &self.lights {
            features |= match light.emitter {
                LightEmitter::Dome { .. } => Features::DOME,
                LightEmitter::Distant { .. } => Features::DISTANT,
                LightEmitter::Local(_) => Features::LOCAL_LIGHTS,
            };
        }
        for mesh in &self.meshes {
            features.set(Features::DEFORMATION, features.contains(Features::DEFORMATION) || mesh.keys > 0);
            features.set(Features::OPACITY, features.contains(Features::OPACITY) || mesh.opacities.is_some());
            features.set(Features::NORMALS, features.contains(Features::NORMALS) || mesh.normals.is_some());
            features.set(Features::COLORS, features.contains(Features::COLORS) || mesh.colors.is_some());
        }
        if self.assemblies.iter().any(|a| a.members().iter().any(|m| m.run.is_instanced())) {
            features |= Features::INSTANCING;
        }
        let placed = || self.assemblies.iter().flat_map(|a| a.members()).filter(|m| m.run.len() > 0);
        for primvar in placed().flat_map(|member| &member.primvars) {
            features |= Features::INSTANCE_PRIMVARS;
            if primvar.id == NAME_DISPLAY_OPACITY {
                features |= Features::OPACITY | Features::INSTANCE_OPACITY;
            }
        }
        features.set(Features::MOTION, placed().any(|member| member.run.key_count() != 0));
        features | self.surfaces.features()
    }

    fn count(&self) -> SceneCounts {
        // Placements and triangles of each assembly, multiplied out.
        let mut totals: Vec<(u128, u128)> = Vec::with_capacity(self.assemblies.len());
        let (mut records, mut clusters, mut split, mut split_assemblies) = (0_u64, 0_u64, FxHashSet::default(), 0_u64);
        for assembly in &self.assemblies {
            let (mut instances, mut triangles) = (0_u128, 0_u128);
            for member in assembly.members() {
                let (i, t) = match member.target {
                    InstanceTarget::Mesh(m) => (1, self.meshes.get(m as usize).map_or(0, |m| u128::from(m.triangles))),
                    InstanceTarget::Assembly(a) => totals.get(a as usize).copied().unwrap_or((0, 0)),
                };
                let times = member.run.len() as u128;
                instances = instances.saturating_add(times.saturating_mul(i));
                triangles = triangles.saturating_add(times.saturating_mul(t));
            }
            if assembly.is_split_mesh() {
                // Users see one mesh, not an assembly of its clusters.
                totals.push((1, triangles));
                split_assemblies += 1;
                if split.insert(assembly.members().first().map(|m| m.target)) {
                    clusters += assembly.len() as u64;
                }
                continue;
            }
            totals.push((instances, triangles));
            records += assembly.len() as u64;
        }
        let (instances, instanced_triangles) = totals.last().copied().unwrap_or((0, 0));
        SceneCounts {
            instances,
            instance_records: records,
            unique_triangles: self.meshes.iter().map(|m| m.triangles).sum(),
            instanced_triangles,
            meshes: (self.meshes.len() as u64).saturating_sub(clusters) + split.len() as u64,
            assemblies: self.assemblies.len() as u64 - split_assemblies,
        }
    }

    /// Returns true if both describe the same scene, by the identities of shared parts.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        fn shared<T>(a: &[Arc<T>], b: &[Arc<T>]) -> bool {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| Arc::ptr_eq(a, b))
        }
        shared(&self.meshes, &other.meshes)
            && shared(&self.assemblies, &other.assemblies)
            && self.lights == other.lights
            && self.surfaces.is_same(&other.surfaces)
            && self.links == other.links
            && self.origin == other.origin
            && self.dropped == other.dropped
            && Arc::ptr_eq(&self.world, &other.world)
    }
}
