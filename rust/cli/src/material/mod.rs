// SPDX-License-Identifier: Apache-2.0
//! `oocpt material show`: the materials of a scene as the renderer compiled them.
//!
//! A Hydra host reads the scene, as for `oocpt doctor --scene`: composition, resolver and the translation of networks
//! are those of its renders. It renders a few pixels, and the renderer writes `oocpt:materialReport` before it opens a
//! device; so materials are shown also if the render fails, with a warning. Hydra passes on only materials that
//! something shows; so that any can be requested by its path, a layer over the file has a triangle that shows it.

mod text;

use anyhow::{Context as _, Result, bail, ensure};
use oocpt_core::material::MaterialText;
use oocpt_render::material_report::MaterialReport;
use serde::Serialize;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

use oocpt_command::host::{HostPicture, temporary, usdrecord};

/// Side of the picture, pixels.
const WIDTH: u32 = 4;
/// Most names of other materials that are suggested if one is not found.
const LIKE: usize = 5;

/// Options of `oocpt material`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: MaterialCommand,
}

#[derive(clap::Subcommand)]
enum MaterialCommand {
    /// Prints a material: its network as it arrived, folded, as bytecode with its cost, and what was left out.
    Show(ShowArguments),
}

#[derive(clap::Args)]
struct ShowArguments {
    /// A USD file.
    scene: PathBuf,
    /// Path of a material; without one, those that something shows are listed with a line each.
    path: Option<String>,
    /// Prints JSON.
    #[arg(long)]
    json: bool,
    /// The host's usdrecord; without, the one in the path.
    #[arg(long, env = "OOCPT_USDRECORD")]
    usdrecord: Option<OsString>,
    /// Seconds after which the host is ended.
    #[arg(long, default_value_t = 600)]
    timeout: u64,
}

/// The materials of a scene for output.
#[derive(Debug, Serialize)]
struct MaterialListing<'a> {
    scene: &'a Path,
    materials: Vec<&'a MaterialText>,
    /// Other warnings of the host: about the material, if one is named.
    warnings: Vec<String>,
}

/// Runs the command.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let MaterialCommand::Show(show) = &arguments.command;
    let (report, mut messages) = ask(show)?;
    let materials: Vec<&MaterialText> = match &show.path {
        None => report.materials.iter().collect(),
        Some(path) => vec![find(&report, path).with_context(|| show.scene.display().to_string())?],
    };
    // Warnings about materials are printed with them.
    messages.retain(|line| !report.materials.iter().any(|material| is_reported(material, line)));
    if let (Some(_), [material]) = (&show.path, &materials[..]) {
        messages.retain(|line| line.contains(&material.path) || !line.starts_with("OocPT: /"));
    }
    let listing = MaterialListing { scene: &show.scene, materials, warnings: messages };
    match (show.json, &listing.materials[..]) {
        (true, _) => println!("{}", serde_json::to_string_pretty(&listing)?),
        (false, [material]) if show.path.is_some() => print!("{}", text::whole(material)),
        (false, materials) => print!("{}", text::list(materials)),
    }
    if !show.json {
        print!("{}", text::warnings("the host said", &listing.warnings));
    }
    Ok(())
}

/// Returns true if a line of the host's is about this material, all of whose warnings are printed.
fn is_reported(material: &MaterialText, line: &str) -> bool {
    let of = line.strip_prefix("OocPT: ").and_then(|line| line.strip_prefix(material.path.as_str()));
    let words = of.and_then(|rest| rest.strip_prefix(": "));
    words.is_some_and(|words| material.warnings.first().is_some_and(|warning| words.starts_with(warning.as_str())))
}

/// Makes a host report the materials; also returns its other warnings.
fn ask(show: &ShowArguments) -> Result<(MaterialReport, Vec<String>)> {
    let file = std::fs::canonicalize(&show.scene).with_context(|| format!("cannot open {}", show.scene.display()))?;
    let folder = temporary("material")?;
    let report = folder.path().join("report.json");
    let file = match &show.path {
        None => file,
        Some(path) => {
            let layer = layer(&file, path)?;
            let over = folder.path().join("over.usda");
            std::fs::write(&over, layer).context("cannot write a layer over the scene")?;
            over
        }
    };
    let usdrecord = usdrecord(show.usdrecord.as_ref());
    let picture = HostPicture {
        file: &file,
        usdrecord: &usdrecord,
        camera: None,
        width: WIDTH,
        variables: vec![
            ("OOCPT_MATERIAL_REPORT", report.clone().into()),
            ("OOCPT_SAMPLES_PER_PIXEL", "1".into()),
            ("OOCPT_MAX_BOUNCES", "0".into()),
        ],
        timeout: Duration::from_secs(show.timeout),
    };
    let rendered = picture.render(folder.path());
    if !report.exists() {
        rendered?;
        bail!(
            "the host rendered without a report of materials: its OocPT is older than this program, or the file's \
             render settings name another one (oocpt:materialReport)"
        );
    }
    let messages = rendered.unwrap_or_else(|error| vec![format!("{error:#}")]);
    Ok((MaterialReport::read(&report)?, messages))
}

/// A layer over `file` with a triangle that shows the material at `path`.
fn layer(file: &Path, path: &str) -> Result<String> {
    let is_name = |name: &str| !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '_');
    let is_path = path.strip_prefix('/').is_some_and(|names| names.split('/').all(is_name));
    ensure!(is_path, "{path:?} is no path of a prim, such as /World/Looks/Wood");
    let name = file.to_str().filter(|name| !name.contains("@@@") && !name.contains(['\n', '\r']));
    let name = name.with_context(|| format!("a layer cannot name {}", file.display()))?;
    Ok(format!(
        "#usda 1.0\n(\n    subLayers = [@@@{name}@@@]\n)\n\
         def Mesh \"OocPT_material_show\" (prepend apiSchemas = [\"MaterialBindingAPI\"])\n{{\n    \
         int[] faceVertexCounts = [3]\n    int[] faceVertexIndices = [0, 1, 2]\n    \
         point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n    \
         uniform token subdivisionScheme = \"none\"\n    rel material:binding = <{path}>\n}}\n"
    ))
}

/// The material of a path.
fn find<'a>(report: &'a MaterialReport, path: &str) -> Result<&'a MaterialText> {
    if let Some(found) = report.materials.iter().find(|material| material.path == path) {
        return Ok(found);
    }
    let name = |path: &str| path.rsplit('/').next().unwrap_or_default().to_ascii_lowercase();
    let wanted = name(path);
    let (like, others): (Vec<&str>, Vec<&str>) = report
        .materials
        .iter()
        .map(|material| material.path.as_str())
        .partition(|path| !wanted.is_empty() && name(path).contains(&wanted));
    let count = report.materials.len();
    let mut shown: Vec<&str> = like.into_iter().chain(others).take(LIKE).collect();
    if count > shown.len() {
        shown.push("...");
    }
    match count {
        0 => bail!("there is no material {path}, and nothing shows another"),
        _ => bail!("there is no material {path}; shown are {count}: {}", shown.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::script::script;

    fn show(path: Option<&str>, usdrecord: &Path) -> ShowArguments {
        let path = path.map(str::to_owned);
        let scene = std::env::current_exe().expect("a file");
        ShowArguments { scene, path, json: false, usdrecord: Some(usdrecord.into()), timeout: 20 }
    }

    #[test]
    fn a_session_layer_binds_the_material_and_rejects_bad_paths() {
        let layer = |path: &str| layer(Path::new("/a b/c@d.usda"), path);
        let text = layer("/World/Looks/Wood_2").expect("a path");
        assert!(text.contains("[@@@/a b/c@d.usda@@@]") && text.contains("</World/Looks/Wood_2>"), "{text}");
        for path in ["", "/", "World", "/a//b", "/a> }", "/a\n", "/a{v=x}b", "/a.b"] {
            let error = layer(path).expect_err("no path");
            assert!(error.to_string().contains("is no path"), "{error}");
        }
        assert!(super::layer(Path::new("/a@@@b"), "/m").is_err(), "it would end the name");
    }

    #[test]
    fn an_unknown_material_lists_similar_names() {
        let material = |path: &str| MaterialText { path: path.to_owned(), ..MaterialText::default() };
        let names = ["/A/Metal", "/B/Wood", "/B/Wood_2", "/C/a", "/C/b", "/C/c", "/C/d"];
        let report = MaterialReport { version: 1, materials: names.map(material).to_vec() };
        assert_eq!(find(&report, "/B/Wood").expect("it is there").path, "/B/Wood");
        let error = find(&report, "/Z/wood").expect_err("it is not").to_string();
        assert_eq!(error, "there is no material /Z/wood; shown are 7: /B/Wood, /B/Wood_2, /A/Metal, /C/a, /C/b, ...");
        let nothing = find(&MaterialReport::default(), "/m").expect_err("nothing is").to_string();
        assert_eq!(nothing, "there is no material /m, and nothing shows another");
    }

    /// A report counts even if the render failed after it; without a report, the reason is one message.
    #[test]
    fn a_written_report_is_used_although_the_host_failed() {
        let report = r#"{"oocptMaterialReport":1,"materials":[{"path":"/m","warnings":["w"]}]}"#;
        let words =
            format!("printf '%s' '{report}' > \"$OOCPT_MATERIAL_REPORT\"; echo 'OocPT: error: no device' >&2; exit 1");
        let program = script("material", &words);
        let (found, messages) = ask(&show(Some("/m"), &program)).expect("a report");
        assert_eq!(found.materials[0].warnings, ["w"]);
        assert!(messages.len() == 1 && messages[0].contains("no device"), "{messages:?}");
        std::fs::remove_file(program).expect("it is there");
        for (words, expected) in [("echo bad layer >&2; exit 1", "bad layer"), ("exit 0", "without a report")] {
            let program = script("no-material", words);
            let error = ask(&show(None, &program)).expect_err("no report");
            assert!(format!("{error:#}").contains(expected), "{error:#}");
            std::fs::remove_file(program).expect("it is there");
        }
    }

    #[test]
    fn warnings_of_a_material_are_not_repeated() {
        let material = MaterialText {
            path: "/m".to_owned(),
            warnings: vec!["a".to_owned(), "b".to_owned()],
            ..MaterialText::default()
        };
        assert!(is_reported(&material, "OocPT: /m: a; b"));
        assert!(
            !is_reported(&material, "OocPT: /m2: a; b")
                && !is_reported(&material, "OocPT: /m/tex: a")
                && !is_reported(&material, "a")
        );
    }
}
