// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench specialise`: what leaving out saves. Each scene is rendered by passes that are compiled for it, and by
//! passes that carry what it does not need, in turn, in one process on one device. All builds have to give the same
//! picture bit for bit.
//!
//! Builds: `own`; `features`, every feature that can be compiled in without another picture, all images and their
//! memory (materials are shaded another way and are not carried where a scene has none);
//! `everything`, with passes and memory for the deepest nesting as well; with `--each`, every such feature by itself;
//! with `--streaming`, the scene streamed though it fits. Each build has a session of its own, is rendered once to warm
//! up, then all builds of a scene in turn, `--runs` times.

use anyhow::{Context, Result, ensure};
use oocpt_abi::Features;
use oocpt_core::inventory::RenderInventory;
use oocpt_render::{ForcedFeatures, RenderRequest, Session, SessionOptions};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

use super::common::{
    BenchMachine, ReportOptions, all_images, compare, finish, median, only_color, plain_settings, write_picture,
};
use super::observe::ObserveOptions;
use oocpt_scenes::generated::GeneratedScene;
use oocpt_scenes::pictures::GeneratedPictures;

/// Options of `oocpt bench specialise`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Scenes.
    #[arg(long, value_delimiter = ',', value_enum, default_values_t = GeneratedScene::ALL)]
    scenes: Vec<GeneratedScene>,
    /// How large they are: numbers of instances grow with it.
    #[arg(long, default_value_t = 1)]
    scale: u32,
    /// Image width, pixels.
    #[arg(long, default_value_t = 256)]
    width: u32,
    /// Image height, pixels.
    #[arg(long, default_value_t = 144)]
    height: u32,
    /// Samples per pixel.
    #[arg(long, default_value_t = 8)]
    samples: u32,
    /// Indirect bounces.
    #[arg(long, default_value_t = 5)]
    bounces: u32,
    /// Counted runs of each build.
    #[arg(long, default_value_t = 5)]
    runs: u32,
    /// Also carries each feature by itself.
    #[arg(long)]
    each: bool,
    /// Also streams each scene though it fits.
    #[arg(long)]
    streaming: bool,
    #[command(flatten)]
    reported: ReportOptions,
    /// Also write the picture of the last scene to this file: PNG (sRGB) or EXR.
    #[arg(long)]
    picture: Option<PathBuf>,
    #[command(flatten)]
    observe: ObserveOptions,
}

const NONE: ForcedFeatures = ForcedFeatures::NONE;

/// One build of one scene.
#[derive(Debug, Serialize)]
struct Row {
    scene: GeneratedScene,
    build: String,
    /// Features that are compiled in, and how many of these the scene does not need.
    features: usize,
    carried: usize,
    max_levels: u32,
    stack_size: u32,
    pipelines: usize,
    /// Of this build's pipelines, when they were first needed.
    compile_secs: f64,
    /// Tracing of the first render; drivers that compile at first use (Mesa's software renderer) do it here.
    first_trace_secs: f64,
    /// Device memory and what the host reads of it, by the buffers there are.
    buffer_bytes: u64,
    /// By the driver's heap: the most that was held.
    gpu_peak_bytes: u64,
    trace_secs: Vec<f64>,
    median_trace_secs: f64,
    /// To the scene's own build; the median of the ratios of runs made in turn.
    ratio: f64,
    different_pixels: u64,
    inventory: RenderInventory,
}

#[derive(Debug, Serialize)]
struct SpecialiseReport {
    bench: &'static str,
    machine: BenchMachine,
    scale: u32,
    width: u32,
    height: u32,
    samples: u32,
    bounces: u32,
    rows: Vec<Row>,
}

/// A build that is rendered in turn with the others.
struct BuildSubject {
    name: String,
    session: Session,
    trace_secs: Vec<f64>,
    different_pixels: u64,
    /// Of the first render.
    compile_secs: f64,
    first_trace_secs: f64,
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let mut rows: Vec<Row> = Vec::new();
    let mut machine = None;
    print_head(arguments);
    for (at, &scene) in arguments.scenes.iter().enumerate() {
        let builds = measure(arguments, scene)?;
        let own = builds.first().map(|build| build.trace_secs.clone()).unwrap_or_default();
        for build in &builds {
            let row = row(scene, build, &own);
            print_row(&row);
            rows.push(row);
        }
        let first = &builds.first().context("no build was rendered")?.session;
        machine = Some(arguments.reported.machine(Some(first)));
        if let (true, Some(path)) = (at + 1 == arguments.scenes.len(), &arguments.picture) {
            write_picture(first, [arguments.width, arguments.height], path)?;
        }
        arguments.observe.write(first, &request(arguments, scene, false), scene.name())?;
    }
    let Arguments { scale, width, height, samples, bounces, .. } = *arguments;
    let machine = machine.context("no scene was named")?;
    println!("on {machine}");
    let report = SpecialiseReport { bench: "specialise", machine, scale, width, height, samples, bounces, rows };
    arguments.reported.write(&report)?;
    let wrong = report.rows.iter().find(|row| row.different_pixels > 0);
    ensure!(wrong.is_none(), "what was carried changed the picture: {:?}", wrong.map(|row| (row.scene, &row.build)));
    Ok(())
}

/// Renders all builds of a scene in turn.
fn measure(arguments: &Arguments, scene: GeneratedScene) -> Result<Vec<BuildSubject>> {
    let mut builds = vec![
        build(arguments, scene, "own", NONE, false)?,
        build(arguments, scene, "features", ForcedFeatures { features: Features::all(), levels: false }, false)?,
        build(arguments, scene, "everything", ForcedFeatures::ALL, false)?,
    ];
    if arguments.each {
        let inventory = builds[1].session.stats().inventory;
        for feature in inventory.features.iter().filter(|feature| feature.carried) {
            let features = Features::from_name(&feature.name).context("a feature without a bit")?;
            builds.push(build(arguments, scene, &feature.name, ForcedFeatures { features, ..NONE }, false)?);
        }
        builds.push(build(arguments, scene, "LEVELS", ForcedFeatures { levels: true, ..NONE }, false)?);
    }
    if arguments.streaming {
        builds.push(build(arguments, scene, "streaming", NONE, true)?);
    }
    let mut reference: Vec<u8> = Vec::new();
    for _ in 0..arguments.runs.max(1) {
        for build in &mut builds {
            build.session.restart();
            finish(&build.session).with_context(|| format!("{}, {}", scene.name(), build.name))?;
            build.trace_secs.push(build.session.timings().trace_secs);
            let different = compare(&build.session, [arguments.width, arguments.height], &mut reference)?;
            build.different_pixels = build.different_pixels.max(different);
        }
    }
    Ok(builds)
}

/// A build, rendered once to warm up.
fn build(
    arguments: &Arguments,
    scene: GeneratedScene,
    name: &str,
    forced_features: ForcedFeatures,
    streams: bool,
) -> Result<BuildSubject> {
    let settings = plain_settings(arguments.samples, arguments.bounces, &arguments.reported.device);
    let options = SessionOptions { force_streaming: streams, forced_features, ..SessionOptions::default() };
    let session = Session::with_options(settings, options).with_images(Arc::new(GeneratedPictures));
    session.with_scene(|db| scene.build(db, arguments.scale))?;
    let images = forced_features.features == Features::all();
    session.render(request(arguments, scene, images));
    finish(&session).with_context(|| format!("warm-up of {}, {name}", scene.name()))?;
    let inventory = session.stats().inventory;
    let compile_secs = inventory.passes.iter().map(|pass| pass.compile_secs).sum();
    let first_trace_secs = session.timings().trace_secs;
    let name = name.to_owned();
    Ok(BuildSubject { name, session, trace_secs: Vec::new(), different_pixels: 0, compile_secs, first_trace_secs })
}

fn request(arguments: &Arguments, scene: GeneratedScene, images: bool) -> RenderRequest {
    let Arguments { width, height, scale, .. } = *arguments;
    let aovs = if images { all_images() } else { only_color() };
    RenderRequest { width, height, camera: scene.camera(scale, width, height), aovs, window: None }
}

fn row(scene: GeneratedScene, build: &BuildSubject, own: &[f64]) -> Row {
    let stats = build.session.stats();
    let inventory = stats.inventory;
    let ratios = build.trace_secs.iter().zip(own).map(|(secs, own)| secs / own).collect();
    Row {
        scene,
        build: build.name.clone(),
        features: inventory.features.iter().filter(|feature| feature.present).count(),
        carried: inventory.features.iter().filter(|feature| feature.carried).count(),
        max_levels: inventory.max_levels,
        stack_size: inventory.stack_size,
        pipelines: inventory.pipelines(),
        compile_secs: build.compile_secs,
        first_trace_secs: build.first_trace_secs,
        buffer_bytes: inventory.bytes(),
        gpu_peak_bytes: stats.gpu_peak_bytes,
        trace_secs: build.trace_secs.clone(),
        median_trace_secs: median(build.trace_secs.clone()),
        ratio: median(ratios),
        different_pixels: build.different_pixels,
        inventory,
    }
}

fn print_head(arguments: &Arguments) {
    let Arguments { width, height, samples, bounces, scale, .. } = arguments;
    println!("{width} x {height} px, {samples} samples, {bounces} bounces, scale {scale}");
    println!(
        "{:<10}{:<19}{:>9}{:>8}{:>7}{:>10}{:>11}{:>9}{:>13}{:>9}{:>8}{:>10}",
        "scene",
        "build",
        "features",
        "carried",
        "levels",
        "pipelines",
        "compile s",
        "first s",
        "buffers KiB",
        "trace s",
        "ratio",
        "different"
    );
}

fn print_row(row: &Row) {
    println!(
        "{:<10}{:<19}{:>9}{:>8}{:>7}{:>10}{:>11.3}{:>9.3}{:>13}{:>9.3}{:>8.3}{:>10}",
        row.scene.name(),
        row.build,
        row.features,
        row.carried,
        row.max_levels,
        row.pipelines,
        row.compile_secs,
        row.first_trace_secs,
        row.buffer_bytes >> 10,
        row.median_trace_secs,
        row.ratio,
        row.different_pixels
    );
}
