// SPDX-License-Identifier: Apache-2.0
//! What all benches do: wait for renders, take medians, name the machine, write reports and pictures.

use anyhow::{Context, Result, bail, ensure};
use oocpt_core::camera::Camera;
use oocpt_core::settings::{HostMapped, Settings, TraversalKind};
use oocpt_core::stats::RenderStats;
use oocpt_render::{AovKind, AovRequest, RenderRequest, RenderTimings, Session, Severity};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Longest wait for one render.
const TIMEOUT: Duration = Duration::from_secs(3 * 3600);

/// Options of every bench that writes a report: its device, and where the report goes.
#[derive(clap::Args)]
pub(crate) struct ReportOptions {
    /// Device: an index or a part of its name.
    #[arg(long, env = "OOCPT_DEVICE", default_value = "")]
    pub(crate) device: String,
    /// Date to put into the report.
    #[arg(long)]
    pub(crate) date: Option<String>,
    /// Also write the report as JSON to this file.
    #[arg(long)]
    pub(crate) json: Option<PathBuf>,
}

impl ReportOptions {
    /// The machine that `session` rendered on.
    pub(crate) fn machine(&self, session: Option<&Session>) -> BenchMachine {
        BenchMachine::new(session, self.date.as_deref())
    }

    /// Writes the report to its file, or prints it.
    pub(crate) fn write(&self, report: &impl Serialize) -> Result<()> {
        write_json(report, self.json.as_deref())
    }
}

/// The machine and program that a report is of.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct BenchMachine {
    version: &'static str,
    /// Empty when nothing was rendered.
    device: String,
    driver: String,
    cores: usize,
    /// As the caller says.
    #[serde(skip_serializing_if = "Option::is_none")]
    date: Option<String>,
}

impl BenchMachine {
    /// The device is the one that `session` rendered with.
    pub(crate) fn new(session: Option<&Session>, date: Option<&str>) -> Self {
        let device = session.and_then(Session::device_report);
        Self {
            version: env!("CARGO_PKG_VERSION"),
            device: device.as_ref().map(|d| d.name.clone()).unwrap_or_default(),
            driver: device.map(|d| d.driver).unwrap_or_default(),
            cores: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            date: date.map(str::to_owned),
        }
    }
}

impl BenchMachine {
    /// The device that another process rendered with.
    pub(crate) fn set_device(&mut self, device: &str) {
        device.clone_into(&mut self.device);
    }
}

impl std::fmt::Display for BenchMachine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { version, device, driver, cores, date } = self;
        write!(f, "OocPT {version}, {cores} cores")?;
        if !device.is_empty() {
            write!(f, ", {device}")?;
        }
        if !driver.is_empty() {
            write!(f, " ({driver})")?;
        }
        date.as_ref().map_or(Ok(()), |date| write!(f, ", {date}"))
    }
}

/// Settings of a render that shows its last picture only.
pub(crate) fn plain_settings(samples: u32, bounces: u32, device: &str) -> Settings {
    Settings {
        samples_per_pixel: samples,
        max_bounces: bounces,
        device: device.to_owned(),
        devices: said("oocpt:devices", |names| Some(names.to_owned())),
        interactive: false,
        traversal: said("oocpt:traversal", TraversalKind::named),
        host_mapped: said("oocpt:hostMappedGeometry", HostMapped::named),
        filter_aovs: said("oocpt:filterAovs", |name| name.parse().ok().map(Some)).unwrap_or(true),
        ..Settings::default()
    }
}

/// What the variable of a setting says, or its default.
fn said<T: Default>(key: &str, named: impl Fn(&str) -> Option<T>) -> T {
    let text = Settings::env_name(key).and_then(|name| std::env::var(name).ok());
    text.and_then(|text| named(text.trim())).unwrap_or_default()
}

/// A request for the colour alone.
pub(crate) fn color_request(width: u32, height: u32, camera: Camera) -> RenderRequest {
    RenderRequest { width, height, camera, aovs: only_color(), window: None }
}

/// Bytes of memory that this process holds now (Linux; 0 elsewhere).
pub(crate) fn resident_bytes() -> u64 {
    // Fields of statm are in pages of 4 KiB on the machines we know.
    let pages = std::fs::read_to_string("/proc/self/statm")
        .ok()
        .and_then(|text| text.split_whitespace().nth(1).and_then(|field| field.parse::<u64>().ok()));
    pages.unwrap_or(0) * 4096
}

/// Lets the peak of this process's memory begin anew: [`oocpt_render::host_peak_bytes`] is that since the last call.
/// Linux (proc(5), `clear_refs`); elsewhere, and where it is not allowed, the peak stays that of the process.
pub(crate) fn reset_peak() {
    if let Err(error) = std::fs::write("/proc/self/clear_refs", "5") {
        tracing::warn!(%error, "host memory: peaks are those of the process so far");
    }
}

/// Writes a report to `path`, or prints it.
pub(crate) fn write_json(report: &impl Serialize, path: Option<&Path>) -> Result<()> {
    let json = serde_json::to_string_pretty(report)?;
    match path {
        Some(path) => std::fs::write(path, json).with_context(|| format!("cannot write {}", path.display())),
        None => {
            println!("{json}");
            Ok(())
        }
    }
}

/// Waits for the render; prints its warnings, fails with its first error.
pub(crate) fn finish(session: &Session) -> Result<()> {
    let converged = session.wait_converged(TIMEOUT);
    for message in session.take_messages() {
        if message.severity == Severity::Error {
            bail!(message.text);
        }
        println!("warning: {}", message.text);
    }
    if !converged {
        bail!("the render did not finish within {} s", TIMEOUT.as_secs());
    }
    Ok(())
}

/// Several runs of one render.
pub(crate) struct RenderRuns {
    pub(crate) trace_secs: Vec<f64>,
    /// Of the run with the median time.
    pub(crate) timings: RenderTimings,
    pub(crate) stats: RenderStats,
    /// The most that a run's picture had.
    pub(crate) different_pixels: u64,
}

/// Measures a render of `size` that was asked for already: it is waited for and not counted, unless `is_cold`, then
/// `count` runs are. Each picture is compared with `reference`; if that is empty, the first one becomes it.
pub(crate) fn measure(
    session: &Session,
    size: [u32; 2],
    count: u32,
    is_cold: bool,
    reference: &mut Vec<u8>,
) -> Result<RenderRuns> {
    finish(session).context("warm-up render")?;
    let mut runs: Vec<(RenderTimings, RenderStats)> = Vec::new();
    let mut different_pixels = 0;
    for run in 0..count.max(1) {
        if run > 0 || !is_cold {
            session.restart();
        }
        finish(session)?;
        different_pixels = different_pixels.max(compare(session, size, reference)?);
        runs.push((session.timings(), session.stats()));
    }
    let trace_secs = runs.iter().map(|(timings, _)| timings.trace_secs).collect();
    runs.sort_by(|a, b| a.0.trace_secs.total_cmp(&b.0.trace_secs));
    let (timings, stats) = runs.swap_remove(runs.len() / 2);
    Ok(RenderRuns { trace_secs, timings, stats, different_pixels })
}

/// One pass of a profiled run.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct PassRow {
    pub(crate) name: String,
    pub(crate) secs: f64,
    /// Of all passes.
    pub(crate) share: f64,
    pub(crate) runs: u64,
}

/// The passes of the last, profiled run.
pub(crate) fn passes_of(timings: &RenderTimings) -> Vec<PassRow> {
    let total: f64 = timings.passes.iter().map(|pass| pass.secs).sum();
    let row = |pass: &oocpt_render::PassTime| PassRow {
        name: pass.name.clone(),
        secs: pass.secs,
        share: pass.secs / total,
        runs: pass.runs,
    };
    timings.passes.iter().map(row).collect()
}

/// Renders once more with timestamps, which cost a little.
pub(crate) fn profile(session: &Session) -> Result<Vec<PassRow>> {
    session.set_profiling(true);
    session.restart();
    let done = finish(session).context("profiled render");
    session.set_profiling(false);
    done?;
    Ok(passes_of(&session.timings()))
}

/// A table of passes; nothing for none.
pub(crate) fn print_passes(passes: &[PassRow]) {
    if !passes.is_empty() {
        println!("{:<24}{:>10}{:>8}{:>10}", "pass", "GPU s", "share", "runs");
    }
    for pass in passes {
        println!("{:<24}{:>10.4}{:>7.1}%{:>10}", pass.name, pass.secs, pass.share * 100.0, pass.runs);
    }
}

/// Pixels in which the picture of `session` differs from `reference`; if that is empty, the picture becomes it.
pub(crate) fn compare(session: &Session, size: [u32; 2], reference: &mut Vec<u8>) -> Result<u64> {
    let mut picture = vec![0_u8; size[0] as usize * size[1] as usize * 16];
    ensure!(session.read_aov(AovKind::Color, &mut picture), "there is no picture");
    if reference.is_empty() {
        *reference = picture;
        return Ok(0);
    }
    Ok(different(reference, &picture))
}

/// Pixels that differ in any bit.
fn different(a: &[u8], b: &[u8]) -> u64 {
    a.chunks(16).zip(b.chunks(16)).filter(|(a, b)| a != b).count() as u64
}

/// The middle value; of an even count, the upper one of the two.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// A request's list of images: colour alone.
pub(crate) fn only_color() -> Vec<AovRequest> {
    vec![AovRequest { kind: AovKind::Color, clear: [0.0; 4] }]
}

/// All images there are.
pub(crate) fn all_images() -> Vec<AovRequest> {
    let others = [AovKind::Denoised, AovKind::LoadWaits];
    let own = AovKind::ALL.into_iter().filter(|kind| !others.contains(kind) && !kind.ranks_ids());
    own.map(|kind| AovRequest { kind, clear: [0.0; 4] }).collect()
}

/// Writes the colour image: linear floats with attributes that tell how it was made where the name ends in `.exr`, else
/// 8-bit sRGB.
pub(crate) fn write_picture(session: &Session, size: [u32; 2], path: &Path) -> Result<()> {
    let [width, height] = size.map(|side| side as usize);
    let mut pixels = vec![0_f32; width * height * 4];
    if !session.read_aov(AovKind::Color, bytemuck::cast_slice_mut(&mut pixels)) {
        bail!("there is no image to write");
    }
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr")) {
        return Ok(oocpt_render::picture::write(path, size, &pixels, &session.picture_attributes())?);
    }
    let mut image = image::RgbImage::new(size[0], size[1]);
    for (x, y, out) in image.enumerate_pixels_mut() {
        let start = ((height - 1 - y as usize) * width + x as usize) * 4;
        for (channel, value) in out.0.iter_mut().zip(&pixels[start..start + 3]) {
            *channel = srgb8(*value);
        }
    }
    image.save(path).with_context(|| format!("cannot write {}", path.display()))
}

/// IEC 61966-2-1 transfer function, rounded to 8 bits.
fn srgb8(linear: f32) -> u8 {
    let x = linear.clamp(0.0, 1.0);
    let encoded = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..=255 by the clamp")]
    let byte = (encoded * 255.0).round() as u8;
    byte
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_of_known_values() {
        assert_eq!(srgb8(0.0), 0, "black stays black");
        assert_eq!(srgb8(1.0), 255, "white stays white");
        assert_eq!(srgb8(0.214_04), 127, "middle grey");
        assert_eq!(srgb8(f32::NAN), 0, "NaN must not wrap");
    }

    #[test]
    fn median_of_an_odd_count_is_the_middle() {
        assert!((median(vec![3.0, 1.0, 2.0]) - 2.0).abs() < f64::EPSILON, "the middle of three");
    }

    #[test]
    fn a_changed_bit_is_a_different_pixel() {
        let a = vec![7_u8; 64];
        let mut b = a.clone();
        assert_eq!(different(&a, &b), 0, "the same picture");
        b[17] ^= 1;
        b[30] ^= 1;
        assert_eq!(different(&a, &b), 1, "two bits of the second pixel");
    }
}
