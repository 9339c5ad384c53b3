// SPDX-License-Identifier: Apache-2.0
//! Checks every invariant of a snapshot, for tests and for `doctor`. It encodes every record once.

use super::snapshot::{InstanceRecord, InstanceTarget, Snapshot, SnapshotError};
use crate::instancing::validate::validate_record;
use crate::mesh::{Aabb, AnyAttribute, Attribute, MeshAsset, MeshSummary};
use oocpt_abi::AttributeRate;

/// Number of records encoded at a time.
const BATCH: usize = 4096;

impl Snapshot {
    /// Checks that every index is in range, every number finite, every box conservative, children come before parents,
    /// and levels and counts are right.
    ///
    /// # Errors
    /// The first broken invariant.
    pub fn validate(&self) -> Result<(), SnapshotError> {
        for (index, mesh) in self.meshes.iter().enumerate() {
            let asset = mesh.asset().map_err(|error| error.to_string());
            let valid = asset.and_then(|asset| match MeshSummary::of(&asset) == ***mesh {
                true => validate_mesh(&asset),
                false => Err("its summary is not that of its arrays".to_owned()),
            });
            valid.map_err(|what| SnapshotError::Mesh { mesh: index, what })?;
        }
        let mut levels: Vec<u32> = Vec::new();
        let mut placements: Vec<u128> = Vec::new();
        for index in 0..self.assemblies.len() {
            let (deepest, count) = self.validate_assembly(index, &levels, &placements)?;
            levels.push(deepest + 1);
            placements.push(count);
        }
        if levels.last().ok_or(SnapshotError::NoRoot)? != &self.max_levels {
            return Err(SnapshotError::Count("max_levels"));
        }
        self.surfaces.check().map_err(SnapshotError::Count)?;
        if placements.last() != Some(&self.counts.instances) {
            return Err(SnapshotError::Count("the number of instances"));
        }
        Ok(())
    }

    /// Returns the levels below the records and the placements of meshes.
    fn validate_assembly(&self, at: usize, levels: &[u32], placed: &[u128]) -> Result<(u32, u128), SnapshotError> {
        let assembly = &self.assemblies[at];
        // Of what is measured late the box is not known.
        let bounds =
            if assembly.is_measured() { assembly.bounds() } else { Aabb { min: [f32::MIN; 3], max: [f32::MAX; 3] } };
        let mut batch = vec![InstanceRecord::default(); BATCH.min(assembly.len())];
        let (mut deepest, mut count) = (0, 0_u128);
        let mut start = 0;
        while start < assembly.len() {
            let end = (start + BATCH).min(assembly.len());
            let records = &mut batch[..end - start];
            assembly.encode(start..end, records);
            for (record, number) in records.iter().zip(start..) {
                let (inside, below, leaves) = match record.target {
                    InstanceTarget::Mesh(m) => self.meshes.get(m as usize).map(|m| (m.bounds, 0, 1)),
                    InstanceTarget::Assembly(a) => {
                        let child = self.assemblies.get(a as usize).map(|a| a.bounds());
                        let known = levels.get(a as usize).zip(placed.get(a as usize));
                        child.zip(known).map(|(bounds, (&levels, &count))| (bounds, levels, count))
                    }
                }
                .ok_or(SnapshotError::Target { assembly: at, record: number })?;
                deepest = deepest.max(below);
                count = count.saturating_add(leaves);
                validate_record(record, &inside, &bounds).map_err(|what| SnapshotError::Record {
                    assembly: at,
                    record: number,
                    what,
                })?;
            }
            start = end;
        }
        if assembly.is_split_mesh() {
            count = 1;
        }
        Ok((deepest, count))
    }
}

fn validate_mesh(mesh: &MeshAsset) -> Result<(), String> {
    let boxes: Vec<Aabb> = (0..mesh.triangles.len()).map(|at| mesh.item_bounds(at)).collect();
    let checked = match mesh.is_clipped {
        true => mesh.bvh.validate_clipped(&boxes),
        false => mesh.bvh.validate_items(&boxes, mesh.kind),
    };
    checked.map_err(|error| error.to_string())?;
    let around = boxes.iter().fold(Aabb::EMPTY, |all, item| all.union(item));
    let is_within = if mesh.is_clipped { around.contains(&mesh.bounds) } else { around == mesh.bounds };
    if mesh.triangles.is_empty() || around != mesh.whole || !is_within {
        return Err("the box is not that of the triangles".to_owned());
    }
    if !mesh.triangles.iter().flat_map(|t| t.vertices.as_flattened()).all(|v| v.is_finite()) {
        return Err("a vertex is not finite".to_owned());
    }
    if !mesh.subsets.is_empty() && mesh.subsets.len() != mesh.triangles.len() {
        return Err("subset numbers do not fit the triangles".to_owned());
    }
    for primvar in &mesh.primvars {
        match &primvar.values {
            AnyAttribute::One(a) => validate_attribute(mesh, Some(a), f32::is_finite)?,
            AnyAttribute::Two(a) => validate_attribute(mesh, Some(a), |v| v.iter().all(|v| v.is_finite()))?,
            AnyAttribute::Three(a) => validate_attribute(mesh, Some(a), |v| v.iter().all(|v| v.is_finite()))?,
            AnyAttribute::Four(a) => validate_attribute(mesh, Some(a), |v| v.iter().all(|v| v.is_finite()))?,
        }
    }
    validate_attribute(mesh, mesh.normals.as_ref(), |n| (glam::Vec3::from(n).length() - 1.0).abs() < 1e-5)?;
    validate_attribute(mesh, mesh.colors.as_ref(), |c| c.iter().all(|v| v.is_finite() && *v >= 0.0))?;
    validate_attribute(mesh, mesh.opacities.as_ref(), |o| (0.0..=1.0).contains(&o))
}

fn validate_attribute<T: Copy>(
    mesh: &MeshAsset,
    attribute: Option<&Attribute<T>>,
    is_valid: impl Fn(T) -> bool,
) -> Result<(), String> {
    let Some(attribute) = attribute else { return Ok(()) };
    let triangles = mesh.triangles.len();
    let fits = match attribute.rate {
        AttributeRate::Constant => attribute.values.len() == 1,
        AttributeRate::Uniform => attribute.values.len() == triangles,
        AttributeRate::FaceVarying => attribute.values.len() == 3 * triangles,
        AttributeRate::Vertex => {
            let in_range = |&corner: &u32| (corner as usize) < attribute.values.len();
            mesh.corner_indices.len() == triangles && mesh.corner_indices.as_flattened().iter().all(in_range)
        }
    };
    if !fits {
        return Err("an attribute does not fit its rate".to_owned());
    }
    if attribute.values.iter().all(|&v| is_valid(v)) {
        Ok(())
    } else {
        Err("an attribute value is unusable".to_owned())
    }
}
