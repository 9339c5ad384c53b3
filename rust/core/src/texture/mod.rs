// SPDX-License-Identifier: Apache-2.0
//! Textures without a device: the tiles and the coarser levels of an image, the choice of sRGB, a reference of the
//! shaders' filter in f64, heights that displace surfaces, and opacity masks of cutouts.
//!
//! Guarantees: pure functions, any thread, no panic on any input. Rows are counted from the bottom: texel (0, 0) is at
//! the origin of st. Sources: `UsdUVTexture` of the `UsdPreviewSurface` specification 2.6 (wrap modes, colour spaces,
//! channels); IEC 61966-2-1 (sRGB).

mod color;
mod covered;
mod faces;
mod footprint;
mod heights;
mod layout;
mod opacity_mask;
mod pyramid;
mod twin;

pub use crate::material::linear_from_srgb;
pub use color::{expand, is_srgb, srgb_from_linear};
#[cfg(test)]
pub(crate) use covered::tests as tests_of_covered;
pub(crate) use covered::{CoveredImage, UvRegion};
pub use faces::{FaceBlock, FaceLayout, MAX_FACE_LOG2, TILE_TEXELS, class_size};
pub use footprint::{MAX_ANISOTROPY, ellipse, filter_width};
pub use heights::{HeightCache, HeightFiles, HeightImage};
pub(crate) use heights::{HeightLevel, member_of, numbered};
pub use layout::{LayoutError, MAX_SIDE, TileLayout, TilePiece};
pub use opacity_mask::{OpacityMask, OpacityMaskMaker, OpacityQuery, mask_bytes};
pub use pyramid::{TexturePyramid, weights};
pub use twin::{PtexSampler, TextureSampler, pack_ptex, select_level, unpack_ptex};

pub use crate::material::{ColorSpace, TextureRef, Wrap};

/// The storage of a channel of a texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum TexelFormat {
    /// Bytes: 0 to 255 for 0 to 1.
    U8,
    /// Floats of half precision.
    F16,
    /// Floats of single precision.
    F32,
}

impl TexelFormat {
    /// Bytes of a channel.
    pub const fn bytes(self) -> u32 {
        match self {
            Self::U8 => 1,
            Self::F16 => 2,
            Self::F32 => 4,
        }
    }
}
