// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench memory` and `woods-memory`: the same picture of the island or the woods with ever less device memory in
//! all: geometry, textures, paths, film, tables and workspaces together. The first row has what the device gives; the
//! others a share of what that row took at most. All rows must give its picture bit for bit.
//!
//! Each row opens the device anew. Its first render is cold: it begins with empty device memory, and what it uploads is
//! in its seconds. Where a scene that fits was rendered while it came, the first picture in core brings the rest and is
//! told apart. The others begin with what the one before left on the device. Compiling passes is not counted.

use anyhow::{Context, Result, bail, ensure};
use oocpt_core::settings::SettingValue;
use oocpt_core::stats::{RenderStats, StreamingStats};
use oocpt_render::{RenderTimings, Session, host_peak_bytes};
use serde::Serialize;
use std::time::Instant;

use super::common::{self, Machine, PassRow, Reported, finish};
use super::view::{Made, Seen, View};

/// Options of `oocpt bench memory`.
#[derive(clap::Args)]
pub(crate) struct Arguments<S: Made> {
    #[command(flatten)]
    view: View<S>,
    /// Device memory in all of the rows after the first, in per cent of what that row took at most.
    #[arg(long, value_delimiter = ',', default_value = "100,90,75,55,40,27,20,14,10")]
    percents: Vec<f64>,
    /// Device memory in all of further rows, MiB.
    #[arg(long, value_delimiter = ',')]
    mib: Vec<u32>,
    /// Warm renders of each row.
    #[arg(long, default_value_t = 1)]
    runs: u32,
    /// Renders each row once more, timing its passes on the device; that run counts for nothing else.
    #[arg(long)]
    profile: bool,
    #[command(flatten)]
    reported: Reported,
}

/// What one render took.
#[derive(Clone, Debug, Serialize)]
struct Run {
    /// Uploads, trees, tracing.
    secs: f64,
    /// Of these: what had to be there before the first wave.
    upload_secs: f64,
    gpu_peak_bytes: u64,
    streaming: StreamingStats,
}

impl Run {
    fn new(timings: &RenderTimings, stats: RenderStats) -> Self {
        let upload_secs = timings.upload_secs + timings.build_secs;
        let RenderStats { gpu_peak_bytes, streaming, .. } = stats;
        Self { secs: upload_secs + timings.trace_secs, upload_secs, gpu_peak_bytes, streaming }
    }
}

/// One budget.
#[derive(Debug, Serialize)]
struct Row {
    /// 0: as the device gives.
    budget_mib: u32,
    /// Of the first row's peak.
    percent: f64,
    cold: Run,
    /// The picture that brought the rest of a scene that fits and was rendered while it came.
    #[serde(skip_serializing_if = "Option::is_none")]
    rest: Option<Run>,
    /// With the median time.
    warm: Run,
    /// Seconds to the first row's.
    ratio_cold: f64,
    ratio_warm: f64,
    different_pixels: u64,
    /// The most memory that the process held in it.
    host_peak_bytes: u64,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    passes: Vec<PassRow>,
}

/// A row that did not render.
#[derive(Debug, Serialize)]
struct Failed {
    budget_mib: u32,
    message: String,
}

#[derive(Debug, Serialize)]
struct Report<S> {
    bench: &'static str,
    machine: Machine,
    #[serde(flatten)]
    seen: Seen<S>,
    commit_secs: f64,
    /// The most memory that the process held until then.
    commit_host_peak_bytes: u64,
    rows: Vec<Row>,
    failed: Vec<Failed>,
}

/// Runs the bench.
pub(crate) fn run<S: Made>(arguments: &Arguments<S>) -> Result<()> {
    ensure!(arguments.percents.iter().all(|&p| p > 0.0), "--percents: only numbers above 0");
    let session = arguments.view.session(&arguments.reported.device);
    session.with_scene(|db| arguments.view.scene.build(db))?;
    let started = Instant::now();
    session.render(arguments.view.request());
    let commit_secs = started.elapsed().as_secs_f64();
    let commit_host_peak_bytes = host_peak_bytes();
    let mut reference = Vec::new();
    let first = measure(arguments, &session, 0, None, &mut reference).context("all the memory there is")?;
    let mut report = Report {
        bench: "memory",
        machine: arguments.reported.machine(Some(&session)),
        seen: arguments.view.seen(&session.stats()),
        commit_secs,
        commit_host_peak_bytes,
        rows: Vec::new(),
        failed: Vec::new(),
    };
    print_head(&report);
    print_row(&first);
    let peak = first.cold.gpu_peak_bytes.max(first.warm.gpu_peak_bytes);
    let share = |percent: &f64| mib_of(*percent, peak);
    let budgets: Vec<u32> = arguments.percents.iter().map(share).chain(arguments.mib.iter().copied()).collect();
    report.rows.push(first);
    for budget in budgets {
        match measure(arguments, &session, budget, report.rows.first(), &mut reference) {
            Ok(row) => {
                print_row(&row);
                report.rows.push(row);
            }
            Err(error) => {
                println!("{budget:>8}  failed: {error:#}");
                report.failed.push(Failed { budget_mib: budget, message: format!("{error:#}") });
            }
        }
    }
    arguments.reported.write(&report)?;
    let different = report.rows.iter().filter(|row| row.different_pixels > 0).count();
    match (different, report.failed.len()) {
        (0, 0) => Ok(()),
        (different, failed) => bail!("{different} rows have another picture, {failed} did not render"),
    }
}

/// `percent` of `bytes`, rounded up to MiB.
#[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "sizes")]
fn mib_of(percent: f64, bytes: u64) -> u32 {
    (bytes as f64 * percent / 100.0 / f64::from(1 << 20)).ceil() as u32
}

/// Renders one row. The first row leaves its picture in `reference`.
fn measure<S: Made>(
    arguments: &Arguments<S>,
    session: &Session,
    budget_mib: u32,
    first: Option<&Row>,
    reference: &mut Vec<u8>,
) -> Result<Row> {
    common::reset_peak();
    session.set_setting("oocpt:memoryBudget", SettingValue::Int(budget_mib.into()))?;
    session.render(arguments.view.request());
    let size = arguments.view.size();
    let mut different_pixels = 0;
    let mut runs: Vec<Run> = Vec::new();
    let mut rest: Option<Run> = None;
    while runs.len() <= arguments.runs as usize {
        if !runs.is_empty() {
            session.restart();
        }
        finish(session)?;
        different_pixels = different_pixels.max(common::compare(session, size, reference)?);
        let run = Run::new(&session.timings(), session.stats());
        let is_first_in_core = run.streaming.in_core && runs.last().is_some_and(|last| !last.streaming.in_core);
        if is_first_in_core && rest.is_none() {
            rest = Some(run);
        } else {
            runs.push(run);
        }
    }
    let cold = runs.remove(0);
    runs.sort_by(|a, b| a.secs.total_cmp(&b.secs));
    let warm = runs.get(runs.len() / 2).unwrap_or(&cold).clone();
    let base = first.map_or((cold.secs, warm.secs), |row| (row.cold.secs, row.warm.secs));
    let peak = first.map_or(cold.gpu_peak_bytes, |row| row.cold.gpu_peak_bytes);
    #[expect(clippy::cast_precision_loss, reason = "sizes are shown, not computed with")]
    let percent =
        if budget_mib == 0 { 100.0 } else { f64::from(budget_mib) * 100.0 * f64::from(1 << 20) / peak as f64 };
    Ok(Row {
        budget_mib,
        percent,
        ratio_cold: cold.secs / base.0,
        ratio_warm: warm.secs / base.1,
        cold,
        rest,
        warm,
        different_pixels,
        host_peak_bytes: host_peak_bytes(),
        passes: if arguments.profile { common::profile(session)? } else { Vec::new() },
    })
}

#[expect(clippy::cast_precision_loss, reason = "sizes are shown, not computed with")]
fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

fn print_head<S: Made>(report: &Report<S>) {
    println!("memory, {} on {}", S::NAME, report.machine);
    let Report { seen, commit_secs, commit_host_peak_bytes, .. } = report;
    println!("{seen}, committed in {commit_secs:.2} s with {:.0} MiB of host memory", mib(*commit_host_peak_bytes));
    println!(
        "{:>8} {:>6} {:>8} {:>8} {:>7} {:>7} {:>6} {:>6} {:>8} {:>10} {:>10} {:>8} {:>5}",
        "MiB",
        "%",
        "peak",
        "driver",
        "cold s",
        "warm s",
        "cold",
        "warm",
        "loads",
        "paged MiB",
        "geometry",
        "host",
        "same"
    );
}

fn print_row(row: &Row) {
    let Run { streaming, .. } = &row.warm;
    println!(
        "{:>8} {:>6.1} {:>8.0} {:>8.0} {:>7.3} {:>7.3} {:>6.2} {:>6.2} {:>8} {:>10.0} {:>10} {:>8.0} {:>5}",
        row.budget_mib,
        row.percent,
        mib(row.cold.gpu_peak_bytes.max(row.warm.gpu_peak_bytes)),
        mib(streaming.driver_peak_bytes.max(row.cold.streaming.driver_peak_bytes)),
        row.cold.secs,
        row.warm.secs,
        row.ratio_cold,
        row.ratio_warm,
        streaming.loads,
        mib(streaming.bytes_paged),
        if streaming.in_core { "in core".into() } else { format!("{:.0} MiB", mib(streaming.geometry_budget_bytes)) },
        mib(row.host_peak_bytes),
        if row.different_pixels == 0 { "yes" } else { "NO" }
    );
    common::print_passes(&row.passes);
}
