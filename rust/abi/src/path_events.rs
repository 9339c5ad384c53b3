// SPDX-License-Identifier: Apache-2.0
//! What paths carry along for light path expressions, with `Features::PATH_EXPRESSIONS`.
//!
//! Guarantees: plain data, from which the build makes the structs of the shaders. Any thread.

use bytemuck::{Pod, Zeroable};

/// An event of a light path after the camera: scattering by side and lobe, or what shines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PathEvent {
    /// Diffuse reflection.
    DiffuseReflection = 0,
    /// Reflection by a lobe that is neither diffuse nor sharp.
    GlossyReflection = 1,
    /// Reflection in one direction.
    SharpReflection = 2,
    /// Diffuse transmission.
    DiffuseTransmission = 3,
    /// Transmission by a lobe that is neither diffuse nor sharp.
    GlossyTransmission = 4,
    /// Transmission in one direction.
    SharpTransmission = 5,
    /// A light that is no dome.
    Light = 6,
    /// A dome.
    Dome = 7,
    /// A surface that emits light.
    Surface = 8,
}

impl PathEvent {
    /// Every event, by its number.
    pub const ALL: [Self; 9] = [
        Self::DiffuseReflection,
        Self::GlossyReflection,
        Self::SharpReflection,
        Self::DiffuseTransmission,
        Self::GlossyTransmission,
        Self::SharpTransmission,
        Self::Light,
        Self::Dome,
        Self::Surface,
    ];

    /// Whether a path ends with it.
    #[must_use]
    pub fn shines(self) -> bool {
        matches!(self, Self::Light | Self::Dome | Self::Surface)
    }
}

/// Number of [`PathEvent`]s.
pub const EVENT_COUNT: u32 = PathEvent::Surface as u32 + 1;

/// Bit of `GpuPathStates::states[0]` of a shadow ray, above its states: its light counts for all expressions when it
/// arrives, and for none before.
pub const STATES_OF_ALL: u32 = 1 << 31;

/// Most light path expressions of a picture: bits of [`GpuPathAutomaton::accepts`], and as many images in
/// [`crate::FrameConstants::light_images`].
pub const MAX_EXPRESSIONS: usize = 32;
const _: () = assert!(MAX_EXPRESSIONS == u32::BITS as usize, "a bit each");

shared! {
    /// The automaton of a picture's light path expressions, and the labels of what they tell apart.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
    pub struct GpuPathAutomaton {
        /// u32: the next state by state, then event ([`PathEvent`]), then label. State 0 leads nowhere.
        pub next: u64,
        /// u32 by state: bit i is set if a path that ends there is one of expression i.
        pub accepts: u64,
        /// u32: label of each local light; 0 without any.
        pub local_labels: u64,
        /// u32: label of each light at infinity; 0 without any.
        pub infinite_labels: u64,
        /// u32: label of each prim id + 1, `prim_count` of them; 0 if no prim has one.
        pub prim_labels: u64,
        /// Number of prims of `prim_labels`; those beyond have `default_label`.
        pub prim_count: u32,
        /// Number of labels.
        pub label_count: u32,
        /// Label of what has none of its own.
        pub default_label: u32,
        /// State of a path that has left the camera.
        pub start: u32,
        /// Bit i is set if nothing is in the way of the light of expression i: where shadow rays ask for a light that
        /// is no mesh, its light counts whatever they meet.
        pub unoccluded: u32,
        /// Padding; 0.
        pub pad: u32,
    }
}

shared! {
    /// States of a path after the surface that it has left, 24 B. A surface scatters by two classes of lobes, diffuse
    /// ones and others; until the next surface both states of a channel count, each by its share.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct GpuPathStates {
        /// By channel: the state if diffuse lobes have scattered the path in the low half, if others have in the high
        /// one.
        pub states: [u32; 3],
        /// Share of the path's light, by channel, that diffuse lobes have scattered.
        pub share: [f32; 3],
    }
}

/// Bytes of a [`GpuPathStates`].
#[allow(clippy::cast_possible_truncation, reason = "the size of a struct")]
pub const PATH_STATES_BYTES: u32 = size_of::<GpuPathStates>() as u32;
