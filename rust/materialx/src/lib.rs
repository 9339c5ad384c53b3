// SPDX-License-Identifier: Apache-2.0
//! `MaterialX` networks: definitions of nodes, translation of surfaces to `OpenPBR`, patterns as programs.
//!
//! Guarantees: no unsafe code; no network or library file makes this crate panic or loop without end; work and memory
//! are bounded by the limits that each module names. Any thread.

#![forbid(unsafe_code)]

pub mod eval;
mod noise;
pub mod program;
