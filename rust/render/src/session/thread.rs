// SPDX-License-Identifier: Apache-2.0
//! The render thread: waits for a job, renders it wave by wave, reports how it ended.
//!
//! A panic of the renderer itself is caught here and reported as an error, and the renderer is started afresh, so that
//! the host process survives.

use crate::error::{RenderError, panic_text};
use crate::job::RenderJob;
use crate::job::shared::{FrameGate, SharedState};
use crate::session::products;
use crate::team::RenderTeam;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

/// Runs until the session ends.
pub(crate) fn run(shared: &SharedState) {
    let mut renderer = RenderTeam::default();
    while let Some((job, generation)) = next_job(shared) {
        let gate = FrameGate::new(shared, generation);
        match catch_unwind(AssertUnwindSafe(|| renderer.render(&job, &gate))) {
            Ok(Ok(())) => write_products(&job, shared),
            Ok(Err(error)) => {
                shared.fail(&error);
                renderer = RenderTeam::default();
            }
            Err(panic) => {
                shared.fail(&RenderError::Internal(panic_text(panic.as_ref())));
                renderer = RenderTeam::default();
            }
        }
        let mut control = shared.control();
        if control.generation == generation {
            control.finished = generation;
            control.next_picture();
        }
        drop(control);
        shared.notify();
    }
}

/// Writes what is to be written of a picture that was not given up.
fn write_products(job: &RenderJob, shared: &SharedState) {
    let control = shared.control();
    let is_given_up = control.stopped || control.quit || control.generation != job.generation;
    drop(control);
    if is_given_up {
        return;
    }
    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| products::write(job, shared))) {
        shared.fail(&RenderError::Internal(panic_text(panic.as_ref())));
    }
}

fn next_job(shared: &SharedState) -> Option<(Arc<RenderJob>, u64)> {
    let mut control = shared.control();
    loop {
        if control.quit {
            return None;
        }
        let waiting = control.finished != control.generation;
        if waiting && control.stopped {
            control.finished = control.generation;
            shared.notify();
        } else if waiting
            && !control.paused
            && let Some(job) = &control.job
        {
            let Some(hold) = control.commits.hold(Instant::now()) else {
                return Some((Arc::clone(job), control.generation));
            };
            control = shared.wait_at_most(control, hold);
            continue;
        }
        control = shared.wait(control);
    }
}
