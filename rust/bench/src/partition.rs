// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench partition`: how fast a flattened island is committed and partitioned, and what it holds on the host.

use anyhow::{Context, Result};
use oocpt_core::partition::PartitionOptions;
use oocpt_core::scene::{SceneDb, Snapshot};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

use super::common::{Machine, median, reset_peak, resident_bytes, write_json};
use oocpt_scenes::island::{Parameters, Prims};

/// Options of `oocpt bench partition`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Instances of each island.
    #[arg(long, value_delimiter = ',', default_value = "100000,1000000,10000000")]
    instances: Vec<u64>,
    /// Quads of its unique meshes: small, they are built before the clock starts.
    #[arg(long, default_value_t = 20_000)]
    unique_quads: u64,
    /// Islands that share one set of arrays.
    #[arg(long, default_value_t = 1)]
    copies: u32,
    /// No island shares arrays with another one.
    #[arg(long)]
    distinct: bool,
    /// MiB of items that are sorted at once; a sixteenth of all are in any case. 0 = the default.
    #[arg(long, value_delimiter = ',', default_value = "0")]
    sort_memory: Vec<u64>,
    /// Threads of each pool; 0 = one per core.
    #[arg(long, value_delimiter = ',', default_value = "2,16")]
    threads: Vec<usize>,
    /// Counted runs of each row.
    #[arg(long, default_value_t = 3)]
    runs: u32,
    /// Chunk size, KiB.
    #[arg(long, default_value_t = 8192)]
    chunk_size: u64,
    /// Date to put into the report.
    #[arg(long)]
    date: Option<String>,
    /// Also write the report as JSON to this file.
    #[arg(long)]
    json: Option<PathBuf>,
}

/// One island on one pool.
#[derive(Debug, Serialize)]
struct Row {
    instances: u64,
    threads: usize,
    /// MiB of items that are sorted at once; 0 = the default.
    sort_memory: u64,
    /// Commit of all instances, meshes built before: resolve, scan, partition.
    commit_secs: Vec<f64>,
    median_commit_secs: f64,
    instances_per_sec: f64,
    chunks: usize,
    chunk_instances: usize,
    /// The borrowed instance arrays.
    array_bytes_per_instance: f64,
    /// What the process grew by through the first commit, meshes aside.
    host_bytes_per_instance: f64,
    /// The arrays, and what the process grew by at most during the first commit.
    peak_bytes_per_instance: f64,
}

#[derive(Debug, Serialize)]
struct Report {
    bench: &'static str,
    machine: Machine,
    copies: u32,
    unique_quads: u64,
    chunk_bytes: u64,
    rows: Vec<Row>,
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let machine = Machine::new(None, arguments.date.as_deref());
    println!("{machine}");
    println!(
        "{:>14} {:>8} {:>11} {:>14} {:>9} {:>11} {:>8} {:>14} {:>13} {:>13}",
        "instances",
        "threads",
        "commit s",
        "instances/s",
        "chunks",
        "instances",
        "sort MiB",
        "array B/inst",
        "host B/inst",
        "peak B/inst"
    );
    let mut rows = Vec::new();
    for &instances in &arguments.instances {
        let parameters = Parameters {
            instances,
            unique_quads: arguments.unique_quads,
            copies: arguments.copies,
            flatten: true,
            distinct: arguments.distinct,
            seed: 7,
        };
        let prims = Prims::new(&parameters)?;
        for &threads in &arguments.threads {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().context("cannot start threads")?;
            for &sort_memory in &arguments.sort_memory {
                let row = pool.install(|| measure(&parameters, &prims, arguments, sort_memory));
                print_row(&row);
                rows.push(row);
            }
        }
    }
    let Arguments { copies, unique_quads, chunk_size, .. } = *arguments;
    let report = Report { bench: "partition", machine, copies, unique_quads, chunk_bytes: chunk_size << 10, rows };
    write_json(&report, arguments.json.as_deref())
}

#[expect(clippy::cast_precision_loss, reason = "counts are shown as rates")]
fn measure(parameters: &Parameters, prims: &Prims, arguments: &Arguments, sort_memory: u64) -> Row {
    let total = parameters.total_instances() as f64;
    let mut commit_secs = Vec::new();
    let (mut grown, mut peak) = (0, 0);
    let mut sizes = (0, 0);
    for run in 0..arguments.runs.max(1) {
        let mut db = SceneDb::new();
        db.set_partition(PartitionOptions { chunk_bytes: arguments.chunk_size << 10 });
        if sort_memory > 0 {
            db.set_partition_memory(sort_memory << 20);
        }
        // Meshes first, each placed in the world, so that building them is not measured.
        for mesh in &prims.meshes {
            let mut mesh = mesh.clone();
            mesh.prim.instanced_by.clear();
            db.upsert_mesh(mesh);
        }
        drop(db.commit());
        let before = resident_bytes();
        if run == 0 {
            reset_peak();
        }
        prims.insert(&mut db);
        let started = Instant::now();
        let commit = db.commit();
        commit_secs.push(started.elapsed().as_secs_f64());
        if run == 0 {
            grown = resident_bytes().saturating_sub(before);
            peak = oocpt_render::host_peak_bytes().saturating_sub(before);
        }
        sizes = chunks(&commit.snapshot);
    }
    let median_commit_secs = median(commit_secs.clone());
    Row {
        instances: parameters.total_instances(),
        threads: rayon::current_num_threads(),
        sort_memory,
        commit_secs,
        median_commit_secs,
        instances_per_sec: total / median_commit_secs,
        chunks: sizes.0,
        chunk_instances: sizes.1,
        array_bytes_per_instance: prims.array_bytes() as f64 / total,
        host_bytes_per_instance: grown as f64 / total,
        peak_bytes_per_instance: (prims.array_bytes() + peak) as f64 / total,
    }
}

/// Chunks and chunk instances.
fn chunks(snapshot: &Snapshot) -> (usize, usize) {
    (snapshot.world.chunks.len(), snapshot.world.instances.len())
}

fn print_row(row: &Row) {
    println!(
        "{:>14} {:>8} {:>11.3} {:>14.0} {:>9} {:>11} {:>8} {:>14.1} {:>13.1} {:>13.1}",
        row.instances,
        row.threads,
        row.median_commit_secs,
        row.instances_per_sec,
        row.chunks,
        row.chunk_instances,
        row.sort_memory,
        row.array_bytes_per_instance,
        row.host_bytes_per_instance,
        row.peak_bytes_per_instance
    );
}
