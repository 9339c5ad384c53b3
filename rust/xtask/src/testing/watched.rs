// SPDX-License-Identifier: Apache-2.0
//! Processes that run beside others: what they write comes out in whole marked lines, one that hangs is ended, and each
//! test's time is known from when its line came.

use std::io::{Read as _, Write as _};
use std::process::{Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};

use crate::process::say;

/// How libtest and pytest begin or end the line of a test that has ended.
const OF_A_TEST: [&str; 4] = [" ... ok\n", " ... FAILED\n", " PASSED", " FAILED"];

/// How a process is watched.
#[derive(Clone, Copy, Debug)]
pub(super) struct WatchedProcess<'a> {
    /// What each of its lines begins with.
    pub(super) mark: &'a str,
    /// Without a word for so long it is killed.
    pub(super) patience: Duration,
}

/// How long a test took, and its mark and name.
pub(super) type TimedTest = (Duration, String);

impl WatchedProcess<'_> {
    /// Runs a command to its end, standard error with standard output; its exit status, -1 where a signal ended it, and
    /// its tests, which run one after the other.
    ///
    /// # Errors
    /// If it cannot be started, or nobody takes the lines.
    pub(super) fn run(self, command: &mut Command) -> Result<(i32, Vec<TimedTest>)> {
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
        let (mut begun, mut tests, mut last) = (Vec::new(), Vec::new(), Instant::now());
        loop {
            match receiver.recv_timeout(self.patience) {
                Ok(chunk) => {
                    begun.extend(chunk);
                    let whole = begun.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
                    let lines: Vec<u8> = begun.drain(..whole).collect();
                    self.print(&lines)?;
                    for test in String::from_utf8_lossy(&lines).split_inclusive('\n').filter_map(test_of) {
                        tests.push((last.elapsed(), format!("{}{test}", self.mark)));
                        last = Instant::now();
                    }
                }
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => {
                    let seconds = self.patience.as_secs();
                    say(format_args!("{}no word for {seconds} s, ended: {}", self.mark, program.display()));
                    child.kill().context("cannot end the child")?;
                    break;
                }
            }
        }
        self.print(&begun)?;
        Ok((child.wait().context("lost the child")?.code().unwrap_or(-1), tests))
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

/// The name of the test whose end a line tells.
fn test_of(line: &str) -> Option<&str> {
    let (name, _) = OF_A_TEST.iter().find_map(|ending| line.split_once(ending))?;
    Some(name.strip_prefix("test ").unwrap_or(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut shell = Command::new("sh");
        shell.args(["-c", script]);
        shell
    }

    fn watched(seconds: u64) -> WatchedProcess<'static> {
        WatchedProcess { mark: "[sh] ", patience: Duration::from_secs(seconds) }
    }

    #[test]
    fn a_child_tells_its_status() {
        let status = |mut command: Command| watched(60).run(&mut command).map(|(status, _)| status);
        assert_eq!(status(shell("echo out; echo err >&2; exit 3")).unwrap(), 3, "of the shell");
        assert_eq!(status(shell("kill -9 $$")).unwrap(), -1, "a signal");
        assert!(status(Command::new("/no such program")).is_err(), "it cannot be started");
    }

    #[test]
    fn a_child_that_hangs_is_ended_and_one_that_talks_is_not() {
        let begin = Instant::now();
        assert_eq!(watched(2).run(&mut shell("printf begun; exec sleep 60")).unwrap().0, -1, "killed");
        assert!(begin.elapsed() < Duration::from_secs(30), "long before its end");
        let script = "for i in 1 2 3 4 5 6; do echo $i; sleep 0.5; done; exit 4";
        assert_eq!(watched(2).run(&mut shell(script)).unwrap().0, 4, "three seconds, but never two without a word");
    }

    #[test]
    fn lines_of_tests_are_known_and_timed() {
        let script = "echo 'running 2 tests'; echo 'test a::b ... ok'; sleep 0.5; echo 'test a::c ... FAILED'; \
                      echo 'tests/x.py::test_d[e] PASSED [ 50%]'";
        let (_, tests) = watched(60).run(&mut shell(script)).unwrap();
        let names: Vec<&str> = tests.iter().map(|(_, name)| name.as_str()).collect();
        assert_eq!(names, ["[sh] a::b", "[sh] a::c", "[sh] tests/x.py::test_d[e]"]);
        assert!(tests[1].0 >= Duration::from_millis(400), "of the second: {:?}", tests[1].0);
    }
}
