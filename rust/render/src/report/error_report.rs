// SPDX-License-Identifier: Apache-2.0
//! The report of error over time that `oocpt:report` names. Each line is a JSON object: the first describes the render,
//! the second lists what it is made of ([`RenderInventory`]); then comes an [`ErrorRow`] at each power of two of the
//! samples and at the end, and the last line lists what was used ([`RenderUsage`]). `oocpt report plot` draws it.
//!
//! Every line is written whole and at once: a render that is killed leaves all lines up to then. The first render of a
//! session empties the file, later ones append, each with its own [`ErrorReportHeader`]. A file that is not a report is
//! never overwritten: its name may come from a scene of strangers.

use oocpt_core::inventory::RenderInventory;
use oocpt_core::stats::{ErrorRow, RenderUsage};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fs::File;
use std::io::{BufRead as _, BufReader, Error, ErrorKind, Read as _, Result, Write as _};
use std::path::Path;

/// The version of the format.
pub const VERSION: u32 = 1;
/// Longest report that is read, bytes; a report is data from strangers.
const MAX_REPORT_BYTES: u64 = 64 << 20;
/// The bytes that every report begins with.
const MAGIC: &[u8] = b"{\"oocptErrorReport\":";

/// The first line of a render: the renderer, the picture and its settings.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ErrorReportHeader {
    /// [`VERSION`]; identifies the first line of a render.
    pub oocpt_error_report: u32,
    /// The renderer's version.
    pub renderer: String,
    /// Name of the device.
    pub device: String,
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
    /// Requested samples per pixel.
    pub samples_target: u32,
    /// Indirect bounces.
    pub max_bounces: u32,
    /// Seed.
    pub seed: u32,
    /// Cap on geometry in KiB; 0 = none.
    pub geometry_budget_kib: u32,
    /// The reference picture, empty = none.
    pub reference: String,
}

/// The line that lists what a render is made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct InventoryLine<'a> {
    pub(crate) inventory: Cow<'a, RenderInventory>,
}

/// The line that lists what a render has used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct UsageLine {
    pub(crate) usage: RenderUsage,
}

/// One render of a report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ErrorReport {
    /// The renderer, the picture and its settings.
    pub header: ErrorReportHeader,
    /// The parts of the render and those left out; `None` if it ended before its passes were compiled.
    pub inventory: Option<RenderInventory>,
    /// Ascending samples.
    pub rows: Vec<ErrorRow>,
    /// The time and memory used; `None` if the render did not come to an end.
    pub usage: Option<RenderUsage>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum ReportLine {
    Header(ErrorReportHeader),
    Inventory(InventoryLine<'static>),
    Usage(UsageLine),
    Row(Box<ErrorRow>),
}

impl ErrorReport {
    /// Reads all renders of a file, in the order in which they were made. A last line that was cut off is left out.
    ///
    /// # Errors
    /// The file cannot be read, is longer than 64 MiB, or has another line that is no part of such a report.
    pub fn read_all(path: &Path) -> Result<Vec<Self>> {
        let mut reports: Vec<Self> = Vec::new();
        let mut broken = None;
        for (number, line) in BufReader::new(oocpt_files::open(path)?.take(MAX_REPORT_BYTES)).lines().enumerate() {
            let line = line?;
            if let Some(error) = broken.take() {
                return Err(error);
            }
            match (serde_json::from_str(&line), reports.last_mut()) {
                (Ok(ReportLine::Header(header)), _) => reports.push(Self { header, ..Self::default() }),
                (Ok(ReportLine::Inventory(line)), Some(report)) => report.inventory = Some(line.inventory.into_owned()),
                (Ok(ReportLine::Row(row)), Some(report)) => report.rows.push(*row),
                (Ok(ReportLine::Usage(line)), Some(report)) => report.usage = Some(line.usage),
                (Ok(ReportLine::Row(_) | ReportLine::Inventory(_) | ReportLine::Usage(_)), None) => {
                    return Err(bad(path, number, "a row before the first render"));
                }
                (Err(error), _) => broken = Some(bad(path, number, &error.to_string())),
            }
        }
        if reports.is_empty() {
            return Err(broken.unwrap_or_else(|| bad(path, 0, "no render")));
        }
        Ok(reports)
    }
}

fn bad(path: &Path, line: usize, what: &str) -> Error {
    Error::new(ErrorKind::InvalidData, format!("{}, line {}: {what}", path.display(), line + 1))
}

/// Appends to a report.
#[derive(Debug)]
pub(crate) struct ReportWriter {
    file: File,
}

impl ReportWriter {
    /// Begins a render; empties the file first when `is_first`. Fails if the file holds something else.
    pub(crate) fn begin(path: &Path, is_first: bool, header: &ErrorReportHeader) -> Result<Self> {
        if !begins_with_or_is_empty(path, MAGIC)? {
            return Err(Error::new(ErrorKind::AlreadyExists, "the file is no report of errors and is left as it is"));
        }
        let mut writer = Self { file: oocpt_files::append(path, is_first)? };
        writer.line(header)?;
        Ok(writer)
    }

    /// Appends `value` as one line.
    pub(crate) fn line(&mut self, value: &impl Serialize) -> Result<()> {
        let mut text = serde_json::to_string(value)?;
        text.push('\n');
        self.file.write_all(text.as_bytes())
    }
}

/// Returns true if a report that begins with `magic` may be written to `path`, because the file is one, is empty or
/// does not exist.
pub(crate) fn begins_with_or_is_empty(path: &Path, magic: &[u8]) -> Result<bool> {
    let mut start = Vec::new();
    match oocpt_files::open(path) {
        Ok(file) => file.take(magic.len() as u64).read_to_end(&mut start)?,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(true),
        Err(error) => return Err(error),
    };
    Ok(start.is_empty() || start == magic)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A setting may name anything: a pipe would hang the host for ever.
    #[cfg(unix)]
    #[test]
    fn no_report_is_written_to_a_pipe() {
        let path = std::env::temp_dir().join(format!("oocpt-report-pipe-{}", std::process::id()));
        assert!(std::process::Command::new("mkfifo").arg(&path).status().expect("mkfifo").success());
        let said = [
            ReportWriter::begin(&path, true, &header(1)).expect_err("a pipe").to_string(),
            ErrorReport::read_all(&path).expect_err("a pipe").to_string(),
            crate::report::chunk_report::ChunkReport::default().write(&path).expect_err("a pipe").to_string(),
            crate::report::material_report::MaterialReport { version: 1, materials: Vec::new() }
                .write(&path)
                .expect_err("a pipe")
                .to_string(),
            crate::film::picture::write(&path, [1, 1], &[0.0; 4], &Vec::new()).expect_err("a pipe").to_string(),
            crate::film::picture::read_attributes(&path).expect_err("a pipe").to_string(),
        ];
        std::fs::remove_file(&path).expect("it is there, as it was");
        for said in said {
            assert!(said.contains("is a pipe, not a file"), "{said}");
        }
    }

    fn header(seed: u32) -> ErrorReportHeader {
        ErrorReportHeader { oocpt_error_report: VERSION, width: 4, height: 3, seed, ..ErrorReportHeader::default() }
    }

    #[test]
    fn a_file_that_is_no_report_is_left_as_it_is() {
        let path = std::env::temp_dir().join(format!("oocpt-no-report-{}", std::process::id()));
        std::fs::write(&path, "precious").expect("a temporary file");
        for is_first in [true, false] {
            assert!(ReportWriter::begin(&path, is_first, &header(1)).is_err(), "refused");
        }
        assert_eq!(std::fs::read_to_string(&path).expect("it is there"), "precious", "nothing is lost");
        std::fs::remove_file(path).expect("it is there");
    }

    #[test]
    fn error_rows_round_trip_and_a_truncated_line_is_skipped() {
        let path = std::env::temp_dir().join(format!("oocpt-report-{}.jsonl", std::process::id()));
        let row = |samples| ErrorRow { samples, seconds: 0.5, ..ErrorRow::default() };
        for (seed, is_first) in [(7, true), (1, true), (2, false)] {
            let mut writer = ReportWriter::begin(&path, is_first, &header(seed)).expect("a temporary file");
            let inventory = RenderInventory { max_levels: seed, ..RenderInventory::default() };
            writer.line(&InventoryLine { inventory: Cow::Borrowed(&inventory) }).expect("a line");
            writer.line(&row(1)).expect("a line");
            writer.line(&row(2)).expect("a line");
            writer
                .line(&UsageLine { usage: RenderUsage { gpu_peak_bytes: seed.into(), ..RenderUsage::default() } })
                .expect("a line");
        }
        let mut file = std::fs::OpenOptions::new().append(true).open(&path).expect("it is there");
        file.write_all(b"{\"samples\":4,\"sec").expect("half a line");
        let reports = ErrorReport::read_all(&path).expect("a report");
        assert_eq!(reports.len(), 2, "the first render of a session empties the file, the next one goes on");
        assert_eq!(reports[0].header, header(1), "what was rendered");
        assert_eq!(reports[1].rows, [row(1), row(2)], "whole rows");
        let levels = |report: &ErrorReport| report.inventory.as_ref().map(|inventory| inventory.max_levels);
        assert_eq!((levels(&reports[0]), levels(&reports[1])), (Some(1), Some(2)), "each with what it is made of");
        let peak = |report: &ErrorReport| report.usage.as_ref().map(|usage| usage.gpu_peak_bytes);
        assert_eq!((peak(&reports[0]), peak(&reports[1])), (Some(1), Some(2)), "each with what it used");
        file.write_all(b"\n{}\n").expect("more");
        assert!(ErrorReport::read_all(&path).is_err(), "a broken line in the middle is no accident");
        std::fs::remove_file(path).expect("it is there");
    }
}
