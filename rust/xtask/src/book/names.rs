// SPDX-License-Identifier: Apache-2.0
//! Names in documents are those of the sources: settings, statistics, environment variables, commands with their flags,
//! files, functions, types, decisions. Pure.
//!
//! A code span is judged by its form: `oocpt:seed` is a key, `a::b` a path, `walk()` a function, `rays.glsl` a file,
//! `MeshDesc` and `mesh_keys` identifiers, `--full` a flag. Commands are judged in code spans and in `sh` blocks. Plain
//! words are not judged. A name of a library that the sources use passes, since it stands in them.

mod commands;
mod decisions;
mod sources;

use std::collections::BTreeSet;

use super::markdown::{Paragraph, code_spans, paragraphs, shell_lines};
use commands::KnownCommands;
use decisions::DecisionList;
use sources::SourceIndex;
pub(super) use sources::{FileText, is_source};

/// Pages about the past and about measurements of then: only their decisions are judged.
const RECORDS: &[&str] = &["rust/book/src/CHANGELOG.md", "rust/book/src/measurements.md"];
/// The page about other renderers, whose code has names of its own.
const OTHERS: &str = "rust/book/src/comparison.md";
/// Names of libraries by how they begin: OpenUSD's, those of image files, Vulkan's, glibc's, the standard libraries'.
/// The sources do not hold all that documents say of them.
const FOREIGN: &[&str] =
    &["Ar", "Gf", "Hd", "Hdsi", "Hio", "Imf_", "OpenImageIO_", "RTLD_", "Sdf", "Tf", "Usd", "Vk", "VK_", "std"];
/// Names that begin as those of a library and are ours.
const OURS: &[&str] = &["HdOocPT", "HdOocpt"];
/// Endings of files that the clone has.
const ENDINGS: &[&str] = &["comp", "cpp", "glsl", "h", "md", "py", "rs"];
/// Names that no source holds, and why a document has them all the same.
const ALLOWED: &[(&str, &str)] = &[
    ("--no-capture", "a flag of Rust test programs"),
    ("PtexWriter::edit", "of the Ptex library, whose files the tests have"),
    ("VmRSS", "a line of Linux's /proc/self/status"),
    ("energy_compensation", "an input of MaterialX that changes nothing here"),
    ("invisibleIds", "UsdGeomPointInstancer's; Hydra hands a mask on"),
    ("sched_autogroup_enabled", "a switch of Linux"),
    ("v3_0", "the namespace of OpenImageIO 3.0"),
];

/// Everything that names are held against.
#[derive(Debug)]
pub(super) struct KnownNames<'a> {
    sources: SourceIndex,
    commands: KnownCommands,
    decisions: DecisionList<'a>,
    files: BTreeSet<&'a str>,
}

impl<'a> KnownNames<'a> {
    /// `files` are all paths of the clone, `texts` the sources among them, `tasks` the command line of `cargo xtask`.
    pub(super) fn new(files: &'a [String], texts: &[FileText], pages: &[FileText], tasks: &clap::Command) -> Self {
        let names = files.iter().map(|file| file.rsplit('/').next().unwrap_or(file)).collect();
        let decisions = DecisionList::new(files, pages);
        Self { sources: SourceIndex::new(texts), commands: KnownCommands::new(tasks, texts), decisions, files: names }
    }

    /// One line for each name of the document that there is not.
    pub(super) fn findings(&self, file: &str, text: &str) -> Vec<String> {
        let mut found = self.decisions.findings(file, text);
        if RECORDS.contains(&file) {
            return found;
        }
        let mut say = |line: usize, what: String| found.push(format!("{file}:{line}: {what}"));
        for Paragraph { line, text } in paragraphs(text) {
            for span in code_spans(&text) {
                if let Some(what) = self.finding(span, file == OTHERS) {
                    say(line, format!("`{span}`: {what}"));
                }
            }
        }
        for (line, command) in shell_lines(text) {
            if let Some(what) = self.finding_of_command(&command) {
                say(line, format!("`{command}`: {what}"));
            }
        }
        found
    }

    /// One line for each decision that a source refers to and that there is not.
    pub(super) fn findings_in_source(&self, file: &str, text: &str) -> Vec<String> {
        self.decisions.findings(file, text)
    }

    fn finding<'s>(&self, span: &'s str, is_of_others: bool) -> Option<String> {
        let keys = span.split("oocpt:").skip(1).filter(|key| key.starts_with(|c: char| c.is_ascii_alphabetic()));
        let key = |rest: &'s str| rest.split(|c: char| !c.is_ascii_alphanumeric() && c != '*').next().unwrap_or(rest);
        if let Some(key) = keys.map(key).find(|key| !self.sources.has_key(key)) {
            return Some(format!("no setting or statistic is oocpt:{key}"));
        }
        if span.starts_with("--") && !is_allowed(span) {
            return self.commands.finding_of_flags(span);
        }
        let of_commands = self.finding_of_command(span);
        if of_commands.is_some() || is_of_others {
            return of_commands;
        }
        self.finding_of_name(span)
    }

    fn finding_of_command(&self, text: &str) -> Option<String> {
        let of_names = self.finding_of_variables(text).or_else(|| self.finding_of_packages(text));
        of_names.or_else(|| self.commands.finding(text))
    }

    /// `cargo test -p oocpt-core`: crates of the clone are named for their folders.
    fn finding_of_packages(&self, command: &str) -> Option<String> {
        let mut words = command.split_whitespace().skip_while(|word| *word != "cargo");
        let is_known = |name: &str| !name.starts_with("oocpt-") || self.sources.defines(&name.replace('-', "_"));
        while let Some(word) = words.next() {
            if matches!(word, "-p" | "--package")
                && let Some(name) = words.next().filter(|name| !is_known(name))
            {
                return Some(format!("there is no crate {name}"));
            }
        }
        None
    }

    fn finding_of_variables(&self, text: &str) -> Option<String> {
        let words = sources::words(text).into_iter().map(|(_, word)| word);
        let unknown = words.filter(|word| word.starts_with("OOCPT_")).find(|word| !self.sources.has_word(word));
        unknown.map(|word| format!("no source reads {word}"))
    }

    /// Files, paths, functions, types and other identifiers.
    fn finding_of_name(&self, span: &str) -> Option<String> {
        let (path, is_call) = span.strip_suffix("()").map_or((span, false), |path| (path, true));
        let is_plain = path.chars().all(|c| c.is_ascii_alphanumeric() || "_:.-".contains(c));
        let is_foreign = !starts_with_one(path, OURS) && starts_with_one(path, FOREIGN);
        if !is_plain || is_foreign || path.contains("NAME") || is_allowed(path) {
            return None;
        }
        if let Some((stem, ending)) = path.rsplit_once('.') {
            let is_file = !stem.is_empty() && ENDINGS.contains(&ending);
            return (is_file && !self.files.contains(path)).then(|| "there is no such file".to_owned());
        }
        if !path.split("::").all(is_identifier) {
            return None;
        }
        let mut parts = path.rsplit("::");
        let last = parts.next().unwrap_or(path);
        if is_call && !self.sources.defines_call(last) {
            return Some(format!("no source defines a function {last}"));
        }
        if let Some(owner) = parts.next() {
            let is_there = self.sources.defines(last) && (is_keyword(owner) || self.sources.defines_in(owner, last));
            return (!is_there).then(|| format!("no source defines {last} in {owner}"));
        }
        let is_known = self.sources.has_word(last) || self.sources.defines(last);
        // Serde writes the field `is_last` as `isLast`.
        let is_known = is_known || self.sources.defines(&snake(last));
        (!is_call && is_name(last) && !is_known).then(|| "no source has this name".to_owned())
    }
}

fn is_allowed(name: &str) -> bool {
    ALLOWED.iter().any(|(allowed, _)| *allowed == name)
}

fn starts_with_one(text: &str, starts: &[&str]) -> bool {
    let goes_on = |rest: &str| rest.is_empty() || rest.starts_with(|c: char| c.is_ascii_uppercase() || c == ':');
    starts.iter().any(|start| text.strip_prefix(start).is_some_and(|rest| start.ends_with('_') || goes_on(rest)))
}

/// `isLast` as Rust writes it: `is_last`.
fn snake(name: &str) -> String {
    let apart = |c: char| if c.is_ascii_uppercase() { format!("_{}", c.to_ascii_lowercase()) } else { c.to_string() };
    name.chars().map(apart).collect()
}

fn is_keyword(word: &str) -> bool {
    matches!(word, "crate" | "self" | "super" | "Self")
}

fn is_identifier(word: &str) -> bool {
    !word.is_empty()
        && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && !word.starts_with(|c: char| c.is_ascii_digit())
}

/// Whether a word is the name of something, and not a word of English: it has a `_`, or a capital after a small letter.
fn is_name(word: &str) -> bool {
    let is_hump = |pair: &[u8]| pair[0].is_ascii_lowercase() && pair[1].is_ascii_uppercase();
    word.contains('_') || word.as_bytes().windows(2).any(is_hump)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{Arg, Command};

    fn findings_of(file: &str, text: &str) -> Vec<String> {
        let sources = [
            ("rust/core/src/settings.rs", "row(\"oocpt:seed\", \"OOCPT_SEED\");\npub fn walk() {}\nstruct MeshDesc;\n"),
            ("shaders/traversal/rays.glsl", "void trace_ray(uint n) {\n"),
        ];
        let texts = sources.map(|(file, text)| (file.to_owned(), text.to_owned()));
        let files = sources.map(|(file, _)| file.to_owned());
        let tasks = Command::new("xtask").subcommand(Command::new("test").arg(Arg::new("full").long("full")));
        let names = KnownNames::new(&files, &texts, &[], &tasks);
        names.findings(file, text)
    }

    fn finding(text: &str) -> String {
        findings_of("README.md", text).join("; ")
    }

    #[test]
    fn names_that_are_there_pass() {
        let text = "`oocpt:seed` `oocpt:se*` `OOCPT_SEED=3` `walk()` `settings::walk` `MeshDesc` `trace_ray` `traceRay` `rays.glsl` \
                    `cargo xtask test --full` `--full` `std::fs::read` `UsdGeomMesh` `NAME_hit` `a word` `depth` `0.5`\n\n\
                    ```sh\ncargo xtask test \\\n    --full   # all\n```\n\n```text\ncargo xtask nothing\n```\n";
        assert_eq!(finding(text), "", "names of the sources, of libraries, and what is no name");
    }

    #[test]
    fn an_unknown_setting_is_found() {
        assert_eq!(finding("`oocpt:sed`"), "README.md:1: `oocpt:sed`: no setting or statistic is oocpt:sed");
        assert!(!finding("`float oocpt:sed = 3`").is_empty(), "as a scene sets it");
        assert!(!finding("`oocpt:x*`").is_empty(), "by its beginning");
    }

    #[test]
    fn an_unknown_variable_is_found() {
        assert_eq!(finding("`OOCPT_SED`"), "README.md:1: `OOCPT_SED`: no source reads OOCPT_SED");
        assert!(!finding("```sh\nexport OOCPT_SED=3\n```\n").is_empty(), "in a block");
    }

    #[test]
    fn an_unknown_command_and_an_unknown_flag_are_found() {
        assert_eq!(finding("`cargo xtask tests`"), "README.md:1: `cargo xtask tests`: cargo xtask has no task tests");
        assert_eq!(finding("a\n\n`--fully`"), "README.md:3: `--fully`: no flag --fully");
        let block = "```sh\n\ncargo xtask test \\\n    --fully\n```\n";
        assert_eq!(finding(block), "README.md:3: `cargo xtask test --fully`: no flag --fully", "over two lines");
    }

    #[test]
    fn an_unknown_crate_is_found() {
        let line = "`cargo test -p oocpt-cores`";
        assert_eq!(finding(line), format!("README.md:1: {line}: there is no crate oocpt-cores"), "a package of cargo");
    }

    #[test]
    fn an_unknown_file_is_found() {
        assert_eq!(finding("`ray.glsl`"), "README.md:1: `ray.glsl`: there is no such file");
    }

    #[test]
    fn an_unknown_function_path_or_type_is_found() {
        assert_eq!(finding("`run()`"), "README.md:1: `run()`: no source defines a function run");
        assert_eq!(finding("`settings::run`"), "README.md:1: `settings::run`: no source defines run in settings");
        assert_eq!(finding("`setting::walk`"), "README.md:1: `setting::walk`: no source defines walk in setting");
        assert_eq!(finding("`MeshDescs`"), "README.md:1: `MeshDescs`: no source has this name");
        assert_eq!(finding("`trace_rays`"), "README.md:1: `trace_rays`: no source has this name");
        assert!(!finding("`HdOocPTMesh`").is_empty(), "ours, although it begins as OpenUSD's");
    }

    #[test]
    fn records_and_other_renderers_may_name_what_is_gone() {
        assert_eq!(findings_of(RECORDS[0], "`oocpt:sed` `run()`"), Vec::<String>::new(), "the changelog");
        assert_eq!(findings_of(OTHERS, "`CyclesThing::run`"), Vec::<String>::new(), "code of others");
        assert!(!findings_of(OTHERS, "`oocpt:sed`").is_empty(), "our settings there");
    }
}
