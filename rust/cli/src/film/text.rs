// SPDX-License-Identifier: Apache-2.0
//! Films in words.

use oocpt_core::convergence::ErrorEstimate;
use oocpt_film::{FilmHeader, OctaveError, SampleRange, estimates};

/// Ranges of samples: `0..64, 128..256`.
pub(super) fn ranges(ranges: &[SampleRange]) -> String {
    if ranges.is_empty() {
        return "none".to_owned();
    }
    ranges.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

/// An error and its 95 % interval, as in the closing words of a render.
pub(super) fn error(error: Option<ErrorEstimate>) -> String {
    error.map_or_else(
        || "error unknown".to_owned(),
        |error| format!("relMSE {:.1e} ({:.1e} to {:.1e})", error.rel_mse, error.low, error.high),
    )
}

/// The samples of a film, and the last error that is known.
pub(super) fn summary(header: &FilmHeader, errors: &[OctaveError]) -> String {
    let [width, height] = header.size();
    let samples = header.samples();
    let all = samples.iter().map(|range| range.samples()).sum::<u32>();
    let last = estimates(errors).last().copied().flatten();
    let mut text = format!("{width} x {height}, samples {}, {}", ranges(&samples), error(last));
    if let Some(last) = errors.last().filter(|last| last.samples != all) {
        text += &format!(" at {}", last.samples);
    }
    if header.nonfinite > 0 {
        text += &format!(", {} samples were not finite", header.nonfinite);
    }
    text
}

/// Bytes as MiB.
#[expect(clippy::cast_precision_loss, reason = "sizes are shown, not computed with")]
pub(super) fn mib(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}
