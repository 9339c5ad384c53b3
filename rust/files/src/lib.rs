// SPDX-License-Identifier: Apache-2.0
//! Opens files whose names come from settings and scenes. Opening a pipe waits for its other end, opening a device may
//! do anything, and neither has an end: so these functions open regular files only, in bounded time.
//!
//! Each function checks the kind of the file before it opens it, opens without waiting (`O_NONBLOCK`), and checks the
//! opened file again, because the name may have been replaced meanwhile. Links are followed. Messages of errors about
//! the kind of a file continue its name: "is a pipe, not a file". Any thread.

#![forbid(unsafe_code)]

mod shared;

pub use shared::{create_in, hold, release, remove_unused, unique_number};

use std::fs::{File, FileType, OpenOptions};
use std::io::{Error, ErrorKind, Read as _, Result, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Opens a file to be read.
///
/// # Errors
/// It does not exist, cannot be read, or is not a regular file ([`ErrorKind::InvalidInput`]).
pub fn open(path: &Path) -> Result<File> {
    let kind = std::fs::metadata(path)?.file_type();
    refuse(kind)?;
    checked(without_waiting(OpenOptions::new().read(true)).open(path)?)
}

/// Reads a whole file of at most `most_bytes`.
///
/// # Errors
/// As [`open`]; it is longer ([`ErrorKind::FileTooLarge`]), or cannot be read to its end.
pub fn read(path: &Path, most_bytes: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // One byte more than allowed detects longer files, also if they grow meanwhile.
    open(path)?.take(most_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most_bytes {
        return Err(Error::new(ErrorKind::FileTooLarge, format!("has more than {most_bytes} bytes")));
    }
    Ok(bytes)
}

/// Opens a file for writing at its end, or creates it. With `anew` it is emptied.
///
/// # Errors
/// It cannot be written, or the name is that of something other than a regular file ([`ErrorKind::InvalidInput`]).
pub fn append(path: &Path, anew: bool) -> Result<File> {
    refuse_existing(path)?;
    let file = checked(without_waiting(OpenOptions::new().append(true).create(true)).open(path)?)?;
    if anew {
        file.set_len(0)?;
    }
    Ok(file)
}

/// Writes a whole file under another name in the same folder, and renames it. Readers see the old file or the new one.
/// For a link, the target is replaced.
///
/// # Errors
/// It cannot be written, or the name is that of something other than a regular file ([`ErrorKind::InvalidInput`]). An
/// existing file stays as it is.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    replace_by(path, |mut file| file.write_all(bytes))
}

/// As [`replace`], with the bytes that `write` writes.
///
/// # Errors
/// Those of `write`, and as [`replace`].
pub fn replace_by(path: &Path, write: impl FnOnce(File) -> Result<()>) -> Result<()> {
    refuse_existing(path)?;
    let path = std::fs::canonicalize(path).unwrap_or_else(|_not_there| path.to_path_buf());
    let beside = name_beside(&path);
    let file = OpenOptions::new().write(true).create_new(true).open(&beside)?;
    let done = write(file).and_then(|()| std::fs::rename(&beside, &path));
    if done.is_err() {
        // The first error is the one that is reported.
        let _removed = std::fs::remove_file(&beside);
    }
    done
}

/// Removes what processes that were killed have left of writing this file, if it was not changed for so long: one that
/// is being written is. Nothing is said of a file that cannot be removed.
pub fn remove_stale(path: &Path, age: Duration) {
    let path = std::fs::canonicalize(path).unwrap_or_else(|_not_there| path.to_path_buf());
    let (Some(folder), Some(name)) = (path.parent(), path.file_name().and_then(|name| name.to_str())) else { return };
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let is_ours = |entry: &str| {
        let middle = entry.strip_prefix(name).and_then(|rest| rest.strip_prefix('.')?.strip_suffix(".tmp"));
        let numbers = middle.and_then(|middle| middle.split_once('-'));
        let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        numbers.is_some_and(|(process, count)| is_number(process) && is_number(count))
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries.filter(|entry| entry.file_name().to_str().is_some_and(is_ours)) {
        let changed = entry.metadata().and_then(|metadata| metadata.modified());
        if changed.is_ok_and(|changed| changed.elapsed().is_ok_and(|since| since >= age)) {
            let _removed = std::fs::remove_file(entry.path());
        }
    }
}

/// A name in the same folder that no other call, thread or process uses.
fn name_beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{}.tmp", unique_number()));
    name.into()
}

/// Fails if there is something other than a regular file; a missing file may be created.
fn refuse_existing(path: &Path) -> Result<()> {
    match std::fs::metadata(path) {
        Ok(metadata) => refuse(metadata.file_type()),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error),
    }
}

fn checked(file: File) -> Result<File> {
    refuse(file.metadata()?.file_type())?;
    Ok(file)
}

fn refuse(kind: FileType) -> Result<()> {
    let what = what_else(kind);
    if kind.is_file() { Ok(()) } else { Err(Error::new(ErrorKind::InvalidInput, format!("is {what}, not a file"))) }
}

#[cfg(unix)]
fn what_else(kind: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt as _;
    if kind.is_dir() {
        "a folder"
    } else if kind.is_fifo() {
        "a pipe"
    } else if kind.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

#[cfg(not(unix))]
fn what_else(kind: FileType) -> &'static str {
    if kind.is_dir() { "a folder" } else { "something else" }
}

#[cfg(unix)]
fn without_waiting(options: &mut OpenOptions) -> &mut OpenOptions {
    use std::os::unix::fs::OpenOptionsExt as _;
    // A small constant; the standard library adds O_CLOEXEC.
    options.custom_flags(rustix::fs::OFlags::NONBLOCK.bits().cast_signed())
}

#[cfg(not(unix))]
fn without_waiting(options: &mut OpenOptions) -> &mut OpenOptions {
    options
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use std::os::unix::net::UnixListener;
    use std::time::{Duration, Instant};

    /// A folder with one entry of each kind, removed at the end.
    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let folder = std::env::temp_dir().join(format!("oocpt-files-{name}-{}", std::process::id()));
            std::fs::create_dir_all(&folder).expect("a temporary folder");
            Self(folder)
        }

        fn path(&self, name: &str) -> PathBuf {
            self.0.join(name)
        }

        fn names(&self) -> Vec<String> {
            let entries = std::fs::read_dir(&self.0).expect("readable");
            let mut names: Vec<String> =
                entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
            names.sort();
            names
        }

        /// The entries that are not files, with the names of their kinds.
        fn others(&self) -> (Vec<(PathBuf, &'static str)>, UnixListener) {
            let [pipe, link, socket] = ["pipe", "link", "socket"].map(|name| self.path(name));
            let made = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo");
            assert!(made.success(), "a pipe");
            std::os::unix::fs::symlink(&pipe, &link).expect("a link");
            let listener = UnixListener::bind(&socket).expect("a socket");
            let device = PathBuf::from("/dev/zero");
            let folder = self.0.clone();
            let all = vec![
                (pipe, "is a pipe, not a file"),
                (link, "is a pipe, not a file"),
                (socket, "is a socket, not a file"),
                (device, "is a device, not a file"),
                (folder, "is a folder, not a file"),
            ];
            (all, listener)
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            std::fs::remove_dir_all(&self.0).expect("own files can be removed");
        }
    }

    #[test]
    fn irregular_files_are_refused_without_blocking() {
        let folder = Folder::new("others");
        let (others, _listener) = folder.others();
        let started = Instant::now();
        for (path, said) in &others {
            let tried = [
                open(path).map(|_file| ()),
                read(path, 10).map(|_bytes| ()),
                append(path, false).map(|_file| ()),
                append(path, true).map(|_file| ()),
                replace(path, b"x"),
            ];
            for (index, result) in tried.into_iter().enumerate() {
                let error = result.expect_err("no file");
                assert_eq!(error.to_string(), *said, "{} by function {index}", path.display());
            }
        }
        assert!(started.elapsed() < Duration::from_secs(5), "nobody waits");
        assert_eq!(folder.names(), ["link", "pipe", "socket"], "nothing is left, all is as it was");
    }

    /// A pipe that replaces a file between the two checks is opened without waiting, and refused.
    #[test]
    fn a_file_replaced_by_a_pipe_before_opening_is_refused() {
        let folder = Folder::new("between");
        let (others, _listener) = folder.others();
        let pipe = &others[0].0;
        let opened = without_waiting(OpenOptions::new().read(true)).open(pipe).expect("opened without waiting");
        assert_eq!(checked(opened).expect_err("a pipe").to_string(), "is a pipe, not a file");
        // No process reads the pipe.
        assert!(without_waiting(OpenOptions::new().append(true)).open(pipe).is_err(), "fails without waiting");
    }

    #[test]
    fn files_are_read_up_to_a_limit() {
        let folder = Folder::new("read");
        let path = folder.path("file");
        std::fs::write(&path, b"12345").expect("a temporary file");
        assert_eq!(read(&path, 5).expect("short enough"), b"12345");
        assert_eq!(read(&path, u64::MAX).expect("no limit"), b"12345");
        assert_eq!(read(&path, 4).expect_err("too long").kind(), ErrorKind::FileTooLarge);
        assert_eq!(read(&folder.path("none"), 4).expect_err("none").kind(), ErrorKind::NotFound);
    }

    #[test]
    fn files_are_replaced_whole_and_links_stay() {
        let folder = Folder::new("write");
        let [path, link] = ["file", "link"].map(|name| folder.path(name));
        replace(&path, b"one").expect("made");
        std::os::unix::fs::symlink("file", &link).expect("a link");
        replace(&link, b"two").expect("replaced");
        assert_eq!(std::fs::read(&path).expect("there"), b"two", "what the link leads to");
        assert!(std::fs::symlink_metadata(&link).expect("there").is_symlink(), "the link stays");
        let failed = replace_by(&path, |_file| Err(Error::other("no room")));
        assert!(failed.is_err() && std::fs::read(&path).expect("there") == b"two", "as it was");
        append(&path, false).expect("there").write_all(b"+").expect("written");
        assert_eq!(std::fs::read(&path).expect("there"), b"two+");
        append(&path, true).expect("there").write_all(b"new").expect("written");
        append(&folder.path("other"), false).expect("made");
        assert_eq!(std::fs::read(&path).expect("there"), b"new");
        assert_eq!(folder.names(), ["file", "link", "other"], "nothing else is left");
    }

    #[test]
    fn only_old_leftovers_of_the_same_file_are_removed() {
        let folder = Folder::new("stale");
        let old = ["film.17-0.tmp", "film.17-0.tmp.tmp", "film.x-1.tmp", "film.17.tmp", "filmx.17-0.tmp", "film"];
        let then = std::time::SystemTime::now() - Duration::from_secs(7200);
        for name in old.iter().chain(&["film.18-3.tmp"]) {
            let file = File::create(folder.path(name)).expect("a file");
            if *name != "film.18-3.tmp" {
                file.set_modified(then).expect("its time");
            }
        }
        remove_stale(&folder.path("film"), Duration::from_secs(3600));
        let mut left: Vec<&str> = old[1..].iter().copied().chain(["film.18-3.tmp"]).collect();
        left.sort_unstable();
        assert_eq!(folder.names(), left, "one that is being written stays, and what is another's");
        remove_stale(&folder.path("film"), Duration::ZERO);
        assert!(!folder.path("film.18-3.tmp").exists(), "older than that");
        remove_stale(&folder.path("no/such/film"), Duration::ZERO);
    }
}
