// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench`: benches are a program of their own, which is not shipped. It is run from beside this one, so that
//! both are of one build.

use anyhow::{Context as _, Result, bail};
use std::ffi::OsString;
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::Command;

/// The program.
const PROGRAM: &str = "oocpt-bench";

/// Options of `oocpt bench`: they are the other program's.
#[derive(clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Arguments {
    /// Bench and options.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Becomes the program.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let own = std::env::current_exe().context("where this program is, is not known")?;
    become_program(&own, &arguments.arguments)
}

/// `own`: this program, beside which the other one is.
fn become_program(own: &Path, arguments: &[OsString]) -> Result<()> {
    let program = own.with_file_name(PROGRAM);
    if !program.is_file() {
        bail!(
            "there is no {}: `cargo build --release -p {PROGRAM}` in the clone builds it; put it there",
            program.display()
        );
    }
    Err(Command::new(&program).args(arguments).exec()).with_context(|| format!("cannot start {}", program.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_bench_program_is_told_in_one_line_with_its_command() {
        let error = become_program(Path::new("/no/such/folder/oocpt"), &[]).expect_err("it is not there");
        let text = format!("{error:#}");
        assert!(text.contains("/no/such/folder/oocpt-bench") && !text.contains('\n'), "{text}");
        assert!(text.contains("cargo build --release -p oocpt-bench"), "{text}");
    }
}
