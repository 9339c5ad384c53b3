// SPDX-License-Identifier: Apache-2.0
//! The packages that the machine itself must have: tools, headers, libraries, a Vulkan driver; installed with apt as
//! root, otherwise named in one line.

mod apt;
mod sources;

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, bail, ensure};

use crate::places::WheelHost;

/// The test that the content of a package exists, whoever installed it.
#[derive(Clone, Copy, Debug)]
enum PackageProbe {
    /// A program in `PATH`.
    Program(&'static str),
    /// A shared library that the loader finds, by soname.
    Library(&'static str),
    /// A header in the compiler's default folders.
    Header(&'static str),
    /// A manifest in one of Vulkan's folders of this name; a prefix of the file's name.
    Vulkan(&'static str, &'static str),
    /// A Python with its headers and `venv`.
    Python,
}

/// Debian's package with Python's headers.
const PYTHON: &str = "python3-dev";

/// Package names are Debian's; each is installed only if its probe fails.
const NEEDS: &[(PackageProbe, &str)] = &[
    (PackageProbe::Program("c++"), "g++"),
    (PackageProbe::Program("git"), "git"),
    (PackageProbe::Program("cmake"), "cmake"),
    (PackageProbe::Program("ninja"), "ninja-build"),
    (PackageProbe::Program("glslangValidator"), "glslang-tools"),
    (PackageProbe::Program("spirv-val"), "spirv-tools"),
    (PackageProbe::Header("tbb/tbb.h"), "libtbb-dev"),
    (PackageProbe::Header("OpenImageIO/imageio.h"), "libopenimageio-dev"),
    (PackageProbe::Header("OpenColorIO/OpenColorIO.h"), "libopencolorio-dev"),
    (PackageProbe::Python, PYTHON),
    (PackageProbe::Python, "python3-venv"),
    (PackageProbe::Library("libvulkan.so.1"), "libvulkan1"),
    (PackageProbe::Vulkan("explicit_layer.d", "VkLayer_khronos_validation"), "vulkan-validationlayers"),
    (PackageProbe::Vulkan("icd.d", ""), apt::MESA),
    (PackageProbe::Library("libjemalloc.so.2"), "libjemalloc2"),
    (PackageProbe::Library("libGL.so.1"), "libgl1"),
    (PackageProbe::Library("libX11.so.6"), "libx11-6"),
    (PackageProbe::Library("libXext.so.6"), "libxext6"),
    (PackageProbe::Library("libSM.so.6"), "libsm6"),
    (PackageProbe::Library("libICE.so.6"), "libice6"),
];

/// The pinned formatter: other versions format differently.
pub(crate) const CLANG_FORMAT: &str = "clang-format-14";

/// Needed by `check` only.
const CHECK_NEEDS: &[(PackageProbe, &str)] = &[(PackageProbe::Program(CLANG_FORMAT), CLANG_FORMAT)];

/// The purpose of a command's needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NeededFor {
    /// Building and running.
    Build,
    /// `check`, which also runs formatters.
    Check,
}

/// Installs missing packages, or prints one line with what to install.
///
/// # Errors
/// Something is missing and the user is not root, or apt-get is not there or fails.
pub(crate) fn prepare(purpose: NeededFor, host: &WheelHost) -> Result<()> {
    let mut needs = NEEDS.to_vec();
    if purpose == NeededFor::Check {
        needs.extend(CHECK_NEEDS);
    }
    let missing = missing_packages(&needs, host);
    if !(apt::is_root() && apt::is_there()) {
        return ask_for(&missing, host);
    }
    if !missing.is_empty() {
        apt::install(&missing, &[])?;
        let still = missing_packages(&needs, host);
        if still.contains(&PYTHON) {
            let python = host.python;
            bail!("the wheel host needs CPython {python} with headers and venv; name one in OOCPT_PYTHON");
        }
        if !still.is_empty() {
            bail!("installed, but still not found: {}", still.join(" "));
        }
    }
    // Mesa 22's llvmpipe computes wrong images, and the renderer refuses it (see the book, design/machine).
    if apt::has_old_mesa() { apt::DebianBackports::of_this_machine()?.install_mesa() } else { Ok(()) }
}

/// Fails if anything is `missing`, with one line that names all of it.
fn ask_for(missing: &[&'static str], host: &WheelHost) -> Result<()> {
    if !apt::is_there() {
        ensure!(missing.is_empty(), "please install what Debian calls {}", missing.join(" "));
        return Ok(());
    }
    // With a GPU the old Mesa may stay: its drivers are fine, and the renderer refuses only its llvmpipe.
    let has_old_mesa = if missing.contains(&apt::MESA) { apt::offers_old_mesa() } else { apt::has_old_mesa() };
    let backports = if has_old_mesa && !has_gpu() { Some(apt::DebianBackports::of_this_machine()?) } else { None };
    let commands = commands_for(missing, backports.as_ref());
    // If the release's Python has another version, its packages do not help.
    let hint = if missing.contains(&PYTHON) {
        format!(" (or name a CPython {} with headers and venv in OOCPT_PYTHON)", host.python)
    } else {
        String::new()
    };
    ensure!(commands.is_empty(), "not root, so please run{hint}: {commands}");
    Ok(())
}

/// A shell line that installs what is missing; empty if nothing is.
fn commands_for(missing: &[&'static str], backports: Option<&apt::DebianBackports>) -> String {
    let stock: Vec<_> = missing.iter().copied().filter(|name| backports.is_none() || *name != apt::MESA).collect();
    let install = (!stock.is_empty()).then(|| format!("sudo apt-get install {}", stock.join(" ")));
    let mesa = backports.map(apt::DebianBackports::mesa_command);
    install.into_iter().chain(mesa).collect::<Vec<_>>().join(" && ")
}

/// Returns true if there is a kernel driver of a GPU that Vulkan may use.
pub(crate) fn has_gpu() -> bool {
    let holds = |folder: &str, prefix: &str| {
        let mut entries = fs::read_dir(folder).into_iter().flatten().flatten();
        entries.any(|entry| entry.file_name().to_string_lossy().starts_with(prefix))
    };
    holds("/dev", "nvidia0") || holds("/dev/dri", "renderD")
}

fn missing_packages(needs: &[(PackageProbe, &'static str)], host: &WheelHost) -> Vec<&'static str> {
    let libraries = loader_cache();
    needs.iter().filter(|(probe, _)| !is_met(*probe, &libraries, host)).map(|(_, package)| *package).collect()
}

fn is_met(probe: PackageProbe, libraries: &str, host: &WheelHost) -> bool {
    match probe {
        PackageProbe::Program(name) => find_program(name).is_some(),
        PackageProbe::Library(soname) => libraries.contains(soname),
        PackageProbe::Header(header) => {
            ["/usr/include", "/usr/local/include"].iter().any(|root| Path::new(root).join(header).is_file())
        }
        PackageProbe::Vulkan(folder, prefix) => has_vulkan_manifest(folder, prefix),
        PackageProbe::Python => crate::host::find_interpreter(host).is_some(),
    }
}

/// The first `name` in `PATH`.
pub(crate) fn find_program(name: &str) -> Option<PathBuf> {
    let path = env::var_os("PATH")?;
    env::split_paths(&path).map(|folder| folder.join(name)).find(|program| program.is_file())
}

/// The newest LLVM that Mitsuba's compiler can use (17 or later), installed if this is Debian and we are root.
///
/// # Errors
/// If there is none and it cannot be installed.
pub(crate) fn llvm() -> Result<PathBuf> {
    const PACKAGE: &str = "libllvm19";
    if newest_llvm(&loader_cache()).is_none() && apt::is_root() && apt::is_there() {
        apt::install(&[PACKAGE], &[])?;
    }
    newest_llvm(&loader_cache()).with_context(|| format!("Mitsuba needs LLVM 17 or later: install {PACKAGE}"))
}

/// The path of the newest usable `libLLVM` in what `ldconfig -p` lists.
fn newest_llvm(listed: &str) -> Option<PathBuf> {
    let entry = |line: &str| {
        let (name, path) = line.trim().split_once(" => ")?;
        let name = name.split_whitespace().next()?.strip_prefix("libLLVM")?;
        // libLLVM-17.so.1, libLLVM.so.19.1
        let version = name.strip_prefix('-').or_else(|| name.strip_prefix(".so."))?;
        let major = version.split('.').next()?.parse::<u32>().ok()?;
        (major >= 17).then(|| (major, PathBuf::from(path)))
    };
    listed.lines().filter_map(entry).max().map(|(_, path)| path)
}

fn loader_cache() -> String {
    // ldconfig is not in the PATH of ordinary users.
    let programs = ["ldconfig", "/sbin/ldconfig", "/usr/sbin/ldconfig"];
    let listed = programs.iter().find_map(|program| Command::new(program).arg("-p").output().ok());
    listed.map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default()
}

fn has_vulkan_manifest(folder: &str, prefix: &str) -> bool {
    if folder == "icd.d" && ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].iter().any(|name| env::var_os(name).is_some()) {
        return true;
    }
    let roots = ["/usr/share/vulkan", "/usr/local/share/vulkan", "/etc/vulkan"].map(PathBuf::from);
    let user = env::var_os("HOME").map(|home| Path::new(&home).join(".local/share/vulkan"));
    let listed = roots.into_iter().chain(user).filter_map(|root| fs::read_dir(root.join(folder)).ok());
    listed.flatten().flatten().any(|entry| {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        name.starts_with(prefix) && name.ends_with(".json")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::places::WHEEL_HOSTS;

    #[test]
    fn llvm_is_found_under_both_kinds_of_name() {
        let line = |name: &str| format!("\t{name} (libc6,x86-64) => /lib/{name}\n");
        let old = line("libLLVM-15.so.1") + &line("libLLVM-C.so.19");
        assert_eq!(newest_llvm(&old), None, "too old, or not it");
        let both = old + &line("libLLVM-17.so.1") + &line("libLLVM.so.19.1");
        assert_eq!(newest_llvm(&both), Some("/lib/libLLVM.so.19.1".into()), "the newest");
    }

    #[test]
    fn only_what_is_missing_is_named() {
        let needs = [
            (PackageProbe::Program("sh"), "dash"),
            (PackageProbe::Program("no-such-program-xyz"), "absent-tool"),
            (PackageProbe::Library("libno-such.so.9"), "absent-library"),
            (PackageProbe::Header("no/such/header.h"), "absent-header"),
            (PackageProbe::Vulkan("no-such.d", ""), "absent-driver"),
        ];
        let missing = missing_packages(&needs, &WHEEL_HOSTS[0]);
        assert_eq!(missing, ["absent-tool", "absent-library", "absent-header", "absent-driver"], "sh is everywhere");
    }

    #[test]
    fn one_line_asks_for_all_that_is_missing() {
        assert_eq!(commands_for(&[], None), "", "nothing to do");
        assert_eq!(
            commands_for(&["cmake", apt::MESA], None),
            "sudo apt-get install cmake mesa-vulkan-drivers",
            "stock"
        );
        let lists = ["deb http://mirror/debian bookworm main\n".to_owned()];
        let backports = apt::DebianBackports::of("VERSION_CODENAME=bookworm\n", &lists).unwrap();
        let both = commands_for(&["cmake", apt::MESA], Some(&backports));
        assert_eq!(both, format!("sudo apt-get install cmake && {}", backports.mesa_command()), "Mesa from one place");
    }
}
