// SPDX-License-Identifier: Apache-2.0
//! The wheel host: a whole OpenUSD 25.08 with Hydra, put together from pinned wheels in the cache.
//!
//! ```text
//! $OOCPT_CACHE/                       default ~/.cache/oocpt
//!   downloads/*.whl                   as downloaded; checked against the pins on every use
//!   host-25.08/                       appears at once, finished (atomic rename); `.stamp` names its pins
//!     python/bpy/lib/libusd_ms.so     the runtime, its libraries and lib/usd plugins, placed as in the wheel
//!     python/bpy/5.0/python/lib/python3.11/site-packages/{pxr,OpenImageIO,PyOpenColorIO}
//!     dev/pxr-{tf,gf,...}/include     the header wheels, untouched
//!     include/pxr/{tf,gf,...}         symlinks into dev/, as the headers name each other
//!     include/pxr/{base,usd}/...      symlinks into dev/, at OpenUSD's standard paths
//!     include/pxr/external/boost      symlink to the headers of pxr_boost
//!   venv-pip/                         pip to download with, made only when something must be downloaded
//!   venv-host/                        Python 3.11 that imports `pxr` of the host; numpy, pytest
//!   venv-usd/                         Python 3.11 with usd-core, to author scenes; numpy, pytest, OpenEXR, Pillow,
//!                                     OpenImageIO, tifffile
//!   venv-reference/                   the same with Mitsuba 3, made only when references are
//! ```
//! `include/` has neither `pxr/pxr.h` nor `pxr/imaging`: those are ours, under `cpp/abi/25.08`. The host and usd-core
//! never share a process. Only what OpenUSD needs is unpacked (about 350 MB of 840). The wheel is a tool that the
//! user's machine downloads; nothing of it is ever redistributed.

mod python;
mod wheels;

use std::fs::{self, File};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result, ensure};

pub(crate) use self::python::{HOST_VENV, PythonInterpreter, REFERENCE_VENV, USD_VENV, VenvPlan, find_interpreter};
use self::wheels::{PinnedWheel, WheelRole};
use crate::places::RootFolders;
use crate::process::{run, say};

/// Raised when the layout described above changes.
const LAYOUT: u32 = 1;

/// Members of the runtime wheel that OpenUSD and its Python modules load.
const RUNTIME_PREFIXES: &[&str] = &[
    "bpy/lib/libusd_ms",
    "bpy/lib/libosd",
    "bpy/lib/libvulkan",
    "bpy/lib/libopenvdb",
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
    "bpy/5.0/python/lib/python3.11/site-packages/pxr/",
    "bpy/5.0/python/lib/python3.11/site-packages/OpenImageIO/",
    "bpy-5.0.1.dist-info/",
];

/// Header libraries and the folder of OpenUSD's source tree that each is included from.
const HEADER_FOLDERS: &[(&str, &str)] = &[
    ("arch", "base"),
    ("gf", "base"),
    ("js", "base"),
    ("plug", "base"),
    ("tf", "base"),
    ("trace", "base"),
    ("ts", "base"),
    ("vt", "base"),
    ("work", "base"),
    ("ar", "usd"),
    ("kind", "usd"),
    ("sdf", "usd"),
    ("boost", "external"),
];

/// Makes sure that the wheel host and both virtual environments are there and match the pins; quick when they are.
///
/// Safe to run from several processes at once: one works, the others wait.
///
/// # Errors
/// If a wheel differs from its pin, cannot be fetched or unpacked, or if the finished host cannot be imported.
pub(crate) fn prepare(places: &RootFolders, interpreter: &PythonInterpreter) -> Result<()> {
    fs::create_dir_all(&places.cache).with_context(|| format!("cannot create {}", places.cache.display()))?;
    let lock = File::create(places.cache.join(".lock")).context("cannot create the lock of the cache")?;
    lock.lock().context("cannot lock the cache")?;
    unpack(places, interpreter)?;
    python::prepare_venv(places, interpreter, &HOST_VENV)?;
    python::prepare_venv(places, interpreter, &USD_VENV)?;
    check_imports(places)
}

/// Makes sure that an environment is there that [`prepare`] leaves out.
///
/// # Errors
/// If a wheel differs from its pin or cannot be fetched.
pub(crate) fn prepare_extra(places: &RootFolders, interpreter: &PythonInterpreter, plan: &VenvPlan) -> Result<()> {
    let lock = File::create(places.cache.join(".lock")).context("cannot create the lock of the cache")?;
    lock.lock().context("cannot lock the cache")?;
    python::prepare_venv(places, interpreter, plan)
}

fn unpack(places: &RootFolders, interpreter: &PythonInterpreter) -> Result<()> {
    let pinned = wheels::with_role(&[WheelRole::Runtime, WheelRole::Headers]);
    let stamp = wheels::stamp(LAYOUT, &pinned);
    if is_stamped(&places.host(), &stamp) {
        return Ok(());
    }
    wheels::fetch(|| python::with_pip(places, interpreter), &places.downloads(), &pinned)?;
    say("unpacking the wheel host (OpenUSD 25.08)");
    let part = places.cache.join(format!("host-25.08.part-{}", std::process::id()));
    remove(&part)?;
    for wheel in &pinned {
        unpack_wheel(places, interpreter, wheel, &part)?;
    }
    link_headers(&part)?;
    fs::write(part.join(".stamp"), stamp).context("cannot write the stamp of the host")?;
    remove(&places.host())?;
    fs::rename(&part, places.host()).context("cannot move the finished host into its place")
}

fn unpack_wheel(places: &RootFolders, interpreter: &PythonInterpreter, wheel: &PinnedWheel, part: &Path) -> Result<()> {
    let mut unpack = Command::new(&interpreter.program);
    unpack.args(["-I", "-c", include_str!("unpack_wheel.py")]).arg(places.downloads().join(wheel.file));
    if wheel.role == WheelRole::Runtime {
        unpack.arg(part.join("python")).args(RUNTIME_PREFIXES);
    } else {
        unpack.arg(part.join("dev"));
    }
    run(&mut unpack)
}

/// Puts the header libraries below `host/include`, at the paths that they use among themselves and at OpenUSD's own.
fn link_headers(host: &Path) -> Result<()> {
    for (library, folder) in HEADER_FOLDERS {
        let headers = format!("dev/pxr-{library}/include/pxr/{library}");
        ensure!(host.join(&headers).is_dir(), "the wheel of pxr-{library}-dev holds no {headers}");
        let pxr = host.join("include/pxr");
        fs::create_dir_all(pxr.join(folder)).context("cannot create the include folder")?;
        link(&format!("../../{headers}"), &pxr.join(library))?;
        link(&format!("../../../{headers}"), &pxr.join(folder).join(library))?;
    }
    Ok(())
}

fn link(target: &str, at: &Path) -> Result<()> {
    symlink(target, at).with_context(|| format!("cannot link {}", at.display()))?;
    ensure!(at.is_dir(), "{} leads nowhere", at.display());
    Ok(())
}

/// The host must import before anything is built against it: a missing system library shows here, with its name.
fn check_imports(places: &RootFolders) -> Result<()> {
    let check = "from pxr import Usd, UsdImagingGL, UsdAppUtils; assert Usd.GetVersion() == (0, 25, 8)";
    let checked = places.host().join(".imports");
    if checked.exists() {
        return Ok(());
    }
    run(Command::new(places.venv_python(HOST_VENV.name)).args(["-I", "-c", check]))
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

    #[test]
    fn headers_appear_at_both_paths() {
        let host = std::env::temp_dir().join(format!("xtask-headers-{}", std::process::id()));
        for (library, _) in HEADER_FOLDERS {
            let folder = host.join(format!("dev/pxr-{library}/include/pxr/{library}"));
            fs::create_dir_all(&folder).unwrap();
            fs::write(folder.join("api.h"), *library).unwrap();
        }
        link_headers(&host).unwrap();
        for path in ["tf/api.h", "base/tf/api.h", "usd/sdf/api.h", "external/boost/api.h"] {
            assert!(host.join("include/pxr").join(path).is_file(), "{path} must resolve");
        }
        fs::remove_dir_all(&host).unwrap();
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
