// SPDX-License-Identifier: Apache-2.0
//! `oocpt doctor --scene S`: what a scene needs of the renderer and what was left out for it.
//!
//! A Hydra host renders the file ([`super::host`]), so that what is told is what a host's renders are made of. Bytes
//! and pipelines are exact for a picture of this size; for times, and for what leaving out saves, see `oocpt bench
//! specialise`.

use super::host::{self, HostQuery};
use super::needs::SceneNeeds;
use super::table;
use anyhow::Result;
use std::ffi::OsString;
use std::path::Path;
use std::time::Duration;

/// Options that go with `--scene`.
#[derive(clap::Args)]
pub(crate) struct SceneCheckOptions {
    /// Tells what the scene of this USD file needs.
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
    /// Camera; without, the one that usdrecord takes.
    #[arg(long, requires = "scene")]
    camera: Option<String>,
    /// The host's usdrecord; without, the one in the path.
    #[arg(long, env = "OOCPT_USDRECORD", requires = "scene")]
    usdrecord: Option<OsString>,
    /// Seconds after which a host is ended.
    #[arg(long, default_value_t = 600, requires = "scene")]
    timeout: u64,
}

/// Prints what the scene of a file needs.
pub(super) fn run(name: &str, options: &SceneCheckOptions, device: &str) -> Result<()> {
    let usdrecord = oocpt_command::host::usdrecord(options.usdrecord.as_ref());
    let answer = host::ask(&HostQuery {
        file: Path::new(name),
        usdrecord: &usdrecord,
        camera: options.camera.as_deref(),
        width: options.width,
        samples: options.samples,
        bounces: options.bounces,
        device,
        timeout: Duration::from_secs(options.timeout),
    })?;
    let needs = SceneNeeds::new(name, answer)?;
    match options.json {
        true => println!("{}", serde_json::to_string_pretty(&needs)?),
        false => print!("{}", table::text(&needs)),
    }
    Ok(())
}
