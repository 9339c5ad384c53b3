// SPDX-License-Identifier: Apache-2.0
//! Checks that the names of types in shipped code are clear without their module: few have one word, and none is used
//! for more than two types.
//!
//! Read from the text as rustfmt lays it out. Associated types and types of other languages are not counted.

use std::collections::BTreeMap;
use std::fs;

use anyhow::{Result, bail};

use super::modules::shipped;
use crate::clone_files::{path, tracked_files};
use crate::places::RootFolders;

/// Number of names of one word in shipped code. It may only fall.
const ONE_WORD_NAMES: usize = 91;
/// Names that modules give to types of their own, each for the same purpose.
const BY_MODULE: &[&str] = &["Arguments", "Error", "Row"];
/// Other names of more than two types, with their numbers, which should fall.
const KNOWN: &[(&str, usize)] = &[];

pub(super) fn check(places: &RootFolders) -> Result<()> {
    let mut files_of: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for file in tracked_files(places)?.into_iter().filter(|file| is_shipped(file)) {
        let text = fs::read_to_string(path(places, &file)).unwrap_or_default();
        for name in type_names(&text) {
            files_of.entry(name).or_default().push(file.clone());
        }
    }
    let findings = findings(&files_of, ONE_WORD_NAMES, KNOWN);
    if !findings.is_empty() {
        bail!("\n  {}", findings.join("\n  "));
    }
    Ok(())
}

/// Returns true if a file is Rust code of a crate, and not of its tests.
fn is_shipped(file: &str) -> bool {
    let parts: Vec<&str> = file.split('/').collect();
    match parts.as_slice() {
        ["rust", _, "src", rest @ ..] => {
            file.ends_with(".rs") && !rest.iter().any(|part| part.trim_end_matches(".rs").ends_with("tests"))
        }
        _ => false,
    }
}

fn findings(files_of: &BTreeMap<String, Vec<String>>, limit: usize, known: &[(&str, usize)]) -> Vec<String> {
    let mut findings = Vec::new();
    let is_one_word = |name: &&String| name.chars().skip(1).all(|c| !c.is_ascii_uppercase());
    let one_word: Vec<&String> = files_of.keys().filter(is_one_word).collect();
    let count = one_word.iter().map(|name| files_of[*name].len()).sum::<usize>();
    let all = files_of.values().map(Vec::len).sum::<usize>();
    if count > limit {
        let names = one_word.iter().map(|name| name.as_str()).collect::<Vec<_>>().join(", ");
        findings.push(format!(
            "{count} of {all} types have names of one word, at most {limit} may (a number that only falls): {names}"
        ));
    } else if count < limit {
        findings.push(format!("{count} types have names of one word: lower ONE_WORD_NAMES from {limit}"));
    }
    for (name, files) in files_of.iter().filter(|(name, _)| !BY_MODULE.contains(&name.as_str())) {
        let most = known.iter().find(|(known, _)| known == name).map_or(2, |(_, most)| *most);
        if files.len() > most {
            findings.push(format!("{name} names {} types, at most {most} may: {}", files.len(), files.join(", ")));
        }
    }
    let fewer = known.iter().filter(|(name, most)| files_of.get(*name).is_none_or(|files| files.len() < *most));
    findings.extend(fewer.map(|(name, most)| format!("{name} names fewer than {most} types: lower its row of KNOWN")));
    findings
}

/// Names of structs, unions, enumerations, traits and type aliases in shipped code.
fn type_names(text: &str) -> Vec<String> {
    shipped(text).into_iter().filter_map(type_name).collect()
}

fn type_name(line: &str) -> Option<String> {
    let is_indented = line.starts_with(' ');
    let mut words = line.split_whitespace().peekable();
    words.next_if(|word| *word == "pub" || word.starts_with("pub("));
    // `pub(in path)` is two words.
    words.next_if(|word| word.ends_with(')') && !word.contains('('));
    words.next_if(|word| *word == "unsafe");
    let keyword = words.next()?;
    let is_type = matches!(keyword, "struct" | "union" | "enum" | "trait") || keyword == "type" && !is_indented;
    let name = words.next().filter(|_| is_type)?;
    let end = name.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(name.len());
    name.starts_with(|c: char| c.is_ascii_uppercase()).then(|| name[..end].to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(list: &[(&str, usize)]) -> BTreeMap<String, Vec<String>> {
        list.iter().map(|(name, count)| ((*name).to_owned(), vec!["a.rs".to_owned(); *count])).collect()
    }

    #[test]
    fn types_of_shipped_code_are_found() {
        let text = "pub struct One<T> {\n    type_of: u8,\n}\npub(crate) enum TwoWords {\n}\n\
                    pub(in crate::x) trait Three: Sized {\n    type Associated;\n}\ntype Four<'a> = &'a str;\n\
                    mod inner {\n    struct Five(u8);\n    type Foreign;\n}\nunion Six {}\nunsafe trait Seven {}\n\
                    // struct Comment\nstruct $name;\n#[cfg(test)]\nmod tests {\n    struct Test;\n}\n";
        assert_eq!(type_names(text), ["One", "TwoWords", "Three", "Four", "Five", "Six", "Seven"]);
    }

    #[test]
    fn more_names_of_one_word_than_may_be_are_told() {
        let files = files(&[("Bvh4", 1), ("Level", 2), ("MipLevel", 2), ("V3", 1)]);
        assert!(findings(&files, 4, &[]).is_empty(), "just as many");
        let above = findings(&files, 3, &[]);
        assert_eq!(above.len(), 1, "{above:?}");
        assert!(above[0].starts_with("4 of 6 types") && above[0].ends_with("Bvh4, Level, V3"), "{above:?}");
        assert_eq!(findings(&files, 5, &[]), ["4 types have names of one word: lower ONE_WORD_NAMES from 5"]);
    }

    #[test]
    fn a_name_of_three_types_is_told_unless_modules_share_it() {
        let files = files(&[("HeapState", 3), ("MeshLayout", 2), ("Row", 5)]);
        let found = findings(&files, 5, &[]);
        assert_eq!(found, ["HeapState names 3 types, at most 2 may: a.rs, a.rs, a.rs"]);
        assert!(findings(&files, 5, &[("HeapState", 3)]).is_empty(), "a known one");
        let fewer = findings(&files, 5, &[("HeapState", 4)]);
        assert_eq!(fewer, ["HeapState names fewer than 4 types: lower its row of KNOWN"]);
    }

    #[test]
    fn tests_do_not_ship() {
        assert!(is_shipped("rust/core/src/mesh/bvh.rs"));
        for file in ["rust/core/src/mesh/tests.rs", "rust/core/src/tests/mesh.rs", "rust/core/tests/all/mesh.rs"] {
            assert!(!is_shipped(file), "{file}");
        }
        assert!(!is_shipped("rust/book/src/glossary.md"));
    }
}
