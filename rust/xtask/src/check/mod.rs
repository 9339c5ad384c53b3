// SPDX-License-Identifier: Apache-2.0
//! Everything that can be judged without running the product. Shaders are compiled and validated by the build of
//! `oocpt-shaders`, which clippy drives.

mod columns;
mod graph;
mod modules;
mod text;
mod types;

use std::process::Command;
use std::time::Instant;

use anyhow::{Result, bail};

use crate::book;
use crate::clone_files::tracked_files;
use crate::places::RootFolders;
use crate::process::{run, say};
use crate::product::{PROFILE, cargo};
use crate::system::CLANG_FORMAT;

/// What a step costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum CheckDepth {
    /// Reads files: seconds.
    Text,
    /// Compiles the workspace: minutes.
    Compiled,
}

/// A named judgement.
type CheckStep = (CheckDepth, &'static str, fn(&RootFolders) -> Result<()>);

const STEPS: &[CheckStep] = &[
    (CheckDepth::Text, "words", text::check),
    (CheckDepth::Text, "columns", columns::check),
    (CheckDepth::Text, "modules", modules::check),
    (CheckDepth::Text, "names of types", types::check),
    (CheckDepth::Text, "documents", book::check),
    (CheckDepth::Text, "crate graph", graph::check),
    (CheckDepth::Text, "no faults in the product", graph::product),
    (CheckDepth::Text, "rustfmt", rustfmt),
    (CheckDepth::Text, "clang-format", clang_format),
    (CheckDepth::Compiled, "clippy and shaders", clippy),
    (CheckDepth::Compiled, "documentation", documentation),
];

/// Runs every step up to `depth`, even after a failure, and then fails if any did.
///
/// # Errors
/// Names the steps that failed; their findings are on stderr.
pub(crate) fn run_all(places: &RootFolders, depth: CheckDepth) -> Result<()> {
    let mut failed = Vec::new();
    for (_, name, step) in STEPS.iter().filter(|(needed, ..)| *needed <= depth) {
        say(format_args!("check: {name}"));
        let started = Instant::now();
        let judged = step(places);
        say(format_args!("check: {name} took {} s", started.elapsed().as_secs()));
        if let Err(error) = judged {
            say(format_args!("check: {name} FAILED: {error:#}"));
            failed.push(*name);
        }
    }
    if !failed.is_empty() {
        bail!("check failed: {}", failed.join(", "));
    }
    say("all checks passed");
    Ok(())
}

fn rustfmt(places: &RootFolders) -> Result<()> {
    run(cargo(places, "fmt").args(["--all", "--check"]))
}

/// In the profile of the tests, so that they find build scripts, procedural macros and shaders ready. The product is
/// the same code without what tests turn on; rustc's warnings about that count when it is built
/// (`product::build_workspace`).
fn clippy(places: &RootFolders) -> Result<()> {
    let mut clippy = cargo(places, "clippy");
    run(clippy.args(["--quiet", "--workspace", "--all-targets", "--profile", PROFILE, "--", "-D", "warnings"]))
}

fn documentation(places: &RootFolders) -> Result<()> {
    let mut doc = cargo(places, "doc");
    run(doc.env("RUSTDOCFLAGS", "-Dwarnings").args([
        "--quiet",
        "--workspace",
        "--no-deps",
        "--document-private-items",
        "--profile",
        PROFILE,
    ]))
}

fn clang_format(places: &RootFolders) -> Result<()> {
    let files: Vec<String> = tracked_files(places)?.into_iter().filter(|file| is_cpp(file)).collect();
    if files.is_empty() {
        return Ok(());
    }
    run(Command::new(CLANG_FORMAT).current_dir(&places.repo).args(["--dry-run", "-Werror", "--style=file"]).args(files))
}

fn is_cpp(file: &str) -> bool {
    let extension = file.rsplit_once('.').map(|(_, extension)| extension);
    file.starts_with("cpp/") && matches!(extension, Some("h" | "cpp"))
}
