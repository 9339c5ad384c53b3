// SPDX-License-Identifier: Apache-2.0
//! Waiting for loads: slow files are no fault, so it goes on as long as the loader's threads live, and is told once a
//! minute. Pure.

use std::time::{Duration, Instant};

/// How often it is told.
const MINUTE: Duration = Duration::from_secs(60);

/// What to do about a wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WaitVerdict {
    /// Wait on.
    Wait,
    /// Tell that nothing has come for so long, and wait on.
    Tell(Duration),
    /// Nothing will come any more: the threads have ended.
    Over,
}

/// A wait for loads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoadWait {
    since: Instant,
    every: Duration,
    told: u32,
}

impl LoadWait {
    /// A wait that begins now.
    pub(crate) fn new(now: Instant) -> Self {
        Self { since: now, every: MINUTE, told: 0 }
    }

    /// Tells more or less often.
    #[cfg(any(test, feature = "faults"))]
    pub(crate) fn telling_every(self, every: Duration) -> Self {
        Self { every, ..self }
    }

    /// Something has come.
    pub(crate) fn came(&mut self, now: Instant) {
        (self.since, self.told) = (now, 0);
    }

    /// Something has come last at that time.
    pub(crate) fn came_at(&mut self, last: Instant) {
        if last > self.since {
            self.came(last);
        }
    }

    /// Asked again and again; `lives`: the threads that load do.
    pub(crate) fn check(&mut self, now: Instant, lives: bool) -> WaitVerdict {
        if !lives {
            return WaitVerdict::Over;
        }
        let waited = now.saturating_duration_since(self.since);
        if waited < self.every.saturating_mul(self.told.saturating_add(1)) {
            return WaitVerdict::Wait;
        }
        self.told = self.told.saturating_add(1);
        WaitVerdict::Tell(waited)
    }
}

/// What is told.
pub(crate) fn told(what: &str, count: usize, waited: Duration) -> String {
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
        let told = (0..7200).filter(|secs| match patience.check(at(*secs), true) {
            WaitVerdict::Tell(waited) => waited == Duration::from_secs(*secs),
            verdict => verdict == WaitVerdict::Over,
        });
        assert_eq!(told.collect::<Vec<_>>(), (1..120).map(|minute| 60 * minute).collect::<Vec<_>>());
        patience.came(at(7200));
        assert_eq!(patience.check(at(7259), true), WaitVerdict::Wait, "a new wait");
        assert_eq!(patience.check(at(7260), true), WaitVerdict::Tell(Duration::from_secs(60)));
        assert_eq!(patience.check(at(7261), false), WaitVerdict::Over, "nobody loads any more");
    }
}
