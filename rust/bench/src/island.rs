// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench island`: the same picture of the island under shrinking geometry budgets and every policy, in one
//! process on one device. The first row is in core; all other rows must give its picture bit for bit.
//!
//! Each row is rendered once to warm up (unless `--cold`), then `--runs` times; its counters are those of the median
//! run.

mod table;

use anyhow::{Context, Result};
use oocpt_core::settings::SettingValue;
use oocpt_core::stats::StreamingStats;
use oocpt_render::Session;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

use super::budgets::{self, Failed};
use super::common::{self, Machine, PassRow, Reported, Runs, finish, write_picture};
use super::observe::Observe;
use super::view::{Made, Seen, View};
use oocpt_scenes::island::Parameters;

/// Options of `oocpt bench island`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    view: View<Parameters>,
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
    #[command(flatten)]
    reported: Reported,
    /// Also write the picture to this file: PNG (sRGB), or EXR with how it was made.
    #[arg(long)]
    picture: Option<PathBuf>,
    /// Also render the last good row once more and write its chunk report to this file (`oocpt report chunks` draws
    /// it).
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
    passes: Vec<PassRow>,
}

#[derive(Debug, Serialize)]
struct Report {
    bench: &'static str,
    machine: Machine,
    #[serde(flatten)]
    seen: Seen<Parameters>,
    instanced_triangles: u64,
    meshes: u64,
    /// Making the arrays, which a host would do.
    generate_secs: f64,
    /// Building the meshes, partitioning.
    commit_secs: f64,
    /// Most host memory of the process until the commit was done, and until the end. Making the arrays counts.
    commit_host_peak_bytes: u64,
    host_peak_bytes: u64,
    chunk_instances: u64,
    all_identical: bool,
    rows: Vec<Row>,
    failed: Vec<Failed>,
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    budgets::check(&arguments.budgets)?;
    let session = arguments.view.session(&arguments.reported.device);
    budgets::limit(&session, arguments.memory_budget, arguments.chunk_size)?;
    let started = Instant::now();
    session.with_scene(|db| arguments.view.scene.build(db))?;
    let generate_secs = started.elapsed().as_secs_f64();
    let started = Instant::now();
    session.render(arguments.view.request());
    let commit_secs = started.elapsed().as_secs_f64();
    let commit_host_peak_bytes = oocpt_render::host_peak_bytes();
    finish(&session).context("warm-up render")?;
    let mut report = report(arguments, &session, generate_secs, commit_secs);
    report.commit_host_peak_bytes = commit_host_peak_bytes;
    table::print_head(&report);
    let (mut reference, bytes) = (Vec::new(), report.seen.scene_bytes);
    (report.rows, report.failed) = budgets::each(
        &arguments.budgets,
        &arguments.policies,
        |percent, policy, first| measure(arguments, &session, (percent, policy), bytes, first, &mut reference),
        table::print_row,
    );
    report.host_peak_bytes = oocpt_render::host_peak_bytes();
    table::print_host_peak(&report);
    report.all_identical = report.rows.iter().all(|row| row.is_identical);
    println!("pictures of all rows: {}", if report.all_identical { "bit-identical" } else { "DIFFERENT" });
    arguments.reported.write(&report)?;
    if let Some(path) = &arguments.picture {
        write_picture(&session, arguments.view.size(), path)?;
    }
    if let (Some(path), Some(row)) = (&arguments.chunk_report, report.rows.last()) {
        // In a render of its own: counting visits costs time, and a scene in core is streamed for it.
        budgets::set(&session, row.budget_percent, report.seen.scene_bytes, &row.policy)?;
        session.set_setting("oocpt:chunkReport", SettingValue::Text(path.to_string_lossy().into_owned()))?;
        session.render(arguments.view.request());
        finish(&session).context("render for the chunk report")?;
    }
    budgets::verdict(report.all_identical, report.rows.len(), &report.failed)
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
    session.render(arguments.view.request());
    let size = arguments.view.size();
    let Runs { trace_secs, timings, stats, different_pixels } =
        common::measure(session, size, arguments.runs, arguments.cold, reference)?;
    arguments.observe.write(session, &arguments.view.request(), &format!("{percent} {policy}"))?;
    let median_trace_secs = timings.trace_secs;
    let first = first.map_or(median_trace_secs, |row| row.median_trace_secs);
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
        passes: if arguments.profile { common::profile(session)? } else { Vec::new() },
    })
}

fn report(arguments: &Arguments, session: &Session, generate_secs: f64, commit_secs: f64) -> Report {
    let stats = session.stats();
    Report {
        bench: "island",
        machine: arguments.reported.machine(Some(session)),
        seen: arguments.view.seen(&stats),
        instanced_triangles: stats.triangles,
        meshes: stats.meshes,
        generate_secs,
        commit_secs,
        commit_host_peak_bytes: 0,
        host_peak_bytes: 0,
        chunk_instances: stats.streaming.chunk_instances,
        all_identical: true,
        rows: Vec::new(),
        failed: Vec::new(),
    }
}
