// SPDX-License-Identifier: Apache-2.0
//! Compiles the parts of OpenSubdiv that evaluate limit surfaces (`sdc`, `vtr`, `far`, `bfr`), and the C++ half of this
//! crate, into static libraries with hidden symbols: a host has its own OpenSubdiv, perhaps of another version.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Package whose folder contains OpenSubdiv's sources.
const CARRIER: &str = "opensubdiv-petite-sys";
/// Folders of OpenSubdiv that are compiled.
const PARTS: [&str; 4] = ["sdc", "vtr", "far", "bfr"];

fn main() -> Result<(), Box<dyn Error>> {
    let root = sources()?;
    let mut library = cc::Build::new();
    library.cpp(true).std("c++17").include(&root).warnings(false).opt_level(2).define("NDEBUG", None);
    hide(&mut library);
    for part in PARTS {
        let mut files: Vec<PathBuf> = Vec::new();
        for entry in root.join("opensubdiv").join(part).read_dir()? {
            let path = entry?.path();
            if path.extension().is_some_and(|extension| extension == "cpp") {
                files.push(path);
            }
        }
        files.sort();
        library.files(files);
    }
    let cpp = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../cpp");
    let mut shim = cxx_build::bridge("src/ffi.rs");
    shim.std("c++17").include(&cpp).flag("-isystem").flag(&root).file(cpp.join("subdiv/limitSurface.cpp"));
    hide(&mut shim);
    // The linker wants a library after those that use it.
    shim.compile("oocpt_subdiv_cxx");
    library.compile("oocpt_opensubdiv");
    for file in ["limitSurface.h", "limitSurface.cpp", "siteTable.h"] {
        println!("cargo:rerun-if-changed={}", cpp.join("subdiv").join(file).display());
    }
    println!("cargo:rerun-if-changed=src/ffi.rs");
    println!("cargo:rerun-if-changed=build.rs");
    Ok(())
}

fn hide(build: &mut cc::Build) {
    build.flag_if_supported("-fvisibility=hidden").flag_if_supported("-fvisibility-inlines-hidden");
}

/// The folder `OpenSubdiv` of the package that carries it.
fn sources() -> Result<PathBuf, Box<dyn Error>> {
    let cargo = std::env::var_os("CARGO").ok_or("cargo does not say where it is")?;
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
    let output =
        Command::new(cargo).args(["metadata", "--format-version", "1", "--manifest-path"]).arg(manifest).output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into());
    }
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout)?;
    let packages = metadata["packages"].as_array().ok_or("cargo metadata lists no packages")?;
    let carrier = packages.iter().find(|package| package["name"] == CARRIER).ok_or("the sources are missing")?;
    let manifest = carrier["manifest_path"].as_str().ok_or("a package without a manifest")?;
    Ok(Path::new(manifest).parent().ok_or("a manifest without a folder")?.join("OpenSubdiv"))
}
