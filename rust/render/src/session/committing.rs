// SPDX-License-Identifier: Apache-2.0
//! The commit thread: edits the scene and commits it, so that the host's threads never wait for that, and posts the
//! jobs that follow. What a commit replaces is dropped here too.

use crate::job::commits::CommitWork;
use crate::job::shared::SharedState;
use crate::session::commit::SessionScene;
use crate::sync::lock;
use std::sync::{Arc, Mutex};

/// Runs until the session ends, at the latest when the commit under way is done.
pub(super) fn run(shared: &Arc<SharedState>, scene: &Mutex<SessionScene>) {
    while waits_for_work(shared) {
        let mut scene = lock(scene);
        // The scene is locked first: whoever has it sees all edits that were taken.
        let Some(CommitWork { edits, ask }) = shared.control().commits.begin() else { continue };
        scene.edit(edits, shared);
        let Some(ask) = ask else { continue };
        let result = scene.commit(&ask, shared);
        drop(scene);
        let before = shared.control().committed(ask, result);
        shared.notify();
        drop(before);
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
