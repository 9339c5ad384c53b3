// SPDX-License-Identifier: Apache-2.0
//! `oocpt report plot`: see [`error_plot`]. `oocpt report picture`: see [`picture`]. `oocpt report html`: see
//! [`page`]. `oocpt report chunks`: draws the report that `oocpt:chunkReport` wrote.
//!
//! `loads.png` and `rays.png` show the boxes of all chunk instances from the render's camera, coloured by the chunk's
//! loads and by the rays that visited it, on a logarithmic scale; grey is zero. `progress.txt` lists the number of
//! unfinished paths over time.

mod boxes;
mod chart;
mod error_plot;
mod letters;
mod page;
mod paint;
mod picture;

use anyhow::{Context, Result, bail};
use clap::Subcommand;
use image::RgbImage;
use oocpt_render::chunk_report::{ChunkReport, ReportChunk};
use rayon::prelude::*;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use boxes::BoxHierarchy;

/// Share of a box's colour in a pixel seen through its faces.
const FACE: f64 = 0.45;
/// Share of a box's colour in a pixel of its edges.
const EDGE: f64 = 0.92;
/// Brightness of faces by axis: the light comes from above.
const SHADE: [f64; 3] = [0.74, 1.0, 0.86];
/// Longest side of a picture; a report may come from strangers.
const MAX_SIDE: u32 = 1 << 14;
/// Lines of the progress table.
const LINES: usize = 40;

/// Options of `oocpt report`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: ReportCommand,
}

#[derive(Subcommand)]
enum ReportCommand {
    /// Error against time of one or more renders, as SVG and PNG, and the times to errors of 1e-1, 1e-2, 1e-3.
    Plot(error_plot::Arguments),
    /// How a picture was made: the attributes of an EXR file of ours, or what a report says of its last render.
    Picture(picture::Arguments),
    /// One page about a render, or about several beside each other: error and memory over time, chunks, what was left
    /// out.
    Html(page::PageArguments),
    /// Pictures of the chunks by loads and by rays, and the table of time against paths left.
    Chunks {
        /// The file that the setting `oocpt:chunkReport` named.
        file: PathBuf,
        /// Folder for the pictures; made if it is not there.
        #[arg(long)]
        out: PathBuf,
    },
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let (file, out) = match &arguments.command {
        ReportCommand::Plot(arguments) => return error_plot::run(arguments),
        ReportCommand::Picture(arguments) => return picture::run(arguments),
        ReportCommand::Html(arguments) => return page::run(arguments),
        ReportCommand::Chunks { file, out } => (file, out),
    };
    let report = ChunkReport::read(file)?;
    if report.width.max(report.height) > MAX_SIDE {
        bail!("{}: a picture of {} x {} pixels", file.display(), report.width, report.height);
    }
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    save(&draw(&report, "loads", |chunk| chunk.loads)?, &out.join("loads.png"))?;
    save(&draw(&report, "rays", |chunk| chunk.rays)?, &out.join("rays.png"))?;
    let text = format!("{}\n{}", summary(&report), progress(&report));
    let path = out.join("progress.txt");
    std::fs::write(&path, &text).with_context(|| format!("cannot write {}", path.display()))?;
    print!("{text}");
    Ok(())
}

fn save(image: &RgbImage, path: &Path) -> Result<()> {
    image.save(path).with_context(|| format!("cannot write {}", path.display()))?;
    println!("{}", path.display());
    Ok(())
}

/// The boxes from the camera, coloured by `value` of their chunks, with a legend below.
fn draw(report: &ChunkReport, title: &str, value: fn(&ReportChunk) -> u64) -> Result<RgbImage> {
    let max = report.chunks.iter().map(value).max().unwrap_or(0);
    let colors: Vec<[f64; 3]> = report
        .instances
        .iter()
        .map(|i| paint::color(report.chunks.get(i.chunk as usize).map_or(0, value), max))
        .collect();
    let boxes = BoxHierarchy::new(report);
    let (width, height) = (report.width.max(1), report.height.max(1));
    let mut image = RgbImage::new(width, height + paint::LEGEND);
    let rows: Vec<Vec<[f64; 3]>> = (0..height)
        .into_par_iter()
        .map(|y| {
            // Row 0 of a picture is its top; pixels of the camera count from the bottom.
            let up = f64::from(height - 1 - y) + 0.5;
            (0..width).map(|x| blend(&boxes, &colors, f64::from(x) + 0.5, up)).collect()
        })
        .collect();
    for (y, row) in (0..).zip(&rows) {
        for (x, color) in (0..).zip(row) {
            image.put_pixel(x, y, paint::pixel(*color));
        }
    }
    paint::legend(&mut image, title, max)?;
    Ok(image)
}

/// The colour of a pixel: the nearest boxes blended over each other.
fn blend(boxes: &BoxHierarchy, colors: &[[f64; 3]], x: f64, y: f64) -> [f64; 3] {
    let entries = boxes.enter(x, y);
    entries.iter().rev().fold(paint::BACKGROUND, |behind, entry| {
        let color = colors.get(entry.instance as usize).copied().unwrap_or(paint::NEVER);
        let shaded = color.map(|c| c * SHADE[entry.axis]);
        match entry.is_edge {
            // Edges are lighter, so that boxes of one colour can be told apart.
            true => paint::mix(behind, paint::mix(color, [1.0; 3], 0.25), EDGE),
            // Boxes that fill the picture are faint, or nothing else would be seen.
            false => paint::mix(behind, shaded, FACE * (0.5 / entry.size).powi(2).min(1.0)),
        }
    })
}

/// One paragraph about the chunks.
fn summary(report: &ChunkReport) -> String {
    let chunks = &report.chunks;
    let sum = |value: fn(&ReportChunk) -> u64| chunks.iter().map(value).fold(0_u64, u64::saturating_add);
    let never = chunks.iter().filter(|chunk| chunk.loads == 0).count();
    let resident = chunks.iter().filter(|chunk| chunk.is_resident).count();
    let mut text = format!(
        "{} chunks of {} MiB (what they share counted for each), {} chunk instances; {never} never loaded, {resident} \
        resident \
         at the end\n",
        chunks.len(),
        sum(|chunk| chunk.bytes) >> 20,
        report.instances.len(),
    );
    let most = |value: fn(&ReportChunk) -> u64| chunks.iter().max_by_key(|chunk| value(chunk));
    for (name, chunk) in [("most loaded", most(|chunk| chunk.loads)), ("most visited", most(|chunk| chunk.rays))] {
        if let Some(chunk) = chunk {
            let ReportChunk { loads, reloads, rays, bytes, .. } = chunk;
            // Writing to a string cannot fail.
            _ = writeln!(text, "{name}: {loads} loads ({reloads} of them again), {rays} rays, {bytes} bytes");
        }
    }
    let (loads, rays) = (sum(|chunk| chunk.loads), sum(|chunk| chunk.rays));
    _ = writeln!(text, "all: {loads} loads, {} of them again, {rays} rays", sum(|chunk| chunk.reloads));
    text
}

/// The table of time against paths left, thinned to few lines with every tenfold drop among them.
fn progress(report: &ChunkReport) -> String {
    let moments = &report.progress;
    let mut text = format!("{:>12} {:>16} {:>9}\n", "seconds", "paths left", "left");
    let total = moments.iter().map(|moment| moment.paths_left).max().unwrap_or(0).max(1);
    let step = moments.len().div_ceil(LINES).max(1);
    let mut next = total;
    for (k, moment) in moments.iter().enumerate() {
        let drops = moment.paths_left <= next / 10;
        if k % step == 0 || drops || k + 1 == moments.len() {
            #[expect(clippy::cast_precision_loss, reason = "a share")]
            let share = 100.0 * moment.paths_left as f64 / total as f64;
            _ = writeln!(text, "{:>12.3} {:>16} {share:>8.4}%", moment.seconds, moment.paths_left);
        }
        if drops {
            next = moment.paths_left;
        }
    }
    text
}

#[cfg(test)]
mod tests;
