// SPDX-License-Identifier: Apache-2.0
//! Python tests: `tests/host` runs in the wheel host's Python (`pxr` is Hydra's), all others in usd-core's. Both see
//! `OOCPT_HOST_PYTHON` and `OOCPT_USD_PYTHON` to start the other one, and `usdrecord` in `PATH`.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context as _, Result};

use super::{TestExtent, TestGroup};
use crate::host::{HOST_VENV, USD_VENV};
use crate::places::RootFolders;
use crate::product::{self, PROFILE};
use crate::shell;

/// pytest's exit status when no test matched.
const NOTHING_COLLECTED: i32 = 5;
/// Number of groups for tests through Hydra, which are two thirds of all; they are divided file by file.
const HYDRA_GROUPS: usize = 3;

/// The groups of an extent.
///
/// # Errors
/// If the folder of the tests through Hydra cannot be read.
pub(super) fn groups(places: &RootFolders, extent: TestExtent<'_>) -> Result<Vec<TestGroup>> {
    let tests = places.repo.join("tests");
    let [hydra, host] = ["hydra", "host"].map(|folder| tests.join(folder));
    let mut files = Vec::new();
    for entry in fs::read_dir(&hydra).with_context(|| format!("cannot read {}", hydra.display()))? {
        let name = entry.with_context(|| format!("cannot read {}", hydra.display()))?.file_name();
        let name = name.to_string_lossy();
        if name.starts_with("test_") && name.ends_with(".py") {
            files.push(hydra.join(&*name));
        }
    }
    files.sort();
    let mut groups = Vec::new();
    for at in 0..HYDRA_GROUPS {
        let dealt = files.iter().skip(at).step_by(HYDRA_GROUPS).cloned().collect();
        groups.push(group(places, &format!("hydra {}", at + 1), USD_VENV.name, dealt, &[], extent));
    }
    if places.wheel.is_default() {
        groups.push(group(places, "python", USD_VENV.name, vec![tests], &[hydra, host.clone()], extent));
        groups.push(group(places, "host", HOST_VENV.name, vec![host], &[], extent));
    } else {
        // What is shipped (the wheel, Blender's extension) is built for the default host, and so are its tests.
        let asking = ["abi", "images"].map(|folder| tests.join(folder)).to_vec();
        groups.push(group(places, "python", USD_VENV.name, asking, &[], extent));
        let package = host.join("test_package.py");
        groups.push(group(places, "host", HOST_VENV.name, vec![host], &[package], extent));
    }
    Ok(groups)
}

fn group(
    places: &RootFolders,
    name: &str,
    venv: &str,
    paths: Vec<PathBuf>,
    without: &[PathBuf],
    extent: TestExtent<'_>,
) -> TestGroup {
    let mut pytest = Command::new(places.venv_python(venv));
    pytest.current_dir(&places.repo);
    pytest.args(["-I", "-m", "pytest", "-ra", "-v", "--durations=10", "--import-mode=importlib"]).args(paths);
    for folder in without {
        pytest.arg("--ignore").arg(folder);
    }
    shell::apply(&shell::for_wheel(places), &mut pytest);
    pytest.env("OOCPT_CLI", product::kept(places, PROFILE, product::COMMAND_FILE));
    extent.tell(&mut pytest);
    if let Some(filter) = extent.filter {
        pytest.args(["-k", filter]);
    }
    let passes = |status| status == 0 || status == NOTHING_COLLECTED;
    TestGroup { name: name.into(), command: pytest, passes, is_long: name != "host" }
}
