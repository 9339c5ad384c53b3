// SPDX-License-Identifier: Apache-2.0
//! Pictures to look at and to compare with: the gallery, and references made with Mitsuba 3 or `MaterialX`'s shaders.
//!
//! Mitsuba is a test tool in an environment of its own; nothing of the product and none of its tests needs it. The work
//! is done by Python programs below `tests/gallery` and `tests/reference`; here they are given their interpreter and
//! their paths.

use std::ffi::OsString;
use std::os::unix::process::CommandExt as _;
use std::process::Command;

use anyhow::{Context as _, Result, ensure};

use crate::host::{self, PythonInterpreter, REFERENCE_VENV, USD_VENV};
use crate::places::RootFolders;
use crate::{shell, system};

/// Becomes the program that renders the gallery; the plugin is built already.
///
/// # Errors
/// If Python cannot be started.
pub(crate) fn gallery(places: &RootFolders, arguments: &[OsString]) -> Result<()> {
    let mut render = Command::new(places.venv_python(USD_VENV.name));
    shell::apply(&shell::for_wheel(places), &mut render);
    render.arg(places.repo.join("tests/gallery/render.py")).args(arguments);
    Err(render.exec()).context("cannot start the gallery")
}

/// Becomes a program of `tests/reference`, `make_references` unless the first argument names one; the plugin need not
/// be built.
///
/// # Errors
/// If the environment cannot be made, there is no LLVM, or no such program.
pub(crate) fn reference(places: &RootFolders, interpreter: &PythonInterpreter, arguments: &[OsString]) -> Result<()> {
    host::prepare_extra(places, interpreter, &REFERENCE_VENV)?;
    let (program, rest) = program_of(arguments);
    let script = places.repo.join("tests/reference").join(format!("{program}.py"));
    ensure!(script.is_file(), "tests/reference holds no program {program}");
    let mut reference = Command::new(places.venv_python(REFERENCE_VENV.name));
    shell::apply(&shell::for_wheel(places), &mut reference);
    if program != "nodes" {
        reference.env("DRJIT_LIBLLVM_PATH", system::llvm()?);
    }
    Err(reference.arg(script).args(rest).exec()).context("cannot start the reference renderer")
}

/// The program that the first argument names, and what is left for it; words with a dash are options of the default
/// one.
fn program_of(arguments: &[OsString]) -> (String, &[OsString]) {
    const PROGRAMS: &[&str] = &["make_references", "to_mitsuba", "check_answers", "time_to_error", "curves", "nodes"];
    match arguments.split_first() {
        Some((first, rest)) if PROGRAMS.iter().any(|program| first == program) => {
            (first.to_string_lossy().into_owned(), rest)
        }
        _ => (PROGRAMS[0].to_owned(), arguments),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_word_may_name_a_program() {
        let words: Vec<OsString> = ["to_mitsuba", "a.usda", "b.exr"].map(Into::into).into();
        assert_eq!(program_of(&words), ("to_mitsuba".to_owned(), &words[1..]), "named");
        assert_eq!(program_of(&words[1..]), ("make_references".to_owned(), &words[1..]), "a scene is no program");
        assert_eq!(program_of(&[]), ("make_references".to_owned(), &[][..]), "nothing");
    }
}
