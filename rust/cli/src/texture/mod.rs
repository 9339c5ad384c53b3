// SPDX-License-Identifier: Apache-2.0
//! `oocpt texture`: texture files and the cache of decoded ones. The work is done inside a Hydra host ([`host`]): what
//! a file is, and by which key renders look for it, is for the host's resolver and the plugin's readers to say.

mod bar;
mod files;
mod host;
mod text;

use anyhow::{Context as _, Result, ensure};
use std::ffi::OsString;
use std::path::PathBuf;

use self::bar::TerminalBar;
use self::host::{TextureAnswer, TextureHost};

/// Options of `oocpt texture`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: TextureCommand,
}

#[derive(clap::Subcommand)]
enum TextureCommand {
    /// Decodes files into the texture cache, so that no render has to. What is there already, or read as it is, is
    /// left alone.
    Convert(ConvertArguments),
    /// Says what files are, how they are read, and what the cache has of them.
    Info(InfoArguments),
}

/// What both take.
#[derive(clap::Args)]
struct CommonArguments {
    /// Texture files, sets of them with `<UDIM>` in their names, folders, or scenes, whose textures are taken as they
    /// are read there.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// `sourceColorSpace` of the textures that will read the files, several after commas; for each the cache keeps
    /// another entry. Scenes say it
    /// themselves.
    #[arg(long, value_delimiter = ',', default_value = "auto")]
    color_space: Vec<String>,
    /// Where the cache is: a folder; empty = the user's own.
    #[arg(long, env = "OOCPT_TEXTURE_CACHE")]
    cache: Option<OsString>,
    /// The host: an `oocpt-texture-host`.
    #[arg(long)]
    host: Option<OsString>,
    /// Files at a time; 0 = as many as cores.
    #[arg(long, default_value_t = 0)]
    jobs: u32,
}

#[derive(clap::Args)]
struct ConvertArguments {
    #[command(flatten)]
    common: CommonArguments,
    /// Draws no progress bar.
    #[arg(long)]
    quiet: bool,
}

#[derive(clap::Args)]
struct InfoArguments {
    #[command(flatten)]
    common: CommonArguments,
    /// Prints a JSON object a line.
    #[arg(long)]
    json: bool,
}

/// Runs the command; fails when one of the files did.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let failed = match &arguments.command {
        TextureCommand::Convert(convert) => {
            let mut bar = TerminalBar::new(!convert.quiet);
            let (mut done, mut bytes) = (0_u64, 0_u64);
            let failed = ask(&convert.common, "convert", |count, answer| {
                bar.step(count, &answer.file);
                match &answer.error {
                    Some(error) => bar.line(&format!("{}: {error}", answer.file)),
                    None => {
                        done += 1;
                        bytes += answer.cache.bytes.unwrap_or(0);
                    }
                }
            })?;
            bar.end();
            println!("{done} files are ready, {}", text::mib(bytes));
            failed
        }
        TextureCommand::Info(info) => {
            // In the order in which they were named, not in which they were done.
            let mut answers = Vec::new();
            let failed = ask(&info.common, "info", |_, answer| answers.push(answer))?;
            answers.sort_by(|a, b| (&a.file, &a.space).cmp(&(&b.file, &b.space)));
            for answer in &answers {
                match info.json {
                    true => println!("{}", serde_json::to_string(answer)?),
                    false => print!("{}", text::describe(answer)),
                }
            }
            failed
        }
    };
    ensure!(failed == 0, "{failed} files cannot be used");
    Ok(())
}

/// Has the host answer for all files; how many failed. `each` gets how many there are in all, and an answer.
fn ask(common: &CommonArguments, command: &str, mut each: impl FnMut(u64, TextureAnswer)) -> Result<u64> {
    let wanted = files::expand(&common.files)?;
    let cache = common.cache.as_deref();
    let mut failed = 0;
    let mut count = wanted.missing.len() as u64;
    for (file, error) in wanted.missing {
        failed += 1;
        each(count, TextureAnswer::failed(&file, &error));
    }
    let pairs = wanted
        .files
        .iter()
        .flat_map(|file| common.color_space.iter().map(move |space| (file.as_str(), space.as_str())));
    let pairs: Vec<(&str, &str)> = pairs.collect();
    if pairs.is_empty() {
        return Ok(failed);
    }
    let host = TextureHost::start(common.host.as_ref(), command, common.jobs, cache).context("oocpt texture")?;
    let missing = count;
    host.ask(&pairs, |line| match line {
        host::HostLine::Count { files } => count = missing + files,
        host::HostLine::Answer(answer) => {
            failed += u64::from(answer.error.is_some());
            each(count, *answer);
        }
    })?;
    Ok(failed)
}
