// SPDX-License-Identifier: Apache-2.0
//! Places the records of held chunks on the device: the arrays of their instancers lie there as the host lends them, a
//! pass makes the records of chunks that moved from them and refits the trees (`shaders/scene/refit_chunks.comp`). So
//! an edit sends the elements that changed, and neither records nor nodes. Of a chunk that was placed with the edit
//! before, the pass places what these elements name.
//!
//! The arrays, member and number of each record, and boxes of nodes are in the device's budget; where there is no room for them, or
//! the device has no double precision, the host encodes chunks. Render thread only.

use super::copied::CopiedAssets;
use super::lent_arrays::{ArrayList, LentArrays, ScatteredWords, SentBytes};
use super::source::{AssetKey, AssetSource};
use crate::device::{Device, PassSpecialisation};
use crate::error::RenderError;
use bytemuck::Zeroable;
use oocpt_abi::{
    Features, GpuChunkMember, GpuHeldChunk, GpuRefittedChunk, MEMBER_AFTER, MEMBER_HALVES, MEMBER_INSTANCED,
    PlacingPush, REFIT_LEVELS, groups,
};
use oocpt_core::Aabb;
use oocpt_core::array::{ElementType, TypedArray};
use oocpt_core::mesh::{has_worn, level_node_count};
use oocpt_core::partition::{Chunk, MemberPlacing};
use oocpt_gpu::{Buffer, BufferUsage, CommandList, HeapRange};
use oocpt_shaders::scene;
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::hash_map::Entry;
use std::sync::{Arc, Weak};
use xxhash_rust::xxh3::xxh3_128;

/// Bytes of a node that are kept beside it: its box, and a place in the order of the nodes.
const NODE_BYTES: u64 = 24 + 4;
/// Bytes of the levels of a tree.
const LEVEL_BYTES: u64 = (REFIT_LEVELS as u64 + 2) * 4;
/// Most workgroups of a dispatch.
const MAX_GROUPS: usize = 1 << 15;
/// Records whose trees the host builds for a snapshot in place of worn ones, as in [`super::shapes`].
const REBUILT_RECORDS: usize = 1 << 16;
/// Most elements of an array: 32 bits number the parts of an element, of which there are sixteen at most.
const MAX_ELEMENTS: usize = 1 << 27;
/// Columns of the identity.
const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

/// What is known of the shape of a chunk.
#[derive(Debug)]
struct PlacedShape {
    /// Member and number of each record.
    places: HeapRange,
    /// Boxes of nodes, their order, and their levels.
    tree: HeapRange,
    /// Half the surface of all nodes of its tree when it was placed first.
    area: Option<f64>,
    /// What it was placed from last.
    last: Option<LastPlacing>,
}

/// A placing of a chunk.
#[derive(Debug)]
struct LastPlacing {
    /// Its number.
    round: u64,
    /// Where records and nodes are.
    memory: Weak<HeapRange>,
    /// A hash of the members, without their arrays.
    members: u128,
}

/// What placing keeps on the device.
#[derive(Debug, Default)]
pub(super) struct DevicePlacing {
    arrays: LentArrays,
    shapes: FxHashMap<u64, PlacedShape>,
    /// Number of the last placing.
    round: u64,
    /// Shapes that have worn out, with their growth and their number of records.
    worn: Vec<(u64, f64, usize)>,
}

/// A chunk to place.
pub(super) struct MovedChunk<'a> {
    pub(super) chunk: &'a Arc<Chunk>,
    pub(super) members: Vec<MemberPlacing>,
    /// Where it is: the key that it had.
    pub(super) from: AssetKey,
    /// Its records and nodes.
    pub(super) memory: Arc<HeapRange>,
}

impl DevicePlacing {
    /// Bytes of device memory held.
    pub(super) fn bytes(&self) -> u64 {
        self.arrays.bytes() + self.shapes.values().map(|shape| shape.places.size() + shape.tree.size()).sum::<u64>()
    }

    /// Forgets the shapes that are not among these.
    pub(super) fn keep(&mut self, shapes: &FxHashSet<u64>) {
        self.shapes.retain(|shape, _| shapes.contains(shape));
    }

    /// Takes the shapes that are to be built anew: those that have worn out most.
    pub(super) fn take_worn(&mut self) -> FxHashSet<u64> {
        let mut worn = std::mem::take(&mut self.worn);
        worn.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        let mut room = REBUILT_RECORDS;
        let mut taken = FxHashSet::default();
        for (shape, _, records) in worn {
            // One at least, however large it is.
            if !taken.is_empty() && records > room {
                break;
            }
            room = room.saturating_sub(records);
            self.shapes.remove(&shape);
            taken.insert(shape);
        }
        taken
    }

    /// Brings what the passes read, and records them; returns the results to come, in the order of `moved`, and the
    /// bytes sent.
    pub(super) fn record(
        &mut self,
        device: &Device,
        (moved, live): (&[MovedChunk<'_>], &ArrayList),
    ) -> Result<(CommandList, Buffer, u64), RenderError> {
        let mut wanted = ArrayList::default();
        moved.iter().for_each(|moved| wanted.add(arrays_of(&moved.members)));
        let (mut sent, mut scattered) = (SentBytes::new(device)?, Vec::new());
        self.arrays.bring([&wanted, live], &mut sent, &mut scattered)?;
        self.round += 1;
        for moved in moved {
            let chunk = moved.chunk;
            if let Entry::Vacant(shape) = self.shapes.entry(chunk.shape()) {
                let mut places: Vec<[u32; 2]> = Vec::with_capacity(chunk.len());
                chunk.each_place(|member, number| places.push([member, number]));
                let places = sent.range("places of records", bytemuck::cast_slice(&places))?;
                let tree_bytes = nodes_of(moved) * NODE_BYTES + LEVEL_BYTES;
                let tree = device.heap.alloc("bounds of nodes", tree_bytes, 256)?;
                shape.insert(PlacedShape { places, tree, area: None, last: None });
            }
        }
        let members: Vec<GpuChunkMember> =
            moved.iter().flat_map(|moved| &moved.members).map(|member| self.describe(member)).collect();
        let members = sent.range("members of chunks", bytemuck::cast_slice(&members))?;
        let chunks = self.chunks(moved, &members);
        let chunks = sent.range("chunks to place", bytemuck::cast_slice(&chunks))?;
        let result_bytes = (moved.len() * size_of::<GpuRefittedChunk>()) as u64;
        let results = device.heap.alloc("chunks placed", result_bytes, 256)?;
        let read = Buffer::new(&device.gpu, "chunks placed", result_bytes, BufferUsage::Readback)?;
        let mut commands = device.gpu.commands("place")?;
        let CopiedAssets { submissions, bytes, .. } = sent.finish()?;
        submissions.iter().for_each(|copy| commands.wait_for(copy));
        for range in [&members, &chunks, &results] {
            commands.keep(range);
        }
        scatter(device, &mut commands, &scattered)?;
        let pass = device.pipeline(&scene::SCENE_REFIT_CHUNKS, plain())?;
        let mut first = 0;
        for batch in moved.chunks(MAX_GROUPS) {
            let count = u32::try_from(batch.len()).unwrap_or(0);
            let [source, target] = [chunks.address(), results.address()];
            let push = PlacingPush { source, target, count: first, words: 0, changed: 0 };
            commands.dispatch(&pass, bytemuck::bytes_of(&push), [count, 1, 1]);
            first += count;
        }
        commands.copy(&results, 0, &read, 0, result_bytes);
        Ok((commands, read, bytes))
    }

    /// The chunks for the passes. Notes that they are placed.
    fn chunks(&mut self, moved: &[MovedChunk<'_>], members: &HeapRange) -> Vec<GpuHeldChunk> {
        let mut first_member = 0_u64;
        let mut chunks = Vec::with_capacity(moved.len());
        for moved in moved {
            let Some(shape) = self.shapes.get_mut(&moved.chunk.shape()) else { continue };
            let (round, described) = (self.round, hash_of(&moved.members));
            let now = LastPlacing { round, memory: Arc::downgrade(&moved.memory), members: described };
            let is_known = shape.last.replace(now).is_some_and(|last| {
                let is_there = std::ptr::eq(last.memory.as_ptr(), Arc::as_ptr(&moved.memory));
                last.round + 1 == round && is_there && last.members == described
            });
            let (records, nodes) = (moved.memory.address(), nodes_of(moved));
            chunks.push(GpuHeldChunk {
                records,
                nodes: records + AssetSource::Chunk(Arc::clone(moved.chunk)).nodes_at(),
                places: shape.places.address(),
                members: members.address() + first_member * size_of::<GpuChunkMember>() as u64,
                boxes: shape.tree.address(),
                order: shape.tree.address() + 24 * nodes,
                levels: shape.tree.address() + NODE_BYTES * nodes,
                // A chunk with more is rejected before it is loaded.
                record_count: u32::try_from(moved.chunk.len()).unwrap_or(0),
                node_count: u32::try_from(nodes).unwrap_or(0),
                is_known: u32::from(is_known),
                pad: 0,
            });
            first_member += moved.members.len() as u64;
        }
        chunks
    }

    fn describe(&self, member: &MemberPlacing) -> GpuChunkMember {
        let arrays = member.arrays.as_ref();
        let found = [0, 1, 2, 3].map(|at| self.arrays.find(arrays.and_then(|arrays| arrays[at].as_ref())));
        let [translations, rotations, scales, transforms] = found.map(|[address, _]| address);
        let changed = found.map(|[_, changed]| changed);
        GpuChunkMember { translations, rotations, scales, transforms, changed, ..described(member) }
    }
    /// Notes what became of chunks: how much the surface of their trees has grown.
    pub(super) fn note(&mut self, moved: &[MovedChunk<'_>], results: &[GpuRefittedChunk]) -> u64 {
        let before = self.worn.len();
        for (MovedChunk { chunk, .. }, result) in moved.iter().zip(results) {
            let area = f64::from_bits(result.area);
            chunk.set_bounds(Aabb { min: result.min, max: result.max });
            let Some(shape) = self.shapes.get_mut(&chunk.shape()) else { continue };
            let growth = area / *shape.area.get_or_insert(area);
            if has_worn(growth) && area > 0.0 {
                self.worn.push((chunk.shape(), growth, chunk.len()));
            }
            if result.unusable > 0 {
                tracing::debug!(unusable = result.unusable, "instances that the device cannot place");
            }
        }
        (self.worn.len() - before) as u64
    }
}

/// A member without its arrays.
fn described(member: &MemberPlacing) -> GpuChunkMember {
    let rotations = member.arrays.as_ref().and_then(|arrays| arrays[1].as_ref());
    let halves = rotations.is_some_and(|q| q.element() == ElementType::Quath);
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    GpuChunkMember {
        before: member.before.map(f64::to_bits),
        after: member.after.unwrap_or(IDENTITY).map(f64::to_bits),
        parent: member.parent.map(f64::to_bits),
        center: member.center.map(f64::to_bits),
        half_sides: member.half.map(f64::to_bits),
        count: u32::try_from(member.count).unwrap_or(u32::MAX),
        flags: flag(member.arrays.is_some(), MEMBER_INSTANCED)
            | flag(member.after.is_some(), MEMBER_AFTER)
            | flag(halves, MEMBER_HALVES),
        ..GpuChunkMember::zeroed()
    }
}

/// A hash of members without their arrays.
fn hash_of(members: &[MemberPlacing]) -> u128 {
    let described: Vec<GpuChunkMember> = members.iter().map(described).collect();
    xxh3_128(bytemuck::cast_slice(&described))
}

fn nodes_of(moved: &MovedChunk<'_>) -> u64 {
    level_node_count(moved.chunk.len()) as u64
}

fn scatter(device: &Device, commands: &mut CommandList, scattered: &[ScatteredWords]) -> Result<(), RenderError> {
    if scattered.is_empty() {
        return Ok(());
    }
    let pass = device.pipeline(&scene::SCENE_SCATTER_WORDS, plain())?;
    for ScatteredWords { changed, .. } in scattered {
        commands.fill(changed, 0, changed.size(), 0);
    }
    for ScatteredWords { entries, target, changed, count, words } in scattered {
        commands.keep(entries);
        let (source, changed) = (entries.address(), changed.address());
        let push = PlacingPush { source, target: *target, count: *count, words: *words, changed };
        commands.dispatch(&pass, bytemuck::bytes_of(&push), groups((*count).into()));
    }
    Ok(())
}

/// Passes of the scene have no features.
fn plain() -> PassSpecialisation {
    PassSpecialisation {
        max_levels: 1,
        stack_size: 1,
        features: Features::empty(),
        #[cfg(feature = "faults")]
        fault: 0,
    }
}

/// Whether the passes read the arrays of a member.
pub(super) fn is_known(member: &MemberPlacing) -> bool {
    use ElementType::{Matrix4d, Quatf, Quath, Vec3f};
    let read: [&[ElementType]; 4] = [&[Vec3f], &[Quatf, Quath], &[Vec3f], &[Matrix4d]];
    let arrays = member.arrays.iter().flat_map(|arrays| arrays.iter().zip(read));
    arrays
        .filter_map(|(array, read)| Some((array.as_ref()?, read)))
        .all(|(array, read)| read.contains(&array.element()) && array.len() <= MAX_ELEMENTS)
}

/// The arrays that place the records of members.
pub(super) fn arrays_of(members: &[MemberPlacing]) -> impl Iterator<Item = &TypedArray> {
    members.iter().flat_map(|member| &member.arrays).flatten().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_worn_trees_are_built_first_within_a_number_of_records() {
        let taken = |worn: &[(u64, f64, usize)]| {
            let mut taken: Vec<u64> =
                DevicePlacing { worn: worn.to_vec(), ..DevicePlacing::default() }.take_worn().into_iter().collect();
            taken.sort_unstable();
            taken
        };
        assert_eq!(taken(&[]), [0; 0]);
        let large = REBUILT_RECORDS / 4 * 3;
        assert_eq!(taken(&[(1, 1.6, large), (2, 3.0, large), (3, 1.7, 100)]), [2, 3], "the worst, and what fits");
        assert_eq!(taken(&[(7, 1.6, 2 * REBUILT_RECORDS)]), [7], "one at least");
        assert_eq!(taken(&[(5, f64::NAN, large), (6, 9.0, large)]), [5], "worse than any number");
    }
}
