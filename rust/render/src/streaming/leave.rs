// SPDX-License-Identifier: Apache-2.0
//! When a picture that streams goes on without streaming: as soon as every chunk of the scene is on the device or where
//! rays read it in host memory. Then no ray waits any more, and passes without a word of streaming in them are faster,
//! with half the memory for a path. What no ray has asked for is brought for that while others trace, if enough paths
//! are left or were streamed; then a later picture does not stream at all. Tiles of textures need not be there: passes
//! of scenes in core say which ones they lack.

use super::residency::Residency;
use crate::engine::LeftOff;

/// Fewest paths that are left to trace, without and with tiles of textures: compiling other passes takes a while, and
/// so does letting paths run out.
const FEWEST_PATHS: [u64; 2] = [1 << 27, 1 << 23];
/// So many bytes are brought for a path that is streamed or left to trace, without and with tiles. It saves some five
/// nanoseconds, with tiles eighty (decisions/0050), and a loader brings four bytes in one, while the processors have
/// little else to do.
const BYTES_A_PATH: [u64; 2] = [60, 960];
/// Paths that run out may wait for tiles: so many bytes are to be free for these or to hold others, which may go.
const ROOM_FOR_TILES: u64 = 8 << 20;

/// Whether and when to leave off.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Leave {
    /// It may be: the memory of host and device holds the scene.
    is_possible: bool,
    /// Whatever is left, and however little room tiles have.
    is_soon: bool,
    has_tiles: bool,
    pub(super) left_off: Option<LeftOff>,
}

impl Leave {
    /// For a scene that can be all there, or cannot, without or with tiles of textures; `is_soon`: whatever is left to
    /// trace.
    pub(super) fn new(is_possible: bool, has_tiles: bool, is_soon: bool) -> Self {
        Self { is_possible, is_soon, has_tiles, left_off: None }
    }

    /// Whether to leave off now, with so many paths that have not begun and that were streamed; has the rest of the
    /// scene brought where that pays.
    pub(super) fn step(&self, residency: &mut Residency<'_>, (unbegun, streamed): (u64, u64)) -> bool {
        if !self.is_possible || self.left_off.is_some() {
            return false;
        }
        if residency.is_all_there() {
            residency.stays = self.is_roomy(residency.room_for_tiles()) && self.pays(unbegun);
            return residency.stays;
        }
        if !residency.brings_rest {
            residency.brings_rest = self.brings(residency.rest_bytes(), unbegun + streamed);
        }
        false
    }

    /// Whether tiles, if there are any, find room in so many bytes.
    fn is_roomy(&self, bytes: u64) -> bool {
        self.is_soon || !self.has_tiles || bytes >= ROOM_FOR_TILES
    }

    /// Whether other passes pay for so many paths.
    fn pays(&self, unbegun: u64) -> bool {
        unbegun > if self.is_soon { 0 } else { FEWEST_PATHS[usize::from(self.has_tiles)] }
    }

    /// Whether to bring `missing` bytes that no ray has asked for, where `paths` were streamed or have not begun.
    fn brings(&self, missing: u64, paths: u64) -> bool {
        self.is_soon || paths >= missing / BYTES_A_PATH[usize::from(self.has_tiles)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_pictures_go_on_without_streaming() {
        for has_tiles in [false, true] {
            let (leave, fewest) = (Leave::new(true, has_tiles, false), FEWEST_PATHS[usize::from(has_tiles)]);
            assert!(leave.pays(fewest + 1) && !leave.pays(fewest), "short ones do not");
            let soon = Leave::new(true, has_tiles, true);
            assert!(soon.pays(1) && !soon.pays(0), "a test wants it soon");
        }
    }

    #[test]
    fn tiles_have_room() {
        let leave = Leave::new(true, true, false);
        assert!(leave.is_roomy(ROOM_FOR_TILES) && !leave.is_roomy(ROOM_FOR_TILES - 1));
        assert!(Leave::new(true, false, false).is_roomy(0), "there are none");
    }

    #[test]
    fn more_is_brought_for_more_paths() {
        let leave = Leave::new(true, false, false);
        assert!(leave.brings(3 << 30, 450_000_000), "1024 samples");
        assert!(!leave.brings(3 << 30, 28_000_000) && leave.brings(3 << 30, 56_000_000), "64 samples, and again");
        assert!(leave.brings(0, 0), "nothing is missing");
        assert!(Leave::new(true, true, false).brings(3 << 30, 28_000_000), "with tiles a path saves more");
    }
}
