// SPDX-License-Identifier: Apache-2.0
//! Runs a program and says what it used: seconds, processor seconds, peak of memory. Linux and other Unix systems.
//!
//! The peak is the kernel's own (`ru_maxrss`), which begins with this program's, from which the other one was made; so
//! nothing large may ever be held here. Of descendants, those count that the program waited for.

use anyhow::{Context, Result, bail};
use oocpt_command::stop;
use std::process::Command;
use std::sync::mpsc;
use std::time::{Duration, Instant};
use wait4::Wait4 as _;

/// What a program used.
#[derive(Clone, Copy, Debug)]
pub(super) struct Used {
    pub(super) is_success: bool,
    /// From start to end.
    pub(super) secs: f64,
    /// Of all its threads, in user and in system mode.
    pub(super) cpu_secs: f64,
    /// The most memory that was resident at a time, bytes.
    pub(super) peak_bytes: u64,
}

/// Runs a program to its end; one that takes longer than `timeout` is ended, and that is an error.
pub(super) fn run(command: &mut Command, timeout: Duration) -> Result<Used> {
    let started = Instant::now();
    let (mut child, running) =
        stop::start(command).with_context(|| format!("cannot start {}", command.get_program().display()))?;
    let id = rustix::process::Pid::from_child(&child);
    let (done, is_done) = mpsc::channel::<()>();
    let (ended, is_late) = std::thread::scope(|scope| {
        let watch = scope.spawn(move || {
            let is_late = is_done.recv_timeout(timeout) == Err(mpsc::RecvTimeoutError::Timeout);
            // Nobody has waited for it yet, so the id is still its own.
            is_late && rustix::process::kill_process(id, rustix::process::Signal::KILL).is_ok()
        });
        let ended = child.wait4();
        drop(done);
        (ended, watch.join().unwrap_or(false))
    });
    drop(running);
    let secs = started.elapsed().as_secs_f64();
    let used = ended.with_context(|| format!("cannot wait for {}", command.get_program().display()))?;
    if is_late {
        bail!("it took longer than {} s and was ended (--timeout)", timeout.as_secs_f64());
    }
    Ok(Used {
        is_success: used.status.success(),
        secs,
        cpu_secs: (used.rusage.utime + used.rusage.stime).as_secs_f64(),
        peak_bytes: used.rusage.maxrss,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str, timeout: f64) -> Result<Used> {
        run(Command::new("sh").args(["-c", script]), Duration::from_secs_f64(timeout))
    }

    #[test]
    fn processor_time_is_that_of_the_child_alone() {
        let idle = shell("sleep 0.3", 60.0).expect("it runs");
        assert!(idle.is_success && idle.secs >= 0.3 && idle.cpu_secs < 0.2, "waiting is no work: {idle:?}");
        let busy = shell("i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done; exit 3", 60.0).expect("it runs");
        assert!(!busy.is_success && busy.cpu_secs > 0.02, "work is: {busy:?}");
        assert!(busy.cpu_secs <= 1.05 * busy.secs + 0.02, "of one thread: {busy:?}");
        // `head` keeps one block of 96 MiB, which `sh` waits for.
        let large = shell("dd if=/dev/zero of=/dev/null bs=96M count=1 2>/dev/null", 60.0).expect("it runs");
        assert!(large.peak_bytes >= 96 << 20, "its block: {large:?}");
        assert!(idle.peak_bytes < 64 << 20, "nobody else's: {idle:?}");
    }

    #[test]
    fn a_program_that_takes_too_long_is_ended() {
        let started = Instant::now();
        let error = shell("exec sleep 60", 0.2).expect_err("too long");
        assert!(started.elapsed() < Duration::from_secs(30), "it does not wait for it");
        assert!(format!("{error:#}").contains("longer than 0.2 s"), "{error:#}");
        let none = run(&mut Command::new("/no/such/program"), Duration::from_secs(1)).expect_err("nothing there");
        assert!(format!("{none:#}").contains("/no/such/program"), "{none:#}");
    }
}
