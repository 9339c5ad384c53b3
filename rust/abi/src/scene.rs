// SPDX-License-Identifier: Apache-2.0
//! Scene data as the shaders read it: triangles, meshes, instance records, assemblies, chunks, distant lights.
//!
//! Guarantees: plain data, of which the build makes the structs of the shaders. Any thread.

use bitflags::bitflags;
use bytemuck::{Pod, Zeroable};

/// Set in `GpuInstance::target` when it names an assembly, else it names a mesh.
pub const TARGET_ASSEMBLY: u32 = 1 << 31;

/// Number of the name `displayColor` in tables of primvars.
pub const NAME_DISPLAY_COLOR: u32 = 0;
/// Number of the name `displayOpacity`.
pub const NAME_DISPLAY_OPACITY: u32 = 1;
/// Bits of the first float of a value by instance where there is none.
pub const NO_VALUE: u32 = 0x7fc0_0000;
/// The bits of [`GpuTriangle::subset_and_sides`] that hold the subset.
pub const SUBSET_MASK: u32 = 0xffff;
/// In `GpuChunkInstance::row`: none.
pub const NO_ROW: u32 = u32::MAX;

shared! {
    /// Point in its mesh's frame, 16 B. Leaves of nodes count bundles of [`POINT_BUNDLE`], in the order of the array:
    /// all are full but the first one.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuPoint {
        /// Centre.
        pub center: [f32; 3],
        /// Authored number: the element id.
        pub face: u32,
    }
}

/// Points of a leaf; a leaf of points is one bundle.
pub const POINT_BUNDLE: u32 = 8;

shared! {
    /// Triangle in its mesh's frame, in BVH order, 48 B, authored winding.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuTriangle {
        /// First vertex.
        pub v0: [f32; 3],
        /// Authored face index: the element id.
        pub face: u32,
        /// Second vertex.
        pub v1: [f32; 3],
        /// Bits 0 to 15: number of the subset that the face is in, from 1; 0 = none. Bits 16 to 31: with `ptex`, sides
        /// of the authored face; 0 = a quad.
        pub subset_and_sides: u32,
        /// Third vertex.
        pub v2: [f32; 3],
        /// Number of the Ptex face, and which part of it this is (`oocpt_core::mesh::PtexTriangle::word`); 0 where no
        /// material asks.
        pub ptex: u32,
    }
}

/// Bytes of a [`GpuTriangle`].
#[allow(clippy::cast_possible_truncation, reason = "small")]
pub const TRIANGLE_BYTES: u32 = size_of::<GpuTriangle>() as u32;
/// Bytes of a [`GpuPoint`].
#[allow(clippy::cast_possible_truncation, reason = "small")]
pub const POINT_BYTES: u32 = size_of::<GpuPoint>() as u32;

/// In [`GpuInstance::prototype_count`]: the map flips handedness.
pub const FLIPS_HANDEDNESS: u32 = 1 << 31;

shared! {
    /// Placement of a mesh or of an assembly, 64 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuInstance {
        /// Rows of the affine map from the parent's frame into the target's.
        pub object_from_parent: [[f32; 4]; 3],
        /// Mesh index, or assembly index with [`TARGET_ASSEMBLY`].
        pub target: u32,
        /// Prim id of the mesh prim; counts when the target is a mesh.
        pub prim_id: i32,
        /// Index among the instances of the instancer's prototype; 0 if this is no instancer placement.
        pub index_in_prototype: u32,
        /// Instances of that prototype; 1 if this is no instancer placement. Beside it [`FLIPS_HANDEDNESS`] (which
        /// the shaders mask off and do not need: normals are mapped as covectors).
        pub prototype_count: u32,
    }
}

/// Set in [`GpuInstance::target`] of a placement that moves: of `object_from_parent` only the bits of the first two
/// numbers count, where its keys are (from the level's records, in 16 bytes) and how many.
pub const TARGET_MOVING: u32 = 1 << 30;

shared! {
    /// A key of what moves, 64 B: `p' = translation + rotation * stretch * p`.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct GpuMotionKey {
        /// In the parent's frame.
        pub translation: [f32; 3],
        /// Part of the shutter.
        pub time: f32,
        /// Unit quaternion, x, y, z, w; on the same side as those of its neighbours.
        pub rotation: [f32; 4],
        /// Of the symmetric stretch the diagonal: xx, yy, zz.
        pub stretch: [f32; 3],
        /// Half the angle to the rotation of the next key, radians; 0 where that is none.
        pub half_angle: f32,
        /// Of the stretch the rest: xy, xz, yz.
        pub shear: [f32; 3],
        /// Padding.
        pub pad: u32,
    }
}

shared! {
    /// How the camera moves, 96 B, and behind it [`GpuCameraKey`]s: rays in the view's frame, as those of
    /// `FrameConstants` in the world.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct GpuCameraMotion {
        /// Origin of the ray of image point (0, 0).
        pub o: [f32; 3],
        /// Keys, two or more.
        pub key_count: u32,
        /// Change of `o` per pixel to the right.
        pub o_x: [f32; 3],
        /// Radius of the lens.
        pub lens_radius: f32,
        /// Change of `o` per pixel up.
        pub o_y: [f32; 3],
        /// Padding.
        pub pad0: u32,
        /// Direction of the ray of image point (0, 0).
        pub d: [f32; 3],
        /// Padding.
        pub pad1: u32,
        /// Change of `d` per pixel to the right.
        pub d_x: [f32; 3],
        /// Padding.
        pub pad2: u32,
        /// Change of `d` per pixel up.
        pub d_y: [f32; 3],
        /// Padding.
        pub pad3: u32,
    }
}

shared! {
    /// A key of the camera, 80 B.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct GpuCameraKey {
        /// World from view.
        pub key: GpuMotionKey,
        /// What the key's translation lacks of the place in f64.
        pub translation_lo: [f32; 3],
        /// Padding.
        pub pad: u32,
    }
}

shared! {
    /// A key of a light that moves, 80 B: world from the unit shape, or the rotation of a light at infinity. Directions
    /// ([`crate::GpuInfiniteLight`], [`crate::GpuLightShaping`], [`crate::GpuLightMap`]) are then relative to the
    /// rotation.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct GpuLightKey {
        /// Between two: as that of a placement.
        pub key: GpuMotionKey,
        /// What the key's translation lacks of the place in f64.
        pub translation_lo: [f32; 3],
        /// Radiance relative to the light's.
        pub radiance: f32,
    }
}

/// How values of an attribute are found; `triangle` is the index in BVH order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(u32)]
pub enum AttributeRate {
    /// `values[0]`.
    Constant = 0,
    /// `values[triangle]`.
    Uniform = 1,
    /// `values[corner_indices[triangle * 3 + corner]]`, interpolated.
    Vertex = 2,
    /// `values[triangle * 3 + corner]`, interpolated.
    FaceVarying = 3,
}

bitflags! {
    /// `GpuMesh::flags` above the three attribute rates (bits 0-1 normals, 2-3 colours, 4-5 opacities).
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
    pub struct MeshFlags: u32 {
        /// Authored double sided (both sides are always shaded).
        const DOUBLE_SIDED = 1 << 8;
        /// Authored left-handed: the normal of the winding points the other way.
        const LEFT_HANDED = 1 << 9;
        /// `normals` counts.
        const HAS_NORMALS = 1 << 10;
        /// `colors` counts.
        const HAS_COLORS = 1 << 11;
        /// `opacities` counts.
        const HAS_OPACITIES = 1 << 12;
        /// `normals` has values by corner for each key.
        const KEY_NORMALS = 1 << 14;
        /// Of points: each has a radius of its own, at each key.
        const OWN_RADII = 1 << 15;
    }
}

/// Where `GpuMesh::flags` keeps the number of keys, 5 bits; 0: its points do not move.
pub const MESH_KEYS_SHIFT: u32 = 16;

impl MeshFlags {
    /// The word for `GpuMesh::flags`: these flags and the rate of each attribute.
    #[must_use]
    pub const fn with_rates(self, normals: AttributeRate, colors: AttributeRate, opacities: AttributeRate) -> u32 {
        self.bits() | normals as u32 | (colors as u32) << 2 | (opacities as u32) << 4
    }
}

shared! {
    /// Where the parts of a mesh are, 72 B. Addresses are device addresses; absent parts are 0.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuMesh {
        /// [`crate::Bvh4Node`] array, 16-byte aligned.
        pub nodes: u64,
        /// [`GpuTriangle`] array, 16-byte aligned. With keys ([`MESH_KEYS_SHIFT`]) one for each, one behind the other,
        /// and behind them the times of the keys, f32. Of points ([`crate::LeafType::POINT`]) it is [`GpuPoint`]
        /// arrays, and behind the times are the radii, f32: one, or with [`MeshFlags::OWN_RADII`] one for each, its
        /// keys side by side.
        pub triangles: u64,
        /// The largest coordinate of a corner, without its sign.
        pub reach: f32,
        /// [`MeshFlags::with_rates`], the keys ([`MESH_KEYS_SHIFT`]) and [`crate::LeafType::flags`].
        pub flags: u32,
        /// u32x3 per triangle; needed when an attribute has rate `Vertex`. 4-byte aligned, as all below.
        pub corner_indices: u64,
        /// f32x3 values, in the mesh's frame.
        pub normals: u64,
        /// f32x3 values, linear.
        pub colors: u64,
        /// f32 values in [0, 1].
        pub opacities: u64,
        /// [`crate::GpuAttribute`] array, 16-byte aligned: primvars that materials read. 0 without any.
        pub primvars: u64,
        /// Their number.
        pub primvar_count: u32,
        /// Triangles.
        pub triangle_count: u32,
    }
}

shared! {
    /// Where the parts of an assembly are, 24 B.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
    pub struct GpuAssembly {
        /// [`crate::LevelNode`] array over the instances, 16-byte aligned.
        pub nodes: u64,
        /// [`GpuInstance`] array, 16-byte aligned.
        pub instances: u64,
        /// As [`GpuChunk::primvars`].
        pub primvars: u64,
    }
}

shared! {
    /// Where the parts of a chunk are, 24 B: `nodes` of 0 = the chunk is absent.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct GpuChunk {
        /// [`crate::LevelNode`] array over the records, 16-byte aligned.
        pub nodes: u64,
        /// [`GpuInstance`] array, 16-byte aligned; the maps start from the chunk's own frame.
        pub instances: u64,
        /// [`crate::GpuAttribute`] array, 16-byte aligned, the last with the name [`crate::NO_NAME`]: values by record,
        /// of which [`NO_VALUE`] in the first float says that there is none. 0 without any.
        pub primvars: u64,
    }
}

shared! {
    /// A chunk in the world, 80 B. A world point `p` (relative to `Snapshot::origin`) is `L (p - origin)` in the
    /// chunk's frame.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuChunkInstance {
        /// Rows of `L`, each followed by that component of the high part of the origin.
        pub chunk_from_world: [[f32; 4]; 3],
        /// Low part of the origin: at most half an ulp of the high part.
        pub origin_lo: [f32; 3],
        /// Index in `FrameConstants::chunks`.
        pub chunk: u32,
        /// Instance number of the opened placements above; 0 for chunks of the root. A record's number is
        /// `instance_id * prototype_count + index_in_prototype`, and so on down.
        pub instance_id: u32,
        /// Row of `FrameConstants::placed_values`, or [`NO_ROW`].
        pub row: u32,
        /// 0.
        pub pad: [u32; 2],
    }
}

impl GpuChunkInstance {
    /// The entry for rows `l` and an origin in f64.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "split in two floats")]
    pub fn new(l: [[f32; 3]; 3], origin: [f64; 3], chunk: u32, instance_id: u32, row: u32) -> Self {
        let hi = origin.map(|x| x as f32);
        let lo = |i: usize| (origin[i] - f64::from(hi[i])) as f32;
        let line = |i: usize| [l[i][0], l[i][1], l[i][2], hi[i]];
        let chunk_from_world = [line(0), line(1), line(2)];
        Self { chunk_from_world, origin_lo: [lo(0), lo(1), lo(2)], chunk, instance_id, row, pad: [0; 2] }
    }
}
