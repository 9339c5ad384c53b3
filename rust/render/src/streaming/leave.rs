// SPDX-License-Identifier: Apache-2.0
//! Decides when a streaming picture goes on without streaming: as soon as every chunk of the scene is on the device or
//! where rays read it in host memory. Then no ray waits any more, and passes compiled without streaming are faster,
//! with half the memory for a path. Units that no ray has asked for are loaded for that while others trace, if enough
//! paths are left or were streamed; then a later picture does not stream at all. Tiles of textures need not be
//! resident: passes of scenes in core report the missing ones.

use super::residency::SceneResidency;
use crate::engine::StreamingEnd;
use crate::frame::in_core::ROOM_FOR_TILES;
use crate::wavefront::PendingCompiles;

/// Nanoseconds that a path saves, without and with tiles of textures, when the device is busy (decisions/0050).
const NANOS_A_PATH: [u64; 2] = [5, 80];
/// Additional nanoseconds that a path saves with [`PATHS_IN_FLIGHT`] paths in flight; with half as many, twice that. A
/// round takes as long as its longest ray, however few it traces (see the book, design/streaming).
const NANOS_IN_FLIGHT: u64 = 20;
const PATHS_IN_FLIGHT: u64 = 1 << 20;
/// Nanoseconds that are lost, without and with tiles: paths run out, and processors compile the other passes before.
const NANOS_LOST: [u64; 2] = [200_000_000, 600_000_000];
/// Bytes that are loaded for a nanosecond saved: a loader brings four in one, while the processors have little else to
/// do.
const BYTES_A_NANO: u64 = 12;

/// Decides whether and when streaming ends.
#[derive(Clone, Debug, Default)]
pub(super) struct LeaveDecision {
    /// True if the memory of host and device holds the scene.
    is_possible: bool,
    /// True if streaming ends whatever is left, and however little room tiles have.
    is_soon: bool,
    has_tiles: bool,
    /// Nanoseconds that a path saves if it is not streamed.
    nanos_a_path: u64,
    /// The passes without streaming, while they are compiled.
    pub(super) compiles: PendingCompiles,
    pub(super) left_off: Option<StreamingEnd>,
}

impl LeaveDecision {
    /// `is_possible`: the scene can be wholly resident; `has_tiles`: it has tiles of textures; at most so many paths
    /// are in flight; `is_soon`: streaming ends whatever is left to trace.
    pub(super) fn new(is_possible: bool, has_tiles: bool, in_flight: u32, is_soon: bool) -> Self {
        let waited = NANOS_IN_FLIGHT * PATHS_IN_FLIGHT / u64::from(in_flight.max(1));
        let nanos_a_path = NANOS_A_PATH[usize::from(has_tiles)] + waited;
        Self { is_possible, is_soon, has_tiles, nanos_a_path, compiles: PendingCompiles::default(), left_off: None }
    }

    /// Returns true if streaming is to end now, after so many rays, with so many paths that have not begun and that
    /// were streamed. Also requests the rest of the scene if that pays, and evicts geometry that leaves tiles no room.
    pub(super) fn step(&self, residency: &mut SceneResidency<'_>, rays: u64, (unbegun, streamed): (u64, u64)) -> bool {
        if !self.is_possible || self.left_off.is_some() {
            return false;
        }
        if residency.is_all_there() {
            // Without streaming nothing is promoted to the device any more.
            let is_settled = self.is_soon || residency.is_settled(rays);
            if !(self.is_ready() && is_settled && self.pays(unbegun)) {
                return false;
            }
            residency.stays = self.is_roomy(residency.room_for_tiles());
            if !residency.stays {
                residency.make_room_for_tiles(ROOM_FOR_TILES);
            }
            return residency.stays;
        }
        self.bring_rest(residency, unbegun + streamed);
        false
    }

    /// Requests the rest of the scene if that pays where so many paths were streamed or have not begun.
    pub(super) fn bring_rest(&self, residency: &mut SceneResidency<'_>, paths: u64) {
        if self.is_possible && !residency.brings_rest {
            residency.brings_rest = self.brings(residency.rest_bytes(), paths);
        }
    }

    /// Returns true if the passes without streaming are compiled.
    fn is_ready(&self) -> bool {
        self.is_soon || self.compiles.is_over()
    }

    /// Returns true if tiles, if there are any, find room in so many bytes.
    fn is_roomy(&self, bytes: u64) -> bool {
        self.is_soon || !self.has_tiles || bytes >= ROOM_FOR_TILES
    }

    /// Returns true if the passes without streaming pay for so many paths.
    pub(super) fn pays(&self, unbegun: u64) -> bool {
        let lost = if self.is_soon { 0 } else { NANOS_LOST[usize::from(self.has_tiles)] };
        unbegun.saturating_mul(self.nanos_a_path) > lost
    }

    /// Returns true if `missing` bytes that no ray has asked for are worth loading, where `paths` were streamed or have
    /// not begun.
    fn brings(&self, missing: u64, paths: u64) -> bool {
        self.is_soon || paths.saturating_mul(self.nanos_a_path) >= missing / BYTES_A_NANO
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_renders_leave_streaming() {
        for (has_tiles, fewest) in [(false, 20_000_000), (true, 7_058_823)] {
            let leave = LeaveDecision::new(true, has_tiles, 1 << 22, false);
            assert!(leave.pays(fewest + 1) && !leave.pays(fewest), "short ones do not");
            let soon = LeaveDecision::new(true, has_tiles, 1 << 22, true);
            assert!(soon.pays(1) && !soon.pays(0), "a test wants it soon");
        }
    }

    #[test]
    fn short_renders_leave_streaming_when_few_paths_are_in_flight() {
        let leave = LeaveDecision::new(true, false, 1 << 18, false);
        assert!(leave.pays(2_400_000) && !leave.pays(2_300_000));
        assert!(LeaveDecision::new(true, false, 0, false).pays(1 << 20), "none is as few as there may be");
    }

    #[test]
    fn leaving_streaming_requires_room_for_tiles() {
        let leave = LeaveDecision::new(true, true, 1 << 20, false);
        assert!(leave.is_roomy(ROOM_FOR_TILES) && !leave.is_roomy(ROOM_FOR_TILES - 1));
        assert!(LeaveDecision::new(true, false, 1 << 20, false).is_roomy(0), "there are none");
    }

    #[test]
    fn more_remaining_paths_justify_a_larger_upload() {
        let leave = LeaveDecision::new(true, false, 1 << 22, false);
        assert!(leave.brings(3 << 30, 28_000_000), "64 samples");
        assert!(!leave.brings(30 << 30, 56_000_000) && leave.brings(30 << 30, 450_000_000), "1024 samples");
        assert!(leave.brings(0, 0), "nothing is missing");
        let few = LeaveDecision::new(true, false, 1 << 16, false);
        assert!(few.brings(30 << 30, 28_000_000), "few in flight save more");
        assert!(
            LeaveDecision::new(true, true, 1 << 22, false).brings(30 << 30, 56_000_000),
            "with tiles a path saves more"
        );
    }
}
