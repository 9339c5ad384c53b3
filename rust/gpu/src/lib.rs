// SPDX-License-Identifier: Apache-2.0
//! A safe interface to Vulkan; this is the only crate of OocPT that calls Vulkan. Apart from it, a [`DenoiserDevice`]
//! by a library that is loaded at run time.
//!
//! It provides a device chosen by name or by rank ([`Gpu`]), memory under a hard budget ([`Buffer`], [`Heap`]), compute
//! [`Pipeline`]s, command lists with barriers of their own ([`CommandList`]), on the main queue or one for transfers,
//! and submissions to wait for ([`Submission`]). All memory is reached by address; there are no descriptor sets.
//!
//! Guarantees:
//! - The bytes of device memory held never exceed the budget; running out is [`GpuError::OutOfMemory`] and changes
//!   nothing.
//! - Nothing the GPU may still use is destroyed: dropping retires, and a timeline semaphore decides when it can be
//!   destroyed.
//! - A lost device, a missing driver or a wrong argument is an error with one clear sentence, never a panic.
//! - Everything may be used from any thread, except that a command list is recorded by one thread at a time.
//!
//! It cannot guarantee that shaders stay inside the memory they are given (see [`Pipeline`]).
//!
//! The path of a command list: `commands` (checks) -> `submit::recorder` (barriers, markers, timestamps) ->
//! `submit::queue` (submits, keeps alive) -> `submit::open_device` (collects) -> `device::logical`, `memory::arena`
//! (let go).
//!
//! Layers; a module uses none of a layer below it in this list, and no two use each other (`cargo xtask check` ensures
//! it for the folders and for the modules beside this file):
//! - `error`: the errors of every layer.
//! - `instance`: the instance, its devices, and the choice of a device. `lane`, `memory_type` and `select` are pure.
//! - `device`: the `logical` one and its parts, and the pipelines compiled for it. `budget`, `retire`, `heap_counters`
//!   and `options` are bookkeeping, without Vulkan's functions.
//! - `memory`: buffers, arenas with ranges, parts of staging rings.
//! - `submit`: `kept` has the objects that command lists keep alive, then `recorder` and `queue`; the `open_device` has
//!   the queues, and takes back the objects of finished submissions.
//! - The types that callers hold, beside this file: `gpu` first, then `range`, `buffer`, `heap_range`, `heap`,
//!   `pipeline`, `host_view`, `submission`, last `commands` and `staging`.
#![allow(unsafe_code, reason = "this crate exists to contain it; one operation per block, each with its reason")]

mod buffer;
mod commands;
mod denoiser;
mod device;
mod error;
mod gpu;
mod heap;
mod heap_range;
mod host_view;
mod instance;
mod memory;
mod pipeline;
#[cfg(feature = "faults")]
mod planted;
mod range;
mod staging;
mod submission;
mod submit;
#[cfg(test)]
mod tests;

pub use buffer::Buffer;
pub use commands::{CommandList, MAX_UPDATE_BYTES};
pub use denoiser::{
    DenoiseOptions, DenoiseQuality, DenoiserDevice, DenoiserError, FloatImage, NoisyPicture, PictureBuffers,
    SharedFilters,
};
pub use device::budget::MemoryUse;
pub use device::options::OpenOptions;
#[cfg(feature = "faults")]
pub use device::watch::{DriverCall, DriverMemory, PlantedFailure};
pub use error::GpuError;
pub use gpu::Gpu;
pub use heap::{Heap, HeapOptions, HeapStats};
pub use heap_range::HeapRange;
pub use host_view::{HostBytes, HostSpan, HostView, HostWords};
pub use instance::capabilities::DeviceCapabilities;
#[cfg(feature = "faults")]
pub use instance::capabilities::hide_capabilities;
pub use instance::enumerate::{devices_together, enumerate, enumerate_for};
pub use instance::limits::DeviceLimits;
pub use instance::memory_type::BufferUsage;
pub use instance::report::{DeviceKind, DeviceReport, HeapReport};
pub use instance::validation::ValidationLog;
pub use pipeline::Pipeline;
pub use range::DeviceRange;
pub use staging::{StagingRing, StagingSlice};
pub use submission::Submission;
