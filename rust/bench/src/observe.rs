// SPDX-License-Identifier: Apache-2.0
//! Reports of error against time that benches write besides: one more render, which counts for nothing else.

use anyhow::{Context, Result};
use oocpt_core::settings::SettingValue;
use oocpt_render::{RenderRequest, Session};
use std::path::{Path, PathBuf};

use super::common::finish;

/// Options of every bench that renders.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct Observe {
    /// Renders once more with a report of error against time to this file (`oocpt report plot` draws it); of a bench
    /// with several rows, one file for each, with the row's name before the extension.
    #[arg(long)]
    pub(crate) report: Option<PathBuf>,
    /// EXR picture for that report to compare with.
    #[arg(long)]
    pub(crate) reference: Option<PathBuf>,
}

impl Observe {
    /// Renders `request` once more with the report of `row`, if one is wanted.
    pub(crate) fn write(&self, session: &Session, request: &RenderRequest, row: &str) -> Result<()> {
        let Some(report) = &self.report else { return Ok(()) };
        let file = of_row(report, row);
        let text = |file: Option<&Path>| {
            SettingValue::Text(file.map_or_else(String::new, |f| f.to_string_lossy().into_owned()))
        };
        session.set_profiling(false);
        session.set_setting("oocpt:report", text(Some(&file)))?;
        session.set_setting("oocpt:reference", text(self.reference.as_deref()))?;
        session.render(request.clone());
        let done = finish(session).with_context(|| format!("the render of {}", file.display()));
        for key in ["oocpt:report", "oocpt:reference"] {
            session.set_setting(key, text(None))?;
        }
        done
    }
}

/// The file of a row: its name goes before the extension, as far as it is fit for a file's name.
fn of_row(file: &Path, row: &str) -> PathBuf {
    if row.is_empty() {
        return file.to_owned();
    }
    let fit: String = row.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
    let stem = file.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let extension = file.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
    file.with_file_name(format!("{stem}-{fit}{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_row_has_a_file_of_its_own() {
        assert_eq!(of_row(Path::new("a/b.jsonl"), ""), Path::new("a/b.jsonl"), "one row, one file");
        assert_eq!(of_row(Path::new("a/b.jsonl"), "29 % sweep"), Path::new("a/b-29---sweep.jsonl"), "one each");
        assert_eq!(of_row(Path::new("b"), "../../cut out"), Path::new("b-------cut-out"), "it stays where it is");
    }
}
