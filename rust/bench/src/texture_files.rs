// SPDX-License-Identifier: Apache-2.0
//! `oocpt bench texture-files`: what texture files cost from the start of a real `usdrecord` to the written picture,
//! without and with the texture cache filled, beside one decode of the same files by `OpenImageIO` alone. The files are
//! noise that does not compress to nothing; they stay in `--work` for the next time. All runs of a row's files must
//! give the same picture, bit for bit.
//!
//! A cold run finds its cache folder empty, a warm one as the run before left it. The files themselves are in the
//! system's page cache either way: disks are not measured. The first row is a tiny file: what a picture costs without
//! textures to speak of.

mod files;
mod process;
mod record;
mod scene;
mod table;

use anyhow::{Context, Result, bail, ensure};
use oocpt_core::stats::RenderUsage;
use serde::Serialize;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

use self::files::{FileKind, ImageTool, TextureFiles};
use self::process::ProcessUsage;
use self::record::{RecordHost, RecordedPicture, RecordedRun};
use super::common::{BenchMachine, ReportOptions};

/// Texels along a side of the first row's file.
const TINY: u32 = 64;
/// What a cold run may take: so many times the decode, and so many seconds more for one file.
const COLD_RATIO: f64 = 1.5;
const COLD_SECS: f64 = 2.0;
/// What a warm run may take, seconds.
const WARM_SECS: f64 = 2.5;

/// Options of `oocpt bench texture-files`.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Texels along a side of the files.
    #[arg(long, value_delimiter = ',', default_value = "2048,4096,8192,16384", value_parser = clap::value_parser!(u32).range(4..=65536))]
    sizes: Vec<u32>,
    /// Kinds of file.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "jpeg,png,tiff,exr")]
    formats: Vec<FileKind>,
    /// Files of a UDIM set on as many quads; 1 = a single file.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(scene::MAX_MEMBERS)))]
    udim: u32,
    /// Folder for files, scenes and caches; files that are there are reused.
    #[arg(long)]
    work: Option<PathBuf>,
    /// Image width, pixels.
    #[arg(long, default_value_t = 256)]
    width: u32,
    /// Samples per pixel.
    #[arg(long, env = "OOCPT_SAMPLES_PER_PIXEL", default_value_t = 4)]
    samples: u32,
    /// Runs of each row.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// Turns the texture cache off; there are only cold runs then.
    #[arg(long)]
    no_cache: bool,
    /// The host: a `usdrecord`.
    #[arg(long)]
    usdrecord: Option<OsString>,
    /// The program that writes and decodes the files.
    #[arg(long)]
    texture_file: Option<OsString>,
    /// Seconds after which a run is ended.
    #[arg(long, default_value_t = 900)]
    timeout: u64,
    #[command(flatten)]
    reported: ReportOptions,
}

/// Files of one size and kind, with an empty cache or a filled one.
#[derive(Debug, Serialize)]
struct Row {
    size: u32,
    kind: &'static str,
    files: usize,
    file_bytes: u64,
    /// `cold` or `warm`.
    cache: &'static str,
    /// Of the whole process, each run.
    run_secs: Vec<f64>,
    /// Of the run with the median time.
    secs: f64,
    cpu_secs: f64,
    peak_bytes: u64,
    /// By the driver's word where it gives one, else by the renderer's.
    device_peak_bytes: u64,
    /// As the renderer says, of the same run.
    usage: RenderUsage,
    /// The folder after the row.
    cache_bytes: u64,
    decode_secs: f64,
    decode_cpu_secs: f64,
    decode_peak_bytes: u64,
    bound_secs: f64,
    holds: bool,
    warnings: Vec<String>,
}

/// Files that were not rendered.
#[derive(Debug, Serialize)]
struct FailedFiles {
    size: u32,
    kind: &'static str,
    message: String,
}

#[derive(Debug, Serialize)]
struct TextureFilesReport {
    bench: &'static str,
    machine: BenchMachine,
    width: u32,
    samples: u32,
    udim: u32,
    rows: Vec<Row>,
    failed: Vec<FailedFiles>,
}

/// Runs the bench.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let work = arguments.work.clone().unwrap_or_else(|| std::env::temp_dir().join("oocpt-texture-files"));
    std::fs::create_dir_all(&work).with_context(|| format!("cannot make {}", work.display()))?;
    let work = std::fs::canonicalize(&work).with_context(|| format!("cannot open {}", work.display()))?;
    let timeout = Duration::from_secs(arguments.timeout);
    let tool = ImageTool::new(arguments.texture_file.as_ref(), timeout);
    let mut host = RecordHost {
        usdrecord: oocpt_command::host::usdrecord(arguments.usdrecord.as_ref()),
        width: arguments.width,
        samples: arguments.samples,
        device: arguments.reported.device.clone(),
        timeout,
        folder: work.join("runs"),
        cache: "0".into(),
    };
    std::fs::create_dir_all(&host.folder).with_context(|| format!("cannot make {}", host.folder.display()))?;
    let mut report = TextureFilesReport {
        bench: "texture-files",
        machine: arguments.reported.machine(None),
        width: arguments.width,
        samples: arguments.samples,
        udim: arguments.udim,
        rows: Vec::new(),
        failed: Vec::new(),
    };
    warm_up(&tool, &host, &work).context("a scene with a tiny texture")?;
    table::print_head(arguments);
    let sizes = || arguments.sizes.iter().flat_map(|size| arguments.formats.iter().map(move |kind| (*size, *kind)));
    for (size, kind) in std::iter::once((TINY, FileKind::Png)).chain(sizes()) {
        let members = if size == TINY { 1 } else { arguments.udim };
        let measured = tool
            .files(&work, kind, size, members)
            .and_then(|files| measure(arguments, &tool, &mut host, &work, &files, (size, kind, members)));
        match measured {
            Ok((rows, device)) => {
                report.machine.set_device(&device);
                report.rows.extend(rows);
            }
            Err(error) => {
                let message = format!("{error:#}");
                println!("{size:>6} {:<5} {message}", kind.name());
                report.failed.push(FailedFiles { size, kind: kind.name(), message });
            }
        }
    }
    println!("on {}", report.machine);
    arguments.reported.write(&report)?;
    ensure!(report.failed.is_empty(), "{} kinds of file did not render", report.failed.len());
    Ok(())
}

/// Brings programs and libraries into the system's page cache, and driver caches to life; not counted.
fn warm_up(tool: &ImageTool, host: &RecordHost, work: &Path) -> Result<()> {
    let files = tool.files(work, FileKind::Png, TINY, 1)?;
    host.record(&write_scene(work, &files, "warm-up", 1)?).map(drop)
}

fn write_scene(work: &Path, files: &TextureFiles, name: &str, members: u32) -> Result<PathBuf> {
    let path = work.join(format!("{name}.usda"));
    std::fs::write(&path, scene::usda(&format!("./{}", files.pattern), members))
        .with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

/// Both rows of the files, printed as they come, and the device's name.
fn measure(
    arguments: &Arguments,
    tool: &ImageTool,
    host: &mut RecordHost,
    work: &Path,
    files: &TextureFiles,
    (size, kind, members): (u32, FileKind, u32),
) -> Result<(Vec<Row>, String)> {
    let scene = write_scene(work, files, &format!("{size}-{}-{members}", kind.name()), members)?;
    let cache = work.join("cache").join(format!("{size}-{}-{members}", kind.name()));
    host.cache = if arguments.no_cache { "0".into() } else { cache.clone().into_os_string() };
    let decode = tool.decode(work, files)?;
    let mut reference = None;
    let mut rows = Vec::new();
    let mut device = String::new();
    let states: &[&'static str] = if arguments.no_cache { &["cold"] } else { &["cold", "warm"] };
    for &state in states {
        let mut runs = Vec::new();
        for _ in 0..arguments.runs {
            if state == "cold" {
                remove(&cache)?;
            }
            let run = host.record(&scene)?;
            same(&mut reference, &run.picture)?;
            runs.push(run);
        }
        let run_secs = runs.iter().map(|run| run.used.secs).collect();
        let run = median(runs).context("no run")?;
        device.clone_from(&run.device);
        let bound_secs = bound(state, members, decode.secs);
        let row = row(run, run_secs, files, decode, (size, kind, state, bound_secs), folder_bytes(&cache));
        table::print_row(&row);
        rows.push(row);
    }
    Ok((rows, device))
}

/// What the issue of textures asks for.
fn bound(state: &str, members: u32, decode_secs: f64) -> f64 {
    match (state, members) {
        ("warm", _) => WARM_SECS,
        (_, 1) => COLD_RATIO * decode_secs + COLD_SECS,
        _ => COLD_RATIO * decode_secs,
    }
}

fn row(
    run: RecordedRun,
    run_secs: Vec<f64>,
    files: &TextureFiles,
    decode: ProcessUsage,
    (size, kind, cache, bound_secs): (u32, FileKind, &'static str, f64),
    cache_bytes: u64,
) -> Row {
    Row {
        size,
        kind: kind.name(),
        files: files.paths.len(),
        file_bytes: files.bytes,
        cache,
        run_secs,
        secs: run.used.secs,
        cpu_secs: run.used.cpu_secs,
        peak_bytes: run.used.peak_bytes,
        device_peak_bytes: run.usage.gpu_peak_bytes.max(run.usage.driver_peak_bytes),
        usage: run.usage,
        cache_bytes,
        decode_secs: decode.secs,
        decode_cpu_secs: decode.cpu_secs,
        decode_peak_bytes: decode.peak_bytes,
        bound_secs,
        holds: run.used.secs <= bound_secs,
        warnings: run.warnings,
    }
}

/// The run with the median time; of an even count, the upper one of the two.
fn median(mut runs: Vec<RecordedRun>) -> Option<RecordedRun> {
    runs.sort_by(|a, b| a.used.secs.total_cmp(&b.used.secs));
    let middle = runs.len() / 2;
    runs.into_iter().nth(middle)
}

/// The first picture becomes the reference, others have to be it.
fn same(reference: &mut Option<RecordedPicture>, picture: &RecordedPicture) -> Result<()> {
    match reference {
        Some(reference) if reference != picture => bail!("two runs of the same files gave different pictures"),
        Some(_) => {}
        None => *reference = Some(picture.clone()),
    }
    Ok(())
}

/// Removes a folder, if it is there.
fn remove(folder: &Path) -> Result<()> {
    match std::fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(error).with_context(|| format!("cannot remove {}", folder.display()))
        }
        _ => Ok(()),
    }
}

/// Bytes of all files below a folder; 0 if there is none.
fn folder_bytes(folder: &Path) -> u64 {
    let Ok(entries) = std::fs::read_dir(folder) else { return 0 };
    let bytes = |entry: std::fs::DirEntry| match entry.metadata() {
        Ok(data) if data.is_dir() => folder_bytes(&entry.path()),
        Ok(data) => data.len(),
        Err(_) => 0,
    };
    entries.filter_map(Result::ok).map(bytes).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_bounds_match_the_stated_ones() {
        assert!((bound("cold", 1, 2.0) - 5.0).abs() < 1e-9, "1.5 times the decode and 2 s");
        assert!((bound("cold", 40, 2.0) - 3.0).abs() < 1e-9, "1.5 times the decode of all");
        assert!((bound("warm", 40, 2.0) - 2.5).abs() < 1e-9, "2.5 s");
    }

    #[test]
    fn clearing_the_cache_removes_its_folder() {
        let folder = std::env::temp_dir().join(format!("oocpt-cold-cache-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("a/b")).expect("a temporary folder");
        std::fs::write(folder.join("a/b/c"), [0; 5]).expect("a temporary file");
        std::fs::write(folder.join("d"), [0; 2]).expect("a temporary file");
        assert_eq!(folder_bytes(&folder), 7, "of all files below");
        remove(&folder).expect("it is ours");
        assert_eq!(folder_bytes(&folder), 0, "gone");
        remove(&folder).expect("what is not there is gone already");
    }
}
