// SPDX-License-Identifier: Apache-2.0
//! The table of `bench texture-files`: a head, then a line for each row as it comes.

use super::{Arguments, Row};

#[expect(clippy::cast_precision_loss, reason = "sizes are shown, not computed with")]
fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

pub(super) fn print_head(arguments: &Arguments) {
    println!(
        "usdrecord, {} px wide, {} samples, median of {} runs of the whole process; files are in the system's page \
        cache; MiB are peaks of the \
         process and of the device's memory, tiles and MiB of textures what was brought to the device",
        arguments.width, arguments.samples, arguments.runs
    );
    println!(
        "{:>6} {:<5}{:>6} {:>9} {:<5}{:>9} {:>9} {:>9} {:>10} {:>8} {:>9} {:>10} {:>9} {:>9} {:>6}",
        "size",
        "kind",
        "files",
        "disk MiB",
        "cache",
        "s",
        "cpu s",
        "MiB",
        "device MiB",
        "tiles",
        "tex MiB",
        "cache MiB",
        "decode s",
        "bound s",
        "holds"
    );
}

pub(super) fn print_row(row: &Row) {
    // In core today's counters of loads stay 0: everything is there before the first ray.
    let is_whole = row.usage.texture_loads == 0;
    let texture = if is_whole { row.usage.texture_scene_bytes } else { row.usage.texture_bytes_paged };
    let tiles = if is_whole { "all".to_owned() } else { row.usage.texture_loads.to_string() };
    println!(
        "{:>6} {:<5}{:>6} {:>9.1} {:<5}{:>9.2} {:>9.2} {:>9.0} {:>10.1} {:>8} {:>9.1} {:>10.1} {:>9.3} {:>9.2} {:>6}",
        row.size,
        row.kind,
        row.files,
        mib(row.file_bytes),
        row.cache,
        row.secs,
        row.cpu_secs,
        mib(row.peak_bytes),
        mib(row.device_peak_bytes),
        tiles,
        mib(texture),
        mib(row.cache_bytes),
        row.decode_secs,
        row.bound_secs,
        if row.holds { "yes" } else { "NO" }
    );
    for warning in &row.warnings {
        println!("       warning: {warning}");
    }
}
