// SPDX-License-Identifier: Apache-2.0
//! Processes that run beside others: their output is printed in whole marked lines, one that hangs is killed, and each
//! test's processor time is measured by its line, so that what runs beside it does not count.

use std::collections::VecDeque;
use std::fs;
use std::io::{Read as _, Write as _};
use std::process::{Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Duration;

use anyhow::{Context as _, Result};

use crate::process::say;

/// The end or beginning of the line in which libtest and pytest report a finished test.
const OF_A_TEST: [&str; 4] = [" ... ok\n", " ... FAILED\n", " PASSED", " FAILED"];

/// Number of lines of a process that are kept: what libtest and pytest say of their failed tests ends with such.
const LAST_LINES: usize = 60;

/// The settings for watching a process.
#[derive(Clone, Copy, Debug)]
pub(super) struct WatchedProcess<'a> {
    /// The prefix of each of its lines.
    pub(super) mark: &'a str,
    /// It is killed after so long without output.
    pub(super) patience: Duration,
}

/// The processor time of a test, with its mark and name.
pub(super) type TimedTest = (Duration, String);

/// What a process that ended did.
#[derive(Debug)]
pub(super) struct EndedProcess {
    /// -1 if a signal ended it.
    pub(super) status: i32,
    /// Its last lines, without the mark.
    pub(super) last_lines: Vec<String>,
    /// Its tests, which ran one after the other.
    pub(super) tests: Vec<TimedTest>,
    /// Of the process and of those that it waited for.
    pub(super) processor_time: Duration,
}

impl WatchedProcess<'_> {
    /// Runs a command to its end, with standard error in standard output.
    ///
    /// # Errors
    /// It cannot be started, or nobody takes the lines.
    pub(super) fn run(self, command: &mut Command) -> Result<EndedProcess> {
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
        // The thread is not joined: children of a killed process may hold the pipe open.
        thread::spawn(move || {
            let mut chunk = [0; 1 << 13];
            while let Ok(count @ 1..) = reader.read(&mut chunk) {
                if sender.send(chunk[..count].to_vec()).is_err() {
                    break;
                }
            }
        });
        let (mut begun, mut tests, mut last) = (Vec::new(), Vec::new(), Duration::ZERO);
        let mut last_lines = VecDeque::new();
        loop {
            match receiver.recv_timeout(self.patience) {
                Ok(chunk) => {
                    begun.extend(chunk);
                    let whole = begun.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
                    let lines: Vec<u8> = begun.drain(..whole).collect();
                    self.print(&lines)?;
                    let lines = String::from_utf8_lossy(&lines);
                    last_lines.extend(lines.lines().map(str::to_owned));
                    last_lines.drain(..last_lines.len().saturating_sub(LAST_LINES));
                    for test in lines.split_inclusive('\n').filter_map(test_of) {
                        let now = processor_time(child.id()).unwrap_or(last);
                        tests.push((now.saturating_sub(last), format!("{}{test}", self.mark)));
                        last = now;
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
        last_lines.extend(String::from_utf8_lossy(&begun).lines().map(str::to_owned));
        let processor_time = processor_time(child.id()).unwrap_or(last);
        let status = child.wait().context("lost the child")?.code().unwrap_or(-1);
        Ok(EndedProcess { status, last_lines: last_lines.into(), tests, processor_time })
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

/// The processor time that a process and the children that it waited for have taken, which Linux tells until it is
/// waited for itself (`proc_pid_stat(5)`: utime, stime, cutime, cstime, in hundredths of a second).
fn processor_time(process: u32) -> Option<Duration> {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The program's name is in parentheses and may hold spaces; the third field follows it.
    let times = stat.rsplit_once(')')?.1.split_whitespace().skip(11).take(4);
    let ticks: u64 = times.map(|ticks| ticks.parse::<u64>().ok()).sum::<Option<u64>>()?;
    Some(Duration::from_millis(10 * ticks))
}

/// The name of the test that a line reports as finished.
fn test_of(line: &str) -> Option<&str> {
    let (name, _) = OF_A_TEST.iter().find_map(|ending| line.split_once(ending))?;
    Some(name.strip_prefix("test ").unwrap_or(name))
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

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
        let status = |mut command: Command| watched(60).run(&mut command).map(|ended| ended.status);
        assert_eq!(status(shell("echo out; echo err >&2; exit 3")).unwrap(), 3, "of the shell");
        assert_eq!(status(shell("kill -9 $$")).unwrap(), -1, "a signal");
        assert!(status(Command::new("/no such program")).is_err(), "it cannot be started");
    }

    #[test]
    fn the_last_lines_of_a_child_are_kept() {
        let lines = watched(60).run(&mut shell("seq 70; printf err >&2")).unwrap().last_lines;
        assert!(lines.len() >= LAST_LINES && lines[0] != "1", "not all: {lines:?}");
        assert_eq!(lines[lines.len() - 2..], ["70", "err"]);
    }

    #[test]
    fn a_child_that_hangs_is_ended_and_one_that_talks_is_not() {
        let begin = Instant::now();
        assert_eq!(watched(2).run(&mut shell("printf begun; exec sleep 60")).unwrap().status, -1, "killed");
        assert!(begin.elapsed() < Duration::from_secs(30), "long before its end");
        let script = "for i in 1 2 3 4 5 6; do echo $i; sleep 0.5; done; exit 4";
        assert_eq!(
            watched(2).run(&mut shell(script)).unwrap().status,
            4,
            "three seconds, but never two without a word"
        );
    }

    #[test]
    fn lines_of_tests_are_known_and_timed() {
        let script = "echo 'running 2 tests'; sleep 0.5; echo 'test a::b ... ok'; i=0; \
                      while [ $i -lt 300000 ]; do i=$((i + 1)); done; echo 'test a::c ... FAILED'; \
                      echo 'tests/x.py::test_d[e] PASSED [ 50%]'; \
                      sh -c 'i=0; while [ $i -lt 300000 ]; do i=$((i + 1)); done; exit 5'";
        let EndedProcess { tests, processor_time, .. } = watched(60).run(&mut shell(script)).unwrap();
        let names: Vec<&str> = tests.iter().map(|(_, name)| name.as_str()).collect();
        assert_eq!(names, ["[sh] a::b", "[sh] a::c", "[sh] tests/x.py::test_d[e]"]);
        let [asleep, busy, _] = [0, 1, 2].map(|test: usize| tests[test].0);
        assert!(busy > asleep, "sleep takes no processor time: {tests:?}");
        assert!(processor_time > asleep + busy, "a child's counts too: {processor_time:?}, {tests:?}");
    }
}
