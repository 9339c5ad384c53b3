// SPDX-License-Identifier: Apache-2.0
//! Every path the door uses, in one table.
//!
//! The clone holds `build/` (plugin, `CMake` trees) and cargo's target folder; everything downloaded lives in a cache
//! outside of it, `$OOCPT_CACHE` or `~/.cache/oocpt`, so that clones share it. Nothing here touches the disk.

use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};

/// Python minor version of the wheel host; headers, interpreter and wheels must agree on it.
pub(crate) const PYTHON_VERSION: &str = "3.11";

/// Roots of the clone and of the cache.
#[derive(Clone, Debug)]
pub(crate) struct RootFolders {
    /// Folder with the workspace `Cargo.toml`.
    pub(crate) repo: PathBuf,
    /// Folder for downloads, wheel host and virtual environments; shared by clones.
    pub(crate) cache: PathBuf,
    /// Cargo's target folder.
    pub(crate) target: PathBuf,
}

impl RootFolders {
    /// Reads `OOCPT_CACHE`, `HOME` and `CARGO_TARGET_DIR`.
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
        Ok(Self { repo, cache, target })
    }

    /// Wheels as downloaded.
    pub(crate) fn downloads(&self) -> PathBuf {
        self.cache.join("downloads")
    }

    /// Root of the unpacked wheel host; see [`crate::host`] for what is inside.
    pub(crate) fn host(&self) -> PathBuf {
        self.cache.join("host-25.08")
    }

    /// `MaterialX`'s data libraries of the host.
    pub(crate) fn materialx(&self) -> PathBuf {
        self.host().join("python/bpy/lib/materialx/libraries")
    }

    /// Folder of the host that holds the Python package `pxr`.
    pub(crate) fn host_site(&self) -> PathBuf {
        self.host().join("python/bpy/5.0/python/lib/python3.11/site-packages")
    }

    /// Build tree of the wheel host's plugin.
    pub(crate) fn wheel_build(&self) -> PathBuf {
        self.repo.join("build/wheel")
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
    fn the_cache_follows_its_variable_then_home() {
        let home = || Some(OsString::from("/home/someone"));
        assert_eq!(cache_root(Some("/big/disk".into()), home()).unwrap(), Path::new("/big/disk"), "explicit");
        assert_eq!(cache_root(None, home()).unwrap(), Path::new("/home/someone/.cache/oocpt"), "default");
        assert_eq!(cache_root(Some("".into()), home()).unwrap(), Path::new("/home/someone/.cache/oocpt"), "empty");
        assert!(cache_root(None, None).is_err(), "without HOME there is no default");
    }
}
