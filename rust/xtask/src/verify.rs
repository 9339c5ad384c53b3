// SPDX-License-Identifier: Apache-2.0
//! Runs every test: Rust by nextest (or cargo), then Python, each file in the interpreter it needs.
//!
//! `tests/host/**` runs in the wheel host's Python (`pxr` is Hydra's), all other Python tests in usd-core's; both see `OOCPT_HOST_PYTHON` and
//! `OOCPT_USD_PYTHON` to start the other one, and `usdrecord` in `PATH`.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail};

use crate::host::{HOST_VENV, USD_VENV};
use crate::places::Places;
use crate::process::{say, succeeds};
use crate::product::{PROFILE, cargo};
use crate::shell;

/// pytest's exit status when no test matched.
const NOTHING_COLLECTED: i32 = 5;

/// Runs all tests whose name contains `filter`; every runner runs, even if one before it failed.
///
/// # Errors
/// Names the runners that failed.
pub(crate) fn run_tests(places: &Places, filter: Option<&str>) -> Result<()> {
    let host = places.repo.join("tests/host");
    let mut failed = Vec::new();
    let mut note = |name: &str, passed: Result<bool>| -> Result<()> {
        if !passed? {
            failed.push(name.to_owned());
        }
        Ok(())
    };
    note("Rust", rust_tests(places, filter))?;
    note("Python (usd-core)", python_tests(places, USD_VENV.name, &places.repo.join("tests"), Some(&host), filter))?;
    note("Python (wheel host)", python_tests(places, HOST_VENV.name, &host, None, filter))?;
    if !failed.is_empty() {
        bail!("tests failed: {}", failed.join(", "));
    }
    say("all tests passed");
    Ok(())
}

fn rust_tests(places: &Places, filter: Option<&str>) -> Result<bool> {
    let mut tests = if succeeds("cargo-nextest", ["nextest", "--version"]) {
        let mut nextest = cargo(places, "nextest run");
        nextest.args(["--workspace", "--cargo-profile", PROFILE, "--no-tests", "pass"]);
        nextest
    } else {
        let mut plain = cargo(places, "test");
        plain.args(["--workspace", "--profile", PROFILE]);
        plain
    };
    shell::apply(&shell::for_wheel(places), &mut tests);
    passes(tests.args(filter))
}

fn python_tests(
    places: &Places,
    venv: &str,
    folder: &Path,
    without: Option<&Path>,
    filter: Option<&str>,
) -> Result<bool> {
    if !folder.is_dir() {
        return Ok(true);
    }
    let mut pytest = Command::new(places.venv_python(venv));
    pytest.current_dir(&places.repo).args(["-I", "-m", "pytest", "-ra", "-v", "--import-mode=importlib"]);
    shell::apply(&shell::for_wheel(places), &mut pytest);
    pytest.arg(folder);
    if let Some(without) = without {
        pytest.arg("--ignore").arg(without);
    }
    if let Some(filter) = filter {
        pytest.args(["-k", filter]);
    }
    let status = status(&mut pytest)?;
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
