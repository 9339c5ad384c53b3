// SPDX-License-Identifier: Apache-2.0
//! Names on the command line become files: folders those below them, patterns the members of their sets.

use anyhow::{Context as _, Result};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Ends of the names that are taken from folders.
const ENDINGS: [&str; 12] = ["bmp", "exr", "hdr", "jpeg", "jpg", "pic", "png", "ptx", "tga", "tif", "tiff", "tx"];
const UDIM: &str = "<UDIM>";
/// Numbers of members.
const MEMBERS: std::ops::RangeInclusive<u32> = 1001..=1100;
/// Deepest folder below a named one.
const DEEPEST: u32 = 32;

/// What the names mean.
#[derive(Debug, Default)]
pub(super) struct ExpandedFiles {
    /// Absolute paths, each once, in order. Members of packages (`scene.usdz[a.png]`) are there as they were named.
    pub(super) files: Vec<String>,
    /// Names that mean nothing, and why.
    pub(super) missing: Vec<(String, String)>,
}

/// The files of all names.
pub(super) fn expand(names: &[PathBuf]) -> Result<ExpandedFiles> {
    let here = std::env::current_dir().context("the working folder is gone")?;
    let mut found = BTreeSet::new();
    let mut missing = Vec::new();
    for name in names {
        let Some(text) = here.join(name).to_str().map(str::to_owned) else {
            missing.push((name.display().to_string(), "its name is no UTF-8".to_owned()));
            continue;
        };
        let path = Path::new(&text);
        let before = found.len();
        let known = if path.is_dir() {
            walk(path, 0, &mut found)
        } else if text.contains(UDIM) {
            members(path, &mut found)
        } else {
            found.insert(text.clone());
            continue;
        };
        if let Err(error) = known {
            missing.push((text, format!("cannot be read: {error}")));
        } else if found.len() == before {
            missing.push((text, "no texture files are there".to_owned()));
        }
    }
    Ok(ExpandedFiles { files: found.into_iter().collect(), missing })
}

/// All files with one of the endings. Links to folders are not followed: they may lead in a circle.
fn walk(folder: &Path, depth: u32, found: &mut BTreeSet<String>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let path = entry.path();
        if entry.file_type()?.is_dir() {
            if depth < DEEPEST {
                walk(&path, depth + 1, found)?;
            }
            continue;
        }
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
        if let (true, Some(text)) = (ENDINGS.contains(&ending.as_str()) && path.is_file(), path.to_str()) {
            found.insert(text.to_owned());
        }
    }
    Ok(())
}

/// The members of a set that are there.
fn members(pattern: &Path, found: &mut BTreeSet<String>) -> std::io::Result<()> {
    let text = pattern.to_string_lossy();
    let names = MEMBERS.map(|number| text.replace(UDIM, &number.to_string()));
    found.extend(names.filter(|name| Path::new(name).is_file()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_and_patterns_become_files() {
        let folder = std::env::temp_dir().join(format!("oocpt-texture-names-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("a/b")).expect("a temporary folder");
        std::fs::create_dir_all(folder.join("empty")).expect("a temporary folder");
        for name in
            ["a/wood.1001.png", "a/wood.1012.png", "a/wood.1101.png", "a/notes.txt", "a/b/deep.EXR", "lone.weird"]
        {
            std::fs::write(folder.join(name), "x").expect("a temporary file");
        }
        std::os::unix::fs::symlink(&folder, folder.join("a/circle")).expect("a link");
        let names = |names: &[&str]| {
            let expanded = expand(&names.iter().map(|name| folder.join(name)).collect::<Vec<_>>()).expect("a folder");
            let root = format!("{}/", folder.display());
            let files: Vec<String> = expanded.files.iter().map(|file| file.replacen(&root, "", 1)).collect();
            (files, expanded.missing)
        };
        let (files, missing) = names(&["a", "a/b/deep.EXR"]);
        assert_eq!(files, ["a/b/deep.EXR", "a/wood.1001.png", "a/wood.1012.png", "a/wood.1101.png"], "each once");
        assert!(missing.is_empty(), "{missing:?}");
        assert_eq!(names(&["a/wood.<UDIM>.png"]).0, ["a/wood.1001.png", "a/wood.1012.png"], "1101 is no member");
        assert_eq!(names(&["lone.weird", "gone.png"]).0, ["gone.png", "lone.weird"], "what is named is asked for");
        let (files, missing) = names(&["empty", "none.<UDIM>.png"]);
        assert!(files.is_empty() && missing.len() == 2 && missing[0].1.contains("no texture files"), "{missing:?}");
        std::fs::remove_dir_all(folder).expect("it is ours");
    }
}
