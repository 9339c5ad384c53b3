// SPDX-License-Identifier: Apache-2.0
//! Device memory: buffers with memory of their own, arenas with ranges, parts of staging rings.

pub(crate) mod allocate;
pub(crate) mod arena;
pub(crate) mod block;
pub(crate) mod range_memory;
pub(crate) mod staging_part;
pub(crate) mod staging_space;
