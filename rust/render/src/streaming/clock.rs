// SPDX-License-Identifier: Apache-2.0
//! Where the time of a streaming render goes, as the host sees it.

use std::time::Instant;

/// Sums of seconds by what was under way.
#[derive(Debug)]
pub(crate) struct StageClock {
    last: Instant,
    state: StageActivity,
    /// The device had work.
    pub(crate) tracing: f64,
    /// Something was being loaded.
    pub(crate) loading: f64,
    /// Something was being loaded and the device had no work.
    pub(crate) waiting: f64,
    /// Both at once.
    pub(crate) overlapped: f64,
}

/// What is under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct StageActivity {
    pub(crate) tracing: bool,
    pub(crate) loading: bool,
}

impl StageClock {
    /// Starts with nothing under way.
    pub(crate) fn new(now: Instant) -> Self {
        let state = StageActivity::default();
        Self { last: now, state, tracing: 0.0, loading: 0.0, waiting: 0.0, overlapped: 0.0 }
    }

    /// From `now` on, `state` is under way.
    pub(crate) fn change(&mut self, now: Instant, state: StageActivity) {
        let secs = now.saturating_duration_since(self.last).as_secs_f64();
        let StageActivity { tracing, loading } = self.state;
        self.tracing += if tracing { secs } else { 0.0 };
        self.loading += if loading { secs } else { 0.0 };
        self.waiting += if loading && !tracing { secs } else { 0.0 };
        self.overlapped += if loading && tracing { secs } else { 0.0 };
        (self.last, self.state) = (now, state);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn step_time_is_attributed_to_its_phase() {
        let start = Instant::now();
        let at = |secs| start + Duration::from_secs(secs);
        let mut clock = StageClock::new(start);
        clock.change(at(1), StageActivity { tracing: true, loading: false });
        clock.change(at(3), StageActivity { tracing: true, loading: true });
        clock.change(at(7), StageActivity { tracing: false, loading: true });
        clock.change(at(15), StageActivity::default());
        clock.change(at(31), StageActivity::default());
        let sums = [clock.tracing, clock.loading, clock.waiting, clock.overlapped];
        assert!(sums == [6.0, 12.0, 8.0, 4.0], "each second counts where it was spent: {sums:?}");
    }
}
