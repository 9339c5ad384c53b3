// SPDX-License-Identifier: Apache-2.0
//! `cargo xtask book`: generates the tables of the documents, checks the documents, builds the book with mdBook.
//!
//! The documents are `README.md`, the book, the decisions and the READMEs of folders. [`check`] is a step of `cargo
//! xtask check` and changes nothing. Pages of the book refer to files outside of it by relative links, which work in
//! the clone; for mdBook, which takes one folder, a copy with everything inside is made in the target folder.

mod links;
mod markdown;
mod names;
mod tables;
mod test_table;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result, bail, ensure};

use crate::clone_files::tracked_files;
use crate::places::RootFolders;
use crate::process::{run, say, succeeds};

/// Longest line of text.
pub(crate) const COLUMNS: usize = 120;
/// Most lines of the README.
const README_LINES: usize = 150;
/// Most decisions: a reader can take in so many.
const MAX_DECISIONS: usize = 25;
const BOOK: &str = "rust/book";
const DECISIONS: &str = "rust/decisions/";

/// Generates the tables, checks, and builds the HTML into `book` in the target folder.
///
/// # Errors
/// A document is wrong, or mdBook fails; with `opens`, also if mdBook is not installed or no browser starts. Else a
/// message says that it is not.
pub(crate) fn make(places: &RootFolders, opens: bool) -> Result<()> {
    let tables = tables::read_all(places)?;
    for (file, text) in documents(places)? {
        let filled = tables::filled(&text, &tables).with_context(|| file.clone())?;
        if filled != text {
            fs::write(places.repo.join(&file), filled).with_context(|| format!("cannot write {file}"))?;
            say(format_args!("tables of {file} generated"));
        }
    }
    check(places)?;
    if !succeeds("mdbook", ["--version"]) {
        let how = "the documents are right; to build the HTML, install mdBook with `cargo install mdbook --locked`";
        ensure!(!opens, how);
        say(how);
        return Ok(());
    }
    let source = places.target.join("book-source");
    stage(places, &source)?;
    let out = places.target.join("book");
    run(Command::new("mdbook").arg("build").arg(&source).arg("--dest-dir").arg(&out))?;
    let index = out.join("index.html");
    say(format_args!("the book is at {}", index.display()));
    if opens {
        run(Command::new("xdg-open").arg(&index)).context("no browser for it")?;
    }
    Ok(())
}

/// Checks the documents: tables are those of their sources, links and paths exist, the README is short, the table of
/// tests is complete.
///
/// # Errors
/// Names everything that is wrong.
pub(crate) fn check(places: &RootFolders) -> Result<()> {
    let files = tracked_files(places)?;
    let documents = documents(places)?;
    let tables = tables::read_all(places)?;
    let sources = sources(places, &files)?;
    let clone = links::TrackedClone::new(&files, &documents);
    let names =
        names::KnownNames::new(&files, &sources, &documents, &<crate::Arguments as clap::CommandFactory>::command());
    let mut findings = Vec::new();
    for (file, text) in &sources {
        findings.extend(names.findings_in_source(file, text));
    }
    for (file, text) in &documents {
        findings.extend(clone.findings(file, text));
        findings.extend(too_long_or_without_status(file, text));
        findings.extend(names.findings(file, text));
        findings.extend(unmapped(file, text, &files));
        if tables::filled(text, &tables).with_context(|| file.clone())? != *text {
            findings.push(format!("{file}: a table is not that of its source; run `cargo xtask book`"));
        }
    }
    let decisions = documents.iter().filter(|(file, _)| is_decision(file)).count();
    if decisions > MAX_DECISIONS {
        findings.push(format!("{decisions} decisions, more than {MAX_DECISIONS}: fold one into a chapter of the book"));
    }
    findings.extend(untold_tests(places, &files, &documents)?);
    if !findings.is_empty() {
        bail!("\n  {}", findings.join("\n  "));
    }
    Ok(())
}

/// Files of tests that the table of tests does not name.
fn untold_tests(places: &RootFolders, files: &[String], documents: &[(String, String)]) -> Result<Vec<String>> {
    let read = |file: &String| {
        let text = fs::read_to_string(places.repo.join(file)).with_context(|| format!("cannot read {file}"))?;
        Ok((file.clone(), text))
    };
    let tests = files.iter().filter(|file| test_table::may_hold_tests(file)).map(read).collect::<Result<Vec<_>>>()?;
    let table = documents.iter().find(|(file, _)| file == test_table::DOCUMENT);
    Ok(test_table::findings(table.map_or("", |(_, text)| text), &tests))
}

/// A README of more than a few screens, or a decision without a status.
fn too_long_or_without_status(file: &str, text: &str) -> Option<String> {
    let lines = text.lines().count();
    if is_decision(file) {
        return (!text.contains("\nStatus: ")).then(|| format!("{file}: no line `Status: ...`"));
    }
    (file == "README.md" && lines > README_LINES).then(|| format!("{file}: {lines} lines, more than {README_LINES}"))
}

/// Returns true for decisions, but not for their list.
fn is_decision(file: &str) -> bool {
    file.strip_prefix(DECISIONS).is_some_and(|name| name != "README.md")
}

/// Crates and folders of C++ that the README's map of the repository does not name.
fn unmapped(file: &str, text: &str, files: &[String]) -> Vec<String> {
    if file != "README.md" {
        return Vec::new();
    }
    let of = |path: &String| -> Option<String> {
        let (root, rest) = path.split_once('/').filter(|(root, _)| ["rust", "cpp"].contains(root))?;
        rest.split_once('/').map(|(folder, _)| format!("{root}/{folder}"))
    };
    let folders: BTreeSet<String> = files.iter().filter_map(of).collect();
    let missing = folders.into_iter().filter(|folder| !text.contains(&format!("`{folder}`")));
    missing.map(|folder| format!("{file}: the map does not name `{folder}`")).collect()
}

/// Every document with its text.
fn documents(places: &RootFolders) -> Result<Vec<(String, String)>> {
    let files = tracked_files(places)?.into_iter().filter(|file| file.ends_with(".md"));
    let read = |file: String| {
        let text = fs::read_to_string(places.repo.join(&file)).with_context(|| format!("cannot read {file}"))?;
        Ok((file, text))
    };
    files.map(read).collect()
}

/// Every source that names are looked up in, with its text.
fn sources(places: &RootFolders, files: &[String]) -> Result<Vec<names::FileText>> {
    let read = |file: &String| {
        let text = fs::read_to_string(places.repo.join(file)).with_context(|| format!("cannot read {file}"))?;
        Ok((file.clone(), text))
    };
    files.iter().filter(|file| names::is_source(file)).map(read).collect()
}

/// Copies the book, the decisions and the pictures into one folder, with links that fit there.
fn stage(places: &RootFolders, target: &Path) -> Result<()> {
    if target.exists() {
        fs::remove_dir_all(target).with_context(|| format!("cannot empty {}", target.display()))?;
    }
    copy(&places.repo.join(BOOK).join("book.toml"), &target.join("book.toml"))?;
    for (file, text) in documents(places)? {
        if let Some(page) = file.strip_prefix("rust/book/src/") {
            write(&target.join("src").join(page), &staged_page(page, &text))?;
        } else if let Some(page) = file.strip_prefix(DECISIONS) {
            write(&target.join("src/decisions").join(page), &staged_decision(&text))?;
        }
    }
    for file in tracked_files(places)?.iter().filter(|file| is_picture(file)) {
        copy(&places.repo.join(file), &target.join("src/files").join(file))?;
    }
    Ok(())
}

/// A page with links that fit the copy. `page`: its path below the source of the book.
fn staged_page(page: &str, text: &str) -> String {
    let up = "../".repeat(page.matches('/').count());
    let decisions = text.replace(&format!("]({up}../../decisions/"), &format!("]({up}decisions/"));
    decisions.replace(&format!("]({up}../../../"), &format!("]({up}files/"))
}

fn staged_decision(text: &str) -> String {
    text.replace("](../book/src/", "](../").replace("](../../", "](../files/")
}

fn is_picture(file: &str) -> bool {
    let is_of_kind = [".jpg", ".png", ".svg"].iter().any(|kind| file.ends_with(kind));
    is_of_kind && file.starts_with("tests/scenes/") && !file["tests/scenes/".len()..].contains('/')
}

fn write(path: &Path, text: &str) -> Result<()> {
    make_parent(path)?;
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    make_parent(to)?;
    fs::copy(from, to).map(drop).with_context(|| format!("cannot copy {}", from.display()))
}

fn make_parent(path: &Path) -> Result<()> {
    let parent = path.parent().unwrap_or(path);
    fs::create_dir_all(parent).with_context(|| format!("cannot make {}", parent.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_readme_is_short() {
        assert_eq!(too_long_or_without_status("README.md", &"x\n".repeat(README_LINES)), None, "as long as it may be");
        let long = "x\n".repeat(README_LINES + 1);
        assert_eq!(
            too_long_or_without_status("README.md", &long),
            Some("README.md: 151 lines, more than 150".to_owned()),
            "a line more"
        );
        assert_eq!(too_long_or_without_status("rust/book/src/a.md", &long), None, "pages may be longer");
    }

    #[test]
    fn the_map_names_all_crates() {
        let files = ["rust/core/src/lib.rs", "rust/gpu/src/lib.rs", "cpp/abi/a.h", "README.md"].map(str::to_owned);
        let map = "| `rust/core` | |\n| `cpp/abi` | |\n";
        assert_eq!(
            unmapped("README.md", map, &files),
            ["README.md: the map does not name `rust/gpu`"],
            "one is missing"
        );
        assert!(unmapped("rust/book/src/a.md", "", &files).is_empty(), "a page without a map");
    }

    #[test]
    fn a_decision_has_a_status() {
        let finding = |text: &str| too_long_or_without_status("rust/decisions/0001-a.md", text);
        assert_eq!(finding("# A\n\nStatus: holds.\nSo be it."), None);
        assert!(finding("# A\n\nIt holds.").is_some_and(|finding| finding.contains("Status")), "no status");
        assert_eq!(too_long_or_without_status("rust/decisions/README.md", "# List"), None, "the list is no decision");
    }

    #[test]
    fn staged_links_stay_inside() {
        let page = "![x](../../../tests/scenes/a.jpg) [d](../../decisions/0001-mesa.md) [p](b.md)";
        let staged = "![x](files/tests/scenes/a.jpg) [d](decisions/0001-mesa.md) [p](b.md)";
        assert_eq!(staged_page("a.md", page), staged, "a page");
        let chapter =
            "![x](../../../../tests/scenes/a.jpg) [d](../../../decisions/0001-mesa.md) [p](../b.md) [q](c.md)";
        let staged = "![x](../files/tests/scenes/a.jpg) [d](../decisions/0001-mesa.md) [p](../b.md) [q](c.md)";
        assert_eq!(staged_page("design/a.md", chapter), staged, "a page in a folder");
        let decision = "[p](../book/src/b.md) ![x](../../tests/scenes/a.jpg) [d](0002-film.md)";
        assert_eq!(
            staged_decision(decision),
            "[p](../b.md) ![x](../files/tests/scenes/a.jpg) [d](0002-film.md)",
            "one"
        );
        assert!(is_picture("tests/scenes/a.jpg") && !is_picture("tests/scenes/small/a.png"), "pictures to show");
    }
}
