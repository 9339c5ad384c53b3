// SPDX-License-Identifier: Apache-2.0
//! The commit thread: edits the scene and commits it, so that the host's threads never wait for that, and posts the
//! jobs that follow. What a commit replaces is dropped here too.

use crate::job::commits::CommitWork;
use crate::job::shared::SharedState;
use crate::session::commit::{CommitEnd, SessionScene};
use crate::sync::lock;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::{Arc, LazyLock, Mutex};

/// Runs until the session ends, at the latest when the commit under way is done.
pub(super) fn run(shared: &Arc<SharedState>, scene: &Mutex<SessionScene>) {
    while waits_for_work(shared) {
        let mut scene = lock(scene);
        // The scene is locked first: whoever has it sees all edits that were taken.
        let Some(CommitWork { edits, ask, is_live }) = shared.control().commits.begin() else { continue };
        let edited = &mut *scene;
        let result = beside_pictures(is_live, || {
            edited.edit(edits, shared);
            ask.as_ref().map(|ask| edited.commit(ask, shared))
        });
        drop(scene);
        let (Some(ask), Some(result)) = (ask, result) else { continue };
        let result = match result {
            CommitEnd::Done(scene) => Some(scene),
            CommitEnd::Failed => None,
            CommitEnd::GivenUp => {
                shared.control().commits.give_up();
                continue;
            }
        };
        let before = shared.control().committed(ask, result);
        shared.notify();
        drop(before);
    }
}

/// The threads that build what live sessions commit. Those of the global pool show pictures meanwhile: there the work
/// for a picture would wait for the builds that were queued before.
static BUILDERS: LazyLock<Option<ThreadPool>> = LazyLock::new(|| {
    let pool = ThreadPoolBuilder::new().thread_name(|number| format!("oocpt-build-{number}")).build();
    pool.inspect_err(|error| tracing::warn!(%error, "commits share the threads that show pictures")).ok()
});

/// Runs `work`, for a live session with those threads.
fn beside_pictures<R: Send>(is_live: bool, work: impl FnOnce() -> R + Send) -> R {
    if !is_live {
        return work();
    }
    match BUILDERS.as_ref() {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// Waits for work; false when the session ends.
fn waits_for_work(shared: &SharedState) -> bool {
    let mut control = shared.control();
    while !control.quit && !control.commits.has_work() {
        control = shared.wait(control);
    }
    !control.quit
}
