// SPDX-License-Identifier: Apache-2.0
//! The partition of a scene: chunks in space, and the top level that places them.
//!
//! The root and every assembly too large to be loaded whole are *opened*: their records are cut into [`Chunk`]s, and
//! each placement of an opened assembly puts its chunks into the top level once more, as [`ChunkInstance`]s. Small
//! assemblies are referenced whole by the records of chunks. Nothing here depends on a memory budget.
//!
//! Stages of a commit: `cost` finds what is large, `store` opens assemblies and keeps what did not change, `lattice`
//! and `cells` cut their members into chunks (`stretches` one part after the other, by `buckets`, if there are too
//! many), `place` composes the placements in f64, `top` builds the hierarchy over them. In a live scene `hold` keeps
//! the chunks of records that move. Pure and deterministic; work is spread over the caller's rayon pool.

mod blocks;
mod buckets;
mod cells;
mod changes;
mod chunk;
mod chunk_members;
mod cost;
mod gather;
mod hold;
mod lattice;
mod part;
mod patch;
mod peaks;
mod place;
mod placed;
mod placement;
mod placing;
mod store;
mod stretches;
mod validate;
mod which;

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

pub(crate) use buckets::OrderBuckets;
pub use chunk::Chunk;
pub use hold::HELD_FROM;
pub(crate) use placed::PlacedReader;
pub use placed::PlacedValues;
pub(crate) use placement::PlacedValue;
pub use placing::{MemberPlacing, PLACING_MEMBERS};
pub(crate) use store::{PartitionSource, PartitionStore};
pub use validate::WorldError;

use crate::instancing::item::PlacementItem;
use crate::mesh::{Aabb, Bvh2};

pub use crate::instancing::assembly::{KEY_BYTES, RECORD_BYTES};

/// Smallest size of a chunk, bytes.
pub const MIN_CHUNK_BYTES: u64 = 16 << 10;
/// Factor of the chunk size above which assemblies and meshes are opened and split.
pub(crate) const OPEN_ABOVE: u64 = 4;

/// Bytes of items that a partition holds at once, or a sixteenth of all items if that is more, unless
/// `SceneDb::set_partition_memory` sets another number.
pub const ITEM_BYTES: u64 = 1 << 30;
/// Share of the scene's bytes that items may take, one in so many (see [`ITEM_BYTES`]).
const ITEM_SHARE: u64 = 16;
/// Share of new placements above which an assembly is cut in stretches (see [`cuts_in_stretches`]).
const FRESH_SHARE: u64 = 4;

/// Largest number of `records` placements that become items at once, if `bytes` of them may be held.
pub(crate) fn at_once(bytes: u64, records: u64) -> u64 {
    (bytes / size_of::<PlacementItem>() as u64).max(records / ITEM_SHARE).max(1)
}

/// Returns true if all of `records` placements are cut anew, stretch by stretch, because there are more `fresh` ones
/// than may be items at once. False if these are a small part: then it would cost more time than it saves memory.
pub(crate) fn cuts_in_stretches(fresh: u64, records: u64, at_once: u64) -> bool {
    fresh > at_once && fresh.saturating_mul(FRESH_SHARE) >= records
}

/// Options of a partition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartitionOptions {
    /// Most bytes of a chunk: its records, their hierarchy, and the targets that no other chunk of the assembly places.
    /// Taken as [`MIN_CHUNK_BYTES`] if it is less.
    pub chunk_bytes: u64,
}

impl Default for PartitionOptions {
    fn default() -> Self {
        Self { chunk_bytes: 8 << 20 }
    }
}

impl PartitionOptions {
    /// The chunk size in effect.
    pub(crate) fn chunk_bytes(&self) -> u64 {
        self.chunk_bytes.max(MIN_CHUNK_BYTES)
    }

    /// Bytes above which meshes are split.
    pub(crate) fn mesh_limit(&self) -> u64 {
        self.chunk_bytes().saturating_mul(OPEN_ABOVE)
    }
}

/// A partitioned scene.
#[derive(Clone, Debug)]
pub struct PartitionedWorld {
    /// Chunks of the opened assemblies, children first, in Morton order, indexed by [`ChunkInstance::chunk`].
    pub chunks: Vec<Arc<Chunk>>,
    /// Placements of chunks.
    pub instances: Vec<ChunkInstance>,
    /// Hierarchy over `instances`: every leaf is one item, whose `child` is the number of the instance.
    pub top: Bvh2,
    /// Length of the longest chain of records from a chunk's record to a mesh; at least 1.
    pub levels: u32,
    /// Opened assemblies that have placements, children first, the root last.
    pub opened: Vec<OpenedAssembly>,
    /// The chunk size that was asked for, bytes.
    pub chunk_bytes: u64,
    /// Values of primvars at placements of opened assemblies.
    pub placed: PlacedValues,
    /// Number of chunk instances left out because their composed transform is beyond single precision.
    pub unplaceable: u64,
}

/// An assembly whose records are in chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OpenedAssembly {
    /// Index into [`crate::scene::Snapshot::assemblies`].
    pub assembly: u32,
    /// Its first chunk.
    pub first_chunk: u32,
    /// Number of its chunks.
    pub chunks: u32,
}

/// A placement of a chunk in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChunkInstance {
    /// Index into [`PartitionedWorld::chunks`].
    pub chunk: u32,
    /// Rows of the linear map from the world's frame to the chunk's.
    pub chunk_from_world: [[f32; 3]; 3],
    /// The world point, minus the snapshot's origin, that is (0, 0, 0) in the chunk's frame.
    pub origin: DVec3,
    /// Instance id so far: from 0, over the opened placements from the outermost in, `id * prototype_count + index`,
    /// wrapping.
    pub instance_id: u32,
    /// Values of primvars of the opened placements: row of [`PartitionedWorld::placed`], or `NO_ROW`.
    pub row: u32,
    /// Box in the world's frame, minus the snapshot's origin. It contains all records as `chunk_from_world` and
    /// `origin`, in single precision and as the sum of two floats, place them.
    pub bounds: Aabb,
}

impl PartitionedWorld {
    /// Bytes of host memory held, without the arrays that records are computed from.
    #[must_use]
    pub fn host_bytes(&self) -> u64 {
        let chunks: u64 = self.chunks.iter().map(|chunk| chunk.host_bytes()).sum();
        chunks + (size_of_val(&self.instances[..]) + size_of_val(&self.top.nodes[..])) as u64
    }

    /// The world with the bounds of all chunks as they are, if some [were late](Chunk::is_late); those that still are
    /// get measured, on the caller's rayon pool. `None` if none was.
    #[must_use]
    pub fn measured(&self) -> Option<Self> {
        let root = self.opened.last()?;
        let first = root.first_chunk as usize;
        let chunks = self.chunks.get(first..first + root.chunks as usize)?;
        if !chunks.iter().any(|chunk| chunk.was_late()) {
            return None;
        }
        chunks.par_iter().for_each(|chunk| chunk.measure());
        let mut world = self.clone();
        // The root is placed once, and none of its chunks elsewhere.
        let at = [placement::OpenedPlacement::root()];
        for instance in &mut world.instances {
            let number = (instance.chunk as usize).checked_sub(first);
            let Some(chunk) = number.and_then(|number| chunks.get(number)).filter(|chunk| chunk.was_late()) else {
                continue;
            };
            let placed = place::place_chunks(&at, std::slice::from_ref(chunk), instance.chunk);
            instance.bounds = placed.into_iter().flatten().next().map_or(Aabb::EMPTY, |placed| placed.bounds);
        }
        world.top = place::top_level(&world.instances);
        Some(world)
    }

    /// The world without anything.
    pub(crate) fn empty() -> Self {
        Self {
            chunks: Vec::new(),
            instances: Vec::new(),
            top: place::top_level(&[]),
            levels: 1,
            opened: vec![OpenedAssembly { assembly: 0, first_chunk: 0, chunks: 0 }],
            chunk_bytes: PartitionOptions::default().chunk_bytes(),
            placed: PlacedValues::default(),
            unplaceable: 0,
        }
    }
}
