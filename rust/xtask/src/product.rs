// SPDX-License-Identifier: Apache-2.0
//! Builds the product: the Rust bridge with cargo, then the plugin with `CMake`; cargo and ninja decide what is out of
//! date.

use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, ensure};
use serde_json::Value;

use crate::host::PythonInterpreter;
use crate::places::RootFolders;
use crate::process::{capture, run, say, shell_word};

/// cargo profile of everything that is built to be run from the clone.
pub(crate) const PROFILE: &str = "fast";

/// The shipped crates: the bridge of the plugin, and the command.
const PRODUCT: [&str; 2] = [BRIDGE, "oocpt-cli"];
const BRIDGE: &str = "oocpt-bridge";
const BRIDGE_FILE: &str = "liboocpt_bridge.a";
/// The command as cargo builds it.
pub(crate) const COMMAND_FILE: &str = "oocpt";
/// What `oocpt bench` runs, crate and program; it is not shipped.
const BENCH: &str = "oocpt-bench";

/// Programs of ours that run in the wheel host's Python: their names in `build/wheel/bin`, and their scripts.
const HOST_PROGRAMS: [(&str, &str); 2] =
    [("usdrecord", "plugin/usdrecord"), ("oocpt-texture-host", "plugin/texture-host")];

/// Builds the plugin for the wheel host into its build tree, with a `usdrecord` beside it.
///
/// # Errors
/// If cargo, `CMake` or the build fails.
pub(crate) fn build_for_wheel(places: &RootFolders, interpreter: &PythonInterpreter) -> Result<()> {
    build_bridge(places, PROFILE)?;
    build_plugin_for_wheel(places, interpreter)
}

/// Builds the tests of every crate, with the faults that they plant (feature `faults`). Gives cargo's messages, a JSON
/// object a line.
///
/// # Errors
/// If cargo fails.
pub(crate) fn build_tests(places: &RootFolders) -> Result<String> {
    let mut build = cargo(places, "build");
    build.args(["--workspace", "--tests", "--profile", PROFILE, "--message-format", "json-render-diagnostics"]);
    capture(&mut build)
}

/// Builds bridge and command, which have none of what tests turn on, and the plugin around the bridge; the benches by
/// themselves, so that they turn on nothing in the product.
///
/// # Errors
/// Cargo, `CMake` or the build fails; in CI also if there are warnings.
pub(crate) fn build_for_tests(places: &RootFolders, interpreter: &PythonInterpreter) -> Result<()> {
    let mut build = cargo(places, "build");
    build.args(packages()).args(["--profile", PROFILE, "--message-format", "json-render-diagnostics"]);
    let warned = capture(&mut build)?.lines().any(is_warning);
    ensure!(!warned || !is_ci(), "the product, without what tests turn on, has warnings");
    run(cargo(places, "build").args(["--package", BENCH, "--profile", PROFILE]))?;
    [BRIDGE_FILE, COMMAND_FILE, BENCH].iter().try_for_each(|file| keep(places, PROFILE, file))?;
    build_plugin_for_wheel(places, interpreter)
}

/// Returns true if one of cargo's messages is a warning about a crate of the clone.
fn is_warning(line: &str) -> bool {
    let message: Option<Value> = serde_json::from_str(line).ok();
    message.is_some_and(|message| message["reason"] == "compiler-message" && message["message"]["level"] == "warning")
}

/// Returns true if this is CI: warnings are errors and `Cargo.lock` may not change.
fn is_ci() -> bool {
    env::var_os("CI").is_some()
}

/// cargo's arguments that name the product.
pub(crate) fn packages() -> Vec<OsString> {
    PRODUCT.iter().flat_map(|package| ["--package", package]).map(OsString::from).collect()
}

/// The path at which a file of the product is kept: builds with the features of tests put theirs at cargo's place.
pub(crate) fn kept(places: &RootFolders, profile: &str, file: &str) -> PathBuf {
    places.target.join("product").join(profile).join(file)
}

/// Keeps the file that cargo has just built. An unchanged file stays, so that nothing is linked anew.
fn keep(places: &RootFolders, profile: &str, file: &str) -> Result<()> {
    let (built, kept) = (places.target.join(profile).join(file), kept(places, profile, file));
    let bytes = fs::read(&built).with_context(|| format!("cargo left no {}", built.display()))?;
    if fs::read(&kept).is_ok_and(|found| found == bytes) {
        return Ok(());
    }
    let folder = kept.parent().context("a path without a folder")?;
    fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    fs::copy(&built, &kept).with_context(|| format!("cannot copy {}", built.display()))?;
    Ok(())
}

/// Builds the plugin for the wheel host around the existing bridge.
///
/// # Errors
/// `CMake` or the build fails.
fn build_plugin_for_wheel(places: &RootFolders, interpreter: &PythonInterpreter) -> Result<()> {
    let mut options = bridge_options(places, PROFILE);
    options.push(("OOCPT_HOST".into(), "wheel".into()));
    options.push(("OOCPT_HOST_VERSION".into(), places.wheel.usd.into()));
    options.push(("OOCPT_HOST_ROOT".into(), path(&places.host())));
    options.push(("OOCPT_PYTHON_INCLUDE".into(), path(&interpreter.include)));
    let tree = places.wheel_build();
    configure(places, &tree, &options)?;
    compile(&tree)?;
    let resources = places.wheel_resources();
    ensure!(resources.join("plugInfo.json").is_file(), "the build left no plugInfo.json in {}", resources.display());
    HOST_PROGRAMS.iter().try_for_each(|(name, script)| write_program(places, name, script))
}

/// Builds bridge, command and plugin, and packs them as a Python package into `build/dist`.
///
/// # Errors
/// If cargo, `CMake`, the build or the packing fails.
pub(crate) fn pack(places: &RootFolders, interpreter: &PythonInterpreter) -> Result<()> {
    run(cargo(places, "build").args(packages()).args(["--profile", PROFILE]))?;
    [BRIDGE_FILE, COMMAND_FILE].iter().try_for_each(|file| keep(places, PROFILE, file))?;
    build_plugin_for_wheel(places, interpreter)?;
    let mut pack = Command::new(&interpreter.program);
    pack.arg("-I").arg(places.repo.join("plugin/package/pack.py"));
    pack.arg("--plugin").arg(places.wheel_build().join("plugin"));
    pack.arg("--command").arg(kept(places, PROFILE, COMMAND_FILE));
    pack.arg("--out").arg(places.repo.join("build/dist"));
    let host = places.wheel;
    pack.args(["--openusd", host.usd, "--bpy", host.bpy, "--python", host.python]);
    run(&mut pack)
}

/// Builds the plugin, and packs it with the add-on as an extension of Blender into `build/dist`.
///
/// # Errors
/// If cargo, `CMake`, the build or the packing fails.
pub(crate) fn pack_for_blender(places: &RootFolders, interpreter: &PythonInterpreter) -> Result<()> {
    build_for_wheel(places, interpreter)?;
    let mut pack = Command::new(&interpreter.program);
    pack.arg("-I").arg(places.repo.join("plugin/blender/pack.py"));
    pack.arg("--plugin").arg(places.wheel_build().join("plugin"));
    pack.arg("--out").arg(places.repo.join("build/dist"));
    pack.args(["--openusd", places.wheel.usd, "--bpy", places.wheel.bpy]);
    run(&mut pack)
}

/// Builds release code against the SDK at `usd` and installs the plugin below `prefix`.
///
/// # Errors
/// If `usd` is no SDK, or the build or the installation fails.
pub(crate) fn install_for_sdk(places: &RootFolders, usd: &Path, prefix: &Path) -> Result<PathBuf> {
    let usd = fs::canonicalize(usd).with_context(|| format!("no OpenUSD install at {}", usd.display()))?;
    ensure!(usd.join("include/pxr/pxr.h").is_file(), "{} has no include/pxr/pxr.h", usd.display());
    fs::create_dir_all(prefix).with_context(|| format!("cannot create {}", prefix.display()))?;
    let prefix = fs::canonicalize(prefix).context("cannot resolve the prefix")?;
    build_bridge(places, "release")?;
    let mut options = bridge_options(places, "release");
    options.push(("OOCPT_HOST".into(), "sdk".into()));
    options.push(("OOCPT_USD_ROOT".into(), path(&usd)));
    options.push(("CMAKE_INSTALL_PREFIX".into(), path(&prefix)));
    let tree = places.repo.join("build").join(sdk_tree_name(&usd));
    configure(places, &tree, &options)?;
    compile(&tree)?;
    run(Command::new("cmake").arg("--install").arg(&tree))?;
    Ok(prefix)
}

fn compile(tree: &Path) -> Result<()> {
    run(Command::new("cmake").arg("--build").arg(tree).args(["--", "--quiet"]))
}

fn build_bridge(places: &RootFolders, profile: &str) -> Result<()> {
    run(cargo(places, "build").args(["--package", BRIDGE, "--profile", profile]))?;
    keep(places, profile, BRIDGE_FILE)
}

/// The `CMake` options that name the bridge.
fn bridge_options(places: &RootFolders, profile: &str) -> Vec<(String, String)> {
    vec![
        ("CMAKE_BUILD_TYPE".into(), "Release".into()),
        ("OOCPT_BRIDGE_LIB".into(), path(&kept(places, profile, BRIDGE_FILE))),
        ("OOCPT_BRIDGE_INCLUDE".into(), path(&places.target.join("cxxbridge"))),
    ]
}

/// A cargo subcommand in the clone, by the same cargo that runs this; in CI (`CI` is set) it may not change
/// `Cargo.lock`.
pub(crate) fn cargo(places: &RootFolders, subcommand: &str) -> Command {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(&places.repo).env("CARGO_TARGET_DIR", &places.target).args(subcommand.split(' '));
    if is_ci() && subcommand != "fmt" {
        cargo.arg("--locked");
    }
    cargo
}

/// Configures `tree` unless it was configured with the same options; `CMake` itself watches its own files.
fn configure(places: &RootFolders, tree: &Path, options: &[(String, String)]) -> Result<()> {
    let wanted = options.iter().map(|(name, value)| format!("-D{name}={value}\n")).collect::<String>();
    let noted = tree.join("xtask-options.txt");
    if tree.join("build.ninja").exists() && fs::read_to_string(&noted).is_ok_and(|found| found == wanted) {
        return Ok(());
    }
    say(format_args!("configuring {}", tree.display()));
    let mut cmake = Command::new("cmake");
    cmake.args(["-G", "Ninja", "-S"]).arg(places.repo.join("cpp")).arg("-B").arg(tree);
    if crate::system::find_program("ccache").is_some() {
        cmake.arg("-DCMAKE_CXX_COMPILER_LAUNCHER=ccache");
    }
    run(cmake.args(wanted.lines()))?;
    fs::write(noted, wanted).context("cannot note the CMake options")
}

/// A build tree per SDK, so that switching between two does not rebuild either.
fn sdk_tree_name(usd: &Path) -> String {
    let name = usd.to_string_lossy();
    let name: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    format!("sdk{name}")
}

/// Writes the build tree's `bin/NAME`, which starts a script in the wheel host with the plugin in its path.
fn write_program(places: &RootFolders, name: &str, script: &str) -> Result<()> {
    let program = places.wheel_bin().join(name);
    let text = program_script(places, script);
    if fs::read_to_string(&program).is_ok_and(|found| found == text) {
        return Ok(());
    }
    fs::create_dir_all(places.wheel_bin()).with_context(|| format!("cannot create the folder of {name}"))?;
    fs::write(&program, text).with_context(|| format!("cannot write {name}"))?;
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    fs::set_permissions(&program, mode).with_context(|| format!("cannot make {name} executable"))
}

fn program_script(places: &RootFolders, script: &str) -> String {
    let python = shell_word(&path(&places.venv_python(crate::host::HOST_VENV.name)));
    let runner = shell_word(&path(&places.repo.join(script)));
    let resources = shell_word(&path(&places.wheel_resources()));
    let materialx = shell_word(&path(&places.materialx()));
    // With -I, a PYTHONPATH that leads to another OpenUSD cannot affect this process.
    format!(
        "#!/bin/sh\n# Written by `cargo xtask \
        build`.\nPXR_PLUGINPATH_NAME={resources}${{PXR_PLUGINPATH_NAME:+:$PXR_PLUGINPATH_NAME}}\n\
         export PXR_PLUGINPATH_NAME\n\
         [ -n \"$PXR_MTLX_STDLIB_SEARCH_PATHS\" ] || PXR_MTLX_STDLIB_SEARCH_PATHS={materialx}\n\
         export PXR_MTLX_STDLIB_SEARCH_PATHS\nexec {python} -I {runner} \"$@\"\n"
    )
}

fn path(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::places::WHEEL_HOSTS;

    #[test]
    fn warnings_are_seen_among_the_messages() {
        let message = |reason, level| format!(r#"{{"reason":"{reason}","message":{{"level":"{level}"}}}}"#);
        assert!(is_warning(&message("compiler-message", "warning")));
        assert!(!is_warning(&message("compiler-message", "note")) && !is_warning("   Compiling core"), "others");
        assert!(!is_warning(&message("compiler-artifact", "warning")), "another message");
    }

    #[test]
    fn each_sdk_has_its_own_tree() {
        assert_eq!(sdk_tree_name(Path::new("/opt/usd-24.11")), "sdk_opt_usd_24_11", "readable");
        assert_ne!(sdk_tree_name(Path::new("/opt/a")), sdk_tree_name(Path::new("/opt/b")), "distinct");
    }

    #[test]
    fn usdrecord_keeps_the_users_plugins() {
        let places =
            RootFolders { repo: "/r p".into(), cache: "/c".into(), target: "/t".into(), wheel: &WHEEL_HOSTS[0] };
        let script = program_script(&places, "plugin/usdrecord");
        assert!(script.contains("exec /c/venv-host/bin/python -I '/r p/plugin/usdrecord' \"$@\""), "{script}");
        assert!(script.contains("${PXR_PLUGINPATH_NAME:+:$PXR_PLUGINPATH_NAME}"), "{script}");
        assert!(
            script.contains("] || PXR_MTLX_STDLIB_SEARCH_PATHS=/c/host-25.08/"),
            "the user's libraries win: {script}"
        );
    }
}
