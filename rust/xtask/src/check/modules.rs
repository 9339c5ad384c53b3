// SPDX-License-Identifier: Apache-2.0
//! Checks that the modules of a crate have no cycles.
//!
//! Modules are siblings at the top of a crate or in a folder, each with all below it. An arrow is a path in shipped
//! code from `crate` or `super` into another module, also to an item of it that the module around both re-exports.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use anyhow::{Result, bail};

use crate::clone_files::{path, tracked_files};
use crate::places::RootFolders;

type ModuleArrows = BTreeMap<String, BTreeSet<String>>;
/// Names of modules from the top of a crate; for paths also those of items.
type ModulePath = Vec<String>;

pub(super) fn check(places: &RootFolders) -> Result<()> {
    let files = tracked_files(places)?;
    let mut crates: BTreeMap<String, BTreeMap<ModulePath, String>> = BTreeMap::new();
    for file in files.iter().filter(|file| file.ends_with(".rs")) {
        let parts: Vec<&str> = file.split('/').collect();
        let ["rust", folder, "src", rest @ ..] = parts.as_slice() else { continue };
        if rest.iter().any(|part| part.trim_end_matches(".rs").ends_with("tests")) {
            continue;
        }
        let names =
            rest.iter().map(|name| name.trim_end_matches(".rs")).filter(|name| !matches!(*name, "mod" | "main"));
        let module: ModulePath = names.filter(|name| *name != "lib").map(str::to_owned).collect();
        let text = fs::read_to_string(path(places, file)).unwrap_or_default();
        crates.entry((*folder).to_owned()).or_default().insert(module, text);
    }
    let mut findings = Vec::new();
    for (name, modules) in &crates {
        for (folder, arrows) in arrows_of(modules) {
            let found = circles(&arrows).into_iter();
            findings.extend(
                found.map(|circle| format!("{name}: {}: {} use each other", folder.join("/"), circle.join(", "))),
            );
        }
    }
    if !findings.is_empty() {
        bail!("\n  {}", findings.join("\n  "));
    }
    Ok(())
}

/// By folder, the arrows between the modules in it.
fn arrows_of(modules: &BTreeMap<ModulePath, String>) -> BTreeMap<ModulePath, ModuleArrows> {
    let passed: BTreeMap<&ModulePath, BTreeMap<String, String>> =
        modules.iter().map(|(module, text)| (module, passed_on(text))).collect();
    let mut folders: BTreeMap<ModulePath, ModuleArrows> = BTreeMap::new();
    for (module, text) in modules {
        for used in used(text, module) {
            let depth = module.iter().zip(&used).take_while(|(own, other)| own == other).count();
            let (Some(own), Some(name)) = (module.get(depth), used.get(depth)) else { continue };
            let folder = module[..depth].to_vec();
            let around = passed.get(&folder).and_then(|items| items.get(name));
            let other = around.unwrap_or(name);
            if other != own && modules.contains_key(&[&*folder, std::slice::from_ref(other)].concat()) {
                folders.entry(folder).or_default().entry(own.clone()).or_default().insert(other.clone());
            }
        }
    }
    folders
}

/// The paths, from the top of the crate, that a file uses in shipped code: from `crate` or `super`, alone or in a
/// group. `module`: the names of the modules around its code.
fn used(text: &str, module: &ModulePath) -> BTreeSet<ModulePath> {
    let code: String = shipped(text).into_iter().map(|line| line.split("//").next().unwrap_or_default()).collect();
    let mut named = BTreeSet::new();
    for (at, _) in code.match_indices("crate::") {
        named.extend(paths(&code[at + "crate::".len()..]).0);
    }
    for (at, _) in code.match_indices("super::") {
        // Only the first of a chain of `super` counts, and its length.
        if code[..at].ends_with("super::") {
            continue;
        }
        let rest = code[at..].trim_start_matches("super::");
        let chain = (code.len() - at - rest.len()) / "super::".len();
        if let Some(above) = module.len().checked_sub(chain) {
            named.extend(paths(rest).0.into_iter().map(|path| [&module[..above], &path].concat()));
        }
    }
    named
}

/// The lines of a file without its modules of tests: the code below them ships. A module with a body ends at the first
/// line that is the brace at its own indentation, as rustfmt lays code out.
pub(super) fn shipped(text: &str) -> Vec<&str> {
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

/// Returns true if a line begins a module.
fn is_module(line: &str) -> bool {
    let words: Vec<&str> = line.split_whitespace().collect();
    matches!(words.as_slice(), ["mod", ..] | ["pub" | "pub(crate)" | "pub(super)", "mod", ..])
}

/// The paths at the beginning of a text, several if there is a group in braces, and their length in bytes.
fn paths(text: &str) -> (Vec<ModulePath>, usize) {
    let start = text.len() - text.trim_start().len();
    let rest = &text[start..];
    if !rest.starts_with('{') {
        let length = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        let (name, after) = rest.split_at(length);
        let Some(below) = after.strip_prefix("::").filter(|_| length > 0) else {
            return (vec![Vec::from_iter((length > 0).then(|| name.to_owned()))], start + length);
        };
        let (below, taken) = paths(below);
        let whole = below.into_iter().map(|path| [vec![name.to_owned()], path].concat()).collect();
        return (whole, start + length + 2 + taken);
    }
    let (mut all, mut at) = (Vec::new(), 1);
    while at < rest.len() && !rest[at..].starts_with('}') {
        let (some, taken) = paths(&rest[at..]);
        all.extend(some);
        at += taken;
        // Skips `as` and a name, and a comma.
        at += rest[at..].find([',', '}']).unwrap_or(rest.len() - at);
        at += usize::from(rest[at..].starts_with(','));
        at += rest[at..].len() - rest[at..].trim_start().len();
    }
    (all, start + (at + 1).min(rest.len()))
}

/// Items that a module re-exports from those below it: `pub use below::{Item, ..}`.
fn passed_on(text: &str) -> BTreeMap<String, String> {
    let code: String = shipped(text).into_iter().map(|line| line.split("//").next().unwrap_or_default()).collect();
    let mut items = BTreeMap::new();
    for (at, _) in code.match_indices("use ") {
        let is_public = code[..at].trim_end().ends_with("pub") || code[..at].trim_end().ends_with(')');
        let (named, _) = paths(&code[at + "use ".len()..]);
        for path in named.into_iter().filter(|_| is_public) {
            if let [module, .., item] = path.as_slice()
                && !matches!(module.as_str(), "crate" | "super" | "self")
            {
                items.insert(item.clone(), module.clone());
            }
        }
    }
    items
}

/// Modules that can be reached from themselves, together with those on the way; sorted.
fn circles(arrows: &ModuleArrows) -> BTreeSet<Vec<String>> {
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

    fn arrows(list: &[(&str, &[&str])]) -> ModuleArrows {
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

    fn owned(list: &[&str]) -> ModulePath {
        list.iter().map(|name| (*name).to_owned()).collect()
    }

    /// The first names of the paths that a file uses.
    fn heads(text: &str, module: &[&str]) -> BTreeSet<String> {
        used(text, &owned(module)).into_iter().filter_map(|path| path.into_iter().next()).collect()
    }

    #[test]
    fn comments_and_tests_use_nothing() {
        let text = "use crate::film::Film; // crate::job\n//! [`crate::engine`]\nfn f() { crate::measure::g() }\n\
                    #[cfg(test)]\nmod tests {\n    use crate::session::Session;\n}\n";
        assert_eq!(heads(text, &["wave"]), names(&["film", "measure"]));
    }

    #[test]
    fn code_below_a_module_of_tests_counts() {
        let of = |tests: &str| {
            let text = format!("use crate::film::Film;\n{tests}\nuse crate::session::Session;\n");
            heads(&text, &["wave"])
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
        assert_eq!(heads(text, &["engine", "feed"]), names(&["engine", "film", "lights", "measure", "wave"]));
        let all = used(text, &owned(&["engine", "feed"]));
        for path in [&["film", "Film"][..], &["film", "job", "Job"], &["lights"], &["engine", "near"]] {
            assert!(all.contains(&owned(path)), "{path:?} in {all:?}");
        }
    }

    #[test]
    fn reexports_count_for_their_module_in_crates_and_folders() {
        let top = "mod a;\npub use a::{One, two};\npub use b::below::Three;\npub(crate) use c::Four;\n";
        let text = "use crate::{One, Three};\nfn f() { crate::two(); crate::Four::new() }\n";
        let below = |folder: &[&str]| {
            let at = |name: &str| [&owned(folder)[..], &owned(&[name])].concat();
            let text = text.replace("crate::", if folder.is_empty() { "crate::" } else { "super::" });
            let files = [(owned(folder), top.to_owned()), (at("d"), text)];
            let empty = ["a", "b", "c"].map(|name| (at(name), String::new()));
            arrows_of(&files.into_iter().chain(empty).collect())
        };
        for folder in [&[][..], &["x"], &["x", "y"]] {
            assert_eq!(below(folder)[&owned(folder)]["d"], names(&["a", "b", "c"]), "{folder:?}");
        }
    }

    #[test]
    fn arrows_go_between_modules_that_stand_beside_each_other() {
        let files = [
            (&["x", "a"][..], "use super::b::B;\nuse crate::y::Y;"),
            (&["x", "b", "deep"], "use super::super::a::A;\nuse crate::x::c::C;"),
            (&["x", "b"], ""),
            (&["x", "c"], ""),
            (&["y"], "use crate::x::a::A;"),
        ];
        let found = arrows_of(&files.into_iter().map(|(module, text)| (owned(module), text.to_owned())).collect());
        assert_eq!(found[&owned(&["x"])], arrows(&[("a", &["b"]), ("b", &["a", "c"])]));
        assert_eq!(found[&owned(&[])], arrows(&[("x", &["y"])]), "`x` has no file of its own, so none goes there");
    }
}
