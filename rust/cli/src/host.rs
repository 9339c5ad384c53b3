// SPDX-License-Identifier: Apache-2.0
//! Programs of the Hydra host that commands start: which one, and what it said. Output comes from strangers: of it a
//! bounded part is read.

use std::ffi::OsString;
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

/// How much of a host's output is looked at, bytes.
const TAIL: u64 = 16 << 10;
/// Lines of it that are shown.
const LINES: usize = 4;
/// Warnings of a host that rendered: how much of its standard error is looked at, bytes, and how many lines are told.
const HEAD: u64 = 256 << 10;
const WARNINGS: usize = 100;

/// The last bytes of a file, or the first, as text.
fn part(file: &Path, bytes: u64, is_end: bool) -> std::io::Result<String> {
    let mut file = File::open(file)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(if is_end { length.saturating_sub(bytes) } else { 0 }))?;
    let mut read = Vec::new();
    file.take(bytes).read_to_end(&mut read)?;
    Ok(String::from_utf8_lossy(&read).into_owned())
}

/// The lines of what a host that rendered said, each once, without where in the host's code it was said.
pub(crate) fn warnings(errors: &Path) -> Vec<String> {
    let text = part(errors, HEAD, false).unwrap_or_else(|error| error.to_string());
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
        // Pixar's usdrecord says where, ours what kind of message it is.
        let plain = line.strip_prefix("Warning: in ").and_then(|line| line.split_once(" -- "));
        let plain = plain.map_or(line, |(_, what)| what);
        let plain = plain.strip_prefix("USD: warning: ").unwrap_or(plain).replacen("OocPT: warning: ", "OocPT: ", 1);
        let line: String = plain.chars().filter(|c| !c.is_control()).collect();
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    let more = lines.len().saturating_sub(WARNINGS);
    lines.truncate(WARNINGS);
    lines.extend((more > 0).then(|| format!("and {more} more")));
    lines
}

/// The last lines of what the host wrote, on one line.
pub(crate) fn tail(logs: &[&Path]) -> String {
    let read = |log: &&Path| part(log, TAIL, true).unwrap_or_else(|error| error.to_string());
    let text: Vec<String> = logs.iter().map(read).collect();
    let text = text.join("\n");
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let shown = lines.get(lines.len().saturating_sub(LINES)..).unwrap_or_default().join(" | ");
    if shown.is_empty() { "it said nothing".to_owned() } else { shown.chars().filter(|c| !c.is_control()).collect() }
}

/// The host to use: what is named, else `usdrecord` from the path.
pub(crate) fn usdrecord(named: Option<&OsString>) -> OsString {
    named.filter(|name| !name.is_empty()).cloned().unwrap_or_else(|| "usdrecord".into())
}
