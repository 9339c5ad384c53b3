// SPDX-License-Identifier: Apache-2.0
//! Vulkan made safe: the only crate of OocPT that calls Vulkan.
//!
//! What it gives: a device chosen by name or by rank ([`Gpu`]), memory under a hard budget ([`Buffer`], [`Heap`]),
//! compute [`Pipeline`]s, command lists with barriers of their own ([`Commands`]), on the main queue or one for
//! transfers, and submissions to wait for ([`Submission`]). All memory is reached by address; there are no descriptor
//! sets.
//!
//! What it promises:
//! - The bytes of device memory held never exceed the budget; running out is [`GpuError::OutOfMemory`] and changes
//!   nothing.
//! - Nothing the GPU may still use is destroyed: dropping retires, and a timeline semaphore says when it can go.
//! - A lost device, a missing driver or a wrong argument is an error with one clear sentence, never a panic.
//! - Everything may be used from any thread, except that a command list is recorded by one thread at a time.
//!
//! What it cannot promise: that shaders stay inside the memory they are given (see [`Pipeline`]).
//!
//! The way of a piece of work: `gpu` -> `commands` (checks) -> `recorder` (barriers, markers, timestamps) -> `queue`
//! (submits, keeps alive) -> `retire` (lets go).
#![allow(unsafe_code, reason = "this crate exists to contain it; one operation per block, each with its reason")]

mod arena;
mod budget;
mod buffer;
mod cache_file;
mod capabilities;
mod commands;
mod device;
mod enumerate;
mod error;
#[cfg(test)]
mod faults;
#[cfg(test)]
mod gates;
mod gpu;
mod heap;
mod heap_counters;
mod heap_range;
mod host_view;
mod instance;
mod lane;
mod markers;
mod memory;
mod memory_type;
mod names;
mod pipeline;
#[cfg(feature = "faults")]
mod planted;
mod probe;
mod queue;
mod range;
mod recorder;
mod report;
mod retire;
mod select;
mod staging;
mod staging_space;
mod submission;
mod timer;
mod validation;
#[cfg(feature = "faults")]
mod watch;

pub use budget::MemoryUse;
pub use buffer::Buffer;
pub use capabilities::Capabilities;
pub use commands::{Commands, MAX_UPDATE_BYTES};
pub use enumerate::{enumerate, enumerate_for};
pub use error::GpuError;
pub use gpu::{Gpu, Limits, OpenOptions};
pub use heap::{Heap, HeapOptions, HeapStats};
pub use heap_range::HeapRange;
pub use host_view::{HostBytes, HostView, HostWords};
pub use memory::Usage;
pub use pipeline::Pipeline;
pub use range::DeviceRange;
pub use report::{DeviceKind, DeviceReport, HeapReport};
pub use staging::{StagingRing, StagingSlice};
pub use submission::Submission;
pub use validation::ValidationLog;
#[cfg(feature = "faults")]
pub use watch::{Call, DriverMemory, Failure};
