// SPDX-License-Identifier: Apache-2.0
//! The progress bar of command line renders: elapsed time, samples and time left, drawn over itself on standard error.
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
const CELLS: usize = 24;
/// Columns of the line.
const COLUMNS: usize = 78;

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

    /// Draws the bar if it is time to: `done` of 1 is finished, after `elapsed`, with `samples` of `target` per pixel.
    pub(crate) fn draw(&mut self, done: f64, elapsed: Duration, samples: u32, target: u32) {
        let now = Instant::now();
        if now >= self.next || done >= 1.0 {
            self.next = now + self.interval;
            self.drawn = true;
            let line = line(done, elapsed, samples, target);
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
fn line(done: f64, elapsed: Duration, samples: u32, target: u32) -> String {
    let done = done.clamp(0.0, 1.0);
    let full = ((done * CELLS as f64) as usize).min(CELLS);
    let secs = elapsed.as_secs_f64();
    let left = if done > 0.0 { format!("~{:.0} s left", secs * (1.0 - done) / done) } else { String::new() };
    let bar = format!("{}{}", "#".repeat(full), "-".repeat(CELLS - full));
    format!("[{bar}] {:3.0} %  {secs:.1} s  {samples}/{target} samples  {left}", 100.0 * done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_progress_line_shows_done_and_remaining() {
        let text = line(0.25, Duration::from_secs(10), 16, 64);
        assert_eq!(text, "[######------------------]  25 %  10.0 s  16/64 samples  ~30 s left", "a quarter done");
        assert!(line(0.0, Duration::ZERO, 0, 64).contains("0/64 samples"), "no estimate before the first sample");
        assert!(line(7.0, Duration::ZERO, 64, 64).starts_with("[########################] 100 %"), "never beyond full");
    }
}
