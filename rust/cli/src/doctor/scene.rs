// SPDX-License-Identifier: Apache-2.0
//! `oocpt doctor --scene S`: what a scene needs of the renderer and what was left out for it, compared with the build
//! that carries every feature which does not change the picture.
//!
//! A generated scene is rendered here; a USD file by a Hydra host ([`super::host`]), so that the report describes a
//! host's renders. Bytes and pipelines are exact for a picture of this size; for times see `oocpt bench specialise`.

use super::host::{self, HostAnswer, HostQuery};
use super::table;
use crate::bench::{all_images, finish};
use crate::scene::generated::GeneratedScene;
use crate::scene::pictures::GeneratedPictures;
use anyhow::{Context, Result, bail};
use oocpt_core::inventory::RenderInventory;
use oocpt_core::settings::Settings;
use oocpt_render::{AovKind, AovRequest, RenderRequest, Session, SessionOptions};
use serde::Serialize;
use std::ffi::OsString;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// The value of `oocpt:carry` of the build that the scene's own is compared with.
const EVERYTHING: &str = "all";

/// Options that go with `--scene`.
#[derive(clap::Args)]
pub(crate) struct SceneCheckOptions {
    /// Tells what this scene needs: a USD file, or a generated scene (forest, woods, leaves, cutouts, lamps, island).
    #[arg(long)]
    pub(super) scene: Option<String>,
    /// Prints JSON.
    #[arg(long, requires = "scene")]
    json: bool,
    /// Width of the picture that is rendered to know, pixels.
    #[arg(long, default_value_t = 16, requires = "scene", value_parser = clap::value_parser!(u32).range(1..=4096))]
    width: u32,
    /// Samples per pixel of that picture.
    #[arg(long, default_value_t = 1, requires = "scene", value_parser = clap::value_parser!(u32).range(1..=65_536))]
    samples: u32,
    /// Indirect bounces.
    #[arg(long, default_value_t = 5, requires = "scene", value_parser = clap::value_parser!(u32).range(0..=1024))]
    bounces: u32,
    /// Camera of a USD file; without, the one that usdrecord takes.
    #[arg(long, requires = "scene")]
    camera: Option<String>,
    /// How large a generated scene is.
    #[arg(long, default_value_t = 1, requires = "scene")]
    scale: u32,
    /// The host's usdrecord; without, the one in the path.
    #[arg(long, env = "OOCPT_USDRECORD", requires = "scene")]
    usdrecord: Option<OsString>,
    /// Seconds after which a host is ended.
    #[arg(long, default_value_t = 600, requires = "scene")]
    timeout: u64,
    /// Does not render with everything carried to compare.
    #[arg(long, requires = "scene")]
    alone: bool,
}

/// One build of the passes with its memory.
#[derive(Clone, Debug, Serialize)]
pub(super) struct PassBuild {
    pub(super) inventory: RenderInventory,
    pub(super) pipelines: usize,
    pub(super) bytes: u64,
    /// Seconds for compiling all pipelines, one after the other, when they were first needed.
    pub(super) compile_secs: f64,
    /// Seconds of tracing the small picture on the device.
    pub(super) trace_secs: f64,
}

impl PassBuild {
    fn new(inventory: RenderInventory, trace_secs: f64) -> Self {
        Self {
            pipelines: inventory.pipelines(),
            bytes: inventory.bytes(),
            compile_secs: inventory.passes.iter().map(|pass| pass.compile_secs).sum(),
            trace_secs,
            inventory,
        }
    }
}

/// The report about a scene.
#[derive(Clone, Debug, Serialize)]
pub(super) struct SceneReport {
    pub(super) scene: String,
    /// The renderer of the scene: "generated", or "host".
    pub(super) by: &'static str,
    pub(super) device: String,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) own: PassBuild,
    /// The build with every feature that can be carried.
    pub(super) everything: Option<PassBuild>,
    /// The warnings of the host: bad data by prim, missing files.
    pub(super) warnings: Vec<String>,
}

/// Prints the report of a scene.
pub(super) fn run(name: &str, options: &SceneCheckOptions, device: &str) -> Result<()> {
    let report = match GeneratedScene::named(name).filter(|_| !Path::new(name).is_file()) {
        Some(scene) => of_generated(scene, options, device)?,
        None => of_file(name, options, device)?,
    };
    match options.json {
        true => println!("{}", serde_json::to_string_pretty(&report)?),
        false => print!("{}", table::text(&report)),
    }
    Ok(())
}

fn of_file(name: &str, options: &SceneCheckOptions, device: &str) -> Result<SceneReport> {
    let usdrecord = crate::host::usdrecord(options.usdrecord.as_ref());
    let mut first = None;
    let mut ask = |carry: &str| -> Result<PassBuild> {
        let HostAnswer { report, warnings } = host::ask(&HostQuery {
            file: Path::new(name),
            usdrecord: &usdrecord,
            camera: options.camera.as_deref(),
            width: options.width,
            samples: options.samples,
            bounces: options.bounces,
            device,
            carry,
            timeout: Duration::from_secs(options.timeout),
        })?;
        let secs = report.rows.last().map_or(0.0, |row| row.seconds_tracing);
        let inventory = report.inventory.context("the host's OocPT is older than this program: no inventory came")?;
        first.get_or_insert((report.header, warnings));
        Ok(PassBuild::new(inventory, secs))
    };
    let own = ask("")?;
    let everything = (!options.alone).then(|| ask(EVERYTHING)).transpose()?;
    let Some((header, warnings)) = first else { bail!("the host said nothing") };
    let (device, width, height) = (header.device, header.width, header.height);
    Ok(SceneReport { scene: name.to_owned(), by: "host", device, width, height, own, everything, warnings })
}

fn of_generated(scene: GeneratedScene, options: &SceneCheckOptions, device: &str) -> Result<SceneReport> {
    let (width, height) = (options.width, (options.width * 9 / 16).max(1));
    let mut named = String::new();
    let mut render = |carry: &str, images: bool| -> Result<PassBuild> {
        let settings = Settings {
            samples_per_pixel: options.samples,
            max_bounces: options.bounces,
            device: device.to_owned(),
            carry: carry.to_owned(),
            interactive: false,
            ..Settings::default()
        };
        let session =
            Session::with_options(settings, SessionOptions::default()).with_images(Arc::new(GeneratedPictures));
        session.with_scene(|db| scene.build(db, options.scale))?;
        let color = vec![AovRequest { kind: AovKind::Color, clear: [0.0; 4] }];
        let aovs = if images { all_images() } else { color };
        session.render(RenderRequest { width, height, camera: scene.camera(options.scale, width, height), aovs });
        finish(&session)?;
        named = session.device_report().map(|report| report.name).unwrap_or_default();
        Ok(PassBuild::new(session.stats().inventory, session.timings().trace_secs))
    };
    let own = render("", false)?;
    let everything = (!options.alone).then(|| render(EVERYTHING, true)).transpose()?;
    let scene = scene.name().to_owned();
    Ok(SceneReport { scene, by: "generated", device: named, width, height, own, everything, warnings: Vec::new() })
}
