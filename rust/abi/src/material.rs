// SPDX-License-Identifier: Apache-2.0
//! Materials as the shaders read them: tables of materials, of prims, of primvars; and the data that are kept of a
//! material at a hit.
//!
//! Guarantees: plain data, from which the build makes the structs of the shaders. Any thread.

use super::MaterialInput;
use bytemuck::{Pod, Zeroable};

/// Value in `FrameConstants::material_slots` and `GpuSurfaceMaterial::material`: there is no material.
pub const NO_MATERIAL: u32 = u32::MAX;
/// Bit in `FrameConstants::material_slots`: traversal has to evaluate the material's alpha test.
pub const SLOT_PRESENCE: u32 = 1 << 31;
/// Value in `GpuMaterial::names`, in place of a primvar: Ptex coordinates.
pub const NAME_PTEX: u32 = u32::MAX - 1;
/// Value in `GpuMaterial::names`, in place of a primvar: the point in the mesh's frame.
pub const NAME_POSITION: u32 = u32::MAX - 2;
/// Value in `GpuMaterial::names`, in place of a primvar: the normal in the mesh's frame.
pub const NAME_NORMAL: u32 = u32::MAX - 3;
/// Value in `GpuMaterial::names`, in place of a primvar: the image in the world of normals along x of the mesh's frame,
/// and half of the image of those along z (`oocpt_materialx::uses::MaterialUses::OBJECT_FRAME`).
pub const NAME_FRAME_X: u32 = u32::MAX - 4;
/// Value in `GpuMaterial::names`, in place of a primvar: the image of normals along y, and the other half.
pub const NAME_FRAME_Y: u32 = u32::MAX - 5;
/// Bit of `GpuInput::kind`: the texture is Ptex, and its set is [`NAME_PTEX`].
pub const INPUT_PTEX: u32 = 1 << 7;
/// Value in `GpuMaterial::names`: no primvar.
pub const NO_NAME: u32 = u32::MAX;
/// Largest prim id that the table of prims contains.
pub const MAX_PRIM_ID: u32 = 1 << 24;
/// Value of `GpuInput::kind`, lowest two bits: the constant `value`.
pub const INPUT_CONSTANT: u32 = 0;
/// Value of `GpuInput::kind`, lowest two bits: a texture.
pub const INPUT_TEXTURE: u32 = 1;
/// Value of `GpuInput::kind`, lowest two bits: a primvar of the mesh, or `value` if it has none.
pub const INPUT_PRIMVAR: u32 = 2;
/// Value of `GpuInput::kind`, lowest two bits: register `texture` of the material's program.
pub const INPUT_REGISTER: u32 = 3;
/// Bit of the immediate of a program's lookup: its set and its map give the texture coordinates; else the operand does.
pub const INPUT_PLACED: u32 = 1 << 8;
/// Position of the channel in `GpuInput::kind`, 0 = all channels, else its number + 1; three bits.
pub const INPUT_CHANNEL_SHIFT: u32 = 2;
/// Position of the texture coordinate set or the primvar in `GpuInput::kind`; two bits.
pub const INPUT_SET_SHIFT: u32 = 5;
/// Texture coordinate set of an input that looks up the same position everywhere.
pub const INPUT_NO_SET: u32 = 2;

shared! {
    /// An input of a material, 64 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuInput {
        /// The value; for a texture its scale; for a primvar its fallback.
        pub value: [f32; 4],
        /// For a texture: summand.
        pub bias: [f32; 4],
        /// For a texture: first row of the map from the set to the position.
        pub row_s: [f32; 3],
        /// Kind, one of `INPUT_*`.
        pub kind: u32,
        /// For a texture: second row of the map.
        pub row_t: [f32; 3],
        /// For a texture: its number.
        pub texture: u32,
    }
}

shared! {
    /// A material, 1344 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuMaterial {
        /// Inputs, indexed by [`MaterialInput`].
        pub inputs: [GpuInput; MaterialInput::COUNT],
        /// Bits of [`super::MaterialFlags`].
        pub flags: u32,
        /// Threshold, as `oocpt_core::material::Material::opacity_threshold`.
        pub opacity_threshold: f32,
        /// Numbers of the names of two sets of texture coordinates and of two other primvars, or [`NO_NAME`].
        pub names: [u32; 4],
        /// Texture coordinates of the sets if a mesh does not have them.
        pub set_fallback: [[f32; 2]; 2],
        /// For its program: its start in `FrameConstants::programs`, in units of 16 bytes: constants, lookups (a
        /// [`GpuInput`] each), instructions (two in 16 bytes). If the opacity is a register, it is followed by
        /// `program_sizes` of the program for the opacity alone, 12 bytes of 0, and that program.
        pub program: u32,
        /// For its program: constants, lookups << 8, instructions << 16; 0: it has none.
        pub program_sizes: u32,
        /// Values of primvars if a mesh does not have them, for the program.
        pub primvar_fallback: [[f32; 4]; 2],
        /// Opacity mask, and the lookup of the opacity.
        pub cutout: GpuCutout,
    }
}

shared! {
    /// The opacity mask of a material, and the data that a walk needs to look the opacity up, 48 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuCutout {
        /// First row of the map to texture coordinates, as in the input.
        pub row_s: [f32; 3],
        /// Number of the name of the set of texture coordinates.
        pub set: u32,
        /// Second row of the map to texture coordinates.
        pub row_t: [f32; 3],
        /// Word 0 of the mask: its size.
        pub size: u32,
        /// Address of an `oocpt_core::texture::OpacityMask` or of a record of a set of them, 16-byte aligned; 0: there
        /// is none.
        pub mask: u64,
        /// Word 1 of the mask: its modes.
        pub modes: u32,
        /// 1 if the opacity is a probability and no threshold applies.
        pub is_chance: u32,
    }
}

shared! {
    /// Materials and categories of a prim, 16 B; by prim id + 1.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
    pub struct GpuPrim {
        /// Index of its first material slot.
        pub first_slot: u32,
        /// Number of its slots: the mesh and its subsets.
        pub slot_count: u32,
        /// Set of the collections of light linking that it is in.
        pub link_set: u32,
        /// Padding; 0.
        pub pad: u32,
    }
}

shared! {
    /// A primvar of a mesh, 16 B.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
    pub struct GpuAttribute {
        /// Offset of its values from `GpuMesh::primvars`, bytes.
        pub values: u64,
        /// Number of its name.
        pub name: u32,
        /// [`crate::AttributeRate`], and floats of a value << 8.
        pub rate_and_width: u32,
    }
}

shared! {
    /// The data of a hit that are kept to evaluate its material, 88 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuSurfaceMaterial {
        /// Texture coordinates of both sets.
        pub uv: [[f32; 2]; 2],
        /// Values of the other primvars.
        pub primvars: [[f32; 4]; 2],
        /// Unit vector in world space: the direction in which u grows in the triangle's plane, for the set that the
        /// normal map reads, else for the first.
        pub tangent: [f32; 3],
        /// Number of the material, or [`NO_MATERIAL`].
        pub material: u32,
        /// Area of the sets that a cone of width 1 covers, packed (`shaders/texture/footprint.glsl`).
        pub footprints: [[u32; 2]; 2] = "uvec2[2]",
        /// 1 or -1: v grows along `cross(normal, tangent)` or against it; 0: there is no tangent.
        pub handedness: f32,
        /// Bits 0 and 1: the mesh has the primvar.
        pub flags: u32,
    }
}
