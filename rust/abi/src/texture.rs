// SPDX-License-Identifier: Apache-2.0
//! Textures: one record each, and a page table of all their tiles together.
//!
//! `FrameConstants::texture_pages` is u64 per tile of the scene: its device address, 0 = absent, with [`PAGE_BROKEN`]
//! when it could not be read. Texels of a tile are tightly packed, row by row from the bottom. Guarantees: plain data
//! with the offsets of the shaders' structs. Any thread.

use bytemuck::{Pod, Zeroable};

/// Bits of [`GpuTexture::flags`] that hold the channels: 1, 2 or 4.
pub const TEXTURE_CHANNELS: u32 = 7;
/// Position of the format of a channel in the flags, two bits.
pub const TEXTURE_FORMAT_SHIFT: u32 = 4;
/// Format: bytes, 0 to 255 for 0 to 1.
pub const TEXTURE_U8: u32 = 0;
/// Format: half floats.
pub const TEXTURE_F16: u32 = 1;
/// Format: floats.
pub const TEXTURE_F32: u32 = 2;
/// Flag: red, green and blue go through the sRGB curve.
pub const TEXTURE_SRGB: u32 = 1 << 6;
/// Flag: a set of up to 100 textures, which are consecutive in the table from number `first_page` on; those without
/// levels are missing.
pub const TEXTURE_UDIM: u32 = 1 << 7;
/// Flag: texels by face; `width` is the number of faces, and `directory` has their positions.
pub const TEXTURE_PTEX: u32 = 1 << 12;
/// Flag: the fallback is a texel as others are: it lies where [`WRAP_BLACK`] has black, and scale and bias apply to it.
pub const TEXTURE_BORDER: u32 = 1 << 13;
/// Position of the wrap mode along s in the flags, two bits.
pub const TEXTURE_WRAP_S_SHIFT: u32 = 8;
/// Position of the wrap mode along t in the flags, two bits.
pub const TEXTURE_WRAP_T_SHIFT: u32 = 10;
/// Wrap mode: transparent black outside.
pub const WRAP_BLACK: u32 = 0;
/// Wrap mode: the texels at the border.
pub const WRAP_CLAMP: u32 = 1;
/// Wrap mode: the image repeats.
pub const WRAP_REPEAT: u32 = 2;
/// Wrap mode: the image repeats, every other time mirrored.
pub const WRAP_MIRROR: u32 = 3;
/// Bit of a tile's entry in the page table: it could not be read, and lookups that need it give the fallback.
pub const PAGE_BROKEN: u64 = 1;
/// Number of members of a UDIM set, 1001 to 1100.
pub const UDIM_PARTS: u32 = 100;

shared! {
    /// A texture, 56 B.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct GpuTexture {
        /// With `TEXTURE_SRGB` and bytes: 256 floats, the decoded value of each byte.
        pub decode: u64,
        /// With `TEXTURE_PTEX`: u32 for each face, log2 of its texels along u, and along v << 8; then, for each class
        /// of sizes from 1 texel on and each face, the number of the first texel of its block
        /// (`oocpt_core::texture::FaceLayout`).
        pub directory: u64,
        /// Number of the first tile among all tiles.
        pub first_page: u32,
        /// Flags, `TEXTURE_*`.
        pub flags: u32,
        /// Number of texels along s.
        pub width: u32,
        /// Number of texels along t.
        pub height: u32,
        /// Number of levels, down to 1 x 1; 0 = there is no image, and lookups give `fallback`.
        pub levels: u32,
        /// Padding; 0.
        pub pad: u32,
        /// Value of lookups if there is no image.
        pub fallback: [f32; 4],
    }
}

shared! {
    /// Tiles that lookups did not find, in core; one in device memory, which the host clears before each wave. A path
    /// that lacked a tile is traced again when the tile is resident; until then the film does not take its wave.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct TextureFeedback {
        /// u32 for each 32 tiles of the scene, one bit each: the tile is in `wanted`, or did not fit.
        pub requested: u64,
        /// u32 per path of the wave: not 0 if it lacked a tile.
        pub incomplete_paths: u64,
        /// u32 each: numbers of tiles, in any order.
        pub wanted: u64,
        /// Number of elements of `wanted`.
        pub request_capacity: u32,
        /// Number of tiles that were requested; `wanted` has no more than its capacity.
        pub request_count: u32,
        /// Not 0 if a path lacked a tile.
        pub is_incomplete: u32,
        /// Padding; 0.
        pub pad: u32,
    }
}
