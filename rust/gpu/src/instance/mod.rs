// SPDX-License-Identifier: Apache-2.0
//! The Vulkan instance, its devices with their capabilities, and the choice of a device. It opens none.

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
