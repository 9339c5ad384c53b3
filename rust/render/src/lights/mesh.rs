// SPDX-License-Identifier: Apache-2.0
//! Meshes that emit light, as lights: the placements that take part, the tree over them, and the tables in which hits
//! are looked up (`shaders/light/mesh.glsl`).
//!
//! A placement takes part if its prim has a material that emits and has no cutouts, and if the prim, instance and mesh
//! of a hit identify it. It does not if texture coordinates of its emission come from an instancer. Memory grows with
//! unique triangles and with placements, both bounded; placements beyond the bounds are met by BSDF rays alone, which
//! loses no light. The result depends on the snapshot only, not on what is on the device. Pure.

use super::emission::halves;
use super::emission::{EmissionMaps, EmittedPower, PlacedEmission, PrimEmission};
use super::emitter::MeshEmitter;
use super::mesh_motion::{MAX_KEYS, MotionTables, has_usable_size, swept};
use super::placed_bounds::in_world;
use super::tree::{self, LightBounds, NOTHING};
use super::{EVEN_SHARE, count, narrow};
use crate::textures::TextureCache;
use oocpt_abi::{
    Features, GpuLightKey, GpuLightLeaf, GpuLightMesh, GpuLightNode, GpuLightTriangle, GpuLightValue, GpuMeshLight,
    NO_INDEX, PrimMask,
};
use oocpt_core::mesh::{LeafKind, SceneMesh};
use oocpt_core::partition::PartitionedWorld;
use oocpt_core::scene::{MeshPlacement, MeshPlacements, Snapshot};
use rustc_hash::FxHashMap;
use std::sync::{Arc, Weak};

/// Most placements: 54 MB on the device with their tree.
const MAX_PLACEMENTS: usize = 1 << 18;
/// Most triangles of unique meshes: 60 MB on the device in large meshes, up to 200 MB where each has a leaf of its own.
const MAX_TRIANGLES: usize = 1 << 20;
/// Meshes from this number on do not fit in the record of a hit.
const MAX_LIGHT_MESH: u32 = 1 << 24;
/// Rounding of single precision in traversal, relative to [`MeshPlacement::reach`]: a few roundings in each frame.
const TRAVERSAL_ERROR: f64 = 8.0 / (1_u64 << 24) as f64;

/// The mesh lights of a scene in the layout of the device.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MeshLights {
    pub(crate) placements: Vec<GpuMeshLight>,
    pub(crate) meshes: Vec<GpuLightMesh>,
    /// The tree over the placements, then those of the meshes.
    pub(crate) nodes: Vec<GpuLightNode>,
    pub(crate) leaves: Vec<GpuLightLeaf>,
    pub(crate) triangles: Vec<GpuLightTriangle>,
    pub(crate) faces: Vec<[u32; 2]>,
    /// Values beside `triangles`; empty, as the next two are, if all emissions are constants of materials.
    pub(crate) values: Vec<GpuLightValue>,
    /// Weights beside `faces`.
    pub(crate) face_weights: Vec<f32>,
    /// Emissions of slots of placements.
    pub(crate) placed_values: Vec<[f32; 3]>,
    /// The values at corners of triangles that programs read: see [`GpuLightValue::corners`].
    pub(crate) corners: Vec<[f32; 4]>,
    /// Most textures that are looked up for a point.
    pub(crate) lookups: u32,
    /// The motion of moving lights: see [`oocpt_abi::LightTablePointers::mesh_motion`]. Empty if none moves, as the
    /// next is.
    pub(crate) motion: Vec<[u32; 2]>,
    pub(crate) keys: Vec<GpuLightKey>,
    /// Bounds and power of all placements.
    pub(super) bounds: LightBounds,
    /// The reason why some emitting meshes are not included.
    pub(crate) warning: Option<String>,
}

/// The emitters and maps that are kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct MeshLightCache {
    last: Option<(u64, Weak<PartitionedWorld>, Option<Arc<MeshLights>>)>,
    emitters: FxHashMap<EmitterKey, Option<Arc<MeshEmitter>>>,
    maps: EmissionMaps,
    /// True if an emitting mesh deforms, so that it is not included.
    deforms: bool,
}

type EmitterKey = (u128, Vec<u32>);

impl MeshLightCache {
    /// The mesh lights of a snapshot; `None` without any. Without `images` textures emit nothing.
    pub(crate) fn get(&mut self, snapshot: &Snapshot, images: Option<&TextureCache>) -> Option<Arc<MeshLights>> {
        if !snapshot.features.contains(Features::EMISSION) {
            *self = Self::default();
            return None;
        }
        if let Some((version, world, lights)) = &self.last
            && *version == snapshot.version
            && Weak::as_ptr(world) == Arc::as_ptr(&snapshot.world)
        {
            return lights.clone();
        }
        let lights = self.make(snapshot, images).map(Arc::new);
        self.last = Some((snapshot.version, Arc::downgrade(&snapshot.world), lights.clone()));
        lights
    }

    /// The warning about the lights of the last snapshot that deform.
    pub(crate) fn warning(&self) -> Option<String> {
        let text =
            "emissive meshes whose points move are not sampled as lights, but met by chance only, which is noisy";
        self.deforms.then(|| text.to_owned())
    }

    fn make(&mut self, snapshot: &Snapshot, images: Option<&TextureCache>) -> Option<MeshLights> {
        let materials = self.maps.powers(snapshot, images);
        let emission: Vec<Option<PrimEmission>> = (-1..i64::try_from(snapshot.surfaces.prims.len()).unwrap_or(0) - 1)
            .map(|id| is_seen_alike(snapshot, id).then(|| PrimEmission::of_prim(snapshot, id, &materials))?)
            .collect();
        let of_prim = |id: i32| emission.get(usize::try_from(i64::from(id) + 1).ok()?)?.as_ref();
        let MeshPlacements { all: mut placements, mut is_complete, leaves_out_deforming } =
            snapshot.mesh_placements(&|prim| of_prim(prim).is_some(), MAX_PLACEMENTS);
        self.deforms = leaves_out_deforming;
        drop_ambiguous(&mut placements);
        let known = std::mem::take(&mut self.emitters);
        let mut making = MeshLightBuilder::default();
        for placement in &placements {
            let (Some(mesh), Some(emission)) =
                (snapshot.meshes.get(placement.mesh as usize), of_prim(placement.prim_id))
            else {
                continue;
            };
            // Leaves other than triangles are found by BSDF sampling only, as meshes with cutouts are.
            if placement.mesh >= MAX_LIGHT_MESH || mesh.opacities.is_some() || mesh.kind != LeafKind::Triangles {
                continue;
            }
            let placed = emission.placed(mesh, &placement.values);
            let emission = placed.as_ref().map_or(emission, |placed| &placed.emission);
            let key: EmitterKey = (mesh.key, emission.key());
            let entry = self.emitters.entry(key.clone()).or_insert_with(|| match known.get(&key) {
                Some(known) => known.clone(),
                None if mesh.triangles > MAX_TRIANGLES as u64 => None,
                None => emitter_of(mesh, emission).map(Arc::new),
            });
            let Some(emitter) = entry.clone() else {
                is_complete &= mesh.triangles <= MAX_TRIANGLES as u64;
                continue;
            };
            match making.number(&emitter) {
                Some(number) => is_complete &= making.add(placement, number, emission, &emitter, placed.as_ref()),
                None => is_complete = false,
            }
        }
        making.finish((!is_complete).then(|| {
            format!(
                "emissive meshes: more than {MAX_PLACEMENTS} placements, {MAX_TRIANGLES} unique triangles or \
                 {MAX_KEYS} keys of motions emit light; the rest is not sampled as lights, but met by chance only, \
                 which is noisy"
            )
        }))
    }
}

/// Returns true if all rays that leave surfaces see a prim. Else shadow rays would find its light for those that do
/// not, too.
fn is_seen_alike(snapshot: &Snapshot, prim_id: i64) -> bool {
    let mask = usize::try_from(prim_id + 1).ok().and_then(|index| snapshot.surfaces.masks.get(index));
    mask.is_none_or(|mask| !mask.intersects(PrimMask::INDIRECT))
}

/// The emitter of a mesh; `None` if nothing emits, or its asset cannot be loaded.
fn emitter_of(mesh: &SceneMesh, emission: &PrimEmission) -> Option<MeshEmitter> {
    match mesh.asset() {
        Ok(asset) => MeshEmitter::new(&asset, emission),
        Err(error) => {
            // Loading it to the device will fail, too, which ends the render with this message.
            tracing::warn!(%error, "an emissive mesh");
            None
        }
    }
}

/// Sorts placements by the identity of a hit; those with the same identity are left out.
fn drop_ambiguous(placements: &mut Vec<MeshPlacement>) {
    let key = |p: &MeshPlacement| (p.prim_id, p.instance_id, p.mesh);
    placements.retain(|placement| placement.prim_id >= 0);
    placements.sort_by_key(key);
    let keys: Vec<_> = placements.iter().map(key).collect();
    let mut at = 0_usize;
    placements.retain(|placement| {
        let own = key(placement);
        let before = at.checked_sub(1).and_then(|at| keys.get(at)) == Some(&own);
        at += 1;
        !before && keys.get(at) != Some(&own)
    });
}

#[derive(Default)]
struct MeshLightBuilder {
    placements: Vec<GpuMeshLight>,
    bounds: Vec<LightBounds>,
    numbers: FxHashMap<*const MeshEmitter, u32>,
    emitters: Vec<Arc<MeshEmitter>>,
    triangles: usize,
    placed_values: Vec<[f32; 3]>,
    lookups: usize,
    motions: MotionTables,
}

impl MeshLightBuilder {
    /// The number of an emitter; `None` if there is no room for it.
    fn number(&mut self, emitter: &Arc<MeshEmitter>) -> Option<u32> {
        if let Some(&number) = self.numbers.get(&Arc::as_ptr(emitter)) {
            return Some(number);
        }
        let triangles = self.triangles + emitter.triangles.len();
        if triangles > MAX_TRIANGLES {
            return None;
        }
        self.triangles = triangles;
        let number = u32::try_from(self.emitters.len()).ok()?;
        self.numbers.insert(Arc::as_ptr(emitter), number);
        self.emitters.push(Arc::clone(emitter));
        Some(number)
    }

    /// Adds a placement; returns false if there is no room for its motion.
    fn add(
        &mut self,
        placement: &MeshPlacement,
        light_mesh: u32,
        emission: &PrimEmission,
        emitter: &MeshEmitter,
        placed: Option<&PlacedEmission>,
    ) -> bool {
        let scale = emission.scale;
        let map = &placement.outer_from_object;
        let columns = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis].map(|column| column.to_array());
        let at = map.translation.to_array();
        let position = at.map(narrow);
        let [x, y, z] = columns.map(|column| column.map(narrow));
        let error = TRAVERSAL_ERROR * placement.reach;
        let gpu = GpuMeshLight {
            position,
            light_mesh,
            position_lo: [0, 1, 2].map(|k| narrow(at[k] - f64::from(position[k]))),
            scale,
            x,
            prim_id: placement.prim_id.unsigned_abs(),
            y,
            instance_id: placement.instance_id,
            z,
            mesh: placement.mesh,
            error: narrow(error),
            values: placed.map_or(NO_INDEX, |_| u32::try_from(self.placed_values.len()).unwrap_or(NO_INDEX)),
            trail: [0; 2],
        };
        let bounds = if placement.motion.is_empty() {
            in_world(&emitter.bounds, columns, at, error, f64::from(scale))
        } else {
            swept(&emitter.bounds, placement, error, f64::from(scale))
        };
        let [min, max] = [bounds.min, bounds.max].map(|corner| corner.map(narrow));
        let numbers = [gpu.position, gpu.x, gpu.y, gpu.z, min, max, [gpu.error, narrow(bounds.power), 0.0]];
        let is_sound = numbers.as_flattened().iter().all(|v| v.is_finite());
        if is_sound && has_usable_size(placement) {
            if !self.motions.add(&placement.motion) {
                return false;
            }
            self.placements.push(gpu);
            self.bounds.push(bounds);
            self.placed_values.extend(placed.iter().flat_map(|placed| &placed.emissions));
            let lookups = emission.by_slot.iter().map(EmittedPower::lookups).max();
            self.lookups = self.lookups.max(lookups.unwrap_or(0));
        }
        true
    }

    fn finish(mut self, warning: Option<String>) -> Option<MeshLights> {
        if self.placements.is_empty() {
            return None;
        }
        let all = self.bounds.iter().fold(NOTHING, |sum, bounds| sum.union(bounds));
        let (total, even) = (all.power, 1.0 / count(self.bounds.len()));
        for bounds in &mut self.bounds {
            let is_usable = total > 0.0 && total.is_finite();
            bounds.power = if is_usable { (1.0 - EVEN_SHARE) * bounds.power / total + EVEN_SHARE * even } else { even };
        }
        let mut nodes = tree::build(&self.bounds);
        for (light, trail) in self.placements.iter_mut().zip(tree::trails(&nodes, self.bounds.len())) {
            light.trail = halves(trail);
        }
        let (motion, keys) = self.motions.finish();
        let mut lights = MeshLights {
            motion,
            keys,
            placements: self.placements,
            meshes: Vec::new(),
            nodes: Vec::new(),
            leaves: Vec::new(),
            triangles: Vec::new(),
            faces: Vec::new(),
            values: Vec::new(),
            face_weights: Vec::new(),
            corners: Vec::new(),
            lookups: u32::try_from(self.lookups).unwrap_or(u32::MAX),
            bounds: all,
            warning,
            placed_values: self.placed_values,
        };
        let varies = !lights.placed_values.is_empty() || self.emitters.iter().any(|emitter| emitter.varies);
        let number = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        for emitter in &self.emitters {
            let (first_leaf, first_triangle) = (number(lights.leaves.len()), number(lights.triangles.len()));
            let root = tree::append(&mut nodes, &emitter.nodes, first_leaf);
            let (first_face, face_count) = (number(lights.faces.len()), number(emitter.faces.len()));
            lights.meshes.push(GpuLightMesh { root, first_face, face_count, pad: 0 });
            let leaf = |leaf: &GpuLightLeaf| GpuLightLeaf { first: leaf.first + first_triangle, ..*leaf };
            lights.leaves.extend(emitter.leaves.iter().map(leaf));
            lights.triangles.extend_from_slice(&emitter.triangles);
            lights.faces.extend(emitter.faces.iter().map(|[face, leaf]| [*face, leaf + first_leaf]));
            if varies {
                lights.face_weights.extend_from_slice(&emitter.face_weights);
                for (([a, b, c], weight), corners) in emitter.values.iter().zip(&emitter.corners) {
                    let first = number(lights.corners.len());
                    lights.corners.extend(corners.iter().flat_map(|corners| corners.as_flattened()));
                    let corners = if corners.is_some() { first } else { NO_INDEX };
                    lights.values.push(GpuLightValue { a: *a, weight: *weight, b: *b, corners, c: *c, pad1: 0 });
                }
            }
        }
        lights.nodes = nodes;
        Some(lights)
    }
}

#[cfg(test)]
pub(super) mod tests;
