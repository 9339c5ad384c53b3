// SPDX-License-Identifier: Apache-2.0
//! Waiting for loads: slow files are not a fault, so a wait goes on as long as the loader's threads live, and is
//! reported once a minute. Pure.

use std::time::{Duration, Instant};

/// The interval between two reports.
const MINUTE: Duration = Duration::from_secs(60);

/// The action to take in a wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WaitVerdict {
    /// Keep waiting.
    Wait,
    /// Report that nothing has come for so long, and keep waiting.
    Tell(Duration),
    /// Nothing will come any more: the threads have ended.
    Over,
}

/// A wait for loads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoadWait {
    since: Instant,
    every: Duration,
    reports: u32,
}

impl LoadWait {
    /// Begins a wait at `now`.
    pub(crate) fn new(now: Instant) -> Self {
        Self { since: now, every: MINUTE, reports: 0 }
    }

    /// Sets the interval between two reports.
    #[cfg(any(test, feature = "faults"))]
    pub(crate) fn telling_every(self, every: Duration) -> Self {
        Self { every, ..self }
    }

    /// Notes that something has come.
    pub(crate) fn came(&mut self, now: Instant) {
        (self.since, self.reports) = (now, 0);
    }

    /// Notes the time at which something came last.
    pub(crate) fn came_at(&mut self, last: Instant) {
        if last > self.since {
            self.came(last);
        }
    }

    /// Decides how to go on; called repeatedly. `lives`: true if the loader's threads run.
    pub(crate) fn check(&mut self, now: Instant, lives: bool) -> WaitVerdict {
        if !lives {
            return WaitVerdict::Over;
        }
        let waited = now.saturating_duration_since(self.since);
        if waited < self.every.saturating_mul(self.reports.saturating_add(1)) {
            return WaitVerdict::Wait;
        }
        self.reports = self.reports.saturating_add(1);
        WaitVerdict::Tell(waited)
    }
}

/// The text of the report.
pub(crate) fn report_text(what: &str, count: usize, waited: Duration) -> String {
    let s = if count == 1 { "" } else { "s" };
    format!("still waiting for {count} {what}{s} to be loaded: nothing has come for {} s", waited.as_secs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_load_warns_once_a_minute_and_is_awaited() {
        let start = Instant::now();
        let at = |secs| start + Duration::from_secs(secs);
        let mut patience = LoadWait::new(start);
        let reports = (0..7200).filter(|secs| match patience.check(at(*secs), true) {
            WaitVerdict::Tell(waited) => waited == Duration::from_secs(*secs),
            verdict => verdict == WaitVerdict::Over,
        });
        assert_eq!(reports.collect::<Vec<_>>(), (1..120).map(|minute| 60 * minute).collect::<Vec<_>>());
        patience.came(at(7200));
        assert_eq!(patience.check(at(7259), true), WaitVerdict::Wait, "a new wait");
        assert_eq!(patience.check(at(7260), true), WaitVerdict::Tell(Duration::from_secs(60)));
        assert_eq!(patience.check(at(7261), false), WaitVerdict::Over, "nobody loads any more");
    }
}
