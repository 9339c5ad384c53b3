// SPDX-License-Identifier: Apache-2.0
//! Checks that the table in `tests/README.md` names every file of tests or a folder that contains it. [`super::links`]
//! checks that the named files exist. Pure.

use std::collections::BTreeSet;

use super::markdown::{code_spans, paragraphs};

/// The document with the table.
pub(super) const DOCUMENT: &str = "tests/README.md";
/// The heading of the table; text from the next heading of its rank on names folders for other reasons.
const HEADING: &str = "\n## Where the test of a thing is\n";

/// Returns true if a file may hold tests that are separate from the code: Python by its name, Rust below a folder
/// `tests` of a crate.
pub(super) fn may_hold_tests(file: &str) -> bool {
    let (folder, name) = file.rsplit_once('/').unwrap_or(("", file));
    let is_python = file.starts_with("tests/") && name.starts_with("test_") && name.ends_with(".py");
    let mut parts = folder.split('/');
    let of_a_crate = matches!(parts.next(), Some("rust" | "tests")) && parts.nth(1) == Some("tests");
    is_python || (of_a_crate && name.ends_with(".rs"))
}

/// One line for each file with tests that the table of `document` does not name. `files` are those of
/// [`may_hold_tests`], with their text.
pub(super) fn findings(document: &str, files: &[(String, String)]) -> Vec<String> {
    let Some((_, rest)) = document.split_once(HEADING) else {
        return vec![format!("{DOCUMENT}: there is no heading `{}`", HEADING.trim())];
    };
    let section = rest.split("\n## ").next().unwrap_or(rest);
    let rows = paragraphs(section).into_iter().filter(|paragraph| paragraph.text.starts_with('|'));
    let rows: Vec<String> = rows.map(|row| row.text).collect();
    let named: BTreeSet<&str> = rows.iter().flat_map(|row| code_spans(row)).collect();
    let is_named = |file: &str| {
        let folders = file.match_indices('/').map(|(at, _)| &file[..at]);
        folders.chain([file]).any(|path| named.contains(path))
    };
    let has_tests = |(file, text): &&(String, String)| file.ends_with(".py") || text.contains("#[test]");
    let untold = files.iter().filter(has_tests).filter(|(file, _)| !is_named(file));
    untold.map(|(file, _)| format!("{DOCUMENT}: no row leads to {file}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "# Tests\n\n`tests/hydra`\n\n## Where the test of a thing is\n\nnot `rust/x/tests/all/c.rs`\n\n\
                         | a | `rust/x/tests/all/a.rs`, `rust/x/tests/all/b` | `tests/h/test_a.py` |\n\n\
                         ## Layout\n\n| `rust/x/tests/all` |\n";

    #[test]
    fn files_in_rows_and_in_their_folders_are_found() {
        let with = |names: &[&str], text: &str| -> Vec<String> {
            let files: Vec<_> = names.iter().map(|name| ((*name).to_owned(), text.to_owned())).collect();
            findings(TABLE, &files)
        };
        let found = ["rust/x/tests/all/a.rs", "rust/x/tests/all/b/c.rs", "tests/h/test_a.py"];
        assert_eq!(with(&found, "#[test]"), Vec::<String>::new(), "by name and by folder");
        let lost = ["rust/x/tests/all/c.rs", "tests/h/test_b.py", "tests/hydra/test_c.py"];
        let expected = lost.map(|file| format!("tests/README.md: no row leads to {file}"));
        assert_eq!(with(&lost, "#[test]"), expected, "text, other sections and other files do not count");
        assert_eq!(with(&["rust/x/tests/all/c.rs"], "fn helper() {}"), Vec::<String>::new(), "no test in it");
        assert_eq!(findings("# Tests\n", &[]).len(), 1, "a table that is gone");
    }

    #[test]
    fn files_apart_from_the_code_may_hold_tests() {
        for file in ["rust/x/tests/a.rs", "rust/x/tests/all/a/b.rs", "tests/x/tests/a.rs", "tests/x/test_a.py"] {
            assert!(may_hold_tests(file), "{file}");
        }
        for file in ["rust/x/src/tests/a.rs", "tests/x/src/a.rs", "tests/x/a.py", "rust/x/tests/a.csv", "a.rs"] {
            assert!(!may_hold_tests(file), "{file}");
        }
    }
}
