// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench moving`: an animation in a live session, of which some or all instances are elsewhere in each frame:
//! frames a second, and what is made anew for them.

use anyhow::{Context, Result, ensure};
use glam::DVec3;
use oocpt_core::array::TypedArray;
use oocpt_core::mesh::level_node_count;
use oocpt_core::scene::InstancerDesc;
use oocpt_render::Session;
use rayon::prelude::*;
use serde::Serialize;
use std::time::Instant;

use super::common::{BenchMachine, finish};
use super::live::{self, EditCost, LiveOptions};
use oocpt_scenes::forest;

/// Radius of the circle that an instance goes around, units; its meshes are about one wide.
const RADIUS: f64 = 0.5;
/// Frames that do not count.
const BEFORE: u32 = 2;
/// Frames of a circle.
const FRAMES: f64 = 48.0;

/// Options of `oocpt bench moving`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Instances in all, of 16 meshes.
    #[arg(long, value_delimiter = ',', default_value = "10000,100000,1000000")]
    instances: Vec<u32>,
    /// Per cent of them that move, spread evenly.
    #[arg(long, value_delimiter = ',', default_value = "100,1")]
    percents: Vec<u32>,
    /// Frames that count; two more go before.
    #[arg(long, default_value_t = 5)]
    frames: u32,
    /// Moves them by velocities while the shutter is open, too: a record of two keys each.
    #[arg(long)]
    blurred: bool,
    /// Cuts and builds anew what moves, as a batch render does.
    #[arg(long)]
    cut: bool,
    #[command(flatten)]
    live: LiveOptions,
}

/// Frames of one size: means over them.
#[derive(Debug, Default, Serialize)]
struct Row {
    instances: usize,
    moved: usize,
    blurred: bool,
    /// Making the arrays of the frame: the host's work, by all threads, so that the device does not cool down.
    edit_secs: f64,
    commit_secs: f64,
    upload_secs: f64,
    trace_secs: f64,
    /// From the edited arrays to the first sample, commit included.
    frame_secs: f64,
    frames_per_second: f64,
    uploaded_bytes: u64,
    chunks: usize,
    /// Chunks whose records are made and sent again.
    chunks_rebuilt: usize,
    records_rebuilt: usize,
    /// Nodes of the trees of these, and of the top level where it is another one.
    nodes_rebuilt: usize,
    nodes: usize,
    /// Meshes whose triangles or trees are another allocation than before.
    meshes_rebuilt: usize,
    /// Trees over instances that kept their shape.
    trees_refitted: u64,
    /// Instances below them.
    records_refitted: u64,
    /// Of these, the instances that the device placed from arrays.
    records_placed: u64,
    /// Trees over instances that were built.
    trees_built: u64,
}

#[derive(Debug, Serialize)]
struct MovingReport {
    bench: &'static str,
    machine: BenchMachine,
    width: u32,
    height: u32,
    frames: u32,
    rows: Vec<Row>,
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let mut report = None;
    for &instances in &arguments.instances {
        let session = arguments.live.session(!arguments.cut)?;
        session.with_scene(|db| forest::build(db, instances))?;
        let rest = forest::scatter(instances)?;
        session.render(arguments.live.request(forest::camera));
        finish(&session).context("first render")?;
        let report = report.get_or_insert_with(|| head(arguments, &session));
        for &percent in &arguments.percents {
            let row = animate(arguments, &session, &rest, percent)?;
            print_row(&row);
            report.rows.push(row);
        }
    }
    report.map_or(Ok(()), |report| arguments.live.reported.write(&report))
}

fn head(arguments: &Arguments, session: &Session) -> MovingReport {
    let machine = arguments.live.reported.machine(Some(session));
    println!("moving instances on {machine}");
    println!(
        "{:>10} {:>10} {:>9} {:>9} {:>9} {:>9} {:>9} {:>8} {:>12} {:>12} {:>10} {:>18} {:>9} {:>6}",
        "instances",
        "moved",
        "edit s",
        "commit s",
        "upload s",
        "trace s",
        "frame s",
        "1/s",
        "uploaded B",
        "chunks",
        "records",
        "nodes",
        "refitted",
        "built"
    );
    let LiveOptions { width, height, .. } = arguments.live;
    let frames = arguments.frames;
    MovingReport { bench: "moving", machine, width, height, frames, rows: Vec::new() }
}

/// Frames in which `percent` of the instances move.
fn animate(arguments: &Arguments, session: &Session, rest: &InstancerDesc, percent: u32) -> Result<Row> {
    ensure!((1..=100).contains(&percent), "{percent} % of the instances cannot move");
    let places = rest.translations.as_ref().context("the forest has places")?;
    let instances = places.len();
    let moved = (instances * percent as usize / 100).max(1);
    let mut row = Row { instances, moved, blurred: arguments.blurred, ..Row::default() };
    let frames = arguments.frames.max(1);
    for frame in 0..frames + BEFORE {
        let started = Instant::now();
        let edited = placed(rest, places, moved, frame, arguments.blurred);
        let edit_secs = started.elapsed().as_secs_f64();
        let EditCost { commit_secs, image_secs, made, after } =
            live::edit(session, edited, arguments.live.request(forest::camera))?;
        // The first frames make what is asked for the first time, and find out who places what moves.
        if frame >= BEFORE {
            let timings = session.timings();
            row.edit_secs += edit_secs;
            row.commit_secs += commit_secs;
            row.frame_secs += image_secs;
            row.upload_secs += timings.upload_secs;
            row.trace_secs += timings.trace_secs;
            row.uploaded_bytes += timings.uploaded_bytes;
            row.chunks = after.world.chunks.len();
            row.chunks_rebuilt += made.chunks;
            row.records_rebuilt += made.records;
            row.nodes_rebuilt += made.nodes;
            row.nodes = after.world.chunks.iter().map(|chunk| level_node_count(chunk.len())).sum::<usize>()
                + after.world.top.nodes.len();
            row.meshes_rebuilt += made.meshes;
            row.trees_refitted += timings.levels.refitted;
            row.records_refitted += timings.levels.refitted_records;
            row.records_placed += timings.levels.placed_records;
            row.trees_built += timings.levels.built;
        }
    }
    let count = frames as usize;
    let mean = f64::from(frames);
    for secs in
        [&mut row.edit_secs, &mut row.commit_secs, &mut row.frame_secs, &mut row.upload_secs, &mut row.trace_secs]
    {
        *secs /= mean;
    }
    let Row { uploaded_bytes, trees_refitted, records_refitted, records_placed, trees_built, .. } = &mut row;
    for sum in [uploaded_bytes, trees_refitted, records_refitted, records_placed, trees_built] {
        *sum = sum.div_ceil(u64::from(frames));
    }
    for sum in [&mut row.chunks_rebuilt, &mut row.records_rebuilt, &mut row.nodes_rebuilt, &mut row.meshes_rebuilt] {
        *sum = sum.div_ceil(count);
    }
    row.frames_per_second = 1.0 / row.frame_secs;
    Ok(row)
}

/// The instances in a frame: `moved` of them, spread over all, on their circles. `blurred`: with velocities.
fn placed(rest: &InstancerDesc, places: &TypedArray, moved: usize, frame: u32, blurred: bool) -> InstancerDesc {
    let count = places.len();
    // Instance k * count / moved, for each k: those at which the share of the whole grows by one.
    let moves = |at: usize| at * moved / count != (at + 1) * moved / count;
    let angle = |at: usize| {
        // The golden angle: neighbours in the array are at other places of their circles.
        std::f64::consts::TAU * f64::from(frame) / FRAMES + 2.399_963 * (at % 1024) as f64
    };
    let at = |at: usize| {
        let place = places.vec3(at).unwrap_or_default();
        let turn = angle(at);
        let offset = if moves(at) { DVec3::new(turn.cos(), 0.0, turn.sin()) * RADIUS } else { DVec3::ZERO };
        (place + offset).as_vec3().to_array()
    };
    let velocity = |at: usize| {
        let turn = angle(at);
        let speed = std::f64::consts::TAU * RADIUS / FRAMES * 24.0;
        let rate = if moves(at) { DVec3::new(-turn.sin(), 0.0, turn.cos()) * speed } else { DVec3::ZERO };
        rate.as_vec3().to_array()
    };
    let mut desc = rest.clone();
    desc.translations = Some(TypedArray::of((0..count).into_par_iter().map(at).collect::<Vec<[f32; 3]>>()));
    if blurred {
        desc.motion.velocities =
            Some(TypedArray::of((0..count).into_par_iter().map(velocity).collect::<Vec<[f32; 3]>>()));
        desc.motion.seconds = [-0.25 / 24.0, 0.25 / 24.0];
    }
    desc
}

fn print_row(row: &Row) {
    println!(
        "{:>10} {:>10} {:>9.4} {:>9.4} {:>9.4} {:>9.4} {:>9.4} {:>8.2} {:>12} {:>12} {:>10} {:>18} {:>9} {:>6}",
        row.instances,
        row.moved,
        row.edit_secs,
        row.commit_secs,
        row.upload_secs,
        row.trace_secs,
        row.frame_secs,
        row.frames_per_second,
        row.uploaded_bytes,
        format!("{} of {}", row.chunks_rebuilt, row.chunks),
        row.records_rebuilt,
        format!("{} of {}", row.nodes_rebuilt, row.nodes),
        row.trees_refitted,
        row.trees_built
    );
}

#[cfg(test)]
mod tests {
    use super::super::live::{CommitCounts, made};
    use super::*;
    use oocpt_core::scene::SceneDb;

    #[test]
    fn as_many_instances_move_as_asked_and_nothing_else_is_made() {
        let rest = forest::scatter(1000).expect("a forest");
        let places = rest.translations.clone().expect("places");
        for moved in [1, 7, 300, 1000] {
            let frame = placed(&rest, &places, moved, 3, false).translations.expect("places");
            let differ = (0..1000).filter(|&at| frame.vec3(at) != places.vec3(at)).count();
            assert_eq!(differ, moved, "moved instances");
        }
        let blurred = placed(&rest, &places, 10, 0, true).motion.velocities.expect("velocities");
        let fast = (0..1000).filter(|&at| blurred.vec3(at).expect("a vector").length() > 0.1).count();
        assert_eq!(fast, 10, "instances with a velocity");
        let mut db = SceneDb::new();
        forest::build(&mut db, 1000).expect("a forest");
        let first = db.commit().snapshot;
        db.upsert_instancer(placed(&rest, &places, 1000, 0, false));
        let second = db.commit().snapshot;
        let all = made(&first, &second);
        assert!(all.records >= 1000 && all.nodes >= 333 && all.meshes == 0, "{all:?}");
        db.upsert_instancer(placed(&rest, &places, 1000, 0, false));
        assert_eq!(made(&second, &db.commit().snapshot), CommitCounts::default(), "the same again");
    }
}
