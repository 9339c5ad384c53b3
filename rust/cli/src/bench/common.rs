// SPDX-License-Identifier: Apache-2.0
//! What all benches do: wait for renders, take medians, name the machine, write reports and pictures.

use anyhow::{Context, Result, bail};
use oocpt_render::{AovKind, Session, Severity};
use serde::Serialize;
use std::path::Path;
use std::time::Duration;

/// Longest wait for one render.
const TIMEOUT: Duration = Duration::from_secs(3 * 3600);

/// The machine and program that a report is of.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Machine {
    version: &'static str,
    /// Empty when nothing was rendered.
    device: String,
    driver: String,
    cores: usize,
    /// As the caller says.
    #[serde(skip_serializing_if = "Option::is_none")]
    date: Option<String>,
}

impl Machine {
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

impl std::fmt::Display for Machine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { version, device, driver, cores, date } = self;
        write!(f, "OocPT {version}, {cores} cores")?;
        if !device.is_empty() {
            write!(f, ", {device} ({driver})")?;
        }
        date.as_ref().map_or(Ok(()), |date| write!(f, ", {date}"))
    }
}

/// Bytes of memory that this process holds now (Linux; 0 elsewhere).
pub(crate) fn resident_bytes() -> u64 {
    // Fields of statm are in pages of 4 KiB on the machines we know.
    let pages = std::fs::read_to_string("/proc/self/statm")
        .ok()
        .and_then(|text| text.split_whitespace().nth(1).and_then(|field| field.parse::<u64>().ok()));
    pages.unwrap_or(0) * 4096
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

/// The middle value; of an even count, the upper one of the two.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Writes the colour image as 8-bit sRGB, top row first.
pub(crate) fn write_picture(session: &Session, size: [u32; 2], path: &Path) -> Result<()> {
    let [width, height] = size.map(|side| side as usize);
    let mut pixels = vec![0_f32; width * height * 4];
    if !session.read_aov(AovKind::Color, bytemuck::cast_slice_mut(&mut pixels)) {
        bail!("there is no image to write");
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
}
