// SPDX-License-Identifier: Apache-2.0
//! Every path that `cargo xtask` uses, in one table.
//!
//! The clone holds `build/` (plugin, `CMake` trees) and cargo's target folder; everything downloaded lives in a cache
//! outside of it, `$OOCPT_CACHE` or `~/.cache/oocpt`, so that clones share it. Nothing here touches the disk.

use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};

/// A wheel host: the OpenUSD inside Blender's Python module.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct WheelHost {
    /// OpenUSD's version, as `--host` and folders name it.
    pub(crate) usd: &'static str,
    /// Version of the Python module.
    pub(crate) bpy: &'static str,
    /// Python's minor version; headers, interpreter and wheels must agree on it.
    pub(crate) python: &'static str,
}

/// All wheel hosts. The first one is the default, and what is shipped is built for it.
pub(crate) const WHEEL_HOSTS: [WheelHost; 2] = [
    WheelHost { usd: "25.08", bpy: "5.0.1", python: "3.11" },
    WheelHost { usd: "26.03", bpy: "5.2.3", python: "3.13" },
];

impl WheelHost {
    /// The host with this version of OpenUSD.
    ///
    /// # Errors
    /// Lists the hosts if there is none.
    pub(crate) fn named(usd: &str) -> Result<&'static Self, String> {
        let known = || WHEEL_HOSTS.iter().map(|host| host.usd).collect::<Vec<_>>().join(", ");
        WHEEL_HOSTS.iter().find(|host| host.usd == usd).ok_or_else(|| format!("there are the hosts {}", known()))
    }

    /// Returns true for the host that commands take where none is named.
    pub(crate) fn is_default(&self) -> bool {
        *self == WHEEL_HOSTS[0]
    }

    /// OpenUSD's version as Python's `Usd.GetVersion()` gives it.
    pub(crate) fn version_tuple(&self) -> String {
        let parts: Vec<_> = self.usd.split('.').map(|part| part.trim_start_matches('0')).collect();
        format!("(0, {})", parts.join(", "))
    }

    /// Blender's folder in the module, below which its Python is.
    pub(crate) fn python_folder(&self) -> String {
        let blender = self.bpy.rsplit_once('.').map_or(self.bpy, |(minor, _)| minor);
        format!("bpy/{blender}/python/lib/python{}/site-packages", self.python)
    }

    /// The end of the names of folders that each host has for itself.
    fn suffix(&self) -> String {
        if self.is_default() { String::new() } else { format!("-{}", self.usd) }
    }
}

/// Roots of the clone and of the cache, and the host that is meant.
#[derive(Clone, Debug)]
pub(crate) struct RootFolders {
    /// Folder with the workspace `Cargo.toml`.
    pub(crate) repo: PathBuf,
    /// Folder for downloads, wheel host and virtual environments; shared by clones.
    pub(crate) cache: PathBuf,
    /// Cargo's target folder.
    pub(crate) target: PathBuf,
    /// The wheel host that paths lead to.
    pub(crate) wheel: &'static WheelHost,
}

impl RootFolders {
    /// Reads `OOCPT_CACHE`, `HOME` and `CARGO_TARGET_DIR`; the wheel host is the default one.
    ///
    /// # Errors
    /// If neither `OOCPT_CACHE` nor `HOME` is set.
    pub(crate) fn from_env() -> Result<Self> {
        let repo = Path::new(env!("CARGO_MANIFEST_DIR"))
            .ancestors()
            .nth(2)
            .context("xtask is not two folders below the workspace root")?
            .to_path_buf();
        let cache = cache_root(env::var_os("OOCPT_CACHE"), env::var_os("HOME"))?;
        let target = match env::var_os("CARGO_TARGET_DIR") {
            Some(target) => repo.join(target),
            None => repo.join("target"),
        };
        Ok(Self { repo, cache, target, wheel: &WHEEL_HOSTS[0] })
    }

    /// Wheels as downloaded.
    pub(crate) fn downloads(&self) -> PathBuf {
        self.cache.join("downloads")
    }

    /// Root of the unpacked wheel host; see [`crate::host`] for what is inside.
    pub(crate) fn host(&self) -> PathBuf {
        self.cache.join(format!("host-{}", self.wheel.usd))
    }

    /// `MaterialX`'s data libraries of the host.
    pub(crate) fn materialx(&self) -> PathBuf {
        self.host().join("python/bpy/lib/materialx/libraries")
    }

    /// Folder of the host that holds the Python package `pxr`.
    pub(crate) fn host_site(&self) -> PathBuf {
        self.host().join("python").join(self.wheel.python_folder())
    }

    /// Folder of the virtual environment `name` of the wheel host.
    pub(crate) fn venv(&self, name: &str) -> PathBuf {
        self.cache.join(format!("{name}{}", self.wheel.suffix()))
    }

    /// Build tree of the wheel host's plugin.
    pub(crate) fn wheel_build(&self) -> PathBuf {
        self.repo.join(format!("build/wheel{}", self.wheel.suffix()))
    }

    /// Folder to name in `PXR_PLUGINPATH_NAME` for the wheel host.
    pub(crate) fn wheel_resources(&self) -> PathBuf {
        self.wheel_build().join("plugin/hdOocPT/resources")
    }

    /// Folder with the `usdrecord` of the wheel host, to be put in `PATH`.
    pub(crate) fn wheel_bin(&self) -> PathBuf {
        self.wheel_build().join("bin")
    }
}

fn cache_root(explicit: Option<OsString>, home: Option<OsString>) -> Result<PathBuf> {
    if let Some(cache) = explicit.filter(|value| !value.is_empty()) {
        return Ok(PathBuf::from(cache));
    }
    let home = home.context("set OOCPT_CACHE: HOME is not set, so there is no place for the cache")?;
    Ok(Path::new(&home).join(".cache/oocpt"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_host_has_its_folders() {
        let of = |usd| RootFolders {
            repo: "/r".into(),
            cache: "/c".into(),
            target: "/t".into(),
            wheel: WheelHost::named(usd).unwrap(),
        };
        let (old, new) = (of("25.08"), of("26.03"));
        assert_eq!(old.wheel_build(), Path::new("/r/build/wheel"), "the default has plain names");
        assert_eq!((old.venv("v"), new.venv("v")), ("/c/v".into(), "/c/v-26.03".into()), "environments");
        assert_eq!(new.wheel_build(), Path::new("/r/build/wheel-26.03"), "build tree");
        let site = "/c/host-26.03/python/bpy/5.2/python/lib/python3.13/site-packages";
        assert_eq!(new.host_site(), Path::new(site), "modules");
        assert_eq!(new.wheel.version_tuple(), "(0, 26, 3)", "without zeros in front");
        assert!(WheelHost::named("24.11").unwrap_err().contains("25.08, 26.03"), "the known ones are listed");
    }

    #[test]
    fn the_table_of_versions_lists_every_host_and_its_blender() {
        let page = include_str!("../../book/src/hosts.md");
        for host in &WHEEL_HOSTS {
            let start = format!("| {} | `bpy=={}` | {} |", host.usd, host.bpy, host.python);
            let row = page.lines().find(|line| line.starts_with(&start)).expect(&start);
            let blender = host.bpy.rsplit_once('.').expect("three numbers").0;
            assert!(row.contains(&format!("extension for Blender {blender}")), "{row}");
        }
    }

    #[test]
    fn the_cache_follows_its_variable_then_home() {
        let home = || Some(OsString::from("/home/someone"));
        assert_eq!(cache_root(Some("/big/disk".into()), home()).unwrap(), Path::new("/big/disk"), "explicit");
        assert_eq!(cache_root(None, home()).unwrap(), Path::new("/home/someone/.cache/oocpt"), "default");
        assert_eq!(cache_root(Some("".into()), home()).unwrap(), Path::new("/home/someone/.cache/oocpt"), "empty");
        assert!(cache_root(None, None).is_err(), "without HOME there is no default");
    }
}
