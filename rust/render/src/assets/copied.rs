// SPDX-License-Identifier: Apache-2.0
//! What was copied to the device. Plain data.

use super::source::AssetKey;
use oocpt_core::residency::AssetId;
use oocpt_gpu::Submission;

/// Copies to the device.
#[derive(Debug, Default)]
pub(crate) struct CopiedAssets {
    /// What to wait for.
    pub(crate) submissions: Vec<Submission>,
    pub(crate) bytes: u64,
    /// The assets, and the stack entries that a walk of the tree of each needs.
    pub(crate) assets: Vec<(AssetId, u32)>,
    /// Of these, what cannot be had and is left out of the picture, and why.
    pub(crate) left_out: Vec<(AssetKey, String)>,
}
