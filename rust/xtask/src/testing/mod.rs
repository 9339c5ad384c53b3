// SPDX-License-Identifier: Apache-2.0
//! Runs every test: builds the workspace and the plugin, then runs groups of tests, a process each, a few at a time.
//!
//! A group of Rust tests is a test program, or a module of one ([`groups`]); a group of Python tests is a pytest
//! ([`python`]). With a process for every test, each would start its device anew, and load its passes. Groups share
//! them, and can show a fault that only appears with the second scene of a process. A test that crashes or hangs ends
//! its group; its lines name it.

mod groups;
mod python;
mod watched;

use std::collections::VecDeque;
use std::process::Command;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};

use crate::host::PythonInterpreter;
use crate::places::RootFolders;
use crate::process::say;
use crate::{product, system};
use groups::TestProgram;
use watched::WatchedProcess;

/// Set for tests that should take all seeds, and for Python tests that should use both front ends of Hydra.
const FULL: &str = "OOCPT_TEST_FULL";
/// Groups at a time without a GPU: one more than two cores have, since hosts wait for files and for one another. On a
/// GPU there is one, as two would share its memory.
const AT_A_TIME: usize = 3;
/// A test without output for so long hangs.
const PATIENCE: Duration = Duration::from_secs(900);
/// Number of tests that are listed, those that take most processor time.
const LISTED: usize = 30;

/// The tests to run, and their extent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TestExtent<'a> {
    /// Part of the names; `None` runs all.
    pub(crate) filter: Option<&'a str>,
    /// True if tests that count over seeds take all of them.
    pub(crate) full: bool,
}

impl TestExtent<'_> {
    /// Sets the environment of the tests.
    fn tell(self, tests: &mut Command) {
        if self.full {
            tests.env(FULL, "1");
        } else {
            tests.env_remove(FULL);
        }
    }
}

/// The tests of one process.
#[derive(Debug)]
struct TestGroup {
    /// The prefix of its lines.
    name: String,
    command: Command,
    /// Returns true for exit statuses that are not failures.
    passes: fn(i32) -> bool,
    /// True if it takes a minute or more: such groups begin first, so that none is left alone at the end.
    is_long: bool,
}

/// A group that failed, with the end of what it said.
#[derive(Debug)]
struct FailedGroup {
    name: String,
    last_lines: Vec<String>,
}

impl FailedGroup {
    /// Prints its last lines, so that they are at the end of a long log, where people look.
    fn tell(&self) {
        say(format_args!("{} failed; it ended with:", self.name));
        self.last_lines.iter().for_each(|line| say(format_args!("[{}] {line}", self.name)));
    }
}

/// Waiting groups, and whether more will come.
#[derive(Debug, Default)]
struct GroupQueue {
    waiting: Mutex<(VecDeque<TestGroup>, bool)>,
    changed: Condvar,
}

impl GroupQueue {
    fn waiting(&self) -> MutexGuard<'_, (VecDeque<TestGroup>, bool)> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds groups, the long ones before all others; `last` if none will come after them.
    fn add(&self, groups: Vec<TestGroup>, last: bool) {
        let mut waiting = self.waiting();
        waiting.0.extend(groups);
        waiting.0.make_contiguous().sort_by_key(|group| !group.is_long);
        waiting.1 = last;
        self.changed.notify_all();
    }

    /// Takes a group; waits if more will come.
    fn next(&self) -> Option<TestGroup> {
        let mut waiting = self.waiting();
        loop {
            if let Some(group) = waiting.0.pop_front() {
                return Some(group);
            }
            if waiting.1 {
                return None;
            }
            waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// Builds everything and runs all tests of an extent; every group runs, even if another failed. The product is built
/// while Rust tests run: a build has seldom work for all processors. Rust tests ask no host: for another one than the
/// default there are Python tests alone.
///
/// # Errors
/// Names the groups that failed, or says why a build did.
pub(crate) fn run(places: &RootFolders, interpreter: &PythonInterpreter, extent: TestExtent<'_>) -> Result<()> {
    let programs: Vec<TestProgram> = if places.wheel.is_default() {
        let messages = timed("building the workspace", || product::build_tests(places))?;
        messages.lines().filter_map(TestProgram::of_message).collect()
    } else {
        Vec::new()
    };
    let has_gpu = system::has_gpu();
    let queue = GroupQueue::default();
    queue.add(groups::of_programs(places, &programs, extent, has_gpu)?, false);
    let build = || {
        let built = timed("building the product", || product::build_for_tests(places, interpreter));
        let groups = built.and_then(|()| python::groups(places, extent));
        let (groups, result) = groups.map_or_else(|error| (vec![], Err(error)), |groups| (groups, Ok(())));
        queue.add(groups, true);
        result
    };
    let (built, failed) = thread::scope(|scope| {
        let built = scope.spawn(build);
        let failed = timed("running the tests", || run_groups(&queue, if has_gpu { 1 } else { AT_A_TIME }));
        (built.join().unwrap_or_else(|_| bail!("the thread of the build ended")), failed)
    });
    let failed = failed?;
    if !failed.is_empty() {
        failed.iter().for_each(FailedGroup::tell);
        let names: Vec<&str> = failed.iter().map(|group| group.name.as_str()).collect();
        bail!("tests failed: {}", names.join(", "));
    }
    built?;
    say("all tests passed");
    Ok(())
}

/// Runs groups, `workers` at a time; returns those that failed.
fn run_groups(queue: &GroupQueue, workers: usize) -> Result<Vec<FailedGroup>> {
    let durations = Mutex::new(Vec::new());
    let work = || -> Result<Vec<FailedGroup>> {
        let mut failed = Vec::new();
        while let Some(mut group) = queue.next() {
            let started = Instant::now();
            let watched = WatchedProcess { mark: &format!("[{}] ", group.name), patience: PATIENCE };
            let ended = watched.run(&mut group.command)?;
            let passes = (group.passes)(ended.status);
            let ending = if passes { "passed" } else { "FAILED" };
            let (wall, processor) = (started.elapsed().as_secs(), ended.processor_time.as_secs());
            say(format_args!("{}: {wall} s, {processor} s of processor time, {ending}", group.name));
            durations.lock().unwrap_or_else(PoisonError::into_inner).extend(ended.tests);
            if !passes {
                failed.push(FailedGroup { name: group.name, last_lines: ended.last_lines });
            }
        }
        Ok(failed)
    };
    let failed = thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let ended = workers.into_iter().map(|worker| worker.join().unwrap_or_else(|_| bail!("a thread ended")));
        ended.collect::<Result<Vec<_>>>()
    })?;
    tell_longest(durations.into_inner().unwrap_or_else(PoisonError::into_inner));
    Ok(failed.into_iter().flatten().collect())
}

fn tell_longest(mut tests: Vec<(Duration, String)>) {
    tests.sort_by(|a, b| b.cmp(a));
    for (duration, name) in tests.into_iter().take(LISTED) {
        say(format_args!("{:6.1} s  {name}", duration.as_secs_f32()));
    }
}

/// Returns the result of `step`, and prints how long it took.
fn timed<T>(name: &str, step: impl FnOnce() -> T) -> T {
    let started = Instant::now();
    let result = step();
    say(format_args!("{name} took {} s", started.elapsed().as_secs()));
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    fn group(name: &str, script: &str) -> TestGroup {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        TestGroup { name: name.into(), command, passes: |status| status == 0, is_long: false }
    }

    #[test]
    fn long_groups_come_first() {
        let queue = GroupQueue::default();
        queue.add(vec![group("a", ""), group("b", "")], false);
        queue.add(vec![TestGroup { is_long: true, ..group("c", "") }, group("d", "")], true);
        let order: Vec<String> = std::iter::from_fn(|| queue.next()).map(|group| group.name).collect();
        assert_eq!(order, ["c", "a", "b", "d"]);
    }

    #[test]
    fn all_groups_run_and_those_that_fail_are_named() {
        let file = std::env::temp_dir().join(format!("oocpt-groups-{}", std::process::id()));
        let last = format!("touch '{}'", file.display());
        let queue = GroupQueue::default();
        queue.add(vec![group("a", "exit 0"), group("b", "echo why; exit 1")], false);
        let failed = thread::scope(|scope| {
            let failed = scope.spawn(|| run_groups(&queue, 2));
            thread::sleep(Duration::from_millis(300));
            queue.add(vec![group("c", "kill -9 $$"), group("d", &last)], true);
            failed.join()
        });
        let mut failed = failed.unwrap().unwrap();
        failed.sort_by(|a, b| a.name.cmp(&b.name));
        let said: Vec<_> = failed.iter().map(|group| (group.name.as_str(), group.last_lines.join("/"))).collect();
        assert_eq!(said, [("b", "why".to_owned()), ("c", String::new())]);
        std::fs::remove_file(file).expect("the last one ran, too");
        assert!(run_groups(&queue, 2).unwrap().is_empty(), "nothing is left");
    }
}
