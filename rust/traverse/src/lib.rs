// SPDX-License-Identifier: Apache-2.0
//! Native traversal: the trace passes of the wavefront on the host, for devices that are processors.
//!
//! On such a device, memory is shared with the host, and the compute shaders of a software driver walk trees slowly.
//! [`closest`] and [`shadow`] do between two submissions what `shaders/traversal` does inside of one. They read the
//! same trees, rays and queues, and use the operations of the shaders wherever these decide the bits of a hit, so that
//! the picture is the same, bit for bit, as the one of the shaders on a device that rounds each product (`fma` of GLSL
//! does not promise more).
//!
//! The path of a ray: `passes` (queues, rays, hit records) -> `walk` (trees) -> `node` (boxes) -> `leaf` (a test for
//! each kind of item) -> `opacity` and `cutout` (-> `presence` -> `opacity_mask` or `texture`); `motion` gives the maps
//! of moving placements. `simd` has the most frequent tests of a walk for each instruction set. Memory is accessed
//! through [`oocpt_gpu::HostView`], which checks every access. Any thread; the work is spread over rayon's pool.
#![forbid(unsafe_code)]

mod cutout;
mod deferred_tests;
mod leaf;
mod motion;
mod node;
mod opacity;
mod opacity_mask;
mod passes;
mod pending;
mod pose;
mod presence;
mod primvar;
mod scene;
mod simd;
mod texture;
mod vector;
mod walk;

pub use passes::{closest, shadow};

use oocpt_abi::Features;

/// The specialisation constants of the passes, as in the shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TraversalConstants {
    /// Length of the longest chain of instance records, 1 to 16.
    pub max_levels: u32,
    /// Number of stack entries of a ray.
    pub stack_size: u32,
    /// Features that the scene needs.
    pub features: Features,
    /// Bytes of all trees, items and records: small ones stay in the caches, so that no ray has to wait for memory.
    pub geometry_bytes: u64,
    /// Instructions that it may use. The hits are the same, bit for bit.
    pub instructions: InstructionSet,
}

/// An instruction set of the processor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InstructionSet {
    /// The widest instructions that this processor has.
    #[default]
    Widest,
    /// Instructions that every processor has.
    Portable,
}

impl TraversalConstants {
    pub(crate) fn levels(&self) -> usize {
        (self.max_levels as usize).clamp(1, walk::MAX_NESTING)
    }
}

/// Reason why a pass did nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceError {
    /// A table is not at the address in the frame.
    NoMemory {
        /// Name of the table, in words.
        what: &'static str,
    },
}

impl std::fmt::Display for TraceError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoMemory { what } => write!(f, "native traversal does not find {what} in memory"),
        }
    }
}

impl std::error::Error for TraceError {}

/// The first feature that a scene needs and native traversal does not support; `None` if it supports all of them.
/// Opacity by Ptex, or by floats through the sRGB curve, is not supported either: the caller, who knows the textures,
/// checks for these.
#[must_use]
pub fn unsupported(features: Features) -> Option<&'static str> {
    features.contains(Features::CUTOUT_PROGRAMS).then_some("cutouts by programs")
}
