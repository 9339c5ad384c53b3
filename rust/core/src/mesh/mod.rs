// SPDX-License-Identifier: Apache-2.0
//! Mesh assets: the form in which meshes go to the GPU. They are immutable and shared by content.
//!
//! Stages: [`build`] runs `topology` (check, holes), `refine` (limit surfaces, cut as [`DicingRate`] says, moved by
//! `displace` as far as a `relief` says), `triangulate`, `primvar` and `normals`, [`bvh`] and [`bvh4`]; `split` cuts
//! large meshes into clusters, `patches` large control meshes before they are refined; `key` is the content hash. A
//! snapshot has [`SceneMesh`]es: a `summary` of each asset, and the asset where `store` and `payload` have put it. Pure
//! functions; called from rayon workers during a commit.

mod attribute;
pub mod build;
pub mod build_bvh4;
mod bundle;
pub mod bvh;
pub mod bvh4;
mod cage;
mod check;
mod collapse;
mod cover;
mod covered;
mod creases;
mod cut_values;
mod deform;
mod demand;
mod dicing;
mod displace;
mod footprint;
mod host_memory;
mod kept_mesh;
mod key;
mod leaf;
pub mod level;
mod level_shape;
mod normals;
mod patch;
mod patch_desc;
mod patches;
mod pattern_relief;
mod payload;
mod plain_values;
mod pose;
mod preview_relief;
mod primvar;
mod ptex;
mod recipe;
mod refine;
mod refine_values;
mod refit;
mod relief;
mod scene_mesh;
mod split;
mod store;
mod summary;
mod tangents;
mod topology;
mod triangulate;
mod unsorted;

use bytemuck::{Pod, Zeroable};
use oocpt_abi::{GpuAttribute, GpuPoint, GpuTriangle};
use serde::{Deserialize, Serialize};

pub(crate) use attribute::each_width;
pub use attribute::{AnyAttribute, Attribute, MeshPrimvar, WantedPrimvar};
pub use build::{BuiltMesh, build_mesh, build_mesh_split, build_mesh_with};
pub use bundle::POINT_BUNDLE;
pub use bvh::{Bvh2, BvhError, BvhNode, build_box_bvh};
pub use bvh4::{Bvh4, level_nodes};
pub use cover::{CutoutCover, SlotCovers};
pub use deform::MeshKeys;
pub use demand::{BuildDemand, SlotDisplacements};
pub(crate) use dicing::OUT_OF_PICTURE;
pub use dicing::{CameraEye, DicingRate};
pub(crate) use footprint::BuildFootprint;
pub use host_memory::HostMemory;
pub(crate) use host_memory::too_large;
pub(crate) use kept_mesh::{BuildGrant, KeptMesh};
pub use key::mesh_key;
pub(crate) use key::{is_same_mesh, mesh_key_with};
pub use leaf::LeafKind;
pub use level::{LevelTree, build_level, level_node_count, likely_level_stack};
pub use level_shape::{LevelShape, RefittedLevel, has_worn};
pub(crate) use patch::MeshPatch;
pub(crate) use patches::{MIN_PATCHED_FACES, MeshPatches};
pub use ptex::{MAX_PTEX_FACES, PtexPart, PtexTriangle};
pub(crate) use recipe::{MeshRecipe, MeshStorage};
pub(crate) use refine::EdgeRates;
pub use refine::MAX_REFINED_TRIANGLES;
pub(crate) use refit::{MeshRefit, MeshShape};
#[cfg(feature = "faults")]
pub use scene_mesh::LOST_FOR_GOOD;
pub use scene_mesh::{SceneMesh, StoredError};
pub use split::split_mesh;
pub use store::{MeshFiles, PayloadError, PayloadSource, StoredEntry};
pub use summary::{AttributeSummary, MeshSummary, PrimvarSummary};

/// Device bytes of a triangle.
const TRIANGLE_BYTES: u64 = size_of::<GpuTriangle>() as u64;
/// Device bytes of a point; its radius is stored elsewhere.
const POINT_BYTES: u64 = size_of::<GpuPoint>() as u64;
/// Device bytes of an entry in the table of primvars.
const PRIMVAR_BYTES: u64 = size_of::<GpuAttribute>() as u64;
/// Alignment of the sections of an asset on the device, bytes.
const SECTION_ALIGN: u64 = 16;

/// An axis-aligned box; empty if any `min > max`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Aabb {
    /// Lower corner.
    pub min: [f32; 3],
    /// Upper corner.
    pub max: [f32; 3],
}

impl Aabb {
    /// The box without points: `+inf .. -inf`.
    pub const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// Returns true if no point is inside.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        (0..3).any(|k| self.min[k] > self.max[k])
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let mut out = *self;
        for k in 0..3 {
            out.min[k] = out.min[k].min(other.min[k]);
            out.max[k] = out.max[k].max(other.max[k]);
        }
        out
    }

    /// The smallest box around `self` and a point.
    #[must_use]
    pub fn with_point(&self, p: [f32; 3]) -> Self {
        self.union(&Self { min: p, max: p })
    }

    /// Half the surface of a box that is not empty, which single precision may not hold.
    #[must_use]
    pub fn half_area(&self) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|k| f64::from(self.max[k]) - f64::from(self.min[k]));
        x * y + y * z + z * x
    }

    /// Returns true if `other` lies inside (an empty box lies inside every box).
    #[must_use]
    pub fn contains(&self, other: &Self) -> bool {
        other.is_empty() || (0..3).all(|k| self.min[k] <= other.min[k] && other.max[k] <= self.max[k])
    }
}

/// A triangle in object space, corners in authored order (a left-handed mesh flips the geometric normal, not the
/// order); or another item, by the asset's [`LeafKind`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Triangle {
    /// Corner positions.
    pub vertices: [[f32; 3]; 3],
    /// Authored face index: the element id.
    pub face: u32,
}

impl Triangle {
    /// The box around it.
    #[must_use]
    pub fn bounds(&self, kind: LeafKind) -> Aabb {
        kind.bounds(&self.vertices)
    }
}

/// A mesh ready for upload: at least one triangle, every number finite, every index in range.
#[derive(Clone, Debug)]
pub struct MeshAsset {
    /// Content hash of the authored data and of the flags; for a cluster, see [`split_mesh`].
    pub key: u128,
    /// Box of the parts of the triangles that rays can meet.
    pub bounds: Aabb,
    /// Box of all triangles.
    pub whole: Aabb,
    /// True if boxes of triangles enclose only the parts that cutouts keep.
    pub is_clipped: bool,
    /// Hierarchy over `triangles`.
    pub bvh: Bvh4,
    /// Kind of the items in `triangles`.
    pub kind: LeafKind,
    /// Triangles, or items of [`Self::kind`], in BVH order.
    pub triangles: Vec<Triangle>,
    /// Point index of each corner, per triangle; empty unless an attribute has `AttributeRate::Vertex`.
    pub corner_indices: Vec<[u32; 3]>,
    /// Unit shading normals in object space, on the outer side (orientation already applied); `None` = flat.
    pub normals: Option<Attribute<[f32; 3]>>,
    /// `displayColor`, not negative.
    pub colors: Option<Attribute<[f32; 3]>>,
    /// `displayOpacity` in `[0, 1]`; `None` = opaque everywhere.
    pub opacities: Option<Attribute<f32>>,
    /// Primvars that bound materials read, by number of their names.
    pub primvars: Vec<MeshPrimvar>,
    /// Per triangle: 0, or the number of its subset counted from 1; empty for a mesh without subsets.
    pub subsets: Vec<u16>,
    /// Place of each triangle in a Ptex file; empty unless a material reads one.
    pub ptex: Vec<PtexTriangle>,
    /// Later keys of a moving mesh; the other fields describe the first key.
    pub keys: MeshKeys,
    /// True if it is seen from both sides, false if from the front only.
    pub double_sided: bool,
    /// True if the geometric normal is minus the right-handed one.
    pub left_handed: bool,
}

impl MeshAsset {
    /// The box of an item while the shutter is open; empty if there is no such item.
    pub(crate) fn item_bounds(&self, at: usize) -> Aabb {
        let count = self.triangles.len();
        self.triangles.get(at).map_or(Aabb::EMPTY, |item| deform::swept(item, self.kind, &self.keys, at, count))
    }

    /// Bytes on the device, as [`MeshSummary::device_bytes`].
    #[must_use]
    pub fn device_bytes(&self) -> u64 {
        MeshSummary::of(self).device_bytes()
    }

    /// Bytes of host memory held.
    #[must_use]
    pub fn host_bytes(&self) -> u64 {
        let arrays = payload::payload_bytes(&MeshSummary::of(self)).unwrap_or(u64::MAX);
        arrays.saturating_add(size_of::<Self>() as u64)
    }
}
