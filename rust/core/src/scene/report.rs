// SPDX-License-Identifier: Apache-2.0
//! What was dropped because it was bad: one line of warning per prim.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::desc::DroppedData;

/// One warning about one prim.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneWarning {
    /// The prim.
    pub path: Arc<str>,
    /// What is wrong and how often, one line, without the path.
    pub message: String,
    /// Of that, what was dropped, by kind.
    pub dropped: DroppedData,
    /// Of that, the rest.
    pub notes: Vec<String>,
}

impl SceneWarning {
    /// The warning about a prim; none where there is nothing to say.
    pub(crate) fn new(path: Arc<str>, notes: Vec<String>, dropped: DroppedData) -> Option<Self> {
        let mut message = String::new();
        notes.iter().for_each(|note| join(&mut message, note));
        if let Some(text) = dropped.message() {
            join(&mut message, &text);
        }
        (!message.is_empty()).then_some(Self { path, message, dropped, notes })
    }

    /// A warning that counts nothing.
    #[must_use]
    pub fn of_notes(path: Arc<str>, notes: Vec<String>) -> Self {
        Self { path, message: notes.join("; "), dropped: DroppedData::NONE, notes }
    }
}

/// What was dropped, by prim, during one commit.
#[derive(Debug, Default)]
pub(crate) struct CommitReports {
    dropped: BTreeMap<Arc<str>, DroppedData>,
    /// What is no dropped data, in words.
    notes: BTreeMap<Arc<str>, Vec<String>>,
}

impl CommitReports {
    /// The counters of a prim.
    pub(crate) fn of(&mut self, path: &Arc<str>) -> &mut DroppedData {
        self.dropped.entry(path.clone()).or_default()
    }

    /// Adds to the counters of a prim.
    pub(crate) fn add(&mut self, path: &Arc<str>, dropped: &DroppedData) {
        if *dropped != DroppedData::default() {
            self.of(path).add(dropped);
        }
    }

    /// Sum over all prims.
    pub(crate) fn total(&self) -> DroppedData {
        let mut total = DroppedData::default();
        self.dropped.values().for_each(|dropped| total.add(dropped));
        total
    }

    /// The warning of every prim that has one, in path order.
    pub(crate) fn warnings(&self) -> BTreeMap<Arc<str>, SceneWarning> {
        let paths = self.notes.keys().chain(self.dropped.keys());
        let warning = |path: &Arc<str>| {
            let notes = self.notes.get(path).cloned().unwrap_or_default();
            let dropped = self.dropped.get(path).copied().unwrap_or(DroppedData::NONE);
            Some((path.clone(), SceneWarning::new(path.clone(), notes, dropped)?))
        };
        paths.filter_map(warning).collect()
    }

    /// Says something about a prim that is no count of dropped data.
    pub(crate) fn note(&mut self, path: &Arc<str>, text: String) {
        let notes = self.notes.entry(path.clone()).or_default();
        if !notes.iter().any(|note| note.contains(&text)) {
            notes.push(text);
        }
    }
}

fn join(line: &mut String, text: &str) {
    if !line.is_empty() {
        line.push_str("; ");
    }
    line.push_str(text);
}
