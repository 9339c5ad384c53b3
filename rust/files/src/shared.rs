// SPDX-License-Identifier: Apache-2.0
//! Files of folders that processes share, as caches: what one of them uses is not removed by another that makes room.
//!
//! Who uses a file has a shared lock on it (`flock`), which ends when the file is closed, so also with a process that
//! is killed. Who removes it asks for all of it first. On NFS the locks of Linux hold between machines. Where a file
//! system has none, files are removed whoever uses them: on a local disk they last for as long as they are open, over a
//! network reading them fails. Any thread.

use crate::{checked, without_waiting};
use std::fs::{File, OpenOptions, TryLockError};
use std::hash::{BuildHasher as _, RandomState};
use std::io::{Error, ErrorKind, Result};
use std::path::Path;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// Marks an open file as used until it is closed, or [`release`]d. Returns false if it was removed, or is at this
/// moment.
#[must_use]
pub fn hold(file: &File) -> bool {
    !matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)) && has_a_name(file)
}

/// Takes the mark of [`hold`] from a file.
pub fn release(file: &File) {
    // Where there are no locks there is nothing to give back.
    let _unlocked = file.unlock();
}

/// Removes a file that nobody holds. Returns false if it is held, or has another file's place by now.
///
/// # Errors
/// It does not exist, cannot be opened, or cannot be removed.
pub fn remove_unused(path: &Path) -> Result<bool> {
    // NFS gives a lock of all of a file only to who may write it.
    let opened = without_waiting(OpenOptions::new().read(true).write(true)).open(path);
    let file = checked(match opened {
        Err(error) if error.kind() == ErrorKind::PermissionDenied => crate::open(path)?,
        opened => opened?,
    })?;
    if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) || !is_named(&file, path)? {
        return Ok(false);
    }
    remove_if(&file, path)
}

/// Removes the file of this name if it is `file`. Another process may give the name to a new file at any moment, so it
/// is taken aside first: a file in use is never without a name, which reading it over NFS needs.
fn remove_if(file: &File, path: &Path) -> Result<bool> {
    let aside = path.with_extension(format!("{}.part", unique_number()));
    std::fs::rename(path, &aside)?;
    let is_it = is_named(file, &aside)?;
    if !is_it {
        // Fails if the name is taken again: then there is a newer one.
        let _given_back = std::fs::hard_link(&aside, path);
    }
    std::fs::remove_file(&aside)?;
    Ok(is_it)
}

/// A number that no other call has, in this process or in another on any machine: two words for names of files.
/// Processes of containers have the same few numbers.
#[must_use]
pub fn unique_number() -> String {
    static PROCESS: LazyLock<u64> = LazyLock::new(|| RandomState::new().hash_one(std::process::id()));
    static COUNT: AtomicU32 = AtomicU32::new(0);
    format!("{}-{}", *PROCESS, COUNT.fetch_add(1, Ordering::Relaxed))
}

/// Makes a file, and its folder where that is missing; again where somebody removes the folder in between.
///
/// # Errors
/// The folder or the file cannot be made.
pub fn create_in(folder: &Path, create: impl Fn() -> Result<File>) -> Result<File> {
    let mut last = Error::from(ErrorKind::NotFound);
    for _ in 0..3 {
        std::fs::create_dir_all(folder)?;
        match create() {
            Err(error) if error.kind() == ErrorKind::NotFound => last = error,
            done => return done,
        }
    }
    Err(last)
}

#[cfg(unix)]
fn has_a_name(file: &File) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    file.metadata().is_ok_and(|metadata| metadata.nlink() > 0)
}

#[cfg(not(unix))]
fn has_a_name(_file: &File) -> bool {
    true
}

/// Whether this is the file of that name.
#[cfg(unix)]
fn is_named(file: &File, path: &Path) -> Result<bool> {
    use std::os::unix::fs::MetadataExt as _;
    let [one, other] = [file.metadata()?, std::fs::metadata(path)?];
    Ok((one.dev(), one.ino()) == (other.dev(), other.ino()))
}

#[cfg(not(unix))]
fn is_named(_file: &File, _path: &Path) -> Result<bool> {
    Ok(true)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use std::fs;

    fn scratch(name: &str) -> std::path::PathBuf {
        let folder = std::env::temp_dir().join(format!("oocpt-shared-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a temporary folder");
        folder
    }

    #[test]
    fn files_in_use_are_not_removed() {
        let folder = scratch("use");
        let path = folder.join("entry");
        fs::write(&path, b"x").expect("written");
        let [one, other] = [0, 1].map(|_| crate::open(&path).expect("there"));
        assert!(hold(&one) && hold(&other), "any number of users");
        drop(one);
        assert!(!remove_unused(&path).expect("there") && path.exists(), "one of them is left");
        release(&other);
        assert!(remove_unused(&path).expect("there") && !path.exists(), "nobody uses it");
        assert!(!hold(&other), "it is gone, though it can be read");
        assert_eq!(remove_unused(&path).expect_err("gone").kind(), ErrorKind::NotFound);
        fs::remove_dir_all(folder).expect("own files");
    }

    #[test]
    fn a_file_that_is_being_removed_cannot_be_held() {
        let folder = scratch("remove");
        let path = folder.join("entry");
        fs::write(&path, b"x").expect("written");
        let remover = crate::open(&path).expect("there");
        remover.try_lock().expect("all of it");
        assert!(!hold(&crate::open(&path).expect("still there")), "not any more");
        fs::rename(&path, folder.join("other")).expect("renamed");
        fs::write(&path, b"y").expect("written");
        assert!(!is_named(&remover, &path).expect("there"), "another file's name by now");
        fs::remove_dir_all(folder).expect("own files");
    }

    #[test]
    fn a_new_file_of_the_same_name_is_given_back() {
        let folder = scratch("new");
        let path = folder.join("entry");
        fs::write(&path, b"old").expect("written");
        let old = crate::open(&path).expect("there");
        fs::write(folder.join("new"), b"new").expect("written");
        fs::rename(folder.join("new"), &path).expect("renamed");
        let new = crate::open(&path).expect("there");
        assert!(hold(&new) && !remove_if(&old, &path).expect("there"), "another process has made it");
        assert!(hold(&new) && is_named(&new, &path).expect("there"), "it has its name");
        assert_eq!(fs::read_dir(&folder).expect("there").count(), 1, "and no other");
        assert!(remove_if(&new, &path).expect("there") && !path.exists(), "the file that was meant");
        fs::remove_dir_all(folder).expect("own files");
    }

    #[test]
    fn folders_that_are_removed_meanwhile_are_made_again() {
        let folder = scratch("again").join("below");
        let tries = std::cell::Cell::new(0);
        let create = || {
            tries.set(tries.get() + 1);
            if tries.get() == 1 {
                fs::remove_dir(&folder)?;
            }
            File::create_new(folder.join("entry"))
        };
        create_in(&folder, create).expect("the second time");
        assert_eq!(tries.get(), 2, "once again");
        let never = || Err(Error::from(ErrorKind::NotFound));
        assert_eq!(create_in(&folder, never).expect_err("no folder lasts").kind(), ErrorKind::NotFound);
        fs::remove_dir_all(folder.parent().expect("ours")).expect("own files");
    }

    #[test]
    fn numbers_of_files_differ_between_processes_of_the_same_number() {
        let [one, other] = [0, 1].map(|_| unique_number());
        assert_ne!(one, other);
        assert!(!one.starts_with(&format!("{}-", std::process::id())), "{one}: numbers of processes come again");
    }
}
