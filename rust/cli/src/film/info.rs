// SPDX-License-Identifier: Apache-2.0
//! `oocpt film info`: what film files say of themselves. Only headers are read, unless all of a file is to be checked.

use super::text;
use anyhow::{Result, ensure};
use oocpt_film::{FilmError, FilmHeader, FilmKind, FilmReader, OctaveError, SampleRange, estimates, missing};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Options of `oocpt film info`.
#[derive(clap::Args)]
pub(crate) struct InfoArguments {
    /// Film files.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Says which of the samples 0..N no file has.
    #[arg(long, value_name = "N")]
    samples: Option<u32>,
    /// Reads all of the files and compares their checksums.
    #[arg(long)]
    check: bool,
    /// Prints a JSON object a line.
    #[arg(long)]
    json: bool,
}

/// What is told of a file.
pub(super) struct FilmFacts {
    file: FilmReader,
    errors: Vec<OctaveError>,
}

impl FilmFacts {
    pub(super) fn read(path: &Path, check: bool) -> Result<Self, FilmError> {
        let file = FilmReader::open(path)?;
        if check {
            file.verify()?;
        }
        let errors = file.errors()?;
        Ok(Self { file, errors })
    }

    fn lines(&self) -> Vec<(String, String)> {
        let FilmHeader { kind, identity, milliseconds, device_bytes, nonfinite, devices, .. } = self.file.header();
        let [_, _, width, height] = identity.request.window;
        let mut lines = vec![
            match kind {
                FilmKind::Sums => ("checkpoint", "its own render goes on from it; it does not merge".to_owned()),
                FilmKind::Exact => ("samples", text::ranges(&self.file.header().samples())),
            },
            ("pixels", format!("{width} x {height} of {} x {}", identity.request.size[0], identity.request.size[1])),
            ("camera", identity.request.camera.clone()),
            ("scene", identity.scene.clone()),
            ("version", identity.version.clone()),
        ];
        for (index, estimate) in estimates(&self.errors).into_iter().enumerate() {
            lines.push(("error", format!("{} at {} samples", text::error(estimate), self.errors[index].samples)));
        }
        if *nonfinite > 0 {
            lines.push(("not finite", format!("{nonfinite} samples")));
        }
        lines.push(("time", format!("{}.{:03} s", milliseconds / 1000, milliseconds % 1000)));
        lines.push(("device memory", text::mib(*device_bytes)));
        lines.extend(devices.iter().map(|device| ("device", device.clone())));
        lines.push(("file", text::mib(self.file.file_bytes())));
        let settings = identity.settings.iter().map(|(key, value)| (key.clone(), value.clone()));
        lines.into_iter().map(|(name, value)| (name.to_owned(), value)).chain(settings).collect()
    }

    /// The file in some lines. It may come from a stranger: no control characters are printed.
    pub(super) fn text(&self) -> String {
        let plain = |text: &str| -> String { text.chars().filter(|c| !c.is_control()).collect() };
        let mut text = format!("{}\n", plain(&self.file.path().display().to_string()));
        for (name, value) in self.lines() {
            text += &format!("    {:<32} {}\n", plain(&name), plain(&value));
        }
        text
    }

    pub(super) fn json(&self) -> Value {
        let estimates = estimates(&self.errors);
        let errors = self.errors.iter().zip(estimates);
        let errors: Vec<Value> = errors
            .map(|(error, estimate)| json!({"samples": error.samples, "estimate": estimate, "worst": error.worst}))
            .collect();
        json!({
            "file": self.file.path(),
            "bytes": self.file.file_bytes(),
            "samples": self.file.header().samples(),
            "header": self.file.header(),
            "errors": errors,
        })
    }

    pub(super) fn samples(&self) -> Vec<SampleRange> {
        self.file.header().samples()
    }
}

/// Runs the command; fails when one of the files cannot be used.
pub(super) fn run(arguments: &InfoArguments) -> Result<()> {
    let mut failed = 0_usize;
    let mut samples = Vec::new();
    for path in &arguments.files {
        match FilmFacts::read(path, arguments.check) {
            Ok(facts) => {
                samples.extend(facts.samples());
                match arguments.json {
                    true => println!("{}", facts.json()),
                    false => print!("{}", facts.text()),
                }
            }
            Err(error) => {
                failed += 1;
                match arguments.json {
                    true => println!("{}", json!({"file": path, "error": error.to_string()})),
                    false => println!("{error}"),
                }
            }
        }
    }
    if let Some(end) = arguments.samples {
        let holes = missing(&samples, end);
        match arguments.json {
            true => println!("{}", json!({"missing": holes})),
            false => println!("missing of 0..{end}: {}", text::ranges(&holes)),
        }
    }
    ensure!(failed == 0, "{failed} files cannot be used");
    Ok(())
}
