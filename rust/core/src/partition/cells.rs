// SPDX-License-Identifier: Apache-2.0
//! Cuts the sorted members of an assembly into cells.
//!
//! A cell is a Morton prefix; one that the rule forbids is cut at the highest bit in which its members differ, so that
//! cells hold no empty halves and a chunk's cell follows from its members alone. A small cell is cut too where one half
//! would be far smaller than the frame that it had to share ([`is_scattered`]). Members of equal codes are cut in the
//! middle of their order. The result is a function of the members and the rule, whatever chunks are kept from before.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::blocks::RecordBlock;
use super::chunk::{AssemblyMembers, Chunk, MemberReaders, SCATTERED};
use super::cost::CutRule;
use super::lattice::MortonLattice;
use super::peaks::RecordPeaks;
use crate::instancing::assembly::InstanceTarget;
use crate::instancing::item::PlacementItem;

/// A cell is cut if one of its halves is smaller than its box by more than this factor: in a chunk's frame of single
/// precision the half would have 6 bits fewer than in its own.
const APART: f64 = 64.0;
/// Cells with more members are cut in parallel.
const PARALLEL: u64 = 1 << 15;

/// A part of an assembly's order. The parts of one list are consecutive.
#[derive(Clone, Copy, Debug)]
pub(crate) enum OrderPiece<'a> {
    /// A chunk from an earlier partition, whole and unchanged.
    Kept(&'a Arc<Chunk>),
    /// Sorted items, at least one.
    Loose(&'a [PlacementItem]),
}

/// The data of the assembly that cutting needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ChunkCutter<'a> {
    pub(crate) rule: &'a CutRule,
    pub(crate) roster: AssemblyMembers<'a>,
    pub(crate) lattice: &'a MortonLattice,
    /// Number of the member of each lasting id.
    pub(crate) member_of: &'a FxHashMap<u32, u32>,
    /// Whether the chunks from before were cut by the same rule, and no cell has lost one.
    pub(crate) is_known: bool,
}

impl OrderPiece<'_> {
    /// The chunk, if it is as it was in the last partition.
    fn known(&self) -> Option<Arc<Chunk>> {
        match self {
            Self::Kept(chunk) => (chunk.key != 0).then(|| Arc::clone(chunk)),
            Self::Loose(_) => None,
        }
    }

    fn len(&self) -> u64 {
        match self {
            Self::Kept(chunk) => chunk.len() as u64,
            Self::Loose(items) => items.len() as u64,
        }
    }

    fn codes(&self) -> [u64; 2] {
        match self {
            Self::Kept(chunk) => chunk.codes,
            Self::Loose(items) => [items.first(), items.last()].map(|item| item.map_or(0, PlacementItem::code)),
        }
    }
}

impl ChunkCutter<'_> {
    /// Chunks of all pieces, in order. Those made here have key 0.
    pub(crate) fn cut(&self, pieces: &[OrderPiece<'_>]) -> Vec<Arc<Chunk>> {
        if self.is_known
            && let Some(chunks) = pieces.iter().map(OrderPiece::known).collect()
        {
            return chunks;
        }
        let records: u64 = pieces.iter().map(OrderPiece::len).sum();
        if records == 0 {
            return Vec::new();
        }
        let is_small = !self.rule.is_too_long(records) && !self.rule.must_cut(records, &self.targets(pieces));
        if is_small && !self.is_scattered(pieces) {
            return vec![self.leaf(pieces)];
        }
        let ends = [pieces.first(), pieces.last()].map(|piece| piece.map_or([0; 2], OrderPiece::codes));
        let differing = ends[0][0] ^ ends[1][1];
        if differing == 0 {
            let melted;
            let items = match pieces {
                [OrderPiece::Loose(items)] => *items,
                _ => {
                    melted = self.items(pieces);
                    &melted
                }
            };
            let (left, right) = items.split_at(items.len() / 2);
            return self.both(&[OrderPiece::Loose(left)], &[OrderPiece::Loose(right)], records);
        }
        let bit = 1_u64 << differing.ilog2();
        let at = pieces.partition_point(|piece| piece.codes()[1] & bit == 0);
        let (mut left, mut right) = (pieces[..at].to_vec(), pieces[at..].to_vec());
        let astride = right.first().copied().filter(|piece| piece.codes()[0] & bit == 0);
        let melted;
        if let Some(piece) = astride {
            let items = match piece {
                OrderPiece::Loose(items) => items,
                OrderPiece::Kept(_) => {
                    melted = self.items(&[piece]);
                    &melted
                }
            };
            let (before, after) = items.split_at(items.partition_point(|item| item.code() & bit == 0));
            left.push(OrderPiece::Loose(before));
            right[0] = OrderPiece::Loose(after);
        }
        self.both(&left, &right, records)
    }

    /// Returns true if [`is_scattered`] says so of the cell. A chunk from before that is the cell was found not to be.
    fn is_scattered(&self, pieces: &[OrderPiece<'_>]) -> bool {
        let records: u64 = pieces.iter().map(OrderPiece::len).sum();
        let is_known = matches!(pieces, [OrderPiece::Kept(_)]) || self.roster.keeps_frame;
        !is_known && records <= SCATTERED as u64 && is_scattered(&self.items(pieces), self.lattice)
    }

    fn both(&self, left: &[OrderPiece<'_>], right: &[OrderPiece<'_>], records: u64) -> Vec<Arc<Chunk>> {
        let (mut left, right) = if records > PARALLEL {
            rayon::join(|| self.cut(left), || self.cut(right))
        } else {
            (self.cut(left), self.cut(right))
        };
        left.extend(right);
        left
    }

    /// The targets of the pieces, with the number of placements of each.
    fn targets(&self, pieces: &[OrderPiece<'_>]) -> Vec<(InstanceTarget, u64)> {
        let mut placed: FxHashMap<u32, u64> = FxHashMap::default();
        for piece in pieces {
            match piece {
                OrderPiece::Kept(chunk) => {
                    for (id, &n) in chunk.ids.iter().zip(chunk.counts.iter()) {
                        let member = self.member_of.get(id).copied().unwrap_or(u32::MAX);
                        *placed.entry(member).or_default() += u64::from(n);
                    }
                }
                OrderPiece::Loose(items) => {
                    for stretch in items.chunk_by(|a, b| a.member() == b.member()) {
                        let member = stretch.first().map_or(u32::MAX, PlacementItem::member);
                        *placed.entry(member).or_default() += stretch.len() as u64;
                    }
                }
            }
        }
        let target = |member: u32| self.roster.assembly.members().get(member as usize).map(|m| m.target);
        let mut targets: Vec<(InstanceTarget, u64)> =
            placed.into_iter().filter_map(|(member, n)| Some((target(member)?, n))).collect();
        targets.sort_unstable();
        targets.dedup_by(|next, first| {
            let same = next.0 == first.0;
            first.1 += if same { next.1 } else { 0 };
            same
        });
        targets
    }

    fn leaf(&self, pieces: &[OrderPiece<'_>]) -> Arc<Chunk> {
        if let [OrderPiece::Kept(chunk)] = pieces {
            return Arc::clone(chunk);
        }
        let melted: Vec<Vec<PlacementItem>> = pieces
            .iter()
            .map(|piece| match piece {
                OrderPiece::Kept(_) => self.items(&[*piece]),
                OrderPiece::Loose(_) => Vec::new(),
            })
            .collect();
        let items: Vec<&[PlacementItem]> = pieces
            .iter()
            .zip(&melted)
            .map(|(piece, melted)| match piece {
                OrderPiece::Kept(_) => &melted[..],
                OrderPiece::Loose(items) => items,
            })
            .collect();
        Arc::new(Chunk::new(&items, self.roster, self.lattice))
    }

    /// The items of all pieces.
    fn items(&self, pieces: &[OrderPiece<'_>]) -> Vec<PlacementItem> {
        let mut out = Vec::new();
        for piece in pieces {
            match piece {
                OrderPiece::Kept(chunk) => out.extend(self.melt(chunk)),
                OrderPiece::Loose(items) => out.extend_from_slice(items),
            }
        }
        out
    }

    /// The items of an earlier chunk, measured again from its own arrays. Records of removed members are left out.
    pub(crate) fn melt(&self, chunk: &Chunk) -> Vec<PlacementItem> {
        let members = chunk.members();
        let numbers: Vec<Option<u32>> = chunk.ids.iter().map(|id| self.member_of.get(id).copied()).collect();
        if numbers.iter().all(Option::is_none) {
            return Vec::new();
        }
        let mut out = Vec::with_capacity(chunk.len());
        let mut readers = MemberReaders::new(&members, None);
        chunk.each(0..chunk.len(), &mut readers, |at, _, rank, reader| {
            let number = chunk.place(at).and_then(|(which, _)| *numbers.get(which as usize)?);
            if let Some((number, mut item)) = number.and_then(|n| Some((n, reader.item(rank)?))) {
                self.lattice.place(&mut item, number);
                out.push(item);
            }
        });
        out
    }
}

/// Returns true if sorted items, where they would be cut, fall into parts of which one is far smaller than all of them
/// together: in one chunk, with a frame of single precision about the middle of all, the points of that part could not
/// be distinguished. Never true for items of equal codes, nor for more than [`SCATTERED`].
pub(crate) fn is_scattered(items: &[PlacementItem], lattice: &MortonLattice) -> bool {
    let (Some(first), Some(last)) = (items.first(), items.last()) else { return false };
    let differing = first.code() ^ last.code();
    if differing == 0 || items.len() > SCATTERED {
        return false;
    }
    let bit = 1_u64 << differing.ilog2();
    let (left, right) = items.split_at(items.partition_point(|item| item.code() & bit == 0));
    let side = |items: &[PlacementItem]| {
        let peaks = RecordBlock::of(items.iter(), lattice)
            .iter()
            .fold(RecordPeaks::NONE, |peaks, block| peaks.max(block.peaks()));
        let ([min, max], _) = lattice.box_of(peaks);
        (max - min).max_element()
    };
    side(left).min(side(right)) * APART < side(items)
}
