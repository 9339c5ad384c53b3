// SPDX-License-Identifier: Apache-2.0
//! The tables of `bench stragglers`: a line for each row as it comes, then when how many of the paths were left.

use super::{Report, Row};

#[expect(clippy::cast_precision_loss, reason = "sizes are shown, not computed with")]
fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

fn name(row: &Row) -> &'static str {
    match (row.streaming.in_core, row.roulette) {
        (true, _) => "in core",
        (false, false) => "off",
        (false, true) => "on",
    }
}

pub(super) fn print_head(report: &Report) {
    println!("stragglers on {}", report.machine);
    println!("{}; against {} samples", report.seen, report.reference_samples);
    println!(
        "{:>7} {:<9}{:>9} {:>11} {:>11} {:>8} {:>8} {:>10} {:>9} {:>9} {:>8} {:>8}",
        "budget%",
        "roulette",
        "trace s",
        "relMSE",
        "1/(s err)",
        "loads",
        "reloads",
        "paged MiB",
        "ended",
        "shadows",
        "saved",
        "waiting"
    );
}

pub(super) fn print_row(row: &Row) {
    let s = &row.streaming;
    println!(
        "{:>7} {:<9}{:>9.3} {:>11.4e} {:>11.1} {:>8} {:>8} {:>10.1} {:>9} {:>9} {:>8} {:>8.3}",
        row.budget_percent,
        name(row),
        row.median_trace_secs,
        row.rel_mse,
        row.efficiency,
        s.loads,
        s.reloads,
        mib(s.bytes_paged),
        s.roulette_paths,
        s.roulette_shadow_rays,
        s.roulette_loads_saved,
        s.seconds_waiting
    );
}

pub(super) fn print_left(rows: &[Row]) {
    println!("{:>7} {:<9}{:>8} {:>9} {:>8} {:>10}", "budget%", "roulette", "left %", "s", "loads", "paged MiB");
    for row in rows {
        for left in &row.left {
            println!(
                "{:>7} {:<9}{:>8} {:>9.3} {:>8} {:>10.1}",
                row.budget_percent,
                name(row),
                left.percent,
                left.seconds,
                left.loads,
                mib(left.bytes_paged)
            );
        }
    }
}
