// SPDX-License-Identifier: Apache-2.0
//! Asks a Hydra host what a USD file needs: `usdrecord` renders a tiny picture of it, and the renderer's own report
//! (`oocpt:report`) says what that was made of. So a file goes the way that it goes in every host: composition, scene
//! index, delegate.

use anyhow::{Context, Result};
use oocpt_command::host::{Picture, temporary};
use oocpt_render::error_report::ErrorReport;
use std::ffi::OsStr;
use std::path::Path;
use std::time::Duration;

/// How to ask.
#[derive(Debug)]
pub(super) struct HostQuery<'a> {
    pub(super) file: &'a Path,
    pub(super) usdrecord: &'a OsStr,
    pub(super) camera: Option<&'a str>,
    pub(super) width: u32,
    pub(super) samples: u32,
    pub(super) bounces: u32,
    pub(super) device: &'a str,
    pub(super) timeout: Duration,
}

/// What a host that rendered gave.
#[derive(Debug)]
pub(super) struct HostAnswer {
    pub(super) report: ErrorReport,
    /// What it said on standard error: prims with bad data, files that are not there.
    pub(super) warnings: Vec<String>,
}

/// Renders the file and gives the report of the last render, and what the host said.
pub(super) fn ask(question: &HostQuery<'_>) -> Result<HostAnswer> {
    let file =
        std::fs::canonicalize(question.file).with_context(|| format!("cannot open {}", question.file.display()))?;
    let folder = temporary("doctor")?;
    let report = folder.path().join("report.jsonl");
    let mut variables = vec![
        ("OOCPT_REPORT", report.clone().into()),
        ("OOCPT_SAMPLES_PER_PIXEL", question.samples.to_string().into()),
        ("OOCPT_MAX_BOUNCES", question.bounces.to_string().into()),
    ];
    if !question.device.is_empty() {
        variables.push(("OOCPT_DEVICE", question.device.into()));
    }
    let HostQuery { usdrecord, camera, width, timeout, .. } = *question;
    let picture = Picture { file: &file, usdrecord, camera, width, variables, timeout };
    let warnings = picture.render(folder.path())?;
    let mut renders = ErrorReport::read_all(&report).with_context(|| {
        "the host rendered without a report: its OocPT is older than this program, or the file's render settings name \
        another \
         one (oocpt:report)"
            .to_owned()
    })?;
    let report = renders.pop().context("the report is empty")?;
    Ok(HostAnswer { report, warnings })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::script::script;

    fn question<'a>(file: &'a Path, usdrecord: &'a OsStr) -> HostQuery<'a> {
        let timeout = Duration::from_millis(300);
        HostQuery { file, usdrecord, camera: None, width: 4, samples: 1, bounces: 0, device: "", timeout }
    }

    /// What `ask` says when the host is this script.
    fn said(name: &str, text: &str) -> String {
        let program = script(name, text);
        let error = ask(&question(&program, program.as_os_str())).expect_err("no report comes");
        std::fs::remove_file(&program).expect("it is there");
        format!("{error:#}")
    }

    #[test]
    fn each_host_failure_gives_one_message() {
        let missing = ask(&question(Path::new("/no/such/file.usda"), OsStr::new("usdrecord"))).expect_err("no file");
        assert!(format!("{missing:#}").contains("cannot open /no/such/file.usda"), "{missing:#}");
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
    fn the_host_gets_the_report_path_and_the_samples() {
        let program = script(
            "reports",
            "test \"$OOCPT_SAMPLES_PER_PIXEL\" = 1 || exit 1\n\
             echo \
             '{\"oocptErrorReport\":1,\"renderer\":\"r\",\"device\":\"d\",\"width\":4,\"height\":3,\"samplesTarget\":1,\
             \"maxBounces\":0,\"seed\":0,\"geometryBudgetKib\":0,\"reference\":\"\"}' > \"$OOCPT_REPORT\"\n\
             echo Camera: /A; for i in 1 2; do echo 'Warning: in F at line 3 of a.cpp -- OocPT: /A: bad data' >&2; \
             done\n\
             echo No camera >&2; echo 'OocPT: 1 samples, 0.1 s' >&2\n\
             echo 'Status: in F at line 3 of a.cpp -- OocPT: 1 samples, 0.1 s' >&2\n",
        );
        let HostAnswer { report, warnings } = ask(&question(&program, program.as_os_str())).expect("a report");
        std::fs::remove_file(&program).expect("it is there");
        assert_eq!(warnings, ["OocPT: /A: bad data", "No camera"], "each line once, without where it was said");
        assert_eq!((report.header.device.as_str(), report.header.height), ("d", 3), "what the host wrote");
    }
}
