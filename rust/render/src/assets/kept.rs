// SPDX-License-Identifier: Apache-2.0
//! Encoded assemblies and chunks in host memory, for those that are loaded again and again: a reload is then a copy.
//!
//! Bounded in bytes. The first assets stay: the order in which units come back does not tell which to evict, and one
//! that is not kept costs no more than encoding it. Any thread.

use super::level::EncodedAsset;
use super::shapes::LevelShapes;
use super::source::AssetKey;
use crate::sync::lock;
use rustc_hash::FxHashMap;
use std::sync::{Arc, Mutex};

/// Encoded assets by key, within a limit of bytes; and the shapes of trees.
#[derive(Debug, Default)]
pub(crate) struct EncodedAssets {
    state: Mutex<KeptAssets>,
    pub(super) shapes: LevelShapes,
}

#[derive(Debug, Default)]
struct KeptAssets {
    /// Most bytes.
    most: u64,
    bytes: u64,
    encoded: FxHashMap<AssetKey, Arc<EncodedAsset>>,
}

impl EncodedAssets {
    /// Sets the limit; drops everything if more is held.
    pub(crate) fn limit(&self, most: u64) {
        let mut state = lock(&self.state);
        state.most = most;
        if state.bytes > most {
            (state.bytes, state.encoded) = (0, FxHashMap::default());
        }
    }

    /// Bytes of host memory held.
    pub(crate) fn bytes(&self) -> u64 {
        lock(&self.state).bytes
    }

    /// Whether anything may be kept.
    pub(crate) fn keeps(&self) -> bool {
        lock(&self.state).most > 0
    }

    /// The kept encoding of an asset.
    pub(crate) fn get(&self, key: &AssetKey) -> Option<Arc<EncodedAsset>> {
        lock(&self.state).encoded.get(key).cloned()
    }

    /// Keeps an asset if there is room.
    pub(crate) fn offer(&self, key: AssetKey, encoded: EncodedAsset) {
        let bytes = encoded.bytes();
        let mut state = lock(&self.state);
        if state.bytes + bytes <= state.most && !state.encoded.contains_key(&key) {
            state.bytes += bytes;
            state.encoded.insert(key, Arc::new(encoded));
        }
    }

    /// Drops an asset.
    pub(crate) fn forget(&self, key: &AssetKey) {
        let mut state = lock(&self.state);
        if let Some(encoded) = state.encoded.remove(key) {
            state.bytes -= encoded.bytes();
        }
    }

    /// Drops the assets that `keep` rejects.
    pub(crate) fn retain(&self, keep: impl Fn(&AssetKey) -> bool) {
        let mut state = lock(&self.state);
        state.encoded.retain(|key, _| keep(key));
        state.bytes = state.encoded.values().map(|encoded| encoded.bytes()).sum();
    }
}

#[cfg(test)]
mod tests {
    use super::super::level::EncodedPiece;
    use super::*;

    fn encoded(bytes: usize) -> EncodedAsset {
        EncodedAsset { pieces: vec![EncodedPiece { offset: 0, bytes: vec![7; bytes] }], stack: 3 }
    }

    #[test]
    fn kept_encodings_stay_within_the_limit_first_come_first_kept() {
        let kept = EncodedAssets::default();
        kept.offer(AssetKey::Chunk(0), encoded(1));
        assert!(kept.get(&AssetKey::Chunk(0)).is_none(), "nothing is kept without a limit");
        kept.limit(100);
        (1..4).for_each(|key| kept.offer(AssetKey::Chunk(key), encoded(40)));
        kept.offer(AssetKey::Chunk(1), encoded(20));
        let there = [1, 2, 3].map(|key| kept.get(&AssetKey::Chunk(key)).map(|encoded| encoded.bytes()));
        assert_eq!(there, [Some(40), Some(40), None]);
        assert_eq!(kept.bytes(), 80);
    }

    #[test]
    fn replaced_encodings_are_dropped() {
        let kept = EncodedAssets::default();
        kept.limit(100);
        (1..3).for_each(|key| kept.offer(AssetKey::Chunk(key), encoded(40)));
        kept.retain(|key| *key == AssetKey::Chunk(2));
        assert_eq!((kept.bytes(), kept.get(&AssetKey::Chunk(1)).is_none()), (40, true));
        kept.offer(AssetKey::Assembly(1), encoded(60));
        assert_eq!(kept.bytes(), 100);
        kept.limit(99);
        assert_eq!((kept.bytes(), kept.get(&AssetKey::Chunk(2)).is_none()), (0, true), "a lower limit holds at once");
    }
}
