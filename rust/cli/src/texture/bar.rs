// SPDX-License-Identifier: Apache-2.0
//! A progress bar on standard error, where that is a terminal; lines for the user go above it.

use std::io::{IsTerminal as _, Write as _};

/// Columns of the bar itself, and of the name behind it.
const COLUMNS: u64 = 24;
const NAME: usize = 40;

/// See the module.
#[derive(Debug)]
pub(super) struct TerminalBar {
    is_drawn: bool,
    done: u64,
}

impl TerminalBar {
    /// A bar, if it is wanted and there is a terminal.
    pub(super) fn new(is_wanted: bool) -> Self {
        Self { is_drawn: is_wanted && std::io::stderr().is_terminal(), done: 0 }
    }

    /// One more of so many is done.
    pub(super) fn step(&mut self, count: u64, name: &str) {
        self.done += 1;
        if self.is_drawn {
            say(&format!("\r\x1b[2K{}", picture(self.done, count, name)));
        }
    }

    /// A line that stays.
    pub(super) fn line(&self, text: &str) {
        let text: String = text.chars().filter(|c| !c.is_control()).collect();
        say(&if self.is_drawn { format!("\r\x1b[2K{text}\n") } else { format!("{text}\n") });
    }

    /// Takes the bar away.
    pub(super) fn end(&self) {
        if self.is_drawn {
            say("\r\x1b[2K");
        }
    }
}

fn say(text: &str) {
    let mut stream = std::io::stderr();
    if let Err(error) = stream.write_all(text.as_bytes()).and_then(|()| stream.flush()) {
        tracing::debug!(%error, "nobody reads the progress");
    }
}

/// The bar as text.
fn picture(done: u64, count: u64, name: &str) -> String {
    let filled = (done.min(count) * COLUMNS).checked_div(count).unwrap_or(COLUMNS);
    let bar: String = (0..COLUMNS).map(|column| if column < filled { '#' } else { '-' }).collect();
    let letters: Vec<char> = name.chars().filter(|c| !c.is_control()).collect();
    let tail: String = letters.iter().skip(letters.len().saturating_sub(NAME)).collect();
    format!("[{bar}] {done} of {count} {tail}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_fills_from_the_left() {
        assert_eq!(picture(1, 2, "/a.png"), "[############------------] 1 of 2 /a.png", "half");
        assert_eq!(picture(0, 0, ""), "[########################] 0 of 0 ", "nothing to do is done");
        let long = picture(2, 2, &format!("{}\u{1b}z", "y".repeat(60)));
        assert!(
            long.ends_with(&format!(" {}z", "y".repeat(39))),
            "the end of the name, without control characters: {long}"
        );
    }
}
