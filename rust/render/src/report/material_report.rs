// SPDX-License-Identifier: Apache-2.0
//! The report that `oocpt:materialReport` names: every material of the scene as readable text, in one JSON object.
//! `oocpt material show` reads it.
//!
//! A file that is not such a report is never overwritten: its name may come from a scene of strangers.

use crate::report::error_report::begins_with_or_is_empty;
use oocpt_core::material::{MaterialText, describe};
use oocpt_core::scene::SceneDb;
use serde::{Deserialize, Serialize};
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

/// The version of the format.
pub const VERSION: u32 = 1;
/// The bytes that every report begins with.
const MAGIC: &[u8] = b"{\"oocptMaterialReport\":";
/// Longest report that is read, bytes.
const MAX_REPORT_BYTES: u64 = 1 << 30;

/// All materials of a scene, whether a mesh shows them or not.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MaterialReport {
    /// [`VERSION`]; distinguishes such a report from other files.
    #[serde(rename = "oocptMaterialReport", default)]
    pub version: u32,
    /// The materials in the order of their paths.
    #[serde(default)]
    pub materials: Vec<MaterialText>,
}

/// The reasons why a report was not written or read.
#[derive(Debug, thiserror::Error)]
pub enum MaterialReportError {
    /// The file cannot be written or read, or holds something else.
    #[error("material report {path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: Error,
    },
    /// The report is of another version.
    #[error("material report {path}: version {version} is not known")]
    Version {
        /// The file.
        path: PathBuf,
        /// The version of the report.
        version: u32,
    },
}

impl MaterialReport {
    /// Describes the materials of a scene; compiles each once more.
    #[must_use]
    pub fn of(scene: &SceneDb) -> Self {
        Self { version: VERSION, materials: scene.materials().map(describe).collect() }
    }

    /// Writes the report.
    ///
    /// # Errors
    /// [`MaterialReportError::File`], also if the file holds something else.
    pub fn write(&self, path: &Path) -> Result<(), MaterialReportError> {
        let refused =
            || Error::new(ErrorKind::AlreadyExists, "the file is no report of materials and is left as it is");
        begins_with_or_is_empty(path, MAGIC)
            .and_then(|ours| if ours { Ok(()) } else { Err(refused()) })
            .and_then(|()| Ok(serde_json::to_vec(self)?))
            .and_then(|json| oocpt_files::replace(path, &json))
            .map_err(|source| MaterialReportError::File { path: path.into(), source })
    }

    /// Reads a report.
    ///
    /// # Errors
    /// [`MaterialReportError`] if the file cannot be read, holds something else or is of another version.
    pub fn read(path: &Path) -> Result<Self, MaterialReportError> {
        let fail = |source: Error| MaterialReportError::File { path: path.into(), source };
        let json = oocpt_files::read(path, MAX_REPORT_BYTES).map_err(fail)?;
        let report: Self = serde_json::from_slice(&json).map_err(|error| fail(error.into()))?;
        if report.version != VERSION {
            return Err(MaterialReportError::Version { path: path.into(), version: report.version });
        }
        Ok(report)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn material_reports_round_trip_and_spare_other_files() {
        let path = std::env::temp_dir().join(format!("oocpt-material-report-{}", std::process::id()));
        let text = MaterialText { path: "/m \"a\"".to_owned(), lookups: 3, ..MaterialText::default() };
        let report = MaterialReport { version: VERSION, materials: vec![text] };
        // The second time overwrites the first.
        for _ in 0..2 {
            report.write(&path).expect("a temporary file");
            assert_eq!(MaterialReport::read(&path).expect("a report"), report);
        }
        MaterialReport { version: 9, ..report.clone() }.write(&path).expect("a temporary file");
        assert!(matches!(MaterialReport::read(&path), Err(MaterialReportError::Version { version: 9, .. })));
        std::fs::write(&path, "precious").expect("a temporary file");
        let refused = report.write(&path).expect_err("another file");
        assert!(refused.to_string().contains("left as it is"), "{refused}");
        assert_eq!(std::fs::read_to_string(&path).expect("it is there"), "precious");
        assert!(matches!(MaterialReport::read(&path), Err(MaterialReportError::File { .. })));
        std::fs::remove_file(&path).expect("it is ours");
    }
}
