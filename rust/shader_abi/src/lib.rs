// SPDX-License-Identifier: Apache-2.0
//! The bytes that host and compute shaders agree on: every struct that crosses, and the compiled shaders.
//!
//! Guarantees: each struct here has the same member offsets as the GLSL struct of the same name in
//! `shaders/include/abi.glsl`; `build.rs` compares them in the SPIR-V of every pass and fails the build on a difference.
//! No Vulkan, no state, no threads: plain data, usable from anywhere.
//!
//! # One wave
//! A wave traces paths `first_path .. first_path + path_count` without a word from the host. `q` is the one [`Push`] of the
//! wave (made by [`Push::wave`]); a line is a step, and there is a full memory barrier between steps. Steps that share a
//! line are independent and may overlap.
//! ```text
//! generate_camera_rays   [groups(path_count)]                 q
//! prepare_dispatch       [1]                                  q.with(0, PREPARE_TRACE)
//! for r in 0..=max_bounces:
//!   intersect_closest    indirect Counters::RAY_ARGS          q.with(r, 0)      | of r-1: intersect_shadow, see below
//!   prepare_dispatch     [1]                                  q.with(r, PREPARE_SHADE)
//!   shade_background     indirect Counters::ESCAPED_ARGS      q.with(r, 0)      | shade_surface indirect Counters::SURFACE_ARGS
//!   prepare_dispatch     [1]                                  q.with(r + 1, PREPARE_TRACE)
//!   intersect_shadow     indirect Counters::SHADOW_ARGS       q.with(r, 0)      | of r+1: intersect_closest
//! accumulate             [groups(min(path_count, width*height))]  q
//! resolve                [groups(width*height)]               q                 (only when an image is wanted)
//! ```
//! AOVs of the pixels `first_path .. first_path + path_count`, with `a = q.flagged(PushFlags::AOVS)`:
//! ```text
//! generate_aov_rays      [groups(path_count)]                 a
//! prepare_dispatch       [1]                                  a.with(0, PREPARE_TRACE)
//! intersect_closest      indirect Counters::RAY_ARGS          a
//! prepare_dispatch       [1]                                  a.with(0, PREPARE_SHADE)
//! shade_aovs             indirect Counters::SURFACE_ARGS      a.with(0, AOV_SURFACES)
//!                      | indirect Counters::ESCAPED_ARGS      a.with(0, AOV_ESCAPED)
//! ```
//! `shaders/README.md` has the table of what each pass reads and writes.

#![forbid(unsafe_code)]

mod abi;
mod lbvh;
mod modules;

pub use abi::*;
pub use lbvh::{Job as LbvhJob, MAX_ITEMS as LBVH_MAX_ITEMS, Step as LbvhStep};
pub use lbvh::{scratch_bytes as lbvh_scratch_bytes, steps as lbvh_steps};
pub use modules::{ALL, Module, passes};
