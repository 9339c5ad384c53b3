// SPDX-License-Identifier: Apache-2.0
//! Checks every invariant of a world, for tests and for `doctor`. It measures and encodes every record once.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};
use rustc_hash::{FxHashMap, FxHashSet};

use super::cells::is_scattered;
use super::chunk::Chunk;
use super::chunk::SCATTERED;
use super::cost::AssetCosts;
use super::lattice::MortonLattice;
use super::part::PartitionJob;
use super::{ChunkInstance, OpenedAssembly, PartitionedWorld};
use crate::instancing::assembly::AssemblyMember;
use crate::instancing::assembly::{Assembly, InstanceRecord, InstanceTarget};
use crate::instancing::item::ItemKey;
use crate::instancing::validate::validate_record;
use crate::mesh::SceneMesh;
use crate::mesh::{Aabb, BvhError};

/// A broken invariant of a [`PartitionedWorld`]: always a bug of this crate.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WorldError {
    /// A chunk breaks an invariant.
    #[error("chunk {chunk}: {what}")]
    Chunk {
        /// Chunk number.
        chunk: usize,
        /// The broken invariant.
        what: &'static str,
    },
    /// The chunks of an assembly do not contain its records, or are not its canonical cells.
    #[error("chunks of assembly {assembly}: {what}")]
    Assembly {
        /// Assembly index.
        assembly: usize,
        /// The broken invariant.
        what: &'static str,
    },
    /// A chunk instance breaks an invariant.
    #[error("chunk instance {instance}: {what}")]
    Instance {
        /// Number of the chunk instance.
        instance: usize,
        /// The broken invariant.
        what: &'static str,
    },
    /// The hierarchy is broken.
    #[error("top level: {0}")]
    Top(#[from] BvhError),
    /// A total is wrong.
    #[error("{0} is wrong")]
    Count(&'static str),
}

/// One opened assembly under test.
struct PartitionCheck<'a> {
    world: &'a PartitionedWorld,
    meshes: &'a [Arc<SceneMesh>],
    assemblies: &'a [Arc<Assembly>],
    part: OpenedAssembly,
    job: PartitionJob<'a>,
    lattice: MortonLattice,
    /// Number of each member by the address of its run; the runs of an assembly are distinct.
    numbers: FxHashMap<usize, u32>,
}

impl PartitionedWorld {
    /// Checks that it is the partition of a snapshot with these meshes and assemblies: that every record of every
    /// opened assembly is in exactly one chunk, in Morton order, in canonical cells within the limits (order and cells
    /// only of assemblies without held chunks); that boxes contain their records, in f64; that chunk instances are the
    /// composed placements; and that the top level reaches each of them once.
    ///
    /// # Errors
    /// The first broken invariant.
    pub fn validate(&self, meshes: &[Arc<SceneMesh>], assemblies: &[Arc<Assembly>]) -> Result<(), WorldError> {
        match self.measured() {
            Some(measured) => measured.validate_measured(meshes, assemblies),
            None => self.validate_measured(meshes, assemblies),
        }
    }

    fn validate_measured(&self, meshes: &[Arc<SceneMesh>], assemblies: &[Arc<Assembly>]) -> Result<(), WorldError> {
        let costs = Arc::new(AssetCosts::new(meshes, assemblies));
        let mut opened = vec![false; assemblies.len()];
        for part in &self.opened {
            *opened.get_mut(part.assembly as usize).ok_or(WorldError::Count("an opened assembly"))? = true;
        }
        let mut next = 0;
        let mut levels = 1;
        for &part in &self.opened {
            if part.first_chunk != next {
                return Err(WorldError::Count("the range of chunks"));
            }
            next += part.chunks;
            let assembly = &assemblies[part.assembly as usize];
            let job = PartitionJob {
                assembly,
                costs: &costs,
                chunk_bytes: self.chunk_bytes,
                opened: &opened,
                item_bytes: u64::MAX,
                buckets: None,
                holds: false,
            };
            let numbers = job.inside().map(|(number, m)| (address(m), number)).collect();
            PartitionCheck { world: self, meshes, assemblies, part, job, lattice: job.lattice(), numbers }.run()?;
            levels = job.inside().map(|(_, m)| 1 + depth(assemblies, m.target)).fold(levels, u32::max);
        }
        if next as usize != self.chunks.len() || opened.last() != Some(&true) {
            return Err(WorldError::Count("the range of chunks"));
        }
        if levels != self.levels {
            return Err(WorldError::Count("the number of levels"));
        }
        let keys: FxHashSet<u64> = self.chunks.iter().map(|c| c.key()).collect();
        if keys.len() != self.chunks.len() || keys.contains(&0) {
            return Err(WorldError::Count("a key"));
        }
        self.validate_instances(assemblies, &opened)?;
        let boxes: Vec<Aabb> = self.instances.iter().map(|i| i.bounds).collect();
        Ok(self.top.validate_boxes(&boxes)?)
    }

    /// Walks all paths through opened assemblies and looks for the instances of their chunks.
    fn validate_instances(&self, assemblies: &[Arc<Assembly>], opened: &[bool]) -> Result<(), WorldError> {
        let mut found: FxHashMap<(u32, u32), Vec<usize>> = FxHashMap::default();
        for (number, instance) in self.instances.iter().enumerate() {
            found.entry((instance.chunk, instance.instance_id)).or_default().push(number);
        }
        let mut left = self.instances.len() as u64 + self.unplaceable;
        let mut open = vec![(opened.len() - 1, DAffine3::IDENTITY, 0_u32)];
        while let Some((at, frame, id)) = open.pop() {
            let part = self.opened.iter().find(|p| p.assembly as usize == at).ok_or(WorldError::Count("opened"))?;
            for chunk in part.first_chunk..part.first_chunk + part.chunks {
                left = left.checked_sub(1).ok_or(WorldError::Count("the number of chunk instances"))?;
                let same = found.get_mut(&(chunk, id));
                let bounds_of = &self.chunks[chunk as usize];
                let place = same.and_then(|numbers| {
                    let at = numbers.iter().position(|&n| is_at(&self.instances[n], &frame, bounds_of))?;
                    Some(numbers.swap_remove(at))
                });
                match place {
                    Some(instance) => check_bounds(&self.instances[instance], bounds_of)
                        .map_err(|what| WorldError::Instance { instance, what })?,
                    None if self.unplaceable > 0 => {}
                    None => return Err(WorldError::Chunk { chunk: chunk as usize, what: "a placement is missing" }),
                }
            }
            for member in assemblies[at].members() {
                if let InstanceTarget::Assembly(a) = member.target
                    && opened[a as usize]
                {
                    let count = member.prototype_count();
                    let reader = member.run.reader(None);
                    open.extend(reader.matrices().map(|(rank, matrix)| {
                        let index = member.run.index_in_prototype(rank);
                        (a as usize, frame * matrix, id.wrapping_mul(count).wrapping_add(index))
                    }));
                }
            }
        }
        if left == 0 { Ok(()) } else { Err(WorldError::Count("the number of chunk instances")) }
    }
}

impl PartitionCheck<'_> {
    fn run(&self) -> Result<(), WorldError> {
        let range = self.part.first_chunk as usize..(self.part.first_chunk + self.part.chunks) as usize;
        let mut last: Option<ItemKey> = None;
        let mut records = 0;
        // The order of held chunks is that of before their records moved.
        let is_held = self.world.chunks[range.clone()].iter().any(|chunk| chunk.is_held());
        let mut seen = FxHashSet::default();
        for at in range.clone() {
            let keys = self.chunk(at).map_err(|what| WorldError::Chunk { chunk: at, what })?;
            if is_held {
                records += keys.len();
                if !keys.iter().all(|key| seen.insert(key.id)) {
                    return Err(WorldError::Chunk { chunk: at, what: "a record is there twice" });
                }
                continue;
            }
            let ordered = keys.windows(2).all(|pair| pair[0] < pair[1]);
            if !ordered || keys.first().is_none_or(|first| last.is_some_and(|last| last >= *first)) {
                // The order is strictly ascending, so no record is there twice.
                return Err(WorldError::Chunk { chunk: at, what: "it is empty or not in order" });
            }
            last = keys.last().copied();
            records += keys.len();
        }
        let wrong = |what| WorldError::Assembly { assembly: self.part.assembly as usize, what };
        if records != self.job.inside().map(|(_, m)| m.run.len()).sum() {
            return Err(wrong("a record is missing"));
        }
        if is_held {
            return Ok(());
        }
        self.cells(&self.world.chunks[range]).map_err(wrong)
    }

    /// Checks one chunk by itself; returns the positions of its records in the order of the assembly.
    fn chunk(&self, at: usize) -> Result<Vec<ItemKey>, &'static str> {
        let chunk = &self.world.chunks[at];
        let members = chunk.members();
        let mut records = vec![InstanceRecord::default(); chunk.len()];
        chunk.encode(0..chunk.len(), &mut records);
        let mut keys = Vec::with_capacity(chunk.len());
        let (mut targets, mut items) = (FxHashSet::default(), Vec::with_capacity(chunk.len()));
        for (k, record) in records.iter().enumerate() {
            let (which, rank) = chunk.place(k).ok_or("a record has no place")?;
            let member = members.get(which).ok_or("a record has no member")?;
            let number = *self.numbers.get(&address(member)).ok_or("a member is not of this assembly")?;
            let present = &self.job.assembly.members()[number as usize];
            if (present.target, present.prim_id) != (member.target, member.prim_id) {
                return Err("a member is not the present one");
            }
            targets.insert(record.target);
            let item = member.run.reader(None).item(rank);
            if item.is_none() && chunk.was_late() {
                // Nobody looked; no ray finds it.
                if record.bounds[0] <= record.bounds[1] {
                    return Err("a record that is not usable has a box");
                }
                keys.push(ItemKey { code: 0, id: u64::from(number) << 32 | u64::from(rank) });
                continue;
            }
            let mut item = item.ok_or("a record is not usable")?;
            self.lattice.place(&mut item, number);
            keys.push(item.key());
            items.push(item);
            let inside = self.bounds_of(record.target).ok_or("a target is out of range")?;
            validate_record(record, &inside, &chunk.bounds())?;
            let matrix = member.run.reader(None).matrix(rank).ok_or("a record is not usable")?;
            if corners(&inside).any(|p| !holds(&chunk.bounds(), matrix.transform_point3(p) - chunk.origin())) {
                return Err("the box does not hold a target");
            }
        }
        let mut targets: Vec<InstanceTarget> = targets.into_iter().collect();
        targets.sort_unstable();
        if targets != chunk.targets() {
            return Err("the targets are not those of the records");
        }
        if chunk.is_held() {
            return Ok(keys);
        }
        if [keys.first(), keys.last()].map(|k| k.map(|k| k.code)) != chunk.codes.map(Some) {
            return Err("the cell is not that of the records");
        }
        let mut left = &items[..];
        for block in chunk.blocks.iter() {
            let (its, rest) = left.split_at_checked(block.len as usize).ok_or("a block is too long")?;
            if !block.is_of(its, &self.lattice) {
                return Err("a block is not of its records");
            }
            left = rest;
        }
        if !left.is_empty() {
            return Err("records are in no block");
        }
        if self.job.assembly.is_split_mesh() && chunk.origin() != DVec3::ZERO {
            return Err("a cluster has a frame of its own");
        }
        Ok(keys)
    }

    fn bounds_of(&self, target: InstanceTarget) -> Option<Aabb> {
        match target {
            InstanceTarget::Mesh(m) => self.meshes.get(m as usize).map(|m| m.bounds),
            InstanceTarget::Assembly(a) => self.assemblies.get(a as usize).map(|a| a.bounds()),
        }
    }

    /// As the cutter's test, with records measured anew.
    fn is_scattered(&self, cell: &[Arc<Chunk>], records: usize) -> Result<bool, &'static str> {
        if records > SCATTERED || self.job.assembly.is_split_mesh() {
            return Ok(false);
        }
        let mut items = Vec::with_capacity(records);
        for chunk in cell {
            let members = chunk.members();
            for at in 0..chunk.len() {
                let (which, rank) = chunk.place(at).ok_or("a record has no place")?;
                let member = members.get(which).ok_or("a record has no member")?;
                let number = *self.numbers.get(&address(member)).ok_or("a member is not of this assembly")?;
                let mut item = member.run.reader(None).item(rank).ok_or("a record is not usable")?;
                self.lattice.place(&mut item, number);
                items.push(item);
            }
        }
        Ok(is_scattered(&items, &self.lattice))
    }

    /// Every cell that is a chunk may stay whole, every cell that holds several had to be cut where it was.
    fn cells(&self, chunks: &[Arc<Chunk>]) -> Result<(), &'static str> {
        let rule = self.job.rule();
        let mut open = vec![chunks];
        while let Some(cell) = open.pop() {
            let (Some(first), Some(last)) = (cell.first(), cell.last()) else { continue };
            let mut placed: FxHashMap<InstanceTarget, u64> = FxHashMap::default();
            for chunk in cell {
                let members = chunk.members();
                for at in 0..chunk.len() {
                    let target = chunk.place(at).and_then(|(which, _)| members.get(which)).map(|m| m.target);
                    *placed.entry(target.ok_or("a record has no member")?).or_default() += 1;
                }
            }
            let records: usize = cell.iter().map(|c| c.len()).sum();
            let placed: Vec<(InstanceTarget, u64)> = placed.into_iter().collect();
            let must_cut = rule.must_cut(records as u64, &placed) || self.is_scattered(cell, records)?;
            if must_cut != (cell.len() > 1) {
                return Err(if cell.len() > 1 { "a cell was cut without need" } else { "a chunk is too large" });
            }
            let differing = first.codes[0] ^ last.codes[1];
            let at = if differing == 0 {
                let mut sum = 0;
                let halves = cell.iter().position(|c| {
                    sum += c.len();
                    sum == records / 2
                });
                halves.map_or(cell.len(), |at| at + 1)
            } else {
                let bit = 1_u64 << differing.ilog2();
                let at = cell.partition_point(|c| c.codes[1] & bit == 0);
                if cell.get(at).is_some_and(|c| c.codes[0] & bit == 0) && cell.len() > 1 {
                    return Err("a chunk is astride a cut");
                }
                at
            };
            if cell.len() > 1 && (at == 0 || at == cell.len()) {
                return Err("equal codes are not cut in the middle");
            }
            if cell.len() > 1 {
                let (left, right) = cell.split_at(at);
                open.extend([left, right]);
            }
        }
        Ok(())
    }
}

fn address(member: &AssemblyMember) -> usize {
    Arc::as_ptr(&member.run) as usize
}

/// Longest chain of records below a target.
fn depth(assemblies: &[Arc<Assembly>], target: InstanceTarget) -> u32 {
    let mut depths: Vec<u32> = Vec::with_capacity(assemblies.len());
    let of = |depths: &[u32], target: InstanceTarget| match target {
        InstanceTarget::Mesh(_) => 0,
        InstanceTarget::Assembly(a) => depths.get(a as usize).copied().unwrap_or(0),
    };
    for assembly in assemblies {
        let placed = assembly.members().iter().filter(|m| m.run.len() > 0);
        depths.push(1 + placed.map(|m| of(&depths, m.target)).max().unwrap_or(0));
    }
    of(&depths, target)
}

fn corners(b: &Aabb) -> impl Iterator<Item = DVec3> {
    let b = *b;
    (0..8_usize).map(move |corner| {
        let pick = |k: usize| f64::from(if corner >> k & 1 == 0 { b.min[k] } else { b.max[k] });
        DVec3::new(pick(0), pick(1), pick(2))
    })
}

fn holds(b: &Aabb, p: DVec3) -> bool {
    (0..3).all(|k| f64::from(b.min[k]) <= p[k] && p[k] <= f64::from(b.max[k]))
}

/// Returns true if the instance is the chunk placed by `frame`.
fn is_at(instance: &ChunkInstance, frame: &DAffine3, chunk: &Chunk) -> bool {
    let rows = instance.chunk_from_world.map(|row| DVec3::from(row.map(f64::from)));
    let origin = frame.transform_point3(chunk.origin());
    let size = frame.matrix3.x_axis.abs().max(frame.matrix3.y_axis.abs()).max(frame.matrix3.z_axis.abs());
    let is_near_one =
        [frame.matrix3.x_axis, frame.matrix3.y_axis, frame.matrix3.z_axis].iter().enumerate().all(|(k, c)| {
            rows.iter().enumerate().all(|(i, row)| {
                let error = row.abs().dot(c.abs()) * 1e-6;
                (row.dot(*c) - f64::from(u8::from(i == k))).abs() <= error
            })
        });
    is_near_one && (instance.origin - origin).abs().max_element() <= 1e-9 * (origin.abs() + size).max_element()
}

/// Checks that the box contains the chunk's box as the f32 map and an origin of two floats place it.
fn check_bounds(instance: &ChunkInstance, chunk: &Chunk) -> Result<(), &'static str> {
    let rows = instance.chunk_from_world.map(|row| DVec3::from(row.map(f64::from)));
    let back = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose().inverse();
    #[expect(clippy::cast_possible_truncation, reason = "what the device gets")]
    let two_floats = |v: f64| f64::from(v as f32) + f64::from((v - f64::from(v as f32)) as f32);
    let origin = DVec3::from(instance.origin.to_array().map(two_floats));
    if corners(&chunk.bounds()).all(|p| holds(&instance.bounds, origin + back * p)) {
        Ok(())
    } else {
        Err("the box does not hold the chunk")
    }
}
