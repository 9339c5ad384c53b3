// SPDX-License-Identifier: Apache-2.0
//! What every source file must and must not contain: licence line, words that mean "not finished", paths of one
//! machine, unsafe code out of its place.

use std::fs;

use anyhow::{Result, bail};

use crate::clone_files::{path, tracked_files};
use crate::places::RootFolders;

/// Words that may not stand alone; one with an issue number behind it (`WORD(#12)`) may. Written in halves so that this
/// file passes.
const UNFINISHED: &[&str] = &[concat!("TO", "DO"), concat!("FIX", "ME"), concat!("XX", "X"), concat!("HA", "CK")];

/// Where unsafe code lives: the Vulkan crate, the bridge's side of the C++ boundary, and the calls to OpenSubdiv.
const UNSAFE_HOMES: &[&str] =
    &["rust/gpu/", "rust/bridge/src/ffi", "rust/bridge/src/held", "rust/bridge/src/lib.rs", "rust/subdiv/src/ffi"];

/// Extensions of files that are read by people and compilers.
const SOURCES: &[&str] = &["rs", "h", "cpp", "comp", "glsl", "py", "sh", "txt", "toml", "cmake"];

pub(super) fn check(places: &RootFolders) -> Result<()> {
    let mut findings = Vec::new();
    for file in tracked_files(places)? {
        // A file that is no text (a picture, a scene in crate form) has no words.
        let Ok(text) = fs::read_to_string(path(places, &file)) else {
            continue;
        };
        findings.extend(findings_in(&file, &text));
    }
    if !findings.is_empty() {
        bail!("\n  {}", findings.join("\n  "));
    }
    Ok(())
}

fn extension(file: &str) -> &str {
    let name = file.rsplit('/').next().unwrap_or(file);
    name.rsplit_once('.').map_or("", |(_, extension)| extension)
}

fn is_source(file: &str) -> bool {
    SOURCES.contains(&extension(file)) || matches!(file, ".ci/run" | "plugin/usdrecord")
}

/// All that is wrong with one file, as `file:line: what`.
fn findings_in(file: &str, text: &str) -> Vec<String> {
    let mut findings = Vec::new();
    if is_source(file) {
        let has_licence = text.lines().take(2).any(|line| line.contains("SPDX-License-Identifier: Apache-2.0"));
        if !has_licence && matches!(extension(file), "rs" | "h" | "cpp" | "comp" | "glsl" | "py") {
            findings.push(format!("{file}:1: no SPDX-License-Identifier"));
        }
    }
    for (number, line) in (1..).zip(text.lines()) {
        if let Some(what) = finding_in_line(file, line) {
            findings.push(format!("{file}:{number}: {what}"));
        }
    }
    findings
}

fn finding_in_line(file: &str, line: &str) -> Option<String> {
    for word in UNFINISHED {
        if after_word(line, word).is_some_and(|rest| !rest.starts_with("(#")) {
            return Some(format!("{word} without an issue number"));
        }
    }
    for machine in [concat!("/ro", "ot/"), concat!("/wo", "rk/")] {
        let starts_path = |at: usize| !line[..at].ends_with(|c: char| c.is_ascii_alphanumeric() || "._-}".contains(c));
        if line.match_indices(machine).any(|(at, _)| starts_path(at)) {
            return Some(format!("{machine} is a path of one machine"));
        }
    }
    let is_code = !line.trim_start().starts_with("//");
    let at_home = UNSAFE_HOMES.iter().any(|home| file.starts_with(home));
    if extension(file) == "rs"
        && is_code
        && !at_home
        && after_word(&without_strings(line), concat!("un", "safe")).is_some()
    {
        return Some("unsafe code outside of its place".to_owned());
    }
    None
}

/// What follows the first `word` that stands alone in `line`.
fn after_word<'line>(line: &'line str, word: &str) -> Option<&'line str> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    line.match_indices(word).find_map(|(at, _)| {
        let (before, after) = (&line[..at], &line[at + word.len()..]);
        (!before.ends_with(is_part) && !after.starts_with(is_part)).then_some(after)
    })
}

/// The line without what stands between double quotes.
fn without_strings(line: &str) -> String {
    line.split('"').step_by(2).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LICENCE: &str = "// SPDX-License-Identifier: Apache-2.0\n";

    fn first_finding(file: &str, body: &str) -> Option<String> {
        findings_in(file, &format!("{LICENCE}{body}")).into_iter().next()
    }

    #[test]
    fn unfinished_words_need_an_issue() {
        for word in UNFINISHED {
            assert!(first_finding("cpp/a.h", &format!("// {word}: later")).is_some(), "{word} alone");
            assert_eq!(first_finding("cpp/a.h", &format!("// {word}(#7): later")), None, "{word} with an issue");
            assert_eq!(first_finding("cpp/a.h", &format!("int {word}_COUNT;")), None, "{word} inside a name");
        }
    }

    #[test]
    fn unsafe_code_has_its_places() {
        let block = concat!("let x = un", "safe { y };");
        assert!(first_finding("rust/core/src/a.rs", block).is_some(), "in core");
        assert_eq!(first_finding("rust/gpu/src/a.rs", block), None, "in gpu");
        assert_eq!(first_finding("rust/core/src/a.rs", "#![forbid(unsafe_code)]"), None, "the lint's name");
        assert_eq!(first_finding("rust/core/src/a.rs", &format!("// {block}")), None, "a comment");
    }

    #[test]
    fn machine_paths_are_found() {
        let root = concat!("/ro", "ot/x");
        assert!(first_finding("plugin/a.py", &format!("open('{root}')")).is_some(), "absolute");
        assert_eq!(first_finding("plugin/a.py", &format!("${{repo}}{root}")), None, "below a variable");
    }

    #[test]
    fn sources_have_a_licence_line() {
        assert_eq!(findings_in("rust/a.rs", "//! x\n"), ["rust/a.rs:1: no SPDX-License-Identifier"], "licence");
        assert_eq!(findings_in("rust/a.rs", LICENCE), Vec::<String>::new(), "with it");
        assert_eq!(findings_in("Cargo.lock", "x\n"), Vec::<String>::new(), "not a source");
    }
}
