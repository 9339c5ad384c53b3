// SPDX-License-Identifier: Apache-2.0
//! What the devices of a picture share: the samples that are left, the film, and who makes what. Any thread.

use crate::device::loader::Loader;
use crate::error::RenderError;
use crate::frame::progress::team::TeamProgress;
use crate::host_memory;
use crate::job::aov::AovKind;
use crate::job::publish::PublishedImages;
use crate::job::request::RenderRequest;
use crate::job::shared::{FrameGate, SharedState};
use crate::job::{RenderJob, TeamWork};
use crate::sync::lock;
use crate::team::blocks::{BlockQueue, NextBlock};
use oocpt_abi::ExactPixel;
use oocpt_core::settings::{SampleSpan, Settings};
use oocpt_film::{ExactFilm, SampleRange};
use oocpt_gpu::DeviceReport;
use std::sync::{Arc, Condvar, Mutex, PoisonError};

/// Planes of a film in host memory beside one for each device: what is whole, and two octaves on their way.
const FILM_PLANES: u64 = 3;

/// Where the images through pixel centres are.
#[derive(Debug, Default)]
struct CentrePlanes {
    images: Option<PublishedImages>,
    /// A device is making them.
    is_under_way: bool,
}

/// What the devices of a picture share.
#[derive(Debug)]
pub(super) struct TeamPlan<'a> {
    pub(super) job: &'a RenderJob,
    pub(super) gate: &'a FrameGate<'a>,
    pub(super) film: Arc<Mutex<ExactFilm>>,
    devices: u32,
    queue: Mutex<BlockQueue>,
    changed: Condvar,
    planes: Mutex<CentrePlanes>,
    progress: TeamProgress<'a>,
}

impl<'a> TeamPlan<'a> {
    /// The plan for the samples of the span that the film lacks, of which those before `open` may begin.
    pub(super) fn new(
        job: &'a RenderJob,
        gate: &'a FrameGate<'a>,
        (film, span, open): (ExactFilm, SampleRange, u32),
        (devices, progress): (usize, TeamProgress<'a>),
    ) -> Self {
        let left = without(span, &film.header().samples());
        Self {
            job,
            gate,
            film: Arc::new(Mutex::new(film)),
            devices: u32::try_from(devices).unwrap_or(u32::MAX),
            queue: Mutex::new(BlockQueue::new(left, open, devices)),
            changed: Condvar::new(),
            planes: Mutex::default(),
            progress,
        }
    }

    pub(super) fn progress(&self) -> &TeamProgress<'a> {
        &self.progress
    }

    /// The next samples of a device; waits while another one may give some back. None: nothing is left.
    pub(super) fn next(&self, number: usize) -> Option<SampleRange> {
        let mut queue = lock(&self.queue);
        loop {
            let secs = self.progress.secs_left();
            if secs.is_some_and(|secs| secs <= 0.0) && self.has_begun() || !self.gate.proceed() {
                queue.close();
                self.changed.notify_all();
            }
            #[cfg(feature = "faults")]
            if let Some([slow, blocks]) = self.job.options.faults.slow_device
                && slow as usize == number
                && queue.is_ahead_of(number, blocks)
            {
                queue = self.changed.wait(queue).unwrap_or_else(PoisonError::into_inner);
                continue;
            }
            match queue.next(number, self.progress.seconds(), secs) {
                NextBlock::Render(block) => return Some(block),
                NextBlock::Done => return None,
                NextBlock::Wait => queue = self.changed.wait(queue).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }

    /// No block begins any more.
    pub(super) fn close(&self) {
        lock(&self.queue).close();
        self.changed.notify_all();
    }

    /// Where the error of all samples that may begin is known: ends the picture if that is small enough, or lets
    /// samples before `open` begin.
    pub(super) fn decide(&self, is_good_enough: bool, open: u32) {
        let mut queue = lock(&self.queue);
        if queue.is_idle() {
            if is_good_enough {
                queue.close();
            } else {
                queue.open(open);
            }
            self.changed.notify_all();
        }
    }

    /// The images through pixel centres, if a device has made them.
    pub(super) fn take_planes(&self) -> Option<PublishedImages> {
        lock(&self.planes).images.take()
    }

    /// Whether the film has samples.
    fn has_begun(&self) -> bool {
        !lock(&self.film).header().planes.is_empty()
    }

    /// The job of a device for a block, and whether it makes the images through pixel centres. `at`: number of the
    /// device, and of its block.
    pub(super) fn block_job(
        &self,
        at: (usize, u32),
        block: SampleRange,
        (device, twin): (&DeviceReport, u32),
    ) -> (RenderJob, bool) {
        let job = self.job;
        let has_planes = job.request.aovs.len() > 1 && {
            let mut planes = lock(&self.planes);
            let needed = planes.images.is_none() && !planes.is_under_way;
            planes.is_under_way |= needed;
            needed
        };
        let mut request = job.request.clone();
        request.aovs.retain(|aov| has_planes || aov.kind == AovKind::Color);
        let settings = Settings {
            samples_per_pixel: block.end,
            span: SampleSpan { begin: block.begin, end: block.end },
            device: device.index.to_string(),
            devices: String::new(),
            target_error: 0.0,
            time_limit_secs: 0.0,
            report: String::new(),
            reference: String::new(),
            checkpoint: String::new(),
            film_part: String::new(),
            ..job.settings.clone()
        };
        let mut options = job.options;
        (options.progress_bar, options.closing_words) = (false, false);
        #[cfg(feature = "faults")]
        options.faults.of_block(at);
        #[cfg(not(feature = "faults"))]
        let _ = at;
        let team = TeamWork { film: Arc::clone(&self.film), twin, devices: self.devices };
        let fixed_host_bytes = job.fixed_host_bytes.saturating_add(self.host_bytes(&request));
        (RenderJob { request, settings, options, team: Some(team), fixed_host_bytes, ..job.clone() }, has_planes)
    }

    /// Bytes of host memory that the film takes, and, but for one device, images and staging memory.
    fn host_bytes(&self, request: &RenderRequest) -> u64 {
        let (devices, settings) = (u64::from(self.devices), &self.job.settings);
        let film = request.pixels() * size_of::<ExactPixel>() as u64 * (FILM_PLANES + devices);
        let of_device = host_memory::images(settings) + Loader::staging_bytes();
        film + devices.saturating_sub(1) * of_device
    }

    /// Takes the messages of a device.
    pub(super) fn tell(&self, apart: &SharedState) {
        for message in std::mem::take(&mut *lock(&apart.messages)) {
            self.gate.shared().report(message.severity, message.text);
        }
    }

    /// Takes the images through pixel centres of the device that was to make them, if it has.
    pub(super) fn keep_planes(&self, images: Option<PublishedImages>) {
        *lock(&self.planes) = CentrePlanes { images, is_under_way: false };
    }

    /// A device has ended a block, after so many seconds of tracing; gives how many of its samples the film has. What
    /// is missing of it is given back, and the device is out, unless the picture is given up.
    pub(super) fn end(
        &self,
        number: usize,
        block: SampleRange,
        secs: f64,
        result: Result<(), RenderError>,
    ) -> (u32, Result<(), RenderError>) {
        let have = samples_within(&self.film, block);
        let samples = have.iter().map(|range| range.samples()).sum();
        self.progress.block_done(number, samples);
        let is_open = self.gate.proceed();
        let result = match result {
            Ok(()) if samples < block.samples() && is_open => {
                Err(RenderError::Internal(format!("samples {block} are not whole")))
            }
            result => result,
        };
        let mut queue = lock(&self.queue);
        if result.is_ok() && samples == block.samples() {
            queue.done(number, block, secs);
        } else {
            queue.give_back(number, &without(block, &have));
        }
        if !is_open {
            queue.close();
        }
        self.changed.notify_all();
        (samples, result)
    }
}

/// Samples of a range that a film has.
fn samples_within(film: &Mutex<ExactFilm>, range: SampleRange) -> Vec<SampleRange> {
    let within = |have: SampleRange| SampleRange::new(have.begin.max(range.begin), have.end.min(range.end));
    lock(film).header().samples().into_iter().map(within).filter(|range| range.begin < range.end).collect()
}

/// What of a range is in none of others, which are in it and ascend.
fn without(range: SampleRange, others: &[SampleRange]) -> Vec<SampleRange> {
    let begins = std::iter::once(range.begin).chain(others.iter().map(|other| other.end));
    let ends = others.iter().map(|other| other.begin).chain([range.end]);
    begins.zip(ends).map(|(begin, end)| SampleRange::new(begin, end)).filter(|left| left.begin < left.end).collect()
}

#[cfg(test)]
mod tests {
    use super::without;
    use oocpt_film::SampleRange;

    #[test]
    fn what_a_film_lacks_of_a_block_is_what_it_does_not_have() {
        let range = SampleRange::new;
        let all = range(2, 20);
        assert_eq!(without(all, &[]), [all], "nothing is there");
        assert_eq!(without(all, &[all]), [], "all of it is");
        assert_eq!(without(all, &[range(2, 4), range(8, 9)]), [range(4, 8), range(9, 20)], "a beginning, and a part");
        assert_eq!(without(all, &[range(16, 20)]), [range(2, 16)], "the end");
    }
}
