// SPDX-License-Identifier: Apache-2.0
//! The compiled passes, as `build.rs` left them.
//!
//! Guarantees: every `shaders/**/NAME.comp` is here, compiled for Vulkan 1.2 and accepted by spirv-val. Any thread.

/// A compiled pass; its entry point is `main`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Module {
    /// Name of the pass: the file name, with `lbvh_` before it for `shaders/lbvh`.
    pub name: &'static str,
    /// SPIR-V.
    pub words: &'static [u32],
}

include!(concat!(env!("OUT_DIR"), "/modules.rs"));
