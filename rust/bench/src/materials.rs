// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench materials`: what materials cost. A wall that fills the picture, one light, camera rays only: each path
//! meets the wall once, and nothing but its material differs from row to row. So the seconds that a row takes more than
//! the constant material, over the number of paths, are what its textures or its program cost for a hit.
//!
//! Sessions are rendered in turn, `--runs` times, after a render that is not counted: what slows the machine for a
//! while slows all rows. All paths of a wave have the same material, as on large surfaces; where materials are mixed,
//! programs of a subgroup run one after the other.

use anyhow::{Context, Result, bail};
use oocpt_core::material::MaterialText;
use oocpt_render::{Session, SessionOptions};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

use super::common::{self, Machine, PassRow, Reported, finish, median, print_passes, write_picture};
use oocpt_scenes::materials::{self, Pattern};
use oocpt_scenes::pictures::Pictures;

/// Options of `oocpt bench materials`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Image width, pixels.
    #[arg(long, default_value_t = 160)]
    width: u32,
    /// Image height, pixels.
    #[arg(long, default_value_t = 90)]
    height: u32,
    /// Samples per pixel.
    #[arg(long, default_value_t = 16)]
    samples: u32,
    /// Side of the textures, texels.
    #[arg(long, default_value_t = 512)]
    texture_size: u32,
    /// Counted runs of each material.
    #[arg(long, default_value_t = 5)]
    runs: u32,
    /// Also renders each material once more with timestamps, for the passes it spends its time in.
    #[arg(long)]
    profile: bool,
    #[command(flatten)]
    reported: Reported,
    /// Also write the picture of the last material to this file: PNG (sRGB) or EXR.
    #[arg(long)]
    picture: Option<PathBuf>,
}

/// One material.
#[derive(Debug, Serialize)]
struct Row {
    material: &'static str,
    nodes: usize,
    /// Of its program.
    instructions: usize,
    noises: usize,
    registers: usize,
    constants: usize,
    /// Texture lookups of a hit.
    lookups: usize,
    trace_secs: Vec<f64>,
    median_trace_secs: f64,
    paths: u64,
    paths_per_sec: f64,
    /// Over the constant material: the median of differences of runs made in turn.
    ns_per_hit: f64,
    /// The least and the greatest of these.
    ns_per_hit_range: [f64; 2],
    #[serde(skip_serializing_if = "Vec::is_empty")]
    passes: Vec<PassRow>,
}

#[derive(Debug, Serialize)]
struct Report {
    bench: &'static str,
    machine: Machine,
    width: u32,
    height: u32,
    samples: u32,
    texture_size: u32,
    rows: Vec<Row>,
}

/// A session that is rendered in turn with the others.
struct Subject {
    pattern: Pattern,
    text: MaterialText,
    session: Session,
    trace_secs: Vec<f64>,
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let Arguments { width, height, samples, texture_size, .. } = *arguments;
    let mut subjects: Vec<Subject> =
        Pattern::ALL.iter().map(|pattern| subject(arguments, *pattern)).collect::<Result<_>>()?;
    for _ in 0..arguments.runs.max(1) {
        for subject in &mut subjects {
            subject.session.restart();
            finish(&subject.session).context(subject.pattern.name())?;
            subject.trace_secs.push(subject.session.timings().trace_secs);
        }
    }
    println!("{width} x {height} px, {samples} samples, camera rays only, each meets the surface once");
    print_head();
    let base = subjects.first().map(|subject| subject.trace_secs.clone()).unwrap_or_default();
    let mut rows = Vec::new();
    for subject in &subjects {
        let row = row(arguments, subject, &base)?;
        print_row(&row);
        rows.push(row);
    }
    let last = subjects.last().map(|subject| &subject.session);
    let machine = arguments.reported.machine(last);
    println!("on {machine}");
    arguments.reported.write(&Report { bench: "materials", machine, width, height, samples, texture_size, rows })?;
    if let (Some(path), Some(session)) = (&arguments.picture, last) {
        write_picture(session, [width, height], path)?;
    }
    Ok(())
}

/// A session with its material, rendered once to warm up.
fn subject(arguments: &Arguments, pattern: Pattern) -> Result<Subject> {
    let settings = common::plain_settings(arguments.samples, 0, &arguments.reported.device);
    let session = Session::with_options(settings, SessionOptions::default()).with_images(Arc::new(Pictures));
    let text = session.with_scene(|db| materials::build(db, pattern, arguments.texture_size))?;
    let [width, height] = [arguments.width, arguments.height];
    session.render(common::color_request(width, height, materials::camera(width, height)));
    finish(&session).with_context(|| format!("warm-up of {}", pattern.name()))?;
    Ok(Subject { pattern, text, session, trace_secs: Vec::new() })
}

fn row(arguments: &Arguments, subject: &Subject, base: &[f64]) -> Result<Row> {
    let Subject { pattern, text, session, trace_secs } = subject;
    let timings = session.timings();
    if timings.paths == 0 {
        bail!("{}: no path was traced", pattern.name());
    }
    #[expect(clippy::cast_precision_loss, reason = "counts are shown as rates")]
    let paths = timings.paths as f64;
    let differences = above(trace_secs, base, paths);
    let median_trace_secs = median(trace_secs.clone());
    Ok(Row {
        material: pattern.name(),
        nodes: text.nodes.len(),
        instructions: text.program.instructions.len(),
        noises: text.program.noises,
        registers: text.program.registers,
        constants: text.program.constants,
        lookups: text.lookups,
        trace_secs: trace_secs.clone(),
        median_trace_secs,
        paths: timings.paths,
        paths_per_sec: paths / median_trace_secs,
        ns_per_hit: median(differences.clone()),
        ns_per_hit_range: differences
            .iter()
            .fold([f64::MAX, f64::MIN], |[low, high], ns| [low.min(*ns), high.max(*ns)]),
        passes: if arguments.profile { common::profile(session)? } else { Vec::new() },
    })
}

/// Nanoseconds a path over the constant material, by runs.
fn above(secs: &[f64], base: &[f64], paths: f64) -> Vec<f64> {
    secs.iter().zip(base).map(|(secs, base)| (secs - base) / paths * 1e9).collect()
}

fn print_head() {
    println!(
        "{:<10}{:>6}{:>13}{:>7}{:>10}{:>8}{:>10}{:>12}{:>12}{:>22}",
        "material",
        "nodes",
        "instructions",
        "noises",
        "registers",
        "lookups",
        "trace s",
        "Mpaths/s",
        "ns a hit",
        "least, greatest"
    );
}

fn print_row(row: &Row) {
    let [low, high] = row.ns_per_hit_range;
    println!(
        "{:<10}{:>6}{:>13}{:>7}{:>10}{:>8}{:>10.4}{:>12.3}{:>12.3}{:>22}",
        row.material,
        row.nodes,
        row.instructions,
        row.noises,
        row.registers,
        row.lookups,
        row.median_trace_secs,
        row.paths_per_sec * 1e-6,
        row.ns_per_hit,
        format!("{low:.3}, {high:.3}")
    );
    print_passes(&row.passes);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cost_per_hit_is_the_difference_of_interleaved_runs() {
        // The machine is slower in the second run: of all rows.
        let [base, program] = [[1.0, 3.0, 1.0], [1.5, 3.5, 1.75]];
        assert_eq!(above(&base, &base, 1e6), [0.0; 3]);
        let ns = above(&program, &base, 1e6);
        let known = [500.0, 500.0, 750.0];
        assert!(ns.iter().zip(known).all(|(ns, known)| (ns - known).abs() < 1e-6), "{ns:?}");
        assert!((median(ns) - 500.0).abs() < 1e-6, "the middle one");
    }
}
