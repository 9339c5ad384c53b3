// SPDX-License-Identifier: Apache-2.0
//! The logical device and its parts, and the pipelines that are compiled for it.

pub(crate) mod budget;
pub(crate) mod compute_pipeline;
pub(crate) mod heap_counters;
pub(crate) mod host_memory;
pub(crate) mod host_pages;
pub(crate) mod lending;
pub(crate) mod logical;
pub(crate) mod mapped;
pub(crate) mod markers;
pub(crate) mod names;
pub(crate) mod options;
pub(crate) mod passes;
pub(crate) mod pipeline_cache;
pub(crate) mod raw_buffer;
pub(crate) mod retire;
pub(crate) mod timeline;
#[cfg(feature = "faults")]
pub(crate) mod watch;
