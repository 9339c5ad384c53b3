// SPDX-License-Identifier: Apache-2.0
//! Instance records: transforms, targets and bounds of the placements of instancers and prims. They are not stored but
//! computed on demand from the arrays of the scene.
//!
//! Follow an instancer: its `arrays` are read element by element (`placement`: transforms, `array_motion`: their change
//! in time), those that are usable are the ranks of a `run` (found by a `scan`), runs with their targets are the
//! members of an [`assembly::Assembly`], which encodes records. A run's `reader` measures one rank, for the partition
//! as an `item`; `rescan` and `diff` spare work after edits. Pure; work is spread over the caller's rayon pool.

pub(crate) mod affine;
pub(crate) mod array_motion;
pub(crate) mod arrays;
pub(crate) mod assembly;
pub(crate) mod diff;
pub(crate) mod instance_primvars;
pub(crate) mod item;
pub(crate) mod motion;
pub(crate) mod placement;
pub(crate) mod run;
pub(crate) mod validate;

use std::sync::Arc;

use crate::desc::InstancedBy;

/// A group of prims with a common frame.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum GroupId {
    /// The root group, which is the world.
    Root,
    /// The group of a prototype.
    Prototype(InstancedBy),
    /// The clusters of a mesh that was split: the hash of the first, or of a mesh in patches, and the prim id.
    Clusters(u128, i32),
    /// A prototype seen in collections of light linking that instances above it are in, sorted.
    Linked(Box<Self>, Arc<[Arc<str>]>),
    /// The placements of an instancer that moves as a whole: its path, and the group that it is in.
    Moving(Arc<str>, Box<Self>),
}
