// SPDX-License-Identifier: Apache-2.0
//! `oocpt`: looks at the machine (`doctor`), merges films (`film`), draws what the renderer reports (`report`), makes
//! scenes (`scene`), looks at materials (`material`), fills the cache of textures (`texture`), runs the program that
//! measures (`bench`).
#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "a command line program reports on standard output")]

mod bench;
mod doctor;
mod film;
mod material;
mod report;
mod scene;
#[cfg(test)]
mod script;
mod texture;

use anyhow::Result;
use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(name = "oocpt", version, about = "OocPT: an out-of-core path tracer for Hydra")]
struct Arguments {
    #[command(subcommand)]
    command: OocptCommand,
}

#[derive(Subcommand)]
enum OocptCommand {
    /// Lists devices, drivers and capabilities; says which device will be used and why.
    Doctor(doctor::Arguments),
    /// Measures the renderer: runs oocpt-bench, which is built from the clone and not shipped.
    Bench(bench::Arguments),
    /// Merges parts of films, makes pictures of them, and says what they are.
    Film(film::FilmArguments),
    /// Draws what a render wrote about itself.
    Report(report::Arguments),
    /// Writes a generated scene as USD.
    Scene(scene::Arguments),
    /// Says what became of the materials of a scene.
    Material(material::Arguments),
    /// Looks at texture files and fills the cache of decoded ones.
    Texture(texture::Arguments),
}

fn main() -> Result<()> {
    oocpt_command::main(|| run(Arguments::parse().command))
}

fn run(command: OocptCommand) -> Result<()> {
    match command {
        OocptCommand::Doctor(arguments) => doctor::run(&arguments),
        OocptCommand::Bench(arguments) => bench::run(&arguments),
        OocptCommand::Film(arguments) => film::run(&arguments),
        OocptCommand::Report(arguments) => report::run(&arguments),
        OocptCommand::Scene(arguments) => scene::run(&arguments),
        OocptCommand::Material(arguments) => material::run(&arguments),
        OocptCommand::Texture(arguments) => texture::run(&arguments),
    }
}
