// SPDX-License-Identifier: Apache-2.0
//! What is there: the Vulkan instance, what its devices are and can do, and what of that is chosen. Opens nothing.

pub(crate) mod capabilities;
pub(crate) mod enumerate;
pub(crate) mod lane;
pub(crate) mod limits;
pub(crate) mod memory_type;
pub(crate) mod probe;
pub(crate) mod report;
pub(crate) mod select;
pub(crate) mod validation;
pub(crate) mod vulkan;
