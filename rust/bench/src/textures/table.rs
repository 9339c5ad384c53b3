// SPDX-License-Identifier: Apache-2.0
//! The table of `bench textures`: a head, then a line for each row as it comes.

use super::{Report, Row};
use crate::common::print_passes;

#[expect(clippy::cast_precision_loss, reason = "sizes are shown, not computed with")]
fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

pub(super) fn print_head(report: &Report) {
    println!("textured woods on {}", report.machine);
    println!(
        "{} x {} px, {} samples, {} bounces; {} instances, {} instanced triangles, {} meshes",
        report.width,
        report.height,
        report.samples,
        report.bounces,
        report.instances,
        report.instanced_triangles,
        report.meshes
    );
    println!(
        "{} chunks, {} chunk instances; {:.1} MiB of geometry, {:.1} MiB of textures; generated in {:.2} s, committed \
        in {:.2} s",
        report.chunks,
        report.chunk_instances,
        mib(report.geometry_bytes),
        mib(report.texture_bytes),
        report.generate_secs,
        report.commit_secs
    );
    println!(
        "{:>7} {:>9} {:<9}{:>9} {:>9} {:>6} {:>9} {:>8} {:>8} {:>10} {:>8} {:>8} {:>10} {:>6} {:>8} {:>8} {:>8} {:>9} \
        {:>9} {:>5}",
        "budget%",
        "MiB",
        "policy",
        "cold s",
        "trace s",
        "ratio",
        "Mpaths/s",
        "chunks",
        "again",
        "MiB",
        "tiles",
        "again",
        "MiB",
        "hit%",
        "tracing",
        "loading",
        "waiting",
        "peak MiB",
        "device",
        "same"
    );
}

pub(super) fn print_row(row: &Row) {
    let s = &row.streaming;
    let policy = match (s.in_core, row.policy.is_empty()) {
        (true, _) => "in core",
        (false, true) => "(default)",
        (false, false) => &row.policy,
    };
    println!(
        "{:>7} {:>9.1} {:<9}{:>9.3} {:>9.3} {:>6.2} {:>9.3} {:>8} {:>8} {:>10.1} {:>8} {:>8} {:>10.1} {:>6.1} {:>8.3} \
        {:>8.3} {:>8.3} {:>9.1} {:>9.1} {:>5}",
        row.budget_percent,
        mib(row.budget_bytes),
        policy,
        row.cold_trace_secs,
        row.median_trace_secs,
        row.ratio,
        row.mpaths_per_sec,
        row.geometry_loads,
        row.geometry_reloads,
        mib(row.geometry_bytes_paged),
        row.tile_loads,
        row.tile_reloads,
        mib(row.tile_bytes_paged),
        100.0 * s.hit_rate,
        s.seconds_tracing,
        s.seconds_loading,
        s.seconds_waiting,
        mib(s.geometry_peak_bytes),
        mib(row.gpu_peak_bytes),
        if row.is_identical { "yes" } else { "NO" }
    );
    print_passes(&row.passes);
}
