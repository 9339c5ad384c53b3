// SPDX-License-Identifier: Apache-2.0
//! Runs the crate on a real device (the software renderer, or the one that `OOCPT_TEST_DEVICE` names) with the
//! validation layer on: any message of the layer, also one about leaks after closing, fails the test that caused it.

mod allocation_failures;
mod budget;
mod buffer;
mod commands;
mod device_selection;
mod heap;
mod host_access;
mod lifetime;
mod pipeline_cache;
mod staging;
mod support;
mod threads;
mod transfer;
