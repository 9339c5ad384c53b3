// SPDX-License-Identifier: Apache-2.0
//! The state that the host's threads, the commit thread and the render thread share: control, images, stats and
//! messages; and the gate that a frame asks whether it may go on.

use crate::denoiser::SessionDenoiser;
use crate::error::RenderError;
use crate::job::RenderJob;
use crate::job::commits::RenderControl;
use crate::job::patience::{self, LoadWait, WaitVerdict};
use crate::job::publish::PublishedImages;
use crate::job::request::{Message, Severity};
use crate::job::timings::RenderTimings;
use crate::sync::lock;
use oocpt_core::stats::RenderStats;
use oocpt_gpu::DeviceReport;
use std::sync::atomic::AtomicBool;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// State shared between the host's threads and those of the session.
#[derive(Debug, Default)]
pub(crate) struct SharedState {
    control: Mutex<RenderControl>,
    changed: Condvar,
    pub(crate) published: Mutex<PublishedImages>,
    pub(crate) stats: Mutex<RenderStats>,
    pub(crate) timings: Mutex<RenderTimings>,
    pub(crate) device: Mutex<Option<DeviceReport>>,
    /// A generation, and the finished samples of each of its pixels.
    pub(crate) reached: Mutex<(u64, u32)>,
    /// Error reports that renders of this session have begun.
    pub(crate) reports: Mutex<Vec<String>>,
    pub(crate) messages: Mutex<Vec<Message>>,
    pub(crate) denoiser: Mutex<SessionDenoiser>,
    /// The user was told that a live view keeps no samples in files.
    pub(crate) told_of_live_views: AtomicBool,
    /// The user was told that a live view is rendered on one device.
    pub(crate) told_of_devices: AtomicBool,
    /// Somebody asks for a checkpoint of the render under way.
    pub(crate) wants_checkpoint: AtomicBool,
    /// The last records that moved were placed by the device, in core.
    pub(crate) places_moved: AtomicBool,
    /// True if the user was told that the last render had samples that are not finite.
    pub(crate) nonfinite_reported: AtomicBool,
    #[cfg(feature = "faults")]
    pub(crate) witness: Mutex<crate::job::faults::FaultWitness>,
    #[cfg(feature = "faults")]
    pub(crate) commit_gate: std::sync::Arc<crate::job::faults::CommitGate>,
}

impl SharedState {
    pub(crate) fn control(&self) -> MutexGuard<'_, RenderControl> {
        lock(&self.control)
    }

    pub(crate) fn wait<'a>(&self, guard: MutexGuard<'a, RenderControl>) -> MutexGuard<'a, RenderControl> {
        self.changed.wait(guard).unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn wait_at_most<'a>(
        &self,
        guard: MutexGuard<'a, RenderControl>,
        time: Duration,
    ) -> MutexGuard<'a, RenderControl> {
        self.changed.wait_timeout(guard, time).unwrap_or_else(PoisonError::into_inner).0
    }

    pub(crate) fn notify(&self) {
        self.changed.notify_all();
    }

    pub(crate) fn report(&self, severity: Severity, text: String) {
        let message = Message { severity, text };
        let mut messages = lock(&self.messages);
        if !messages.contains(&message) {
            messages.push(message);
        }
    }

    /// Decides whether to keep waiting for `count` of `what` while the loader's threads live; reports long waits.
    pub(crate) fn wait_for_loads(
        &self,
        patience: &mut LoadWait,
        what: &str,
        count: usize,
        lives: bool,
    ) -> Result<(), RenderError> {
        match patience.check(Instant::now(), lives) {
            WaitVerdict::Wait => {}
            WaitVerdict::Tell(waited) => self.report(Severity::Warning, patience::report_text(what, count, waited)),
            WaitVerdict::Over => return Err(RenderError::Internal("the threads that load have ended".into())),
        }
        Ok(())
    }

    pub(crate) fn fail(&self, error: &RenderError) {
        tracing::error!(%error, "render ended early");
        self.report(Severity::Error, error.to_string());
    }
}

/// What the frame asks between waves: may it go on?
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameGate<'a> {
    session: &'a SharedState,
    /// Where results go.
    shared: &'a SharedState,
    generation: u64,
    /// Until then a newer job does not close it, as long as no picture of this one is shown.
    until: Option<Instant>,
}

impl<'a> FrameGate<'a> {
    /// The gate of the job of `generation`.
    pub(crate) fn new(session: &'a SharedState, generation: u64) -> Self {
        Self { session, shared: session, generation, until: None }
    }

    /// The same, but a newer job waits for the first picture of this one, for so long at most.
    pub(crate) fn for_first_picture(&self, patience: Duration) -> Self {
        Self { until: Instant::now().checked_add(patience), ..*self }
    }

    /// The same, but what the frame gives goes to `shared`.
    pub(crate) fn with_results<'b>(&self, shared: &'b SharedState) -> FrameGate<'b>
    where
        'a: 'b,
    {
        FrameGate { shared, ..*self }
    }

    /// Whether there is a newer job for which this one is given up: it publishes nothing any more.
    pub(crate) fn is_superseded(&self) -> bool {
        let is_newer = self.session.control().generation != self.generation;
        is_newer && !self.outlasts()
    }

    /// Whether the newer job may go on with the samples of `job`, which is the one of this gate, or with some of them.
    pub(crate) fn leads_on_from(&self, job: &RenderJob) -> bool {
        let newer = self.session.control().job.clone();
        newer.is_some_and(|newer| newer.has_samples_of(job) || newer.shares_samples_of(job))
    }

    fn outlasts(&self) -> bool {
        self.until.is_some_and(|until| Instant::now() < until) && !lock(&self.session.published).shows(self.generation)
    }

    /// Waits out a pause; returns false if the image is to be given up (stop, a newer job, the end of the session) or
    /// is to end with the samples that it has.
    pub(crate) fn proceed(&self) -> bool {
        let mut control = self.session.control();
        loop {
            let is_over = control.ends_early == self.generation || control.generation != self.generation;
            if control.quit || control.stopped || (is_over && !self.outlasts()) {
                return false;
            }
            if !control.paused {
                return true;
            }
            control = self.session.wait(control);
        }
    }

    /// Begins a wait for loads.
    pub(crate) fn patience(&self) -> LoadWait {
        let patience = LoadWait::new(Instant::now());
        #[cfg(feature = "faults")]
        if let Some(job) = &self.session.control().job
            && job.options.faults.impatient_millis > 0
        {
            let every = Duration::from_millis(job.options.faults.impatient_millis.into());
            return patience.telling_every(every);
        }
        patience
    }

    /// The state to which results are written.
    pub(crate) fn shared(&self) -> &SharedState {
        self.shared
    }
}
