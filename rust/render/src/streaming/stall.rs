// SPDX-License-Identifier: Apache-2.0
//! Decides whether a picture makes progress, in counted work: loads that were made and paths that have ended. Seconds
//! would not tell, since disks and devices may be slow. Pure.

/// Loads without a path that ends, whatever the scene has: a million.
const MAX_LOADS: u64 = 1 << 20;
/// Additional loads for each unit of the scene.
const LOADS_A_UNIT: u64 = 64;

/// Counts the loads since a path ended last.
#[derive(Clone, Copy, Debug)]
pub(super) struct StallDetector {
    most_loads: u64,
    ended: u64,
    /// Loads when a path ended last.
    loads: u64,
}

impl StallDetector {
    /// A detector for a scene of so many units.
    pub(super) fn new(units: usize) -> Self {
        Self { most_loads: MAX_LOADS + LOADS_A_UNIT * units as u64, ended: 0, loads: 0 }
    }

    /// Takes in the paths that have ended and the loads so far; returns the loads since a path ended last, if these are
    /// far too many.
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
        let most = MAX_LOADS + 6400;
        assert_eq!(stall.note(0, most), None, "some scenes take so many");
        assert_eq!(stall.note(1, most + 1), None, "a path has ended");
        assert_eq!(stall.note(1, 2 * most + 1), None, "counted from there");
        assert_eq!(stall.note(1, 2 * most + 2), Some(most + 1), "too many");
        assert_eq!(stall.note(0, 2 * most + 3), None, "another stage begins to count");
    }
}
