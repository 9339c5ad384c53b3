// SPDX-License-Identifier: Apache-2.0
//! The immutable result of a commit. It is shared between threads by `Arc` and never changes.

use oocpt_abi::{Features, MaterialFlags, NO_NAME, PrimMask};
use std::collections::BTreeSet;
use std::sync::Arc;

use glam::DVec3;

use crate::desc::DroppedData;
use crate::material::{Material, TextureRef};
use crate::partition::PartitionedWorld;

pub use super::light::{
    DomeTexture, IesError, IesProfile, Light, LightEmitter, LightMotion, LightShaping, LinkTable, LocalLight,
    LocalShape, blackbody,
};
pub use super::report::SceneWarning;
pub use crate::instancing::assembly::{Assembly, InstanceRecord, InstanceTarget};
pub use crate::mesh::{Aabb, Attribute, Bvh2, BvhError, BvhNode, LeafKind, MeshAsset, SceneMesh, Triangle};

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
    /// Number of assemblies.
    pub assemblies: u64,
}

/// What a prim looks like: an entry of [`SurfaceTables::prims`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PrimRecord {
    /// First of its slots: the mesh's own material, then those of its subsets.
    pub first_slot: u32,
    /// Number of slots; 0 = no prim has this id, or it has no materials at all.
    pub slot_count: u32,
    /// Which categories it is in: index into [`SurfaceTables::category_sets`].
    pub category_set: u32,
    /// Of a prim that is another one below instances that are in collections of their own: the prim id of that.
    pub shown_as: Option<i32>,
}

/// What surfaces look like: materials, and which prim has which. Empty where no mesh has a material and none is in a
/// collection.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceTables {
    /// Materials in use.
    pub materials: Vec<Arc<Material>>,
    /// Their paths; a material that a mesh light dresses has that of its mesh, with a number.
    pub material_paths: Vec<Arc<str>>,
    /// Textures in use, each once.
    pub textures: Vec<TextureRef>,
    /// By prim id + 1 (0: meshes without an id); may be shorter than the largest id.
    pub prims: Vec<PrimRecord>,
    /// Material of each slot, or `NO_MATERIAL`. A triangle's slot is that of its prim's record plus its subset number
    /// ([`MeshAsset::subsets`]).
    pub material_slots: Vec<u32>,
    /// Labels in light path expressions by prim id + 1; empty if no prim has one, and may be shorter than the largest
    /// id.
    pub labels: Vec<Option<Arc<str>>>,
    /// What prims do without, by prim id + 1; empty if none has a bit, and may be shorter than the largest id.
    pub masks: Vec<PrimMask>,
    /// Primvars that images are wanted of, with the numbers of their names ([`crate::MeshAsset::primvars`]).
    pub shown_primvars: Vec<(Arc<str>, u32)>,
    /// Collections that prims are in, sorted; the first is empty.
    pub category_sets: Vec<Vec<Arc<str>>>,
}

impl SurfaceTables {
    /// The number of the name of a primvar that an image is wanted of; `NO_NAME` if there is none.
    #[must_use]
    pub fn primvar_number(&self, name: &str) -> u32 {
        self.shown_primvars.iter().find(|(shown, _)| **shown == *name).map_or(NO_NAME, |(_, number)| *number)
    }

    /// Whether some prim is a shadow catcher.
    #[must_use]
    pub fn catches_shadows(&self) -> bool {
        self.masks.iter().any(|mask| mask.contains(PrimMask::SHADOW_CATCHER))
    }

    /// Features that the materials need.
    #[must_use]
    pub fn features(&self) -> Features {
        let flags = self.materials.iter().fold(MaterialFlags::empty(), |all, material| all | material.flags);
        let mut features = flags.features();
        features.set(Features::MATERIALS, !self.materials.is_empty());
        features.set(Features::PRIM_MASKS, !self.masks.is_empty());
        features
    }
}

/// A scene at one moment.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Grows with each commit that changed something.
    pub version: u64,
    /// World point that is (0, 0, 0) in the root assembly's frame. Kept across edits unless the scene moves far.
    pub origin: DVec3,
    /// Unique meshes in use, indexed by [`InstanceTarget::Mesh`]. Indices of kept meshes change as little as possible.
    pub meshes: Vec<Arc<SceneMesh>>,
    /// Assemblies, indexed by [`InstanceTarget::Assembly`]. Children come before parents; the root always exists and is
    /// the last.
    pub assemblies: Vec<Arc<Assembly>>,
    /// Lights that shine, by path.
    pub lights: Vec<Light>,
    /// Materials, textures, and their assignment to prims.
    pub surfaces: SurfaceTables,
    /// Categories of light linking.
    pub links: LinkTable,
    /// Features that the scene uses.
    pub features: Features,
    /// Kinds of the items of its meshes.
    pub leaf_kinds: BTreeSet<LeafKind>,
    /// Length of the longest chain of instance records from the root to a mesh; at least 1.
    pub max_levels: u32,
    /// Numbers of instances, triangles, meshes and assemblies.
    pub counts: SceneCounts,
    /// Data left out because they were bad.
    pub dropped: DroppedData,
    /// The same scene cut into chunks.
    pub world: Arc<PartitionedWorld>,
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
        /// The broken invariant.
        what: &'static str,
    },
    /// A mesh breaks an invariant.
    #[error("mesh {mesh}: {what}")]
    Mesh {
        /// Mesh index.
        mesh: usize,
        /// The broken invariant.
        what: String,
    },
    /// Levels or counts are wrong.
    #[error("{0} is wrong")]
    Count(&'static str),
}
