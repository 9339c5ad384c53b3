// SPDX-License-Identifier: Apache-2.0
//! What a lane ran last, for the error of a lost device: labels and marks of the submissions in flight. Any thread.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::device::markers::{OperationMark, describe};

/// What is known of a submission in flight.
#[derive(Debug)]
struct SubmissionRecord {
    value: u64,
    label: String,
    marks: Vec<OperationMark>,
}

#[derive(Debug)]
struct SubmissionLogState {
    in_flight: VecDeque<SubmissionRecord>,
    /// Label of the newest submission known to have finished.
    last_finished: String,
}

/// The record of one lane.
#[derive(Debug)]
pub(crate) struct SubmissionLog(Mutex<SubmissionLogState>);

impl Default for SubmissionLog {
    fn default() -> Self {
        Self(Mutex::new(SubmissionLogState { in_flight: VecDeque::new(), last_finished: "none".to_owned() }))
    }
}

impl SubmissionLog {
    fn lock(&self) -> MutexGuard<'_, SubmissionLogState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes a submission, the newest of the lane.
    pub(crate) fn submitted(&self, value: u64, label: String, marks: Vec<OperationMark>) {
        self.lock().in_flight.push_back(SubmissionRecord { value, label, marks });
    }

    /// Forgets what has finished.
    pub(crate) fn finished(&self, completed: u64) {
        let state = &mut *self.lock();
        while let Some(work) = state.in_flight.pop_front_if(|work| work.value <= completed) {
            state.last_finished = work.label;
        }
    }

    /// Whether nothing is known to be in flight.
    pub(crate) fn is_empty(&self) -> bool {
        self.lock().in_flight.is_empty()
    }

    /// What ran last: by the marker if there is one, else the last finished submission.
    pub(crate) fn last_pass(&self, marker: Option<u32>) -> String {
        let state = self.lock();
        let running = state.in_flight.front().map(|work| work.label.as_str());
        let names = state.in_flight.iter().map(|work| (work.label.as_str(), work.marks.as_slice()));
        let found = marker.and_then(|marker| describe(names, marker));
        match (found, running) {
            (Some(pass), _) => pass,
            (None, Some(running)) => format!("{} (then {running} was submitted)", state.last_finished),
            (None, None) => state.last_finished.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_finished_pass_is_remembered_by_label() {
        let passes = SubmissionLog::default();
        assert_eq!((passes.last_pass(None).as_str(), passes.is_empty()), ("none", true), "nothing ran");
        for (value, label) in [(1, "first"), (2, "second"), (3, "third")] {
            passes.submitted(value, label.to_owned(), Vec::new());
        }
        assert_eq!(passes.last_pass(None), "none (then first was submitted)", "nothing is known to have finished");
        passes.finished(2);
        assert_eq!(passes.last_pass(None), "second (then third was submitted)", "up to the second");
        passes.finished(2);
        assert!(!passes.is_empty(), "the third is in flight");
        passes.finished(u64::MAX);
        assert_eq!(
            (passes.last_pass(Some(7)).as_str(), passes.is_empty()),
            ("third", true),
            "all, whatever the marker"
        );
    }
}
