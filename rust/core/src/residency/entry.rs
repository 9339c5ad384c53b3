// SPDX-License-Identifier: Apache-2.0
//! What the planner remembers of each unit. Steps are counted modulo 2^32; only differences are used.

/// Where a unit is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum UnitState {
    /// Not on the device, nobody waits for it.
    #[default]
    Absent,
    /// Not on the device; the last step saw rays that wait for it.
    Requested,
    /// A load command is out.
    Loading,
    /// Usable.
    Resident,
}

#[derive(Clone, Debug, Default)]
pub(super) struct UnitEntry {
    pub(super) state: UnitState,
    /// Loads that completed.
    pub(super) loads: u32,
    /// Step since which rays wait without a gap, and the loads begun before it.
    pub(super) since: u32,
    pub(super) since_loads: u32,
    /// The last step that saw waiting rays.
    pub(super) seen: u32,
    /// The last step in which it was of use: waited for, visited or loaded.
    pub(super) used: u32,
    /// The step after which it became usable.
    pub(super) usable: u32,
    /// No load before this step (after a failure); 0 = any time.
    pub(super) retry: u32,
    /// Rays that needed it lately; halves every `HALF_LIFE_STEPS`, as of step `used`.
    pub(super) heat: f32,
    /// Pairs that it is kept for.
    pub(super) holds: u32,
    /// Place in the list of resident units.
    pub(super) slot: u32,
    /// It was resident at least once.
    pub(super) touched: bool,
}

/// Steps after which old demand counts half.
pub(super) const HALF_LIFE_STEPS: u32 = 16;

/// `2^(-i / HALF_LIFE_STEPS)`; a table, so that no platform's `exp2` takes part in a decision.
const FRACTIONS: [f32; HALF_LIFE_STEPS as usize] = [
    1.0,
    0.957_603_3,
    0.917_004,
    0.878_126,
    0.840_896_4,
    0.805_245_2,
    0.771_105_4,
    0.738_413,
    std::f32::consts::FRAC_1_SQRT_2,
    0.677_127_8,
    0.648_419_8,
    0.620_928_9,
    0.594_603_5,
    0.569_394_3,
    0.545_253_9,
    0.522_136_9,
];

impl UnitEntry {
    /// Heat as of `step`.
    pub(super) fn heat_at(&self, step: u32) -> f32 {
        let age = step.wrapping_sub(self.used);
        let whole = age / HALF_LIFE_STEPS;
        if whole > 100 {
            return 0.0;
        }
        self.heat * FRACTIONS[(age % HALF_LIFE_STEPS) as usize] * f32::from_bits((127 - whole) << 23)
    }

    /// A load failed a short time ago.
    pub(super) fn pauses(&self, step: u32) -> bool {
        self.retry != 0 && self.retry.wrapping_sub(step).cast_signed() > 0
    }

    /// `rays` visited it in `step`.
    pub(super) fn visited(&mut self, step: u32, rays: u32) {
        self.heat = self.heat_at(step) + rays_f32(rays);
        self.used = step;
    }

    /// `rays` wait for it in `step`; the same rays as a step before, hence no sum.
    pub(super) fn waited_for(&mut self, step: u32, rays: u32) {
        self.heat = self.heat_at(step).max(rays_f32(rays));
        self.used = step;
    }
}

#[expect(clippy::cast_precision_loss, reason = "an estimate")]
fn rays_f32(rays: u32) -> f32 {
    rays as f32
}
