// SPDX-License-Identifier: Apache-2.0
//! Runs every test: Rust by nextest (or cargo), the renderer's on a device by modules ([`grouped`]), Python each file
//! in the interpreter it needs.
//!
//! `tests/host/**` runs in the wheel host's Python (`pxr` is Hydra's), all other Python tests in usd-core's; both see
//! `OOCPT_HOST_PYTHON` and `OOCPT_USD_PYTHON` to start the other one, and `usdrecord` in `PATH`.
//!
//! Without a GPU the plugin is built and Python runs beside the Rust tests, in two processes: all of them wait much,
//! for shaders that are compiled on one core and for hosts. Its lines begin with [`MARK`] then. On a GPU one after the
//! other: two would share its memory. [`WITHOUT_GPU`] says what else differs.

use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Instant;

use anyhow::{Context as _, Result, bail};

use crate::host::{HOST_VENV, Interpreter, USD_VENV};
use crate::places::Places;
use crate::process::{say, succeeds};
use crate::product::{self, PROFILE, cargo};
use crate::watched::Watched;
use crate::{grouped, shell, system};

/// pytest's exit status when no test matched.
const NOTHING_COLLECTED: i32 = 5;
/// Set for tests that are to take all seeds.
const FULL: &str = "OOCPT_TEST_FULL";
/// What a line of Python's begins with, where others stand between.
const MARK: &str = "[python] ";
/// What [`grouped`] runs.
const GROUPED: &str = "(package(oocpt-render) & binary(gpu))";
/// Profiles of nextest and the threads that Mesa's software renderer has in them, besides the one that submits; none =
/// as many as it likes. With a GPU one has all tests, without they share them (`.config/nextest.toml` says why).
type NextestProfile = (&'static str, Option<&'static str>);
const ON_GPU: &[NextestProfile] = &[("default", None)];
const WITHOUT_GPU: &[NextestProfile] = &[("software", Some("0")), ("software-threads", None)];

/// Which tests run, and how far they go.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent<'a> {
    /// Part of the names; all without.
    pub(crate) filter: Option<&'a str>,
    /// Tests that count over seeds take all of them.
    pub(crate) full: bool,
}

impl Extent<'_> {
    /// Tells the tests.
    fn tell(self, tests: &mut Command) {
        if self.full {
            tests.env(FULL, "1");
        } else {
            tests.env_remove(FULL);
        }
    }
}

/// Builds everything and runs all tests of an extent; every runner runs, even if another failed.
///
/// # Errors
/// Names the runners that failed, or says why a build did.
pub(crate) fn run_tests(places: &Places, interpreter: &Interpreter, extent: Extent<'_>) -> Result<()> {
    timed("building the workspace", || product::build_workspace(places))?;
    let (rust, python) = if system::has_gpu() {
        (rust_tests(places, extent), all_python_tests(places, interpreter, extent, ""))
    } else {
        thread::scope(|scope| {
            let python = scope.spawn(|| all_python_tests(places, interpreter, extent, MARK));
            let rust = rust_tests(places, extent);
            (rust, python.join().unwrap_or_else(|_| bail!("the thread of the Python tests ended")))
        })
    };
    let mut failed = python?;
    if !rust? {
        failed.insert(0, "Rust");
    }
    if !failed.is_empty() {
        bail!("tests failed: {}", failed.join(", "));
    }
    say("all tests passed");
    Ok(())
}

/// What `step` gives; says how long it took.
fn timed<T>(name: &str, step: impl FnOnce() -> T) -> T {
    let started = Instant::now();
    let result = step();
    say(format_args!("{name} took {} s", started.elapsed().as_secs()));
    result
}

/// Builds the plugin, then runs the Python tests; gives the names of the runners that failed. Without a GPU (with a
/// `mark`) those through Hydra, which are the half of them, run beside the others.
fn all_python_tests(
    places: &Places,
    interpreter: &Interpreter,
    extent: Extent<'_>,
    mark: &str,
) -> Result<Vec<&'static str>> {
    timed("building the plugin", || product::build_plugin_for_wheel(places, interpreter))?;
    let tests = places.repo.join("tests");
    let [hydra, host] = ["hydra", "host"].map(|folder| tests.join(folder));
    let run =
        |venv: &str, folder: &Path, without: &[&Path]| python_tests(places, venv, (folder, without), extent, mark);
    let through_hydra = || run(USD_VENV.name, &hydra, &[]);
    let others =
        || Ok::<_, anyhow::Error>((run(HOST_VENV.name, &host, &[])?, run(USD_VENV.name, &tests, &[&hydra, &host])?));
    let (others, through_hydra) = if mark.is_empty() {
        (others(), through_hydra())
    } else {
        thread::scope(|scope| {
            let through_hydra = scope.spawn(through_hydra);
            (others(), through_hydra.join().unwrap_or_else(|_| bail!("the thread of the Python tests ended")))
        })
    };
    let (in_host, others) = others?;
    let passed = [("Python (wheel host)", in_host), ("Python (usd-core)", others), ("Python (Hydra)", through_hydra?)];
    Ok(passed.into_iter().filter(|(_, passed)| !passed).map(|(name, _)| name).collect())
}

fn rust_tests(places: &Places, extent: Extent<'_>) -> Result<bool> {
    if !succeeds("cargo-nextest", ["nextest", "--version"]) {
        // Tests of a binary share a process here, and with it the device.
        let mut plain = cargo(places, "test");
        plain.args(["--workspace", "--profile", PROFILE]).env("RUST_TEST_THREADS", "1");
        shell::apply(&shell::for_wheel(places), &mut plain);
        extent.tell(&mut plain);
        return passes(plain.args(extent.filter));
    }
    let mut all_pass = true;
    for (profile, driver_threads) in if system::has_gpu() { ON_GPU } else { WITHOUT_GPU } {
        let mut nextest = cargo(places, "nextest run");
        nextest.args(["--workspace", "--profile", profile, "--cargo-profile", PROFILE, "--no-tests", "pass"]);
        nextest.arg("--filterset").arg(format!("not {GROUPED}"));
        shell::apply(&shell::for_wheel(places), &mut nextest);
        if let Some(threads) = driver_threads {
            nextest.env("LP_NUM_THREADS", threads);
        }
        extent.tell(&mut nextest);
        all_pass &= timed(&format!("nextest, profile {profile}"), || passes(nextest.args(extent.filter)))?;
    }
    all_pass &= timed("tests with a device, by modules", || {
        grouped::run(places, extent.filter, system::has_gpu(), |command| {
            shell::apply(&shell::for_wheel(places), command);
            extent.tell(command);
        })
    })?;
    Ok(all_pass)
}

fn python_tests(
    places: &Places,
    venv: &str,
    (folder, without): (&Path, &[&Path]),
    extent: Extent<'_>,
    mark: &str,
) -> Result<bool> {
    if !folder.is_dir() {
        return Ok(true);
    }
    let mut pytest = Command::new(places.venv_python(venv));
    pytest.current_dir(&places.repo).args([
        "-I",
        "-m",
        "pytest",
        "-ra",
        "-v",
        "--durations=20",
        "--import-mode=importlib",
    ]);
    shell::apply(&shell::for_wheel(places), &mut pytest);
    pytest.env("OOCPT_CLI", product::kept(places, PROFILE, product::COMMAND_FILE));
    pytest.arg(folder);
    for folder in without {
        pytest.arg("--ignore").arg(folder);
    }
    extent.tell(&mut pytest);
    if let Some(filter) = extent.filter {
        pytest.args(["-k", filter]);
    }
    let status = timed(&format!("pytest {}", folder.display()), || {
        if mark.is_empty() { status(&mut pytest) } else { Watched { mark, patience: None }.status(&mut pytest) }
    })?;
    Ok(status == 0 || status == NOTHING_COLLECTED)
}

fn passes(command: &mut Command) -> Result<bool> {
    Ok(status(command)? == 0)
}

/// The exit status; a child that a signal ended counts as failed.
fn status(command: &mut Command) -> Result<i32> {
    let program = command.get_program().to_owned();
    let status = command.stdin(Stdio::null()).status();
    Ok(status.with_context(|| format!("cannot start {}", program.display()))?.code().unwrap_or(-1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What one profile leaves out the other one has, so that no test is lost between them.
    #[test]
    fn the_profiles_without_a_gpu_share_all_tests() {
        let config = concat!(env!("CARGO_MANIFEST_DIR"), "/../../.config/nextest.toml");
        let config = std::fs::read_to_string(config).unwrap();
        let filter_of = |profile: &str| {
            let section = config.split(&format!("[profile.{profile}]\n")).nth(1).unwrap();
            section.lines().next().unwrap().strip_prefix("default-filter = ").unwrap().trim_matches('"').to_owned()
        };
        let [(most, _), (rest, _)] = WITHOUT_GPU else { panic!("two profiles") };
        assert_eq!(filter_of(most), format!("not ({})", filter_of(rest)), "of {most}");
        assert_eq!(config.matches("default-filter").count(), WITHOUT_GPU.len(), "and no other profile leaves any out");
    }
}
