// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench curves`: hair, points and a limit surface: seconds, rays a second, and memory for each item.

use anyhow::{Context, Result};
use oocpt_core::settings::{SettingValue, Settings};
use oocpt_render::{Session, SessionOptions};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

use super::common::{self, Machine, Reported, Runs, write_picture};
use oocpt_scenes::fur::{self, Subject};

/// Options of `oocpt bench curves`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Hairs, points, or quads of the surface.
    #[arg(long, default_value_t = 10_000)]
    count: u32,
    /// What is shown, one after the other.
    #[arg(long, value_delimiter = ',', value_enum, default_values_t = Subject::ALL)]
    subjects: Vec<Subject>,
    /// Longest edge of the limit surface in pixels; 0 is its cage.
    #[arg(long, default_value_t = Settings::default().dicing_rate)]
    dicing_rate: f32,
    /// Image width, pixels.
    #[arg(long, default_value_t = 320)]
    width: u32,
    /// Image height, pixels.
    #[arg(long, default_value_t = 240)]
    height: u32,
    /// Samples per pixel.
    #[arg(long, default_value_t = 4)]
    samples: u32,
    /// Indirect bounces.
    #[arg(long, default_value_t = 3)]
    bounces: u32,
    /// Counted runs of each scene.
    #[arg(long, default_value_t = 3)]
    runs: u32,
    #[command(flatten)]
    reported: Reported,
    /// Also write the pictures as PNG (sRGB) to this folder.
    #[arg(long)]
    pictures: Option<PathBuf>,
}

/// One scene.
#[derive(Debug, Serialize)]
struct Row {
    scene: &'static str,
    commit_secs: f64,
    trace_secs: Vec<f64>,
    median_trace_secs: f64,
    rays: u64,
    mrays_per_sec: f64,
    /// Leaf items: pieces of curves, points, triangles.
    items: u64,
    scene_bytes: u64,
    host_bytes: u64,
    device_bytes_per_count: f64,
}

#[derive(Debug, Serialize)]
struct Report {
    bench: &'static str,
    machine: Machine,
    width: u32,
    height: u32,
    samples: u32,
    bounces: u32,
    count: u32,
    rows: Vec<Row>,
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let mut rows = Vec::new();
    let mut machine = Machine::new(None, None);
    println!(
        "{:<15}{:>9} {:>9} {:>9} {:>12} {:>11} {:>11} {:>9}",
        "scene", "commit s", "trace s", "Mrays/s", "items", "device MiB", "host MiB", "B/count"
    );
    for subject in arguments.subjects.iter().copied() {
        let (row, session) = measure(arguments, subject)?;
        println!(
            "{:<15}{:>9.3} {:>9.3} {:>9.2} {:>12} {:>11} {:>11} {:>9.1}",
            row.scene,
            row.commit_secs,
            row.median_trace_secs,
            row.mrays_per_sec,
            row.items,
            row.scene_bytes >> 20,
            row.host_bytes >> 20,
            row.device_bytes_per_count
        );
        rows.push(row);
        machine = arguments.reported.machine(Some(&session));
        if let Some(folder) = &arguments.pictures {
            let path = folder.join(format!("{}.png", subject.name().replace(' ', "_")));
            write_picture(&session, [arguments.width, arguments.height], &path)?;
        }
    }
    println!("on {machine}");
    let Arguments { width, height, samples, bounces, count, .. } = *arguments;
    arguments.reported.write(&Report { bench: "curves", machine, width, height, samples, bounces, count, rows })
}

fn measure(arguments: &Arguments, subject: Subject) -> Result<(Row, Session)> {
    let size = [arguments.width, arguments.height];
    let plain = common::plain_settings(arguments.samples, arguments.bounces, &arguments.reported.device);
    let settings = Settings { dicing_rate: arguments.dicing_rate, ..plain };
    let session = Session::with_options(settings, SessionOptions::default());
    session.set_setting("enableInteractive", SettingValue::Bool(false))?;
    session.with_scene(|db| fur::build(db, subject, arguments.count))?;
    let started = Instant::now();
    session.render(common::color_request(size[0], size[1], fur::camera(size[0], size[1])));
    let commit_secs = started.elapsed().as_secs_f64();
    let Runs { trace_secs, timings, stats, .. } =
        common::measure(&session, size, arguments.runs, false, &mut Vec::new()).context(subject.name())?;
    let rays = timings.closest_rays + timings.shadow_rays;
    let scene_bytes = stats.streaming.scene_bytes;
    #[expect(clippy::cast_precision_loss, reason = "counts are shown as rates")]
    let (mrays_per_sec, device_bytes_per_count) =
        (rays as f64 / timings.trace_secs * 1e-6, scene_bytes as f64 / f64::from(arguments.count.max(1)));
    let row = Row {
        scene: subject.name(),
        commit_secs,
        trace_secs,
        median_trace_secs: timings.trace_secs,
        rays,
        mrays_per_sec,
        items: stats.unique_triangles,
        scene_bytes,
        host_bytes: stats.host_bytes,
        device_bytes_per_count,
    };
    Ok((row, session))
}
