// SPDX-License-Identifier: Apache-2.0
//! Benches through real hosts: Python programs below `tests/bench` that need no cargo, so that they can be copied to a
//! machine that has only a GPU. They get their interpreter and their paths here. Benches that need no host are in
//! `oocpt bench`.

use std::ffi::OsString;
use std::os::unix::process::CommandExt as _;
use std::process::Command;

use anyhow::{Context as _, Result, bail};

use crate::host::USD_VENV;
use crate::places::RootFolders;
use crate::shell;

/// The benches and their programs.
const PROGRAMS: [(&str, &str); 3] = [("sets", "measure_sets.py"), ("beside", "beside.py"), ("live", "measure_live.py")];

/// The program that the first argument names, and the remaining arguments.
///
/// # Errors
/// The first argument names no program.
pub(crate) fn script_of(arguments: &[OsString]) -> Result<(&'static str, &[OsString])> {
    if let Some((first, rest)) = arguments.split_first()
        && let Some((_, script)) = PROGRAMS.iter().find(|(name, _)| first == name)
    {
        return Ok((script, rest));
    }
    let names: Vec<_> = PROGRAMS.iter().map(|(name, _)| *name).collect();
    bail!("name a bench: {}; what needs no host is measured by `oocpt bench`", names.join(", "))
}

/// Becomes a program of `tests/bench`; the plugin is built already.
///
/// # Errors
/// If Python cannot be started.
pub(crate) fn bench(places: &RootFolders, script: &str, arguments: &[OsString]) -> Result<()> {
    let mut python = Command::new(places.venv_python(USD_VENV.name));
    shell::apply(&shell::for_wheel(places), &mut python);
    python.arg(places.repo.join("tests/bench").join(script)).args(arguments);
    Err(python.exec()).context("cannot start the bench")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_word_names_the_bench() {
        let words: Vec<OsString> = ["sets", "--seed", "3"].map(Into::into).into();
        assert_eq!(script_of(&words).unwrap(), ("measure_sets.py", &words[1..]), "the rest is its own");
        let message = script_of(&words[1..]).unwrap_err().to_string();
        assert!(message.contains("name a bench: sets, beside, live;"), "{message}");
        assert!(script_of(&[]).is_err(), "nothing");
    }
}
