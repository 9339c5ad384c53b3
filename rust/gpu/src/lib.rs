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
//! The way of a piece of work: `commands` (checks) -> `recorder` (barriers, markers, timestamps) -> `queue` (submits,
//! keeps alive) -> `open_device` (collects) -> `device`, `arena` (let go).
//!
//! Layers; a module uses none of a layer below it in this list, and no two use each other (`cargo xtask check`):
//! - Bookkeeping, without Vulkan's functions: `error`, `budget`, `lane`, `retire`, `heap_counters`, `staging_space`,
//!   `memory_type`, `options`.
//! - What is there: `validation`, `instance`, `capabilities`, `report`, `select`, `probe`, `limits`, `enumerate`.
//! - Parts of a device: `names`, `raw_buffer`, `timeline`, `markers`, `passes`, `host_memory`; with them the `device`.
//! - What is made from it: `memory`, `block`, `arena`, `range_memory`, `staging_part`, `compute_pipeline`, `timer`,
//!   `pipeline_cache`; `kept` is what command lists keep alive of it.
//! - Submissions: `queue`, `recorder`; the `open_device` has the queues, and takes back what they are done with.
//! - What callers hold: `gpu` first, then `range`, `buffer`, `heap_range`, `heap`, `pipeline`, `host_view`,
//!   `submission`, last `commands` and `staging`.
#![allow(unsafe_code, reason = "this crate exists to contain it; one operation per block, each with its reason")]

mod arena;
mod block;
mod budget;
mod buffer;
mod capabilities;
mod commands;
mod compute_pipeline;
mod device;
mod enumerate;
mod error;
mod gpu;
mod heap;
mod heap_counters;
mod heap_range;
mod host_memory;
mod host_pages;
mod host_view;
mod instance;
mod kept;
mod lane;
mod lending;
mod limits;
mod mapped;
mod markers;
mod memory;
mod memory_type;
mod names;
mod open_device;
mod options;
mod passes;
mod pipeline;
mod pipeline_cache;
#[cfg(feature = "faults")]
mod planted;
mod probe;
mod queue;
mod range;
mod range_memory;
mod raw_buffer;
mod recorder;
mod report;
mod retire;
mod select;
mod staging;
mod staging_part;
mod staging_space;
mod submission;
#[cfg(test)]
mod tests;
mod timeline;
mod timer;
mod validation;
#[cfg(feature = "faults")]
mod watch;

pub use budget::MemoryUse;
pub use buffer::Buffer;
pub use capabilities::Capabilities;
#[cfg(feature = "faults")]
pub use capabilities::hide_capabilities;
pub use commands::{Commands, MAX_UPDATE_BYTES};
pub use enumerate::{enumerate, enumerate_for};
pub use error::GpuError;
pub use gpu::Gpu;
pub use heap::{Heap, HeapOptions, HeapStats};
pub use heap_range::HeapRange;
pub use host_view::{HostBytes, HostSpan, HostView, HostWords};
pub use limits::Limits;
pub use memory_type::Usage;
pub use options::OpenOptions;
pub use pipeline::Pipeline;
pub use range::DeviceRange;
pub use report::{DeviceKind, DeviceReport, HeapReport};
pub use staging::{StagingRing, StagingSlice};
pub use submission::Submission;
pub use validation::ValidationLog;
#[cfg(feature = "faults")]
pub use watch::{Call, DriverMemory, Failure};
