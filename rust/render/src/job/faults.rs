// SPDX-License-Identifier: Apache-2.0
//! Faults and controls that tests set. They are compiled only with the feature `faults`, which the tests of this
//! workspace turn on: the product has none of them.

use crate::sync::lock;
use oocpt_abi::Features;
use oocpt_gpu::{DriverMemory, PlantedFailure};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The ways in which a session deviates from what its scene asks for; none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlantedFaults {
    /// Makes rays forget chunks that they would have to wait for (`SPEC_FAULT`): the picture is wrong. 0 = none.
    pub lost_chunks: u32,
    /// The probability, in thousandths, with which roulette on loads (`oocpt:stragglerRoulette`) loads a chunk; `None`
    /// computes it from what loads cost and bring.
    pub roulette_per_mille: Option<u16>,
    /// The cost of a loaded byte in nanoseconds that roulette assumes instead of measuring it; all else is unchanged.
    pub roulette_ns_per_byte: Option<u32>,
    /// Makes roulette on loads end rays without weighting those that go on: the picture is too dark.
    pub unweighted_roulette: bool,
    /// With adaptive sampling, plays roulette on loads also with samples that decide where others go.
    pub early_roulette: bool,
    /// Lets each pixel's own samples decide how many more it gets: adaptive pictures are biased.
    pub naive_sampling: bool,
    /// Leaves out the opacity masks of cutouts: every candidate hit looks up its texture. The picture has the same
    /// mean.
    pub no_opacity_masks: bool,
    /// Makes the trace passes look up the cutouts that masks cannot decide. The picture is the same.
    pub no_deferred_cutouts: bool,
    /// Features that are compiled in although the scene does not need them: lobes that only tests have.
    pub more_features: Features,
    /// Streams the first picture of a scene that fits while the scene is uploaded, on any device (`upload`).
    pub streams_first: bool,
    /// Ends streaming as soon as the whole scene is there, however few paths are left, and loads what is missing of it
    /// at once (`streaming::leave`).
    pub leaves_soon: bool,
    /// Makes allocations fail in the first render of the session.
    pub failure: Option<PlantedFailure>,
    /// Loses so many devices one after the other, each after so many submissions, in the first render.
    pub lost_devices: [u32; 2],
    /// A failure of one of several devices of a picture, by its number, or of each of them, in its first block.
    pub team_failure: Option<(Option<u32>, PlantedFailure)>,
    /// Of several devices, one by its number begins its second block when the others have ended so many.
    pub slow_device: Option<[u32; 2]>,
    /// By what the sides of the first picture of an interactive render are divided; 1 = there is none; none = by the
    /// pace of the device.
    pub first_picture: Option<u32>,
    /// Nothing comes after it.
    pub first_picture_alone: bool,
    /// Renders the film of a batch picture in windows of at most so many pixels, but of three rows at least.
    pub film_window: Option<u32>,
    /// Copies images to the host to be denoised.
    pub denoises_by_host: bool,
    /// There is no memory for another film beside that of a live view whose window moves.
    pub has_no_second_film: bool,
    /// Milliseconds after which a wait for loads is told, in place of a minute; 0 = a minute.
    pub impatient_millis: u32,
}

impl PlantedFaults {
    /// Leaves those of a block of a device, given by their numbers.
    pub(crate) fn of_block(&mut self, (device, block): (usize, u32)) {
        let strikes = |number: Option<u32>| block == 0 && number.is_none_or(|number| number as usize == device);
        self.failure = self.team_failure.filter(|(number, _)| strikes(*number)).map(|(_, failure)| failure);
        self.lost_devices = [0; 2];
    }
}

/// Counters of a device when a render has ended, for tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultWitness {
    /// Calls that have failed because of a planted failure, since the device was opened.
    pub struck: u64,
    /// Device memory, as counted at the driver's functions.
    pub driver: DriverMemory,
    /// Peak of the bytes that the budget has counted, host and device together.
    pub peak_budgeted_bytes: u64,
    /// Bytes that the budget counts now.
    pub budgeted_bytes: u64,
}

impl FaultWitness {
    pub(crate) fn of(gpu: &oocpt_gpu::Gpu) -> Self {
        let memory = gpu.memory();
        Self {
            struck: gpu.planted_failures(),
            driver: gpu.driver_memory(),
            peak_budgeted_bytes: gpu.peak_budgeted_bytes(),
            budgeted_bytes: memory.used + memory.host_used,
        }
    }
}

/// The time after which a closed gate opens: a test that nobody opens it for is to fail, not to hang.
const OPENS: Duration = Duration::from_secs(20);

/// A gate that each commit of a session passes when its edits are applied.
#[derive(Debug, Default)]
pub struct CommitGate {
    state: Mutex<GateState>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct GateState {
    is_closed: bool,
    /// So many commits pass all the same.
    admitted: u32,
    /// Commits that have come to the gate.
    arrived: u64,
    passed: u64,
    /// So many commits fail.
    failures: u32,
}

impl CommitGate {
    /// Commits wait from now on until [`Self::open`].
    pub fn close(&self) {
        lock(&self.state).is_closed = true;
    }

    /// Lets commits pass.
    pub fn open(&self) {
        lock(&self.state).is_closed = false;
        self.changed.notify_all();
    }

    /// Lets so many commits pass the closed gate.
    pub fn admit(&self, commits: u32) {
        lock(&self.state).admitted = commits;
        self.changed.notify_all();
    }

    /// Makes so many commits fail.
    pub fn fail(&self, commits: u32) {
        lock(&self.state).failures = commits;
    }

    /// Commits that have come to the gate so far.
    pub fn arrived(&self) -> u64 {
        lock(&self.state).arrived
    }

    /// Commits that have passed the gate so far.
    pub fn passed(&self) -> u64 {
        lock(&self.state).passed
    }

    /// Waits until so many commits have come to the gate, at most `timeout`; returns whether they have.
    pub fn wait_for(&self, commits: u64, timeout: Duration) -> bool {
        let end = Instant::now() + timeout;
        let mut state = lock(&self.state);
        while state.arrived < commits {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            state = self.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        true
    }

    pub(crate) fn pass(&self) {
        let mut state = lock(&self.state);
        state.arrived += 1;
        self.changed.notify_all();
        let closed = |state: &mut GateState| state.is_closed && state.admitted == 0;
        state = self.changed.wait_timeout_while(state, OPENS, closed).unwrap_or_else(PoisonError::into_inner).0;
        state.passed += 1;
        state.admitted = state.admitted.saturating_sub(1);
        if state.failures > 0 {
            state.failures -= 1;
            drop(state);
            std::panic::resume_unwind(Box::new("a planted failure"));
        }
    }
}
