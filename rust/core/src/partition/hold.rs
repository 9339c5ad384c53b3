// SPDX-License-Identifier: Apache-2.0
//! Holds the chunks of a live scene while their records move.
//!
//! A chunk that is held keeps its records, their order and its frame; its box alone is measured. So nothing is sorted,
//! what is known of the order stays true, and trees over its records can be refitted. It is cut anew when anything else
//! changes, or when the boxes have grown so that rays would enter too many chunks. Only live scenes hold: chunks of
//! others are a function of the scene alone.
//!
//! Where what moves is measured late, the chunk has the bounds that it was measured with last, with those of a few of
//! its records, until somebody measures it again. What is torn apart is seen by these; that one record is far away is
//! seen a commit later.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::chunk::{Chunk, MemberReaders};
use super::chunk_members::ChunkMembers;
use super::part::{AssemblyPart, PartitionJob};
use crate::instancing::assembly::{Assembly, AssemblyMember, MovedRanks};
use crate::instancing::diff::ChangedNumbers;
use crate::instancing::item::PlacementItem;
use crate::mesh::Aabb;

/// Number of moved records from which chunks are held. Cutting fewer anew costs little.
pub const HELD_FROM: usize = 1 << 13;
/// Growth of the surface of all boxes together from which on they are cut anew.
const GROWN: f64 = 2.0;
/// The same for a single box: records are single precision relative to the middle of what their chunk was.
const APART: f64 = 64.0;
/// Records of a chunk that are measured where the others are measured late.
const SAMPLES: usize = 16;

/// The records of a member that have moved since the last partition.
enum MovedRecords {
    Nothing,
    /// One bit for each rank.
    Ranks(Vec<u64>),
    /// Items of all usable ranks.
    All(Vec<PlacementItem>),
    /// All, and nobody has looked where.
    Late,
    /// The same for these instances.
    LateNumbers(Arc<ChangedNumbers>),
}

/// The members of an assembly while its chunks are held.
struct HeldMembers<'a> {
    assembly: &'a Arc<Assembly>,
    /// Members with records in chunks, with their numbers in the assembly.
    members: Vec<(u32, &'a AssemblyMember)>,
    /// What moved of each.
    moved: Vec<MovedRecords>,
    /// Place of the member of each lasting id.
    places: FxHashMap<u32, usize>,
}

impl AssemblyPart {
    /// The chunks after records have moved and nothing else has changed; `None` if they are to be cut.
    pub(super) fn hold(&self, job: PartitionJob<'_>) -> Option<Vec<Arc<Chunk>>> {
        if !job.holds || !self.is_cut_for(job.chunk_bytes) || job.assembly.is_split_mesh() {
            return None;
        }
        let members: Vec<(u32, &AssemblyMember)> = job.inside().collect();
        let known = self.known_members();
        if known.len() != members.len() {
            return None;
        }
        let pairs = known.zip(&members).map(|((_, known), (_, member))| known.moved_ranks(member));
        let moved: Vec<MovedRanks> = pairs.collect::<Option<_>>()?;
        let counts = members.iter().zip(&moved).map(|((_, member), moved)| moved.count(member));
        let count: usize = counts.sum();
        let whole = members.iter().zip(&moved).filter(|(_, moved)| matches!(moved, MovedRanks::All));
        let whole = whole.filter(|((_, member), _)| member.run.is_measured());
        let items: usize = whole.map(|((_, member), _)| member.run.len()).sum();
        let is_held = self.chunks.iter().any(|chunk| chunk.is_held());
        if (count < HELD_FROM && !is_held) || (items * size_of::<PlacementItem>()) as u64 > job.item_bytes {
            return None;
        }
        let moved = members.iter().zip(&moved).map(|((_, member), moved)| MovedRecords::of(member, moved)).collect();
        let places = self.known_members().zip(0..).map(|((id, _), place)| (id, place)).collect();
        let held = HeldMembers { assembly: job.assembly, members, moved, places };
        let chunks = self.chunks.par_iter().with_max_len(1).map(|chunk| held.chunk(chunk));
        let chunks = chunks.collect::<Option<Vec<Arc<Chunk>>>>().filter(|chunks| are_near(chunks));
        if chunks.is_none() {
            held.give_back();
        }
        chunks
    }
}

impl MovedRanks {
    fn count(&self, member: &AssemblyMember) -> usize {
        match self {
            Self::Nothing => 0,
            Self::Ranks(ranks) => ranks.len(),
            Self::Numbers(numbers) => numbers.len().min(member.run.len()),
            Self::All => member.run.len(),
        }
    }
}

impl MovedRecords {
    fn of(member: &AssemblyMember, moved: &MovedRanks) -> Self {
        match moved {
            MovedRanks::Nothing => Self::Nothing,
            MovedRanks::Ranks(ranks) => {
                let mut bits = vec![0_u64; (member.run.ranks() as usize).div_ceil(64)];
                for &rank in ranks.iter() {
                    if let Some(word) = bits.get_mut(rank as usize / 64) {
                        *word |= 1 << (rank % 64);
                    }
                }
                Self::Ranks(bits)
            }
            MovedRanks::Numbers(numbers) => Self::LateNumbers(Arc::clone(numbers)),
            MovedRanks::All if !member.run.is_measured() => Self::Late,
            MovedRanks::All => Self::All(member.run.take_items()),
        }
    }
}

impl MovedRecords {
    fn is_late(&self) -> bool {
        matches!(self, Self::Late | Self::LateNumbers(_))
    }
}

/// Whether some record of a chunk, whose members are given with what moved of each, is somewhere where nobody looked.
fn has_late(chunk: &Chunk, members: &ChunkMembers, moved: &[&MovedRecords]) -> bool {
    let numbers: Vec<_> = members.iter().map(|member| member.run.numbers()).collect();
    let is_late = |(which, rank): (u32, u32)| match moved.get(which as usize) {
        Some(MovedRecords::Late) => true,
        Some(MovedRecords::LateNumbers(changed)) => {
            let number = numbers.get(which as usize).and_then(|numbers| numbers.of(rank).flatten());
            number.is_none_or(|number| changed.contains(number))
        }
        _ => false,
    };
    (0..chunk.len()).filter_map(|at| chunk.place(at)).any(is_late)
}

impl HeldMembers<'_> {
    /// The chunk with its records where they are now; `None` if one of them is nowhere.
    fn chunk(&self, chunk: &Arc<Chunk>) -> Option<Arc<Chunk>> {
        let places: Vec<usize> = chunk.ids.iter().map(|id| self.places.get(id).copied()).collect::<Option<_>>()?;
        let moved: Vec<&MovedRecords> = places.iter().map(|&place| self.moved.get(place)).collect::<Option<_>>()?;
        let numbers = places.iter().filter_map(|&place| Some(self.members.get(place)?.0));
        let members = ChunkMembers::new(self.assembly, numbers.collect());
        if moved.iter().all(|moved| matches!(moved, MovedRecords::Nothing)) {
            chunk.set_members(members);
            return Some(Arc::clone(chunk));
        }
        if chunk.is_late() || moved.iter().any(|moved| moved.is_late()) && has_late(chunk, &members, &moved) {
            let bounds = chunk.bounds().union(&sampled(chunk, &members));
            return Some(Arc::new(chunk.moved(members, bounds, true)));
        }
        let mut readers = MemberReaders::new(&members, None);
        let (mut around, mut spread, mut count) = ([DVec3::INFINITY, DVec3::NEG_INFINITY], 0.0_f32, 0);
        for at in 0..chunk.len() {
            let (which, rank) = chunk.place(at)?;
            let item = match *moved.get(which as usize)? {
                MovedRecords::Nothing | MovedRecords::Late | MovedRecords::LateNumbers(_) => continue,
                MovedRecords::Ranks(bits) => match bits.get(rank as usize / 64) {
                    Some(word) if word >> (rank % 64) & 1 == 1 => readers.item(which, rank)?,
                    _ => continue,
                },
                MovedRecords::All(items) => *items.get(members.get(which)?.run.usable_before(rank))?,
            };
            let (center, half) = (item.center(), DVec3::from(item.half().map(f64::from)));
            around = [around[0].min(center - half), around[1].max(center + half)];
            spread = spread.max(item.spread());
            count += 1;
        }
        if count == 0 {
            // Its records are those of before in other arrays.
            chunk.set_members(members);
            return Some(Arc::clone(chunk));
        }
        let bounds = chunk.bounds_of(around, f64::from(spread));
        // Of the records that stay, no more is known than their box together with the others.
        let bounds = if count < chunk.len() { bounds.union(&chunk.bounds()) } else { bounds };
        Some(Arc::new(chunk.moved(members, bounds, false)))
    }

    /// Leaves the items to those who cut.
    fn give_back(self) {
        for ((_, member), moved) in self.members.into_iter().zip(self.moved) {
            if let MovedRecords::All(items) = moved {
                member.run.keep_items(items);
            }
        }
    }
}

/// The box of a few records of a chunk where they are now.
fn sampled(chunk: &Chunk, members: &ChunkMembers) -> Aabb {
    let mut readers = MemberReaders::new(members, None);
    let step = chunk.len().div_ceil(SAMPLES).max(1);
    let places = (0..chunk.len()).step_by(step).filter_map(|at| chunk.place(at));
    let items = places.filter_map(|(which, rank)| readers.item(which, rank));
    let none = ([DVec3::INFINITY, DVec3::NEG_INFINITY], 0.0_f32);
    let (around, spread) = items.fold(none, |([min, max], spread), item| {
        let (center, half) = (item.center(), DVec3::from(item.half().map(f64::from)));
        ([min.min(center - half), max.max(center + half)], spread.max(item.spread()))
    });
    if around[0].x > around[1].x { Aabb::EMPTY } else { chunk.bounds_of(around, f64::from(spread)) }
}

/// Whether the records of each chunk are still near each other.
fn are_near(chunks: &[Arc<Chunk>]) -> bool {
    let area = |chunk: &Chunk| chunk.bounds().half_area();
    let held = || chunks.iter().filter_map(|chunk| Some((chunk.held?.area, area(chunk))));
    let others: f64 = chunks.iter().filter(|chunk| !chunk.is_held()).map(|chunk| area(chunk)).sum();
    let [before, now] = held().fold([others; 2], |[before, now], (was, is)| [before + was, now + is]);
    now <= GROWN * before && held().all(|(was, is)| is <= APART * was)
}
