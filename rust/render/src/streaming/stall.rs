// SPDX-License-Identifier: Apache-2.0
//! Whether a picture gets on, in counted work: loads that were made and paths that have ended. Seconds say nothing of
//! it, since disks and devices may be slow. Pure.

/// Loads without a path that ends, whatever the scene has: a million.
const MOST_LOADS: u64 = 1 << 20;
/// Beside these, for each unit of the scene.
const LOADS_A_UNIT: u64 = 64;

/// See the module.
#[derive(Clone, Copy, Debug)]
pub(super) struct StallDetector {
    most_loads: u64,
    ended: u64,
    /// Loads when a path ended last.
    loads: u64,
}

impl StallDetector {
    /// For a scene of so many units.
    pub(super) fn new(units: usize) -> Self {
        Self { most_loads: MOST_LOADS + LOADS_A_UNIT * units as u64, ended: 0, loads: 0 }
    }

    /// Takes note of the paths that have ended and of the loads so far; the loads that have brought no path to its end,
    /// where these are far too many.
    pub(super) fn note(&mut self, ended: u64, loads: u64) -> Option<u64> {
        if ended != self.ended {
            (self.ended, self.loads) = (ended, loads);
        }
        let in_vain = loads.saturating_sub(self.loads);
        (in_vain > self.most_loads).then_some(in_vain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_stalls_by_loads_that_end_no_path() {
        let mut stall = StallDetector::new(100);
        let most = MOST_LOADS + 6400;
        assert_eq!(stall.note(0, most), None, "some scenes take so many");
        assert_eq!(stall.note(1, most + 1), None, "a path has ended");
        assert_eq!(stall.note(1, 2 * most + 1), None, "counted from there");
        assert_eq!(stall.note(1, 2 * most + 2), Some(most + 1), "too many");
        assert_eq!(stall.note(0, 2 * most + 3), None, "another stage begins to count");
    }
}
