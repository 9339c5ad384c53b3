// SPDX-License-Identifier: Apache-2.0
//! Materials as the shaders read them: tables of materials, of prims, of primvars; and what is kept of a material at a
//! hit.
//!
//! Guarantees: plain data, of which the build makes the structs of the shaders. Any thread.

use super::MaterialInput;
use bytemuck::{Pod, Zeroable};

/// In `FrameConstants::material_slots` and `GpuSurfaceMaterial::material`: none.
pub const NO_MATERIAL: u32 = u32::MAX;
/// In `FrameConstants::material_slots`: traversal has to ask the material whether the surface is there.
pub const SLOT_PRESENCE: u32 = 1 << 31;
/// In `GpuMaterial::names`, in place of a primvar: Ptex coordinates.
pub const NAME_PTEX: u32 = u32::MAX - 1;
/// In `GpuMaterial::names`, in place of a primvar: the point in the mesh's frame.
pub const NAME_POSITION: u32 = u32::MAX - 2;
/// In `GpuMaterial::names`, in place of a primvar: the normal in the mesh's frame.
pub const NAME_NORMAL: u32 = u32::MAX - 3;
/// In `GpuMaterial::names`, in place of a primvar: where normals along x of the mesh's frame go in the world, and half
/// of where those along z go (`oocpt_materialx::uses::MaterialUses::OBJECT_FRAME`).
pub const NAME_FRAME_X: u32 = u32::MAX - 4;
/// In `GpuMaterial::names`, in place of a primvar: the same along y, and the other half.
pub const NAME_FRAME_Y: u32 = u32::MAX - 5;
/// `GpuInput::kind`: the texture is Ptex, and its set is [`NAME_PTEX`].
pub const INPUT_PTEX: u32 = 1 << 7;
/// In `GpuMaterial::names`: no primvar.
pub const NO_NAME: u32 = u32::MAX;
/// Largest prim id that the table of prims knows.
pub const MAX_PRIM_ID: u32 = 1 << 24;
/// `GpuInput::kind`, lowest two bits: `value`.
pub const INPUT_CONSTANT: u32 = 0;
/// `GpuInput::kind`, lowest two bits: a texture.
pub const INPUT_TEXTURE: u32 = 1;
/// `GpuInput::kind`, lowest two bits: a primvar of the mesh, or `value` where it has none.
pub const INPUT_PRIMVAR: u32 = 2;
/// `GpuInput::kind`, lowest two bits: register `texture` of the material's program.
pub const INPUT_REGISTER: u32 = 3;
/// In the immediate of a program's lookup: its set and its map are its place; else the operand is.
pub const INPUT_PLACED: u32 = 1 << 8;
/// `GpuInput::kind`: where the channel begins, 0 = all of them, else its number + 1; three bits.
pub const INPUT_CHANNEL_SHIFT: u32 = 2;
/// `GpuInput::kind`: where the texture coordinate set or the primvar begins; two bits.
pub const INPUT_SET_SHIFT: u32 = 5;
/// Texture coordinate set of an input that looks at the same place everywhere.
pub const INPUT_NO_SET: u32 = 2;

shared! {
    /// An input of a material, 64 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuInput {
        /// The value; of a texture its scale; of a primvar what replaces it.
        pub value: [f32; 4],
        /// Of a texture: what is added.
        pub bias: [f32; 4],
        /// Of a texture: first row of the map from the set to the place.
        pub row_s: [f32; 3],
        /// `INPUT_*`.
        pub kind: u32,
        /// Of a texture: second row of the map.
        pub row_t: [f32; 3],
        /// Of a texture: its number.
        pub texture: u32,
    }
}

shared! {
    /// A material, 1344 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuMaterial {
        /// The inputs.
        pub inputs: [GpuInput; MaterialInput::COUNT],
        /// Bits of [`super::MaterialFlags`].
        pub flags: u32,
        /// See `oocpt_core::material::Material::opacity_threshold`.
        pub opacity_threshold: f32,
        /// Numbers of the names of two sets of texture coordinates and of two other primvars, or [`NO_NAME`].
        pub names: [u32; 4],
        /// What the sets are where a mesh does not have them.
        pub set_fallback: [[f32; 2]; 2],
        /// Of its program: where it begins in `FrameConstants::programs`, in units of 16 bytes: constants, lookups (a
        /// [`GpuInput`] each), instructions (two in 16 bytes). Behind it, if the opacity is a register: `program_sizes`
        /// of the program for that alone, 12 bytes of 0, and it.
        pub program: u32,
        /// Of its program: constants, lookups << 8, instructions << 16; 0: it has none.
        pub program_sizes: u32,
        /// What primvars are where a mesh does not have them, for the program.
        pub primvar_fallback: [[f32; 4]; 2],
        /// What is known of its opacity without its texture.
        pub cutout: GpuCutout,
    }
}

shared! {
    /// What is known of a material's opacity without its texture, and what a walk needs to look it up, 48 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuCutout {
        /// Rows of the map from its set of texture coordinates: as of the input.
        pub row_s: [f32; 3],
        /// Number of the name of that set.
        pub set: u32,
        /// See `row_s`.
        pub row_t: [f32; 3],
        /// Words 0 and 1 of the mask: size and modes.
        pub size: u32,
        /// `oocpt_core::texture::OpacityMask` or a record of a set of them, 16-byte aligned; 0: there is none.
        pub mask: u64,
        /// See `size`.
        pub modes: u32,
        /// 1: the opacity is a probability, no threshold cuts.
        pub is_chance: u32,
    }
}

shared! {
    /// What a prim looks like, 16 B; by prim id + 1.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
    pub struct GpuPrim {
        /// First of its material slots.
        pub first_slot: u32,
        /// Their number: the mesh and its subsets.
        pub slot_count: u32,
        /// Which collections of lights' links it is in.
        pub link_set: u32,
        /// 0.
        pub pad: u32,
    }
}

shared! {
    /// A primvar of a mesh, 16 B.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
    pub struct GpuAttribute {
        /// Bytes from `GpuMesh::primvars` to its values.
        pub values: u64,
        /// Number of its name.
        pub name: u32,
        /// [`crate::AttributeRate`], and floats of a value << 8.
        pub rate_and_width: u32,
    }
}

shared! {
    /// What is kept of a hit to evaluate its material, 88 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuSurfaceMaterial {
        /// Texture coordinates of both sets.
        pub uv: [[f32; 2]; 2],
        /// The other primvars.
        pub primvars: [[f32; 4]; 2],
        /// Unit, world: where u grows, in the triangle's plane; of the set that the normal map reads, else of the
        /// first.
        pub tangent: [f32; 3],
        /// Number of the material, or [`NO_MATERIAL`].
        pub material: u32,
        /// What a cone of width 1 covers of the sets, packed (`shaders/texture/footprint.glsl`).
        pub footprints: [[u32; 2]; 2] = "uvec2[2]",
        /// 1 or -1: v grows along `cross(normal, tangent)` or against it; 0: no tangent.
        pub handedness: f32,
        /// Bit 0, bit 1: the mesh has the primvar.
        pub flags: u32,
    }
}
