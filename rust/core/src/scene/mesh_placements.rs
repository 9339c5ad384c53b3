// SPDX-License-Identifier: Apache-2.0
//! The placements of the meshes of some prims, multiplied out: their transforms as traversal applies them, and the ids
//! of hits on them.
//!
//! Pure. Records of prims that are not asked for are passed over without being computed; assemblies and chunks without
//! any are not looked into.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use super::placement_motion::{PlacementMotion, as_rounded};
use super::snapshot::Snapshot;
use crate::instancing::assembly::{AssemblyMember, InstanceRecord, InstanceTarget};
use crate::instancing::motion::{MotionKey, PlacementKeys, norm_of};
use crate::partition::{PlacedReader, PlacedValue};

/// Factor of the rounding of a moving frame's map, relative to a frame at rest: the map is computed in single
/// precision, from keys, and inverted.
const MOVING_ROUNDINGS: f64 = 4.0;

/// A mesh in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshPlacement {
    /// Index into [`Snapshot::meshes`].
    pub mesh: u32,
    /// Prim id of a hit.
    pub prim_id: i32,
    /// Instance id of a hit, wrapping.
    pub instance_id: u32,
    /// Map from the mesh's frame to the innermost of `motion`, or, for a mesh at rest, to the world's, minus
    /// [`Snapshot::origin`]: the product of the single-precision maps that traversal applies.
    pub outer_from_object: DAffine3,
    /// Motion of that frame in the world, minus [`Snapshot::origin`].
    pub motion: PlacementMotion,
    /// Sum of the distances, in the world, from the origins of these frames to the farthest corner of the mesh's box:
    /// rounding in traversal is proportional to it. Moving frames are weighted by their larger rounding.
    pub reach: f64,
    /// Values that instancers give it, by number of the name: those of the innermost instancer that has one, in single
    /// precision. Values of the mesh itself win over them, and are not considered here.
    pub values: Vec<(u32, [f32; 4])>,
}

impl MeshPlacement {
    /// From the mesh's frame to the world's, minus [`Snapshot::origin`], at a time of the shutter.
    #[must_use]
    pub fn world_at(&self, time: f64) -> DAffine3 {
        self.motion.at(time) * self.outer_from_object
    }

    /// The box in the world, minus [`Snapshot::origin`], of a box in the mesh's frame while the shutter is open.
    #[must_use]
    pub fn swept(&self, min: [f64; 3], max: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let (min, max) = (DVec3::from_array(min), DVec3::from_array(max));
        let matrix = &self.outer_from_object.matrix3;
        let half = 0.5 * (max - min);
        let half = matrix.x_axis.abs() * half.x + matrix.y_axis.abs() * half.y + matrix.z_axis.abs() * half.z;
        let (min, max) = self.motion.swept(self.outer_from_object.transform_point3(0.5 * (min + max)), half);
        (min.to_array(), max.to_array())
    }

    /// The least magnitude of the map's determinant at any time, and an upper bound of the factor by which it stretches
    /// lengths.
    #[must_use]
    pub fn extent(&self) -> (f64, f64) {
        let (least, most) = self.motion.extent();
        let matrix = &self.outer_from_object.matrix3;
        (least * matrix.determinant().abs(), most * norm_of(matrix))
    }
}

/// The result of [`Snapshot::mesh_placements`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshPlacements {
    /// Placements in an order that depends on the snapshot only.
    pub all: Vec<MeshPlacement>,
    /// True if there are no more placements than these.
    pub is_complete: bool,
    /// True if some are left out because the points of their mesh move.
    pub leaves_out_deforming: bool,
}

/// Returns true for the ids of the prims whose placements the caller needs.
type PrimFilter<'a> = &'a dyn Fn(i32) -> bool;

/// The chain of transforms from the world to a frame.
struct FramePath {
    /// Motions in the chain.
    motion: PlacementMotion,
    /// Map to the frame from the innermost moving frame, or from the world.
    here_from_outer: DAffine3,
    /// Origins of the frames in the chain, each in the innermost moving frame around it, and the number of moving
    /// frames.
    frames: Vec<(usize, DVec3)>,
    instance_id: u32,
}

/// A record, with the data of its member that are needed.
struct FoundRecord {
    record: InstanceRecord,
    values: Vec<PlacedValue>,
    /// Keys of a moving record.
    keys: Option<Arc<[MotionKey]>>,
}

impl FoundRecord {
    fn new(record: InstanceRecord, values: Vec<PlacedValue>, keys: Option<&PlacementKeys>) -> Self {
        Self { record, values, keys: keys.map(as_rounded) }
    }
}

struct PlacementTraversal<'a> {
    snapshot: &'a Snapshot,
    wanted: PrimFilter<'a>,
    /// By assembly: true if it contains a prim that is asked for.
    holds: Vec<bool>,
    most: usize,
    found: MeshPlacements,
}

impl Snapshot {
    /// Placements of the prims for which `wanted` is true, at most `most`. Those whose map cannot be inverted are left
    /// out, and those of meshes whose points move.
    #[must_use]
    pub fn mesh_placements(&self, wanted: &dyn Fn(i32) -> bool, most: usize) -> MeshPlacements {
        let found = MeshPlacements { is_complete: true, ..MeshPlacements::default() };
        let mut walk = PlacementTraversal { snapshot: self, wanted, holds: Vec::new(), most, found };
        for assembly in &self.assemblies {
            let holds = assembly.members().iter().any(|member| walk.leads_to(member.target, member.prim_id));
            walk.holds.push(holds);
        }
        for instance in &self.world.instances {
            let Some(chunk) = self.world.chunks.get(instance.chunk as usize) else { continue };
            let rows = instance.chunk_from_world.map(|row| DVec3::from(row.map(f64::from)));
            let matrix3 = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose();
            let way = FramePath {
                motion: PlacementMotion::default(),
                here_from_outer: DAffine3 { matrix3, translation: -(matrix3 * instance.origin) },
                frames: vec![(0, instance.origin)],
                instance_id: instance.instance_id,
            };
            let is_wanted = |target, prim_id| walk.leads_to(target, prim_id);
            let mut records = Vec::new();
            let room = most - walk.found.all.len();
            let outer = self.world.placed.row(instance.row);
            let all = chunk.encode_where(&is_wanted, room, &mut |record, member, rank, keys| {
                records.push(FoundRecord::new(record, values(member, &outer, rank), keys.as_ref()));
            });
            walk.found.is_complete &= all;
            records.iter().for_each(|found| walk.visit(found, &way));
        }
        walk.found
    }
}

/// The values of a record of `member` inside a placement with the values `outer`.
fn values(member: &AssemblyMember, outer: &[PlacedValue], rank: u32) -> Vec<PlacedValue> {
    if member.primvars.is_empty() {
        outer.to_vec()
    } else {
        PlacedReader::values(&PlacedReader::all_of(member), outer, rank)
    }
}

impl PlacementTraversal<'_> {
    fn leads_to(&self, target: InstanceTarget, prim_id: i32) -> bool {
        match target {
            InstanceTarget::Mesh(_) => (self.wanted)(prim_id),
            InstanceTarget::Assembly(assembly) => self.holds.get(assembly as usize).copied().unwrap_or(false),
        }
    }

    /// Notes a record's mesh, or those below it. The recursion is as deep as assemblies are nested.
    fn visit(&mut self, found: &FoundRecord, way: &FramePath) {
        if self.found.all.len() >= self.most {
            self.found.is_complete = false;
            return;
        }
        let record = &found.record;
        let [x, y, z] = record.object_from_parent.map(|row| row.map(f64::from));
        let row = |[a, b, c, _]: [f64; 4]| DVec3::new(a, b, c);
        let object_from_parent = DAffine3 {
            matrix3: DMat3::from_cols(row(x), row(y), row(z)).transpose(),
            translation: DVec3::new(x[3], y[3], z[3]),
        };
        let (motion, object_from_outer) = match &found.keys {
            None => (way.motion.clone(), object_from_parent * way.here_from_outer),
            Some(keys) => match way.motion.within(&way.here_from_outer.inverse(), keys) {
                Some(motion) => (motion, DAffine3::IDENTITY),
                None => return,
            },
        };
        let outer_from_object = object_from_outer.inverse();
        if !outer_from_object.is_finite() || !object_from_outer.matrix3.determinant().is_normal() {
            return;
        }
        let instance_id = way.instance_id.wrapping_mul(record.prototype_count).wrapping_add(record.index_in_prototype);
        let here = (motion.levels.len(), outer_from_object.translation);
        match record.target {
            InstanceTarget::Mesh(mesh) => {
                let Some(mesh_of) = self.snapshot.meshes.get(mesh as usize) else { return };
                if mesh_of.keys != 0 {
                    self.found.leaves_out_deforming = true;
                    return;
                }
                let bounds = mesh_of.bounds;
                let farthest = [0, 1, 2].map(|k| f64::from(bounds.min[k].abs().max(bounds.max[k].abs())));
                let prim_id = record.prim_id;
                let reach = reach(&motion, &outer_from_object, farthest, &way.frames);
                let values = found.values.iter().map(PlacedValue::expanded).collect();
                let placed = MeshPlacement { mesh, prim_id, instance_id, outer_from_object, motion, reach, values };
                self.found.all.push(placed);
            }
            InstanceTarget::Assembly(index) => {
                let Some(assembly) = self.snapshot.assemblies.get(index as usize).map(Arc::clone) else { return };
                let frames = way.frames.iter().copied().chain([here]).collect();
                let inside = FramePath { motion, here_from_outer: object_from_outer, frames, instance_id };
                let mut records = Vec::new();
                let room = self.most - self.found.all.len();
                let is_wanted = |target, prim_id| self.leads_to(target, prim_id);
                let all = assembly.encode_where(&is_wanted, room, &mut |record, member, rank, keys| {
                    records.push(FoundRecord::new(record, values(member, &found.values, rank), keys.as_ref()));
                });
                self.found.is_complete &= all;
                records.iter().for_each(|found| self.visit(found, &inside));
            }
        }
    }
}

/// Computes [`MeshPlacement::reach`]. `farthest`: distance of the mesh's box from its origin, along each axis.
fn reach(motion: &PlacementMotion, map: &DAffine3, farthest: [f64; 3], frames: &[(usize, DVec3)]) -> f64 {
    let at = |time: Option<f64>| {
        let outer = |count: usize| time.map_or(DAffine3::IDENTITY, |time| motion.outer_at(count, time));
        let world = outer(motion.levels.len()) * *map;
        let matrix = world.matrix3;
        let size =
            matrix.x_axis.abs() * farthest[0] + matrix.y_axis.abs() * farthest[1] + matrix.z_axis.abs() * farthest[2];
        let size = size.length();
        let away = |(count, origin): &(usize, DVec3)| {
            outer(*count).transform_point3(*origin).distance(world.translation) + size
        };
        size + frames.iter().map(away).sum::<f64>()
    };
    if motion.is_empty() {
        return at(None);
    }
    // Between two of the times the reach grows only by a small part.
    let (times, _) = motion.times();
    MOVING_ROUNDINGS * motion.magnification() * times.into_iter().map(|time| at(Some(time))).fold(0.0, f64::max)
}
