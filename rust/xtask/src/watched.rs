// SPDX-License-Identifier: Apache-2.0
//! Children that run beside others: what they write comes out in whole lines, and one that hangs is ended.

use std::io::{Read as _, Write as _};
use std::process::{Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Duration;

use anyhow::{Context as _, Result};

use crate::process::say;

/// How a child is watched.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Watched<'a> {
    /// What each of its lines begins with.
    pub(crate) mark: &'a str,
    /// Without a word for so long it is killed; none = never.
    pub(crate) patience: Option<Duration>,
}

impl Watched<'_> {
    /// Runs a command to its end, standard error with standard output; its exit status, -1 where a signal ended it.
    ///
    /// # Errors
    /// If it cannot be started, or nobody takes the lines.
    pub(crate) fn status(self, command: &mut Command) -> Result<i32> {
        let program = command.get_program().to_owned();
        let (mut reader, writer) = std::io::pipe().context("no pipe")?;
        let errors = writer.try_clone().context("no pipe")?;
        let mut child = command
            .stdin(Stdio::null())
            .stdout(writer)
            .stderr(errors)
            .spawn()
            .with_context(|| format!("cannot start {}", program.display()))?;
        // The command holds the pipe's other end, which has to be closed for the last byte to be the last.
        command.stdout(Stdio::null()).stderr(Stdio::null());
        let (sender, receiver) = sync_channel(16);
        // Not joined: what a killed child has started may hold the pipe open.
        thread::spawn(move || {
            let mut chunk = [0; 1 << 13];
            while let Ok(count @ 1..) = reader.read(&mut chunk) {
                if sender.send(chunk[..count].to_vec()).is_err() {
                    break;
                }
            }
        });
        let mut begun = Vec::new();
        loop {
            let patience = self.patience.unwrap_or(Duration::MAX);
            match receiver.recv_timeout(patience) {
                Ok(chunk) => {
                    begun.extend(chunk);
                    let whole = begun.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1);
                    self.print(&begun[..whole])?;
                    begun.drain(..whole);
                }
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => {
                    say(format_args!("no word for {} s, ended: {}", patience.as_secs(), program.display()));
                    child.kill().context("cannot end the child")?;
                    break;
                }
            }
        }
        self.print(&begun)?;
        Ok(child.wait().context("lost the child")?.code().unwrap_or(-1))
    }

    fn print(self, bytes: &[u8]) -> Result<()> {
        let mut out = std::io::stdout().lock();
        for line in bytes.split_inclusive(|byte| *byte == b'\n') {
            let end: &[u8] = if line.ends_with(b"\n") { b"" } else { b"\n" };
            out.write_all(&[self.mark.as_bytes(), line, end].concat()).context("cannot write")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    fn shell(script: &str) -> Command {
        let mut shell = Command::new("sh");
        shell.args(["-c", script]);
        shell
    }

    #[test]
    fn a_child_tells_its_status() {
        let status = |mut command: Command| Watched::default().status(&mut command);
        assert_eq!(status(shell("echo out; echo err >&2; exit 3")).unwrap(), 3, "of the shell");
        assert_eq!(status(shell("kill -9 $$")).unwrap(), -1, "a signal");
        assert!(status(Command::new("/no such program")).is_err(), "it cannot be started");
    }

    #[test]
    fn a_child_that_hangs_is_ended_and_one_that_talks_is_not() {
        let watched = Watched { patience: Some(Duration::from_secs(2)), ..Watched::default() };
        let begin = Instant::now();
        assert_eq!(watched.status(&mut shell("printf begun; exec sleep 60")).unwrap(), -1, "killed");
        assert!(begin.elapsed() < Duration::from_secs(30), "long before its end");
        let script = "for i in 1 2 3 4 5 6; do echo $i; sleep 0.5; done; exit 4";
        assert_eq!(watched.status(&mut shell(script)).unwrap(), 4, "three seconds, but never two without a word");
    }
}
