// SPDX-License-Identifier: Apache-2.0
//! The items that the partition sorts: a placement as its box and a number. An item has 24 bytes, because a scene may
//! have 10^8.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::affine::{MATRIX_ERROR, nearest};
use super::placement::InstanceFootprint;

/// A coordinate far beyond any position, and finite in single precision.
const HUGE: f64 = 1e30;
/// Relative error of rounding a position to single precision.
const POSITION_ERROR: f64 = 1.0 / 8_388_608.0;

/// Position of a member in the order of an assembly: Morton code, then member, then rank.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct ItemKey {
    pub(crate) code: u64,
    /// Number of the member in its assembly (high half), rank of the instance (low half).
    pub(crate) id: u64,
}

/// One placement on its way into a chunk.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct PlacementItem {
    /// Morton code; before the item is on a lattice: x and y of the centre.
    code: u64,
    /// Member and rank; before the item is on a lattice: z of the centre and the rank.
    id: u64,
    /// Half sides, including the rounding of the target's own offset; upper halves of f32s, rounded up.
    half: [u16; 3],
    /// [`InstanceFootprint::spread`], as its upper 16 bits.
    spread: u16,
}

impl PlacementItem {
    /// An item that is not on a lattice yet.
    #[inline]
    pub(crate) fn new(footprint: &InstanceFootprint, rank: u32) -> Self {
        let [x, y, z] = footprint.center.to_array().map(|v| u64::from(nearest(v).to_bits()));
        let own = footprint.spread * footprint.lever * MATRIX_ERROR;
        let half = footprint.half + own + footprint.center.abs() * POSITION_ERROR;
        let half = half.to_array().map(short_up);
        Self { code: y << 32 | x, id: u64::from(rank) << 32 | z, half, spread: short_up(footprint.spread) }
    }

    /// Position in the order.
    #[inline]
    pub(crate) fn key(&self) -> ItemKey {
        ItemKey { code: self.code, id: self.id }
    }

    /// The Morton code.
    #[inline]
    pub(crate) fn code(&self) -> u64 {
        self.code
    }

    /// Number of the member in its assembly.
    #[inline]
    pub(crate) fn member(&self) -> u32 {
        (self.id >> 32) as u32
    }

    /// Rank of the instance.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "the low half is what is wanted")]
    pub(crate) fn rank(&self) -> u32 {
        self.id as u32
    }

    /// Half sides of its box.
    #[inline]
    pub(crate) fn half(&self) -> [f32; 3] {
        self.half.map(float)
    }

    /// The largest half side.
    #[inline]
    pub(crate) fn largest_half(&self) -> f32 {
        // The order of numbers that are not negative is that of their bits.
        let [x, y, z] = self.half;
        float(x.max(y).max(z))
    }

    /// [`InstanceFootprint::spread`], rounded up.
    #[inline]
    pub(crate) fn spread(&self) -> f32 {
        float(self.spread)
    }

    /// Sets its position on the lattice of its assembly, as placement of `member`. The centre is lost.
    #[inline]
    pub(crate) fn set_place(&mut self, code: u64, member: u32) {
        let rank = self.id >> 32;
        self.code = code;
        self.id = u64::from(member) << 32 | rank;
    }

    /// The centre, of an item that is not on a lattice yet.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "two halves of 64 bits each")]
    pub(crate) fn center(&self) -> DVec3 {
        let read = |bits: u64| f64::from(f32::from_bits(bits as u32));
        DVec3::new(read(self.code), read(self.code >> 32), read(self.id))
    }
}

/// The upper half of an f32 that is not below `v` (not negative; values above [`HUGE`] count as that).
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "16 of 32 bits are left")]
fn short_up(v: f64) -> u16 {
    // One step of the upper half covers both roundings.
    let bits = nearest(v.min(HUGE)).to_bits();
    if bits == 0 && v == 0.0 { 0 } else { ((bits >> 16) + 1) as u16 }
}

#[inline]
fn float(v: u16) -> f32 {
    f32::from_bits(u32::from(v) << 16)
}
