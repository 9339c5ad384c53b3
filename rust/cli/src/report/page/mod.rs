// SPDX-License-Identifier: Apache-2.0
//! `oocpt report html`: one page about one render, or about several beside each other. The page is whole in itself: no
//! script, no network, pictures are inside. All that comes from files is text to it ([`html`]).

mod charts;
mod html;
mod picture;
#[cfg(test)]
mod tests;
mod text;

use anyhow::{Context, Result, bail};
use oocpt_core::stats::ErrorRow;
use oocpt_render::chunk_report::ChunkReport;
use oocpt_render::error_report::ErrorReport;
use oocpt_render::picture::{PictureAttributes, read_attributes};
use picture::EmbeddedPicture;
use std::path::{Path, PathBuf};

/// Renders on one page: a report may come from strangers.
const MAX_REPORTS: usize = 32;

/// Options of `oocpt report html`.
#[derive(clap::Args)]
pub(crate) struct PageArguments {
    /// Reports that `oocpt:report` named (.jsonl), each followed by what belongs to it, if anything: its picture (.png,
    /// .exr) and the report that `oocpt:chunkReport` named (.json). Without a picture that of the same name beside the
    /// report is taken.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// The page.
    #[arg(long, default_value = "report.html")]
    out: PathBuf,
}

/// What the page says of one render.
#[derive(Debug, Default)]
struct PageReport {
    name: String,
    report: ErrorReport,
    picture: Option<EmbeddedPicture>,
    /// What the picture's file says of how it was made.
    attributes: PictureAttributes,
    /// The boxes of its chunks from the camera, by loads and by rays, and words about them.
    chunks: Option<([EmbeddedPicture; 2], String)>,
}

impl PageReport {
    /// The last row that was written.
    fn last(&self) -> Option<&ErrorRow> {
        self.report.rows.last()
    }
}

/// Runs the command.
pub(crate) fn run(arguments: &PageArguments) -> Result<()> {
    let page = html::page(&gather(&arguments.files)?)?;
    let out = &arguments.out;
    std::fs::write(out, page).with_context(|| format!("cannot write {}", out.display()))?;
    println!("{}", out.display());
    Ok(())
}

/// Reads the files, each into the report before it.
fn gather(files: &[PathBuf]) -> Result<Vec<PageReport>> {
    let mut reports: Vec<PageReport> = Vec::new();
    for file in files {
        let kind = file.extension().map(|kind| kind.to_string_lossy().to_ascii_lowercase());
        match (kind.as_deref(), reports.last_mut()) {
            (Some("jsonl"), _) => reports.push(read_report(file)?),
            (Some("png" | "exr"), Some(report)) => set_picture(report, file)?,
            (Some("json"), Some(report)) => report.chunks = Some(picture::of_chunks(&ChunkReport::read(file)?)?),
            (Some("png" | "exr" | "json"), None) => bail!("{}: a report (.jsonl) comes before it", file.display()),
            _ => bail!("{}: no report (.jsonl, .json) and no picture (.png, .exr)", file.display()),
        }
    }
    if reports.len() > MAX_REPORTS {
        bail!("{} reports; a page holds {MAX_REPORTS}", reports.len());
    }
    // What was named wins over what lies beside.
    for (report, file) in reports.iter_mut().zip(files.iter().filter(|file| is_report(file))) {
        let beside = ["exr", "png"].map(|kind| file.with_extension(kind));
        if let (None, Some(beside)) = (&report.picture, beside.iter().find(|path| path.is_file())) {
            set_picture(report, beside)?;
        }
    }
    Ok(reports)
}

fn is_report(file: &Path) -> bool {
    file.extension().is_some_and(|kind| kind.eq_ignore_ascii_case("jsonl"))
}

/// The last render of a report.
fn read_report(file: &Path) -> Result<PageReport> {
    let renders = ErrorReport::read_all(file).with_context(|| format!("cannot read {}", file.display()))?;
    let report = renders.into_iter().next_back().context("no render")?;
    let name = file.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    Ok(PageReport { name, report, ..PageReport::default() })
}

fn set_picture(report: &mut PageReport, file: &Path) -> Result<()> {
    report.picture = Some(picture::of_file(file)?);
    if file.extension().is_some_and(|kind| kind.eq_ignore_ascii_case("exr")) {
        report.attributes = read_attributes(file).with_context(|| format!("cannot read {}", file.display()))?;
    }
    Ok(())
}
