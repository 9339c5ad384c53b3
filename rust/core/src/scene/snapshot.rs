// SPDX-License-Identifier: Apache-2.0
//! The immutable result of a commit. Shared between threads by `Arc`; nothing in it ever changes.

use std::sync::Arc;

use bitflags::bitflags;
use glam::DVec3;

use crate::partition::World;

pub use super::assembly::{Assembly, InstanceFlags, InstanceRecord, Target};
pub use super::light::{Light, blackbody};
pub use super::report::{DroppedData, SceneWarning};
pub use crate::mesh::{Aabb, Attribute, AttributeRate, Bvh2, BvhError, BvhNode, MeshAsset, Triangle};

bitflags! {
    /// What a scene uses. The bits are those of the shaders' FEATURES constant.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub struct SceneFeatures: u32 {
        /// A dome light.
        const DOME = 1;
        /// A distant light.
        const DISTANT = 2;
        /// A mesh with opacity below 1 somewhere.
        const OPACITY = 4;
        /// A mesh with shading normals.
        const NORMALS = 8;
        /// A mesh with `displayColor`.
        const COLORS = 16;
        /// Depth of field. A camera feature: never set by the scene.
        const LENS = 32;
        /// A placement by an instancer.
        const INSTANCING = 64;
        /// A mesh seen from one side only.
        const SINGLE_SIDED = 128;
    }
}

/// Sizes of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneCounts {
    /// Placements of meshes, multiplied out.
    pub instances: u128,
    /// Instance records, not multiplied out.
    pub instance_records: u64,
    /// Triangles of the unique meshes.
    pub unique_triangles: u64,
    /// Triangles, multiplied out.
    pub instanced_triangles: u128,
    /// Unique meshes.
    pub meshes: u64,
    /// Assemblies.
    pub assemblies: u64,
}

/// A scene at one moment.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Grows with each commit that changed something.
    pub version: u64,
    /// World point that is (0, 0, 0) in the root assembly's frame. Kept across edits unless the scene moves far.
    pub origin: DVec3,
    /// Unique meshes in use; [`Target::Mesh`] indexes this. Indices of kept meshes change as little as possible.
    pub meshes: Vec<Arc<MeshAsset>>,
    /// [`Target::Assembly`] indexes this. Children come before parents, the root is last and always there.
    pub assemblies: Vec<Arc<Assembly>>,
    /// Lights that shine, by path.
    pub lights: Vec<Light>,
    /// What the scene uses.
    pub features: SceneFeatures,
    /// Deepest chain of instance records from the root to a mesh; at least 1.
    pub max_levels: u32,
    /// Sizes.
    pub counts: SceneCounts,
    /// Bad data left out.
    pub dropped: DroppedData,
    /// The same scene cut into chunks.
    pub world: Arc<World>,
}

/// A broken invariant of a [`Snapshot`]: always a bug of this crate.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SnapshotError {
    /// There is no root assembly.
    #[error("no root assembly")]
    NoRoot,
    /// A record points outside the snapshot, or at an assembly that does not come before its parent.
    #[error("record {record} of assembly {assembly} has a target out of range")]
    Target {
        /// Assembly index.
        assembly: usize,
        /// Record number.
        record: usize,
    },
    /// A record holds a number that is not finite, an empty box, or an index beyond its prototype's count.
    #[error("record {record} of assembly {assembly} is malformed: {what}")]
    Record {
        /// Assembly index.
        assembly: usize,
        /// Record number.
        record: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// A mesh breaks an invariant.
    #[error("mesh {mesh}: {what}")]
    Mesh {
        /// Mesh index.
        mesh: usize,
        /// What is wrong.
        what: String,
    },
    /// Levels or counts are wrong.
    #[error("{0} is wrong")]
    Count(&'static str),
}
