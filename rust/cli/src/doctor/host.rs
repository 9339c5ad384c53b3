// SPDX-License-Identifier: Apache-2.0
//! Asks a Hydra host what a USD file needs: `usdrecord` renders a tiny picture of it, and the renderer's own report
//! (`oocpt:report`) says what that was made of. So a file goes the way that it goes in every host: composition, scene
//! index, delegate.
//!
//! The file comes from strangers. It is handed over as an absolute path, in an environment of the user's; the host is
//! ended after a time; of its output only the end is shown; the report is read with the bounds of all reports.

use crate::host::{tail, warnings};
use crate::stop::{self, Folder};
use anyhow::{Context, Result, bail};
use oocpt_render::error_report::ErrorReport;
use std::ffi::OsStr;
use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Numbers the temporary folders.
static FOLDERS: AtomicU64 = AtomicU64::new(0);

/// How to ask.
#[derive(Debug)]
pub(super) struct Question<'a> {
    pub(super) file: &'a Path,
    pub(super) usdrecord: &'a OsStr,
    pub(super) camera: Option<&'a str>,
    pub(super) width: u32,
    pub(super) samples: u32,
    pub(super) bounces: u32,
    pub(super) device: &'a str,
    /// Value of `oocpt:carry`.
    pub(super) carry: &'a str,
    pub(super) timeout: Duration,
}

/// What a host that rendered gave.
#[derive(Debug)]
pub(super) struct Answer {
    pub(super) report: ErrorReport,
    /// What it said on standard error: prims with bad data, files that are not there.
    pub(super) warnings: Vec<String>,
}

/// Renders the file and gives the report of the last render, and what the host said.
pub(super) fn ask(question: &Question<'_>) -> Result<Answer> {
    let file = std::fs::canonicalize(question.file)
        .with_context(|| format!("cannot open {}: neither a file nor a generated scene", question.file.display()))?;
    let number = FOLDERS.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("oocpt-doctor-{}-{number}", std::process::id()));
    let folder = Folder::create(folder)?;
    let [report, output, errors] = ["report.jsonl", "output", "errors"].map(|name| folder.path().join(name));
    let keep = |path: &Path| File::create(path).context("cannot keep the host's output");
    let mut command = Command::new(question.usdrecord);
    command
        .args(["--renderer", "OocPT", "--disableGpu", "--disableCameraLight", "--enableDomeLightVisibility"])
        .args(["--imageWidth", &question.width.to_string()])
        .args(question.camera.iter().flat_map(|camera| ["--camera", camera]))
        .arg(&file)
        .arg(folder.path().join("picture.exr"))
        .env("OOCPT_REPORT", &report)
        .env("OOCPT_SAMPLES_PER_PIXEL", question.samples.to_string())
        .env("OOCPT_MAX_BOUNCES", question.bounces.to_string())
        .env("OOCPT_CARRY", question.carry)
        .stdin(Stdio::null())
        .stdout(keep(&output)?)
        .stderr(keep(&errors)?);
    if !question.device.is_empty() {
        command.env("OOCPT_DEVICE", question.device);
    }
    let (mut child, started) = stop::start(&mut command).with_context(|| {
        format!(
            "cannot start the Hydra host {}: install a usdrecord, name one by --usdrecord, or in the clone: \
             eval \"$(cargo xtask env)\"",
            question.usdrecord.display()
        )
    })?;
    let status = wait(&mut child, question.timeout)?;
    drop(started);
    let said = tail(&[&output, &errors]);
    let Some(status) = status else {
        bail!("the host was ended after {} s (--timeout): {said}", question.timeout.as_secs());
    };
    if !status.success() {
        bail!("the host could not render {}: {said}", file.display());
    }
    let mut renders = ErrorReport::read_all(&report).with_context(|| {
        "the host rendered without a report: its OocPT is older than this program, or the file's render settings name \
        another \
         one (oocpt:report)"
            .to_owned()
    })?;
    let report = renders.pop().context("the report is empty")?;
    Ok(Answer { report, warnings: warnings(&errors) })
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn question<'a>(file: &'a Path, usdrecord: &'a OsStr) -> Question<'a> {
        let timeout = Duration::from_millis(300);
        Question { file, usdrecord, camera: None, width: 4, samples: 1, bounces: 0, device: "", carry: "", timeout }
    }

    /// A program in place of `usdrecord`.
    fn script(name: &str, text: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("oocpt-doctor-{name}-{}", std::process::id()));
        std::fs::write(&path, format!("#!/bin/sh\n{text}\n")).expect("a temporary file");
        let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
        std::fs::set_permissions(&path, mode).expect("it is ours");
        path
    }

    /// What `ask` says when the host is this script.
    fn said(name: &str, text: &str) -> String {
        let program = script(name, text);
        let error = ask(&question(&program, program.as_os_str())).expect_err("no report comes");
        std::fs::remove_file(&program).expect("it is there");
        format!("{error:#}")
    }

    #[test]
    fn each_trouble_is_one_message() {
        let missing = ask(&question(Path::new("/no/such/file.usda"), OsStr::new("usdrecord"))).expect_err("no file");
        assert!(format!("{missing:#}").contains("neither a file nor a generated scene"), "{missing:#}");
        let here = std::env::current_exe().expect("a file");
        let none = ask(&question(&here, OsStr::new("/no/such/usdrecord"))).expect_err("no host");
        assert!(format!("{none:#}").contains("cannot start the Hydra host"), "{none:#}");
        let failed = said("fails", "echo first; echo bad layer >&2; exit 3");
        assert!(failed.contains("could not render") && failed.contains("first | bad layer"), "{failed}");
        let silent = said("silent", "exit 0");
        assert!(silent.contains("without a report"), "{silent}");
        let slow = said("slow", "exec sleep 60");
        assert!(slow.contains("ended after"), "{slow}");
        let loud = said("loud", "head -c 300000 /dev/zero | tr '\\0' 'x'; echo; exit 1");
        assert!(loud.len() < 20_000, "only the end of it: {} bytes", loud.len());
    }

    #[test]
    fn the_host_is_asked_for_a_report_and_told_what_to_carry() {
        let program = script(
            "reports",
            "test \"$OOCPT_CARRY\" = \"\" && test \"$OOCPT_SAMPLES_PER_PIXEL\" = 1 || exit 1\n\
             echo \
             '{\"oocptErrorReport\":1,\"renderer\":\"r\",\"device\":\"d\",\"width\":4,\"height\":3,\"samplesTarget\":1,\
             \"maxBounces\":0,\"seed\":0,\"geometryBudgetKib\":0,\"reference\":\"\"}' > \"$OOCPT_REPORT\"\n\
             echo Camera: /A; for i in 1 2; do echo 'Warning: in F at line 3 of a.cpp -- OocPT: /A: bad data' >&2; \
             done\n\
             echo No camera >&2\n",
        );
        let Answer { report, warnings } = ask(&question(&program, program.as_os_str())).expect("a report");
        std::fs::remove_file(&program).expect("it is there");
        assert_eq!(warnings, ["OocPT: /A: bad data", "No camera"], "each line once, without where it was said");
        assert_eq!((report.header.device.as_str(), report.header.height), ("d", 3), "what the host wrote");
    }
}
