// SPDX-License-Identifier: Apache-2.0
//! The Morton lattice of an assembly, along which its items are sorted.
//!
//! The lattice is canonical: a function of the assembly's box only, which changes only when that box's longest side
//! passes a power of two or its lower corner a multiple of it. The quantum is a power of two, the lattice passes
//! through the frame's 0, so moving a member never moves the cells of the others. 21 bits per axis (G. M. Morton, "A
//! computer oriented geodetic data base", 1966), and one bit on top for members too large to share cells with the rest.

use glam::DVec3;

use super::peaks::RecordPeaks;
use crate::instancing::affine::nearest;
use crate::instancing::item::PlacementItem;
use crate::mesh::Aabb;

/// Number of bits per axis.
const BITS: u32 = 21;
/// Largest number of lattice steps of the box's longest side; the code has room for twice as many, wherever it begins.
const STEPS: f64 = 1_048_576.0;
/// Members with a half side above this many quanta are kept apart: between 1/32 and 1/16 of the longest side.
const LARGE: f64 = 32_768.0;
/// Slack of a lattice cell in quanta, for the rounding of positions far from 0.
const CELL_SLACK: f64 = 1.0 / 256.0;

/// Rounding of [`MortonLattice::peaks`]: at most two additions in single precision.
const NUMBER_ERROR: f64 = 1.0 / 2_097_152.0;

/// A power-of-two lattice with an aligned lower corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MortonLattice {
    base: DVec3,
    quantum: f64,
    /// Exact value of 1 / `quantum`.
    steps: f64,
}

impl MortonLattice {
    /// The lattice of an assembly whose members (those in chunks) fill `bounds`.
    pub(crate) fn around(bounds: &Aabb) -> Self {
        if bounds.is_empty() {
            return Self { base: DVec3::ZERO, quantum: 1.0, steps: 1.0 };
        }
        let min = DVec3::from(bounds.min.map(f64::from));
        let side = (DVec3::from(bounds.max.map(f64::from)) - min).max_element();
        // Coincident points may have no extent at all: any quantum is valid then, down to the smallest difference of
        // floats.
        let quantum = power_of_two(side.max(f64::from(f32::MIN_POSITIVE))) / STEPS;
        let step = quantum * STEPS;
        Self { base: (min / step).floor() * step, quantum, steps: 1.0 / quantum }
    }

    /// Puts an item on the lattice as placement of `member`.
    #[inline]
    pub(crate) fn place(&self, item: &mut PlacementItem, member: u32) {
        let at = (item.center() - self.base) * self.steps;
        let [x, y, z] = at.to_array().map(lattice_step);
        let large = f64::from(item.largest_half()) > LARGE * self.quantum;
        let code = u64::from(large) << 63 | spread_bits(x) | spread_bits(y) << 1 | spread_bits(z) << 2;
        item.set_place(code, member);
    }

    /// The extreme values of a placed item's box, relative to the lattice's corner, without the rounding of its map in
    /// the chunk and of the numbers themselves; see [`MortonLattice::box_of`].
    #[inline]
    #[expect(clippy::cast_precision_loss, reason = "21 bits, and a power of two")]
    pub(crate) fn peaks(&self, item: &PlacementItem) -> RecordPeaks {
        let quantum = nearest(self.quantum);
        let code = item.code();
        let [x, y, z] = [code, code >> 1, code >> 2].map(|v| gather_bits(v & (u64::MAX >> 1)));
        let corner = [x, y, z].map(|v| v as f32 * quantum);
        let half = item.half();
        let low: [f32; 3] = std::array::from_fn(|k| half[k] - corner[k]);
        let high: [f32; 3] = std::array::from_fn(|k| corner[k] + quantum + half[k]);
        RecordPeaks([low[0], low[1], low[2], high[0], high[1], high[2], item.spread(), 0.0])
    }

    /// The box of the peaks in the assembly's frame, and the largest spread.
    pub(crate) fn box_of(&self, peaks: RecordPeaks) -> ([DVec3; 2], f64) {
        let [a, b, c, d, e, f, spread, _] = peaks.0.map(f64::from);
        let (low, high) = (-DVec3::new(a, b, c), DVec3::new(d, e, f));
        let slack = |v: DVec3| v.abs() * NUMBER_ERROR + CELL_SLACK * self.quantum;
        ([self.base + (low - slack(low)), self.base + (high + slack(high))], spread)
    }
}

/// The smallest power of two that is not below a normal positive number.
fn power_of_two(v: f64) -> f64 {
    const MANTISSA: u64 = (1 << 52) - 1;
    let bits = v.to_bits();
    let floor = f64::from_bits(bits & !MANTISSA);
    if bits & MANTISSA == 0 { floor } else { 2.0 * floor }
}

/// Number of whole steps in `v`, which is not negative except for rounding.
#[inline]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 21 bits")]
fn lattice_step(v: f64) -> u64 {
    // Conversion to 32 bits first takes a fraction of the instructions.
    u64::from(v.clamp(0.0, f64::from((1_u32 << BITS) - 1)) as u32)
}

/// Spreads 21 bits to every third bit.
#[inline]
fn spread_bits(v: u64) -> u64 {
    let v = (v | v << 32) & 0x001f_0000_0000_ffff;
    let v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    let v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    let v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// The inverse of [`spread_bits`]; other bits are ignored.
#[inline]
fn gather_bits(v: u64) -> u32 {
    let v = v & 0x1249_2492_4924_9249;
    let v = (v | v >> 2) & 0x10c3_0c30_c30c_30c3;
    let v = (v | v >> 4) & 0x100f_00f0_0f00_f00f;
    let v = (v | v >> 8) & 0x001f_0000_ff00_00ff;
    let v = (v | v >> 16) & 0x001f_0000_0000_ffff;
    ((v | v >> 32) & 0x001f_ffff) as u32
}
