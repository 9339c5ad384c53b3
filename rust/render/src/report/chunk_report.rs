// SPDX-License-Identifier: Apache-2.0
//! The report about chunks that a render writes at its end if `oocpt:chunkReport` names a file: the chunks, how often
//! each was loaded, how many rays asked for it, and how the number of unfinished paths fell. `oocpt report chunks`
//! draws it.
//!
//! Plain data and JSON. Positions are in world space minus `origin`, in which the chunk instances' boxes are exact in
//! f32. A file that is not such a report is never overwritten: its name may come from a scene of strangers.

use crate::report::error_report::begins_with_or_is_empty;
use serde::{Deserialize, Serialize};
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

/// Longest report that is read, bytes.
const MAX_REPORT_BYTES: u64 = 4 << 30;
/// The version of the format.
pub const VERSION: u32 = 1;
/// The bytes that every report begins with.
const MAGIC: &[u8] = b"{\"oocptChunkReport\":";

/// Rays affine in the pixel position, as [`oocpt_core::CameraRays`] but in f64: with `px, py` in pixels from the lower
/// left corner, `origin = o + px * o_x + py * o_y` and `direction = d + px * d_x + py * d_y`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReportCamera {
    /// Ray origin at pixel position (0, 0).
    pub o: [f64; 3],
    /// Its change per pixel to the right.
    pub o_x: [f64; 3],
    /// Its change per pixel up.
    pub o_y: [f64; 3],
    /// Ray direction at pixel position (0, 0).
    pub d: [f64; 3],
    /// Its change per pixel to the right.
    pub d_x: [f64; 3],
    /// Its change per pixel up.
    pub d_y: [f64; 3],
}

/// A placement of a chunk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReportInstance {
    /// Box: min, max.
    pub bounds: [[f32; 3]; 2],
    /// Index into [`ChunkReport::chunks`].
    pub chunk: u32,
}

/// Size and use of one chunk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReportChunk {
    /// Device bytes of the chunk and of the assets that it needs.
    pub bytes: u64,
    /// Instance records.
    pub records: u64,
    /// Times it was loaded.
    pub loads: u64,
    /// Of these, times it had been on the device before.
    pub reloads: u64,
    /// Visits of rays, all its placements together.
    pub rays: u64,
    /// True if it was on the device at the end.
    pub is_resident: bool,
}

/// The number of unfinished paths at one moment of the render.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReportMoment {
    /// Seconds since the first path started.
    pub seconds: f64,
    /// Paths not finished yet.
    pub paths_left: u64,
}

/// A whole report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChunkReport {
    /// [`VERSION`]; distinguishes such a report from other files.
    #[serde(rename = "oocptChunkReport", default)]
    pub version: u32,
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// World point that is (0, 0, 0) for everything below.
    pub origin: [f64; 3],
    /// The camera.
    pub camera: ReportCamera,
    /// Placements of chunks.
    pub instances: Vec<ReportInstance>,
    /// Chunks.
    pub chunks: Vec<ReportChunk>,
    /// Numbers of unfinished paths, in the order of time.
    pub progress: Vec<ReportMoment>,
}

/// The reasons why a report was not written or read.
#[derive(Debug, thiserror::Error)]
pub enum ChunkReportError {
    /// The file cannot be written or read.
    #[error("chunk report {path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: Error,
    },
    /// The file holds something else.
    #[error("chunk report {path}: {source}")]
    Content {
        /// The file.
        path: PathBuf,
        /// The fault in the content, and its place.
        source: serde_json::Error,
    },
    /// A placement of a chunk that is not there.
    #[error("chunk report {path}: instance {instance} is of chunk {chunk}, of {chunks}")]
    Chunk {
        /// The file.
        path: PathBuf,
        /// The placement.
        instance: usize,
        /// Its chunk.
        chunk: u32,
        /// Chunks there are.
        chunks: usize,
    },
}

impl ChunkReport {
    /// Writes the report as JSON.
    ///
    /// # Errors
    /// [`ChunkReportError::File`], also when the file has something else in it.
    pub fn write(&self, path: &Path) -> Result<(), ChunkReportError> {
        let refused = || Error::new(ErrorKind::AlreadyExists, "the file is no report of chunks and is left as it is");
        let checked = begins_with_or_is_empty(path, MAGIC).and_then(|ours| if ours { Ok(()) } else { Err(refused()) });
        checked.map_err(|source| ChunkReportError::File { path: path.into(), source })?;
        let json = serde_json::to_vec(self);
        let json = json.map_err(|source| ChunkReportError::Content { path: path.into(), source })?;
        oocpt_files::replace(path, &json).map_err(|source| ChunkReportError::File { path: path.into(), source })
    }

    /// Reads a report and checks that its indices are in range.
    ///
    /// # Errors
    /// [`ChunkReportError`] if the file cannot be read, holds something else, or an index is out of range.
    pub fn read(path: &Path) -> Result<Self, ChunkReportError> {
        let json = oocpt_files::read(path, MAX_REPORT_BYTES)
            .map_err(|source| ChunkReportError::File { path: path.into(), source })?;
        let report: Self =
            serde_json::from_slice(&json).map_err(|source| ChunkReportError::Content { path: path.into(), source })?;
        let chunks = report.chunks.len();
        let is_bad = |instance: &ReportInstance| instance.chunk as usize >= chunks;
        match report.instances.iter().position(is_bad) {
            Some(instance) => {
                let chunk = report.instances[instance].chunk;
                Err(ChunkReportError::Chunk { path: path.into(), instance, chunk, chunks })
            }
            None => Ok(report),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> ChunkReport {
        ChunkReport {
            width: 4,
            height: 3,
            camera: ReportCamera { d: [0.1, 0.2, -1.0], ..ReportCamera::default() },
            instances: vec![ReportInstance { bounds: [[0.1; 3], [1.0; 3]], chunk: 1 }],
            chunks: vec![ReportChunk::default(), ReportChunk { loads: 3, rays: u64::MAX, ..ReportChunk::default() }],
            progress: vec![ReportMoment { seconds: 0.5, paths_left: 12 }],
            ..ChunkReport::default()
        }
    }

    #[test]
    fn a_file_that_is_no_report_is_left_as_it_is() {
        let path = std::env::temp_dir().join(format!("oocpt-no-chunk-report-{}", std::process::id()));
        for precious in ["precious", "{\"width\": 3}"] {
            std::fs::write(&path, precious).expect("a temporary file");
            assert!(report().write(&path).is_err(), "refused");
            assert_eq!(std::fs::read_to_string(&path).expect("it is there"), precious, "nothing is lost");
        }
        std::fs::write(&path, "").expect("a temporary file");
        report().write(&path).expect("an empty file is nobody's");
        report().write(&path).expect("a report is written over one of before");
        std::fs::remove_file(path).expect("it is there");
    }

    #[test]
    fn a_chunk_report_round_trips() {
        let path = std::env::temp_dir().join(format!("oocpt-chunk-report-{}.json", std::process::id()));
        report().write(&path).expect("the folder for temporary files can be written");
        let read = ChunkReport::read(&path);
        let mut broken = report();
        broken.instances[0].chunk = 2;
        broken.write(&path).expect("it was written before");
        let refused = ChunkReport::read(&path);
        std::fs::remove_file(&path).expect("it was there");
        assert_eq!(read.expect("a good report"), report(), "bit for bit");
        let message = refused.expect_err("an index out of range").to_string();
        assert!(message.contains("instance 0 is of chunk 2, of 2"), "{message}");
    }
}
