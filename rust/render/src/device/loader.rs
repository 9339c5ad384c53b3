// SPDX-License-Identifier: Apache-2.0
//! Threads that fill pinned staging memory, one set for each open device, shared by its sessions.
//!
//! One thread per core up to [`MAX_THREADS`], since one thread fills only a quarter of the bus.

use crate::device::reading::ReadingLimit;
use crate::error::RenderError;
use crossbeam_channel::{Sender, unbounded};
use oocpt_gpu::{Gpu, StagingRing};
use std::sync::Arc;
use std::thread::JoinHandle;

/// Most threads that fill staging memory.
const MAX_THREADS: usize = 16;
/// Pinned staging memory per thread, bytes.
const RING_PER_THREAD: u64 = 8 << 20;

fn thread_count() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from).min(MAX_THREADS)
}

/// A task of a loader thread. Must not panic.
pub(crate) type LoaderTask = Box<dyn FnOnce(&Arc<Gpu>, &StagingRing) + Send>;

/// The threads and their staging memory.
#[derive(Debug)]
pub(crate) struct Loader {
    /// The limit on mesh bytes that the threads read at a time.
    reading: Arc<ReadingLimit>,
    tasks: Option<Sender<LoaderTask>>,
    threads: Vec<JoinHandle<()>>,
    ring: Arc<StagingRing>,
}

impl Loader {
    /// Starts the threads.
    pub(crate) fn new(gpu: &Arc<Gpu>, reading: Arc<ReadingLimit>) -> Result<Self, RenderError> {
        let count = thread_count();
        let ring = Arc::new(StagingRing::new(gpu, Self::staging_bytes())?);
        let (tasks, queue) = unbounded::<LoaderTask>();
        let mut threads = Vec::with_capacity(count);
        for _ in 0..count {
            let (gpu, ring, queue) = (Arc::clone(gpu), Arc::clone(&ring), queue.clone());
            let thread = std::thread::Builder::new().name("oocpt-load".into()).spawn(move || {
                for task in queue {
                    task(&gpu, &ring);
                }
            });
            match thread {
                Ok(handle) => threads.push(handle),
                Err(error) if threads.is_empty() => {
                    return Err(RenderError::Internal(format!("cannot start a loader thread: {error}")));
                }
                Err(_) => break,
            }
        }
        Ok(Self { reading, tasks: Some(tasks), threads, ring })
    }

    /// The limit on mesh bytes that the threads read at a time.
    pub(crate) fn reading(&self) -> &Arc<ReadingLimit> {
        &self.reading
    }

    /// The staging memory, for small writes of other threads.
    pub(crate) fn ring(&self) -> &StagingRing {
        &self.ring
    }

    /// Bytes of its staging memory.
    pub(crate) fn staging_bytes() -> u64 {
        thread_count() as u64 * RING_PER_THREAD
    }

    /// Returns true if the threads run, so that the tasks given to them will be carried out.
    pub(crate) fn lives(&self) -> bool {
        !self.threads.iter().any(JoinHandle::is_finished)
    }

    /// Hands `task` to the next thread that is free.
    pub(crate) fn run(&self, task: LoaderTask) -> Result<(), RenderError> {
        match self.tasks.as_ref().map(|tasks| tasks.send(task)) {
            Some(Ok(())) => Ok(()),
            _ => Err(RenderError::Internal("the loader's threads have ended".into())),
        }
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        self.tasks = None;
        for thread in self.threads.drain(..) {
            if thread.join().is_err() {
                tracing::error!("a loader thread had panicked");
            }
        }
    }
}
