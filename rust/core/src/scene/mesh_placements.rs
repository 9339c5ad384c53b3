// SPDX-License-Identifier: Apache-2.0
//! The placements of some prims' meshes, multiplied out: where traversal finds them, and what a hit there is called.
//!
//! Pure. Records of prims that are not asked for are passed over without being computed; assemblies and chunks without
//! any are not looked into.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use super::snapshot::Snapshot;
use crate::instancing::assembly::{InstanceRecord, Member, Target};
use crate::partition::{PlacedReader, PlacedValue};

/// A mesh in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshPlacement {
    /// Index into [`Snapshot::meshes`].
    pub mesh: u32,
    /// Prim id of a hit.
    pub prim_id: i32,
    /// Instance id of a hit, wrapping.
    pub instance_id: u32,
    /// From the mesh's frame to the world's, minus [`Snapshot::origin`]: what the single precision maps that traversal
    /// goes through amount to.
    pub world_from_object: DAffine3,
    /// Sum of the distances, in the world, from the origins of the frames on that way to the farthest corner of the
    /// mesh's box: rounding in traversal is in proportion to it.
    pub reach: f64,
    /// Values that instancers give it, by number of the name: those of the innermost that has one, in single precision.
    /// What the mesh itself has wins over them, and is not looked at here.
    pub values: Vec<(u32, [f32; 4])>,
}

/// Whether a prim is asked for, by its id.
type Wanted<'a> = &'a dyn Fn(i32) -> bool;

struct Walk<'a> {
    snapshot: &'a Snapshot,
    wanted: Wanted<'a>,
    /// By assembly: whether a prim that is asked for is in it.
    holds: Vec<bool>,
    most: usize,
    found: Vec<MeshPlacement>,
    is_complete: bool,
}

impl Snapshot {
    /// Placements of the prims that `wanted` says yes to, at most `most`, in an order that depends on the snapshot
    /// only; and whether these are all. Those whose map cannot be inverted are left out, and those that move.
    #[must_use]
    pub fn mesh_placements(&self, wanted: &dyn Fn(i32) -> bool, most: usize) -> (Vec<MeshPlacement>, bool) {
        let mut walk = Walk { snapshot: self, wanted, holds: Vec::new(), most, found: Vec::new(), is_complete: true };
        for assembly in &self.assemblies {
            let holds = assembly.members().iter().any(|member| walk.leads_to(member.target, member.prim_id));
            walk.holds.push(holds);
        }
        for instance in &self.world.instances {
            let Some(chunk) = self.world.chunks.get(instance.chunk as usize) else { continue };
            let rows = instance.chunk_from_world.map(|row| DVec3::from(row.map(f64::from)));
            let matrix3 = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose();
            let chunk_from_world = DAffine3 { matrix3, translation: -(matrix3 * instance.origin) };
            let frames = [instance.origin];
            let is_wanted = |target, prim_id| walk.leads_to(target, prim_id);
            let mut records = Vec::new();
            let room = most - walk.found.len();
            let outer = self.world.placed.row(instance.row);
            let all = chunk.encode_where(&is_wanted, room, &mut |record, member, rank| {
                records.push((record, values(member, &outer, rank)));
            });
            walk.is_complete &= all;
            for (record, values) in &records {
                walk.visit(record, &chunk_from_world, instance.instance_id, &frames, values);
            }
        }
        (walk.found, walk.is_complete)
    }
}

impl Snapshot {
    /// Whether a placement that moves, or one whose points do, is, or holds, one of a prim that `wanted` says yes to.
    #[must_use]
    pub fn moves_any(&self, wanted: &dyn Fn(i32) -> bool) -> bool {
        let mut holds: Vec<bool> = Vec::with_capacity(self.assemblies.len());
        for assembly in &self.assemblies {
            let leads = |member: &&Member| match member.target {
                Target::Mesh(_) => wanted(member.prim_id),
                Target::Assembly(below) => holds.get(below as usize).copied().unwrap_or(false),
            };
            let found: Vec<&Member> = assembly.members().iter().filter(leads).collect();
            let deforms = |target: Target| match target {
                Target::Mesh(mesh) => self.meshes.get(mesh as usize).is_some_and(|mesh| mesh.keys > 0),
                Target::Assembly(_) => false,
            };
            let moves = |member: &&Member| member.key_count() != 0 || deforms(member.target);
            if found.iter().any(|member| moves(member) && member.run.len() > 0) {
                return true;
            }
            holds.push(!found.is_empty());
        }
        false
    }
}

/// The values of a record of `member` inside a placement with the values `outer`.
fn values(member: &Member, outer: &[PlacedValue], rank: u32) -> Vec<PlacedValue> {
    if member.primvars.is_empty() {
        outer.to_vec()
    } else {
        PlacedReader::values(&PlacedReader::all_of(member), outer, rank)
    }
}

impl Walk<'_> {
    fn leads_to(&self, target: Target, prim_id: i32) -> bool {
        match target {
            Target::Mesh(_) => (self.wanted)(prim_id),
            Target::Assembly(assembly) => self.holds.get(assembly as usize).copied().unwrap_or(false),
        }
    }

    /// Notes a record's mesh, or those below it. As deep as assemblies are nested.
    fn visit(
        &mut self,
        record: &InstanceRecord,
        parent_from_world: &DAffine3,
        parent: u32,
        frames: &[DVec3],
        values: &[PlacedValue],
    ) {
        if record.keys != 0 {
            return;
        }
        if self.found.len() >= self.most {
            self.is_complete = false;
            return;
        }
        let [x, y, z] = record.object_from_parent.map(|row| row.map(f64::from));
        let row = |[a, b, c, _]: [f64; 4]| DVec3::new(a, b, c);
        let object_from_parent = DAffine3 {
            matrix3: DMat3::from_cols(row(x), row(y), row(z)).transpose(),
            translation: DVec3::new(x[3], y[3], z[3]),
        };
        let object_from_world = object_from_parent * *parent_from_world;
        let world_from_object = object_from_world.inverse();
        if !world_from_object.is_finite() || !object_from_world.matrix3.determinant().is_normal() {
            return;
        }
        let instance_id = parent.wrapping_mul(record.prototype_count).wrapping_add(record.index_in_prototype);
        let at = world_from_object.translation;
        match record.target {
            Target::Mesh(mesh) => {
                let Some(mesh_of) = self.snapshot.meshes.get(mesh as usize).filter(|mesh| mesh.keys == 0) else {
                    return;
                };
                let bounds = mesh_of.bounds;
                let farthest = [0, 1, 2].map(|k| f64::from(bounds.min[k].abs().max(bounds.max[k].abs())));
                let matrix = world_from_object.matrix3;
                let size = matrix.x_axis.abs() * farthest[0]
                    + matrix.y_axis.abs() * farthest[1]
                    + matrix.z_axis.abs() * farthest[2];
                let reach = size.length() + frames.iter().map(|f| f.distance(at) + size.length()).sum::<f64>();
                let prim_id = record.prim_id;
                let values = values.iter().map(PlacedValue::expanded).collect();
                self.found.push(MeshPlacement { mesh, prim_id, instance_id, world_from_object, reach, values });
            }
            Target::Assembly(index) => {
                let Some(assembly) = self.snapshot.assemblies.get(index as usize).map(Arc::clone) else { return };
                let frames: Vec<DVec3> = frames.iter().copied().chain([at]).collect();
                let mut records = Vec::new();
                let room = self.most - self.found.len();
                let is_wanted = |target, prim_id| self.leads_to(target, prim_id);
                let all = assembly.encode_where(&is_wanted, room, &mut |record, member, rank| {
                    records.push((record, self::values(member, values, rank)));
                });
                self.is_complete &= all;
                for (record, values) in &records {
                    self.visit(record, &object_from_world, instance_id, &frames, values);
                }
            }
        }
    }
}
