// SPDX-License-Identifier: Apache-2.0
//! When a picture that streams goes on without streaming: as soon as every chunk of the scene is on the device or where
//! rays read it in host memory. Then no ray waits any more, and passes without a word of streaming in them are faster,
//! with half the memory for a path. What no ray has asked for is brought for that while others trace, if enough paths
//! are left or were streamed; then a later picture does not stream at all. Tiles of textures need not be there: passes
//! of scenes in core say which ones they lack.

use super::residency::SceneResidency;
use crate::engine::StreamingEnd;
use crate::wavefront::PendingCompiles;

/// Nanoseconds that a path saves, without and with tiles of textures, where the device is busy (decisions/0050).
const NANOS_A_PATH: [u64; 2] = [5, 80];
/// What it saves more with so many paths in flight; with half as many, twice that. A round takes as long as its longest
/// ray, however few it traces (see the book, design/streaming).
const NANOS_IN_FLIGHT: u64 = 20;
const PATHS_IN_FLIGHT: u64 = 1 << 20;
/// Nanoseconds that are lost, without and with tiles: paths run out, and processors compile the other passes before.
const NANOS_LOST: [u64; 2] = [200_000_000, 600_000_000];
/// Bytes that are brought for a nanosecond saved: a loader brings four in one, while the processors have little else to
/// do.
const BYTES_A_NANO: u64 = 12;
/// Tiles that come without streaming need so many bytes beside geometry, for themselves or in place of others.
const ROOM_FOR_TILES: u64 = 8 << 20;

/// Whether and when to leave off.
#[derive(Clone, Debug, Default)]
pub(super) struct LeaveDecision {
    /// It may be: the memory of host and device holds the scene.
    is_possible: bool,
    /// Whatever is left, and however little room tiles have.
    is_soon: bool,
    has_tiles: bool,
    /// What a path saves that is not streamed, nanoseconds.
    nanos_a_path: u64,
    /// The other passes.
    pub(super) compiles: PendingCompiles,
    pub(super) left_off: Option<StreamingEnd>,
}

impl LeaveDecision {
    /// For a scene that can be all there, or cannot, without or with tiles of textures, and at most so many paths in
    /// flight; `is_soon`: whatever is left to trace.
    pub(super) fn new(is_possible: bool, has_tiles: bool, in_flight: u32, is_soon: bool) -> Self {
        let waited = NANOS_IN_FLIGHT * PATHS_IN_FLIGHT / u64::from(in_flight.max(1));
        let nanos_a_path = NANOS_A_PATH[usize::from(has_tiles)] + waited;
        Self { is_possible, is_soon, has_tiles, nanos_a_path, compiles: PendingCompiles::default(), left_off: None }
    }

    /// Whether to leave off now, after so many rays, with so many paths that have not begun and that were streamed; has
    /// the rest of the scene brought where that pays, and geometry go where it leaves tiles no room.
    pub(super) fn step(&self, residency: &mut SceneResidency<'_>, rays: u64, (unbegun, streamed): (u64, u64)) -> bool {
        if !self.is_possible || self.left_off.is_some() {
            return false;
        }
        if residency.is_all_there() {
            // Without streaming nothing comes to the device any more.
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

    /// Has the rest of the scene brought if that pays where so many paths were streamed or have not begun.
    pub(super) fn bring_rest(&self, residency: &mut SceneResidency<'_>, paths: u64) {
        if self.is_possible && !residency.brings_rest {
            residency.brings_rest = self.brings(residency.rest_bytes(), paths);
        }
    }

    /// Whether the other passes are there; until then paths are streamed.
    fn is_ready(&self) -> bool {
        self.is_soon || self.compiles.is_over()
    }

    /// Whether tiles, if there are any, find room in so many bytes.
    fn is_roomy(&self, bytes: u64) -> bool {
        self.is_soon || !self.has_tiles || bytes >= ROOM_FOR_TILES
    }

    /// Whether other passes pay for so many paths.
    pub(super) fn pays(&self, unbegun: u64) -> bool {
        let lost = if self.is_soon { 0 } else { NANOS_LOST[usize::from(self.has_tiles)] };
        unbegun.saturating_mul(self.nanos_a_path) > lost
    }

    /// Whether to bring `missing` bytes that no ray has asked for, where `paths` were streamed or have not begun.
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
