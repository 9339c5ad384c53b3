// SPDX-License-Identifier: Apache-2.0
//! The folder in which files are kept from render to render, unless a setting names another one.

use std::path::PathBuf;

/// `$XDG_CACHE_HOME/oocpt/NAME`, or the same below `~/.cache` (XDG Base Directory Specification 0.8).
pub(crate) fn cache_folder(name: &str) -> Option<PathBuf> {
    let variable = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let caches = variable("XDG_CACHE_HOME").or_else(|| Some(variable("HOME")?.join(".cache")))?;
    Some(caches.join("oocpt").join(name))
}
