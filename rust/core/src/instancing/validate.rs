// SPDX-License-Identifier: Apache-2.0
//! The invariants of a record. For tests and for `doctor`.

use super::assembly::{InstanceRecord, InstanceTarget};
use crate::mesh::Aabb;

/// Checks one record that places something with the box `inside`, in a parent with the box `around`.
pub(crate) fn validate_record(record: &InstanceRecord, inside: &Aabb, around: &Aabb) -> Result<(), &'static str> {
    let [min, max] = record.bounds;
    let bounds = Aabb { min, max };
    let rows = &record.object_from_parent;
    if !rows.iter().flatten().chain(&min).chain(&max).all(|v| v.is_finite()) {
        return Err("a number is not finite");
    }
    if bounds.is_empty() || !around.contains(&bounds) {
        return Err("the box is empty or sticks out of the assembly's");
    }
    if record.index_in_prototype >= record.prototype_count {
        return Err("the index is beyond the prototype's count");
    }
    if matches!(record.target, InstanceTarget::Assembly(_)) && record.prim_id != -1 {
        return Err("an assembly has a prim id");
    }
    if record.keys != 0 {
        // The map is that of the frame's own time, at which the shutter need not be open.
        return Ok(());
    }
    // Every corner of the target, taken back into the parent's frame by the f32 matrix, lies in the box.
    let row = |k: usize| glam::DVec4::from(rows[k].map(f64::from));
    let back = glam::DMat4::from_cols(row(0), row(1), row(2), glam::DVec4::W).transpose().inverse();
    for corner in 0..8_usize {
        let pick = |k: usize| f64::from(if corner >> k & 1 == 0 { inside.min[k] } else { inside.max[k] });
        let p = back.transform_point3(glam::DVec3::new(pick(0), pick(1), pick(2)));
        if (0..3).any(|k| p[k] < f64::from(min[k]) || p[k] > f64::from(max[k])) {
            return Err("the box does not hold the target");
        }
    }
    Ok(())
}
