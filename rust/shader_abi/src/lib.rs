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
//! for r in 0..=max_bounces:   (with Features::MATERIALS one round more, for rays of delta lobes)
//!   intersect_closest    indirect Counters::TRACE_ARGS        q.with(r, 0)      | of r-1: intersect_shadow, see below
//!   prepare_dispatch     [1]                                  q.with(r, PREPARE_SHADE)
//!   shade_background     indirect Counters::ESCAPED_ARGS      q.with(r, 0)      | shade_surface indirect Counters::SURFACE_ARGS
//!   prepare_dispatch     [1]                                  q.with(r + 1, PREPARE_TRACE)
//!   intersect_shadow     indirect Counters::SHADOW_ARGS       q.with(r, 0)      | of r+1: intersect_closest
//! accumulate             [groups(min(path_count, width*height))]  q
//!   (cut where every pixel has a power of two of samples: measure_error [min(ERROR_GROUPS, groups(width*height))] there)
//! resolve                [groups(width*height)]               q                 (only when an image is wanted)
//! ```
//! With `Frame::texture_feedback` the host sets `Counters::ray_count[0]` to 0 before the wave and reads the
//! [`TextureFeedback`] after it. If paths lacked tiles, it
//! brings them, empties the feedback, and repeats the wave with `q.flagged(PushFlags::RETRACE)`, until none does.
//!
//! AOVs of the pixels `first_path .. first_path + path_count`, with `a = q.flagged(PushFlags::AOVS)`:
//! ```text
//! generate_aov_rays      [groups(path_count)]                 a
//! prepare_dispatch       [1]                                  a.with(0, PREPARE_TRACE)
//! intersect_closest      indirect Counters::TRACE_ARGS        a
//! prepare_dispatch       [1]                                  a.with(0, PREPARE_SHADE)
//! shade_aovs             indirect Counters::SURFACE_ARGS      a.with(0, AOV_SURFACES)
//!                      | indirect Counters::ESCAPED_ARGS      a.with(0, AOV_ESCAPED)
//! ```
//!
//! # One submission of streaming
//! With [`Features::STREAMING`] chunks may be absent (`GpuChunk::nodes == 0`), rays wait for them across submissions, and paths are
//! at different bounces. Paths live in *slots*, and leave their radiance at a *place*; there are more places than slots. Segment `s` is the
//! places from `s * segment_size` on, and holds the paths `first .. first + count` of the render. `q` has `frame` and `flags` only
//! (`Push::wave(frame, 0, 0, pixels)`; for AOVs, flagged); `a(s) = Push::wave(frame, first, count, pixels).with(r, s * segment_size)`
//! with the segment's paths, `g(s) = a(s).into_slots(s, taken, slots)`. `r` is the round: it starts at 0 with the render (or with the
//! AOVs) and grows through all submissions. Before the first one the host zeroes `Counters` and the segment table.
//! ```text
//! (host)                 the chunk table as it now is; fill Streaming::sort_counts with 0
//! (roulette, with verdicts: roulette_play  indirect Counters::DEFERRED_ARGS  q.with(r, table))
//! (cutouts: resolve_cutouts  indirect Counters::DEFERRED_ARGS  q.with(r, 0))
//! sort_deferred_count    indirect Counters::DEFERRED_ARGS     q.with(r, 0)      | generate_camera_rays or generate_aov_rays of
//!                                                                                 each new segment [groups(count)], g(s)
//! sort_deferred_scan     [sort_blocks(chunk_count), 1, 1] (1)  q.with(r, SCAN_BLOCKS)
//! sort_deferred_scan     [1]                                  q.with(r, SCAN_SUMS)
//! sort_deferred_scatter  indirect Counters::DEFERRED_ARGS     q.with(r, 0)
//! repeat as often as one submission is to last, with r = r + 1 each time:
//!   prepare_dispatch     [1]                                  q.with(r, PREPARE_TRACE)
//!   intersect_closest    indirect Counters::TRACE_ARGS        q.with(r, 0)      | intersect_shadow indirect Counters::SHADOW_ARGS
//!   prepare_dispatch     [1]                                  q.with(r, PREPARE_SHADE)
//!                      | record_surfaces indirect RAY_ARGS    q.with(r, 0)
//!     (textures: PREPARE_RESOLVE beside record_surfaces, then resolve_materials indirect RESOLVE_ARGS q.with(r, 0), then PREPARE_SHADE)
//!   shade_background     indirect Counters::ESCAPED_ARGS      q.with(r, 0)      | shade_surface indirect Counters::SURFACE_ARGS
//!     (AOVs: shade_aovs twice, as above, at round r)
//! prepare_dispatch       [1]                                  q.with(r, PREPARE_DEMAND)
//! (host)                 fill Streaming::demand with 0
//! count_demand           indirect Counters::DEFERRED_ARGS     q.with(r, 0)
//! (roulette, as long as few paths are left: Streaming::worth and worth_sums filled with 0; roulette_level [1] q.with(r, 0), then roulette_worth
//!  indirect DEFERRED_ARGS q.with(r, 0); Streaming::worth and roulette copied out too)
//! (host)                 copy Counters, the segment table and Streaming::demand out
//! ```
//! (1) more than 65535 blocks do not happen below 2^25 chunks. A line that only sorts may be left out when no ray is deferred, all four
//! `sort_*` together. Absent chunks may become resident, and resident ones absent, between submissions only.
//! A segment with `alive == 0` and `count > 0` is done. When all earlier ones are accumulated:
//! ```text
//! accumulate             [groups(min(count, width*height))]   a(s)
//! ```
//! and its places are free for another segment. A slot is free as soon as its path has ended (`Counters::freed`). Nothing is left to do when every segment is done. When no chunk is absent no ray is
//! deferred. When `ray_count[r & 1] + shadow_count == 0` after a submission, all living paths wait for chunks.
//!
//! `shaders/README.md` has the table of what each pass reads and writes.

#![forbid(unsafe_code)]

mod abi;
mod lbvh;
mod modules;

pub use abi::*;
pub use lbvh::{Job as LbvhJob, MAX_ITEMS as LBVH_MAX_ITEMS, Step as LbvhStep};
pub use lbvh::{scratch_bytes as lbvh_scratch_bytes, steps as lbvh_steps};
pub use modules::{ALL, Module, checks, passes};
