// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench textures`: the woods in core, and under budgets that their geometry and their textures each exceed,
//! under every policy, in one process on one device. All rows must give the first one's picture bit for bit.
//!
//! A budget of 25 % is a quarter of the lesser of geometry and textures: each of the two is at least four times what is
//! there for both together. Each row is rendered once to warm up, then `--runs` times; its counters are those of the
//! median run.

mod table;

use anyhow::{Context, Result};
use oocpt_core::stats::StreamingStats;
use oocpt_render::{RenderRequest, Session, SessionOptions};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use super::budgets::{self, Failed};
use super::common::{self, Machine, PassRow, Reported, Runs, finish, write_picture};
use super::observe::Observe;
use oocpt_scenes::pictures::Pictures;
use oocpt_scenes::woods::{self, Parameters};

/// Options of `oocpt bench textures`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    woods: Parameters,
    /// Image width, pixels.
    #[arg(long, default_value_t = 128)]
    width: u32,
    /// Image height, pixels.
    #[arg(long, default_value_t = 72)]
    height: u32,
    /// Samples per pixel.
    #[arg(long, default_value_t = 2)]
    samples: u32,
    /// Indirect bounces.
    #[arg(long, default_value_t = 3)]
    bounces: u32,
    /// Budgets in per cent of the lesser of geometry and textures; 100 = in core, and has to be the first.
    #[arg(long, value_delimiter = ',', default_value = "100,25")]
    budgets: Vec<f64>,
    /// Budgets are all of the geometry and so many per cent of the textures.
    #[arg(long)]
    of_textures: bool,
    /// Policies of the rows below 100.
    #[arg(long, value_delimiter = ',', default_value = "benefit,priority,sweep")]
    policies: Vec<String>,
    /// Chunk size, KiB; 0 = the renderer's default. A chunk may need up to 64 times that, so the default here suits the
    /// default woods.
    #[arg(long, default_value_t = 256)]
    chunk_size: u32,
    /// Hard limit of all device memory, MiB; 0 = automatic.
    #[arg(long, default_value_t = 0)]
    memory_budget: u32,
    /// Counted runs of each row.
    #[arg(long, default_value_t = 3)]
    runs: u32,
    /// Also renders each row once more with timestamps, for the passes it spends its time in.
    #[arg(long)]
    profile: bool,
    #[command(flatten)]
    reported: Reported,
    /// Also write the picture to this file: PNG (sRGB), or EXR with how it was made.
    #[arg(long)]
    picture: Option<PathBuf>,
    #[command(flatten)]
    observe: Observe,
}

/// One budget under one policy.
#[derive(Debug, Serialize)]
struct Row {
    budget_percent: f64,
    budget_bytes: u64,
    /// Empty in core.
    policy: String,
    /// The first run, which brings what it needs.
    cold_trace_secs: f64,
    trace_secs: Vec<f64>,
    median_trace_secs: f64,
    /// To the first row.
    ratio: f64,
    mpaths_per_sec: f64,
    /// Every run's picture is equal to the first row's, in bits.
    is_identical: bool,
    different_pixels: u64,
    gpu_peak_bytes: u64,
    geometry_loads: u64,
    geometry_reloads: u64,
    geometry_bytes_paged: u64,
    tile_loads: u64,
    tile_reloads: u64,
    tile_bytes_paged: u64,
    streaming: StreamingStats,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    passes: Vec<PassRow>,
}

#[derive(Debug, Serialize)]
struct Report {
    bench: &'static str,
    machine: Machine,
    width: u32,
    height: u32,
    samples: u32,
    bounces: u32,
    woods: Parameters,
    instances: u64,
    instanced_triangles: u64,
    meshes: u64,
    /// Making the arrays, which a host would do.
    generate_secs: f64,
    /// Building the meshes, partitioning.
    commit_secs: f64,
    chunks: u64,
    chunk_instances: u64,
    geometry_bytes: u64,
    texture_bytes: u64,
    all_identical: bool,
    rows: Vec<Row>,
    failed: Vec<Failed>,
}

impl Report {
    /// What budgets of a percentage are parts of.
    #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bytes")]
    fn whole_bytes(&self, percent: f64, of_textures: bool) -> u64 {
        if of_textures {
            return self.texture_bytes + (self.geometry_bytes as f64 * 100.0 / percent) as u64;
        }
        self.geometry_bytes.min(self.texture_bytes)
    }
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    budgets::check(&arguments.budgets)?;
    let settings = common::plain_settings(arguments.samples, arguments.bounces, &arguments.reported.device);
    let session = Session::with_options(settings, SessionOptions::default()).with_images(Arc::new(Pictures));
    budgets::limit(&session, arguments.memory_budget, arguments.chunk_size)?;
    let started = Instant::now();
    session.with_scene(|db| woods::build(db, &arguments.woods))?;
    let generate_secs = started.elapsed().as_secs_f64();
    let started = Instant::now();
    session.render(request(arguments));
    let commit_secs = started.elapsed().as_secs_f64();
    finish(&session).context("warm-up render")?;
    let mut report = report(arguments, &session, generate_secs, commit_secs);
    table::print_head(&report);
    let mut reference = Vec::new();
    let bytes = |percent| report.whole_bytes(percent, arguments.of_textures);
    let (rows, failed) = budgets::each(
        &arguments.budgets,
        &arguments.policies,
        |percent, policy, first| measure(arguments, &session, (percent, policy), bytes(percent), first, &mut reference),
        table::print_row,
    );
    (report.rows, report.failed) = (rows, failed);
    report.all_identical = report.rows.iter().all(|row| row.is_identical);
    println!("pictures of all rows: {}", if report.all_identical { "bit-identical" } else { "DIFFERENT" });
    arguments.reported.write(&report)?;
    if let Some(path) = &arguments.picture {
        write_picture(&session, [arguments.width, arguments.height], path)?;
    }
    budgets::verdict(report.all_identical, report.rows.len(), &report.failed)
}

fn request(arguments: &Arguments) -> RenderRequest {
    let (width, height) = (arguments.width, arguments.height);
    common::color_request(width, height, woods::camera(width, height))
}

/// Renders one row. The first row leaves its picture in `reference`.
fn measure(
    arguments: &Arguments,
    session: &Session,
    (percent, policy): (f64, &str),
    bytes: u64,
    first: Option<&Row>,
    reference: &mut Vec<u8>,
) -> Result<Row> {
    let budget = budgets::set(session, percent, bytes, policy)?;
    session.render(request(arguments));
    finish(session)?;
    let cold_trace_secs = session.timings().trace_secs;
    let size = [arguments.width, arguments.height];
    let Runs { trace_secs, timings, stats, different_pixels } =
        common::measure(session, size, arguments.runs, false, reference)?;
    let passes = if arguments.profile { common::profile(session)? } else { Vec::new() };
    arguments.observe.write(session, &request(arguments), &format!("{percent} {policy}"))?;
    let median_trace_secs = timings.trace_secs;
    let first = first.map_or(median_trace_secs, |row| row.median_trace_secs);
    #[expect(clippy::cast_precision_loss, reason = "counts are shown as rates")]
    let mpaths_per_sec = timings.paths as f64 / median_trace_secs * 1e-6;
    let streaming = stats.streaming;
    Ok(Row {
        budget_percent: percent,
        budget_bytes: u64::from(budget) << 10,
        policy: policy.into(),
        cold_trace_secs,
        trace_secs,
        median_trace_secs,
        ratio: median_trace_secs / first,
        mpaths_per_sec,
        is_identical: different_pixels == 0,
        different_pixels,
        gpu_peak_bytes: stats.gpu_peak_bytes,
        geometry_loads: streaming.loads - streaming.texture_loads,
        geometry_reloads: streaming.reloads - streaming.texture_reloads,
        geometry_bytes_paged: streaming.bytes_paged - streaming.texture_bytes_paged,
        tile_loads: streaming.texture_loads,
        tile_reloads: streaming.texture_reloads,
        tile_bytes_paged: streaming.texture_bytes_paged,
        streaming,
        passes,
    })
}

fn report(arguments: &Arguments, session: &Session, generate_secs: f64, commit_secs: f64) -> Report {
    let stats = session.stats();
    Report {
        bench: "textures",
        machine: arguments.reported.machine(Some(session)),
        width: arguments.width,
        height: arguments.height,
        samples: arguments.samples,
        bounces: arguments.bounces,
        woods: arguments.woods,
        instances: stats.instances,
        instanced_triangles: stats.triangles,
        meshes: stats.meshes,
        generate_secs,
        commit_secs,
        chunks: stats.streaming.chunks,
        chunk_instances: stats.streaming.chunk_instances,
        geometry_bytes: stats.streaming.scene_bytes - stats.streaming.texture_scene_bytes,
        texture_bytes: stats.streaming.texture_scene_bytes,
        all_identical: true,
        rows: Vec::new(),
        failed: Vec::new(),
    }
}
