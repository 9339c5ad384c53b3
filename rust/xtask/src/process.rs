// SPDX-License-Identifier: Apache-2.0
//! Child processes: run one, fail with the command line, keep stdout clean.
//!
//! `cargo xtask env` is evaluated by a shell, so nothing but its answer may reach stdout: children write to stderr
//! unless they are captured.

use std::ffi::OsStr;
use std::fmt::Display;
use std::io;
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail};

/// Prints what is being done for the user, on stderr.
pub(crate) fn say(what: impl Display) {
    #[expect(clippy::print_stderr, reason = "the door talks to a person or to a CI log")]
    {
        eprintln!("xtask: {what}");
    }
}

/// Runs `command` to its end with stdout sent to stderr and no stdin.
///
/// # Errors
/// If it cannot be started or does not succeed; the error quotes the command line.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let status = command
        .stdin(Stdio::null())
        .stdout(Stdio::from(io::stderr()))
        .status()
        .with_context(|| format!("cannot start `{}`", quoted(command)))?;
    if !status.success() {
        bail!("`{}` failed: {status}", quoted(command));
    }
    Ok(())
}

/// Runs `command` and returns what it wrote to stdout; its stderr passes through.
///
/// # Errors
/// As [`run`]; also if the output is not UTF-8.
pub(crate) fn capture(command: &mut Command) -> Result<String> {
    let output = command
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("cannot start `{}`", quoted(command)))?;
    if !output.status.success() {
        bail!("`{}` failed: {}", quoted(command), output.status);
    }
    String::from_utf8(output.stdout).with_context(|| format!("`{}` wrote no UTF-8", quoted(command)))
}

/// Returns true if `program` can be started and succeeds with `args`, all output dropped.
pub(crate) fn succeeds<I, S>(program: impl AsRef<OsStr>, args: I) -> bool
where
    I: IntoIterator<Item = S>,
    S: AsRef<OsStr>,
{
    Command::new(program)
        .args(args)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// `value` as one word of a POSIX shell.
pub(crate) fn shell_word(value: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./:=,+@%".contains(c);
    if !value.is_empty() && value.chars().all(plain) {
        return value.to_owned();
    }
    format!("'{}'", value.replace('\'', r"'\''"))
}

fn quoted(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(|word| shell_word(&word.to_string_lossy())).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shell_words_survive_a_shell() {
        for value in ["plain/path-1.0", "", "two words", "it's", "$HOME `x` \"q\" \\ ;"] {
            let echoed = capture(Command::new("sh").args(["-c", &format!("printf %s {}", shell_word(value))])).unwrap();
            assert_eq!(echoed, value, "word {value:?}");
        }
    }

    #[test]
    fn a_failure_quotes_the_command() {
        let message = run(Command::new("sh").args(["-c", "exit 3"])).unwrap_err().to_string();
        assert!(message.contains("sh -c 'exit 3'") && message.contains('3'), "{message}");
    }
}
