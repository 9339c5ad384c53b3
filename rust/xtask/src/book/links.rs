// SPDX-License-Identifier: Apache-2.0
//! Links, pictures and paths of the documents lead somewhere. Pure: works on the list of the clone's files.

use std::collections::{BTreeMap, BTreeSet};

use super::markdown::{Paragraph, anchors, code_spans, paragraphs, shell_lines, targets};

/// Tracked files and the folders that hold them, relative to the root, and the documents among them with their text.
#[derive(Debug, Default)]
pub(super) struct TrackedClone<'a> {
    known: BTreeSet<&'a str>,
    pages: BTreeMap<&'a str, &'a str>,
}

impl<'a> TrackedClone<'a> {
    pub(super) fn new(files: &'a [String], pages: &'a [(String, String)]) -> Self {
        let mut known = BTreeSet::new();
        for file in files {
            known.insert(file.as_str());
            known.extend(file.match_indices('/').map(|(at, _)| &file[..at]));
        }
        Self { known, pages: pages.iter().map(|(file, text)| (file.as_str(), text.as_str())).collect() }
    }

    /// One line for each link, picture and path of `file` that leads nowhere.
    pub(super) fn findings(&self, file: &str, text: &str) -> Vec<String> {
        let mut found = Vec::new();
        for Paragraph { line, text } in paragraphs(text) {
            for target in targets(&text) {
                if let Some(what) = self.broken(file, &target) {
                    found.push(format!("{file}:{line}: {target}: {what}"));
                }
            }
            for path in code_spans(&text).filter(|span| self.is_path(file, span)) {
                if !self.exists(path) && !self.exists(&joined(file, path)) {
                    found.push(format!("{file}:{line}: `{path}` does not exist"));
                }
            }
        }
        for (line, command) in shell_lines(text) {
            for path in command.split_whitespace().filter(|word| self.is_path("", word) && !self.exists(word)) {
                found.push(format!("{file}:{line}: `{path}` does not exist"));
            }
        }
        found
    }

    /// What is wrong with a link from `file`.
    fn broken(&self, file: &str, target: &str) -> Option<String> {
        if target.contains("://") || target.starts_with("mailto:") {
            return None;
        }
        let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
        let path = if path.is_empty() { file.to_owned() } else { joined(file, path) };
        if !self.known.contains(path.trim_end_matches('/')) {
            return Some("there is no such file".to_owned());
        }
        let page = self.pages.get(path.as_str());
        let is_missing = !anchor.is_empty() && !page.is_some_and(|text| anchors(text).iter().any(|a| a == anchor));
        is_missing.then(|| "there is no such heading".to_owned())
    }

    /// Whether a code span looks like a path of the repository: it begins with a folder of the root or beside `file`.
    /// `NAME` stands for a name that the reader chooses.
    fn is_path(&self, file: &str, span: &str) -> bool {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./*".contains(c);
        let Some((first, rest)) = span.split_once('/') else {
            return false;
        };
        let begins = self.known.contains(first) || self.known.contains(joined(file, first).as_str());
        begins && !first.is_empty() && !rest.is_empty() && span.chars().all(is_plain) && !span.contains("NAME")
    }

    /// Whether there is such a file or folder; `*` stands for any part of a name.
    fn exists(&self, path: &str) -> bool {
        let path = path.trim_end_matches('/');
        if let Some((before, after)) = path.split_once('*') {
            let fits = |rest: &str| rest.ends_with(after.trim_start_matches('*')) && rest.len() >= after.len();
            return self.known.iter().any(|known| known.strip_prefix(before).is_some_and(fits));
        }
        self.known.contains(path)
    }
}

/// The path that `relative` means in `file`.
fn joined(file: &str, relative: &str) -> String {
    let mut parts: Vec<&str> = file.split('/').collect();
    parts.pop();
    for part in relative.split('/') {
        match part {
            "" | "." => {}
            ".." => drop(parts.pop()),
            name => parts.push(name),
        }
    }
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn findings(text: &str) -> Vec<String> {
        let files = ["README.md", "rust/book/src/a.md", "rust/book/src/b.md", "tests/x.jpg"].map(str::to_owned);
        let pages = [("rust/book/src/b.md".to_owned(), "# Some heading\n".to_owned())];
        TrackedClone::new(&files, &pages).findings("rust/book/src/a.md", text)
    }

    #[test]
    fn existing_links_and_paths_pass() {
        let text = "[b](b.md#some-heading) ![p](../../../tests/x.jpg) [w](https://example.com/no)\n\n\
                    `rust/book` `tests/*.jpg` `src/unknown.rs` `a / b` `and/or` `tests/NAME.rs`\n";
        assert_eq!(findings(text), Vec::<String>::new(), "links, a picture, paths, other code");
    }

    #[test]
    fn missing_links_and_paths_are_named() {
        let text = "[c](c.md)\n\n[b](b.md#other)\n\n![p](../../tests/x.jpg)\n\nsee `rust/book/none.md`\n\n`tests/*.png`\n\n\
             ```sh\npytest tests/x.jpg tests/none.py\n```\n";
        let expected = [
            "rust/book/src/a.md:1: c.md: there is no such file",
            "rust/book/src/a.md:3: b.md#other: there is no such heading",
            "rust/book/src/a.md:5: ../../tests/x.jpg: there is no such file",
            "rust/book/src/a.md:7: `rust/book/none.md` does not exist",
            "rust/book/src/a.md:9: `tests/*.png` does not exist",
            "rust/book/src/a.md:12: `tests/none.py` does not exist",
        ];
        assert_eq!(findings(text), expected, "each with its line");
    }
}
