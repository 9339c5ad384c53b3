// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench edits`: a live session in which some of N instances move: what does an edit cost, and does it depend on
//! N?

use anyhow::{Context, Result, ensure};
use oocpt_core::array::TypedArray;
use oocpt_core::scene::InstancerDesc;
use oocpt_render::{RenderRequest, Session};
use serde::Serialize;

use super::common::{BenchMachine, finish};
use super::live::{self, EditCost, LiveOptions};
use super::observe::ObserveOptions;
use oocpt_scenes::island::{self, IslandParameters};

/// Options of `oocpt bench edits`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Instances of each island.
    #[arg(long, value_delimiter = ',', default_value = "1000000,10000000")]
    instances: Vec<u64>,
    /// Instances that move.
    #[arg(long, value_delimiter = ',', default_value = "1,1000,100000")]
    moves: Vec<u64>,
    /// Quads of the unique meshes.
    #[arg(long, default_value_t = 200_000)]
    unique_quads: u64,
    /// Counted edits of each row.
    #[arg(long, default_value_t = 3)]
    runs: u32,
    #[command(flatten)]
    live: LiveOptions,
    #[command(flatten)]
    observe: ObserveOptions,
}

/// Edits of one size in one island; seconds and counts of the median edit.
#[derive(Debug, Serialize)]
struct Row {
    instances: u64,
    moved: u64,
    commit_secs: f64,
    /// From the edit to its first whole image, commit included.
    image_secs: f64,
    uploaded_bytes: u64,
    chunks: usize,
    /// Chunks that the edit left, entered or changed.
    chunks_touched: usize,
    /// All records of these are made and sent again.
    records_touched: usize,
}

#[derive(Debug, Serialize)]
struct EditsReport {
    bench: &'static str,
    machine: BenchMachine,
    width: u32,
    height: u32,
    rows: Vec<Row>,
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let mut report = None;
    for &instances in &arguments.instances {
        let island = IslandParameters {
            instances,
            unique_quads: arguments.unique_quads,
            copies: 1,
            flatten: true,
            distinct: false,
            seed: 7,
        };
        let session = arguments.live.session(false)?;
        let prims = session.with_scene(|db| island::build(db, &island))?;
        let mut pebbles = prims
            .instancers
            .into_iter()
            .max_by_key(|instancer| instancer.translations.as_ref().map_or(0, TypedArray::len))
            .context("the island has no instancer")?;
        session.render(request(arguments, &island));
        finish(&session).context("first render")?;
        let report = report.get_or_insert_with(|| head(arguments, &session));
        for &moved in &arguments.moves {
            let mut rows = Vec::new();
            for run in 0..u64::from(arguments.runs.max(1)) {
                rows.push(edit(arguments, &island, &session, &mut pebbles, moved, run)?);
            }
            rows.sort_by(|a, b| a.image_secs.total_cmp(&b.image_secs));
            let row = rows.swap_remove(rows.len() / 2);
            print_row(&row);
            report.rows.push(row);
        }
        arguments.observe.write(&session, &request(arguments, &island), &instances.to_string())?;
    }
    report.map_or(Ok(()), |report| arguments.live.reported.write(&report))
}

fn head(arguments: &Arguments, session: &Session) -> EditsReport {
    let machine = arguments.live.reported.machine(Some(session));
    println!("edits on {machine}");
    println!(
        "{:>12} {:>9} {:>10} {:>9} {:>14} {:>9} {:>9} {:>10}",
        "instances", "moved", "commit s", "image s", "uploaded B", "chunks", "touched", "records"
    );
    let LiveOptions { width, height, .. } = arguments.live;
    EditsReport { bench: "edits", machine, width, height, rows: Vec::new() }
}

fn request(arguments: &Arguments, island: &IslandParameters) -> RenderRequest {
    arguments.live.request(|width, height| island::camera(island, width, height))
}

/// Moves `moved` instances of `instancer`, spread over all of it, by a few centimetres.
fn edit(
    arguments: &Arguments,
    island: &IslandParameters,
    session: &Session,
    instancer: &mut InstancerDesc,
    moved: u64,
    run: u64,
) -> Result<Row> {
    instancer.translations = instancer.translations.as_ref().map(|old| shifted(old, moved, run)).transpose()?;
    let EditCost { commit_secs, image_secs, made, after } =
        live::edit(session, instancer.clone(), request(arguments, island))?;
    Ok(Row {
        instances: session.stats().instances,
        moved,
        commit_secs,
        image_secs,
        uploaded_bytes: session.timings().uploaded_bytes,
        chunks: after.world.chunks.len(),
        chunks_touched: made.chunks,
        records_touched: made.records,
    })
}

/// A copy of the array in which `moved` elements differ.
fn shifted(old: &TypedArray, moved: u64, run: u64) -> Result<TypedArray> {
    let mut places: Vec<[f32; 3]> =
        (0..old.len()).filter_map(|i| old.vec3(i)).map(|p| p.as_vec3().to_array()).collect();
    let count = places.len() as u64;
    ensure!(moved <= count, "only {count} instances in the largest instancer, cannot move {moved}");
    for k in 0..moved {
        // Evenly spread; another place in each run.
        let index = usize::try_from((k * count / moved + run * 7919) % count)?;
        places[index][0] += 0.03;
    }
    Ok(TypedArray::of(places))
}

fn print_row(row: &Row) {
    println!(
        "{:>12} {:>9} {:>10.4} {:>9.4} {:>14} {:>9} {:>9} {:>10}",
        row.instances,
        row.moved,
        row.commit_secs,
        row.image_secs,
        row.uploaded_bytes,
        row.chunks,
        row.chunks_touched,
        row.records_touched
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_instances_move_as_asked() {
        let old = TypedArray::of(vec![[1.0_f32, 2.0, 3.0]; 1000]);
        for moved in [1, 7, 1000] {
            let new = shifted(&old, moved, 3).expect("enough instances");
            let differ = (0..1000).filter(|&i| new.vec3(i) != old.vec3(i)).count();
            assert_eq!(differ as u64, moved, "moved instances");
        }
        assert!(shifted(&old, 1001, 0).is_err(), "there are no more than 1000");
    }
}
