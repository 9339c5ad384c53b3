// SPDX-License-Identifier: Apache-2.0
//! SIGINT and SIGTERM: ends the programs that were started, removes temporary files, and exits with status 130.
//!
//! Nothing in this process blocks for more than a moment then. The code that started a program or made a temporary
//! folder mostly cleans up by itself, once the program has ended; the rest is done here.

use anyhow::{Context as _, Result};
use rustix::process::{Pid, Signal, kill_process};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Exit status of a command that was interrupted.
const INTERRUPTED: i32 = 130;
/// Time between the first and the second signal to a program: our `usdrecord` ends at once at the second.
const PAUSE: Duration = Duration::from_millis(100);
/// The time that programs and their callers have to clean up.
const PATIENCE: Duration = Duration::from_millis(500);

/// The programs and folders to clean up.
#[derive(Debug)]
struct StopState {
    is_stopping: bool,
    /// True if the command has returned.
    is_done: bool,
    programs: Vec<Pid>,
    folders: Vec<PathBuf>,
}

static STATE: Mutex<StopState> =
    Mutex::new(StopState { is_stopping: false, is_done: false, programs: Vec::new(), folders: Vec::new() });
static CHANGED: Condvar = Condvar::new();

fn state() -> MutexGuard<'static, StopState> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A program that was started, as long as nobody has waited for it.
#[derive(Debug)]
pub struct StartedProgram {
    id: Pid,
}

impl Drop for StartedProgram {
    fn drop(&mut self) {
        state().programs.retain(|id| *id != self.id);
        CHANGED.notify_all();
    }
}

/// Starts a program that ends when this process is interrupted; none is started any more then. The second value goes
/// when the program was waited for.
pub fn start(command: &mut Command) -> std::io::Result<(Child, StartedProgram)> {
    let mut state = state();
    if state.is_stopping {
        return Err(std::io::ErrorKind::Interrupted.into());
    }
    let child = command.spawn()?;
    let id = Pid::from_child(&child);
    state.programs.push(id);
    Ok((child, StartedProgram { id }))
}

/// A temporary folder that is removed with everything in it, also when this process is interrupted.
#[derive(Debug)]
pub struct TemporaryFolder(PathBuf);

impl TemporaryFolder {
    /// Makes the folder, which must not be there.
    pub fn create(path: PathBuf) -> Result<Self> {
        let mut state = state();
        std::fs::create_dir(&path).with_context(|| format!("cannot make {}", path.display()))?;
        state.folders.push(path.clone());
        Ok(Self(path))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        if let Err(error) = std::fs::remove_dir_all(&self.0) {
            tracing::warn!(folder = %self.0.display(), %error, "a temporary folder is left");
        }
        state().folders.retain(|folder| *folder != self.0);
    }
}

/// Listens from now on. Call it first.
pub fn listen() -> Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM]).context("signals cannot be heard")?;
    let heard = move || {
        let mut is_first = true;
        for _signal in signals.forever() {
            if !is_first {
                end_at_once();
            }
            is_first = false;
            // Another thread does it, so that a second signal is handled meanwhile.
            if std::thread::Builder::new().name("stop".to_owned()).spawn(end).is_err() {
                end_at_once();
            }
        }
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(heard).context("signals cannot be heard")?;
    Ok(())
}

/// The command has returned; never returns itself when this process is about to end with another status.
pub fn done() {
    let mut state = state();
    state.is_done = true;
    CHANGED.notify_all();
    while state.is_stopping {
        state = CHANGED.wait(state).unwrap_or_else(PoisonError::into_inner);
    }
}

/// Ends programs, waits a moment for those who clean up after them, ends this process.
fn end() {
    let mut state = state();
    state.is_stopping = true;
    if !state.programs.is_empty() {
        tell(&state.programs, Signal::TERM);
        state = wait(state, PAUSE, |state| state.programs.is_empty());
        tell(&state.programs, Signal::TERM);
        state = wait(state, PATIENCE, |state| state.programs.is_empty());
        drop(wait(state, PATIENCE, |state| state.is_done));
    } else {
        drop(state);
    }
    end_at_once();
}

/// Kills the remaining programs, removes the folders and ends this process.
fn end_at_once() -> ! {
    let state = state();
    tell(&state.programs, Signal::KILL);
    for folder in &state.folders {
        if let Err(error) = std::fs::remove_dir_all(folder) {
            tracing::debug!(folder = %folder.display(), %error, "a temporary folder is left");
        }
    }
    if let Err(error) = writeln!(std::io::stderr(), "oocpt: interrupted") {
        tracing::debug!(%error, "nobody hears");
    }
    // This skips the destructors of libraries whose threads are still at work.
    signal_hook::low_level::exit(INTERRUPTED)
}

fn tell(programs: &[Pid], signal: Signal) {
    for id in programs {
        let killed = kill_process(*id, signal);
        tracing::debug!(?id, ?signal, ?killed, "a program is to end");
    }
}

fn wait<'a>(
    state: MutexGuard<'a, StopState>,
    most: Duration,
    is_so: fn(&StopState) -> bool,
) -> MutexGuard<'a, StopState> {
    let end = Instant::now() + most;
    let mut state = state;
    while !is_so(&state) {
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            break;
        }
        state = CHANGED.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
    }
    state
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_known_until_it_was_waited_for() {
        let (mut child, started) = start(Command::new("sleep").arg("60")).expect("it starts");
        let id = Pid::from_child(&child);
        assert!(state().programs.contains(&id), "it would be ended");
        tell(&[id], Signal::TERM);
        assert!(!child.wait().expect("it ends").success(), "it was ended");
        drop(started);
        assert!(!state().programs.contains(&id), "its number may be another's");
    }

    #[test]
    fn a_folder_is_known_until_it_is_removed() {
        let path = std::env::temp_dir().join(format!("oocpt-stop-{}", std::process::id()));
        let folder = TemporaryFolder::create(path.clone()).expect("a temporary folder");
        std::fs::write(folder.path().join("file"), "x").expect("a file");
        assert!(state().folders.contains(&path), "it would be removed");
        assert!(TemporaryFolder::create(path.clone()).is_err(), "it is ours alone");
        drop(folder);
        assert!(!path.exists() && !state().folders.contains(&path), "it is gone");
    }
}
