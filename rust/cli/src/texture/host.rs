// SPDX-License-Identifier: Apache-2.0
//! Runs the program that inspects files inside the host: `oocpt-texture-host` (plugin/texture-host). It reads one file
//! a line and answers with a line for each, in any order. Its answers are bounded and checked: files may come from
//! strangers.

use anyhow::{Context as _, Result, ensure};
use oocpt_command::stop;
use serde::{Deserialize, Serialize};
use std::ffi::{OsStr, OsString};
use std::io::{BufRead as _, BufReader, Read, Write as _};
use std::process::{Child, Command, Stdio};

/// Longest line that is read, bytes.
const MAX_LINE_BYTES: u64 = 1 << 20;

/// The host's answer about one file; all but `file` and `space` are empty if `error` is not.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct TextureAnswer {
    pub(super) file: String,
    pub(super) space: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) error: Option<String>,
    pub(super) size: [u32; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) faces: Option<u32>,
    pub(super) levels: u64,
    pub(super) channels: u32,
    pub(super) format: String,
    pub(super) is_tiled: bool,
    pub(super) is_srgb: bool,
    pub(super) why: String,
    pub(super) is_direct: bool,
    pub(super) cache: CachedTexture,
}

/// The entry in the cache.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct CachedTexture {
    pub(super) key: String,
    pub(super) path: String,
    pub(super) bytes: Option<u64>,
    pub(super) first_level: Option<u32>,
}

impl TextureAnswer {
    pub(super) fn failed(file: &str, error: &str) -> Self {
        Self { file: file.to_owned(), error: Some(error.to_owned()), ..Self::default() }
    }
}

/// A line of the host's output.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum HostLine {
    /// The number of answers to come.
    Count { files: u64 },
    /// One answer.
    Answer(Box<TextureAnswer>),
}

/// A running host; killed when it is dropped.
#[derive(Debug)]
pub(super) struct TextureHost {
    child: Child,
    name: OsString,
    /// Goes after the child was waited for.
    _started: stop::StartedProgram,
}

impl Drop for TextureHost {
    fn drop(&mut self) {
        // A host that has ended is not killed again; its status was reported.
        if matches!(self.child.try_wait(), Ok(None)) && self.child.kill().is_ok() {
            let ended = self.child.wait();
            tracing::debug!(?ended, "the host was ended");
        }
    }
}

impl TextureHost {
    /// Starts the program. `cache` is the value of `OOCPT_TEXTURE_CACHE`.
    pub(super) fn start(name: Option<&OsString>, command: &str, jobs: u32, cache: Option<&OsStr>) -> Result<Self> {
        let name = name.filter(|name| !name.is_empty()).cloned().unwrap_or_else(|| "oocpt-texture-host".into());
        let mut start = Command::new(&name);
        start.arg(command).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        if jobs > 0 {
            start.args(["--jobs", &jobs.to_string()]);
        }
        if let Some(cache) = cache {
            start.env("OOCPT_TEXTURE_CACHE", cache);
        }
        let (child, started) = stop::start(&mut start).with_context(|| {
            format!("cannot start {}: name it by --host; in the clone: eval \"$(cargo xtask env)\"", name.display())
        })?;
        Ok(Self { child, name, _started: started })
    }

    /// Asks for all of the files with their color spaces; `each` gets every line as it arrives.
    pub(super) fn ask(mut self, files: &[(&str, &str)], mut each: impl FnMut(HostLine)) -> Result<()> {
        let mut input = self.child.stdin.take().context("no way to the host")?;
        let output = self.child.stdout.take().context("no way from the host")?;
        let errors = self.child.stderr.take().context("no way from the host")?;
        let mut lines = String::new();
        for (file, space) in files {
            lines += &serde_json::to_string(&[file, space])?;
            lines.push('\n');
        }
        let mut output = BufReader::new(output);
        let (mut expected, mut answered) = (None, 0);
        let heard = std::thread::scope(|scope| {
            // The host may begin to answer before it has read all lines.
            let written = scope.spawn(move || input.write_all(lines.as_bytes()));
            // Libraries print complaints there about files that are reported anyway.
            let complaints = scope.spawn(move || end_of(errors));
            let mut heard = Ok(());
            let mut line = String::new();
            loop {
                line.clear();
                match (&mut output).take(MAX_LINE_BYTES).read_line(&mut line) {
                    Ok(0) => break,
                    Ok(_) => {}
                    Err(error) => {
                        heard = Err(error).context("its answer cannot be read");
                        break;
                    }
                }
                match serde_json::from_str(&line) {
                    Ok(HostLine::Count { files }) if expected.is_none() => {
                        expected = Some(files);
                        each(HostLine::Count { files });
                    }
                    Ok(HostLine::Answer(answer)) if !answer.file.is_empty() => {
                        answered += 1;
                        each(HostLine::Answer(answer));
                    }
                    // Hosts and their plugins print lines of their own.
                    Ok(_) | Err(_) => tracing::debug!(line, "the host says"),
                }
            }
            // A host that ends early does not read all files; its status shows that.
            let written = written.join();
            tracing::debug!(?written, "files were told");
            heard.map(|()| complaints.join().unwrap_or_default())
        });
        let complaints = heard.with_context(|| self.name.display().to_string())?;
        let status = self.child.wait().context("cannot wait for the host")?;
        ensure!(status.success(), "{} failed ({status}): {complaints}", self.name.display());
        tracing::debug!(complaints, "the host has ended");
        ensure!(expected == Some(answered), "{} answered for {answered} files only", self.name.display());
        Ok(())
    }
}

/// The last bytes of a host's output beside its answers, on one line.
fn end_of(mut errors: impl Read) -> String {
    const KEPT: usize = 2048;
    let (mut all, mut part) = (Vec::new(), [0; 4096]);
    while let Ok(count @ 1..) = errors.read(&mut part) {
        all.extend_from_slice(part.get(..count).unwrap_or_default());
        all.drain(..all.len().saturating_sub(KEPT));
    }
    let text = String::from_utf8_lossy(&all);
    text.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" | ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    /// The answers of a script in place of the host.
    fn hear(name: &str, script: &str) -> (Vec<String>, Result<()>) {
        let path: PathBuf = std::env::temp_dir().join(format!("oocpt-texture-host-{name}-{}", std::process::id()));
        std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).expect("a temporary file");
        let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
        std::fs::set_permissions(&path, mode).expect("it is ours");
        let program = path.clone().into_os_string();
        let host = TextureHost::start(Some(&program), "info", 3, Some(OsStr::new("/c"))).expect("it starts");
        let mut heard = Vec::new();
        let result = host.ask(&[("/a \"b\".png", "raw"), ("/b.png", "auto")], |line| {
            heard.push(match line {
                HostLine::Count { files } => files.to_string(),
                HostLine::Answer(answer) => format!("{} {:?}", answer.file, answer.error),
            });
        });
        std::fs::remove_file(path).expect("it is there");
        (heard, result)
    }

    #[test]
    fn files_are_sent_to_the_host_and_answers_are_read() {
        let script = "[ \"$1 $2 $3 $OOCPT_TEXTURE_CACHE\" = 'info --jobs 3 /c' ] || exit 7\n\
                      read -r first; [ \"$first\" = '[\"/a \\\"b\\\".png\",\"raw\"]' ] || exit 8\n\
                      echo a library greets; echo '{\"files\": 2}'\n\
                      echo '{\"file\": \"/b.png\", \"error\": \"cannot be found\"}'; echo '{\"file\": \"/a.png\", \
                      \"levels\": 3}'";
        let (heard, result) = hear("answers", script);
        result.expect("all are answered");
        assert_eq!(heard, ["2", "/b.png Some(\"cannot be found\")", "/a.png None"], "in its order");
    }

    #[test]
    fn a_host_that_exits_early_is_an_error() {
        let text = |result: Result<()>| format!("{:#}", result.expect_err("no end"));
        let few = hear("few", "echo '{\"files\": 2}'; echo '{\"file\": \"/b.png\"}'").1;
        assert!(text(few).contains("answered for 1 files only"), "one is missing");
        let failed = text(hear("failed", "echo a library >&2; echo no plugin >&2; exit 1").1);
        assert!(failed.contains("failed (exit status: 1): a library | no plugin"), "{failed}");
        let none = TextureHost::start(Some(&"/no/such/host".into()), "info", 0, None).expect_err("nothing there");
        assert!(format!("{none:#}").contains("cannot start /no/such/host"), "{none:#}");
    }
}
