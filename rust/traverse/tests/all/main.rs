// SPDX-License-Identifier: Apache-2.0
//! Native traversal against the shaders, on the same memory.
#![forbid(unsafe_code)]

#[cfg(test)]
mod support;
#[cfg(test)]
mod walk;
