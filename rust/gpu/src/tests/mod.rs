// SPDX-License-Identifier: Apache-2.0
//! Tests that need more than the public interface: a broken Vulkan rule, a lost device, a gate between two queues.

mod queue_order;
mod validation_and_loss;

pub(crate) use queue_order::open;
