// SPDX-License-Identifier: Apache-2.0
//! Decisions that documents and sources refer to by number are files of `rust/decisions`. Pure.
//!
//! A reference is a number of four digits that begins with two zeros: `decision 0004`, `decisions/0004`, `(0004)`,
//! `0004-partition.md`. The changelog and the decisions themselves may also name those that the list of the folder says
//! are folded into chapters.

use std::collections::BTreeSet;

use super::sources::FileText;

const FOLDER: &str = "rust/decisions/";
const LIST: &str = "rust/decisions/README.md";
const CHANGELOG: &str = "rust/book/src/CHANGELOG.md";
const DIGITS: usize = 4;

/// Numbers of decisions with their files, and the numbers that are folded.
#[derive(Debug, Default)]
pub(super) struct DecisionList<'a> {
    /// Names such as `0004-partition.md`.
    files: BTreeSet<&'a str>,
    folded: BTreeSet<String>,
}

impl<'a> DecisionList<'a> {
    pub(super) fn new(files: &'a [String], pages: &[FileText]) -> Self {
        let list = pages.iter().filter(|(file, _)| file == LIST);
        let numbers = list.flat_map(|(_, text)| text.lines()).flat_map(references);
        Self {
            files: files.iter().filter_map(|file| file.strip_prefix(FOLDER)).collect(),
            folded: numbers.map(|(number, _)| number.to_owned()).collect(),
        }
    }

    /// One line for each reference that leads nowhere.
    pub(super) fn findings(&self, file: &str, text: &str) -> Vec<String> {
        let mut found = Vec::new();
        for (line, content) in (1..).zip(text.lines()) {
            for (number, name) in references(content) {
                let may_look_back = file == CHANGELOG || file.starts_with(FOLDER);
                let is_folded = may_look_back && self.folded.contains(number);
                let is_there = match name {
                    Some(name) => self.files.contains(name),
                    None => self.files.iter().any(|file| file.starts_with(number)),
                };
                let is_known = is_there || is_folded && name.is_none();
                if !is_known {
                    found.push(format!("{file}:{line}: there is no decision {}", name.unwrap_or(number)));
                }
            }
        }
        found
    }
}

/// Numbers of decisions in a line, with the name of the file where it stands.
fn references(line: &str) -> Vec<(&str, Option<&str>)> {
    let mut found = Vec::new();
    for (at, _) in line.match_indices("00") {
        let (before, rest) = (&line[..at], &line[at..]);
        let is_part = |c: char| c.is_ascii_alphanumeric() || "._-#,:".contains(c);
        let is_begun = !before.ends_with(is_part) && (!before.ends_with('/') || before.ends_with("decisions/"));
        let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
        let after = &rest[digits..];
        let goes_on = after.starts_with(['_', '%', '/']) || after.starts_with(|c: char| c.is_ascii_alphabetic());
        let has_more = after.starts_with(['.', ',', ':']) && after[1..].starts_with(|c: char| c.is_ascii_digit());
        if !is_begun || digits != DIGITS || goes_on || has_more {
            continue;
        }
        let name = rest.split_once(".md").map(|(stem, _)| &rest[..stem.len() + ".md".len()]);
        let is_name = |name: &&str| name[digits..].chars().all(|c| c.is_ascii_alphanumeric() || "-.".contains(c));
        found.push((&rest[..digits], name.filter(|_| after.starts_with('-')).filter(is_name)));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn findings(file: &str, text: &str) -> Vec<String> {
        let files = ["rust/decisions/0004-partition.md", "rust/decisions/README.md"].map(str::to_owned);
        let list = "| 0004 | holds |\n\n## Folded\n\n| 0007 | Images | [Image files](../book/src/design/images.md) |\n";
        let pages = [(LIST.to_owned(), list.to_owned())];
        DecisionList::new(&files, &pages).findings(file, text)
    }

    #[test]
    fn decisions_that_are_there_pass() {
        let text = "decision 0004, decisions/0004 (0004) [0004](../../decisions/0004-partition.md)\n\
                    0.0007 a.0007.exr 2026-0007 10007 00070 0007_000 x0007 1:0007 assets/0007.png\n";
        assert_eq!(findings("a.md", text), Vec::<String>::new(), "decisions, and numbers that are none");
    }

    #[test]
    fn decisions_that_are_nowhere_are_named() {
        let expected = ["a.rs:2: there is no decision 0009", "a.rs:2: there is no decision 0010"];
        assert_eq!(findings("a.rs", "\n// (decisions/0009, 0010).\n"), expected, "a list");
        assert_eq!(findings("a.md", "decision 0009."), ["a.md:1: there is no decision 0009"], "at the end");
        let renamed = ["a.cpp:1: there is no decision 0004-parts.md"];
        assert_eq!(findings("a.cpp", "// rust/decisions/0004-parts.md"), renamed, "by its old name");
        assert_eq!(findings("a.glsl", "// (0009): why"), ["a.glsl:1: there is no decision 0009"], "a number alone");
    }

    #[test]
    fn changelog_and_decisions_alone_may_name_folded_decisions() {
        for file in [CHANGELOG, LIST, "rust/decisions/0004-partition.md"] {
            assert_eq!(findings(file, "takes in what was 0007"), Vec::<String>::new(), "{file}");
        }
        assert_eq!(findings("a.rs", "// decisions/0007").len(), 1, "a source");
        assert_eq!(findings("a.md", "decision 0007").len(), 1, "a page");
        assert_eq!(findings(CHANGELOG, "decision 0008").len(), 1, "one that never was");
    }
}
