// SPDX-License-Identifier: Apache-2.0
//! Keeps the partition from commit to commit: decides which assemblies are opened, has their members cut into chunks,
//! and puts the world together.

use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::cells::{Cutter, Piece};
use super::chunk::{Chunk, Roster};
use super::cost::{AssetCosts, CutRule};
use super::lattice::{Item, Lattice};
use super::place::{Placement, place_chunks, top_level};
use super::{ChunkInstance, OPEN_ABOVE, PartitionOptions, World};
use crate::mesh::{Aabb, MeshAsset};
use crate::scene::assembly::Assembly;
use crate::scene::{Snapshot, Target};

/// Most chunk instances, unless the root alone has more.
const MAX_INSTANCES: u128 = 1 << 22;

/// What lasts from one commit to the next.
#[derive(Debug)]
pub(crate) struct PartitionStore {
    options: PartitionOptions,
    next_key: u64,
    world: Arc<World>,
    /// What `world` is the partition of.
    seen: Option<Seen>,
}

#[derive(Debug)]
struct Seen {
    options: PartitionOptions,
    meshes: Vec<Arc<MeshAsset>>,
    assemblies: Vec<Arc<Assembly>>,
}

/// What is partitioned.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source<'a> {
    pub(crate) meshes: &'a [Arc<MeshAsset>],
    /// Children before parents, root last.
    pub(crate) assemblies: &'a [Arc<Assembly>],
}

impl Default for PartitionStore {
    fn default() -> Self {
        Self { options: PartitionOptions::default(), next_key: 0, world: Arc::new(World::empty()), seen: None }
    }
}

impl PartitionStore {
    /// Takes other options from the next commit on; true when they differ.
    pub(crate) fn set_options(&mut self, options: PartitionOptions) -> bool {
        std::mem::replace(&mut self.options, options) != options
    }

    /// How to partition.
    pub(crate) fn options(&self) -> PartitionOptions {
        self.options
    }

    /// Partitions a scene.
    pub(crate) fn update(&mut self, source: Source<'_>) -> Arc<World> {
        if self.seen.as_ref().is_some_and(|seen| seen.is_of(self.options, source)) {
            return self.world.clone();
        }
        let costs = AssetCosts::new(source.meshes, source.assemblies);
        let mut limit = self.options.chunk_bytes().saturating_mul(OPEN_ABOVE);
        loop {
            let opened = source.opened(&costs, limit);
            let only_root = opened.iter().filter(|&&o| o).count() <= 1;
            let chunks: Vec<Vec<Arc<Chunk>>> = (0..source.assemblies.len())
                .map(|a| if opened[a] { self.partition(source, &costs, &opened, a) } else { Vec::new() })
                .collect();
            if only_root || source.count(&opened, &chunks) <= MAX_INSTANCES {
                let mut world = source.world(&opened, chunks);
                self.stamp(&mut world);
                world.levels = source.levels(&opened);
                if !world.is_same(&self.world) {
                    self.world = Arc::new(world);
                }
                break;
            }
            limit = limit.saturating_mul(4);
        }
        source.assemblies.iter().flat_map(|a| a.members()).for_each(|m| m.run.drop_items());
        let (meshes, assemblies) = (source.meshes.to_vec(), source.assemblies.to_vec());
        self.seen = Some(Seen { options: self.options, meshes, assemblies });
        self.world.clone()
    }

    /// Cuts one assembly.
    fn partition(&self, source: Source<'_>, costs: &AssetCosts, opened: &[bool], at: usize) -> Vec<Arc<Chunk>> {
        let assembly = &source.assemblies[at];
        let members = assembly.members();
        let is_inside =
            |target: Target| !matches!(target, Target::Assembly(a) if opened.get(a as usize) == Some(&true));
        let inside = || members.iter().zip(0_u32..).filter(|(m, _)| m.run.len() > 0 && is_inside(m.target));
        let mut totals: FxHashMap<Target, u64> = FxHashMap::default();
        inside().for_each(|(m, _)| *totals.entry(m.target).or_default() += m.run.len() as u64);
        let bounds = inside().fold(Aabb::EMPTY, |b, (m, _)| b.union(&m.run.bounds()));
        let lattice = Lattice::around(&bounds);
        let mut items: Vec<Item> = Vec::with_capacity(inside().map(|(m, _)| m.run.len()).sum());
        for (member, number) in inside() {
            let mut part = member.run.take_items();
            part.par_iter_mut().with_min_len(1 << 12).for_each(|item| lattice.place(item, number));
            items.append(&mut part);
        }
        items.par_sort_unstable_by_key(Item::key);
        let ids: Vec<u32> = (0_u32..).take(members.len()).collect();
        let member_of = ids.iter().map(|&id| (id, id)).collect();
        let rule = CutRule { costs, chunk_bytes: self.options.chunk_bytes(), totals };
        let roster = Roster { members, ids: &ids, keeps_frame: assembly.is_split_mesh() };
        let cutter = Cutter { rule: &rule, roster, lattice: &lattice, member_of: &member_of };
        cutter.cut(&[Piece::Loose(&items)])
    }

    /// Gives new chunks their keys.
    fn stamp(&mut self, world: &mut World) {
        for chunk in &mut world.chunks {
            if let Some(chunk) = Arc::get_mut(chunk).filter(|chunk| chunk.key == 0) {
                self.next_key += 1;
                chunk.key = self.next_key;
            }
        }
    }
}

impl Seen {
    fn is_of(&self, options: PartitionOptions, source: Source<'_>) -> bool {
        fn shared<T>(a: &[Arc<T>], b: &[Arc<T>]) -> bool {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| Arc::ptr_eq(a, b))
        }
        self.options == options && shared(&self.meshes, source.meshes) && shared(&self.assemblies, source.assemblies)
    }
}

impl Source<'_> {
    /// The root, and every assembly above `limit` that is placed.
    fn opened(&self, costs: &AssetCosts, limit: u64) -> Vec<bool> {
        let mut opened = vec![false; self.assemblies.len()];
        if let Some(root) = opened.last_mut() {
            *root = true;
        }
        for at in (0..self.assemblies.len()).rev() {
            if !opened[at] {
                continue;
            }
            for member in self.assemblies[at].members().iter().filter(|m| m.run.len() > 0) {
                if let Target::Assembly(a) = member.target
                    && costs.of_assembly(a as usize) > limit
                    && let Some(child) = opened.get_mut(a as usize)
                {
                    *child = true;
                }
            }
        }
        opened
    }

    /// Opened assemblies that `at` places, with the run of each member that does.
    fn openings(&self, opened: &[bool], at: usize) -> impl Iterator<Item = (usize, &crate::scene::assembly::Member)> {
        let members = self.assemblies.get(at).map_or(&[][..], |a| a.members());
        members.iter().filter_map(move |member| match member.target {
            Target::Assembly(a) if opened.get(a as usize) == Some(&true) => Some((a as usize, member)),
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
    fn world(&self, opened: &[bool], chunks: Vec<Vec<Arc<Chunk>>>) -> World {
        let placements = self.placements(opened);
        let mut world = World::empty();
        for (chunks, placements) in chunks.into_iter().zip(placements) {
            // More than 2^32 chunks would need half a terabyte of records: they are not placed.
            let Ok(first) = u32::try_from(world.chunks.len()) else { break };
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

    /// Where each opened assembly is: parents' placements times their own.
    fn placements(&self, opened: &[bool]) -> Vec<Vec<Placement>> {
        let mut placements: Vec<Vec<Placement>> = vec![Vec::new(); self.assemblies.len()];
        if let Some(root) = placements.last_mut() {
            root.push(Placement { frame: glam::DAffine3::IDENTITY, id: 0 });
        }
        for at in (0..self.assemblies.len()).rev() {
            let parents = std::mem::take(&mut placements[at]);
            for (child, member) in self.openings(opened, at).filter(|_| !parents.is_empty()) {
                let count = member.prototype_count();
                let places: Vec<_> = member.run.reader(None).matrices().collect();
                for parent in &parents {
                    placements[child].extend(places.iter().map(|(rank, matrix)| Placement {
                        frame: parent.frame * *matrix,
                        id: parent.id.wrapping_mul(count).wrapping_add(*rank),
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
                    Target::Mesh(_) => 0,
                    Target::Assembly(a) if opened_too || opened.get(a as usize) == Some(&false) => {
                        levels.get(a as usize).copied().unwrap_or(0)
                    }
                    Target::Assembly(_) => 0,
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

impl Snapshot {
    /// What of this scene is partitioned.
    pub(crate) fn source(&self) -> Source<'_> {
        Source { meshes: &self.meshes, assemblies: &self.assemblies }
    }
}
