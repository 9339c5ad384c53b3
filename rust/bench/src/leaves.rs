// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench leaves`: what cutouts cost. Three scenes of the same instanced leaves, in one process on one device:
//! opaque cards, cards whose opacity is a picture that is 1 all over, and leaves cut out by a picture. The second has
//! to give the first one's picture bit for bit, at no cost: its texels say that nobody need ask (decisions/0058). The
//! third one's rays go on where a card has holes, so rays are counted too.

use anyhow::{Context, Result, bail};
use oocpt_core::settings::SettingValue;
use oocpt_render::{Session, SessionOptions};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

use super::common::{self, Machine, PassRow, Reported, Runs, print_passes, write_picture};
use super::observe::Observe;
use oocpt_scenes::leaves::{self, Leaves};
use oocpt_scenes::pictures::Pictures;

/// Options of `oocpt bench leaves`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Leaves, each an instance.
    #[arg(long, default_value_t = 10_000)]
    leaves: u32,
    /// Side of the picture, texels.
    #[arg(long, default_value_t = 512)]
    texture_size: u32,
    /// Image width, pixels.
    #[arg(long, default_value_t = 160)]
    width: u32,
    /// Image height, pixels.
    #[arg(long, default_value_t = 120)]
    height: u32,
    /// Samples per pixel.
    #[arg(long, default_value_t = 4)]
    samples: u32,
    /// Indirect bounces.
    #[arg(long, default_value_t = 3)]
    bounces: u32,
    /// Hard limit of all device memory, MiB; 0 = automatic.
    #[arg(long, default_value_t = 0)]
    memory_budget: u32,
    /// Counted runs of each scene.
    #[arg(long, default_value_t = 3)]
    runs: u32,
    /// Also renders each scene once more with timestamps, for the passes it spends its time in.
    #[arg(long)]
    profile: bool,
    #[command(flatten)]
    reported: Reported,
    /// Also write the picture of the cut leaves as PNG (sRGB) to this file.
    #[arg(long)]
    picture: Option<PathBuf>,
    #[command(flatten)]
    observe: Observe,
}

/// One scene.
#[derive(Debug, Serialize)]
struct Row {
    scene: &'static str,
    trace_secs: Vec<f64>,
    median_trace_secs: f64,
    /// Seconds to those of the first row.
    ratio: f64,
    closest_rays: u64,
    shadow_rays: u64,
    mrays_per_sec: f64,
    /// Seconds a ray to those of the first row.
    ratio_per_ray: f64,
    /// To the first row's picture.
    different_pixels: u64,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    passes: Vec<PassRow>,
}

#[derive(Debug, Serialize)]
struct Report {
    bench: &'static str,
    machine: Machine,
    width: u32,
    height: u32,
    samples: u32,
    bounces: u32,
    leaves: u32,
    texture_size: u32,
    rows: Vec<Row>,
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let mut reference = Vec::new();
    let mut rows = Vec::new();
    let mut last = None;
    for kind in Leaves::ALL {
        // A session at a time, so that none shares the device with another.
        drop(last.take());
        let session = session(arguments, kind)?;
        if rows.is_empty() {
            print_head(arguments, &Machine::new(None, None));
        }
        let row = measure(arguments, &session, kind, rows.first(), &mut reference)?;
        print_row(&row);
        rows.push(row);
        last = Some(session);
    }
    let report = Report {
        bench: "leaves",
        machine: arguments.reported.machine(last.as_ref()),
        width: arguments.width,
        height: arguments.height,
        samples: arguments.samples,
        bounces: arguments.bounces,
        leaves: arguments.leaves,
        texture_size: arguments.texture_size,
        rows,
    };
    println!("on {}", report.machine);
    arguments.reported.write(&report)?;
    if let (Some(path), Some(session)) = (&arguments.picture, &last) {
        write_picture(session, [arguments.width, arguments.height], path)?;
    }
    if report.rows.get(1).is_some_and(|row| row.different_pixels > 0) {
        bail!("a picture that is opaque all over changed the render");
    }
    Ok(())
}

fn session(arguments: &Arguments, kind: Leaves) -> Result<Session> {
    let settings = common::plain_settings(arguments.samples, arguments.bounces, &arguments.reported.device);
    let session = Session::with_options(settings, SessionOptions::default()).with_images(Arc::new(Pictures));
    session.set_setting("oocpt:memoryBudget", SettingValue::Int(arguments.memory_budget.into()))?;
    session.with_scene(|db| leaves::build(db, kind, arguments.leaves, arguments.texture_size))?;
    Ok(session)
}

fn measure(
    arguments: &Arguments,
    session: &Session,
    kind: Leaves,
    first: Option<&Row>,
    reference: &mut Vec<u8>,
) -> Result<Row> {
    let size = [arguments.width, arguments.height];
    let request = common::color_request(size[0], size[1], leaves::camera(size[0], size[1]));
    session.render(request.clone());
    let Runs { trace_secs, timings, different_pixels, .. } =
        common::measure(session, size, arguments.runs, false, reference).context(kind.name())?;
    let passes = if arguments.profile { common::profile(session)? } else { Vec::new() };
    arguments.observe.write(session, &request, kind.name())?;
    let median_trace_secs = timings.trace_secs;
    #[expect(clippy::cast_precision_loss, reason = "counts are shown as rates")]
    let mrays_per_sec = (timings.closest_rays + timings.shadow_rays) as f64 / median_trace_secs * 1e-6;
    Ok(Row {
        scene: kind.name(),
        trace_secs,
        median_trace_secs,
        ratio: first.map_or(1.0, |first| median_trace_secs / first.median_trace_secs),
        closest_rays: timings.closest_rays,
        shadow_rays: timings.shadow_rays,
        mrays_per_sec,
        ratio_per_ray: first.map_or(1.0, |first| first.mrays_per_sec / mrays_per_sec),
        different_pixels,
        passes,
    })
}

fn print_head(arguments: &Arguments, machine: &Machine) {
    println!("{} leaves, {machine}", arguments.leaves);
    println!(
        "{} x {} px, {} samples, {} bounces",
        arguments.width, arguments.height, arguments.samples, arguments.bounces
    );
    println!(
        "{:<15}{:>9} {:>6} {:>12} {:>12} {:>9} {:>8} {:>10}",
        "scene", "trace s", "ratio", "closest", "shadow", "Mrays/s", "per ray", "different"
    );
}

fn print_row(row: &Row) {
    println!(
        "{:<15}{:>9.3} {:>6.2} {:>12} {:>12} {:>9.2} {:>8.2} {:>10}",
        row.scene,
        row.median_trace_secs,
        row.ratio,
        row.closest_rays,
        row.shadow_rays,
        row.mrays_per_sec,
        row.ratio_per_ray,
        row.different_pixels
    );
    print_passes(&row.passes);
}
