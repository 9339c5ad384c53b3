// SPDX-License-Identifier: Apache-2.0
//! How finely the subdivision surfaces and displaced meshes of a scene are cut: as their nearest placements need it.
//!
//! Prototypes are looked at as a whole where the camera is farther from them than their size; only near placements are
//! gone into. What comes out is coarse on purpose, so that small movements of the camera change nothing: sizes are
//! rounded up to the next half power of two, places of the camera to a quarter of their distance from the surface. A
//! function of the scene and the camera, not of what was before; but in a live view ([`DicingCamera::live`]) what was
//! cut stays as long as it is fine enough (`found`). Pure; reads every instance of instancers with subdivision
//! surfaces.

mod camera;
mod found;
mod patch_cuts;

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

pub use camera::DicingCamera;
use camera::DicingDensity;
use found::SurfaceDensity;
use patch_cuts::PatchDensities;

use super::entries::{InstancerEntry, MeshEntry};
use super::mesh_outline::{BoundingSphere, stretch};
use super::resolve::{MAX_NESTING, PrimHierarchy, ScenePrims};
use super::surface_cut::SurfaceCut;
use crate::array::ElementType;
use crate::desc::{InstancedBy, InstancerPrototype};
use crate::instancing::GroupId;
use crate::instancing::affine::usable_affine;
use crate::instancing::placement::InstancePlacer;
use crate::mesh::{Aabb, BuildDemand, DicingRate, MIN_PATCHED_FACES};

/// Near placements of a prototype that are gone into, from one place.
const MAX_NEAR: usize = 8;
/// Near placements that are gone into in all: each reads the instances below it.
const MAX_VISITS: usize = 64;

/// A surface that a live view has in patches stays in them up to so many of its radii away.
const LEAVING_PATCHES: f64 = 3.0;

/// How finely each of the `reachable` subdivision surfaces is cut, by path.
pub(crate) fn dice(
    prims: ScenePrims<'_>,
    hierarchy: &PrimHierarchy,
    reachable: &FxHashSet<Arc<str>>,
    camera: &DicingCamera,
) -> FxHashMap<Arc<str>, SurfaceCut> {
    let rate = DicingRate { pixels: camera.pixels, ..DicingRate::default() };
    let is_wanted = |entry: &MeshEntry| BuildDemand { dicing: Some(&rate), ..entry.demand() }.refines(&entry.desc);
    let refined: Vec<(&Arc<str>, &MeshEntry)> =
        prims.meshes.iter().filter(|(path, entry)| reachable.contains(*path) && is_wanted(entry)).collect();
    let bounds: FxHashMap<Arc<str>, BoundingSphere> =
        refined.par_iter().map(|(path, entry)| ((*path).clone(), entry.outline().ball)).collect();
    let mut walk = DicingTraversal {
        prims,
        hierarchy,
        camera,
        bounds: &bounds,
        boxes: FxHashMap::default(),
        found: FxHashMap::default(),
        patches: FxHashMap::default(),
        far: FxHashMap::default(),
        visits: 0,
    };
    if camera.pixels > 0.0 && !bounds.is_empty() {
        walk.visit(&GroupId::Root, &DAffine3::IDENTITY, 0);
        let far: Vec<(GroupId, DicingDensity)> = walk.far.drain().collect();
        for (group, density) in far {
            walk.spread(&group, density, 0);
        }
    }
    share(&refined, walk.found, walk.patches, camera)
}

/// Prims with the same content are cut alike, so that they stay one mesh.
fn share(
    refined: &[(&Arc<str>, &MeshEntry)],
    mut found: FxHashMap<Arc<str>, SurfaceDensity>,
    mut patches: FxHashMap<Arc<str>, PatchDensities>,
    camera: &DicingCamera,
) -> FxHashMap<Arc<str>, SurfaceCut> {
    let mut shared: FxHashMap<u128, (SurfaceDensity, PatchDensities)> = FxHashMap::default();
    for (path, entry) in refined {
        let (of_content, of_patches) = shared.entry(entry.outline().content).or_default();
        of_content.add(found.remove(*path).unwrap_or_default());
        of_patches.add(patches.remove(*path).unwrap_or_default());
    }
    // What there is of a content is the same for all prims that have been cut.
    let kept: FxHashMap<u128, &MeshEntry> = refined
        .iter()
        .filter(|(_, entry)| entry.dicing.pixels > 0.0)
        .map(|(_, entry)| (entry.outline().content, *entry))
        .collect();
    let mut cuts: FxHashMap<u128, SurfaceCut> = FxHashMap::default();
    let mut cut = |entry: &MeshEntry| {
        let content = entry.outline().content;
        if let Some(known) = cuts.get(&content) {
            return Some(known.clone());
        }
        let (found, patches) = shared.get(&content)?;
        let kept = kept.get(&content).copied().filter(|_| camera.is_live);
        let cut = match patches.cut(camera, entry, kept.and_then(|kept| kept.cuts.as_ref())) {
            Some(patches) => SurfaceCut::of_patches(camera.pixels, patches),
            None => {
                let kept = kept.filter(|kept| kept.cuts.is_none()).map(|kept| &kept.dicing);
                let dicing = if camera.is_live { found.live_dicing(camera, kept) } else { found.dicing(camera) };
                SurfaceCut { dicing, patches: None }
            }
        };
        cuts.insert(content, cut.clone());
        Some(cut)
    };
    refined.iter().map(|(path, entry)| ((*path).clone(), cut(entry).unwrap_or_default())).collect()
}

struct DicingTraversal<'a> {
    prims: ScenePrims<'a>,
    hierarchy: &'a PrimHierarchy,
    camera: &'a DicingCamera,
    /// The surfaces that are cut, in their own frames.
    bounds: &'a FxHashMap<Arc<str>, BoundingSphere>,
    /// Boxes of what is cut in each prototype, in its own frame; empty where nothing is.
    boxes: FxHashMap<GroupId, Aabb>,
    found: FxHashMap<Arc<str>, SurfaceDensity>,
    /// The same for the patches of surfaces that have a near placement.
    patches: FxHashMap<Arc<str>, PatchDensities>,
    /// Pixels of a unit of length in a prototype's frame, for those of its placements that are not gone into.
    far: FxHashMap<GroupId, DicingDensity>,
    visits: usize,
}

/// A placement that is near.
struct NearPlacement {
    distance: f64,
    map: DAffine3,
}

impl<'a> DicingTraversal<'a> {
    fn instancers(&self, group: &GroupId) -> Vec<(&'a InstancerEntry, DAffine3)> {
        let content = self.hierarchy.content(group);
        let usable = |path: &Arc<str>| {
            let entry = self.prims.instancers.get(path).filter(|entry| entry.is_usable)?;
            Some((entry, usable_affine(&entry.desc.prim.transform)?))
        };
        content.instancers.iter().filter_map(usable).collect()
    }

    /// The surfaces of a group, with their places in it.
    fn surfaces(&self, group: &GroupId) -> Vec<(&'a Arc<str>, BoundingSphere, DAffine3)> {
        let content = self.hierarchy.content(group);
        let surface = |path: &'a Arc<str>| {
            let transform = &self.prims.meshes.get(path)?.desc.prim.transform;
            Some((path, *self.bounds.get(path)?, usable_affine(transform)?))
        };
        content.meshes.iter().filter_map(surface).collect()
    }

    /// Looks at all placements in a group that is itself placed by `world_from_group`.
    fn visit(&mut self, group: &GroupId, world_from_group: &DAffine3, depth: u32) {
        for (path, ball, map) in self.surfaces(group) {
            let map = *world_from_group * map;
            let placed = ball.placed(&map);
            self.found.entry(path.clone()).or_default().see(self.camera, &placed, ball.radius, &map);
            self.see_patches(path, &ball, &placed, &map);
        }
        if depth >= MAX_NESTING {
            return;
        }
        for (entry, before) in self.instancers(group) {
            for prototype in &entry.desc.prototypes {
                let id = id_of(entry, prototype);
                let bounds = self.box_of(&id, depth);
                if bounds.is_empty() {
                    continue;
                }
                let (mut near, far) = self.look(entry, prototype, &bounds, *world_from_group * before);
                near.sort_by(|a, b| a.distance.total_cmp(&b.distance));
                let room = MAX_NEAR.min(MAX_VISITS - self.visits.min(MAX_VISITS));
                let rest = near.split_off(room.min(near.len()));
                let ball = BoundingSphere::of(&bounds);
                let rest = rest.iter().map(|near| self.density(&ball, &near.map)).fold(far, DicingDensity::max);
                let known = self.far.entry(id.clone()).or_default();
                *known = known.max(rest);
                self.visits += near.len();
                for placement in near {
                    self.visit(&id, &placement.map, depth + 1);
                }
            }
        }
    }

    /// A placement of a surface, patch by patch.
    fn see_patches(&mut self, path: &Arc<str>, ball: &BoundingSphere, placed: &BoundingSphere, map: &DAffine3) {
        let camera = self.camera;
        let Some(entry) = self.prims.meshes.get(path) else { return };
        if entry.desc.face_vertex_counts.len() < MIN_PATCHED_FACES {
            return;
        }
        let found = self.patches.entry(path.clone()).or_default();
        let radii = if camera.is_live && entry.cuts.is_some() { LEAVING_PATCHES } else { 2.0 };
        match entry.patches().filter(|_| placed.is_within(radii, camera.position)) {
            Some(patches) => found.see(camera, patches, ball.radius, map),
            None => {
                let distance = placed.distance(camera.position);
                found.cover(camera.density_in(placed.center, placed.radius, distance).stretched(stretch(map)));
            }
        }
    }

    /// Pixels of a unit of a prototype's frame.
    fn density(&self, ball: &BoundingSphere, map: &DAffine3) -> DicingDensity {
        let placed = ball.placed(map);
        let distance = placed.distance(self.camera.position);
        self.camera.density_in(placed.center, placed.radius, distance).stretched(stretch(map))
    }

    /// The near placements of a prototype, and the largest density of the others.
    fn look(
        &self,
        entry: &InstancerEntry,
        prototype: &InstancerPrototype,
        bounds: &Aabb,
        before: DAffine3,
    ) -> (Vec<NearPlacement>, DicingDensity) {
        let ball = BoundingSphere::of(bounds);
        let nothing = || (Vec::new(), DicingDensity::default());
        let look = |(mut near, far): (Vec<NearPlacement>, DicingDensity), map: DAffine3| {
            let placed = ball.placed(&map);
            if placed.is_near(self.camera.position) {
                near.push(NearPlacement { distance: placed.center.distance(self.camera.position), map });
                (near, far)
            } else {
                (near, far.max(self.density(&ball, &map)))
            }
        };
        let join = |(mut near, far): (Vec<NearPlacement>, DicingDensity),
                    (more, other): (Vec<NearPlacement>, DicingDensity)| {
            near.extend(more);
            (near, far.max(other))
        };
        maps(entry, prototype, bounds, before).fold(nothing, look).reduce(nothing, join)
    }

    /// The box of what is cut in a prototype.
    fn box_of(&mut self, id: &GroupId, depth: u32) -> Aabb {
        if let Some(known) = self.boxes.get(id) {
            return *known;
        }
        // Met again below itself, a prototype is empty.
        self.boxes.insert(id.clone(), Aabb::EMPTY);
        let mut bounds = Aabb::EMPTY;
        for (_, ball, map) in self.surfaces(id) {
            bounds = bounds.union(&placed_box(&ball.placed(&map)));
        }
        if depth < MAX_NESTING {
            for (entry, before) in self.instancers(id) {
                for prototype in &entry.desc.prototypes {
                    let inner = self.box_of(&id_of(entry, prototype), depth + 1);
                    let ball = BoundingSphere::of(&inner);
                    let placed = maps(entry, prototype, &inner, before).map(|map| placed_box(&ball.placed(&map)));
                    bounds = bounds.union(&placed.reduce(|| Aabb::EMPTY, |a, b| a.union(&b)));
                }
            }
        }
        self.boxes.insert(id.clone(), bounds);
        bounds
    }

    /// Hands the density of a prototype down to all surfaces in it.
    fn spread(&mut self, id: &GroupId, density: DicingDensity, depth: u32) {
        if self.far.get(id).copied().unwrap_or_default().covers(density) || depth > MAX_NESTING {
            return;
        }
        self.far.insert(id.clone(), density);
        for (path, _, map) in self.surfaces(id) {
            let density = density.stretched(stretch(&map));
            self.found.entry(path.clone()).or_default().cover(density);
            self.patches.entry(path.clone()).or_default().scatter();
        }
        for (entry, before) in self.instancers(id) {
            for prototype in &entry.desc.prototypes {
                let inner = id_of(entry, prototype);
                let bounds = self.box_of(&inner, depth);
                let largest = maps(entry, prototype, &bounds, before).map(|map| stretch(&map)).reduce(|| 0.0, f64::max);
                self.spread(&inner, density.stretched(largest), depth + 1);
            }
        }
    }
}

fn id_of(entry: &InstancerEntry, prototype: &InstancerPrototype) -> GroupId {
    let (instancer, prototype_root) = (entry.desc.prim.path.clone(), prototype.root.clone());
    GroupId::Prototype(InstancedBy { instancer, prototype_root })
}

fn placed_box(ball: &BoundingSphere) -> Aabb {
    let corner = |sign: f64| (ball.center + DVec3::splat(sign * ball.radius)).as_vec3().to_array();
    Aabb { min: corner(-1.0), max: corner(1.0) }
}

/// The maps of all shown instances of a prototype with the box `bounds`; none for an empty box.
fn maps<'a>(
    entry: &'a InstancerEntry,
    prototype: &'a InstancerPrototype,
    bounds: &Aabb,
    before: DAffine3,
) -> impl ParallelIterator<Item = DAffine3> + 'a {
    let indices = prototype.indices.view();
    let is_usable = !bounds.is_empty() && indices.element() == ElementType::I32;
    let placer = InstancePlacer::new(before, DAffine3::IDENTITY, Some(&entry.arrays), bounds);
    let mask = entry.arrays.mask.as_ref();
    let map = move |at: usize| {
        let number = usize::try_from(indices.index(at)?).ok()?;
        if mask.is_some_and(|mask| mask.view().boolean(number) == Some(false)) {
            return None;
        }
        placer.matrix(Some(number)).filter(DAffine3::is_finite)
    };
    (0..if is_usable { indices.len() } else { 0 }).into_par_iter().with_min_len(1 << 12).filter_map(map)
}
