// SPDX-License-Identifier: Apache-2.0
//! Brings assets to the device on the loader's threads while the render thread traces: encode into pinned staging
//! memory, copy on the transfer queue. A load belongs to an [`Inbox`]; what was asked for by an inbox that is gone is
//! skipped.

use super::encode::{Part, Writer};
use super::source::Source;
use crate::error::RenderError;
use crate::loader::Loader;
use crate::sync::lock;
use crossbeam_channel::{Receiver, Sender, unbounded};
use oocpt_core::residency::AssetId;
use oocpt_gpu::{DeviceRange, Gpu, HeapRange, StagingRing, Submission};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, Weak};
use std::time::Duration;

/// An asset that is to come to the device.
#[derive(Debug)]
struct Load {
    asset: AssetId,
    source: Source,
    target: Arc<HeapRange>,
    workspace: Option<Arc<HeapRange>>,
    reply: Sender<Loaded>,
    /// Gone when nobody waits for the result any more.
    wanted: Weak<()>,
    progress: Mutex<Progress>,
}

/// How far the parts of a load are.
#[derive(Debug)]
struct Progress {
    left: usize,
    /// What the finished parts have left behind.
    sum: Result<(Vec<Submission>, u64), RenderError>,
}

/// A part of a load: several threads work on one, so that a ray waits as short as possible.
#[derive(Debug)]
struct Job {
    load: Arc<Load>,
    part: Part,
}

/// What became of a job.
#[derive(Debug)]
pub(crate) struct Loaded {
    pub(crate) asset: AssetId,
    /// The copies to wait for, and their bytes.
    pub(crate) result: Result<(Vec<Submission>, u64), RenderError>,
}

/// Where the results of one scene's jobs arrive.
#[derive(Debug)]
pub(crate) struct Inbox {
    reply: Sender<Loaded>,
    results: Receiver<Loaded>,
    wanted: Arc<()>,
    in_flight: AtomicU64,
}

impl Default for Inbox {
    fn default() -> Self {
        let (reply, results) = unbounded();
        Self { reply, results, wanted: Arc::new(()), in_flight: AtomicU64::new(0) }
    }
}

impl Inbox {
    /// A result that is there.
    pub(crate) fn try_next(&self) -> Option<Loaded> {
        let loaded = self.results.try_recv().ok()?;
        self.in_flight.fetch_sub(1, Ordering::Relaxed);
        Some(loaded)
    }

    /// The next result, none after `timeout` or when nothing is under way.
    pub(crate) fn next(&self, timeout: Duration) -> Option<Loaded> {
        if self.in_flight() == 0 {
            return None;
        }
        let loaded = self.results.recv_timeout(timeout).ok()?;
        self.in_flight.fetch_sub(1, Ordering::Relaxed);
        Some(loaded)
    }

    /// Asks for `source` to be written to `target` (and its boxes to `workspace`); the result comes here.
    pub(crate) fn load(
        &self,
        loader: &Loader,
        asset: AssetId,
        source: Source,
        target: Arc<HeapRange>,
        workspace: Option<Arc<HeapRange>>,
    ) -> Result<(), RenderError> {
        let parts = Writer::parts(&source);
        let load = Arc::new(Load {
            asset,
            source,
            target,
            workspace,
            reply: self.reply.clone(),
            wanted: Arc::downgrade(&self.wanted),
            progress: Mutex::new(Progress { left: parts.len(), sum: Ok((Vec::new(), 0)) }),
        });
        for part in parts {
            let job = Job { load: Arc::clone(&load), part };
            loader.run(Box::new(|gpu, ring| job.run(gpu, ring)))?;
        }
        self.in_flight.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }

    /// Jobs whose results have not been taken.
    pub(crate) fn in_flight(&self) -> u64 {
        self.in_flight.load(Ordering::Relaxed)
    }
}

impl Job {
    fn run(self, gpu: &Arc<Gpu>, ring: &StagingRing) {
        if self.load.wanted.strong_count() == 0 {
            return;
        }
        let result = catch_unwind(AssertUnwindSafe(|| self.write(gpu, ring)))
            .unwrap_or_else(|_| Err(RenderError::Internal("a loader thread panicked".into())));
        self.load.done(result);
    }

    fn write(&self, gpu: &Arc<Gpu>, ring: &StagingRing) -> Result<(Vec<Submission>, u64), RenderError> {
        let load = &*self.load;
        let mut writer = Writer::new(gpu, ring);
        let workspace = load.workspace.as_deref().map(|range| range as &dyn DeviceRange);
        writer.part(&load.source, &self.part, &*load.target, workspace)?;
        writer.finish()
    }
}

impl Load {
    /// Takes note of one part; the last one sends the result.
    fn done(&self, result: Result<(Vec<Submission>, u64), RenderError>) {
        let mut progress = lock(&self.progress);
        progress.left = progress.left.saturating_sub(1);
        match (&mut progress.sum, result) {
            (Ok((submissions, bytes)), Ok((more, copied))) => {
                submissions.extend(more);
                *bytes += copied;
            }
            (sum @ Ok(_), Err(error)) => *sum = Err(error),
            (Err(_), _) => {}
        }
        if progress.left > 0 {
            return;
        }
        let result = std::mem::replace(&mut progress.sum, Ok((Vec::new(), 0)));
        drop(progress);
        if self.reply.send(Loaded { asset: self.asset, result }).is_err() {
            tracing::debug!("nobody waits for a loaded asset any more");
        }
    }
}
