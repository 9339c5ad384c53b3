// SPDX-License-Identifier: Apache-2.0
//! The modules of a crate: none uses one that uses it, on however long a way.
//!
//! Modules are those at the top of a crate, with all below them. An arrow is a path in shipped code from `crate` or
//! `super` into another module, also to an item of it that the top of the crate passes on.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use anyhow::{Result, bail};

use crate::clone_files::{path, tracked_files};
use crate::places::Places;

type Arrows = BTreeMap<String, BTreeSet<String>>;

pub(super) fn check(places: &Places) -> Result<()> {
    let files = tracked_files(places)?;
    let read = |file: &str| fs::read_to_string(path(places, file)).unwrap_or_default();
    let mut crates: BTreeMap<String, Arrows> = BTreeMap::new();
    let mut tops: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
    for file in &files {
        let parts: Vec<&str> = file.split('/').collect();
        let ["rust", folder, "src", rest @ ..] = parts.as_slice() else { continue };
        let is_test = rest.iter().any(|part| part.trim_end_matches(".rs").ends_with("tests"));
        let place: Vec<&str> = rest.iter().map(|name| name.trim_end_matches(".rs")).filter(|n| *n != "mod").collect();
        let Some(module) = place.first().filter(|_| !is_test && file.ends_with(".rs")) else { continue };
        if matches!(*module, "lib" | "main") {
            continue;
        }
        let top =
            tops.entry((*folder).to_owned()).or_insert_with(|| passed_on(&read(&format!("rust/{folder}/src/lib.rs"))));
        let arrows = crates.entry((*folder).to_owned()).or_default().entry((*module).to_owned()).or_default();
        arrows.extend(used(&read(file), &place, top).into_iter().filter(|used| used != module));
    }
    for arrows in crates.values_mut() {
        let modules: BTreeSet<String> = arrows.keys().cloned().collect();
        arrows.values_mut().for_each(|used| used.retain(|name| modules.contains(name)));
    }
    let found: BTreeSet<(String, Vec<String>)> = crates
        .iter()
        .flat_map(|(folder, arrows)| circles(arrows).into_iter().map(|circle| (folder.clone(), circle)))
        .collect();
    if !found.is_empty() {
        bail!("modules that use each other: {found:?}");
    }
    Ok(())
}

/// The modules that a file at `place` (the names of the modules around its code, from the top) names in shipped code:
/// by a path from `crate` or `super`, alone or in a group, or by an item that the top of the crate passes on.
fn used(text: &str, place: &[&str], passed_on: &BTreeMap<String, String>) -> BTreeSet<String> {
    let code: String = shipped(text).into_iter().map(|line| line.split("//").next().unwrap_or_default()).collect();
    let mut named = BTreeSet::new();
    for (at, _) in code.match_indices("crate::") {
        heads(&code[at + "crate::".len()..], &mut named);
    }
    for (at, _) in code.match_indices("super::") {
        // Of a chain only the first one, and how long it is.
        if code[..at].ends_with("super::") {
            continue;
        }
        let rest = code[at..].trim_start_matches("super::");
        let chain = (code.len() - at - rest.len()) / "super::".len();
        if chain == place.len() {
            heads(rest, &mut named);
        }
    }
    named.into_iter().map(|name| passed_on.get(&name).cloned().unwrap_or(name)).collect()
}

/// The lines of a file without its modules of tests: what is below them ships. A module with a body ends at the first
/// line that is the brace at its own indentation, as rustfmt lays code out.
fn shipped(text: &str) -> Vec<&str> {
    let mut kept = Vec::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        kept.push(line);
        let code = line.trim_start();
        if !(code.starts_with("#[cfg(test)]") || code.starts_with("#[cfg(all(test,")) {
            continue;
        }
        let indentation = &line[..line.len() - code.len()];
        let Some(item) = lines.next() else { break };
        if !is_module(item) {
            kept.push(item);
        } else if item.ends_with('{') {
            lines.by_ref().find(|line| line.strip_prefix(indentation) == Some("}"));
        }
    }
    kept
}

/// Whether a line begins a module.
fn is_module(line: &str) -> bool {
    let words: Vec<&str> = line.split_whitespace().collect();
    matches!(words.as_slice(), ["mod", ..] | ["pub" | "pub(crate)" | "pub(super)", "mod", ..])
}

/// The first names of a path, or of the paths of a group in braces.
fn heads(path: &str, into: &mut BTreeSet<String>) {
    let name = |rest: &str| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let Some(group) = path.strip_prefix('{') else {
        into.insert(name(path));
        return;
    };
    let (mut depth, mut is_first) = (0_u32, true);
    for (at, letter) in group.char_indices() {
        match letter {
            '}' if depth == 0 => return,
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => is_first = true,
            letter if is_first && !letter.is_whitespace() => {
                into.insert(name(&group[at..]));
                is_first = false;
            }
            _ => {}
        }
    }
}

/// Items that the top of a crate takes from its modules, with these modules: `pub use module::{Item, ..}`.
fn passed_on(top: &str) -> BTreeMap<String, String> {
    let code: String = top.lines().map(|line| line.split("//").next().unwrap_or_default()).collect();
    let mut items = BTreeMap::new();
    for statement in code.split("use ").skip(1) {
        let path: String = statement.split(';').next().unwrap_or_default().split_whitespace().collect();
        let Some((module, rest)) = path.split_once("::") else { continue };
        // Without the modules below: `module::below::Item`.
        let items_at = rest.find('{').or_else(|| rest.rfind("::").map(|at| at + 2)).unwrap_or(0);
        let mut names = BTreeSet::new();
        heads(&rest[items_at..], &mut names);
        items.extend(names.into_iter().map(|name| (name, module.to_owned())));
    }
    items
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
    fn module_cycles_of_any_length_are_found() {
        let line = arrows(&[("a", &["b", "c"]), ("b", &["c"]), ("c", &[])]);
        assert!(circles(&line).is_empty(), "a line has none");
        let circle = arrows(&[("a", &["b"]), ("b", &["c"]), ("c", &["a", "d"]), ("d", &[]), ("e", &["a"])]);
        assert_eq!(circles(&circle), BTreeSet::from([vec!["a".to_owned(), "b".to_owned(), "c".to_owned()]]));
    }

    fn names(list: &[&str]) -> BTreeSet<String> {
        list.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn comments_and_tests_use_nothing() {
        let text = "use crate::film::Film; // crate::job\n//! [`crate::engine`]\nfn f() { crate::measure::g() }\n\
                    #[cfg(test)]\nmod tests {\n    use crate::session::Session;\n}\n";
        assert_eq!(used(text, &["wave"], &BTreeMap::new()), names(&["film", "measure"]));
    }

    #[test]
    fn code_below_a_module_of_tests_counts() {
        let of = |tests: &str| {
            let text = format!("use crate::film::Film;\n{tests}\nuse crate::session::Session;\n");
            used(&text, &["wave"], &BTreeMap::new())
        };
        let found = names(&["film", "session"]);
        for tests in [
            "#[cfg(test)]\nmod tests;",
            "#[cfg(test)]\npub(super) mod tests;",
            "#[cfg(test)]\nmod tests {\n    fn f() {\n        crate::job::g();\n    }\n}",
            "#[cfg(all(test, unix))]\nmod tests {\n    use crate::job::Job;\n}",
            "mod below {\n    #[cfg(test)]\n    mod tests {\n        use crate::job::Job;\n    }\n}",
        ] {
            assert_eq!(of(tests), found, "{tests}");
        }
        let helper = of("#[cfg(test)]\nuse crate::job::Job;");
        assert_eq!(helper, names(&["film", "job", "session"]), "a single item of tests counts as shipped");
    }

    #[test]
    fn grouped_and_super_paths_count() {
        let text = "use crate::{\n    film::{Film, job::Job},\n    lights,\n};\nuse super::super::wave::Wave;\n\
                    use super::near;\nfn f(x: super::super::measure::Row) { super::super::super::none() }\n";
        assert_eq!(used(text, &["engine", "feed"], &BTreeMap::new()), names(&["film", "lights", "wave", "measure"]));
    }

    #[test]
    fn reexports_of_the_crate_root_count_for_their_module() {
        let top = passed_on("mod a;\npub use a::{One, two};\npub use b::below::Three;\npub use c::Four;\n");
        let text = "use crate::{One, Three};\nfn f() { crate::two(); crate::Four::new() }\n";
        assert_eq!(used(text, &["d"], &top), names(&["a", "b", "c"]));
    }
}
