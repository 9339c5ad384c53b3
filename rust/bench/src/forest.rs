// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench forest`: renders the forest several times on a warm device: medians as a table and as JSON.
//!
//! The first render warms the device up and is not counted. A last, profiled render says where the time goes; its total
//! is not used, since timestamps cost a little.

use anyhow::{Context, Result};
use oocpt_core::inventory::RenderInventory;
use oocpt_render::{AovKind, AovRequest, RenderRequest, RenderTimings, Session, SessionOptions};
use serde::Serialize;
use std::path::PathBuf;

use super::common::{
    PassRow, color_request, finish, median, passes_of, plain_settings, print_passes, write_json, write_picture,
};
use super::observe::ObserveOptions;
use oocpt_scenes::forest;

/// Options of `oocpt bench forest`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Image width, pixels.
    #[arg(long, default_value_t = 1024)]
    width: u32,
    /// Image height, pixels.
    #[arg(long, default_value_t = 429)]
    height: u32,
    /// Samples per pixel.
    #[arg(long, default_value_t = 256)]
    samples: u32,
    /// Indirect bounces.
    #[arg(long, default_value_t = 5)]
    bounces: u32,
    /// Instances in the forest.
    #[arg(long, default_value_t = 100_000)]
    instances: u32,
    /// Counted runs.
    #[arg(long, default_value_t = 3)]
    runs: u32,
    /// Most paths in flight, to the power of two below; 0 = as many as pay.
    #[arg(long, default_value_t = 0)]
    in_flight: u32,
    /// Images beside the colour, by name.
    #[arg(long, value_delimiter = ',', value_parser = image)]
    images: Vec<AovKind>,
    /// Device: an index or a part of its name.
    #[arg(long, env = "OOCPT_DEVICE", default_value = "")]
    device: String,
    /// Also write the report as JSON to this file.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Also write the picture to this file: PNG (sRGB), or EXR with how it was made.
    #[arg(long)]
    picture: Option<PathBuf>,
    #[command(flatten)]
    observe: ObserveOptions,
}

fn image(name: &str) -> Result<AovKind> {
    AovKind::from_token(name).with_context(|| format!("there is no image {name}"))
}

/// Everything a bench says.
#[derive(Serialize)]
struct ForestReport {
    scene: &'static str,
    device: String,
    driver: String,
    width: u32,
    height: u32,
    samples: u32,
    bounces: u32,
    instances: u64,
    unique_triangles: u64,
    instanced_triangles: u64,
    gpu_mib: u64,
    commit_secs: f64,
    upload_secs: f64,
    build_secs: f64,
    compile_secs: f64,
    trace_secs: Vec<f64>,
    median_trace_secs: f64,
    mpaths_per_sec: f64,
    mrays_per_sec: f64,
    rays_per_path: f64,
    closest_rays: u64,
    shadow_rays: u64,
    waves: u64,
    /// Paths that waves have room for, and the bytes of their arrays.
    paths_in_flight: u64,
    path_mib: u64,
    /// Of GPU time, profiled run.
    passes: Vec<PassRow>,
    /// Million closest-hit rays a second while `intersect_closest` runs.
    closest_mrays_per_sec: f64,
    /// Million shadow rays a second while `intersect_shadow` runs.
    shadow_mrays_per_sec: f64,
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let settings = plain_settings(arguments.samples, arguments.bounces, &arguments.device);
    let in_flight = (arguments.in_flight > 0).then_some(arguments.in_flight);
    let session = Session::with_options(settings, SessionOptions { in_flight, ..SessionOptions::default() });
    let started = std::time::Instant::now();
    session.with_scene(|db| forest::build(db, arguments.instances))?;
    session.render(request(arguments));
    let commit_secs = started.elapsed().as_secs_f64();
    finish(&session).context("warm-up render")?;
    let first = session.timings();
    let mut runs = Vec::new();
    for _ in 0..arguments.runs.max(1) {
        session.restart();
        finish(&session)?;
        runs.push(session.timings());
    }
    session.set_profiling(true);
    session.restart();
    finish(&session).context("profiled render")?;
    let report = report(arguments, &session, &first, &runs, commit_secs);
    print_table(&report);
    write_json(&report, arguments.json.as_deref())?;
    arguments.observe.write(&session, &request(arguments), "")?;
    let size = [arguments.width, arguments.height];
    arguments.picture.as_ref().map_or(Ok(()), |path| write_picture(&session, size, path))
}

fn request(arguments: &Arguments) -> RenderRequest {
    let (width, height) = (arguments.width, arguments.height);
    let mut request = color_request(width, height, forest::camera(width, height));
    request.aovs.extend(arguments.images.iter().map(|kind| AovRequest { kind: *kind, clear: [0.0; 4] }));
    request
}

#[expect(clippy::cast_precision_loss, reason = "counts are shown as rates")]
fn report(
    arguments: &Arguments,
    session: &Session,
    first: &RenderTimings,
    runs: &[RenderTimings],
    commit_secs: f64,
) -> ForestReport {
    let (stats, profiled) = (session.stats(), session.timings());
    let trace_secs: Vec<f64> = runs.iter().map(|run| run.trace_secs).collect();
    let median_secs = median(trace_secs.clone());
    let pass_secs = |name: &str| profiled.passes.iter().find(|pass| pass.name == name).map_or(f64::NAN, |p| p.secs);
    let rays = (profiled.closest_rays + profiled.shadow_rays) as f64;
    let device = session.device_report();
    ForestReport {
        scene: "forest",
        device: device.as_ref().map(|d| d.name.clone()).unwrap_or_default(),
        driver: device.map(|d| d.driver).unwrap_or_default(),
        width: arguments.width,
        height: arguments.height,
        samples: arguments.samples,
        bounces: arguments.bounces,
        instances: stats.instances,
        unique_triangles: stats.unique_triangles,
        instanced_triangles: stats.triangles,
        gpu_mib: stats.gpu_peak_bytes >> 20,
        commit_secs,
        upload_secs: first.upload_secs,
        build_secs: first.build_secs,
        compile_secs: first.compile_secs,
        median_trace_secs: median_secs,
        mpaths_per_sec: profiled.paths as f64 / median_secs * 1e-6,
        mrays_per_sec: rays / median_secs * 1e-6,
        rays_per_path: rays / profiled.paths as f64,
        closest_rays: profiled.closest_rays,
        shadow_rays: profiled.shadow_rays,
        waves: profiled.waves,
        paths_in_flight: stats.inventory.paths,
        path_mib: path_bytes(&stats.inventory) >> 20,
        closest_mrays_per_sec: profiled.closest_rays as f64 / pass_secs("intersect_closest") * 1e-6,
        shadow_mrays_per_sec: profiled.shadow_rays as f64 / pass_secs("intersect_shadow") * 1e-6,
        passes: passes_of(&profiled),
        trace_secs,
    }
}

/// Bytes of the arrays by path.
fn path_bytes(inventory: &RenderInventory) -> u64 {
    let names = ["rays", "shadow_rays", "hits", "paths", "radiance", "cones", "light_paths", "incomplete_paths"];
    let queues = ["ray_queue 0", "ray_queue 1", "shadow_queue", "surface_queue", "escaped_queue", "settle_queue"];
    let is_of_paths = |name: &str| names.contains(&name) || queues.contains(&name) || name == "settle_hits";
    inventory.buffers.iter().filter(|buffer| is_of_paths(&buffer.name)).map(|buffer| buffer.bytes).sum()
}

fn print_table(report: &ForestReport) {
    println!("{} on {} ({})", report.scene, report.device, report.driver);
    println!(
        "{} x {} px, {} samples, {} bounces; {} instances, {} unique and {} instanced triangles; {} MiB on the GPU",
        report.width,
        report.height,
        report.samples,
        report.bounces,
        report.instances,
        report.unique_triangles,
        report.instanced_triangles,
        report.gpu_mib
    );
    println!(
        "commit {:.3} s, upload {:.3} s, tables {:.3} s, compile {:.3} s",
        report.commit_secs, report.upload_secs, report.build_secs, report.compile_secs
    );
    println!(
        "trace {:.3} s (median of {}): {:.2} Mpaths/s, {:.1} Mrays/s, {:.2} rays a path",
        report.median_trace_secs,
        report.trace_secs.len(),
        report.mpaths_per_sec,
        report.mrays_per_sec,
        report.rays_per_path
    );
    println!("{} waves; room for {} paths in flight, {} MiB", report.waves, report.paths_in_flight, report.path_mib);
    println!(
        "within its pass: closest {:.0} Mrays/s, shadow {:.0} Mrays/s",
        report.closest_mrays_per_sec, report.shadow_mrays_per_sec
    );
    print_passes(&report.passes);
}
