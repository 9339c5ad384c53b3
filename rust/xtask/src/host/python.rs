// SPDX-License-Identifier: Apache-2.0
//! The host's Python: the interpreter of the machine, and two virtual environments that never share a process.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result};

use super::wheels::{self, WheelRole};
use super::{is_stamped, remove};
use crate::places::{RootFolders, WheelHost};
use crate::process::{run, say, succeeds};

/// A usable interpreter of the version that the wheels are made for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PythonInterpreter {
    /// The program to start.
    pub(crate) program: PathBuf,
    /// Folder with its own `Python.h`.
    pub(crate) include: PathBuf,
}

/// The contents of a virtual environment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VenvPlan {
    /// Name of its folder in the cache.
    pub(crate) name: &'static str,
    roles: &'static [WheelRole],
    sees_host: bool,
}

/// Imports the wheel host's `pxr`: runs `usdrecord` and the tests of the plugin.
pub(crate) const HOST_VENV: VenvPlan =
    VenvPlan { name: "venv-host", roles: &[WheelRole::Tools, WheelRole::Denoiser], sees_host: true };

/// Imports usd-core's `pxr`: authors scenes, reads pictures.
pub(crate) const USD_VENV: VenvPlan =
    VenvPlan { name: "venv-usd", roles: &[WheelRole::Tools, WheelRole::UsdTools], sees_host: false };

/// Renders references with Mitsuba from scenes that usd-core reads; runs `MaterialX`'s own shaders of nodes.
pub(crate) const REFERENCE_VENV: VenvPlan = VenvPlan {
    name: "venv-reference",
    roles: &[WheelRole::Tools, WheelRole::UsdTools, WheelRole::ReferenceTools],
    sees_host: false,
};

/// Finds the host's Python with `venv` and its own headers: `OOCPT_PYTHON`, the system's, then those in `PATH`.
pub(crate) fn find_interpreter(host: &WheelHost) -> Option<PythonInterpreter> {
    let explicit = env::var_os("OOCPT_PYTHON").map(PathBuf::from);
    let named = format!("python{}", host.python);
    let known = [format!("/usr/bin/{named}"), named, "python3".to_owned()].map(PathBuf::from);
    explicit.into_iter().chain(known).find_map(|program| ask(&program, host.python))
}

fn ask(program: &Path, version: &str) -> Option<PythonInterpreter> {
    const QUESTION: &str = "import ensurepip, sys, sysconfig, venv; \
        print('%d.%d' % sys.version_info[:2]); print(sys.executable); print(sysconfig.get_path('include'))";
    let output =
        Command::new(program).args(["-I", "-c", QUESTION]).stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
    let answer = parse_answer(&String::from_utf8(output.stdout).ok()?, version)?;
    answer.include.join("Python.h").is_file().then_some(answer)
}

fn parse_answer(answer: &str, version: &str) -> Option<PythonInterpreter> {
    let mut lines = answer.lines();
    if lines.next()? != version {
        return None;
    }
    Some(PythonInterpreter { program: lines.next()?.into(), include: lines.next()?.into() })
}

impl RootFolders {
    /// The interpreter of the virtual environment `name`.
    pub(crate) fn venv_python(&self, name: &str) -> PathBuf {
        self.venv(name).join("bin/python")
    }

    /// The library of Open Image Denoise in the environment that renders.
    pub(crate) fn denoiser(&self) -> PathBuf {
        let site = self.venv(HOST_VENV.name).join(format!("lib/python{}/site-packages", self.wheel.python));
        site.join("pyoidn/oidn/lib/libOpenImageDenoise.so.2")
    }
}

/// A Python with pip, to download with: Debian's own has none, so it comes from an environment of its own, made on
/// first use.
pub(super) fn with_pip(places: &RootFolders, interpreter: &PythonInterpreter) -> Result<PathBuf> {
    let python = places.venv_python("venv-pip");
    if !succeeds(&python, ["-m", "pip", "--version"]) {
        let folder = places.venv("venv-pip");
        remove(&folder)?;
        run(Command::new(&interpreter.program).args(["-m", "venv"]).arg(&folder))?;
    }
    Ok(python)
}

/// Makes sure that the environment holds exactly its pinned wheels. The caller holds the lock of the cache.
pub(super) fn prepare_venv(places: &RootFolders, interpreter: &PythonInterpreter, plan: &VenvPlan) -> Result<()> {
    let pinned = wheels::with_role(places.wheel, plan.roles);
    let folder = places.venv(plan.name);
    let stamp = format!("{}\n{}", interpreter.program.display(), wheels::stamp(super::LAYOUT, &pinned));
    if is_stamped(&folder, &stamp) {
        return Ok(());
    }
    let files = wheels::fetch(|| with_pip(places, interpreter), &places.downloads(), &pinned)?;
    say(format_args!("making the Python environment {}", plan.name));
    remove(&folder)?;
    run(Command::new(&interpreter.program).args(["-m", "venv"]).arg(&folder))?;
    let mut pip = Command::new(places.venv_python(plan.name));
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-index", "--no-deps"]);
    run(pip.args(files))?;
    if plan.sees_host {
        let site = folder.join(format!("lib/python{}/site-packages/oocpt_host.pth", places.wheel.python));
        fs::write(site, format!("{}\n", places.host_site().display())).context("cannot link the host's Python")?;
    }
    // The stamp is written last: a folder without a stamp is unfinished and made anew.
    fs::write(folder.join(".stamp"), stamp).context("cannot write the stamp of the environment")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_pinned_version_is_accepted() {
        let answer = "3.11\n/usr/bin/python3.11\n/usr/include/python3.11\n";
        let found = parse_answer(answer, "3.11").unwrap();
        assert_eq!(found.include, Path::new("/usr/include/python3.11"), "include folder");
        assert_eq!(parse_answer(answer, "3.13"), None, "another minor version");
        assert_eq!(parse_answer("3.11\n", "3.11"), None, "a cut answer");
    }

    #[test]
    fn the_environments_never_mix_hosts() {
        assert!(HOST_VENV.sees_host && !HOST_VENV.roles.contains(&WheelRole::UsdTools), "the host has its own pxr");
        assert!(!USD_VENV.sees_host && USD_VENV.roles.contains(&WheelRole::UsdTools), "usd-core has its own pxr");
    }
}
