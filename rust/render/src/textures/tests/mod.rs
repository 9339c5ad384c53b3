// SPDX-License-Identifier: Apache-2.0
//! Textures: lookups, footprints and Ptex on the device; decoding, single files and the cache on the host.

#![expect(clippy::cast_possible_truncation, reason = "images of tests are small")]

mod cache;
mod decode;
mod file;
mod footprint;
mod harness;
mod lookup;
mod ptex;

/// The result of `texture_lookup` when it is done.
const DONE: u32 = u32::MAX;
/// The result of `texture_lookup` when the texture has a fallback alone.
const FALLBACK: u32 = u32::MAX - 1;
