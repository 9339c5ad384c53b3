// SPDX-License-Identifier: Apache-2.0
//! `oocpt-bench`, which `oocpt bench` runs: speed is measured here and only here; tests never time.
#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "a command line program reports on standard output")]

mod budgets;
mod common;
mod curves;
mod edits;
mod forest;
mod island;
mod leaves;
mod live;
mod materials;
mod memory;
mod moving;
mod observe;
mod partition;
mod specialise;
mod stragglers;
mod texture_files;
mod textures;
mod view;

use anyhow::Result;
use clap::{Parser, Subcommand};
use oocpt_scenes::{island as island_scene, woods};

/// Options of `oocpt bench`; without a subcommand they are those of `bench forest`.
#[derive(Parser)]
#[command(
    name = "oocpt-bench",
    bin_name = "oocpt bench",
    version,
    about = "Measures the renderer on generated scenes; prints tables and JSON"
)]
#[command(args_conflicts_with_subcommands = true)]
struct Arguments {
    #[command(subcommand)]
    command: Option<BenchCommand>,
    #[command(flatten)]
    forest: forest::Arguments,
}

#[derive(Subcommand)]
enum BenchCommand {
    /// The forest: 16 meshes, a terrain, everything in core.
    Forest(forest::Arguments),
    /// The island in core and under shrinking geometry budgets; the pictures have to be the same bits.
    Island(island::Arguments),
    /// The island with ever less device memory in all, cold and warm; the pictures have to be the same bits.
    Memory(memory::Arguments<island_scene::IslandParameters>),
    /// The woods with ever less device memory in all: geometry, textures, paths, film.
    WoodsMemory(memory::Arguments<woods::WoodsParameters>),
    /// The island under small geometry budgets without and with roulette on loads: time, error, how the paths run out.
    Stragglers(stragglers::Arguments),
    /// A textured forest in core and under budgets that its geometry and its textures each exceed; the same bits.
    Textures(textures::Arguments),
    /// Texture files of real size through a real usdrecord, with an empty and a filled texture cache, beside their
    /// decoding.
    TextureFiles(Box<texture_files::Arguments>),
    /// Instanced leaves: opaque, with an opacity picture that is opaque all over, and cut out.
    Leaves(leaves::Arguments),
    /// Materials of constants, textures and programs on the same wall: what a program costs for each hit.
    Materials(materials::Arguments),
    /// Hair, points and a limit surface: rays a second, memory for each.
    Curves(curves::Arguments),
    /// What leaving out saves: scenes by passes made for them and by passes that carry everything; the same bits.
    Specialise(specialise::Arguments),
    /// Commits flattened islands: instances a second, host bytes an instance.
    Partition(partition::Arguments),
    /// Moves instances in a live session: seconds to the next image, bytes sent again.
    Edits(edits::Arguments),
    /// An animation of instances in a live session: frames a second, what is made anew.
    Moving(moving::Arguments),
}

fn main() -> Result<()> {
    oocpt_command::main(|| run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<()> {
    match &arguments.command {
        None => forest::run(&arguments.forest),
        Some(BenchCommand::Forest(arguments)) => forest::run(arguments),
        Some(BenchCommand::Island(arguments)) => island::run(arguments),
        Some(BenchCommand::Memory(arguments)) => memory::run(arguments),
        Some(BenchCommand::WoodsMemory(arguments)) => memory::run(arguments),
        Some(BenchCommand::Stragglers(arguments)) => stragglers::run(arguments),
        Some(BenchCommand::Textures(arguments)) => textures::run(arguments),
        Some(BenchCommand::TextureFiles(arguments)) => texture_files::run(arguments),
        Some(BenchCommand::Leaves(arguments)) => leaves::run(arguments),
        Some(BenchCommand::Materials(arguments)) => materials::run(arguments),
        Some(BenchCommand::Curves(arguments)) => curves::run(arguments),
        Some(BenchCommand::Specialise(arguments)) => specialise::run(arguments),
        Some(BenchCommand::Partition(arguments)) => partition::run(arguments),
        Some(BenchCommand::Edits(arguments)) => edits::run(arguments),
        Some(BenchCommand::Moving(arguments)) => moving::run(arguments),
    }
}
