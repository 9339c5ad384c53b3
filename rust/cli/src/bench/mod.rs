// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench`: speed is measured here and only here; tests never time.

mod common;
mod forest;
mod partition;

use anyhow::Result;
use clap::Subcommand;

/// Options of `oocpt bench`; without a subcommand they are those of `bench forest`.
#[derive(clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    forest: forest::Arguments,
}

#[derive(Subcommand)]
enum Command {
    /// The forest: 16 meshes, a terrain, everything in core.
    Forest(forest::Arguments),
    /// Commits flattened islands: instances a second, host bytes an instance.
    Partition(partition::Arguments),
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    match &arguments.command {
        None => forest::run(&arguments.forest),
        Some(Command::Forest(arguments)) => forest::run(arguments),
        Some(Command::Partition(arguments)) => partition::run(arguments),
    }
}
