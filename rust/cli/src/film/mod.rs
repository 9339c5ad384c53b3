// SPDX-License-Identifier: Apache-2.0
//! `oocpt film`: parts of films are rendered, and merge to films and pictures, which needs no device.

mod info;
mod render;
mod text;

use anyhow::{Context as _, Result};
use oocpt_film::{FilmPicture, FilmReader, merge, picture};
use oocpt_render::picture::{PictureAttribute, PictureAttributes, write};
use std::path::{Path, PathBuf};

/// Options of `oocpt film`.
#[derive(clap::Args)]
pub(crate) struct FilmArguments {
    #[command(subcommand)]
    command: FilmCommand,
}

#[derive(clap::Subcommand)]
enum FilmCommand {
    /// Has a Hydra host render some of a picture's samples as a part of a film.
    Render(render::RenderArguments),
    /// Merges parts of one film to the bits that one render would have given.
    Merge {
        /// Films of the same picture with other samples.
        #[arg(required = true)]
        parts: Vec<PathBuf>,
        /// The film to write; may be one of the parts.
        #[arg(long)]
        out: PathBuf,
    },
    /// Makes the picture of a film, or of parts that are merged on the way.
    Picture {
        /// Films of the same picture with other samples.
        #[arg(required = true)]
        films: Vec<PathBuf>,
        /// The picture to write, an EXR file.
        #[arg(long)]
        out: PathBuf,
        /// Takes what is there where samples are missing.
        #[arg(long)]
        partial: bool,
    },
    /// Says what film files are.
    Info(info::InfoArguments),
}

/// Runs the command.
pub(crate) fn run(arguments: &FilmArguments) -> Result<()> {
    match &arguments.command {
        FilmCommand::Render(arguments) => render::run(arguments),
        FilmCommand::Merge { parts, out } => {
            merge(parts, out)?;
            let film = FilmReader::open(out)?;
            println!("{}: {}", out.display(), text::summary(film.header(), &film.errors()?));
            Ok(())
        }
        FilmCommand::Picture { films, out, partial } => {
            let picture = picture(films, *partial)?;
            println!("{}", text::summary(&picture.header, &picture.errors));
            save(&picture, out).with_context(|| format!("cannot write {}", out.display()))
        }
        FilmCommand::Info(arguments) => info::run(arguments),
    }
}

fn save(picture: &FilmPicture, out: &Path) -> Result<()> {
    Ok(write(out, picture.header.size(), &picture.rgba, &attributes(picture))?)
}

/// Settings that are attributes of pictures.
const TOLD: [&str; 4] = ["seed", "maxBounces", "pixelFilter", "pixelFilterWidth"];

/// What the picture says of its making, in the words of a render's picture.
#[expect(clippy::cast_precision_loss, reason = "counts are exact below 2^53")]
fn attributes(picture: &FilmPicture) -> PictureAttributes {
    let header = &picture.header;
    let number = |name: &str, number: f64| (name.to_owned(), PictureAttribute::Number(number));
    let text = |name: &str, text: String| (name.to_owned(), PictureAttribute::Text(text));
    let mut all = vec![
        text("renderer", format!("OocPT {}", header.identity.version)),
        text("device", header.devices.iter().map(String::as_str).collect::<Vec<_>>().join("; ")),
        text("scene", header.identity.scene.clone()),
        number("samples", f64::from(picture.samples)),
        number("seconds", header.milliseconds as f64 / 1000.0),
        number("deviceBytes", header.device_bytes as f64),
    ];
    for name in TOLD {
        let Some(value) = header.identity.settings.get(&format!("oocpt:{name}")) else { continue };
        all.push(value.parse().map_or_else(|_text| text(name, value.clone()), |value| number(name, value)));
    }
    if !picture.missing.is_empty() {
        all.push(text("samplesMissing", text::ranges(&picture.missing)));
    }
    if let Some(error) = picture.error() {
        all.push(number("errorEstimate", error.rel_mse));
        all.push(number("errorLow", error.low));
        all.push(number("errorHigh", error.high));
    }
    all
}

#[cfg(test)]
mod tests;
