// SPDX-License-Identifier: Apache-2.0
//! What the passes of `shaders/scene` get: chunks of a live view whose records the device places from the arrays of
//! their instancers, and whose trees it refits.
//!
//! Guarantees: plain data, from which the build makes the structs of the shaders. Doubles are given as their bits: they
//! lie in memory as pairs of words. Any thread.

use bytemuck::{Pod, Zeroable};

/// Threads of a workgroup of `refit_chunks`, which has one for each chunk.
pub const REFIT_THREADS: u32 = 1024;
/// Most levels of a tree that `refit_chunks` refits: more than trees over 2^26 records have.
pub const REFIT_LEVELS: u32 = 64;
/// Words of the set of nodes with changed records below them; trees of more nodes are refitted as a whole.
pub const REFIT_CHANGED_WORDS: u32 = 2048;
/// In [`GpuChunkMember::changed`]: all elements may differ.
pub const ALL_CHANGED: u32 = 1;

/// Bits of [`GpuChunkMember::flags`]: an instancer makes the placements; without it there is one, `before * after`.
pub const MEMBER_INSTANCED: u32 = 1;
/// `after` is not the identity.
pub const MEMBER_AFTER: u32 = 2;
/// Rotations are halves; floats without it.
pub const MEMBER_HALVES: u32 = 4;

shared! {
    /// A member of a held chunk: its records are at `before * T * R * S * M * after`, with the arrays that it has.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
    pub struct GpuChunkMember {
        /// Columns of the map to the chunk's frame, the translation last.
        pub before: [u64; 12],
        /// Columns of the map from the target's frame.
        pub after: [u64; 12],
        /// Translation of `before` in the assembly's frame, in which it is decided what is usable.
        pub parent: [u64; 3],
        /// Middle of the target's box.
        pub center: [u64; 3],
        /// Half its sides.
        pub half_sides: [u64; 3],
        /// Three floats for each instance; 0 if there is none, as the next ones are.
        pub translations: u64,
        /// Quaternions of four floats or halves, the real part last.
        pub rotations: u64,
        /// Three floats for each instance.
        pub scales: u64,
        /// Sixteen doubles for each instance, as Gf stores them.
        pub transforms: u64,
        /// By array, in the order above: one bit for each element that differs from what the records were made of
        /// last; 0 if none does, [`ALL_CHANGED`].
        pub changed: [u64; 4],
        /// Instances that all of these arrays have.
        pub count: u32,
        /// `MEMBER_INSTANCED` and the like.
        pub flags: u32,
    }
}

shared! {
    /// A chunk whose records are placed and whose tree is refitted.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
    pub struct GpuHeldChunk {
        /// [`crate::GpuInstance`] `[record_count]`: of each, the map and the bit of its handedness are written.
        pub records: u64,
        /// [`crate::LevelNode`] `[node_count]`: of each, all but the children is written.
        pub nodes: u64,
        /// Number of the member and of the instance of each record.
        pub places: u64,
        /// [`GpuChunkMember`] array.
        pub members: u64,
        /// Six floats for each node: the box of all below it.
        pub boxes: u64,
        /// Numbers of the nodes, level by level from the root.
        pub order: u64,
        /// Number of levels, then the place in `order` where each begins, and where the last ends: `REFIT_LEVELS + 2`.
        pub levels: u64,
        /// Records.
        pub record_count: u32,
        /// Nodes.
        pub node_count: u32,
        /// 1 if records, boxes, order and levels are those of the last pass, so that only what
        /// [`GpuChunkMember::changed`] names has to be placed; else 0.
        pub is_known: u32,
        /// Padding; 0.
        pub pad: u32,
    }
}

shared! {
    /// What `refit_chunks` tells of a chunk.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct GpuRefittedChunk {
        /// Half the surface of all nodes, a double.
        pub area: u64,
        /// Box of all records in the chunk's frame: smallest corner.
        pub min: [f32; 3],
        /// Largest corner; below `min` if no record is usable.
        pub max: [f32; 3],
        /// Records that are not usable: rays do not find them.
        pub unusable: u32,
        /// Padding; 0.
        pub pad: u32,
    }
}

shared! {
    /// Push constants of the passes of `shaders/scene`, 32 B.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
    pub struct PlacingPush {
        /// `refit_chunks`: [`GpuHeldChunk`] array. `scatter_words`: of each changed element its number, then its words.
        pub source: u64,
        /// `refit_chunks`: [`GpuRefittedChunk`] array. `scatter_words`: the array that is changed.
        pub target: u64,
        /// `refit_chunks`: the chunk of the first workgroup. `scatter_words`: number of changed elements.
        pub count: u32,
        /// `scatter_words`: words of an element.
        pub words: u32,
        /// `scatter_words`: the set of changed elements, one bit for each.
        pub changed: u64,
    }
}
