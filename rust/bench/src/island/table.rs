// SPDX-License-Identifier: Apache-2.0
//! The table of `bench island`: a head, then a line for each row as it comes.

use super::{Report, Row};

pub(super) fn print_head(report: &Report) {
    println!("island on {}", report.machine);
    println!("{}", report.seen);
    println!(
        "{} instanced triangles, {} meshes, {} chunk instances; generated in {:.2} s, committed in {:.2} s",
        report.instanced_triangles, report.meshes, report.chunk_instances, report.generate_secs, report.commit_secs
    );
    println!(
        "{:>7} {:>9} {:<9}{:>9} {:>6} {:>9} {:>8} {:>8} {:>8} {:>10} {:>6} {:>8} {:>8} {:>8} {:>8} {:>9} {:>5}",
        "budget%",
        "MiB",
        "policy",
        "trace s",
        "ratio",
        "Mpaths/s",
        "loads",
        "reloads",
        "evicted",
        "paged MiB",
        "hit%",
        "tracing",
        "loading",
        "waiting",
        "overlap",
        "peak MiB",
        "same"
    );
}

/// The most host memory, which is known at the end.
#[expect(clippy::cast_precision_loss, reason = "sizes are shown, not computed with")]
pub(super) fn print_host_peak(report: &Report) {
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    println!(
        "host memory at most: {:.0} MiB until the commit was done, {:.0} MiB until the end",
        mib(report.commit_host_peak_bytes),
        mib(report.host_peak_bytes)
    );
}

/// What the row was rendered with; a first row that does not fit all memory streams too.
fn policy_name(row: &Row) -> &str {
    match (row.streaming.in_core, row.policy.is_empty()) {
        (true, _) => "in core",
        (false, true) => "(default)",
        (false, false) => &row.policy,
    }
}

#[expect(clippy::cast_precision_loss, reason = "sizes are shown, not computed with")]
pub(super) fn print_row(row: &Row) {
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let s = &row.streaming;
    println!(
        "{:>7} {:>9.1} {:<9}{:>9.3} {:>6.2} {:>9.3} {:>8} {:>8} {:>8} {:>10.1} {:>6.1} {:>8.3} {:>8.3} {:>8.3} \
        {:>8.3} {:>9.1} {:>5}",
        row.budget_percent,
        mib(row.geometry_budget_bytes),
        policy_name(row),
        row.median_trace_secs,
        row.ratio,
        row.mpaths_per_sec,
        s.loads,
        s.reloads,
        s.evictions,
        mib(s.bytes_paged),
        100.0 * s.hit_rate,
        s.seconds_tracing,
        s.seconds_loading,
        s.seconds_waiting,
        s.seconds_overlapped,
        mib(s.geometry_peak_bytes),
        if row.is_identical { "yes" } else { "NO" }
    );
}
