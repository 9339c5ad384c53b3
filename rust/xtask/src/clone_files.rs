// SPDX-License-Identifier: Apache-2.0
//! The files of the clone, as checks and documents see them.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context as _, Result};

use crate::places::RootFolders;
use crate::process::capture;

/// Files of the clone that git knows or would take, with forward slashes, relative to the root.
pub(crate) fn tracked_files(places: &RootFolders) -> Result<Vec<String>> {
    let mut git = Command::new("git");
    git.current_dir(&places.repo).args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"]);
    let listed = capture(&mut git).context("the checks need a git clone")?;
    let mut files: Vec<String> = listed.split_terminator('\0').map(str::to_owned).collect();
    files.sort();
    files.dedup();
    files.retain(|file| path(places, file).is_file());
    Ok(files)
}

/// A file of the clone.
pub(crate) fn path(places: &RootFolders, file: &str) -> PathBuf {
    places.repo.join(file)
}
