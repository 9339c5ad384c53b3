// SPDX-License-Identifier: Apache-2.0
//! What places the records of a held chunk: of each its member and its number in the arrays of the instancer, of each
//! member its arrays and the maps around them. With these a device places the records by itself. Pure; any thread.

use glam::{DAffine3, DVec3};

use super::chunk::Chunk;
use crate::array::TypedArray;
use crate::instancing::arrays::ArrayChanges;
use crate::instancing::run::RunSpec;

/// Most members of a chunk that [`Chunk::placing`] describes: each is described in each of its chunks.
pub const PLACING_MEMBERS: usize = 256;

/// A member of a chunk. Its records are at `before * T * R * S * M * after` with the arrays that it has, in the order
/// translations, rotations, scales, transforms; without an instancer there is one record, at `before * after`.
#[derive(Clone, Debug)]
pub struct MemberPlacing {
    /// To the chunk's frame: columns, the translation last.
    pub before: [f64; 12],
    /// Translation of `before` in the assembly's frame.
    pub parent: [f64; 3],
    /// From the target's frame, as `before`; `None` for the identity.
    pub after: Option<[f64; 12]>,
    /// Middle of the target's box.
    pub center: [f64; 3],
    /// Half sides of the target's box.
    pub half: [f64; 3],
    /// Arrays of the instancer, if there is one; absent ones are `None`.
    pub arrays: Option<[Option<TypedArray>; 4]>,
    /// What differs in these arrays from those that the commit before had, if it was looked at.
    pub changes: Option<ArrayChanges>,
    /// Instances that all of these arrays have.
    pub count: usize,
}

impl MemberPlacing {
    fn new(spec: &RunSpec, origin: DVec3) -> Self {
        let [min, max] = [spec.target_bounds.min, spec.target_bounds.max].map(|v| DVec3::from(v.map(f64::from)));
        let arrays = spec.instances.as_ref().map(|instances| &instances.arrays);
        Self {
            before: (DAffine3::from_translation(-origin) * spec.before).to_cols_array(),
            parent: spec.before.translation.to_array(),
            after: (spec.after != DAffine3::IDENTITY).then(|| spec.after.to_cols_array()),
            center: (0.5 * (min + max)).to_array(),
            half: (0.5 * (max - min)).to_array(),
            arrays: arrays.map(|arrays| arrays.transforming().map(|array| array.cloned())),
            changes: arrays.and_then(|arrays| arrays.known_changes().cloned()),
            count: arrays.map_or(1, |arrays| arrays.len()),
        }
    }
}

impl Chunk {
    /// The members of the records, in the order that [`Chunk::each_place`] counts; `None` if some record has keys, or
    /// if there are more than [`PLACING_MEMBERS`].
    #[must_use]
    pub fn placing(&self) -> Option<Vec<MemberPlacing>> {
        let members = self.members();
        let is_at_rest = members.iter().all(|member| member.run.key_count() == 0);
        let describes = is_at_rest && members.len() <= PLACING_MEMBERS;
        describes.then(|| members.iter().map(|member| MemberPlacing::new(member.run.spec(), self.origin())).collect())
    }

    /// Calls `visit` with the number of the member and the instance of each record, in order; `u32::MAX` stands for an
    /// instance that no array has. Chunks of the same [`Chunk::shape`] have the same.
    pub fn each_place(&self, mut visit: impl FnMut(u32, u32)) {
        let members = self.members();
        let numbers: Vec<_> = members.iter().map(|member| member.run.numbers()).collect();
        for (which, rank) in (0..self.len()).filter_map(|at| self.place(at)) {
            let number = numbers.get(which as usize).and_then(|numbers| numbers.of(rank).flatten());
            visit(which, number.and_then(|number| u32::try_from(number).ok()).unwrap_or(u32::MAX));
        }
    }
}
