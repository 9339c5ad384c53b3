// SPDX-License-Identifier: Apache-2.0
//! The texture files of the bench: written once by `oocpt-texture-file`, which is built beside the plugin, and reused
//! by later runs; and one decode of them by `OpenImageIO` alone, to compare with.

use anyhow::{Context, Result, bail, ensure};
use serde::Deserialize;
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use super::process::{self, Used};
use super::scene::numbers;

/// Part of every name: raised when the noise or the way of writing changes, so that old files are not reused.
const VERSION: &str = "noise1";

/// A kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Kind {
    /// Quality 92, 8 bits.
    Jpeg,
    /// 8 bits, packed fast.
    Png,
    /// 8 bits, deflate with a predictor, in strips.
    Tiff,
    /// Half floats, zip, in scanlines.
    Exr,
}

impl Kind {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Jpeg => "jpeg",
            Self::Png => "png",
            Self::Tiff => "tiff",
            Self::Exr => "exr",
        }
    }

    fn extension(self) -> &'static str {
        match self {
            Self::Jpeg => "jpg",
            Self::Png => "png",
            Self::Tiff => "tif",
            Self::Exr => "exr",
        }
    }
}

/// The program that writes and reads.
#[derive(Debug)]
pub(super) struct Tool {
    program: OsString,
    timeout: Duration,
}

/// Files of one size and kind: one, or the members of a UDIM set.
#[derive(Debug)]
pub(super) struct Files {
    /// With `<UDIM>` where there are several.
    pub(super) pattern: String,
    pub(super) paths: Vec<PathBuf>,
    pub(super) bytes: u64,
}

/// What the program says.
#[derive(Deserialize)]
struct VarianceEstimate {
    seconds: f64,
}

impl Tool {
    pub(super) fn new(program: Option<&OsString>, timeout: Duration) -> Self {
        let program = program.filter(|name| !name.is_empty()).cloned().unwrap_or_else(|| "oocpt-texture-file".into());
        Self { program, timeout }
    }

    /// The files in `folder`, those that are not there yet written: each appears whole or not at all.
    pub(super) fn files(&self, folder: &Path, kind: Kind, size: u32, members: u32) -> Result<Files> {
        let name = |number: &str| format!("{VERSION}-{size}.{number}.{}", kind.extension());
        let numbers = numbers(members);
        let mut files = Files { pattern: name("<UDIM>"), paths: Vec::new(), bytes: 0 };
        for number in &numbers {
            let path = folder.join(name(&number.to_string()));
            if !path.exists() {
                println!("writing {}", path.display());
                let partial = folder.join(format!("part-{}", name(&number.to_string())));
                let words = ["write".into(), size.to_string(), number.to_string()].map(OsString::from);
                self.call(folder, words.iter().map(OsString::as_os_str).chain([partial.as_os_str()]))?;
                std::fs::rename(&partial, &path).with_context(|| format!("cannot write {}", path.display()))?;
            }
            files.bytes += path.metadata().with_context(|| format!("cannot open {}", path.display()))?.len();
            files.paths.push(path);
        }
        if let [number] = numbers.as_slice() {
            files.pattern = name(&number.to_string());
        }
        Ok(files)
    }

    /// Decodes all of the files once, on all cores: of one file `OpenImageIO`'s own threads, of several one thread a
    /// file. The seconds are those
    /// from the first file's opening to the last one's end, without those of the program's start.
    pub(super) fn decode(&self, folder: &Path, files: &Files) -> Result<Used> {
        let words = ["read", "0"].map(OsStr::new);
        let (said, used) =
            self.call(folder, words.into_iter().chain(files.paths.iter().map(|path| path.as_os_str())))?;
        Ok(Used { secs: said.seconds, ..used })
    }

    fn call<'a>(&self, folder: &Path, words: impl Iterator<Item = &'a OsStr>) -> Result<(VarianceEstimate, Used)> {
        let [output, errors] = ["tool-output", "tool-errors"].map(|name| folder.join(name));
        let keep = |path: &Path| File::create(path).with_context(|| format!("cannot write {}", path.display()));
        let mut command = Command::new(&self.program);
        command.args(words).stdin(Stdio::null()).stdout(keep(&output)?).stderr(keep(&errors)?);
        let used = process::run(&mut command, self.timeout).with_context(|| {
            format!("{}: name it by --texture-file; in the clone: eval \"$(cargo xtask env)\"", self.program.display())
        })?;
        if !used.is_success {
            bail!("{} failed: {}", self.program.display(), oocpt_command::host::tail(&[&output, &errors]));
        }
        let text = std::fs::read_to_string(&output).context("cannot read what it said")?;
        let said: VarianceEstimate =
            serde_json::from_str(&text).with_context(|| format!("{} said {text:?}", self.program.display()))?;
        ensure!(said.seconds.is_finite(), "{} said {text:?}", self.program.display());
        Ok((said, used))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with a program in place of `oocpt-texture-file`.
    fn tool(name: &str, script: &str) -> (PathBuf, Tool) {
        let folder = std::env::temp_dir().join(format!("oocpt-texture-files-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        let program = folder.join("tool");
        std::fs::write(&program, format!("#!/bin/sh\n{script}\n")).expect("a temporary file");
        let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
        std::fs::set_permissions(&program, mode).expect("it is ours");
        let tool = Tool::new(Some(&program.into_os_string()), Duration::from_secs(60));
        (folder, tool)
    }

    #[test]
    fn files_are_written_once_and_then_reused() {
        let script = "[ $1 = read ] && { shift 2; echo \"{\\\"seconds\\\": $#.5}\"; exit; }\n\
                      printf %s \"$2 $3\" > \"$4\" && echo \"$4\" >> \"$(dirname \"$0\")/log\" && echo '{\"seconds\": \
                      1}'";
        let (folder, tool) = tool("reuse", script);
        for _ in 0..2 {
            let files = tool.files(&folder, Kind::Tiff, 16, 2).expect("written");
            assert_eq!(files.pattern, "noise1-16.<UDIM>.tif", "a set");
            assert_eq!(files.bytes, 14, "of both, as the program wrote them: size and number");
            let second = std::fs::read_to_string(&files.paths[1]).expect("it is there");
            assert_eq!(second, "16 1002", "each member is another picture");
            let decode = tool.decode(&folder, &files).expect("read");
            assert!((decode.secs - 2.5).abs() < 1e-9 && decode.peak_bytes > 0, "both files, the program's own seconds");
        }
        let log = std::fs::read_to_string(folder.join("log")).expect("it is there");
        assert_eq!(log.lines().count(), 2, "each file once: {log}");
        assert!(log.contains("part-noise1-16.1001.tif"), "under another name until it is whole: {log}");
        assert_eq!(tool.files(&folder, Kind::Tiff, 16, 1).expect("there").pattern, "noise1-16.1001.tif", "one file");
        std::fs::remove_dir_all(folder).expect("it is ours");
    }

    #[test]
    fn a_failed_write_gives_one_message_and_leaves_no_file() {
        let (folder, failing) = tool("fails", "printf x > \"$4\"; echo 'disk is full' >&2; exit 1");
        let error = format!("{:#}", failing.files(&folder, Kind::Png, 8, 1).expect_err("it fails"));
        assert!(error.contains("failed: disk is full"), "{error}");
        assert!(!folder.join("noise1-8.1001.png").exists(), "half a file is none");
        std::fs::remove_dir_all(folder).expect("it is ours");
        let (folder, silent) = tool("silent", "exit 0");
        let error = format!("{:#}", silent.files(&folder, Kind::Png, 8, 1).expect_err("it says nothing"));
        assert!(error.contains("said \"\""), "{error}");
        std::fs::remove_dir_all(folder).expect("it is ours");
    }
}
