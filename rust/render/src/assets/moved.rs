// SPDX-License-Identifier: Apache-2.0
//! Which chunks that moved the device places by itself, and what becomes of them in the store: each keeps the memory
//! that it had, under another key. Render thread only.

use super::catalog::SceneAssets;
use super::lent_arrays::ArrayList;
use super::placing::{MovedChunk, arrays_of, is_known};
use super::source::AssetKey;
use super::store::AssetStore;
use crate::device::Device;
use crate::error::RenderError;
use bytemuck::Zeroable;
use oocpt_abi::{GpuChunkMember, GpuRefittedChunk};
use oocpt_core::partition::Chunk;
use rustc_hash::FxHashMap;
use std::sync::Arc;
use std::time::Duration;

/// Most bytes of the members that are described for a snapshot.
const MAX_DESCRIBED: usize = 64 << 20;
/// The longest that placing may take before the device counts as lost.
const TIMEOUT: Duration = Duration::from_secs(120);

impl AssetStore {
    /// Places the held chunks that moved, each in the memory that it had `before`, by shape. Those that cannot be
    /// placed are left to the loader. Returns the bytes sent, and whether all were placed but for those that have worn
    /// out.
    pub(super) fn place_held(
        &mut self,
        device: &Device,
        assets: &SceneAssets,
        before: &FxHashMap<u64, AssetKey>,
    ) -> Result<(u64, bool), RenderError> {
        let rebuilt = self.placing.take_worn();
        rebuilt.iter().for_each(|shape| self.shapes().forget(*shape));
        let held: Vec<&Arc<Chunk>> = assets.held_chunks().collect();
        self.placing.keep(&held.iter().map(|chunk| chunk.shape()).collect());
        let (mut moved, mut arrays, mut described) = (Vec::new(), ArrayList::default(), 0);
        for chunk in held {
            let Some(members) = chunk.placing().filter(|members| members.iter().all(is_known)) else { continue };
            arrays.add(arrays_of(&members));
            let from = before.get(&chunk.shape()).filter(|_| !rebuilt.contains(&chunk.shape()));
            let resident = from.and_then(|from| Some((from, Arc::clone(&self.get(from)?.memory))));
            described += members.len() * size_of::<GpuChunkMember>();
            if let Some((&from, memory)) = resident {
                moved.push(MovedChunk { chunk, members, from, memory });
            }
        }
        if moved.is_empty() || described > MAX_DESCRIBED {
            return Ok((0, false));
        }
        let (commands, read, bytes) = self.placing.record(device, (&moved, &arrays))?;
        if !commands.submit()?.wait(TIMEOUT)? {
            return Err(RenderError::Internal("placing instances did not finish".into()));
        }
        let mut results = vec![GpuRefittedChunk::zeroed(); moved.len()];
        read.read(0, bytemuck::cast_slice_mut(&mut results))?;
        let worn = self.placing.note(&moved, &results);
        self.shapes().note_placed(moved.len() as u64, moved.iter().map(|moved| moved.chunk.len() as u64).sum(), worn);
        moved.iter().for_each(|moved| self.take_over(&moved.from, AssetKey::Chunk(moved.chunk.key())));
        let left = before.iter().filter(|(shape, key)| !rebuilt.contains(shape) && self.get(key).is_some());
        Ok((bytes, left.count() == 0))
    }
}
