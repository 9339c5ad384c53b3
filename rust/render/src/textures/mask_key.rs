// SPDX-License-Identifier: Apache-2.0
//! What masks of opacity are known by.

use oocpt_core::texture::OpacityMask;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Image, channel, wrap modes, the longest side, and the bits of scale, bias, threshold and what is around the image.
pub(super) type MaskKey = (u64, u8, [u32; 3], [u32; 4]);

/// Masks that were made; `None`: there is none.
pub(super) type MadeMasks = FxHashMap<MaskKey, Option<Arc<OpacityMask>>>;
