// SPDX-License-Identifier: Apache-2.0
//! Native traversal: the trace passes of the wavefront on the host, for devices that are processors.
//!
//! There device memory is host memory, and a software driver's compute shader is a slow way to walk a tree. [`closest`]
//! and [`shadow`] do between two submissions what `shaders/traversal` does inside of one: over the same trees, rays and
//! queues, in the operations of the shaders where they make the bits of a hit, so that the picture is the same, bit for
//! bit, as the one of the shaders on a device that rounds each product (`fma` of GLSL does not promise more).
//!
//! The way of a ray: `passes` (queues, rays, hit records) -> `walk` (trees) -> `node` (boxes) -> `leaf` (a test for
//! each kind of item) -> `opacity` and `cutout` (-> `presence` -> `opacity_mask` or `texture`); `motion` gives the maps
//! of what moves. What a walk does most, `simd` has by what instructions the processor has. Memory is reached through
//! [`oocpt_gpu::HostView`], which checks every look. Any thread; the work is spread over rayon's pool.
#![forbid(unsafe_code)]

mod asking;
mod cutout;
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

/// What the passes are specialised by: the constants of the shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TraversalConstants {
    /// Deepest chain of instance records, 1 to 16.
    pub max_levels: u32,
    /// Stack entries of a ray.
    pub stack_size: u32,
    /// What the scene needs.
    pub features: Features,
    /// Bytes of all trees, items and records: what is small stays in the caches, and no ray has to wait for memory.
    pub geometry_bytes: u64,
    /// Which instructions it may use. The hits are the same, bit for bit.
    pub instructions: InstructionSet,
}

/// Instructions of a processor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InstructionSet {
    /// The widest that there are on this one.
    #[default]
    Widest,
    /// What every one has.
    Portable,
}

impl TraversalConstants {
    pub(crate) fn levels(&self) -> usize {
        (self.max_levels as usize).clamp(1, walk::MOST_LEVELS)
    }
}

/// Why a pass did nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceError {
    /// A table is not where the frame says.
    NoMemory {
        /// In words.
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

/// What native traversal cannot do yet of what a scene needs; none if it can do all of it. Nor does it look opacity up
/// in Ptex, or in floats through the sRGB curve: whoever knows the textures sees to that.
#[must_use]
pub fn unsupported(features: Features) -> Option<&'static str> {
    features.contains(Features::CUTOUT_PROGRAMS).then_some("cutouts by programs")
}
