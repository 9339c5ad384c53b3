// SPDX-License-Identifier: Apache-2.0
//! What a command line of ours is told when its user interrupts it: whether there is a picture to wait for.
//!
//! A command line makes one picture after the other. While one is made, the first interrupt has the render end with
//! the samples that it has, if it has any of each pixel; while a finished one is written, it is waited for. In every
//! other case, and at the second interrupt, the process is to end at once: what is temporary is removed here, and C++
//! ends it. Hosts that are not ours never call this, and nothing here knows of signals.
//!
//! Any thread; the calls of a command line come from one, [`interrupt`] from another.

use crate::guard::{BridgeError, guard};
use oocpt_render::{EarlyEnd, Session};
use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

/// What the command line is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum RunnerPhase {
    /// Nothing that could be delivered.
    #[default]
    Preparing,
    /// A picture is asked for.
    Rendering,
    /// It is rendered, and is about to be written.
    Writing,
}

/// One per process.
#[derive(Debug, Default)]
struct RunnerState {
    phase: RunnerPhase,
    is_interrupted: bool,
    /// Holds what is temporary of the picture under way; empty for none.
    folder: PathBuf,
    /// The sessions of this process, and their newest jobs when the picture was begun.
    sessions: Vec<(Weak<Session>, u64)>,
}

static STATE: Mutex<RunnerState> = Mutex::new(RunnerState {
    phase: RunnerPhase::Preparing,
    is_interrupted: false,
    folder: PathBuf::new(),
    sessions: Vec::new(),
});

fn state() -> MutexGuard<'static, RunnerState> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

impl RunnerState {
    /// The first answer of a session that has rendered for the picture under way.
    fn of_picture(&self, ask: impl Fn(&Session, u64) -> Option<EarlyEnd>) -> Option<EarlyEnd> {
        self.sessions.iter().find_map(|(session, after)| ask(&*session.upgrade()?, *after))
    }

    /// Whether there is a picture to wait for.
    fn interrupt(&mut self) -> bool {
        let is_first = !std::mem::replace(&mut self.is_interrupted, true);
        is_first
            && match self.phase {
                RunnerPhase::Preparing => false,
                RunnerPhase::Rendering => self.of_picture(Session::finish_early).is_some(),
                RunnerPhase::Writing => true,
            }
    }
}

/// A session was made.
pub(crate) fn session_opened(session: &Arc<Session>) {
    let mut state = state();
    state.sessions.retain(|(session, _)| session.strong_count() > 0);
    state.sessions.push((Arc::downgrade(session), 0));
}

/// A picture is begun, whose temporary files are in `folder`; false when the command line was interrupted before.
pub(crate) fn begin_picture(folder: &str) -> Result<bool, BridgeError> {
    guard("begin_picture", || {
        let mut state = state();
        state.folder = PathBuf::from(folder);
        state.phase = RunnerPhase::Rendering;
        for (session, newest) in &mut state.sessions {
            *newest = session.upgrade().map_or(0, |session| session.generation());
        }
        Ok(!state.is_interrupted)
    })
}

/// The picture is rendered.
pub(crate) fn picture_rendered() -> Result<(), BridgeError> {
    guard("picture_rendered", || {
        state().phase = RunnerPhase::Writing;
        Ok(())
    })
}

/// The user wants no more. False when the process is to end at once: then nothing temporary is left, and the user was
/// told.
pub(crate) fn interrupt() -> Result<bool, BridgeError> {
    guard("interrupt", || {
        let mut state = state();
        let is_second = state.is_interrupted;
        if state.interrupt() {
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

/// Whether the command line was interrupted, and how far the picture under way is.
pub(crate) fn interrupted() -> Result<(bool, EarlyEnd), BridgeError> {
    guard("interrupted", || {
        let state = state();
        let early = state.of_picture(Session::reached).unwrap_or(EarlyEnd { samples: 0, target: 0 });
        Ok((state.is_interrupted, early))
    })
}

/// Others may still be writing into the folder.
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
    // A terminal shows `^C`, or a progress bar, on the line where it stands.
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
        let interrupt = |phase| RunnerState { phase, ..RunnerState::default() }.interrupt();
        assert!(!interrupt(RunnerPhase::Preparing), "nothing is there");
        assert!(!interrupt(RunnerPhase::Rendering), "nothing is rendered yet");
        assert!(interrupt(RunnerPhase::Writing), "it is there");
    }

    #[test]
    fn a_second_interrupt_does_not_wait() {
        let mut state = RunnerState { phase: RunnerPhase::Writing, ..RunnerState::default() };
        assert!(state.interrupt() && !state.interrupt(), "one picture, one wait");
    }

    #[test]
    fn a_session_without_a_job_has_no_picture() {
        let session = Arc::new(Session::new(oocpt_core::settings::Settings::default()));
        let sessions = vec![(Arc::downgrade(&session), 0)];
        let mut state = RunnerState { phase: RunnerPhase::Rendering, sessions, ..RunnerState::default() };
        assert!(!state.interrupt() && state.of_picture(Session::reached).is_none(), "nothing was asked of it");
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
