// SPDX-License-Identifier: Apache-2.0
//! The wavefront: the passes of a frame, the memory they work in, and the order they run in.
//!
//! `oocpt_shaders::PASSES` declares each pass. Render thread only.

mod ahead;
mod native;
mod passes;
mod paths;
mod record;

pub(crate) use ahead::{BackgroundCompile, PendingCompiles};
pub(crate) use native::{NativeTraversal, TraversalBackend};
pub(crate) use passes::WavefrontPasses;
pub(crate) use paths::{PathBuffers, PathNeeds};
pub(crate) use record::{PathKind, TracedRays, WavefrontRecorder};
