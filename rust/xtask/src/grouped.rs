// SPDX-License-Identifier: Apache-2.0
//! Tests with a device, a module of them in one process.
//!
//! nextest starts a process for every test. Each would open a device and have Mesa's software driver translate its
//! passes anew: two thirds of what the renderer's tests cost. Modules share both, and a fault that only the second
//! scene of a process shows has a chance to be seen. A test that crashes or hangs ends its module, named on its last
//! line.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};
use serde_json::Value;

use crate::places::Places;
use crate::process::{capture, say};
use crate::product::{PROFILE, cargo};
use crate::watched::Watched;

/// The test binary of `oocpt-render`.
const BINARY: &str = "gpu";
/// Modules that ask whether the order in which threads of the device get on shows; elsewhere Mesa's software renderer
/// works on the thread that submits, which spares it waking its threads for each of hundreds of passes over few paths.
const THREADED: [&str; 7] = ["control", "sample_counts", "determinism", "edits", "failures", "passes", "streaming"];
/// Submodules in processes of their own: they differ from the rest, or are as long as all of it.
const APART: [&str; 1] = ["streaming::roulette"];
/// Begun first, so that none of them is left alone with one core at the end; then by how many tests they have.
const LONGEST: [&str; 4] = ["streaming", "bsdf", "materials", "features"];
/// Without a word for so long, a test hangs.
const PATIENCE: Duration = Duration::from_secs(1200);

/// What runs in one process.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Group {
    module: String,
    tests: Vec<String>,
}

impl Group {
    fn is_threaded(&self) -> bool {
        THREADED.contains(&self.module.as_str())
    }

    fn command(&self, places: &Places, binary: &Path, has_gpu: bool) -> Command {
        let mut command = Command::new(binary);
        command.current_dir(places.repo.join("rust/render")).args(["--exact", "--test-threads=1"]).args(&self.tests);
        if !has_gpu && !self.is_threaded() {
            command.env("LP_NUM_THREADS", "0");
        }
        command
    }
}

/// Runs those whose name contains `filter`, as many groups at a time as `has_gpu` allows; `apply` prepares a command.
/// Every group runs, even if another failed.
///
/// # Errors
/// If the binary cannot be found or started.
pub(crate) fn run(
    places: &Places,
    filter: Option<&str>,
    has_gpu: bool,
    apply: impl Fn(&mut Command) + Sync,
) -> Result<bool> {
    let binary = binary(places)?;
    let mut list = Command::new(&binary);
    apply(&mut list);
    let groups = groups(&capture(list.args(["--list", "--format", "terse"]))?, filter);
    let waiting = Mutex::new(groups.into_iter());
    let next = || waiting.lock().unwrap_or_else(PoisonError::into_inner).next();
    let work = || -> Result<bool> {
        let mut all_pass = true;
        while let Some(group) = next() {
            let started = Instant::now();
            let mut command = group.command(places, &binary, has_gpu);
            apply(&mut command);
            let passes = Watched { patience: Some(PATIENCE), ..Watched::default() }.status(&mut command)? == 0;
            let (count, seconds) = (group.tests.len(), started.elapsed().as_secs());
            let ending = if passes { "passed" } else { "FAILED" };
            say(format_args!("{BINARY} {}: {count} tests, {seconds} s, {ending}", group.module));
            all_pass &= passes;
        }
        Ok(all_pass)
    };
    // Two on one GPU would share its memory.
    let workers = if has_gpu { 1 } else { 2 };
    thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let ended = workers.into_iter().map(|worker| worker.join().unwrap_or_else(|_| anyhow::bail!("a thread ended")));
        ended.collect::<Vec<_>>().into_iter().try_fold(true, |all, passes| Ok(all & passes?))
    })
}

/// The binary that cargo has built, or builds now.
fn binary(places: &Places) -> Result<PathBuf> {
    let mut build = cargo(places, "test");
    build.args(["--workspace", "--no-run", "--test", BINARY, "--profile", PROFILE, "--message-format", "json"]);
    let messages = capture(&mut build)?;
    let executable = |line: &str| -> Option<PathBuf> {
        let message: Value = serde_json::from_str(line).ok()?;
        let is_it =
            message["target"]["name"] == BINARY && message["manifest_path"].as_str()?.ends_with("render/Cargo.toml");
        is_it.then(|| message["executable"].as_str().map(PathBuf::from))?
    };
    messages.lines().find_map(executable).with_context(|| format!("cargo built no test {BINARY}"))
}

/// The groups of a list of tests as libtest writes it.
fn groups(list: &str, filter: Option<&str>) -> Vec<Group> {
    let mut by_module: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    let tests = list.lines().filter_map(|line| line.strip_suffix(": test"));
    for test in tests.filter(|test| filter.is_none_or(|part| test.contains(part))) {
        let is_in = |module: &&&str| test.strip_prefix(**module).is_some_and(|rest| rest.starts_with("::"));
        let module = APART.iter().find(is_in).copied().unwrap_or_else(|| test.split("::").next().unwrap_or(test));
        by_module.entry(module).or_default().push(test.to_owned());
    }
    let group = |(module, tests): (&str, _)| Group { module: module.to_owned(), tests };
    let mut groups: Vec<Group> = by_module.into_iter().map(group).collect();
    let place = |group: &Group| LONGEST.iter().position(|module| *module == group.module).unwrap_or(LONGEST.len());
    groups.sort_by_key(|group| (place(group), std::cmp::Reverse(group.tests.len())));
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIST: &str = "a::one: test\nstreaming::roulette::x: test\nstreaming::y: test\nb::one: test\nb::two: test\n\
                        streaming::roulettes::z: test\n0 benchmarks\nalone: test\n";

    #[test]
    fn every_test_is_in_the_group_of_its_module() {
        let found = groups(LIST, None);
        let named: Vec<(&str, usize)> = found.iter().map(|group| (group.module.as_str(), group.tests.len())).collect();
        assert_eq!(named, [("streaming", 2), ("b", 2), ("a", 1), ("alone", 1), ("streaming::roulette", 1)]);
        let mut all: Vec<&str> = found.iter().flat_map(|group| &group.tests).map(String::as_str).collect();
        all.sort_unstable();
        let mut listed: Vec<&str> = LIST.lines().filter_map(|line| line.strip_suffix(": test")).collect();
        listed.sort_unstable();
        assert_eq!(all, listed, "each once");
    }

    #[test]
    fn a_filter_is_a_part_of_a_name() {
        assert_eq!(groups(LIST, Some("b::t")), [Group { module: "b".into(), tests: vec!["b::two".into()] }]);
        assert!(groups(LIST, Some("nothing")).is_empty(), "then no process is started");
    }

    #[test]
    fn module_lists_name_existing_modules() {
        let main = concat!(env!("CARGO_MANIFEST_DIR"), "/../render/tests/gpu/main.rs");
        let main = std::fs::read_to_string(main).unwrap();
        for module in THREADED.iter().chain(&LONGEST) {
            assert!(main.contains(&format!("mod {module};")), "{module}");
        }
        for module in APART {
            let path = module.replace("::", "/");
            let file = format!("{}/../render/tests/gpu/{path}", env!("CARGO_MANIFEST_DIR"));
            assert!(
                Path::new(&file).with_extension("rs").exists() || Path::new(&file).join("mod.rs").exists(),
                "{file}"
            );
        }
    }
}
