// SPDX-License-Identifier: Apache-2.0
//! Programs of the Hydra host that commands start: which one, a small picture by it, and what it said.
//!
//! Scenes and output come from strangers. A file is handed over as an absolute path, in an environment of the user's;
//! the host is ended after a time; of its output a bounded part is read.

use crate::stop::{self, Folder};
use anyhow::{Context as _, Result, bail};
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Numbers the temporary folders.
static FOLDERS: AtomicU64 = AtomicU64::new(0);

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

/// Whether a line says how things went, such as what a render ends with: Pixar's usdrecord names the kind, ours names
/// all other kinds.
fn is_status(line: &str) -> bool {
    let ours = line
        .strip_prefix("OocPT: ")
        .is_some_and(|text| !["warning: ", "error: "].iter().any(|kind| text.starts_with(kind)));
    ours || line.starts_with("Status: in ")
}

/// The lines of what a host that rendered said, each once, without where in the host's code it was said.
pub fn warnings(errors: &Path) -> Vec<String> {
    let text = part(errors, HEAD, false).unwrap_or_else(|error| error.to_string());
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty() && !is_status(line)) {
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
pub fn tail(logs: &[&Path]) -> String {
    let read = |log: &&Path| part(log, TAIL, true).unwrap_or_else(|error| error.to_string());
    let text: Vec<String> = logs.iter().map(read).collect();
    let text = text.join("\n");
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let shown = lines.get(lines.len().saturating_sub(LINES)..).unwrap_or_default().join(" | ");
    if shown.is_empty() { "it said nothing".to_owned() } else { shown.chars().filter(|c| !c.is_control()).collect() }
}

/// The host to use: what is named, else `usdrecord` from the path.
pub fn usdrecord(named: Option<&OsString>) -> OsString {
    named.filter(|name| !name.is_empty()).cloned().unwrap_or_else(|| "usdrecord".into())
}

/// A folder of its own for what a host is asked for.
pub fn temporary(name: &str) -> Result<Folder> {
    let number = FOLDERS.fetch_add(1, Ordering::Relaxed);
    Folder::create(std::env::temp_dir().join(format!("oocpt-{name}-{}-{number}", std::process::id())))
}

/// A picture that a host renders of a file.
#[derive(Debug)]
pub struct Picture<'a> {
    /// An absolute path.
    pub file: &'a Path,
    /// The host: a path, or a name that is looked for in `PATH`.
    pub usdrecord: &'a OsStr,
    /// Without, the one that the host takes.
    pub camera: Option<&'a str>,
    /// Pixels; the height follows from the camera.
    pub width: u32,
    /// For the host's environment.
    pub variables: Vec<(&'static str, OsString)>,
    /// Time after which the host is ended.
    pub timeout: Duration,
}

impl Picture<'_> {
    /// Has it rendered; what is left of it is in `folder`. Gives what the host said on standard error: prims with bad
    /// data, files that are not there.
    pub fn render(&self, folder: &Path) -> Result<Vec<String>> {
        let [output, errors] = ["output", "errors"].map(|name| folder.join(name));
        let keep = |path: &Path| File::create(path).context("cannot keep the host's output");
        let mut command = Command::new(self.usdrecord);
        command
            .args(["--renderer", "OocPT", "--disableGpu", "--disableCameraLight", "--enableDomeLightVisibility"])
            .args(["--imageWidth", &self.width.to_string()])
            .args(self.camera.iter().flat_map(|camera| ["--camera", camera]))
            .arg(self.file)
            .arg(folder.join("picture.exr"))
            .envs(self.variables.iter().map(|(name, value)| (name, value)))
            .stdin(Stdio::null())
            .stdout(keep(&output)?)
            .stderr(keep(&errors)?);
        let (mut child, started) = stop::start(&mut command).with_context(|| {
            format!(
                "cannot start the Hydra host {}: install a usdrecord, name one by --usdrecord, or in the clone: \
                 eval \"$(cargo xtask env)\"",
                self.usdrecord.display()
            )
        })?;
        let status = wait(&mut child, self.timeout)?;
        drop(started);
        let said = tail(&[&output, &errors]);
        let Some(status) = status else {
            bail!("the host was ended after {} s (--timeout): {said}", self.timeout.as_secs());
        };
        if !status.success() {
            bail!("the host could not render {}: {said}", self.file.display());
        }
        Ok(warnings(&errors))
    }
}

/// The status, or none when it took too long.
fn wait(child: &mut Child, timeout: Duration) -> Result<Option<ExitStatus>> {
    let end = Instant::now() + timeout;
    loop {
        if let Some(status) = child.try_wait().context("cannot wait for the host")? {
            return Ok(Some(status));
        }
        if Instant::now() >= end {
            child.kill().context("cannot end the host")?;
            child.wait().context("cannot wait for the host")?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}
