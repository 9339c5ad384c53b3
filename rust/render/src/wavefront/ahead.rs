// SPDX-License-Identifier: Apache-2.0
//! Passes of scenes in core, compiled while passes that stream trace: a picture that leaves streaming would wait for
//! them otherwise (decisions/0050).

use super::TraversalBackend;
use super::passes::wanted;
use crate::device::{Device, PassSpecialisation};
use crate::film::Film;
use crate::sync::lock;
use oocpt_shaders::PassInfo;
use std::sync::{Arc, Mutex, Weak};
use std::thread::JoinHandle;

/// Threads that compile. The three longest passes take nearly all of the time; not those of rayon, which others would
/// wait for.
const THREADS: usize = 3;

/// Tells whether threads compile still, whoever keeps it.
#[derive(Clone, Debug, Default)]
pub(crate) struct PendingCompiles(Weak<Mutex<std::vec::IntoIter<&'static PassInfo>>>);

impl PendingCompiles {
    /// Whether all threads are done.
    pub(crate) fn is_over(&self) -> bool {
        self.0.strong_count() == 0
    }
}

/// The passes that were compiled last and the threads that do it. Dropping it waits for these: none may be in the
/// driver when the process ends.
#[derive(Debug, Default)]
pub(crate) struct BackgroundCompile {
    special: Option<PassSpecialisation>,
    passes: u32,
    threads: Vec<JoinHandle<()>>,
    pending: PendingCompiles,
}

impl BackgroundCompile {
    /// Begins to compile what a frame of this kind needs; not while others are under way. What cannot be compiled is
    /// told when the frame asks for it.
    pub(crate) fn begin(
        &mut self,
        device: &Arc<Device>,
        (special, backend): (PassSpecialisation, TraversalBackend),
        film: &Film,
    ) {
        if self.special == Some(special) || !self.pending.is_over() {
            return;
        }
        self.wait();
        let passes = wanted((special, backend), film);
        (self.special, self.passes) = (Some(special), u32::try_from(passes.len()).unwrap_or(u32::MAX));
        let passes = Arc::new(Mutex::new(passes.into_iter()));
        self.pending = PendingCompiles(Arc::downgrade(&passes));
        for _ in 0..THREADS {
            let (device, passes) = (Arc::clone(device), Arc::clone(&passes));
            let compile = move || {
                let next = || lock(&passes).next();
                while let Some(row) = next() {
                    if let Err(error) = device.pipeline(row.module, special) {
                        tracing::debug!(%error, pass = row.module.name, "not compiled ahead");
                    }
                }
            };
            match std::thread::Builder::new().name("oocpt-compile".into()).spawn(compile) {
                Ok(thread) => self.threads.push(thread),
                // Then the frame compiles them.
                Err(error) => tracing::debug!(%error, "no thread to compile ahead"),
            }
        }
    }

    /// Tells when they are there.
    pub(crate) fn pending(&self) -> PendingCompiles {
        self.pending.clone()
    }

    /// Waits for passes that serve a frame of this kind; gives the size of their stacks, which may be larger, and how
    /// many they are.
    pub(crate) fn serves(&mut self, special: PassSpecialisation) -> Option<(u32, u32)> {
        let have = self.special.filter(|have| {
            have.stack_size >= special.stack_size
                && *have == PassSpecialisation { stack_size: have.stack_size, ..special }
        })?;
        self.wait();
        Some((have.stack_size, self.passes))
    }

    fn wait(&mut self) {
        for thread in self.threads.drain(..) {
            // A panic is one of the driver's bindings; the frame will meet it again.
            drop(thread.join());
        }
    }
}

impl Drop for BackgroundCompile {
    fn drop(&mut self) {
        self.wait();
    }
}
