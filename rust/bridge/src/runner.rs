// SPDX-License-Identifier: Apache-2.0
//! The reaction of our command lines to an interrupt by the user: it decides whether there is a picture to wait for.
//!
//! A command line makes one picture after the other. While one is rendered, the first interrupt makes the render end
//! with the samples that it has, if it has any of each pixel; while a finished one is written, it is waited for. In
//! every other case, and at the second interrupt, the process is to end at once: temporary files are removed here, and
//! C++ ends it. What comes within a second of the first counts as the first: terminals and schedulers signal a process
//! and its parents, and these hand the signal on. Other hosts never call this, and nothing here knows of signals.
//!
//! Any thread; the calls of a command line come from one, [`interrupt`] from another.

use crate::guard::{BridgeError, guard};
use oocpt_render::{EarlyEnd, Session};
use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

/// Signals so soon after the first one are the same interrupt.
const TOGETHER: Duration = Duration::from_secs(1);

/// The phase of the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum RunnerPhase {
    /// There is no picture that could be delivered.
    #[default]
    Preparing,
    /// A picture is being rendered.
    Rendering,
    /// The picture is rendered, and is about to be written.
    Writing,
}

/// The state of the command line; one per process.
#[derive(Debug, Default)]
struct RunnerState {
    phase: RunnerPhase,
    /// When the first interrupt came.
    interrupted: Option<Instant>,
    /// The folder of temporary files of the picture under way; empty if there is none.
    folder: PathBuf,
    /// The sessions of this process, and their newest jobs when the picture was begun.
    sessions: Vec<(Weak<Session>, u64)>,
}

static STATE: Mutex<RunnerState> = Mutex::new(RunnerState {
    phase: RunnerPhase::Preparing,
    interrupted: None,
    folder: PathBuf::new(),
    sessions: Vec::new(),
});

fn state() -> MutexGuard<'static, RunnerState> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

impl RunnerState {
    /// The first answer of a session that has rendered for the picture under way.
    fn of_picture<T>(&self, ask: impl Fn(&Session, u64) -> Option<T>) -> Option<T> {
        self.sessions.iter().find_map(|(session, after)| ask(&*session.upgrade()?, *after))
    }

    /// Returns true if there is a picture to wait for.
    fn interrupt(&mut self, now: Instant) -> bool {
        let first = *self.interrupted.get_or_insert(now);
        now.duration_since(first) < TOGETHER
            && match self.phase {
                RunnerPhase::Preparing => false,
                RunnerPhase::Rendering => self.of_picture(Session::finish_early).is_some(),
                RunnerPhase::Writing => true,
            }
    }
}

/// Adds a session that was opened.
pub(crate) fn session_opened(session: &Arc<Session>) {
    let mut state = state();
    state.sessions.retain(|(session, _)| session.strong_count() > 0);
    state.sessions.push((Arc::downgrade(session), 0));
}

/// Begins a picture, whose temporary files are in `folder`; returns false if the command line was interrupted before.
pub(crate) fn begin_picture(folder: &str) -> Result<bool, BridgeError> {
    guard("begin_picture", || {
        let mut state = state();
        state.folder = PathBuf::from(folder);
        state.phase = RunnerPhase::Rendering;
        for (session, newest) in &mut state.sessions {
            *newest = session.upgrade().map_or(0, |session| session.generation());
        }
        Ok(state.interrupted.is_none())
    })
}

/// Notes that the picture is rendered.
pub(crate) fn picture_rendered() -> Result<(), BridgeError> {
    guard("picture_rendered", || {
        state().phase = RunnerPhase::Writing;
        Ok(())
    })
}

/// Adds to the EXR file `path` of the picture under way how it was made; it stays as it is if that fails.
pub(crate) fn annotate_picture(path: &str) -> Result<(), BridgeError> {
    guard("annotate_picture", || {
        let attributes =
            state().of_picture(|session, after| (session.generation() > after).then(|| session.picture_attributes()));
        // Another renderer's picture.
        let Some(attributes) = attributes else { return Ok(()) };
        Ok(oocpt_render::picture::annotate(Path::new(path), &attributes)?)
    })
}

/// Handles an interrupt by the user. Returns false if the process is to end at once: then temporary files are removed,
/// and the user was told.
pub(crate) fn interrupt() -> Result<bool, BridgeError> {
    guard("interrupt", || {
        let mut state = state();
        let is_second = state.interrupted.is_some();
        if state.interrupt(Instant::now()) {
            return Ok(true);
        }
        oocpt_render::textures::remove_unfinished();
        remove(&state.folder);
        let when = match (is_second, state.phase) {
            (true, _) => "a second time",
            (false, RunnerPhase::Preparing) => "before a picture was begun",
            (false, _) => "before the first sample was done",
        };
        say(&format!("OocPT: interrupted {when}; nothing is written"));
        Ok(false)
    })
}

/// Has the picture under way make a checkpoint as soon as it can; the user is told if there is nothing to keep.
pub(crate) fn make_checkpoint() -> Result<(), BridgeError> {
    guard("make_checkpoint", || {
        let state = state();
        let is_named = match state.phase {
            RunnerPhase::Rendering => {
                state.of_picture(|session, after| (session.generation() > after).then(|| session.make_checkpoint()))
            }
            RunnerPhase::Preparing | RunnerPhase::Writing => None,
        };
        match is_named {
            Some(true) => {}
            Some(false) => say("OocPT: no checkpoint: oocpt:checkpoint names no file"),
            None => say("OocPT: no checkpoint: no picture is being rendered"),
        }
        Ok(())
    })
}

/// Returns true if the command line was interrupted, and the progress of the picture under way.
pub(crate) fn interrupted() -> Result<(bool, EarlyEnd), BridgeError> {
    guard("interrupted", || {
        let state = state();
        let early = state.of_picture(Session::reached).unwrap_or(EarlyEnd { samples: 0, target: 0 });
        Ok((state.interrupted.is_some(), early))
    })
}

/// Removes the folder; others may still be writing into it.
fn remove(folder: &Path) {
    const TIMES: u32 = 10;
    for _ in 0..TIMES {
        if folder.as_os_str().is_empty() || !folder.exists() || std::fs::remove_dir_all(folder).is_ok() {
            return;
        }
    }
}

fn say(line: &str) {
    let mut errors = std::io::stderr().lock();
    // A terminal shows `^C`, or a progress bar, on the current line.
    let start = if errors.is_terminal() { "\n" } else { "" };
    if let Err(error) = writeln!(errors, "{start}{line}") {
        tracing::debug!(%error, "nobody hears");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interrupt_waits_only_for_a_picture_that_has_samples() {
        let interrupt = |phase| RunnerState { phase, ..RunnerState::default() }.interrupt(Instant::now());
        assert!(!interrupt(RunnerPhase::Preparing), "nothing is there");
        assert!(!interrupt(RunnerPhase::Rendering), "nothing is rendered yet");
        assert!(interrupt(RunnerPhase::Writing), "it is there");
    }

    #[test]
    fn a_second_interrupt_does_not_wait() {
        let mut state = RunnerState { phase: RunnerPhase::Writing, ..RunnerState::default() };
        let first = Instant::now();
        assert!(state.interrupt(first) && !state.interrupt(first + TOGETHER), "one picture, one wait");
    }

    #[test]
    fn signals_that_come_together_are_one_interrupt() {
        let first = Instant::now();
        let mut state = RunnerState { phase: RunnerPhase::Writing, ..RunnerState::default() };
        let soon = first + TOGETHER / 2;
        assert!(state.interrupt(first) && state.interrupt(soon) && state.interrupt(soon), "the same one");
        assert!(!state.interrupt(first + TOGETHER), "counted from the first");
    }

    #[test]
    fn a_session_without_a_job_has_no_picture() {
        let session = Arc::new(Session::new(oocpt_core::settings::Settings::default()));
        let sessions = vec![(Arc::downgrade(&session), 0)];
        let mut state = RunnerState { phase: RunnerPhase::Rendering, sessions, ..RunnerState::default() };
        assert!(
            !state.interrupt(Instant::now()) && state.of_picture(Session::reached).is_none(),
            "nothing was asked of it"
        );
    }

    #[test]
    fn a_temporary_folder_is_removed_with_its_files() {
        let folder = std::env::temp_dir().join(format!("oocpt-runner-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        std::fs::write(folder.join("part.exr"), "x").expect("a file");
        remove(&folder);
        remove(&folder);
        assert!(!folder.exists(), "nothing is left");
        remove(Path::new(""));
    }
}
