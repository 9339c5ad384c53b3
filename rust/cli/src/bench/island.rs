// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench island`: the same picture of the island under shrinking geometry budgets and every policy, in one process
//! on one device. The first row is in core; all other rows must give its picture bit for bit.
//!
//! Each row is rendered once to warm up (unless `--cold`), then `--runs` times; its counters are those of the median run.

mod table;

use anyhow::{Context, Result, bail, ensure};
use oocpt_core::settings::Value;
use oocpt_core::stats::StreamingStats;
use oocpt_render::{RenderRequest, Session, SessionOptions};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

use super::common::{self, Machine, Runs, budget_kib, budget_rows, finish, write_json, write_picture};
use super::observe::Observe;
use crate::scene::island::{self, Parameters};

/// Options of `oocpt bench island`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    island: Parameters,
    /// Image width, pixels.
    #[arg(long, default_value_t = 1024)]
    width: u32,
    /// Image height, pixels.
    #[arg(long, default_value_t = 429)]
    height: u32,
    /// Samples per pixel.
    #[arg(long, default_value_t = 64)]
    samples: u32,
    /// Indirect bounces.
    #[arg(long, default_value_t = 5)]
    bounces: u32,
    /// Geometry budgets in per cent of the scene's geometry; 100 = in core, and has to be the first.
    #[arg(long, value_delimiter = ',', default_value = "100,29,10,5")]
    budgets: Vec<f64>,
    /// Policies of the rows below 100.
    #[arg(long, value_delimiter = ',', default_value = "benefit")]
    policies: Vec<String>,
    /// Chunk size, KiB; 0 = the default.
    #[arg(long, default_value_t = 0)]
    chunk_size: u32,
    /// Hard limit of all device memory, MiB; 0 = automatic.
    #[arg(long, default_value_t = 0)]
    memory_budget: u32,
    /// Counted runs of each row.
    #[arg(long, default_value_t = 3)]
    runs: u32,
    /// Counts the first render of each row instead of warming up with it: from empty device memory.
    #[arg(long)]
    cold: bool,
    /// Renders each row once more, timing its passes on the device; that run counts for nothing else.
    #[arg(long)]
    profile: bool,
    /// Device: an index or a part of its name.
    #[arg(long, env = "OOCPT_DEVICE", default_value = "")]
    device: String,
    /// Date to put into the report.
    #[arg(long)]
    date: Option<String>,
    /// Also write the report as JSON to this file.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Also write the picture to this file: PNG (sRGB), or EXR with how it was made.
    #[arg(long)]
    picture: Option<PathBuf>,
    /// Also render the last good row once more and write its chunk report to this file (`oocpt report chunks` draws it).
    #[arg(long)]
    chunk_report: Option<PathBuf>,
    #[command(flatten)]
    observe: Observe,
}

/// One budget under one policy.
#[derive(Debug, Serialize)]
struct Row {
    budget_percent: f64,
    geometry_budget_bytes: u64,
    /// Empty in core.
    policy: String,
    trace_secs: Vec<f64>,
    median_trace_secs: f64,
    /// To the first row.
    ratio: f64,
    mpaths_per_sec: f64,
    /// Every run's picture is equal to the first row's, in bits.
    is_identical: bool,
    different_pixels: u64,
    gpu_peak_bytes: u64,
    streaming: StreamingStats,
    /// Seconds on the device of each pass, and its dispatches; only with `--profile`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    passes: Vec<(String, f64, u64)>,
}

/// A row that did not render.
#[derive(Debug, Serialize)]
struct Failed {
    budget_percent: f64,
    policy: String,
    message: String,
}

#[derive(Debug, Serialize)]
struct Report {
    bench: &'static str,
    machine: Machine,
    width: u32,
    height: u32,
    samples: u32,
    bounces: u32,
    instances: u64,
    unique_quads: u64,
    copies: u32,
    flatten: bool,
    seed: u64,
    instanced_triangles: u64,
    meshes: u64,
    /// Making the arrays, which a host would do.
    generate_secs: f64,
    /// Building the meshes, partitioning.
    commit_secs: f64,
    chunks: u64,
    chunk_instances: u64,
    scene_bytes: u64,
    all_identical: bool,
    rows: Vec<Row>,
    failed: Vec<Failed>,
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    ensure!(arguments.budgets.first().is_some_and(|&p| p >= 100.0), "--budgets: the first one has to be 100");
    ensure!(arguments.budgets.iter().all(|&p| p > 0.0), "--budgets: only numbers above 0");
    let settings = common::plain_settings(arguments.samples, arguments.bounces, &arguments.device);
    let session = Session::with_options(settings, SessionOptions::default());
    session.set_setting("oocpt:memoryBudget", Value::Int(arguments.memory_budget.into()))?;
    if arguments.chunk_size > 0 {
        session.set_setting("oocpt:chunkSize", Value::Int(arguments.chunk_size.into()))?;
    }
    let started = Instant::now();
    session.with_scene(|db| island::build(db, &arguments.island))?;
    let generate_secs = started.elapsed().as_secs_f64();
    let started = Instant::now();
    session.render(request(arguments));
    let commit_secs = started.elapsed().as_secs_f64();
    finish(&session).context("warm-up render")?;
    let mut report = report(arguments, &session, generate_secs, commit_secs);
    table::print_head(&report);
    let mut reference = Vec::new();
    for (percent, policy) in budget_rows(&arguments.budgets, &arguments.policies) {
        match measure(arguments, &session, percent, &policy, &report, &mut reference) {
            Ok(row) => {
                table::print_row(&row);
                report.rows.push(row);
            }
            // A budget may be too small for the largest chunk: the other rows are worth having.
            Err(error) => {
                let message = format!("{error:#}");
                println!("{percent:>7} {policy}: {message}");
                report.failed.push(Failed { budget_percent: percent, policy, message });
            }
        }
    }
    report.all_identical = report.rows.iter().all(|row| row.is_identical);
    println!("pictures of all rows: {}", if report.all_identical { "bit-identical" } else { "DIFFERENT" });
    write_json(&report, arguments.json.as_deref())?;
    if let Some(path) = &arguments.picture {
        write_picture(&session, [arguments.width, arguments.height], path)?;
    }
    if let (Some(path), Some(row)) = (&arguments.chunk_report, report.rows.last()) {
        // In a render of its own: counting visits costs time, and a scene in core is streamed for it.
        set_row(&session, row.budget_percent, &row.policy, report.scene_bytes)?;
        session.set_setting("oocpt:chunkReport", Value::Text(path.to_string_lossy().into_owned()))?;
        session.render(request(arguments));
        finish(&session).context("render for the chunk report")?;
    }
    if !report.all_identical {
        bail!("the picture depends on the budget");
    }
    if !report.failed.is_empty() {
        bail!("{} of {} rows did not render", report.failed.len(), report.failed.len() + report.rows.len());
    }
    Ok(())
}

fn request(arguments: &Arguments) -> RenderRequest {
    let (width, height) = (arguments.width, arguments.height);
    common::color_request(width, height, island::camera(&arguments.island, width, height))
}

/// Sets the session up for a row; gives its budget in KiB.
fn set_row(session: &Session, percent: f64, policy: &str, scene_bytes: u64) -> Result<u32> {
    let budget = budget_kib(percent, scene_bytes);
    session.set_setting("oocpt:geometryBudget", Value::Int(budget.into()))?;
    if !policy.is_empty() {
        session.set_setting("oocpt:policy", Value::Text(policy.into()))?;
    }
    Ok(budget)
}

/// Renders one row. The first row leaves its picture in `reference`.
fn measure(
    arguments: &Arguments,
    session: &Session,
    percent: f64,
    policy: &str,
    report: &Report,
    reference: &mut Vec<u8>,
) -> Result<Row> {
    let budget = set_row(session, percent, policy, report.scene_bytes)?;
    session.render(request(arguments));
    let size = [arguments.width, arguments.height];
    let Runs { trace_secs, timings, stats, different_pixels } =
        common::measure(session, size, arguments.runs, arguments.cold, reference)?;
    arguments.observe.write(session, &request(arguments), &format!("{percent} {policy}"))?;
    let median_trace_secs = timings.trace_secs;
    let first = report.rows.first().map_or(median_trace_secs, |row| row.median_trace_secs);
    #[expect(clippy::cast_precision_loss, reason = "counts are shown as rates")]
    let mpaths_per_sec = timings.paths as f64 / median_trace_secs * 1e-6;
    Ok(Row {
        budget_percent: percent,
        geometry_budget_bytes: u64::from(budget) << 10,
        policy: policy.into(),
        trace_secs,
        median_trace_secs,
        ratio: median_trace_secs / first,
        mpaths_per_sec,
        is_identical: different_pixels == 0,
        different_pixels,
        gpu_peak_bytes: stats.gpu_peak_bytes,
        streaming: stats.streaming,
        passes: if arguments.profile { profile(session)? } else { Vec::new() },
    })
}

/// Renders once more and gives the device's time of each pass.
fn profile(session: &Session) -> Result<Vec<(String, f64, u64)>> {
    session.set_profiling(true);
    session.restart();
    let finished = finish(session).context("profiled render");
    session.set_profiling(false);
    finished?;
    Ok(session.timings().passes.into_iter().map(|pass| (pass.name, pass.secs, pass.runs)).collect())
}

fn report(arguments: &Arguments, session: &Session, generate_secs: f64, commit_secs: f64) -> Report {
    let stats = session.stats();
    let Parameters { unique_quads, copies, flatten, seed, .. } = arguments.island;
    Report {
        bench: "island",
        machine: Machine::new(Some(session), arguments.date.as_deref()),
        width: arguments.width,
        height: arguments.height,
        samples: arguments.samples,
        bounces: arguments.bounces,
        instances: stats.instances,
        unique_quads,
        copies,
        flatten,
        seed,
        instanced_triangles: stats.triangles,
        meshes: stats.meshes,
        generate_secs,
        commit_secs,
        chunks: stats.streaming.chunks,
        chunk_instances: stats.streaming.chunk_instances,
        scene_bytes: stats.streaming.scene_bytes,
        all_identical: true,
        rows: Vec::new(),
        failed: Vec::new(),
    }
}
