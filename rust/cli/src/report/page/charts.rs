// SPDX-License-Identifier: Apache-2.0
//! The page's charts: error and memory over time, on axes that are as long. Their colours are the page's, which follow
//! the reader's.

use super::PageReport;
use super::text::clean;
use crate::report::chart::{COLORS, Chart, ChartCurve, GRID, INK, PAPER};
use crate::report::error_plot;
use anyhow::Result;
use oocpt_core::stats::ErrorRow;
use plotters::style::RGBColor;

/// Points of a curve; a report may have any number of rows.
const MAX_POINTS: usize = 400;

/// Error over time of all reports.
pub(super) fn error(reports: &[PageReport]) -> Result<String> {
    let named: Vec<_> = reports.iter().map(|of| (clean(&of.name), thinned(&of.report.rows))).collect();
    themed(&error_plot::chart(named.iter().map(|(name, rows)| (name.as_str(), rows.as_slice()))))
}

/// Memory over time of all reports, in MiB; `None` where no row tells any.
pub(super) fn memory(reports: &[PageReport]) -> Result<Option<String>> {
    type MemoryKind = (&'static str, fn(&ErrorRow) -> u64);
    let kinds: [MemoryKind; 3] = [
        ("device memory", |row| row.gpu_bytes),
        ("most memory of the process", |row| row.host_peak_bytes),
        ("sent to the device", |row| row.bytes_paged),
    ];
    let mut curves = Vec::new();
    for of in reports {
        let rows = thinned(&of.report.rows);
        for (what, bytes) in kinds {
            #[expect(clippy::cast_precision_loss, reason = "a point of a chart")]
            let point = |row: &ErrorRow| [row.seconds_tracing, bytes(row) as f64 / f64::from(1 << 20), 0.0, 0.0];
            let points: Vec<_> = rows.iter().map(point).filter(|p| p[0] > 0.0 && p[1] > 0.0).collect();
            let of_whom = if reports.len() > 1 { format!("{}: ", clean(&of.name)) } else { String::new() };
            if !points.is_empty() {
                curves.push(ChartCurve { name: format!("{of_whom}{what}"), points, ..ChartCurve::default() });
            }
        }
    }
    let chart = Chart { curves, x_title: "seconds tracing", y_title: "MiB" };
    if chart.curves.is_empty() { Ok(None) } else { themed(&chart).map(Some) }
}

/// Every so many rows, and the last one.
fn thinned(rows: &[ErrorRow]) -> Vec<ErrorRow> {
    let step = rows.len().div_ceil(MAX_POINTS).max(1);
    rows.iter().enumerate().filter(|(k, _)| k % step == 0 || k + 1 == rows.len()).map(|(_, row)| row.clone()).collect()
}

/// The chart as SVG whose colours are the variables of the page's style.
fn themed(chart: &Chart) -> Result<String> {
    let hex = |color: RGBColor| format!("#{:02X}{:02X}{:02X}", color.0, color.1, color.2);
    let named = [(PAPER, "paper".to_owned()), (GRID, "grid".to_owned()), (INK, "ink".to_owned())];
    let curves = COLORS.iter().enumerate().map(|(number, color)| (*color, format!("curve{number}")));
    let svg = named.into_iter().chain(curves).fold(chart.svg()?, |svg, (color, name)| {
        svg.replace(&format!("\"{}\"", hex(color)), &format!("\"var(--{name})\""))
    });
    Ok(svg)
}
