// SPDX-License-Identifier: Apache-2.0
//! The compiled shaders, and the table of passes.
//!
//! Guarantees: each struct of `oocpt_abi::LAYOUTS` has the same member offsets in the shaders; `build.rs` compares them
//! in the SPIR-V of every pass and fails the build on a difference. No Vulkan, no state, no threads: plain data, usable
//! from anywhere.
//!
//! # What the host promises
//! [`PASSES`] declares the passes; `rust/render/src/wavefront/record.rs` records them in their order. There is a full
//! memory barrier between two passes unless they are recorded as concurrent. The parameters of a pass are a
//! [`PushConstants`].
//!
//! In core a wave traces the paths `first_path .. first_path + path_count` in rounds, without the host in between: all
//! rays of round `r` are at bounce `r`. There are `max_bounces + 1` rounds, with [`Features::MATERIALS`] one more, for
//! rays of delta lobes. With `FrameConstants::texture_feedback` the host sets `WavefrontCounters::ray_count[0]` to 0
//! before the wave and reads the [`TextureFeedback`] after it. If paths lacked tiles, it loads them, empties the
//! feedback, and repeats the wave with `PushFlags::RETRACE`, until no path lacks one.
//!
//! With [`Features::STREAMING`] chunks may be absent (`GpuChunk::nodes == 0`), rays wait for them across submissions,
//! and paths are at different bounces. Paths live in *slots*, and leave their radiance at a *place*; there are more
//! places than slots. Segment `s` is the places from `s * segment_size` on, and holds the paths `first .. first +
//! count` of the render: its push constants are `PushConstants::wave(frame, first, count, pixels).with(r, s *
//! segment_size)`, and where it begins `.into_slots(s, taken, slots)` of that. Passes over all slots take
//! `PushConstants::wave(frame, 0, 0, pixels).with(r, ..)`. Round numbers grow through all submissions of a stage.
//! Before the first one the host zeroes `WavefrontCounters`, the segment table and `StreamingPointers::demand`; before
//! the deferred rays are sorted `StreamingPointers::sort_counts`, before demand is counted
//! `StreamingPointers::demand_counts`, before worth is estimated `StreamingPointers::worth` and `worth_sums`. Chunks
//! appear and disappear between submissions only. The passes that sort deferred rays may be left out, all four
//! together, if no ray is deferred.
//!
//! A segment with `alive == 0` and `count > 0` is done. When all earlier ones are accumulated, it is accumulated too,
//! and its places are free for another segment. A slot is free as soon as its path has ended
//! (`WavefrontCounters::freed`). The stage is over when every segment is done. If no chunk is absent, no ray is
//! deferred. If `ray_count[r & 1] + shadow_count` is 0 after a submission, all living paths wait for chunks.
//!
//! [`PushConstants`]: oocpt_abi::PushConstants
//! [`Features::MATERIALS`]: oocpt_abi::Features::MATERIALS
//! [`Features::STREAMING`]: oocpt_abi::Features::STREAMING
//! [`TextureFeedback`]: oocpt_abi::TextureFeedback

#![forbid(unsafe_code)]

mod fold;
mod modules;
mod table;

pub use modules::{ALL, SCENE, ShaderModule, checks, passes, scene};
pub use table::{DispatchSize, PASSES, Pass, PassCondition, PassImage, PassInfo, document};
