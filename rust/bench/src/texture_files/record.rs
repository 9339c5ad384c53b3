// SPDX-License-Identifier: Apache-2.0
//! One run of a real `usdrecord`, as a user would start it, with a texture cache of the bench's own.

use anyhow::{Context, Result, bail, ensure};
use exr::prelude::{FlatSamples, ReadChannels as _, ReadLayers as _};
use oocpt_core::stats::RenderUsage;
use oocpt_render::error_report::ErrorReport;
use std::ffi::OsString;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use super::process::{self, Used};
use oocpt_command::host::{tail, warnings};

/// How to run.
#[derive(Debug)]
pub(super) struct Host {
    pub(super) usdrecord: OsString,
    pub(super) width: u32,
    pub(super) samples: u32,
    pub(super) device: String,
    pub(super) timeout: Duration,
    /// For scenes, pictures and what the host says.
    pub(super) folder: PathBuf,
    /// Value of `OOCPT_TEXTURE_CACHE`: a folder, or `0`.
    pub(super) cache: OsString,
}

/// What a run gave.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) used: Used,
    pub(super) usage: RenderUsage,
    pub(super) device: String,
    pub(super) warnings: Vec<String>,
    pub(super) picture: Picture,
}

/// All channels of a picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Picture(Vec<FlatSamples>);

impl Picture {
    fn read(path: &Path) -> Result<Self> {
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_file(path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        Ok(Self(image.layer_data.channel_data.list.into_iter().map(|channel| channel.sample_data).collect()))
    }

    /// Every channel has one value all over, or all but: a fallback, not a texture.
    fn is_plain(&self) -> bool {
        self.0.iter().all(|channel| {
            let range = channel.values_as_f32().fold([f32::MAX, f32::MIN], |[low, high], v| [low.min(v), high.max(v)]);
            range[1] - range[0] < 0.01
        })
    }
}

impl Host {
    /// Renders the scene once.
    pub(super) fn record(&self, scene: &Path) -> Result<Run> {
        let [report, output, errors, picture] =
            ["report.jsonl", "output", "errors", "picture.exr"].map(|name| self.folder.join(name));
        for old in [&report, &picture] {
            match std::fs::remove_file(old) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    return Err(error).with_context(|| format!("cannot remove {}", old.display()));
                }
                _ => {}
            }
        }
        let keep = |path: &Path| File::create(path).with_context(|| format!("cannot write {}", path.display()));
        let mut command = Command::new(&self.usdrecord);
        command
            .args(["--renderer", "OocPT", "--disableGpu", "--disableCameraLight", "--camera", "/World/Camera"])
            .args(["--imageWidth", &self.width.to_string()])
            .args([scene, &picture])
            .env("OOCPT_REPORT", &report)
            .env("OOCPT_SAMPLES_PER_PIXEL", self.samples.to_string())
            .env("OOCPT_TEXTURE_CACHE", &self.cache)
            .stdin(Stdio::null())
            .stdout(keep(&output)?)
            .stderr(keep(&errors)?);
        if !self.device.is_empty() {
            command.env("OOCPT_DEVICE", &self.device);
        }
        let used = process::run(&mut command, self.timeout).context("usdrecord")?;
        if !used.is_success {
            bail!("usdrecord failed: {}", tail(&[&output, &errors]));
        }
        let last = ErrorReport::read_all(&report).context("the host rendered without a report")?.pop();
        let last = last.context("the report is empty")?;
        let usage =
            last.usage.context("the report does not say what was used: the host's OocPT is older than this program")?;
        let warnings = warnings(&errors);
        let picture = Picture::read(&picture)?;
        ensure!(!picture.is_plain(), "the picture shows no texture; the host said: {}", tail(&[&errors]));
        Ok(Run { used, usage, device: last.header.device, warnings, picture })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_render::picture::write;

    /// What a host does that runs this script, with two pictures beside it: one with something on it, one plain.
    fn run(name: &str, script: &str) -> (PathBuf, Result<Run>) {
        let folder = std::env::temp_dir().join(format!("oocpt-record-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        let texture = [0.1, 0.2, 0.3, 1.0, 0.5, 0.2, 0.3, 1.0];
        write(&folder.join("texture.exr"), [2, 1], &texture, &Vec::new()).expect("a temporary file");
        write(&folder.join("plain.exr"), [2, 1], &[0.5; 8], &Vec::new()).expect("a temporary file");
        let program = folder.join("usdrecord");
        let text = format!("#!/bin/sh\ncd {}\nfor last; do :; done\n{script}\n", folder.display());
        std::fs::write(&program, text).expect("a temporary file");
        let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
        std::fs::set_permissions(&program, mode).expect("it is ours");
        let host = Host {
            usdrecord: program.into_os_string(),
            width: 2,
            samples: 3,
            device: String::new(),
            timeout: Duration::from_secs(60),
            folder: folder.clone(),
            cache: "/the/cache".into(),
        };
        let result = host.record(Path::new("scene.usda"));
        (folder, result)
    }

    const HEADER: &str = r#"{"oocptErrorReport":1,"renderer":"r","device":"d","width":2,"height":1,"samplesTarget":3,"maxBounces":0,"seed":0,"geometryBudgetKib":0,"reference":""}"#;
    const USAGE: &str = r#"{"usage":{"secondsTotal":1.5,"gpuPeakBytes":7,"driverPeakBytes":0,"hostBytes":0,"inCore":true,"sceneBytes":0,"textureSceneBytes":9,"textureBytes":0,"textureLoads":0,"textureBytesPaged":0}}"#;

    #[test]
    fn a_run_returns_its_usage_and_the_picture() {
        let script = format!(
            "[ \"$OOCPT_TEXTURE_CACHE $OOCPT_SAMPLES_PER_PIXEL\" = '/the/cache 3' ] || exit 9\n\
             cp texture.exr \"$last\"; printf '%s\\n' '{HEADER}' '{USAGE}' > \"$OOCPT_REPORT\"; echo 'Warning: in F \
             at line 3 of a.cpp -- bad file' >&2"
        );
        let (folder, run) = run("whole", &script);
        let run = run.expect("it renders");
        assert_eq!(
            (run.usage.gpu_peak_bytes, run.usage.texture_scene_bytes, &*run.device),
            (7, 9, "d"),
            "the report's"
        );
        assert_eq!(run.warnings, ["bad file"], "what the host said");
        assert_eq!(run.picture, Picture::read(&folder.join("texture.exr")).expect("it is there"), "the same pixels");
        assert_ne!(run.picture, Picture::read(&folder.join("plain.exr")).expect("it is there"), "not any pixels");
        std::fs::remove_dir_all(folder).expect("it is ours");
    }

    #[test]
    fn a_run_without_a_valid_report_is_an_error() {
        let report = format!("printf '%s\\n' '{HEADER}' '{USAGE}' > \"$OOCPT_REPORT\"");
        for (name, script, reason) in [
            ("fails", "echo no device >&2; exit 1".to_owned(), "usdrecord failed: no device"),
            (
                "plain",
                format!("cp plain.exr \"$last\"; {report}; echo cannot be read >&2"),
                "no texture; the host said: cannot be read",
            ),
            ("none", report.clone(), "cannot read"),
            ("silent", "cp texture.exr \"$last\"".to_owned(), "without a report"),
            (
                "old",
                format!("cp texture.exr \"$last\"; echo '{HEADER}' > \"$OOCPT_REPORT\""),
                "older than this program",
            ),
        ] {
            let (folder, run) = run(name, &script);
            let error = format!("{:#}", run.expect_err(name));
            assert!(error.contains(reason), "{name}: {error}");
            std::fs::remove_dir_all(folder).expect("it is ours");
        }
    }
}
