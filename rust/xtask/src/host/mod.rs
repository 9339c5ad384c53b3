// SPDX-License-Identifier: Apache-2.0
//! A wheel host: a whole OpenUSD with Hydra, put together from pinned wheels in the cache.
//!
//! ```text
//! $OOCPT_CACHE/                       default ~/.cache/oocpt
//!   downloads/*.whl                   as downloaded; checked against the pins on every use
//!   host-25.08/, host-26.03/           appears at once, finished (atomic rename); `.stamp` names its pins
//!     python/bpy/lib/libusd_ms.so     the runtime, its libraries and lib/usd plugins, placed as in the wheel
//!     python/bpy/5.0/python/lib/python3.11/site-packages/{pxr,OpenImageIO,PyOpenColorIO}
//!     dev/pxr-{tf,gf,...}/include     the header wheels ([`headers`])
//!     include/pxr/{tf,gf,...}         symlinks into dev/, as the headers name each other
//!     include/pxr/{base,usd}/...      symlinks into dev/, at OpenUSD's standard paths
//!     include/pxr/external/boost      symlink to the headers of pxr_boost
//!   venv-pip/                         pip to download with, made only when something must be downloaded
//!   venv-host/                        Python 3.11 that imports `pxr` of the host; numpy, pytest
//!   venv-usd/                         Python 3.11 with usd-core, to author scenes; numpy, pytest, OpenEXR, Pillow,
//!                                     OpenImageIO, tifffile
//!   venv-reference/                   the same with Mitsuba 3, made only when references are
//! ```
//! Names of folders are those of the default host; the environments of another end in its version.
//!
//! `include/` has neither `pxr/pxr.h` nor `pxr/imaging`: those are ours, under `cpp/abi`. The host and usd-core never
//! share a process. Only what OpenUSD needs is unpacked (about 350 MB of 840). The wheel is a tool that the
//! user's machine downloads; nothing of it is ever redistributed.

mod headers;
mod python;
mod wheels;

use std::fs::{self, File};
use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result};

pub(crate) use self::python::{HOST_VENV, PythonInterpreter, REFERENCE_VENV, USD_VENV, VenvPlan, find_interpreter};
use self::wheels::{PinnedWheel, WheelRole};
use crate::places::RootFolders;
use crate::process::{run, say};

/// Raised when the layout described above changes.
const LAYOUT: u32 = 1;

/// Libraries of the runtime wheel that OpenUSD and its Python modules load, and its plugins.
const RUNTIME_PREFIXES: &[&str] = &[
    "bpy/lib/libusd_ms",
    "bpy/lib/libosd",
    "bpy/lib/libvulkan",
    "bpy/lib/libopenvdb",
    "bpy/lib/libopenjph",
    "bpy/lib/libMaterialX",
    "bpy/lib/libOpenImageIO",
    "bpy/lib/libOpenColorIO",
    "bpy/lib/libOpenEXR",
    "bpy/lib/libImath",
    "bpy/lib/libIex",
    "bpy/lib/libIlmThread",
    "bpy/lib/libtbb",
    "bpy/lib/usd/",
    "bpy/lib/materialx/",
];

/// Makes sure that the wheel host and both virtual environments exist and match the pins; quick if they do.
///
/// Safe to run from several processes at once: one works, the others wait.
///
/// # Errors
/// A wheel differs from its pin, cannot be fetched or unpacked, or the finished host cannot be imported.
pub(crate) fn prepare(places: &RootFolders, interpreter: &PythonInterpreter) -> Result<()> {
    fs::create_dir_all(&places.cache).with_context(|| format!("cannot create {}", places.cache.display()))?;
    let lock = File::create(places.cache.join(".lock")).context("cannot create the lock of the cache")?;
    lock.lock().context("cannot lock the cache")?;
    unpack(places, interpreter)?;
    python::prepare_venv(places, interpreter, &HOST_VENV)?;
    python::prepare_venv(places, interpreter, &USD_VENV)?;
    check_imports(places)
}

/// Makes sure that an environment which [`prepare`] leaves out exists.
///
/// # Errors
/// A wheel differs from its pin or cannot be fetched.
pub(crate) fn prepare_extra(places: &RootFolders, interpreter: &PythonInterpreter, plan: &VenvPlan) -> Result<()> {
    let lock = File::create(places.cache.join(".lock")).context("cannot create the lock of the cache")?;
    lock.lock().context("cannot lock the cache")?;
    python::prepare_venv(places, interpreter, plan)
}

fn unpack(places: &RootFolders, interpreter: &PythonInterpreter) -> Result<()> {
    let pinned = wheels::with_role(places.wheel, &[WheelRole::Runtime, WheelRole::Headers]);
    let stamp = wheels::stamp(LAYOUT, &pinned);
    if is_stamped(&places.host(), &stamp) {
        return Ok(());
    }
    wheels::fetch(|| python::with_pip(places, interpreter), &places.downloads(), &pinned)?;
    say(format_args!("unpacking the wheel host (OpenUSD {})", places.wheel.usd));
    let part = places.host().with_extension(format!("part-{}", std::process::id()));
    remove(&part)?;
    for wheel in &pinned {
        unpack_wheel(places, interpreter, wheel, &part)?;
    }
    headers::correct(&part, places.wheel)?;
    headers::link(&part)?;
    fs::write(part.join(".stamp"), stamp).context("cannot write the stamp of the host")?;
    remove(&places.host())?;
    fs::rename(&part, places.host()).context("cannot move the finished host into its place")
}

fn unpack_wheel(places: &RootFolders, interpreter: &PythonInterpreter, wheel: &PinnedWheel, part: &Path) -> Result<()> {
    let mut unpack = Command::new(&interpreter.program);
    unpack.args(["-I", "-c", include_str!("unpack_wheel.py")]).arg(places.downloads().join(wheel.file));
    if wheel.role == WheelRole::Runtime {
        let modules = places.wheel.python_folder();
        unpack.arg(part.join("python")).args(RUNTIME_PREFIXES);
        unpack.args([format!("{modules}/pxr/"), format!("{modules}/OpenImageIO/")]);
        unpack.arg(format!("bpy-{}.dist-info/", places.wheel.bpy));
    } else {
        unpack.arg(part.join("dev"));
    }
    run(&mut unpack)
}

/// The host must import before anything is built against it: a missing system library shows here, with its name.
fn check_imports(places: &RootFolders) -> Result<()> {
    let version = places.wheel.version_tuple();
    let check = format!("from pxr import Usd, UsdImagingGL, UsdAppUtils; assert Usd.GetVersion() == {version}");
    let checked = places.host().join(".imports");
    if checked.exists() {
        return Ok(());
    }
    run(Command::new(places.venv_python(HOST_VENV.name)).args(["-I", "-c", &check]))
        .context("the wheel host does not load; the message above names what is missing")?;
    File::create(checked).map(drop).context("cannot note that the host imports")
}

fn is_stamped(folder: &Path, stamp: &str) -> bool {
    fs::read_to_string(folder.join(".stamp")).is_ok_and(|found| found == stamp)
}

fn remove(folder: &Path) -> Result<()> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(error).with_context(|| format!("cannot remove {}", folder.display()))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::places::{WHEEL_HOSTS, WheelHost};

    #[test]
    fn the_book_lists_the_hosts() {
        let repo = RootFolders::from_env().unwrap().repo;
        let read = |file: &str| fs::read_to_string(repo.join(file)).unwrap();
        let page = read("rust/book/src/hosts.md");
        let is_version = |line: &&str| line.starts_with("| 2");
        let listed: Vec<_> =
            page.lines().filter(is_version).map(|line| line.split(" | ").collect::<Vec<_>>()).collect();
        let of_wheels: Vec<_> = listed.iter().filter(|row| row[1].starts_with("`bpy==")).map(|row| &row[..3]).collect();
        let known =
            |host: &WheelHost| [format!("| {}", host.usd), format!("`bpy=={}`", host.bpy), host.python.to_owned()];
        assert_eq!(of_wheels, WHEEL_HOSTS.iter().map(known).collect::<Vec<_>>(), "the wheel hosts");
        // `cpp/abi` serves these runtimes, the shim none that is older than the oldest.
        let number = |usd: &str| usd.trim_start_matches("| ").replace('.', "");
        let served = read("cpp/abi/pxr/pxr.h");
        for host in &WHEEL_HOSTS {
            assert!(served.contains(&format!("OOCPT_ABI_VERSION != {}", number(host.usd))), "{}", host.usd);
        }
        assert_eq!(served.matches("OOCPT_ABI_VERSION != ").count(), WHEEL_HOSTS.len(), "and no other");
        let oldest = listed.iter().map(|row| number(row[0])).min().unwrap();
        assert!(read("cpp/hdOocPT/compat.h").contains(&format!("#if PXR_VERSION < {oldest}\n")), "{oldest}");
    }

    #[test]
    fn a_stamp_must_match_wholly() {
        let folder = std::env::temp_dir().join(format!("xtask-stamp-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        assert!(!is_stamped(&folder, "a"), "no stamp yet");
        fs::write(folder.join(".stamp"), "ab").unwrap();
        assert!(!is_stamped(&folder, "a"), "another stamp");
        assert!(is_stamped(&folder, "ab"), "the same stamp");
        fs::remove_dir_all(&folder).unwrap();
    }
}
