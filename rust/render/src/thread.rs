// SPDX-License-Identifier: Apache-2.0
//! The render thread: waits for a job, renders it wave by wave, reports how it ended.
//!
//! A panic of the renderer itself is caught here, reported as an error, and the renderer is started afresh: the host
//! lives (design.md, "Fails well").

use crate::error::RenderError;
use crate::frame::Renderer;
use crate::session::{Job, Shared};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// What the frame asks between waves: may it go on?
#[derive(Debug)]
pub(crate) struct Gate<'a> {
    shared: &'a Shared,
    generation: u64,
}

impl Gate<'_> {
    /// Waits out a pause; false when the image is to be given up (stop, a newer job, the end of the session).
    pub(crate) fn proceed(&self) -> bool {
        let mut control = self.shared.control();
        loop {
            if control.quit || control.stopped || control.generation != self.generation {
                return false;
            }
            if !control.paused {
                return true;
            }
            control = self.shared.wait(control);
        }
    }

    /// Where results go.
    pub(crate) fn shared(&self) -> &Shared {
        self.shared
    }
}

/// Runs until the session ends.
pub(crate) fn run(shared: &Shared) {
    let mut renderer = Renderer::default();
    while let Some((job, generation)) = next_job(shared) {
        let gate = Gate { shared, generation };
        match catch_unwind(AssertUnwindSafe(|| renderer.render(&job, &gate))) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => {
                shared.fail(&error);
                renderer = Renderer::default();
            }
            Err(panic) => {
                shared.fail(&RenderError::Internal(panic_text(panic.as_ref())));
                renderer = Renderer::default();
            }
        }
        let mut control = shared.control();
        if control.generation == generation {
            control.finished = generation;
        }
        drop(control);
        shared.notify();
    }
}

fn next_job(shared: &Shared) -> Option<(Arc<Job>, u64)> {
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
            return Some((Arc::clone(job), control.generation));
        }
        control = shared.wait(control);
    }
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(ToString::to_string)
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "unknown panic".into())
}
