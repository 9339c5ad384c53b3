// SPDX-License-Identifier: Apache-2.0
//! `oocpt film render`: a Hydra host renders some of a picture's samples, and leaves them as a part of a film.
//!
//! The host takes the place of this process, so it gets its signals and gives its exit status.

use anyhow::{Context as _, Result, bail};
use oocpt_core::settings::{SampleSpan, SettingValue, Settings};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Options of `oocpt film render`.
#[derive(clap::Args)]
pub(crate) struct RenderArguments {
    /// USD file.
    scene: PathBuf,
    /// Samples of each pixel, A..B: of a picture of B samples all but the first A.
    #[arg(long, value_name = "A..B", value_parser = span)]
    samples: SampleSpan,
    /// The part of the film.
    #[arg(long, value_name = "PART")]
    out: PathBuf,
    /// Camera; without, the one that usdrecord takes.
    #[arg(long)]
    camera: Option<String>,
    /// Width of the picture in pixels; the height follows from the camera.
    #[arg(long, default_value_t = 960, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    width: u32,
    /// Any other setting, "oocpt:" may be left out; may be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = setting)]
    settings: Vec<String>,
    /// The picture of these samples alone; without, PART.exr.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// The host's usdrecord; without, the one in the path.
    #[arg(long, env = "OOCPT_USDRECORD")]
    usdrecord: Option<OsString>,
    /// More flags of usdrecord.
    #[arg(last = true, value_name = "FLAGS")]
    flags: Vec<OsString>,
}

fn span(text: &str) -> Result<SampleSpan> {
    let span = SampleSpan::named(text).filter(|span| !span.is_empty());
    span.with_context(|| format!("{text:?} is not A..B, with A below B and B at most 2^24"))
}

/// A setting as given, if there is such a one.
fn setting(text: &str) -> Result<String> {
    let Some((name, value)) = text.split_once('=') else { bail!("{text:?} is not KEY=VALUE") };
    Settings::default().set(Settings::key_named(name)?, SettingValue::Text(value.to_owned()))?;
    Ok(text.to_owned())
}

/// The command that renders.
fn command(arguments: &RenderArguments) -> Result<Command> {
    let absolute = |path: &Path| std::path::absolute(path).with_context(|| path.display().to_string());
    let out = absolute(&arguments.out)?;
    let picture = arguments.picture.clone().unwrap_or_else(|| {
        let mut name = arguments.out.clone().into_os_string();
        name.push(".exr");
        name.into()
    });
    let mut command = Command::new(oocpt_command::host::usdrecord(arguments.usdrecord.as_ref()));
    command
        .args(["--renderer", "OocPT", "--disableGpu", "--imageWidth", &arguments.width.to_string()])
        .args(arguments.camera.iter().flat_map(|camera| ["--camera", camera]))
        .args(arguments.settings.iter().flat_map(|setting| ["--set", setting]))
        .args(&arguments.flags)
        .arg(absolute(&arguments.scene)?)
        .arg(absolute(&picture)?)
        // Settings of the machine, which no scene sets: every host takes them from here.
        .env("OOCPT_FILM_PART", out)
        .env("OOCPT_SAMPLE_RANGE", arguments.samples.to_string());
    Ok(command)
}

/// Has the part rendered; returns only if the host cannot be started.
pub(crate) fn run(arguments: &RenderArguments) -> Result<()> {
    let mut command = command(arguments)?;
    let error = replaced_by(&mut command);
    let program = command.get_program().display().to_string();
    Err(error).with_context(|| {
        format!(
            "cannot start the Hydra host {program}: install a usdrecord, name one by --usdrecord, or in the clone: eval \
             \"$(cargo xtask env)\""
        )
    })
}

#[cfg(unix)]
fn replaced_by(command: &mut Command) -> std::io::Error {
    use std::os::unix::process::CommandExt as _;
    command.exec()
}

#[cfg(not(unix))]
fn replaced_by(command: &mut Command) -> std::io::Error {
    match command.status() {
        Ok(status) => std::process::exit(status.code().unwrap_or(1)),
        Err(error) => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    #[derive(clap::Parser)]
    struct Line {
        #[command(flatten)]
        arguments: RenderArguments,
    }

    fn words(line: &[&str]) -> Result<Vec<String>> {
        let line = Line::try_parse_from([&["render"], line].concat())?;
        let command = command(&line.arguments)?;
        let words = command.get_args().map(|word| word.to_string_lossy().into_owned());
        let variables = command
            .get_envs()
            .filter_map(|(name, value)| Some(format!("{}={}", name.to_string_lossy(), value?.to_string_lossy())));
        Ok(words.chain(variables).collect())
    }

    #[test]
    fn a_part_is_what_a_host_renders_with_these_settings() {
        let line =
            ["/s.usda", "--samples", "3..8", "--out", "/p", "--width", "64", "--camera", "/C", "--set", "seed=7"];
        let told = words(&[&line[..], &["--", "--disableCameraLight"]].concat()).expect("a command");
        let expected = [
            "--renderer",
            "OocPT",
            "--disableGpu",
            "--imageWidth",
            "64",
            "--camera",
            "/C",
            "--set",
            "seed=7",
            "--disableCameraLight",
            "/s.usda",
            "/p.exr",
            "OOCPT_FILM_PART=/p",
            "OOCPT_SAMPLE_RANGE=3..8",
        ];
        assert_eq!(told, expected);
    }

    #[test]
    fn wrong_samples_and_settings_are_refused_before_a_host_starts() {
        let with = |samples: &str, setting: &str| words(&["s", "--samples", samples, "--out", "p", "--set", setting]);
        assert!(with("3..8", "seed=7").is_ok(), "a part");
        for samples in ["8", "8..3", ""] {
            assert!(with(samples, "seed=7").is_err(), "{samples}");
        }
        let refused = with("3..8", "sed=7").expect_err("no such setting").to_string();
        assert!(refused.contains("oocpt:seed"), "{refused}");
        assert!(with("3..8", "seed=many").is_err() && with("3..8", "seed").is_err(), "no value");
    }
}
