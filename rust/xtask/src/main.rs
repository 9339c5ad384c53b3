// SPDX-License-Identifier: Apache-2.0
//! `cargo xtask`: the single entry point of OocPT for people and CI.
//!
//! Each command sets up what it needs (system packages, wheel host, Python environments, build) and is quick if that is
//! done. Answers go to stdout, everything else to stderr. Paths are in [`places`], the wheel host is described in
//! [`host`].
#![forbid(unsafe_code)]

mod book;
mod check;
mod clone_files;
mod host;
mod measure;
mod picture;
mod places;
mod process;
mod product;
mod shell;
mod system;
mod testing;

use std::ffi::OsString;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context as _, Result};
use clap::{Parser, Subcommand};

use crate::host::PythonInterpreter;
use crate::places::{RootFolders, WHEEL_HOSTS, WheelHost};
use crate::process::say;

#[derive(Debug, Parser)]
#[command(name = "cargo xtask", about = "Set up, build, record, test and check OocPT", disable_help_subcommand = true)]
struct Arguments {
    #[command(subcommand)]
    command: XtaskCommand,
}

#[derive(Debug, clap::Args)]
struct HostArgument {
    /// OpenUSD of the wheel host: 25.08, or 26.03, which needs Python 3.13
    #[arg(long, value_parser = WheelHost::named, default_value = WHEEL_HOSTS[0].usd)]
    host: &'static WheelHost,
}

#[derive(Debug, Subcommand)]
enum XtaskCommand {
    /// Install system packages (as root), put together the wheel host and the Python environments
    Setup {
        #[command(flatten)]
        host: HostArgument,
    },
    /// Build the plugin for the wheel host
    Build {
        #[command(flatten)]
        host: HostArgument,
    },
    /// Render a scene: `record [usdrecord flags] SCENE OUT`
    #[command(disable_help_flag = true)]
    Record {
        /// Handed to usdrecord as they are; `--renderer OocPT` is added unless a renderer is named
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<OsString>,
    },
    /// Print shell exports: `eval "$(cargo xtask env)"`
    Env {
        #[command(flatten)]
        host: HostArgument,
    },
    /// Build against an OpenUSD SDK and install the plugin
    Install {
        /// Root of the SDK (the folder with `include/pxr/pxr.h`)
        #[arg(long)]
        usd: PathBuf,
        /// Where to install
        #[arg(long)]
        prefix: PathBuf,
    },
    /// Pack plugin, `usdrecord` and command as a Python package into `build/dist`, for `pip install`
    Wheel {
        #[command(flatten)]
        host: HostArgument,
    },
    /// Pack plugin and add-on as an extension of the host's Blender into `build/dist`, to install from disk
    Blender {
        #[command(flatten)]
        host: HostArgument,
    },
    /// Run all tests, or those whose name contains FILTER; for another host than the default one, those that ask it
    Test {
        /// Part of a test's name
        filter: Option<String>,
        /// Take all seeds where a few tell nearly as much, and run tests through Hydra in both front ends
        #[arg(long)]
        full: bool,
        #[command(flatten)]
        host: HostArgument,
    },
    /// Formatting, lints, documentation, crate graph, words, lengths of files and lines, documents
    Check {
        /// Only what needs no compiler: words, lengths, documents, crate graph, formatting
        #[arg(long)]
        fast: bool,
    },
    /// Generate the tables of the documents, check links and paths, build the book into `target/book`
    Book {
        /// Show it in the browser
        #[arg(long)]
        open: bool,
    },
    /// Render the gallery's scenes and put them on one sheet, `build/gallery/gallery.jpg`
    #[command(disable_help_flag = true)]
    Gallery {
        /// Handed to `tests/gallery/render.py` as they are
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<OsString>,
    },
    /// Make the references of the feature scenes anew with Mitsuba: `reference
    /// [to_mitsuba|check_answers|time_to_error|curves] ...`
    #[command(disable_help_flag = true)]
    Reference {
        /// A program of `tests/reference` and its arguments
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<OsString>,
    },
    /// Measure through real hosts: `bench sets ...` renders whole sets with ever less device memory
    #[command(disable_help_flag = true)]
    Bench {
        /// A program of `tests/bench` and its arguments
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<OsString>,
    },
    /// What the Vulkan devices of this machine can do (the `oocpt doctor` of the clone)
    #[command(disable_help_flag = true)]
    Doctor {
        /// Handed to `oocpt doctor` as they are
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<OsString>,
    },
}

fn main() -> ExitCode {
    match perform(Arguments::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            say(format_args!("error: {error:#}"));
            ExitCode::FAILURE
        }
    }
}

fn perform(task: XtaskCommand) -> Result<()> {
    let places = RootFolders::from_env()?;
    let of = |host: HostArgument| RootFolders { wheel: host.host, ..places.clone() };
    match task {
        XtaskCommand::Setup { host } => set_up(&of(host)).map(drop),
        XtaskCommand::Build { host } => build(&of(host)).map(drop),
        XtaskCommand::Record { arguments } => record(&places, &arguments),
        XtaskCommand::Env { host } => print_env(&of(host)),
        XtaskCommand::Wheel { host } => {
            let places = of(host);
            product::pack(&places, &set_up(&places)?)
        }
        XtaskCommand::Blender { host } => {
            let places = of(host);
            product::pack_for_blender(&places, &set_up(&places)?)
        }
        XtaskCommand::Install { usd, prefix } => install(&places, &usd, &prefix),
        XtaskCommand::Test { filter, full, host } => {
            let places = of(host);
            let interpreter = set_up(&places)?;
            testing::run(&places, &interpreter, testing::TestExtent { filter: filter.as_deref(), full })
        }
        XtaskCommand::Check { fast } => {
            system::prepare(system::NeededFor::Check, places.wheel)?;
            check::run_all(&places, if fast { check::CheckDepth::Text } else { check::CheckDepth::Compiled })
        }
        XtaskCommand::Book { open } => book::make(&places, open),
        XtaskCommand::Gallery { arguments } => {
            build(&places)?;
            picture::gallery(&places, &arguments)
        }
        XtaskCommand::Reference { arguments } => picture::reference(&places, &set_up(&places)?, &arguments),
        XtaskCommand::Bench { arguments } => {
            let (script, rest) = measure::script_of(&arguments)?;
            build(&places)?;
            measure::bench(&places, script, rest)
        }
        XtaskCommand::Doctor { arguments } => doctor(&places, &arguments),
    }
}

fn set_up(places: &RootFolders) -> Result<PythonInterpreter> {
    system::prepare(system::NeededFor::Build, places.wheel)?;
    let interpreter = host::find_interpreter(places.wheel).with_context(|| {
        format!("no CPython {} with headers and venv; name one in OOCPT_PYTHON", places.wheel.python)
    })?;
    host::prepare(places, &interpreter)?;
    Ok(interpreter)
}

fn build(places: &RootFolders) -> Result<PythonInterpreter> {
    let interpreter = set_up(places)?;
    product::build_for_wheel(places, &interpreter)?;
    Ok(interpreter)
}

/// Becomes `usdrecord`: returns only if that cannot be started.
fn record(places: &RootFolders, arguments: &[OsString]) -> Result<()> {
    let (settings, sdk) = settings_for_recording(places)?;
    let program = sdk.as_ref().map_or_else(|| places.wheel_bin(), |usd| usd.join("bin")).join("usdrecord");
    let mut usdrecord = Command::new(program);
    shell::apply(&settings, &mut usdrecord);
    if !names_one_of(arguments, &["--renderer", "-r"]) {
        usdrecord.args(["--renderer", "OocPT"]);
    }
    // An SDK's usdrecord opens a GL window unless told not to; OocPT draws without one.
    if sdk.is_some() && !names_one_of(arguments, &["--disableGpu"]) {
        usdrecord.arg("--disableGpu");
    }
    let error = usdrecord.args(arguments).exec();
    Err(error).with_context(|| format!("cannot start {}", usdrecord.get_program().display()))
}

fn names_one_of(arguments: &[OsString], flags: &[&str]) -> bool {
    let is_named = |word: &str| {
        flags.iter().any(|flag| word == *flag || word.strip_prefix(flag).is_some_and(|rest| rest.starts_with('=')))
    };
    arguments.iter().any(|word| is_named(&word.to_string_lossy()))
}

/// Builds for the SDK that `OOCPT_USD_ROOT` names, else for the wheel host; returns how to reach its `usdrecord`.
fn settings_for_recording(places: &RootFolders) -> Result<(Vec<shell::VariableSetting>, Option<PathBuf>)> {
    let Some(usd) = shell::sdk_root()? else {
        build(places)?;
        return Ok((shell::for_wheel(places), None));
    };
    system::prepare(system::NeededFor::Build, places.wheel)?;
    let prefix = product::install_for_sdk(places, &usd, &places.repo.join("build/sdk"))?;
    Ok((shell::for_sdk(&usd, &prefix), Some(usd)))
}

#[expect(clippy::print_stdout, reason = "the answer is for the shell that evaluates it")]
fn print_env(places: &RootFolders) -> Result<()> {
    let (settings, _) = settings_for_recording(places)?;
    print!("{}", shell::exports(&settings));
    Ok(())
}

fn install(places: &RootFolders, usd: &Path, prefix: &Path) -> Result<()> {
    system::prepare(system::NeededFor::Build, places.wheel)?;
    let prefix = product::install_for_sdk(places, usd, prefix)?;
    say(format_args!(
        "installed; hosts find it with PXR_PLUGINPATH_NAME={}",
        prefix.join(shell::INSTALLED_RESOURCES).display()
    ));
    Ok(())
}

/// Becomes `oocpt doctor`.
fn doctor(places: &RootFolders, arguments: &[OsString]) -> Result<()> {
    system::prepare(system::NeededFor::Build, places.wheel)?;
    let mut cargo = product::cargo(places, "run");
    cargo.args(["--quiet", "--profile", product::PROFILE, "--package", "oocpt-cli", "--bin", "oocpt", "--", "doctor"]);
    if names_one_of(arguments, &["--scene"]) {
        // A USD file is inspected through the host that `record` uses.
        let (settings, _) = settings_for_recording(places)?;
        shell::apply(&settings, &mut cargo);
    }
    Err(cargo.args(arguments).exec()).context("cannot start cargo")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        <Arguments as clap::CommandFactory>::command().debug_assert();
    }

    #[test]
    fn usdrecord_flags_pass_untouched() {
        let words = ["xtask", "record", "--imageWidth", "64", "-r", "Storm", "--help", "a.usda", "b.exr"];
        let XtaskCommand::Record { arguments } = Arguments::parse_from(words).command else {
            panic!("not a record task")
        };
        assert_eq!(arguments, words[2..], "order and dashes are kept");
        assert!(names_one_of(&arguments, &["--renderer", "-r"]), "short flag");
        assert!(names_one_of(&["--renderer=GL".into()], &["--renderer", "-r"]), "joined value");
        assert!(
            !names_one_of(&["--renderSettingsPrimPath".into(), "-rs".into()], &["--renderer", "-r"]),
            "other flags"
        );
    }
}
