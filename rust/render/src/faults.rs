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
    /// By what the sides of the first picture of an interactive render are divided; 1 = there is none; none = by the
    /// pace of the device.
    pub first_picture: Option<u32>,
    /// Nothing comes after it.
    pub first_picture_alone: bool,
    /// Milliseconds after which a wait for loads is told, in place of a minute; 0 = a minute.
    pub impatient_millis: u32,
}

/// What became of them, and what the driver gave, when a render ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultWitness {
    /// Failures that struck since the device was opened.
    pub struck: u64,
    /// Bytes by the driver's own function.
    pub driver: DriverMemory,
    /// Most bytes of host and device together that the books of the budget ever had.
    pub most_on_the_books: u64,
    /// Bytes on the books now.
    pub on_the_books: u64,
}

impl FaultWitness {
    pub(crate) fn of(gpu: &oocpt_gpu::Gpu) -> Self {
        let memory = gpu.memory();
        Self {
            struck: gpu.failures_struck(),
            driver: gpu.driver_memory(),
            most_on_the_books: gpu.most_on_the_books(),
            on_the_books: memory.used + memory.host_used,
        }
    }
}
