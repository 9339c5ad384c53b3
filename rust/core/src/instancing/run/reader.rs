// SPDX-License-Identifier: Apache-2.0
//! Reads single placements of a run by rank. Borrows the run; any thread.

use glam::DAffine3;

use crate::array::ArrayView;
use crate::instancing::item::PlacementItem;
use crate::instancing::motion::PlacementKeys;
use crate::instancing::placement::{InstanceFootprint, InstancePlacer, PlacedInstance};

/// Instance numbers by rank.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InstanceNumbers<'a> {
    pub(super) unmasked: Option<&'a [u32]>,
    /// Instance numbers by rank; `None`: placed once, without a number.
    pub(super) indices: Option<ArrayView<'a>>,
    pub(super) limit: usize,
}

impl InstanceNumbers<'_> {
    /// Number of a rank; `None` if it is out of range.
    #[inline]
    pub(crate) fn of(&self, rank: u32) -> Option<Option<usize>> {
        let Some(indices) = &self.indices else {
            return Some(None);
        };
        number(self.unmasked, indices, rank as usize).filter(|&n| n < self.limit).map(Some)
    }
}

/// Reads single placements of a run.
#[derive(Clone, Debug)]
pub(crate) struct RunReader<'a> {
    pub(super) numbers: InstanceNumbers<'a>,
    pub(super) placer: InstancePlacer<'a>,
    pub(super) bad: &'a [u32],
    pub(super) ranks: u32,
}

impl RunReader<'_> {
    fn is_usable(&self, rank: u32) -> bool {
        rank < self.ranks && (self.bad.is_empty() || self.bad.binary_search(&rank).is_err())
    }

    /// As [`InstancePlacer::touch`].
    #[inline]
    pub(crate) fn touch(&self, rank: u32) -> u8 {
        self.numbers.of(rank).flatten().map_or(0, |number| self.placer.touch(number))
    }

    /// The item of a placement for the partition; `None` if it is not usable.
    #[inline]
    pub(crate) fn item(&self, rank: u32) -> Option<PlacementItem> {
        let number = self.numbers.of(rank).filter(|_| self.is_usable(rank))?;
        self.placer.measure(number).map(|(_, footprint)| PlacementItem::new(&footprint, rank))
    }

    /// As [`RunReader::item`], for a rank known to be usable.
    #[inline]
    pub(crate) fn usable_item(&self, rank: u32) -> Option<PlacementItem> {
        let number = self.numbers.of(rank)?;
        self.placer.footprint(number).map(|footprint| PlacementItem::new(&footprint, rank))
    }

    /// Exact centre and size of a placement.
    pub(crate) fn footprint(&self, rank: u32) -> Option<InstanceFootprint> {
        let number = self.numbers.of(rank).filter(|_| self.is_usable(rank))?;
        self.placer.measure(number).map(|(_, footprint)| footprint)
    }

    /// As [`RunReader::item`], for the first usable rank.
    pub(crate) fn first_item(&self) -> Option<PlacementItem> {
        // The first rank that is not a bad one.
        let first = (0_u32..).zip(self.bad).take_while(|(rank, bad)| rank == *bad).count();
        self.item(u32::try_from(first).ok()?)
    }

    /// The placement of a usable rank.
    #[inline]
    pub(crate) fn place(&self, rank: u32) -> Option<PlacedInstance> {
        self.numbers.of(rank).and_then(|number| self.placer.place(number))
    }

    /// The keys of a usable rank of a moving run.
    pub(crate) fn keys(&self, rank: u32) -> Option<PlacementKeys> {
        let number = self.numbers.of(rank)?;
        self.placer.keys(number).map(|(keys, _)| keys)
    }

    /// Matrix of a usable rank from the target's frame, f64.
    pub(crate) fn matrix(&self, rank: u32) -> Option<DAffine3> {
        self.numbers.of(rank).and_then(|number| self.placer.matrix(number))
    }

    /// All usable placements as f64 matrices from the target's frame, with their ranks.
    pub(crate) fn matrices(&self) -> impl Iterator<Item = (u32, DAffine3)> {
        (0..self.ranks).filter(|&rank| self.is_usable(rank)).filter_map(|rank| {
            let number = self.numbers.of(rank)?;
            Some((rank, self.placer.matrix(number)?))
        })
    }
}

/// Instance number of a rank; `None` if it is negative.
#[inline]
pub(super) fn number(unmasked: Option<&[u32]>, indices: &ArrayView<'_>, rank: usize) -> Option<usize> {
    match unmasked {
        Some(numbers) => numbers.get(rank).map(|&n| n as usize).filter(|&n| i32::try_from(n).is_ok()),
        None => indices.index(rank).and_then(|n| usize::try_from(n).ok()),
    }
}
