// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench stragglers`: what roulette on loads (`oocpt:stragglerRoulette`) gains. The island under small geometry
//! budgets, each without and with it, in one process on one device: seconds, loads, and the true error against a
//! picture in core with more samples; and when how many of the paths were left (the table of L. Berchtold's thesis,
//! 2022), with loads and bytes until then.
//!
//! Each row is rendered once to warm up, then once with each of `--runs` seeds; its table of paths left is that of the
//! run with the median time.

mod table;

use anyhow::{Context, Result, ensure};
use oocpt_core::settings::SettingValue;
use oocpt_core::stats::StreamingStats;
use oocpt_render::{AovKind, LeftMoment, RenderRequest, Session};
use serde::Serialize;
use std::path::PathBuf;

use super::budgets;
use super::common::{Machine, Reported, finish, median, write_picture};
use super::view::{Made, Seen, View};
use oocpt_scenes::island::Parameters;

/// Seed of the reference: none of those of the runs.
const REFERENCE_SEED: i64 = 1_000_003;
/// Keeps the relative error of black pixels finite.
const EPSILON: f64 = 1e-2;
/// Shares of the paths left, per cent.
const SHARES: [f64; 6] = [50.0, 10.0, 1.0, 0.1, 0.01, 0.0];

/// Options of `oocpt bench stragglers`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    view: View<Parameters>,
    /// Samples per pixel of the picture to compare with, rendered in core.
    #[arg(long, default_value_t = 1024)]
    reference_samples: u32,
    /// Geometry budgets in per cent of the scene's geometry, below 100.
    #[arg(long, value_delimiter = ',', default_value = "25,10,5")]
    budget: Vec<f64>,
    /// Chunk size, KiB; 0 = the default.
    #[arg(long, default_value_t = 0)]
    chunk_size: u32,
    /// Hard limit of all device memory, MiB; 0 = automatic.
    #[arg(long, default_value_t = 0)]
    memory_budget: u32,
    /// Counted runs of each row, each with another seed.
    #[arg(long, default_value_t = 3)]
    runs: u32,
    #[command(flatten)]
    reported: Reported,
    /// Also write the last picture as PNG (sRGB) to this file.
    #[arg(long)]
    picture: Option<PathBuf>,
}

/// When so many of the paths were left.
#[derive(Clone, Copy, Debug, Serialize)]
struct Left {
    /// At most, per cent.
    percent: f64,
    seconds: f64,
    loads: u64,
    bytes_paged: u64,
}

/// One budget without or with roulette; the first row is in core.
#[derive(Debug, Serialize)]
struct Row {
    budget_percent: f64,
    roulette: bool,
    trace_secs: Vec<f64>,
    median_trace_secs: f64,
    /// To the reference, mean over the runs.
    rel_mse: f64,
    /// 1 / (`rel_mse` x `median_trace_secs`).
    efficiency: f64,
    streaming: StreamingStats,
    left: Vec<Left>,
}

#[derive(Debug, Serialize)]
struct Report {
    bench: &'static str,
    machine: Machine,
    #[serde(flatten)]
    seen: Seen<Parameters>,
    reference_samples: u32,
    rows: Vec<Row>,
    /// Budgets too small for the largest chunk, and what was said.
    failed: Vec<(f64, String)>,
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    ensure!(arguments.budget.iter().all(|&p| p > 0.0 && p < 100.0), "--budget: numbers above 0 and below 100");
    let session = arguments.view.session(&arguments.reported.device);
    budgets::limit(&session, arguments.memory_budget, arguments.chunk_size)?;
    session.with_scene(|db| arguments.view.scene.build(db))?;
    let request = arguments.view.request();
    session.set_setting("oocpt:seed", SettingValue::Int(REFERENCE_SEED))?;
    session.set_setting("oocpt:samplesPerPixel", SettingValue::Int(arguments.reference_samples.into()))?;
    session.render(request.clone());
    finish(&session).context("reference")?;
    ensure!(session.stats().streaming.in_core, "the scene has to fit the device: it gives the reference");
    let reference = picture(&session, &request)?;
    session.set_setting("oocpt:samplesPerPixel", SettingValue::Int(arguments.view.samples.into()))?;
    let mut report = report(arguments, &session);
    table::print_head(&report);
    for (percent, roulette) in rows(&arguments.budget) {
        match measure(arguments, &session, (percent, roulette), report.seen.scene_bytes, &reference) {
            Ok(row) => {
                table::print_row(&row);
                report.rows.push(row);
            }
            Err(error) => {
                println!("{percent:>7} {error:#}");
                report.failed.push((percent, format!("{error:#}")));
            }
        }
    }
    table::print_left(&report.rows);
    arguments.reported.write(&report)?;
    if let Some(path) = &arguments.picture {
        write_picture(&session, arguments.view.size(), path)?;
    }
    ensure!(report.failed.is_empty(), "{} rows did not render", report.failed.len());
    Ok(())
}

/// In core, then each budget without and with roulette.
fn rows(budgets: &[f64]) -> Vec<(f64, bool)> {
    let pairs = budgets.iter().flat_map(|&percent| [(percent, false), (percent, true)]);
    std::iter::once((100.0, false)).chain(pairs).collect()
}

fn picture(session: &Session, request: &RenderRequest) -> Result<Vec<[f32; 4]>> {
    let mut pixels = vec![[0.0_f32; 4]; request.width as usize * request.height as usize];
    ensure!(session.read_aov(AovKind::Color, bytemuck::cast_slice_mut(&mut pixels)), "there is no picture");
    Ok(pixels)
}

fn measure(
    arguments: &Arguments,
    session: &Session,
    (percent, roulette): (f64, bool),
    scene_bytes: u64,
    reference: &[[f32; 4]],
) -> Result<Row> {
    budgets::set(session, percent, scene_bytes, "")?;
    session.set_setting("oocpt:stragglerRoulette", SettingValue::Bool(roulette))?;
    let request = arguments.view.request();
    session.set_setting("oocpt:seed", SettingValue::Int(0))?;
    session.render(request.clone());
    finish(session).context("warm-up render")?;
    let mut runs = Vec::new();
    let mut errors = Vec::new();
    for seed in 1..=arguments.runs.max(1) {
        session.set_setting("oocpt:seed", SettingValue::Int(seed.into()))?;
        session.render(request.clone());
        finish(session)?;
        errors.push(rel_mse(&picture(session, &request)?, reference));
        runs.push((session.timings(), session.stats().streaming));
    }
    let trace_secs: Vec<f64> = runs.iter().map(|(timings, _)| timings.trace_secs).collect();
    let median_trace_secs = median(trace_secs.clone());
    runs.sort_by(|a, b| a.0.trace_secs.total_cmp(&b.0.trace_secs));
    let (timings, streaming) = runs.swap_remove(runs.len() / 2);
    let rel_mse = errors.iter().sum::<f64>() / f64::from(arguments.runs.max(1));
    let left = SHARES.iter().filter_map(|&share| left_at(&timings.left, timings.paths, share)).collect();
    let efficiency = 1.0 / (rel_mse * median_trace_secs);
    Ok(Row { budget_percent: percent, roulette, trace_secs, median_trace_secs, rel_mse, efficiency, streaming, left })
}

/// The first moment with at most `percent` of the paths left.
fn left_at(moments: &[LeftMoment], paths: u64, percent: f64) -> Option<Left> {
    #[expect(clippy::cast_precision_loss, reason = "a share")]
    let share = |moment: &&LeftMoment| 100.0 * moment.paths_left as f64 <= percent * paths as f64;
    let &LeftMoment { seconds, loads, bytes_paged, .. } = moments.iter().find(share)?;
    Some(Left { percent, seconds, loads, bytes_paged })
}

/// Mean of `(x - r)^2 / (r^2 + 0.01)` over pixels and channels; contains the reference's own error.
fn rel_mse(picture: &[[f32; 4]], reference: &[[f32; 4]]) -> f64 {
    let error = |(x, r): (&f32, &f32)| {
        let (x, r) = (f64::from(*x), f64::from(*r));
        (x - r).powi(2) / (r * r + EPSILON)
    };
    let sum: f64 = picture.iter().zip(reference).flat_map(|(x, r)| x[..3].iter().zip(&r[..3]).map(error)).sum();
    #[expect(clippy::cast_precision_loss, reason = "a mean")]
    let count = (3 * reference.len().max(1)) as f64;
    sum / count
}

fn report(arguments: &Arguments, session: &Session) -> Report {
    Report {
        bench: "stragglers",
        machine: arguments.reported.machine(Some(session)),
        seen: arguments.view.seen(&session.stats()),
        reference_samples: arguments.reference_samples,
        rows: Vec::new(),
        failed: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_known_pictures() {
        let black = vec![[0.0; 4]; 5];
        let grey = vec![[0.1, 0.1, 0.1, 1.0]; 5];
        assert!((rel_mse(&grey, &black) - 1.0).abs() < 1e-6, "0.01 over 0.01");
        assert!((rel_mse(&black, &grey) - 0.5).abs() < 1e-6, "0.01 over 0.02");
        assert!(rel_mse(&grey, &grey).abs() < 1e-12, "the same");
    }

    #[test]
    fn the_first_moment_of_a_share_counts() {
        let moment =
            |seconds, paths_left| LeftMoment { seconds, paths_left, loads: paths_left, ..LeftMoment::default() };
        let moments = [moment(1.0, 900), moment(2.0, 100), moment(3.0, 90), moment(4.0, 0)];
        let at = |percent| left_at(&moments, 1000, percent).map(|left| left.seconds);
        assert_eq!([at(50.0), at(10.0), at(1.0), at(0.0)], [Some(2.0), Some(2.0), Some(4.0), Some(4.0)], "by share");
        assert!(left_at(&moments[..3], 1000, 0.0).is_none(), "never, as far as is known");
    }
}
