// SPDX-License-Identifier: Apache-2.0
//! The keys of opacity masks.

use oocpt_core::texture::OpacityMask;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Everything that a mask depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct MaskKey {
    pub(super) image: u64,
    pub(super) channel: u8,
    /// As in `GpuTexture::flags`, along s and t.
    pub(super) wrap: [u32; 2],
    /// Longest side in texels.
    pub(super) side: u32,
    /// Bits of the scale, the bias, the threshold and the value around the image.
    pub(super) query: [u32; 4],
}

/// The masks that were built; `None` for an image that has none.
pub(super) type MadeMasks = FxHashMap<MaskKey, Option<Arc<OpacityMask>>>;
