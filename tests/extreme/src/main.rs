// SPDX-License-Identifier: Apache-2.0
//! `oocpt-extreme`: runs the stiff and extreme cases on this machine's device and prints the table.
#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a command line program")]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use oocpt_extreme::{Options, Table, run};

#[derive(Parser)]
#[command(name = "oocpt-extreme", about = "Stiff and extreme cases through the renderer, against closed forms and f64")]
struct Arguments {
    /// Device by index or part of its name
    #[arg(long, env = "OOCPT_TEST_DEVICE", default_value = "")]
    device: String,
    /// As many rays as the cases are meant to have (a GPU: minutes)
    #[arg(long)]
    full: bool,
    /// Turn Vulkan's validation layer on
    #[arg(long)]
    validation: bool,
    /// Only cases whose name contains this
    #[arg(long)]
    filter: Option<String>,
    /// Write the table as JSON
    #[arg(long)]
    json: Option<PathBuf>,
    /// Compare with the table of another device, as JSON
    #[arg(long)]
    against: Option<PathBuf>,
    /// Run nothing: compare this table with the other
    #[arg(long, requires = "against")]
    read: Option<PathBuf>,
    /// What may differ between devices, relative
    #[arg(long, default_value_t = 1e-3)]
    tolerance: f64,
}

fn main() -> ExitCode {
    match perform(Arguments::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether every row is as it is known to be.
fn perform(arguments: Arguments) -> Result<bool, String> {
    let table = if let Some(path) = &arguments.read {
        read(path)?
    } else {
        let Arguments { device, full, validation, filter, .. } = arguments;
        run(&Options { device, validation, full, filter })
    };
    println!("{}", table.text());
    if let Some(path) = &arguments.json {
        let text = serde_json::to_string_pretty(&table).map_err(|error| error.to_string())?;
        std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))?;
    }
    if let Some(path) = &arguments.against {
        println!("{}", table.against(&read(path)?, arguments.tolerance));
    }
    Ok(table.unexpected().next().is_none())
}

fn read(path: &Path) -> Result<Table, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))
}
