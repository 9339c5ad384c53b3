// SPDX-License-Identifier: Apache-2.0
//! Keeps the partition from commit to commit: decides which assemblies are opened, cuts their members into chunks, and
//! assembles the world.

use oocpt_abi::NO_ROW;
use std::sync::Arc;

use rustc_hash::{FxHashMap, FxHashSet};

use super::buckets::OrderBuckets;
use super::chunk::Chunk;
use super::cost::AssetCosts;
use super::part::{AssemblyPart, PartitionJob};
use super::place::{place_chunks, top_level};
use super::placed::{PlacedReader, PlacedValues};
use super::placement::OpenedPlacement;
use super::{ChunkInstance, ITEM_BYTES, OPEN_ABOVE, OpenedAssembly, PartitionOptions, PartitionedWorld};
use crate::instancing::GroupId;
use crate::instancing::assembly::Assembly;
use crate::instancing::assembly::InstanceTarget;
use crate::mesh::SceneMesh;

/// Largest number of chunk instances, unless the root alone has more.
const MAX_INSTANCES: u128 = 1 << 22;

/// The state that is kept from one commit to the next.
#[derive(Debug)]
pub(crate) struct PartitionStore {
    options: PartitionOptions,
    item_bytes: u64,
    /// True if chunks whose records move are held.
    holds: bool,
    /// True if the bounds of these may be measured later.
    is_late: bool,
    next_key: u64,
    parts: FxHashMap<GroupId, AssemblyPart>,
    world: Arc<PartitionedWorld>,
    /// The inputs of `world`.
    seen: Option<PartitionInputs>,
}

#[derive(Debug)]
struct PartitionInputs {
    options: PartitionOptions,
    meshes: Vec<Arc<SceneMesh>>,
    assemblies: Vec<Arc<Assembly>>,
}

/// The scene that is partitioned.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PartitionSource<'a> {
    pub(crate) groups: &'a [&'a GroupId],
    pub(crate) meshes: &'a [Arc<SceneMesh>],
    /// Assemblies, one for each group. Children before parents, root last.
    pub(crate) assemblies: &'a [Arc<Assembly>],
    /// Buckets that the scan of each assembly used.
    pub(crate) buckets: &'a [Option<OrderBuckets>],
}

impl Default for PartitionStore {
    fn default() -> Self {
        Self {
            options: PartitionOptions::default(),
            item_bytes: ITEM_BYTES,
            holds: false,
            is_late: false,
            next_key: 0,
            parts: FxHashMap::default(),
            world: Arc::new(PartitionedWorld::empty()),
            seen: None,
        }
    }
}

impl PartitionStore {
    /// Sets other options from the next commit on; returns true if they differ.
    pub(crate) fn set_options(&mut self, options: PartitionOptions) -> bool {
        std::mem::replace(&mut self.options, options) != options
    }

    /// Sets the bytes of items that are held at once, which does not change the result.
    pub(crate) fn set_item_bytes(&mut self, bytes: u64) {
        self.item_bytes = bytes;
    }

    /// Sets whether chunks whose records move are held; returns true if some are and are to be cut now.
    pub(crate) fn set_holds(&mut self, holds: bool) -> bool {
        self.holds = holds;
        let must_cut = !holds && self.world.chunks.iter().any(|chunk| chunk.is_held());
        self.seen = self.seen.take().filter(|_| !must_cut);
        must_cut
    }

    /// Sets whether held chunks are measured later.
    pub(crate) fn set_late(&mut self, is_late: bool) {
        self.is_late = is_late;
    }

    /// Whether held chunks are measured later.
    pub(crate) fn is_late(&self) -> bool {
        self.holds && self.is_late
    }

    /// Bytes of items that are held at once.
    pub(crate) fn item_bytes(&self) -> u64 {
        self.item_bytes
    }

    /// Options of the partition.
    pub(crate) fn options(&self) -> PartitionOptions {
        self.options
    }

    /// Partitions a scene; `None`, and nothing has changed, if some runs have to be measured first.
    pub(crate) fn update(&mut self, source: PartitionSource<'_>) -> Option<Arc<PartitionedWorld>> {
        if self.seen.as_ref().is_some_and(|seen| seen.is_of(self.options, source)) {
            return Some(self.world.clone());
        }
        let costs = Arc::new(AssetCosts::new(source.meshes, source.assemblies));
        let mut limit = self.options.chunk_bytes().saturating_mul(OPEN_ABOVE);
        loop {
            let opened = source.opened(&costs, limit);
            let held = source.is_late().then(|| self.hold(source, &costs, &opened));
            if matches!(held, Some(None)) {
                return None;
            }
            let only_root = opened.iter().filter(|&&o| o).count() <= 1;
            let chunks = self.partition(source, &costs, &opened, held.flatten());
            if only_root || source.count(&opened, &chunks) <= MAX_INSTANCES {
                let mut world = source.world(&opened, chunks);
                world.levels = source.levels(&opened);
                world.chunk_bytes = self.options.chunk_bytes();
                if !world.is_same(&self.world) {
                    self.world = Arc::new(world);
                }
                break;
            }
            limit = limit.saturating_mul(4);
        }
        source.assemblies.iter().flat_map(|a| a.members()).for_each(|m| m.run.drop_kept());
        let (meshes, assemblies) = (source.meshes.to_vec(), source.assemblies.to_vec());
        self.seen = Some(PartitionInputs { options: self.options, meshes, assemblies });
        Some(self.world.clone())
    }

    /// The chunks of the root, if all of them are held.
    fn hold(&self, source: PartitionSource<'_>, costs: &Arc<AssetCosts>, opened: &[bool]) -> Option<Vec<Arc<Chunk>>> {
        let (group, assembly) = source.groups.last().zip(source.assemblies.last())?;
        self.parts.get(*group)?.hold(self.job(assembly, costs, opened, None))
    }

    fn job<'a>(
        &self,
        assembly: &'a Arc<Assembly>,
        costs: &'a Arc<AssetCosts>,
        opened: &'a [bool],
        buckets: Option<&'a OrderBuckets>,
    ) -> PartitionJob<'a> {
        let (chunk_bytes, item_bytes, holds) = (self.options.chunk_bytes(), self.item_bytes, self.holds);
        PartitionJob { assembly, costs, chunk_bytes, opened, item_bytes, buckets, holds }
    }

    /// Brings the chunks of all opened assemblies up to date; those of the root are `held`, if it is known that they
    /// are.
    fn partition(
        &mut self,
        source: PartitionSource<'_>,
        costs: &Arc<AssetCosts>,
        opened: &[bool],
        mut held: Option<Vec<Arc<Chunk>>>,
    ) -> Vec<Vec<Arc<Chunk>>> {
        let mut old = std::mem::take(&mut self.parts);
        let all = source.groups.iter().zip(source.assemblies).zip(source.buckets).zip(opened);
        all.map(|(((group, assembly), buckets), &is_opened)| {
            if !is_opened {
                return Vec::new();
            }
            let mut part = old.remove(*group).unwrap_or_default();
            let of_root = held.take_if(|_| **group == GroupId::Root);
            part.update(self.job(assembly, costs, opened, buckets.as_ref()), of_root);
            for chunk in &mut part.chunks {
                // New ones are not shared yet.
                if let Some(chunk) = Arc::get_mut(chunk).filter(|chunk| chunk.key == 0) {
                    self.next_key += 1;
                    chunk.key = self.next_key;
                }
            }
            let chunks = part.chunks.clone();
            self.parts.insert((*group).clone(), part);
            chunks
        })
        .collect()
    }
}

impl PartitionInputs {
    fn is_of(&self, options: PartitionOptions, source: PartitionSource<'_>) -> bool {
        fn shared<T>(a: &[Arc<T>], b: &[Arc<T>]) -> bool {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| Arc::ptr_eq(a, b))
        }
        self.options == options && shared(&self.meshes, source.meshes) && shared(&self.assemblies, source.assemblies)
    }
}

impl PartitionSource<'_> {
    /// Whether some run of the root is not measured; those of others always are.
    fn is_late(&self) -> bool {
        self.assemblies.last().is_some_and(|root| !root.is_measured())
    }

    /// The root, and every assembly above `limit` that is placed.
    fn opened(&self, costs: &AssetCosts, limit: u64) -> Vec<bool> {
        let mut opened = vec![false; self.assemblies.len()];
        // Moving placements stay instances: chunk instances have no keys (decisions/0027).
        let placed = self.assemblies.iter().flat_map(|assembly| assembly.members());
        let moving: FxHashSet<u32> = placed
            .filter(|member| member.run.key_count() != 0)
            .filter_map(|member| if let InstanceTarget::Assembly(a) = member.target { Some(a) } else { None })
            .collect();
        if let Some(root) = opened.last_mut() {
            *root = true;
        }
        for at in (0..self.assemblies.len()).rev() {
            if !opened[at] {
                continue;
            }
            for member in self.assemblies[at].members().iter().filter(|m| m.run.len() > 0) {
                if let InstanceTarget::Assembly(a) = member.target
                    && costs.of_assembly(a as usize) > limit
                    && !moving.contains(&a)
                    && let Some(child) = opened.get_mut(a as usize)
                {
                    *child = true;
                }
            }
        }
        opened
    }

    /// Opened assemblies that `at` places, with the run of each member that places one.
    fn openings(
        &self,
        opened: &[bool],
        at: usize,
    ) -> impl Iterator<Item = (usize, &crate::instancing::assembly::AssemblyMember)> {
        let members = self.assemblies.get(at).map_or(&[][..], |a| a.members());
        members.iter().filter_map(move |member| match member.target {
            InstanceTarget::Assembly(a) if opened.get(a as usize) == Some(&true) => Some((a as usize, member)),
            _ => None,
        })
    }

    /// Number of chunk instances.
    fn count(&self, opened: &[bool], chunks: &[Vec<Arc<Chunk>>]) -> u128 {
        let mut counts: Vec<u128> = Vec::with_capacity(chunks.len());
        for (at, chunks) in chunks.iter().enumerate() {
            let below = self
                .openings(opened, at)
                .map(|(child, member)| counts.get(child).map_or(0, |n| n.saturating_mul(member.run.len() as u128)));
            let below = below.fold(0, u128::saturating_add);
            counts.push(below.saturating_add(chunks.len() as u128));
        }
        counts.last().copied().unwrap_or(0)
    }

    /// Places the chunks.
    fn world(&self, opened: &[bool], chunks: Vec<Vec<Arc<Chunk>>>) -> PartitionedWorld {
        let mut placements = self.placements(opened);
        let mut world = PartitionedWorld::empty();
        world.placed = PlacedValues::new(&mut placements);
        world.opened.clear();
        for (assembly, (chunks, placements)) in (0..).zip(chunks.into_iter().zip(placements)) {
            // More than 2^32 chunks would need half a terabyte of records: they are not placed.
            let Ok(first) = u32::try_from(world.chunks.len()) else { break };
            let Ok(count) = u32::try_from(chunks.len()) else { break };
            if opened.get(assembly as usize) == Some(&true) {
                world.opened.push(OpenedAssembly { assembly, first_chunk: first, chunks: count });
            }
            let instances = place_chunks(&placements, &chunks, first);
            world.unplaceable += instances.iter().filter(|i| i.is_none()).count() as u64;
            let instances: Vec<ChunkInstance> = instances.into_iter().flatten().collect();
            if world.instances.is_empty() {
                world.instances = instances;
            } else {
                world.instances.extend(instances);
            }
            world.chunks.extend(chunks);
        }
        world.top = top_level(&world.instances);
        world
    }

    /// Placements of each opened assembly: parents' placements times their own.
    fn placements(&self, opened: &[bool]) -> Vec<Vec<OpenedPlacement>> {
        let mut placements: Vec<Vec<OpenedPlacement>> = vec![Vec::new(); self.assemblies.len()];
        if let Some(root) = placements.last_mut() {
            root.push(OpenedPlacement::root());
        }
        for at in (0..self.assemblies.len()).rev() {
            let parents = std::mem::take(&mut placements[at]);
            for (child, member) in self.openings(opened, at).filter(|_| !parents.is_empty()) {
                let count = member.prototype_count();
                let readers = PlacedReader::all_of(member);
                let places: Vec<_> = member.run.reader(None).matrices().collect();
                for parent in &parents {
                    placements[child].extend(places.iter().map(|(rank, matrix)| OpenedPlacement {
                        frame: parent.frame * *matrix,
                        id: parent.id.wrapping_mul(count).wrapping_add(member.run.index_in_prototype(*rank)),
                        values: PlacedReader::values(&readers, &parent.values, *rank),
                        row: NO_ROW,
                    }));
                }
            }
            placements[at] = parents;
        }
        placements
    }

    /// Longest chain of records below the opened assemblies.
    fn levels(&self, opened: &[bool]) -> u32 {
        let mut levels: Vec<u32> = Vec::with_capacity(self.assemblies.len());
        let mut longest = 1;
        for (assembly, &opened_here) in self.assemblies.iter().zip(opened) {
            let below = |opened_too: bool| {
                let placed = assembly.members().iter().filter(|m| m.run.len() > 0);
                let depths = placed.map(|m| match m.target {
                    InstanceTarget::Mesh(_) => 0,
                    InstanceTarget::Assembly(a) if opened_too || opened.get(a as usize) == Some(&false) => {
                        levels.get(a as usize).copied().unwrap_or(0)
                    }
                    InstanceTarget::Assembly(_) => 0,
                });
                depths.max().unwrap_or(0)
            };
            if opened_here {
                longest = longest.max(1 + below(false));
            }
            let all = 1 + below(true);
            levels.push(all);
        }
        longest
    }
}
