// SPDX-License-Identifier: Apache-2.0
//! Faults and knobs that tests set. Compiled with the feature `faults` alone, which the tests of this workspace turn
//! on: the product has none of them.

use oocpt_abi::Features;
use oocpt_gpu::{DriverMemory, PlantedFailure};

/// What a session does wrong, or otherwise than its scene asks for; nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlantedFaults {
    /// Makes rays forget chunks that they would have to wait for (`SPEC_FAULT`): the picture is wrong. 0 = none.
    pub lost_chunks: u32,
    /// The probability, in thousandths, with which roulette on loads (`oocpt:stragglerRoulette`) loads whatever it
    /// plays for; none = by what loads cost and bring.
    pub roulette_per_mille: Option<u16>,
    /// What a byte of a load costs that roulette in nanoseconds, whatever the clock says; all else is as without.
    pub roulette_ns_per_byte: Option<u32>,
    /// Makes that roulette end rays without weighting those that go on: the picture is too dark.
    pub unweighted_roulette: bool,
    /// With adaptive sampling: roulette on loads is also played with samples that decide where others go.
    pub early_roulette: bool,
    /// Lets each pixel's own samples decide how many more it gets: adaptive pictures are biased.
    pub naive_sampling: bool,
    /// Leaves masks of cutouts out: every candidate is asked of its texture. The picture has the same mean.
    pub no_opacity_masks: bool,
    /// What masks leave open of cutouts is looked up by the passes that trace. The picture is the same.
    pub no_deferred_cutouts: bool,
    /// What is compiled in beside what the scene needs: lobes that only tests have.
    pub more_features: Features,
    /// The first picture of a scene that fits is rendered while the scene comes, on any device (`upload`).
    pub streams_first: bool,
    /// A picture that streams goes on without as soon as all of the scene is there, however few paths are left, and
    /// what is missing of it is brought at once (`streaming::leave`).
    pub leaves_soon: bool,
    /// Makes calls that take memory fail, in the first render of the session.
    pub failure: Option<PlantedFailure>,
    /// So many devices are lost, one after the other, each after so many submissions, in the first render.
    pub lost_devices: [u32; 2],
    /// Milliseconds after which a wait for loads is told, in place of a minute; 0 = a minute.
    pub impatient_millis: u32,
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
