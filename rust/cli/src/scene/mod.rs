// SPDX-License-Identifier: Apache-2.0
//! `oocpt scene`: writes a generated scene as USD.

mod usd;

use anyhow::Result;
use clap::Subcommand;
use oocpt_scenes::island;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Options of `oocpt scene`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: SceneCommand,
}

#[derive(Subcommand)]
enum SceneCommand {
    /// The island: a stand-in for Disney's Moana island.
    Island {
        #[command(flatten)]
        island: island::Parameters,
        /// The file to write: .usdc, .usda or .usd.
        #[arg(long)]
        out: PathBuf,
        /// A Python that imports usd-core and numpy, as `cargo xtask env` names it.
        #[arg(long, env = "OOCPT_USD_PYTHON", hide_env_values = true)]
        python: Option<OsString>,
        /// Has the scene ask every host that renders it for a report of error against time in this file
        /// (`oocpt:report`).
        #[arg(long)]
        report: Option<PathBuf>,
    },
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let SceneCommand::Island { island, out, python, report } = &arguments.command;
    let python = usd::python(python.as_deref().map(Path::new))?;
    let prims = island::Prims::new(island)?;
    usd::write(&prims, &island::stage_camera(island), report.as_deref(), python, out)?;
    println!("{}: {} instances, {} unique quads", out.display(), island.total_instances(), prims.quads);
    Ok(())
}
