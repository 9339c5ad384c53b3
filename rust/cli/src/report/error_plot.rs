// SPDX-License-Identifier: Apache-2.0
//! `oocpt report plot`: draws error over time from the reports that `oocpt:report` made, and prints the time to given
//! errors.
//!
//! The last render of each file counts. The error is the true relMSE if there is a reference, else the estimate with
//! its interval. The dashed line falls as the inverse of the time from the last row on: relMSE is a squared error, so
//! that is the slope -1/2 of the root.

use super::chart::{Chart, ChartCurve};
use anyhow::{Context, Result};
use oocpt_core::stats::ErrorRow;
use oocpt_render::error_report::ErrorReport;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Errors whose time is printed.
const TARGETS: [f64; 3] = [1e-1, 1e-2, 1e-3];

/// Options of `oocpt report plot`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Files that the setting `oocpt:report` named.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Name of the pictures without `.svg` and `.png`.
    #[arg(long, default_value = "error")]
    out: PathBuf,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let mut reports = Vec::new();
    for file in &arguments.files {
        let renders = ErrorReport::read_all(file).with_context(|| format!("cannot read {}", file.display()))?;
        let name = file.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        reports.extend(renders.into_iter().next_back().map(|report| (name, report)));
    }
    let chart = chart(reports.iter().map(|(name, report)| (name.as_str(), report.rows.as_slice())));
    let (svg, png) = (arguments.out.with_extension("svg"), arguments.out.with_extension("png"));
    std::fs::write(&svg, chart.svg()?).with_context(|| format!("cannot write {}", svg.display()))?;
    super::save(&chart.picture()?, &png)?;
    println!("{}\n{}", svg.display(), table(&reports));
    Ok(())
}

/// Seconds and error of a row, with the ends of the interval, which are 0 for a true error.
fn point(row: &ErrorRow) -> Option<[f64; 4]> {
    let point = match (row.truth, row.estimate) {
        (Some(truth), _) => [row.seconds_tracing, truth.rel_mse, 0.0, 0.0],
        (None, Some(estimate)) => [row.seconds_tracing, estimate.rel_mse, estimate.low, estimate.high],
        (None, None) => return None,
    };
    (point[0] > 0.0 && point[1] > 0.0 && point.iter().all(|v| v.is_finite())).then_some(point)
}

/// The chart of reports with these names and rows.
pub(super) fn chart<'a>(reports: impl Iterator<Item = (&'a str, &'a [ErrorRow])>) -> Chart {
    let mut curves = Vec::new();
    for (number, (name, rows)) in reports.enumerate() {
        let points: Vec<[f64; 4]> = rows.iter().filter_map(point).collect();
        let last = points.last().copied();
        curves.push(ChartCurve { name: name.to_owned(), points, color_of: number, ..ChartCurve::default() });
        if let (0, Some([x, y, ..])) = (number, last) {
            let ideal = [1e-6, 1e6].map(|factor| [x * factor, y / factor, 0.0, 0.0]);
            let name = "ideal: slope -1 (RMSE -1/2)".to_owned();
            curves.push(ChartCurve { name, points: ideal.to_vec(), is_dashed: true, color_of: 1 });
        }
    }
    Chart { curves, x_title: "seconds tracing", y_title: "relMSE" }
}

/// Seconds at which the error falls to `target` for good, interpolated linearly in the logarithms between two rows;
/// `None` if it never does.
pub(crate) fn time_to(rows: &[ErrorRow], target: f64) -> Option<f64> {
    let points: Vec<[f64; 4]> = rows.iter().filter_map(point).collect();
    let last_above = points.iter().rposition(|p| p[1] > target);
    match last_above {
        None => points.first().map(|p| p[0]),
        Some(k) => {
            let (a, b) = (points[k], points.get(k + 1)?);
            let share = (a[1].ln() - target.ln()) / (a[1].ln() - b[1].ln());
            Some((a[0].ln() + share * (b[0].ln() - a[0].ln())).exp())
        }
    }
}

/// The table: samples, seconds, estimate and the error against a reference at the end, and the seconds to each target:
/// of the true error if there is a reference.
fn table(reports: &[(String, ErrorReport)]) -> String {
    let mut text =
        format!("{:<24}{:>9}{:>11}{:>12}{:>25}", "report", "samples", "seconds", "estimate", "95 % interval");
    _ = write!(text, "{:>12}{:>12}{:>9}", "true relMSE", "RMSE", "FLIP");
    for target in TARGETS {
        _ = write!(text, "{:>12}", format!("to {target:.0e}"));
    }
    text.push('\n');
    for (name, report) in reports {
        let Some(last) = report.rows.last() else { continue };
        let none = || "-".to_owned();
        let estimate = last.estimate.map_or_else(none, |e| format!("{:.3e}", e.rel_mse));
        let interval = last.estimate.map_or_else(none, |e| format!("{:.3e} to {:.3e}", e.low, e.high));
        let rel_mse = last.truth.map_or_else(none, |truth| format!("{:.3e}", truth.rel_mse));
        let rmse = last.truth.map_or_else(none, |truth| format!("{:.3e}", truth.rmse));
        let flip = last.truth.map_or_else(none, |truth| format!("{:.4}", truth.flip));
        _ = write!(text, "{name:<24}{:>9}{:>11.3}{estimate:>12}{interval:>25}", last.samples, last.seconds_tracing);
        _ = write!(text, "{rel_mse:>12}{rmse:>12}{flip:>9}");
        for target in TARGETS {
            let time = time_to(&report.rows, target).map_or("-".to_owned(), |secs| format!("{secs:.3} s"));
            _ = write!(text, "{time:>12}");
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_core::convergence::ErrorEstimate;
    use oocpt_core::stats::TrueError;

    fn rows(slope: f64) -> Vec<ErrorRow> {
        let row = |k: i32| {
            let seconds = 0.01 * 2_f64.powi(k);
            let rel_mse = 0.01 * seconds.powf(slope);
            let estimate = Some(ErrorEstimate { rel_mse, low: 0.8 * rel_mse, high: 1.25 * rel_mse });
            ErrorRow { samples: 1 << k, seconds, seconds_tracing: seconds, estimate, ..ErrorRow::default() }
        };
        (0..10).map(row).collect()
    }

    #[test]
    fn the_time_to_an_error_lies_on_the_line_between_rows() {
        let rows = rows(-1.0);
        for (target, seconds) in [(0.1, 0.1), (0.01, 1.0)] {
            let found = time_to(&rows, target).expect("it is reached");
            assert!((found / seconds - 1.0).abs() < 1e-9, "relMSE {target} at {found} s, not at {seconds}");
        }
        assert_eq!(time_to(&rows, 1e-4), None, "never reached");
        assert_eq!(time_to(&rows, 1e3), Some(0.01), "from the first row on");
    }

    #[test]
    fn an_error_that_rises_again_is_not_reached_before() {
        let mut rows = rows(-1.0);
        rows[6].estimate = rows[0].estimate;
        let found = time_to(&rows, 0.1).expect("it is reached");
        assert!(found > rows[6].seconds, "a firefly at {} s: {found}", rows[6].seconds);
    }

    #[test]
    fn charts_and_table_match_the_rows() {
        let report = |slope| ErrorReport { rows: rows(slope), ..ErrorReport::default() };
        let reports = [("steep <a>".to_owned(), report(-1.0)), ("flat".to_owned(), report(-0.5))];
        let chart = chart(reports.iter().map(|(name, report)| (name.as_str(), report.rows.as_slice())));
        let svg = chart.svg().expect("a chart");
        assert!(svg.contains("steep &lt;a&gt;") && svg.trim_end().ends_with("</svg>"), "names are data: {svg}");
        let curves: Vec<&str> = svg.lines().filter(|line| line.contains("stroke-width=\"2\"")).collect();
        assert_eq!(curves.len(), 2, "the ideal line is dashed: {svg}");
        for curve in curves {
            let points = curve.split("points=\"").nth(1).and_then(|rest| rest.split('"').next()).expect("points");
            assert_eq!(points.split_whitespace().count(), 10, "a point of each row: {curve}");
        }
        let picture = chart.picture().expect("a chart");
        let drawn = picture.pixels().filter(|p| p.0 != picture.get_pixel(0, picture.height() - 1).0).count();
        assert!(drawn > 5000, "curves, grid and letters: {drawn} pixels");
        let table = table(&reports);
        assert!(table.lines().count() == 3 && table.contains("0.100 s"), "{table}");
    }

    #[test]
    fn estimated_and_reference_errors_are_both_charted() {
        let mut rows = rows(-1.0);
        for row in &mut rows {
            let rel_mse = 2.0 * row.estimate.expect("an estimate").rel_mse;
            row.truth = Some(TrueError { rel_mse, rmse: 0.25, flip: 0.0625 });
        }
        let reports = [("referenced".to_owned(), ErrorReport { rows, ..ErrorReport::default() })];
        let table = table(&reports);
        let words: Vec<&str> = table.lines().nth(1).expect("a row").split_whitespace().collect();
        assert_eq!(words[3..9], ["1.953e-3", "1.563e-3", "to", "2.441e-3", "3.906e-3", "2.500e-1"], "{table}");
        assert_eq!((words[9], words[10]), ("0.0625", "0.200"), "FLIP, and the time to a true error of 0.1: {table}");
    }

    #[test]
    fn a_report_without_errors_is_an_empty_chart() {
        let empty = [("empty".to_owned(), ErrorReport::default())];
        assert!(
            chart([("empty", &[][..])].into_iter()).svg().expect("a chart").contains("relMSE"),
            "axes all the same"
        );
        assert!(table(&empty).starts_with("report"), "the head of the table");
    }
}
