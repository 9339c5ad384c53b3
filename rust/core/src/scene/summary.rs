// SPDX-License-Identifier: Apache-2.0
//! Condenses the warnings of many prims into a few lines: if more than [`FEW`] prims have similar warnings, one line
//! names the first prim, the number of others, and the sum of what was dropped.
//!
//! Pure. Lines come in the order of the first prims; the counts include every prim.

use super::report::SceneWarning;
use crate::desc::DroppedData;
use rustc_hash::{FxHashMap, FxHashSet};
use std::fmt::Write as _;

/// Number of prims with similar warnings that are still listed one by one.
const FEW: usize = 4;
/// Largest number of lines of one summary. Kinds of warning are few, but texts come from scenes.
const MAX_LINES: usize = 100;

/// Prims with similar warnings.
struct WarningGroup<'a> {
    members: Vec<&'a SceneWarning>,
    dropped: DroppedData,
    /// True if all have the same notes.
    is_same: bool,
}

/// One line or more for users, with paths.
#[must_use]
pub fn summary(warnings: &[SceneWarning]) -> Vec<String> {
    let mut numbers = FxHashMap::default();
    let mut groups: Vec<WarningGroup<'_>> = Vec::new();
    for warning in warnings {
        let number = *numbers.entry(kind(&warning.message)).or_insert(groups.len());
        if number == groups.len() {
            groups.push(WarningGroup { members: Vec::new(), dropped: DroppedData::NONE, is_same: true });
        }
        let Some(group) = groups.get_mut(number) else { continue };
        group.is_same &= group.members.first().is_none_or(|first| first.notes == warning.notes);
        group.dropped.add(&warning.dropped);
        group.members.push(warning);
    }
    // Lines in path order, for the prims that are listed one by one.
    let mut lines: Vec<(&str, String)> = groups.iter().flat_map(WarningGroup::lines).collect();
    lines.sort_by_key(|(path, _)| *path);
    let more = lines.len().saturating_sub(MAX_LINES);
    let mut lines: Vec<String> = lines.into_iter().take(MAX_LINES).map(|(_, line)| line).collect();
    lines.extend((more > 0).then(|| format!("{more} more warnings of other kinds or of other prims")));
    lines
}

impl<'a> WarningGroup<'a> {
    /// The lines, each with the path of its first prim.
    fn lines(&self) -> Vec<(&'a str, String)> {
        let prims: FxHashSet<&str> = self.members.iter().map(|warning| &*warning.path).collect();
        let Some(first) = self.members.first().filter(|_| prims.len() > FEW) else {
            let line = |warning: &&'a SceneWarning| (&*warning.path, format!("{}: {}", warning.path, warning.message));
            return self.members.iter().map(line).collect();
        };
        let more = prims.len() - 1;
        let (path, message) = (&first.path, &first.message);
        let mut line = match self.is_same {
            true => format!("{path} and {more} more prims: {message}"),
            false => format!("{path}: {message}; and the like for {more} more prims"),
        };
        let sums: Vec<String> = self.dropped.by_cause().iter().flatten().map(|(_, n)| n.to_string()).collect();
        if !sums.is_empty() {
            // Writing to a String cannot fail.
            write!(line, " ({} in all)", sums.join(", ")).unwrap_or_default();
        }
        vec![(&*first.path, line)]
    }
}

/// The text without the parts that depend on the prim: numbers, paths and quoted text.
fn kind(text: &str) -> String {
    let mut kind = String::with_capacity(text.len());
    for word in text.split(' ') {
        let own = word.trim_start_matches('(').starts_with(['/', '<', '"', '\'']);
        let digits = word.trim_matches(|c: char| c.is_ascii_punctuation());
        let is_number = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
        kind.push_str(if own || is_number { "*" } else { word });
        kind.push(' ');
    }
    kind
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note(path: &str, text: &str) -> SceneWarning {
        SceneWarning::of_notes(path.into(), vec![text.to_owned()])
    }

    fn areas(path: &str, count: u64) -> SceneWarning {
        let dropped = DroppedData { zero_area_triangles: count, ..DroppedData::NONE };
        SceneWarning::new(path.into(), Vec::new(), dropped).expect("something was dropped")
    }

    #[test]
    fn equal_warnings_of_many_prims_become_one_line() {
        let many: Vec<SceneWarning> = (3..19).map(|n| areas(&format!("/World/Proto_{n:02}"), 4)).collect();
        let line = "/World/Proto_03 and 15 more prims: bad data: 4 zero-area triangles (64 in all)";
        assert_eq!(summary(&many), [line], "the first, how many, and the sum");
        let mut other = many.clone();
        other[7] = areas("/World/Proto_10", 40);
        assert_eq!(summary(&other), [line.replace("64", "100")], "counts may differ");
        other.push(note("/World/A", "its material /Looks/A does not exist"));
        let lines = summary(&other);
        assert_eq!(lines.len(), 2, "another kind is another line: {lines:?}");
        assert_eq!(lines[0], "/World/A: its material /Looks/A does not exist", "by path");
    }

    #[test]
    fn few_warnings_are_listed_one_by_one() {
        let few: Vec<SceneWarning> = (0..4).map(|n| areas(&format!("/{n}"), n + 1)).collect();
        let lines = summary(&few);
        assert_eq!(lines.len(), 4, "{lines:?}");
        assert_eq!(lines[1], "/1: bad data: 2 zero-area triangles", "as it is");
        assert!(summary(&[]).is_empty(), "nothing to say");
    }

    #[test]
    fn warnings_that_differ_beyond_the_path_are_grouped_as_similar() {
        let missing = |n: u32| note(&format!("/M{n}"), &format!("its material /Looks/{n} does not exist"));
        let lines = summary(&(0..7).map(missing).collect::<Vec<_>>());
        assert_eq!(lines, ["/M0: its material /Looks/0 does not exist; and the like for 6 more prims"], "its own path");
        let same: Vec<_> = (0..7).map(|n| note(&format!("/M{n}"), "a Volume is not supported")).collect();
        assert_eq!(summary(&same), ["/M0 and 6 more prims: a Volume is not supported"], "the same words");
    }

    #[test]
    fn the_number_of_summary_lines_is_bounded() {
        let word = |n: usize| note(&format!("/{n}"), &format!("word{n}"));
        let lines = summary(&(0..500).map(word).collect::<Vec<_>>());
        assert_eq!(lines.len(), MAX_LINES + 1, "bounded");
        assert_eq!(lines[MAX_LINES], "400 more warnings of other kinds or of other prims", "and says so");
    }
}
