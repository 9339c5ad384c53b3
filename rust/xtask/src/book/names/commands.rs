// SPDX-License-Identifier: Apache-2.0
//! The commands of the clone with their flags, as their definitions have them: `cargo xtask`, `oocpt`, `usdrecord`, the
//! Python programs. Pure.
//!
//! Tasks of `cargo xtask` come from clap itself. Those of `oocpt` are read from its source, since xtask depends on
//! nothing of the product: subcommands are the variants of `enum ..Command`, flags the fields under `#[arg(long)]`.

use std::collections::{BTreeMap, BTreeSet};

use clap::Command;

use super::sources::{FileText, words};

type NameSet = BTreeSet<String>;

const CLI: &str = "rust/cli/src/";
/// `oocpt bench` is a program of its own.
const BENCH: &str = "rust/bench/src/";
/// Scenes and hosts share options with every command that makes or asks one.
const SHARED: [&str; 3] = ["rust/scenes/src/", "rust/command/src/", "plugin/texture-host"];
/// What `UsdAppUtils` adds to every usdrecord: `pxr/usdImaging/usdAppUtils/*Args.py` of OpenUSD.
const ADDED_BY_USD: &[&str] =
    &["camera", "colorCorrectionMode", "complexity", "defaultTime", "frames", "help", "renderer"];
/// Tasks of `cargo xtask` that hand their arguments on, and where those are defined.
const HANDED_ON: &[(&str, &[&str])] = &[
    ("record", &["plugin/usdrecord"]),
    ("bench", &["tests/bench/"]),
    ("gallery", &["tests/gallery/"]),
    ("reference", &["tests/reference/"]),
    ("doctor", &["rust/cli/src/doctor/"]),
];

/// A command of `oocpt`: its own subcommands, and all flags below it.
#[derive(Debug, Default)]
struct ToolCommand {
    commands: NameSet,
    flags: NameSet,
}

impl ToolCommand {
    /// `definitions`: the files that may list its subcommands; `place`: where its options are.
    fn new(definitions: &[String], place: &str, files: &[FileText]) -> Self {
        let commands = definitions.iter().flat_map(|file| subcommands(text_of(files, file))).collect();
        let [scenes, programs, host] = SHARED;
        Self { commands, flags: flags_below(&[place, scenes, programs, host], files) }
    }
}

/// All commands with their flags, without dashes.
#[derive(Debug, Default)]
pub(super) struct KnownCommands {
    tasks: BTreeMap<String, NameSet>,
    tools: BTreeMap<String, ToolCommand>,
    extreme: NameSet,
    usdrecord: NameSet,
    programs: BTreeMap<String, NameSet>,
}

impl KnownCommands {
    /// `tasks` is the command line of `cargo xtask`.
    pub(super) fn new(tasks: &Command, files: &[FileText]) -> Self {
        let below = |folders: &[&str]| flags_below(folders, files);
        let mut usdrecord = below(&["plugin/usdrecord"]);
        usdrecord.extend(ADDED_BY_USD.iter().map(|&flag| flag.to_owned()));
        let mut made = Self { extreme: below(&["tests/extreme/src/"]), ..Self::default() };
        for task in tasks.get_subcommands() {
            let mut flags: NameSet = task.get_arguments().filter_map(|a| a.get_long()).map(str::to_owned).collect();
            let handed = HANDED_ON.iter().find(|(name, _)| *name == task.get_name());
            flags.extend(handed.map_or_else(NameSet::new, |(_, folders)| below(folders)));
            if task.get_name() == "record" {
                flags.extend(usdrecord.iter().cloned());
            }
            made.tasks.insert(task.get_name().to_owned(), flags);
        }
        for name in subcommands(text_of(files, &format!("{CLI}main.rs"))) {
            let stem = format!("{CLI}{}", name.replace('-', "_"));
            let tool = ToolCommand::new(&[format!("{stem}.rs"), format!("{stem}/mod.rs")], &stem, files);
            made.tools.insert(name, tool);
        }
        made.tools.insert("bench".to_owned(), ToolCommand::new(&[format!("{BENCH}main.rs")], BENCH, files));
        // A command of the Python package alone (plugin/package/oocpt/__main__.py): usdrecord by another name.
        made.tools.insert("record".to_owned(), ToolCommand { commands: NameSet::new(), flags: usdrecord.clone() });
        let scripts = files.iter().filter(|(file, _)| file.ends_with(".py"));
        made.programs = scripts.map(|(file, text)| (file.clone(), flags(file, text).collect())).collect();
        made.usdrecord = usdrecord;
        made
    }

    /// What is wrong with a command line; nothing for programs of others.
    pub(super) fn finding(&self, line: &str) -> Option<String> {
        let line = line.split(" #").next().unwrap_or(line);
        line.split(['|', ';', '&']).find_map(|command| self.finding_in(command))
    }

    fn finding_in(&self, command: &str) -> Option<String> {
        let plain: String = command.chars().map(|c| if "\"'()[]$".contains(c) { ' ' } else { c }).collect();
        let mut words: Vec<&str> = plain.split_whitespace().collect();
        let is_set = |word: &&str| word.contains('=') && !word.starts_with('-');
        let first = words.iter().position(|word| !is_set(word) && !matches!(*word, "eval" | "export" | "nice"))?;
        words.drain(..first);
        match words.as_slice() {
            ["cargo", "xtask", task, rest @ ..] if is_name(task) => match self.tasks.get(*task) {
                Some(known) => unknown_flag(rest, known),
                None => Some(format!("cargo xtask has no task {task}")),
            },
            ["cargo", "run", rest @ ..] => self.finding_of_built(rest),
            ["oocpt" | "target/fast/oocpt", rest @ ..] => self.finding_of_tool(rest),
            ["usdrecord", rest @ ..] => unknown_flag(rest, &self.usdrecord),
            [_, script, rest @ ..] => unknown_flag(rest, self.programs.get(*script)?),
            _ => None,
        }
    }

    /// `cargo run ... -- ARGUMENTS`.
    fn finding_of_built(&self, words: &[&str]) -> Option<String> {
        let end = words.iter().position(|word| *word == "--")?;
        let (build, rest) = (&words[..end], &words[end + 1..]);
        if build.contains(&"oocpt-extreme") {
            return unknown_flag(rest, &self.extreme);
        }
        if build.contains(&"oocpt-bench") {
            return self.finding_of_tool(&[&["bench"], rest].concat());
        }
        build.contains(&"oocpt-cli").then(|| self.finding_of_tool(rest)).flatten()
    }

    fn finding_of_tool(&self, words: &[&str]) -> Option<String> {
        let (name, rest) = words.split_first().filter(|(name, _)| is_name(name))?;
        let Some(tool) = self.tools.get(*name) else {
            return Some(format!("oocpt has no command {name}"));
        };
        if let Some(sub) = rest.first().filter(|sub| is_name(sub) && !tool.commands.is_empty())
            && !tool.commands.contains(*sub)
        {
            return Some(format!("oocpt {name} has no command {sub}"));
        }
        unknown_flag(rest, &tool.flags)
    }

    /// What is wrong with flags that stand without a program: `--full`.
    pub(super) fn finding_of_flags(&self, span: &str) -> Option<String> {
        let tools = self.tools.values().map(|tool| &tool.flags);
        let known = self.tasks.values().chain(tools).chain(self.programs.values());
        let all = known.chain([&self.usdrecord, &self.extreme]).flatten().cloned().collect();
        unknown_flag(&span.split_whitespace().collect::<Vec<_>>(), &all)
    }
}

fn unknown_flag(words: &[&str], known: &NameSet) -> Option<String> {
    let flags = words.iter().filter_map(|word| word.strip_prefix("--"));
    let names = flags.map(|flag| flag.split(|c: char| !c.is_ascii_alphanumeric() && c != '-').next().unwrap_or(flag));
    names.filter(|name| !name.is_empty()).find(|name| !known.contains(*name)).map(|name| format!("no flag --{name}"))
}

/// Whether the word can be a command, and not a file or what the reader fills in.
fn is_name(word: &str) -> bool {
    !word.starts_with('-') && word.chars().all(|c| c.is_ascii_lowercase() || c == '-')
}

fn text_of<'a>(files: &'a [FileText], name: &str) -> &'a str {
    files.iter().find(|(file, _)| file == name).map_or("", |(_, text)| text)
}

/// Variants of the enumeration whose name ends with `Command`, as clap names them.
fn subcommands(text: &str) -> Vec<String> {
    let after = text.lines().skip_while(|line| !(line.contains("enum ") && line.ends_with("Command {"))).skip(1);
    let body = after.take_while(|line| *line != "}");
    let variants =
        body.filter_map(|line| line.strip_prefix("    ")).filter(|line| line.starts_with(char::is_uppercase));
    variants.filter_map(|line| words(line).first().map(|(_, name)| kebab(name))).collect()
}

/// Flags that files below these folders define.
fn flags_below(folders: &[&str], files: &[FileText]) -> NameSet {
    let is_below = |file: &str| folders.iter().any(|folder| file.starts_with(folder));
    files.iter().filter(|(file, _)| is_below(file)).flat_map(|(file, text)| flags(file, text)).collect()
}

/// Flags that a file defines, by clap or by argparse.
fn flags(file: &str, text: &str) -> impl Iterator<Item = String> {
    let found = if file.ends_with(".rs") { clap_flags(text) } else { python_flags(text) };
    found.into_iter()
}

fn clap_flags(text: &str) -> Vec<String> {
    let attributes = text.split("#[arg(").skip(1).filter_map(|rest| rest.split_once(")]\n"));
    let long = attributes.filter(|(attribute, _)| words(attribute).iter().any(|(_, word)| *word == "long"));
    let flag = |(attribute, after): (&str, &str)| {
        if let Some((_, name)) = attribute.split_once("long = \"") {
            return name.split('"').next().map(str::to_owned);
        }
        let mut lines = after.lines().map(str::trim).filter(|line| !line.starts_with(['#', '/']));
        lines.next()?.split(':').next()?.split_whitespace().last().map(kebab)
    };
    long.filter_map(flag).collect()
}

/// Literals that begin with two dashes; where flags are made from names (`f"--{name}"`) all quoted names, too.
fn python_flags(text: &str) -> Vec<String> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let literal = |rest: &str| rest.split(|c| !is_part(c)).next().unwrap_or("").to_owned();
    let mut found: Vec<String> = text.split("\"--").skip(1).map(literal).collect();
    if text.contains("f\"--{") {
        found.extend(text.split('"').filter(|part| part.chars().all(is_part)).map(str::to_owned));
        found.extend(
            words(text)
                .iter()
                .filter(|(at, word)| text[at + word.len()..].starts_with('='))
                .map(|(_, word)| (*word).to_owned()),
        );
    }
    found.retain(|flag| !flag.is_empty());
    found
}

/// `HostMemory` and `host_memory` as clap writes them: `host-memory`.
fn kebab(name: &str) -> String {
    let mut made = String::new();
    for (index, c) in name.char_indices() {
        if c.is_ascii_uppercase() && index > 0 {
            made.push('-');
        }
        made.push(if c == '_' { '-' } else { c.to_ascii_lowercase() });
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Arg;

    fn commands() -> KnownCommands {
        let tasks = Command::new("xtask")
            .subcommand(Command::new("record"))
            .subcommand(Command::new("test").arg(Arg::new("full").long("full")));
        let files = [
            ("rust/cli/src/main.rs", "enum OocptCommand {\n    /// Measures.\n    Bench(bench::Arguments),\n}\n"),
            (
                "rust/bench/src/main.rs",
                "enum Command {\n    WoodsMemory(A),\n    Island {\n        #[arg(long)]\n        out: P,\n    },\n}\n",
            ),
            (
                "rust/bench/src/island.rs",
                "    /// MiB.\n    #[arg(long, default_value_t = 0)]\n    pub(super) host_memory: u32,\n    \
                 #[arg(long = \"runs\")]\n    count: u32,\n    #[arg(short)]\n    quiet: bool,\n",
            ),
            ("tests/extreme/src/main.rs", "#[arg(long)]\nagainst: Path,\n"),
            ("plugin/usdrecord", "add(\"--imageWidth\", \"-w\")\n"),
            ("tests/scenes/forest.py", "for name in (\"width\", 3):\n    add(f\"--{name}\")\nadd(\"--seed\")\n"),
        ];
        KnownCommands::new(&tasks, &files.map(|(file, text)| (file.to_owned(), text.to_owned())))
    }

    #[test]
    fn defined_commands_pass() {
        for line in [
            "eval \"$(cargo xtask env-is-checked-below)\" || true".replace("env-is-checked-below", "test").as_str(),
            "OOCPT_REPORT=a.jsonl cargo xtask record --camera /World/Camera --imageWidth 64 a.usda a.png",
            "cargo xtask test [FILTER] [--full]",
            "cargo run --profile fast -p oocpt-cli --bin oocpt -- bench island --host-memory 3 --runs=2 --out a",
            "oocpt bench woods-memory",
            "cargo run -p oocpt-bench -- island --host-memory 3",
            "oocpt bench [NAME]",
            "cargo run -p oocpt-extreme -- --against there.json",
            "$OOCPT_USD_PYTHON tests/scenes/forest.py --width 3 --seed 1 forest.usdc",
            "usdview --renderer OocPT --anything",
            "cargo test --profile fast",
        ] {
            assert_eq!(commands().finding(line), None, "{line}");
        }
        assert_eq!(commands().finding_of_flags("--full --seed 3"), None, "flags of several programs");
    }

    #[test]
    fn unknown_commands_are_named() {
        for (line, expected) in [
            ("cargo xtask picture", "cargo xtask has no task picture"),
            ("eval \"$(cargo xtask shell)\"", "cargo xtask has no task shell"),
            ("cargo xtask test --fast", "no flag --fast"),
            ("true && cargo xtask record --imageHeight 3 a b", "no flag --imageHeight"),
            ("usdrecord --imageHeight=3 a b", "no flag --imageHeight"),
            ("oocpt benches", "oocpt has no command benches"),
            ("oocpt bench moon", "oocpt bench has no command moon"),
            ("oocpt bench island --quiet", "no flag --quiet"),
            ("cargo run -p oocpt-cli --bin oocpt -- bench island --full", "no flag --full"),
            ("cargo run -p oocpt-bench -- moon", "oocpt bench has no command moon"),
            ("cargo run -p oocpt-extreme -- --beside x", "no flag --beside"),
            ("python tests/scenes/forest.py --trees 3", "no flag --trees"),
        ] {
            assert_eq!(commands().finding(line).as_deref(), Some(expected), "{line}");
        }
        assert_eq!(commands().finding_of_flags("--fulll").as_deref(), Some("no flag --fulll"), "a flag alone");
    }
}
