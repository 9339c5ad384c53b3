// SPDX-License-Identifier: Apache-2.0
//! No line is wider than 120 columns: of documents, Python and GLSL everything, of Rust and C++ the comments (their
//! formatters see to the code, but for strings).

use std::fs;

use anyhow::{Result, bail};

use crate::book::COLUMNS;
use crate::clone_files::{path, tracked_files};
use crate::places::RootFolders;

/// Python programs without an extension.
const PROGRAMS: &[&str] = &["plugin/usdrecord", "plugin/texture-host"];

/// What of a file is held to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ColumnRule {
    /// Everything but table rows, pictures and what a URL makes wide.
    Markdown,
    All,
    Comments,
    Nothing,
}

pub(super) fn check(places: &RootFolders) -> Result<()> {
    let mut findings = Vec::new();
    for file in tracked_files(places)? {
        if held(&file) == ColumnRule::Nothing {
            continue;
        }
        if let Ok(text) = fs::read_to_string(path(places, &file)) {
            findings.extend(findings_in(&file, &text));
        }
    }
    if !findings.is_empty() {
        bail!("\n  {}", findings.join("\n  "));
    }
    Ok(())
}

fn held(file: &str) -> ColumnRule {
    let extension = file.rsplit_once('.').map_or("", |(_, extension)| extension);
    match extension {
        "md" => ColumnRule::Markdown,
        "py" | "comp" | "glsl" => ColumnRule::All,
        "rs" | "h" | "cpp" => ColumnRule::Comments,
        _ if PROGRAMS.contains(&file) => ColumnRule::All,
        _ => ColumnRule::Nothing,
    }
}

fn findings_in(file: &str, text: &str) -> Vec<String> {
    let held = held(file);
    let is_wide = |line: &str| line.chars().count() > COLUMNS && counts(held, line.trim_start());
    let wide = (1..).zip(text.lines()).filter(|(_, line)| is_wide(line));
    wide.map(|(number, line)| format!("{file}:{number}: {} columns, more than {COLUMNS}", line.chars().count()))
        .collect()
}

fn counts(held: ColumnRule, line: &str) -> bool {
    match held {
        ColumnRule::Markdown => !line.starts_with(['|', '!']) && !line.contains("://"),
        ColumnRule::All => true,
        ColumnRule::Comments => line.starts_with("//"),
        ColumnRule::Nothing => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(file: &str, line: &str) -> usize {
        findings_in(file, &format!("short\n{line}\n")).len()
    }

    #[test]
    fn wide_lines_are_found() {
        let wide = "x".repeat(COLUMNS + 1);
        assert_eq!(
            findings_in("a.py", &format!("\n{wide}\n")),
            ["a.py:2: 121 columns, more than 120"],
            "with its place"
        );
        assert_eq!(count("a.py", &wide[1..]), 0, "as wide as it may be");
        assert_eq!(count("a.py", &"ä".repeat(COLUMNS)), 0, "columns, not bytes");
        assert_eq!(count("plugin/usdrecord", &wide), 1, "a program");
        assert_eq!(count("README.md", &wide), 1, "text");
        assert_eq!(count("README.md", &format!("| {wide} |")), 0, "a row");
        assert_eq!(count("README.md", &format!("![p](a.jpg) {wide}")), 0, "a picture");
        assert_eq!(count("README.md", &format!("https://{wide}")), 0, "an address");
        assert_eq!(count("rust/gpu/a.rs", &format!("    /// {wide}")), 1, "a comment");
        assert_eq!(count("rust/gpu/a.rs", &format!("let x = \"{wide}\";")), 0, "code is the formatter's");
        assert_eq!(count("shaders/a.glsl", &format!("x = {wide};")), 1, "no formatter sees to shaders");
        assert_eq!(count("a.json", &wide), 0, "no text");
    }
}
