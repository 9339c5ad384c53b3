// SPDX-License-Identifier: Apache-2.0
//! Ending a render before its last sample because the user asks for it: the picture then has the samples that are done,
//! as after a time limit.
//!
//! Any thread; nothing blocks.

use crate::job::commits::RenderControl;
use crate::session::Session;
use crate::sync::lock;
use std::sync::atomic::Ordering;

/// The progress of a render that ends early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EarlyEnd {
    /// Samples of each pixel that are done.
    pub samples: u32,
    /// Samples that were requested.
    pub target: u32,
}

impl Session {
    /// Number of the newest job: grows with every [`Session::render`] that changes something, and with every
    /// [`Session::restart`].
    pub fn generation(&self) -> u64 {
        self.shared.control().generation
    }

    /// Makes the newest job end with the samples that it has, as soon as the part of a wave under way is done;
    /// [`Session::is_converged`] then becomes true. Returns `None` and changes nothing if no job is newer than `after`,
    /// if the newest request waits for its commit, or if not every pixel has a sample.
    pub fn finish_early(&self, after: u64) -> Option<EarlyEnd> {
        let mut control = self.shared.control();
        let early = self.early(&control, after)?;
        control.ends_early = control.generation;
        drop(control);
        self.shared.notify();
        Some(early)
    }

    /// The result that [`Session::finish_early`] would return, without ending the job.
    pub fn reached(&self, after: u64) -> Option<EarlyEnd> {
        self.early(&self.shared.control(), after)
    }

    /// Has the render under way make a checkpoint as soon as it can; false if `oocpt:checkpoint` names no file.
    pub fn make_checkpoint(&self) -> bool {
        let is_named = !self.settings().checkpoint.is_empty();
        self.shared.wants_checkpoint.store(is_named, Ordering::Relaxed);
        is_named
    }

    fn early(&self, control: &RenderControl, after: u64) -> Option<EarlyEnd> {
        let target = control.job.as_ref()?.settings.samples_per_pixel;
        let newest = Some(control.generation).filter(|newest| *newest > after && !control.commits.is_awaited())?;
        let (generation, samples) = *lock(&self.shared.reached);
        (generation == newest && samples > 0).then_some(EarlyEnd { samples, target })
    }
}
