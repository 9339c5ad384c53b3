// SPDX-License-Identifier: Apache-2.0
//! `oocpt report picture`: how a picture was made. EXR files that our own programs write say it in their attributes;
//! for those that a host writes, the report that `oocpt:report` named stands beside them, and its last render is told
//! in the same words.

use anyhow::{Context, Result, ensure};
use oocpt_core::stats::ErrorRow;
use oocpt_render::error_report::ErrorReport;
use oocpt_render::picture::{PictureAttribute, PictureAttributes, read_attributes};
use serde_json::{Map, json};
use std::path::{Path, PathBuf};

/// Options of `oocpt report picture`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// An EXR file, or a report (.jsonl).
    file: PathBuf,
    /// Prints JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let file = &arguments.file;
    let attributes = match file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("jsonl")) {
        true => of_report(file)?,
        false => read_attributes(file).with_context(|| format!("cannot read {}", file.display()))?,
    };
    ensure!(
        !attributes.is_empty(),
        "{}: it does not say how it was made; hosts write none of it into the files of their renders, the report that \
         oocpt:report names has the same numbers",
        file.display()
    );
    if arguments.json {
        let map: Map<String, serde_json::Value> =
            attributes.into_iter().map(|(name, value)| (name, json!(value))).collect();
        println!("{}", serde_json::to_string_pretty(&map)?);
        return Ok(());
    }
    for (name, value) in attributes {
        println!("{name:<16} {value}");
    }
    Ok(())
}

/// What an EXR file would say of the last render of a report.
#[expect(clippy::cast_precision_loss, reason = "counts are exact below 2^53")]
fn of_report(file: &Path) -> Result<PictureAttributes> {
    let renders = ErrorReport::read_all(file).with_context(|| format!("cannot read {}", file.display()))?;
    let last = renders.last().context("no render")?;
    let row = last.rows.last().with_context(|| format!("{}: its last render has no samples", file.display()))?;
    let ErrorRow { samples, seconds, seconds_tracing, rays, estimate, bytes_paged, truth, .. } = row;
    let text = |name: &str, text: &str| {
        (name.to_owned(), PictureAttribute::Text(text.chars().filter(|c| !c.is_control()).take(400).collect()))
    };
    let number = |name: &str, number: f64| (name.to_owned(), PictureAttribute::Number(number));
    let mut all = vec![
        text("renderer", &last.header.renderer),
        text("device", &last.header.device),
        number("seed", f64::from(last.header.seed)),
        number("maxBounces", f64::from(last.header.max_bounces)),
        number("samples", f64::from(*samples)),
        number("seconds", *seconds),
        number("secondsTracing", *seconds_tracing),
        number("rays", *rays as f64),
        number("bytesPaged", *bytes_paged as f64),
    ];
    if let Some(estimate) = estimate {
        all.push(number("errorEstimate", estimate.rel_mse));
        all.push(number("errorLow", estimate.low));
        all.push(number("errorHigh", estimate.high));
    }
    if let Some(truth) = truth {
        all.push(number("errorRelMse", truth.rel_mse));
        all.push(number("errorRmse", truth.rmse));
        all.push(number("errorFlip", truth.flip));
    }
    all.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_report_replaces_missing_exr_attributes() {
        let path = std::env::temp_dir().join(format!("oocpt-sidecar-{}.jsonl", std::process::id()));
        let lines = [
            r#"{"oocptErrorReport":1,"renderer":"OocPT 0","device":"a\u0007b","width":4,"height":3,"samplesTarget":2,"maxBounces":5,"seed":9,"geometryBudgetKib":0,"reference":""}"#,
            r#"{"samples":1,"seconds":0.5,"secondsTracing":0.25,"rays":10,"estimate":null,"worst":[],"bytesPaged":0}"#,
            r#"{"samples":2,"seconds":1.0,"secondsTracing":0.75,"rays":20,"estimate":{"relMse":0.1,"low":0.05,"high":0.2},"worst":[],"bytesPaged":3}"#,
        ];
        std::fs::write(&path, lines.join("\n")).expect("a temporary file");
        let said = of_report(&path).expect("a report");
        let find = |name: &str| said.iter().find(|(have, _)| have == name).map(|(_, value)| value.clone());
        assert_eq!(find("device"), Some(PictureAttribute::Text("ab".into())), "no control characters");
        for (name, number) in [("samples", 2.0), ("secondsTracing", 0.75), ("rays", 20.0), ("seed", 9.0)] {
            assert_eq!(find(name), Some(PictureAttribute::Number(number)), "{name} of the last row");
        }
        assert!(find("errorHigh").is_some() && find("errorFlip").is_none(), "{said:?}");
        std::fs::remove_file(path).expect("it is there");
    }
}
