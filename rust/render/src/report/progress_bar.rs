// SPDX-License-Identifier: Apache-2.0
//! The progress bar of command line renders: elapsed time, samples, error and time left, drawn over itself on standard
//! error.
//!
//! Render thread only. The bar is drawn here and not in the host because the host's thread may be blocked in a loop of
//! its own meanwhile.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// Least time between two drawings.
const INTERVAL: Duration = Duration::from_millis(100);
/// Least time between two drawings where the bar cannot be drawn over itself.
const LINE_INTERVAL: Duration = Duration::from_secs(10);
/// Cells of the bar.
const CELLS: usize = 12;
/// Columns of the line.
const COLUMNS: usize = 78;

/// How far a render is.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BarState {
    /// Share of all samples that are done.
    pub(crate) done: f64,
    /// Share of them that the target error is expected to take; 1 without one.
    pub(crate) needed: f64,
    pub(crate) elapsed: Duration,
    /// The time limit.
    pub(crate) limit: Option<Duration>,
    /// Finished samples of each pixel, and samples per pixel of the whole render.
    pub(crate) samples: [u32; 2],
    /// The error as last estimated.
    pub(crate) rel_mse: Option<f64>,
}

/// A bar, drawn or not yet.
#[derive(Debug)]
pub(crate) struct ProgressBar {
    next: Instant,
    interval: Duration,
    over: bool,
    drawn: bool,
}

impl ProgressBar {
    /// Creates a bar that starts to draw now.
    pub(crate) fn new() -> Self {
        let over = std::io::stderr().is_terminal();
        Self { next: Instant::now(), interval: if over { INTERVAL } else { LINE_INTERVAL }, over, drawn: false }
    }

    /// Draws the bar if it is time to.
    pub(crate) fn draw(&mut self, state: &BarState) {
        let now = Instant::now();
        if now >= self.next || state.done >= 1.0 {
            self.next = now + self.interval;
            self.drawn = true;
            let line = line(state);
            put(&if self.over { format!("\r{line:<COLUMNS$}") } else { format!("{line}\n") });
        }
    }
}

impl Drop for ProgressBar {
    /// Leaves the bar as it is and goes to a new line.
    fn drop(&mut self) {
        if self.drawn && self.over {
            put("\n");
        }
    }
}

fn put(text: &str) {
    let mut out = std::io::stderr().lock();
    if let Err(error) = out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        tracing::debug!(%error, "the progress bar cannot be drawn");
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a fraction of a few cells")]
fn line(state: &BarState) -> String {
    let done = state.done.clamp(0.0, 1.0);
    let full = ((done * CELLS as f64) as usize).min(CELLS);
    let secs = state.elapsed.as_secs_f64();
    let [samples, target] = state.samples;
    let error = state.rel_mse.map_or_else(String::new, |error| format!("relMSE {error:.1e}  "));
    let left = seconds_left(state).map_or_else(String::new, |left| format!("~{left:.0} s left"));
    let bar = format!("{}{}", "#".repeat(full), "-".repeat(CELLS - full));
    format!("[{bar}] {:3.0} %  {secs:.1} s  {samples}/{target} samples  {error}{left}", 100.0 * done)
}

/// Seconds to the end of the samples, to the target error or to the time limit, whatever comes first.
fn seconds_left(state: &BarState) -> Option<f64> {
    let secs = state.elapsed.as_secs_f64();
    let by_samples = (state.done > 0.0).then(|| secs * (state.needed.min(1.0) / state.done - 1.0).max(0.0))?;
    let by_clock = state.limit.map_or(f64::INFINITY, |limit| (limit.as_secs_f64() - secs).max(0.0));
    Some(by_samples.min(by_clock))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_progress_line_shows_done_and_remaining() {
        let quarter = BarState {
            done: 0.25,
            needed: 1.0,
            elapsed: Duration::from_secs(10),
            samples: [16, 64],
            ..BarState::default()
        };
        assert_eq!(line(&quarter), "[###---------]  25 %  10.0 s  16/64 samples  ~30 s left", "a quarter done");
        let told = BarState { rel_mse: Some(4.13e-3), needed: 0.5, ..quarter };
        let said = "[###---------]  25 %  10.0 s  16/64 samples  relMSE 4.1e-3  ~10 s left";
        assert_eq!(line(&told), said, "the error, and the time to the target");
        let limited = BarState { limit: Some(Duration::from_secs(12)), ..told };
        assert!(line(&limited).ends_with("  ~2 s left"), "the clock comes first");
        let none = BarState { samples: [0, 64], ..BarState::default() };
        assert!(line(&none).ends_with("0/64 samples  "), "no estimate before the first sample");
        let all = BarState { done: 7.0, ..quarter };
        assert!(line(&all).starts_with("[############] 100 %"), "never beyond full");
        let longest = BarState {
            done: 0.99,
            elapsed: Duration::from_secs(9999),
            samples: [1023, 1024],
            rel_mse: Some(1e-3),
            ..quarter
        };
        assert!(line(&longest).len() <= COLUMNS, "it fits a terminal: {}", line(&longest));
    }
}
