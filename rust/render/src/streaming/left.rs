// SPDX-License-Identifier: Apache-2.0
//! The number of unfinished paths over time: the table "time against paths left" of L. Berchtold's thesis (2022). Pure.

use crate::job::timings::LeftMoment;

/// The next entry is due at [`STEP`] times the time of the last one plus this, seconds.
const FIRST: f64 = 0.05;
/// The factor from the time of an entry to that of the next.
const STEP: f64 = 1.1;
/// Shares of the paths left at which an entry is made whatever the time.
const SHARES: [f64; 6] = [0.5, 0.1, 0.01, 0.001, 0.0001, 0.0];

/// Moments at growing intervals, and when shares were passed.
#[derive(Debug, Default)]
pub(crate) struct PathsLeftLog {
    pub(crate) moments: Vec<LeftMoment>,
    /// Paths of the render.
    total: u64,
    /// Number of [`SHARES`] that were passed.
    passed: usize,
}

impl PathsLeftLog {
    /// A log for so many paths.
    pub(crate) fn of(total: u64) -> Self {
        Self { total, ..Self::default() }
    }

    /// Adds a moment.
    pub(crate) fn note(&mut self, moment: LeftMoment) {
        #[expect(clippy::cast_precision_loss, reason = "a share")]
        let share = moment.paths_left as f64 / self.total.max(1) as f64;
        let passed = SHARES.iter().filter(|&&limit| share <= limit).count();
        let is_due = self.moments.last().is_none_or(|last| moment.seconds >= last.seconds * STEP + FIRST);
        if is_due || passed > self.passed {
            self.passed = passed;
            self.moments.push(moment);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_moments_are_recorded_at_each_share() {
        let mut left = PathsLeftLog::of(1000);
        for (step, paths_left) in [1000, 999, 998, 501, 500, 499, 120, 90, 11, 10, 9, 1, 0, 0].into_iter().enumerate() {
            let seconds = 0.001 * f64::from(u32::try_from(step).expect("few"));
            left.note(LeftMoment { seconds, paths_left, ..LeftMoment::default() });
        }
        let noted: Vec<u64> = left.moments.iter().map(|moment| moment.paths_left).collect();
        assert_eq!(noted, [1000, 500, 90, 10, 1, 0], "the first, and half, a tenth, 1 %, 0.1 %, none");
        left.note(LeftMoment { seconds: 1.0, ..LeftMoment::default() });
        assert_eq!(left.moments.len(), 7, "later, whatever is left");
    }
}
