// SPDX-License-Identifier: Apache-2.0
//! The end of a render before its last sample, when its user wants no more: the picture is then what is done of it, as
//! with a time limit that has passed.
//!
//! Any thread; nothing waits.

use crate::session::Session;
use crate::sync::lock;

/// How far a render is that ends early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EarlyEnd {
    /// Samples of each pixel that are done.
    pub samples: u32,
    /// Samples that were asked for.
    pub target: u32,
}

impl Session {
    /// Number of the newest job: grows with every [`Session::render`] that changes something, and with every
    /// [`Session::restart`].
    pub fn generation(&self) -> u64 {
        self.shared.control().generation
    }

    /// Has the newest job end with the samples that it has, as soon as the part of a wave under way is done;
    /// [`Session::is_converged`] says when. `None`, and nothing is changed, while there is no job newer than `after`,
    /// or not a sample of each of its pixels is done.
    pub fn finish_early(&self, after: u64) -> Option<EarlyEnd> {
        let mut control = self.shared.control();
        let early = self.early(control.generation, after, control.job.as_ref()?.settings.samples_per_pixel)?;
        control.ends_early = control.generation;
        drop(control);
        self.shared.notify();
        Some(early)
    }

    /// What [`Session::finish_early`] says, without an effect.
    pub fn reached(&self, after: u64) -> Option<EarlyEnd> {
        let control = self.shared.control();
        self.early(control.generation, after, control.job.as_ref()?.settings.samples_per_pixel)
    }

    fn early(&self, newest: u64, after: u64, target: u32) -> Option<EarlyEnd> {
        let (generation, samples) = *lock(&self.shared.reached);
        (newest > after && generation == newest && samples > 0).then_some(EarlyEnd { samples, target })
    }
}
