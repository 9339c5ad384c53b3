// SPDX-License-Identifier: Apache-2.0
//! Groups of Rust tests: a program that cargo built, or a module of one.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context as _, Result};
use serde_json::Value;

use super::{TestExtent, TestGroup};
use crate::places::RootFolders;
use crate::process::capture;
use crate::shell;

/// Programs that run by modules, since all of one would take longer than everything else: crate and target.
const BY_MODULE: [(&str, &str); 1] = [("render", "gpu")];
/// Submodules in groups of their own: they differ from the rest, or are as long as all of it.
const APART: [&str; 1] = ["streaming::roulette"];
/// Crates whose tests open a device.
const WITH_DEVICE: [&str; 7] = ["bench", "bridge", "extreme", "gpu", "judge", "render", "traverse"];
/// Groups that ask whether the order in which threads of the device get on shows. In all others Mesa's software driver
/// works on the thread that submits, which spares it waking its threads for each of hundreds of passes over few paths.
const THREADED: [&str; 10] = [
    "gpu all",
    "gpu growth",
    "gpu unit",
    "render control",
    "render determinism",
    "render edits",
    "render failures",
    "render passes",
    "render sample_counts",
    "render streaming",
];
/// Groups in which Mesa's software driver translates passes for most of the time and runs each on few rays: it does not
/// optimise their code, which halves that time. Elsewhere slower code costs more than this saves.
const MOSTLY_TRANSLATED: [&str; 3] = ["extreme table", "render features", "render materials"];
/// Groups of a minute or more.
const LONG: [&str; 12] = [
    "extreme table",
    "ptex all",
    "render bsdf",
    "render features",
    "render lights",
    "render materials",
    "render streaming",
    "render streaming::roulette",
    "render textures",
    "render unit",
    "shaders all",
    "traverse all",
];

/// A program of tests.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TestProgram {
    /// Folder of the crate, without the path to it: a crate's tests run in it.
    package: String,
    folder: PathBuf,
    /// Name of the test target; "unit" for the tests inside a crate.
    target: String,
    executable: PathBuf,
}

impl TestProgram {
    /// The test program in one of cargo's messages (`--message-format json`), if it has one.
    pub(super) fn of_message(line: &str) -> Option<Self> {
        let message: Value = serde_json::from_str(line).ok()?;
        let executable = PathBuf::from(message["executable"].as_str().filter(|_| message["profile"]["test"] == true)?);
        let folder = PathBuf::from(message["manifest_path"].as_str()?).parent()?.to_path_buf();
        let package = folder.file_name()?.to_string_lossy().into_owned();
        let is_test = message["target"]["kind"].as_array().is_some_and(|kinds| kinds.iter().any(|kind| kind == "test"));
        let target = if is_test { message["target"]["name"].as_str()? } else { "unit" }.to_owned();
        Some(Self { package, folder, target, executable })
    }

    fn opens_a_device(&self) -> bool {
        WITH_DEVICE.contains(&self.package.as_str())
    }

    fn runs_by_module(&self) -> bool {
        BY_MODULE.contains(&(&self.package, &self.target))
    }

    fn command(&self, places: &RootFolders, extent: TestExtent<'_>) -> Command {
        let mut command = Command::new(&self.executable);
        command.current_dir(&self.folder).env("CARGO_MANIFEST_DIR", &self.folder);
        shell::apply(&shell::for_wheel(places), &mut command);
        extent.tell(&mut command);
        command
    }
}

/// The groups of an extent.
///
/// # Errors
/// If a program cannot list its tests.
pub(super) fn of_programs(
    places: &RootFolders,
    programs: &[TestProgram],
    extent: TestExtent<'_>,
    has_gpu: bool,
) -> Result<Vec<TestGroup>> {
    let mut groups = Vec::new();
    for program in programs {
        let mut list = program.command(places, extent);
        let list = capture(list.args(["--list", "--format", "terse"]))
            .with_context(|| format!("{} of {} does not list its tests", program.target, program.package))?;
        for (name, tests) in dealt(program, &list, extent.filter) {
            let mut command = program.command(places, extent);
            // Tests run one at a time, so that each line belongs to a known test, and its time is known.
            command.args(["--exact", "--test-threads=1"]).args(tests);
            if !has_gpu && program.opens_a_device() && !THREADED.contains(&name.as_str()) {
                command.env("LP_NUM_THREADS", "0");
            }
            if !has_gpu && MOSTLY_TRANSLATED.contains(&name.as_str()) {
                command.env("GALLIVM_PERF", "nopt");
            }
            let is_long = LONG.contains(&name.as_str());
            groups.push(TestGroup { name, command, passes: |status| status == 0, is_long });
        }
    }
    Ok(groups)
}

/// Groups and their tests, from a list in libtest's format.
fn dealt(program: &TestProgram, list: &str, filter: Option<&str>) -> BTreeMap<String, Vec<String>> {
    let mut dealt: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let tests = list.lines().filter_map(|line| line.strip_suffix(": test"));
    for test in tests.filter(|test| filter.is_none_or(|part| test.contains(part))) {
        let is_in = |module: &&&str| test.strip_prefix(**module).is_some_and(|rest| rest.starts_with("::"));
        let part = if program.runs_by_module() {
            APART.iter().find(is_in).copied().unwrap_or_else(|| test.split("::").next().unwrap_or(test))
        } else {
            &program.target
        };
        dealt.entry(format!("{} {part}", program.package)).or_default().push(test.to_owned());
    }
    dealt
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const LIST: &str = "a::one: test\nstreaming::roulette::x: test\nstreaming::y: test\nb::one: test\nb::two: test\n\
                        streaming::roulettes::z: test\n0 benchmarks\nalone: test\n";

    fn program(package: &str, target: &str) -> TestProgram {
        let [package, target] = [package, target].map(str::to_owned);
        TestProgram { package, target, folder: "/r".into(), executable: "/t".into() }
    }

    fn counts(dealt: &BTreeMap<String, Vec<String>>) -> Vec<(&str, usize)> {
        dealt.iter().map(|(name, tests)| (name.as_str(), tests.len())).collect()
    }

    #[test]
    fn every_test_is_in_one_group() {
        let by_module = dealt(&program("render", "gpu"), LIST, None);
        let expected = [("render a", 1), ("render alone", 1), ("render b", 2), ("render streaming", 2)];
        assert_eq!(counts(&by_module)[..4], expected);
        assert_eq!(counts(&by_module)[4..], [("render streaming::roulette", 1)]);
        let whole = dealt(&program("core", "all"), LIST, None);
        assert_eq!(counts(&whole), [("core all", 7)]);
        for dealt in [by_module, whole] {
            let mut all: Vec<String> = dealt.into_values().flatten().collect();
            all.sort();
            let mut listed: Vec<&str> = LIST.lines().filter_map(|line| line.strip_suffix(": test")).collect();
            listed.sort_unstable();
            assert_eq!(all, listed, "each once");
        }
    }

    #[test]
    fn a_filter_is_a_part_of_a_name() {
        let of = |filter| dealt(&program("render", "gpu"), LIST, Some(filter));
        assert_eq!(of("b::t"), BTreeMap::from([("render b".into(), vec!["b::two".into()])]));
        assert!(of("nothing").is_empty(), "then no process is started");
    }

    #[test]
    fn cargo_tells_of_programs_with_tests() {
        let message = |test: bool, kind: &str| {
            format!(
                r#"{{"reason":"compiler-artifact","manifest_path":"/r/rust/core/Cargo.toml","executable":"/t/all-1",
                "target":{{"name":"all","kind":["{kind}"]}},"profile":{{"test":{test}}}}}"#
            )
            .replace('\n', "")
        };
        let program = TestProgram::of_message(&message(true, "test")).unwrap();
        assert_eq!((program.package.as_str(), program.target.as_str()), ("core", "all"));
        assert_eq!((program.folder, program.executable), ("/r/rust/core".into(), "/t/all-1".into()));
        assert_eq!(TestProgram::of_message(&message(true, "lib")).unwrap().target, "unit");
        assert_eq!(TestProgram::of_message(&message(false, "bin")), None, "a program, but not of tests");
        assert_eq!(TestProgram::of_message("   Compiling core"), None);
    }

    #[test]
    fn groups_that_are_named_here_exist() {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let exists = |path: &str| Path::new(root).join(path).exists();
        for name in THREADED.iter().chain(&LONG).chain(&MOSTLY_TRANSLATED) {
            let (package, part) = name.split_once(' ').unwrap();
            let folder = if exists(&format!("rust/{package}")) { "rust" } else { "tests" };
            let folder = format!("{folder}/{package}");
            let file = if part == "unit" {
                "src/lib.rs".to_owned()
            } else if BY_MODULE.iter().any(|(crate_name, target)| *crate_name == package && *target != part) {
                format!("tests/gpu/{}", part.replace("::", "/"))
            } else {
                format!("tests/{part}")
            };
            let file = format!("{folder}/{file}");
            let places = [file.clone(), format!("{file}.rs"), format!("{file}/main.rs")];
            assert!(places.iter().any(|place| exists(place)), "{name}: no {file}");
        }
        for module in APART {
            let path = format!("rust/render/tests/gpu/{}", module.replace("::", "/"));
            assert!(exists(&path) || exists(&format!("{path}.rs")), "{path}");
        }
        for package in WITH_DEVICE {
            assert!(exists(&format!("rust/{package}")) || exists(&format!("tests/{package}")), "{package}");
        }
    }
}
