// SPDX-License-Identifier: Apache-2.0
//! The immutable result of a commit. Shared between threads by `Arc`; nothing in it ever changes.

use std::collections::BTreeSet;
use std::sync::Arc;

use bitflags::bitflags;
use glam::DVec3;

use super::surfaces::PrimRecord;
use crate::desc::DroppedData;
use crate::material::{Material, MaterialFlags, TextureRef};
use crate::partition::World;

pub use super::light::{
    DomeTexture, Emitter, IesError, IesProfile, Light, LightMotion, LightShaping, LinkTable, LocalLight, LocalShape,
    blackbody,
};
pub use super::report::SceneWarning;
pub use crate::instancing::assembly::{Assembly, InstanceFlags, InstanceRecord, Target};
pub use crate::mesh::{
    Aabb, Attribute, AttributeRate, Bvh2, BvhError, BvhNode, LeafKind, MeshAsset, SceneMesh, Triangle,
};

bitflags! {
    /// What a scene uses. The names are those of the features of the passes (`oocpt_abi::Features`).
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub struct SceneFeatures: u64 {
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
        /// A mesh with a material.
        const MATERIALS = 1 << 11;
        /// A material that reads a texture.
        const TEXTURES = 1 << 12;
        /// A material whose opacity is asked for in traversal.
        const CUTOUTS = 1 << 13;
        /// A material that lets light through.
        const TRANSMISSION = 1 << 14;
        /// A material with a coat.
        const COAT = 1 << 15;
        /// One that does by a rough surface.
        const ROUGH_TRANSMISSION = 1 << 28;
        /// A material of `OpenPBR`: glass and coat with inputs of their own.
        const OPEN_PBR = 1 << 18;
        /// A material with fuzz.
        const SHEEN = 1 << 19;
        /// A material whose inputs are worked out by a program.
        const PATTERNS = 1 << 20;
        /// A material that is anisotropic.
        const ANISOTROPY = 1 << 8;
        /// A material with a thin film.
        const THIN_FILM = 1 << 9;
        /// A material without an inside.
        const THIN_WALLS = 1 << 10;
        /// A material that absorbs light on its way inside.
        const ABSORPTION = 1 << 24;
        /// A material of hair.
        const HAIR = 1 << 27;
        /// A material with a rough diffuse lobe.
        const ROUGH_DIFFUSE = 1 << 32;
        /// A material of glass whose index depends on the channel.
        const DISPERSION = 1 << 34;
        /// A material that is one of several by chance.
        const MIXTURES = 1 << 33;
        /// A material whose opacity is worked out by a program.
        const CUTOUT_PROGRAMS = 1 << 25;
        /// A material that emits light.
        const EMISSION = 1 << 22;
        /// A primvar with a value per instance that something reads.
        const INSTANCE_PRIMVARS = 1 << 23;
        /// A `displayOpacity` below 1 among them.
        const INSTANCE_OPACITY = 1 << 16;
        /// A placement that moves while the shutter is open.
        const MOTION = 1 << 21;
        /// Points that move while the shutter is open.
        const DEFORMATION = 1 << 31;
        /// A material that reads a Ptex texture.
        const PTEX = 1 << 29;
        /// A light with a place.
        const LOCAL_LIGHTS = 1 << 17;
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

/// What surfaces look like: materials, and which prim has which. Empty where no mesh has a material and none is in a
/// collection.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceTables {
    /// Materials in use.
    pub materials: Vec<Arc<Material>>,
    /// Textures in use, each once.
    pub textures: Vec<TextureRef>,
    /// By prim id + 1 (0: meshes without an id); may be shorter than the largest id.
    pub prims: Vec<PrimRecord>,
    /// Material of each slot, or [`NO_MATERIAL`](super::NO_MATERIAL). A triangle's slot is that of its prim's record
    /// plus its subset number ([`MeshAsset::subsets`]).
    pub material_slots: Vec<u32>,
    /// Collections that prims are in, sorted; the first is empty.
    pub category_sets: Vec<Vec<Arc<str>>>,
}

impl SurfaceTables {
    /// What the materials need.
    #[must_use]
    pub fn features(&self) -> SceneFeatures {
        let flags = self.materials.iter().fold(MaterialFlags::empty(), |all, material| all | material.flags);
        let parts = [
            (MaterialFlags::TEXTURED, SceneFeatures::TEXTURES),
            (MaterialFlags::PRESENCE, SceneFeatures::CUTOUTS),
            (MaterialFlags::TRANSMISSIVE, SceneFeatures::TRANSMISSION),
            (MaterialFlags::ROUGH_TRANSMISSION, SceneFeatures::ROUGH_TRANSMISSION),
            (MaterialFlags::COAT, SceneFeatures::COAT),
            (MaterialFlags::EMISSIVE, SceneFeatures::EMISSION),
            (MaterialFlags::PTEX, SceneFeatures::PTEX),
            (MaterialFlags::OPEN_PBR, SceneFeatures::OPEN_PBR),
            (MaterialFlags::SHEEN, SceneFeatures::SHEEN),
            (MaterialFlags::PATTERNS, SceneFeatures::PATTERNS),
            (MaterialFlags::CUTOUT_PROGRAM, SceneFeatures::CUTOUT_PROGRAMS),
            (MaterialFlags::MIXTURE, SceneFeatures::MIXTURES),
            (MaterialFlags::ANISOTROPIC, SceneFeatures::ANISOTROPY),
            (MaterialFlags::THIN_FILM, SceneFeatures::THIN_FILM),
            (MaterialFlags::THIN_WALLED, SceneFeatures::THIN_WALLS),
            (MaterialFlags::ABSORBING, SceneFeatures::ABSORPTION),
            (MaterialFlags::HAIR, SceneFeatures::HAIR),
            (MaterialFlags::ROUGH_DIFFUSE, SceneFeatures::ROUGH_DIFFUSE),
            (MaterialFlags::DISPERSIVE, SceneFeatures::DISPERSION),
        ];
        let mut features = SceneFeatures::empty();
        features.set(SceneFeatures::MATERIALS, !self.materials.is_empty());
        for (flag, feature) in parts {
            features.set(feature, flags.contains(flag));
        }
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
    /// Unique meshes in use; [`Target::Mesh`] indexes this. Indices of kept meshes change as little as possible.
    pub meshes: Vec<Arc<SceneMesh>>,
    /// [`Target::Assembly`] indexes this. Children come before parents, the root is last and always there.
    pub assemblies: Vec<Arc<Assembly>>,
    /// Lights that shine, by path.
    pub lights: Vec<Light>,
    /// Materials, textures, and who has them.
    pub surfaces: SurfaceTables,
    /// Categories of light linking.
    pub links: LinkTable,
    /// What the scene uses.
    pub features: SceneFeatures,
    /// What its meshes are made of.
    pub leaf_kinds: BTreeSet<LeafKind>,
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
