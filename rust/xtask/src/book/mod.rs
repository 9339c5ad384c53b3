// SPDX-License-Identifier: Apache-2.0
//! `cargo xtask book`: generates the tables of the documents, checks the documents, builds the book with mdBook.
//!
//! The documents are `README.md`, the book, the decisions and the READMEs of folders. [`check`] is a step of `cargo
//! xtask check` and changes nothing. Pages of the book refer to files outside of it by relative links, which work where
//! the clone is looked at; for mdBook, which takes one folder, a copy with everything inside is made in the target
//! folder.

mod links;
mod markdown;
mod tables;
mod test_table;

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result, bail};

use crate::clone_files::tracked_files;
use crate::places::Places;
use crate::process::{run, say, succeeds};

/// Longest line of text.
pub(crate) const COLUMNS: usize = 120;
/// Most lines of the README.
const README_LINES: usize = 150;
/// Most words of a decision, its appendices left out: a page.
const DECISION_WORDS: usize = 600;
const BOOK: &str = "rust/book";
const DECISIONS: &str = "rust/decisions/";

/// Generates the tables, checks, and builds the HTML into `book` in the target folder.
///
/// # Errors
/// If a document is wrong, or mdBook fails. Where mdBook is not installed it says so.
pub(crate) fn make(places: &Places) -> Result<()> {
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
        say("the documents are right; to build the HTML, install mdBook with `cargo install mdbook --locked`");
        return Ok(());
    }
    let source = places.target.join("book-source");
    stage(places, &source)?;
    let out = places.target.join("book");
    run(Command::new("mdbook").arg("build").arg(&source).arg("--dest-dir").arg(&out))?;
    say(format_args!("the book is at {}", out.join("index.html").display()));
    Ok(())
}

/// Judges the documents: tables are those of their sources, links and paths lead somewhere, the README is short, the
/// table of tests is complete.
///
/// # Errors
/// Names everything that is wrong.
pub(crate) fn check(places: &Places) -> Result<()> {
    let files = tracked_files(places)?;
    let documents = documents(places)?;
    let tables = tables::read_all(places)?;
    let clone = links::Clone::new(&files, &documents);
    let mut findings = Vec::new();
    for (file, text) in &documents {
        findings.extend(clone.findings(file, text));
        findings.extend(too_long(file, text));
        if tables::filled(text, &tables).with_context(|| file.clone())? != *text {
            findings.push(format!("{file}: a table is not that of its source; run `cargo xtask book`"));
        }
    }
    findings.extend(untold_tests(places, &files, &documents)?);
    if !findings.is_empty() {
        bail!("\n  {}", findings.join("\n  "));
    }
    Ok(())
}

/// Files of tests that the table of tests does not lead to.
fn untold_tests(places: &Places, files: &[String], documents: &[(String, String)]) -> Result<Vec<String>> {
    let read = |file: &String| {
        let text = fs::read_to_string(places.repo.join(file)).with_context(|| format!("cannot read {file}"))?;
        Ok((file.clone(), text))
    };
    let tests = files.iter().filter(|file| test_table::may_hold_tests(file)).map(read).collect::<Result<Vec<_>>>()?;
    let table = documents.iter().find(|(file, _)| file == test_table::DOCUMENT);
    Ok(test_table::findings(table.map_or("", |(_, text)| text), &tests))
}

/// A README of more than a few screens, or a decision of more than a page before its first appendix.
fn too_long(file: &str, text: &str) -> Option<String> {
    let lines = text.lines().count();
    if file.starts_with(DECISIONS) {
        let body = text.split("\n## Appendix").next().unwrap_or(text);
        let words = body.split_whitespace().count();
        return (words > DECISION_WORDS).then(|| format!("{file}: {words} words, more than {DECISION_WORDS}"));
    }
    (file == "README.md" && lines > README_LINES).then(|| format!("{file}: {lines} lines, more than {README_LINES}"))
}

/// Every document with its text.
fn documents(places: &Places) -> Result<Vec<(String, String)>> {
    let files = tracked_files(places)?.into_iter().filter(|file| file.ends_with(".md"));
    let read = |file: String| {
        let text = fs::read_to_string(places.repo.join(&file)).with_context(|| format!("cannot read {file}"))?;
        Ok((file, text))
    };
    files.map(read).collect()
}

/// Copies the book, the decisions and the pictures into one folder, with links that fit there.
fn stage(places: &Places, target: &Path) -> Result<()> {
    if target.exists() {
        fs::remove_dir_all(target).with_context(|| format!("cannot empty {}", target.display()))?;
    }
    copy(&places.repo.join(BOOK).join("book.toml"), &target.join("book.toml"))?;
    for (file, text) in documents(places)? {
        if let Some(page) = file.strip_prefix("rust/book/src/") {
            write(&target.join("src").join(page), &staged_page(&text))?;
        } else if let Some(page) = file.strip_prefix(DECISIONS) {
            write(&target.join("src/decisions").join(page), &staged_decision(&text))?;
        }
    }
    for file in tracked_files(places)?.iter().filter(|file| is_picture(file)) {
        copy(&places.repo.join(file), &target.join("src/files").join(file))?;
    }
    Ok(())
}

fn staged_page(text: &str) -> String {
    text.replace("](../../decisions/", "](decisions/").replace("](../../../", "](files/")
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
        assert_eq!(too_long("README.md", &"x\n".repeat(README_LINES)), None, "as long as it may be");
        let long = "x\n".repeat(README_LINES + 1);
        assert_eq!(too_long("README.md", &long), Some("README.md: 151 lines, more than 150".to_owned()), "a line more");
        assert_eq!(too_long("rust/book/src/a.md", &long), None, "pages may be longer");
    }

    #[test]
    fn a_decision_is_a_page() {
        let (page, rest) = ("word ".repeat(DECISION_WORDS), "\n## Appendix: measurements\n more");
        assert_eq!(too_long("rust/decisions/0001-a.md", &format!("{page}{rest}")), None, "appendices do not count");
        assert!(too_long("rust/decisions/0001-a.md", &format!("{page}{page}{rest}")).is_some(), "two pages");
    }

    #[test]
    fn staged_links_stay_inside() {
        let page = "![x](../../../tests/scenes/a.jpg) [d](../../decisions/0001-mesa.md) [p](b.md)";
        assert_eq!(staged_page(page), "![x](files/tests/scenes/a.jpg) [d](decisions/0001-mesa.md) [p](b.md)", "a page");
        let decision = "[p](../book/src/b.md) ![x](../../tests/scenes/a.jpg) [d](0002-film.md)";
        assert_eq!(
            staged_decision(decision),
            "[p](../b.md) ![x](../files/tests/scenes/a.jpg) [d](0002-film.md)",
            "one"
        );
        assert!(is_picture("tests/scenes/a.jpg") && !is_picture("tests/scenes/small/a.png"), "pictures to show");
    }
}
