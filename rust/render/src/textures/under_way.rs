// SPDX-License-Identifier: Apache-2.0
//! The files that this process is writing into texture caches, so that an interrupted process removes its partial
//! files.
//!
//! They have names of their own until they are complete ([`super::disk`]), so a leftover is never taken for an entry;
//! it would only stay there until it is stale.

use crate::sync::lock;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

static FILES: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Notes that this file is about to be written.
pub(super) fn begin(file: &Path) {
    lock(&FILES).insert(file.to_path_buf());
}

/// Notes that this file is complete, or removed.
pub(super) fn end(file: &Path) {
    lock(&FILES).remove(file);
}

/// Removes the files that this process has begun and not completed. For a process that is about to end; a thread that
/// still writes a file then goes on into one without a name. Any thread.
pub fn remove_unfinished() {
    for file in std::mem::take(&mut *lock(&FILES)) {
        if let Err(error) = std::fs::remove_file(&file) {
            tracing::debug!(file = %file.display(), %error, "an unfinished file cannot be removed");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_unfinished_files_are_removed() {
        let file = |name: &str| std::env::temp_dir().join(format!("oocpt-under-way-{name}-{}", std::process::id()));
        let [done, open] = ["done", "open"].map(file);
        for file in [&done, &open] {
            std::fs::write(file, "x").expect("a temporary file");
            begin(file);
        }
        end(&done);
        remove_unfinished();
        assert!(done.exists() && !open.exists(), "what is whole stays, what is not goes");
        std::fs::remove_file(done).expect("it is ours");
    }
}
