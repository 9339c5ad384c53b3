// SPDX-License-Identifier: Apache-2.0
//! The modules of a crate: none uses one that uses it, on however long a way.
//!
//! Modules are those at the top of a crate, with all below them; an arrow is a `crate::NAME` in shipped code.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use anyhow::{Result, bail};

use super::{path, tracked_files};
use crate::places::Places;

/// Circles that are left, by crate folder. What is mended must go from here.
const KNOWN: &[(&str, &[&str])] = &[
    ("bridge", &["ffi_images", "host_file", "images"]),
    ("core", &["partition", "scene"]),
    (
        "gpu",
        &[
            "arena",
            "buffer",
            "cache_file",
            "commands",
            "device",
            "gpu",
            "heap",
            "heap_range",
            "host_view",
            "markers",
            "memory",
            "pipeline",
            "queue",
            "range",
            "recorder",
            "staging",
            "submission",
            "timer",
        ],
    ),
    ("gpu", &["report", "select"]),
    ("ptex", &["edits", "file"]),
    ("xtask", &["book", "check", "product", "system"]),
];

type Arrows = BTreeMap<String, BTreeSet<String>>;

pub(super) fn check(places: &Places) -> Result<()> {
    let mut crates: BTreeMap<String, Arrows> = BTreeMap::new();
    for file in tracked_files(places)? {
        let parts: Vec<&str> = file.split('/').collect();
        let ["rust", folder, "src", rest @ ..] = parts.as_slice() else { continue };
        let is_test = rest.iter().any(|part| part.trim_end_matches(".rs").ends_with("tests"));
        let Some(module) = rest.first().map(|name| name.trim_end_matches(".rs")) else { continue };
        if is_test || !file.ends_with(".rs") || matches!(module, "lib" | "main") {
            continue;
        }
        let Ok(text) = fs::read_to_string(path(places, &file)) else { continue };
        let arrows = crates.entry((*folder).to_owned()).or_default().entry(module.to_owned()).or_default();
        arrows.extend(used(&text).into_iter().filter(|used| used != module));
    }
    let found: BTreeSet<(String, Vec<String>)> = crates
        .iter()
        .flat_map(|(folder, arrows)| circles(arrows).into_iter().map(|circle| (folder.clone(), circle)))
        .collect();
    let owned = |names: &&[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let known: BTreeSet<(String, Vec<String>)> =
        KNOWN.iter().map(|(folder, names)| ((*folder).to_owned(), owned(names))).collect();
    let new: Vec<String> = found.difference(&known).map(|circle| format!("a circle: {circle:?}")).collect();
    let gone: Vec<String> = known.difference(&found).map(|circle| format!("no circle any more: {circle:?}")).collect();
    if !new.is_empty() || !gone.is_empty() {
        bail!("{}", [new, gone].concat().join("; "));
    }
    Ok(())
}

/// The modules that a file names, in code that is shipped.
fn used(text: &str) -> BTreeSet<String> {
    let shipped = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
    let code = shipped.lines().map(|line| line.split("//").next().unwrap_or_default());
    let named = |line: &str| -> Vec<String> {
        let name = |rest: &str| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
        line.split("crate::").skip(1).map(name).filter(|name| name.starts_with(|c: char| c.is_lowercase())).collect()
    };
    code.flat_map(named).collect()
}

/// Modules that can be reached from themselves, together with those on the way; sorted.
fn circles(arrows: &Arrows) -> BTreeSet<Vec<String>> {
    let reach = |from: &str| {
        let mut seen = BTreeSet::new();
        let mut next: Vec<&String> = arrows.get(from).into_iter().flatten().collect();
        while let Some(module) = next.pop() {
            if seen.insert(module.clone()) {
                next.extend(arrows.get(module).into_iter().flatten());
            }
        }
        seen
    };
    let all: BTreeMap<&String, BTreeSet<String>> = arrows.keys().map(|module| (module, reach(module))).collect();
    let mutual = |module: &String| -> Vec<String> {
        let there = all.get(module).into_iter().flatten();
        there.filter(|other| all.get(other).is_some_and(|back| back.contains(module))).cloned().collect()
    };
    arrows.keys().map(mutual).filter(|circle| circle.len() > 1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrows(list: &[(&str, &[&str])]) -> Arrows {
        list.iter().map(|(from, to)| ((*from).to_owned(), to.iter().map(|name| (*name).to_owned()).collect())).collect()
    }

    #[test]
    fn circles_are_found_however_long() {
        let line = arrows(&[("a", &["b", "c"]), ("b", &["c"]), ("c", &[])]);
        assert!(circles(&line).is_empty(), "a line has none");
        let circle = arrows(&[("a", &["b"]), ("b", &["c"]), ("c", &["a", "d"]), ("d", &[]), ("e", &["a"])]);
        assert_eq!(circles(&circle), BTreeSet::from([vec!["a".to_owned(), "b".to_owned(), "c".to_owned()]]));
    }

    #[test]
    fn comments_and_tests_use_nothing() {
        let text = "use crate::film::Film; // crate::job\n//! [`crate::engine`]\nfn f() { crate::measure::g() }\n\
                    use crate::NoFiles;\n#[cfg(test)]\nmod tests {\n    use crate::session::Session;\n}\n";
        assert_eq!(used(text), BTreeSet::from(["film".to_owned(), "measure".to_owned()]));
    }
}
