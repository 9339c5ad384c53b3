// SPDX-License-Identifier: Apache-2.0
//! The folder in which decoded images are kept from render to render, shared by all processes of a user.
//!
//! An entry is a file of `tx`, named by a hash of its key: the identity of the source (`ImageLibrary::identity`) and
//! how it is read. It is written under another name and renamed when it is complete, so nobody reads half of one; each
//! tile has a checksum, and a damaged entry is removed and made again. The least recently used entries are removed if
//! all together exceed the limit, but none that a process uses. Any thread.

use super::convert::TileSink;
use super::image::ImageError;
use super::tx::{TxDescription, TxFile, TxWriter};
use super::under_way;
use crate::device::cache_folder::cache_folder;
use crate::sync::lock;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime};
use xxhash_rust::xxh3::xxh3_128;

/// The extension of entries.
const ENDING: &str = "tx";
/// The extension of files under way. One as old as [`STALE`] was left behind by a process that died.
const UNDER_WAY: &str = "part";
const STALE: Duration = Duration::from_secs(24 * 60 * 60);
/// Entries are marked as used no more often than this.
const MARK_AGE: Duration = Duration::from_secs(60 * 60);

/// What this process knows of the entries of all processes.
#[derive(Debug, Default)]
struct KnownEntries {
    bytes: u64,
    /// Bytes beyond which the folder is looked at: 0 before it was.
    clean_at: u64,
}

/// The folder with its limit and its state.
#[derive(Debug)]
pub(crate) struct DiskCache {
    folder: PathBuf,
    /// Bytes of all entries.
    limit: u64,
    known: Mutex<KnownEntries>,
    complaint: Mutex<Option<String>>,
    failed: AtomicBool,
}

impl DiskCache {
    /// The cache of a setting, which is a folder; empty means the user's own folder, "0" no cache.
    pub(crate) fn of_setting(setting: &str, limit_mib: u32) -> Option<Self> {
        let folder = match setting {
            "0" => return None,
            "" => cache_folder("textures")?,
            path => PathBuf::from(path),
        };
        Some(Self::new(folder, u64::from(limit_mib) << 20))
    }

    /// A cache in a folder, which is created with the first entry.
    pub(crate) fn new(folder: PathBuf, limit: u64) -> Self {
        Self { folder, limit, known: Mutex::default(), complaint: Mutex::default(), failed: AtomicBool::new(false) }
    }

    /// The first error, once: the render goes on without the cache where it fails.
    pub(crate) fn take_complaint(&self) -> Option<String> {
        lock(&self.complaint).take()
    }

    /// Returns true if a write failed; nothing is written from then on.
    pub(crate) fn has_failed(&self) -> bool {
        self.failed.load(Ordering::Relaxed)
    }

    fn complain(&self, what: &str, error: &io::Error) {
        let text = format!("texture cache {}: {what}: {error}; decoded images stay in memory", self.folder.display());
        tracing::debug!("{text}");
        if !self.failed.swap(true, Ordering::Relaxed) {
            *lock(&self.complaint) = Some(text);
        }
    }

    /// The path of the entry of a key, whether it exists or not.
    pub(crate) fn path(&self, key: &str) -> PathBuf {
        self.folder.join(format!("{:032x}.{ENDING}", xxh3_128(key.as_bytes())))
    }

    /// The entry of a key, if it exists and is complete.
    pub(crate) fn find(&self, key: &str) -> Option<TxFile> {
        let path = self.path(key);
        let file = oocpt_files::open(&path).ok()?;
        let used = file.metadata().and_then(|metadata| metadata.modified());
        if !oocpt_files::hold(&file) {
            return None;
        }
        match TxFile::open(file) {
            Ok(entry) if entry.description().key == key => {
                let now = SystemTime::now();
                if used.is_ok_and(|used| now.duration_since(used).is_ok_and(|age| age > MARK_AGE)) {
                    // The times do not matter in a folder that cannot be written.
                    let marked = File::options().append(true).open(&path).and_then(|file| file.set_modified(now));
                    tracing::trace!(?marked, "used");
                }
                Some(entry)
            }
            Ok(_other_key) => None,
            Err(error) => {
                tracing::debug!(path = %path.display(), %error, "an entry of the texture cache is damaged");
                self.remove(key);
                None
            }
        }
    }

    /// Removes the damaged entry of a key, whoever uses it: it is to be made anew.
    pub(crate) fn remove(&self, key: &str) {
        let path = self.path(key);
        if let Err(error) = fs::remove_file(&path) {
            tracing::debug!(path = %path.display(), %error, "cannot be removed");
        }
    }

    /// Begins an entry; `None`, with a complaint, if nothing can be written.
    pub(crate) fn begin(&self, description: TxDescription) -> Option<PendingEntry<'_>> {
        if self.has_failed() {
            return None;
        }
        let path = self.path(&description.key);
        let part = path.with_extension(format!("{}.{UNDER_WAY}", oocpt_files::unique_number()));
        under_way::begin(&part);
        let create = || File::options().write(true).create_new(true).open(&part);
        let begun = oocpt_files::create_in(&self.folder, create).and_then(|file| TxWriter::new(file, description));
        match begun {
            Ok(writer) => Some(PendingEntry { cache: self, writer: Some(writer), part, path }),
            Err(error) => {
                under_way::end(&part);
                self.complain("cannot be written", &error);
                None
            }
        }
    }

    /// Takes in a new entry, and removes old ones if there are too many.
    fn added(&self, path: &Path, bytes: u64) {
        let mut known = lock(&self.known);
        known.bytes = known.bytes.saturating_add(bytes);
        if known.bytes > known.clean_at {
            known.bytes = self.clean(path);
            // Entries that are used stay: the folder is not looked at again for each new one.
            known.clean_at = self.limit.max(known.bytes.saturating_add(self.limit / 8));
        }
    }

    /// Removes stale files, and entries, the oldest first, until they are within the limit, but not `newest`. Returns
    /// the bytes that are left.
    fn clean(&self, newest: &Path) -> u64 {
        let now = SystemTime::now();
        let mut entries = Vec::new();
        let mut sum = 0_u64;
        for file in fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            let path = file.path();
            let Ok(metadata) = file.metadata() else { continue };
            if !is_ours(&path) {
                continue; // Whoever names a folder with files of his own keeps them.
            }
            let used = metadata.modified().unwrap_or(now);
            match path.extension().and_then(|ending| ending.to_str()) {
                Some(ENDING) => {
                    sum = sum.saturating_add(metadata.len());
                    entries.push((used, metadata.len(), path));
                }
                Some(UNDER_WAY) if now.duration_since(used).is_ok_and(|age| age > STALE) => {
                    delete(&path);
                }
                _ => {}
            }
        }
        entries.sort();
        for (_, bytes, path) in entries {
            if sum <= self.limit {
                break;
            }
            if path != newest && delete(&path) {
                sum = sum.saturating_sub(bytes);
            }
        }
        sum
    }
}

/// Returns true if a file has the name of an entry: 32 hexadecimal digits before the first dot.
fn is_ours(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let stem = name.split('.').next().unwrap_or_default();
    stem.len() == 32 && stem.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// Removes a file that no process uses. Returns true if it is gone; another process may have been faster.
fn delete(path: &Path) -> bool {
    match oocpt_files::remove_unused(path) {
        Ok(is_removed) => is_removed,
        Err(error) => {
            tracing::debug!(path = %path.display(), %error, "cannot be removed");
            error.kind() == io::ErrorKind::NotFound
        }
    }
}

/// An entry under way; removed again unless it is committed.
#[derive(Debug)]
pub(crate) struct PendingEntry<'a> {
    cache: &'a DiskCache,
    writer: Option<TxWriter<File>>,
    part: PathBuf,
    path: PathBuf,
}

impl PendingEntry<'_> {
    /// Gives the complete file its name, or takes the entry that has it and as many levels: a file that another process
    /// may be reading keeps its name, which reading it over NFS needs.
    fn named(&self, entry: TxFile) -> io::Result<TxFile> {
        if fs::hard_link(&self.part, &self.path).is_ok() {
            fs::remove_file(&self.part)?;
            return Ok(entry);
        }
        let has_enough = |theirs: &TxFile| theirs.description().first_level <= entry.description().first_level;
        if let Some(theirs) = self.cache.find(&entry.description().key).filter(has_enough) {
            fs::remove_file(&self.part)?;
            return Ok(theirs);
        }
        // It has fewer levels or is being removed, or the file system has no links.
        fs::rename(&self.part, &self.path)?;
        Ok(entry)
    }

    /// Completes the file and names it; `None`, with a complaint, if that fails.
    pub(crate) fn commit(mut self) -> Option<TxFile> {
        let writer = self.writer.take()?;
        let ended = writer.finish().and_then(|file| {
            // NFS shows others what was written when the file is closed.
            drop(file);
            // Opened and held before it has its name: from then on another process may remove it.
            let file = oocpt_files::open(&self.part)?;
            let _is_there = oocpt_files::hold(&file);
            self.named(TxFile::open(file)?)
        });
        match ended {
            Ok(entry) => {
                self.cache.added(&self.path, entry.bytes());
                Some(entry)
            }
            Err(error) => {
                self.cache.complain("cannot be written", &error);
                None
            }
        }
    }
}

impl TileSink for PendingEntry<'_> {
    fn tile(&mut self, level: u32, at: [u32; 2], size: [u32; 2], texels: &[u8]) -> Result<(), ImageError> {
        let Some(writer) = &mut self.writer else { return Err(ImageError("the texture cache is closed".into())) };
        writer.tile(level, at, size, texels).map_err(|error| {
            self.cache.complain("cannot be written", &error);
            ImageError(format!("the texture cache cannot be written: {error}"))
        })
    }
}

impl Drop for PendingEntry<'_> {
    fn drop(&mut self) {
        // After a commit the file has another name.
        if self.part.exists() {
            delete(&self.part);
        }
        under_way::end(&self.part);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::textures::ImageInfo;
    use oocpt_core::texture::TexelFormat;

    /// A cache whose folder is removed at the end.
    struct Scratch(DiskCache);

    impl std::ops::Deref for Scratch {
        type Target = DiskCache;

        fn deref(&self) -> &DiskCache {
            &self.0
        }
    }

    impl Drop for Scratch {
        fn drop(&mut self) {
            if self.folder.exists() {
                fs::remove_dir_all(&self.folder).expect("removed");
            }
        }
    }

    fn cache(name: &str, limit: u64) -> Scratch {
        let folder = std::env::temp_dir().join(format!("oocpt-cache-{name}-{}", std::process::id()));
        Scratch(DiskCache::new(folder, limit))
    }

    fn description(key: &str) -> TxDescription {
        let info = ImageInfo {
            levels: vec![[100, 100]],
            channels: 1,
            format: TexelFormat::U8,
            tile_friendly: false,
            is_srgb: None,
            wrap: None,
        };
        TxDescription::new(key, &info, false, 6)
    }

    /// Adds an entry; level 6 of 100 x 100 texels is one texel.
    fn add(cache: &DiskCache, key: &str, texel: u8) -> TxFile {
        let mut pending = cache.begin(description(key)).expect("begun");
        pending.tile(6, [0, 0], [1, 1], &[texel]).expect("written");
        pending.commit().expect("whole")
    }

    fn texel(file: &TxFile) -> u8 {
        let mut out = [0];
        file.tile(6, [0, 0], [1, 1], &mut out).expect("there");
        out[0]
    }

    fn files(cache: &DiskCache) -> usize {
        fs::read_dir(&cache.folder).map_or(0, Iterator::count)
    }

    #[test]
    fn entries_are_found_by_their_key_and_made_anew() {
        let cache = cache("found", 1 << 20);
        assert!(cache.find("a").is_none(), "nothing is there");
        assert_eq!(texel(&add(&cache, "a", 1)), 1, "what was written");
        add(&cache, "b", 2);
        let old = cache.find("a").expect("there");
        assert_eq!(texel(&add(&cache, "a", 3)), 1, "the one that is there");
        cache.remove("a");
        add(&cache, "a", 3);
        assert_eq!(texel(&old), 1, "who has the old one open keeps it");
        assert_eq!(cache.find("a").map(|file| texel(&file)), Some(3), "the new one");
        assert_eq!(cache.find("b").map(|file| texel(&file)), Some(2), "the other");
        // The file of another key under this name is not accepted.
        fs::copy(cache.path("a"), cache.path("c")).expect("copied");
        assert!(cache.find("c").is_none(), "keys are compared, not only their hashes");
        cache.remove("a");
        assert!(cache.find("a").is_none(), "removed");
    }

    #[test]
    fn uncommitted_entries_leave_no_file() {
        let cache = cache("dropped", 1 << 20);
        let mut pending = cache.begin(description("a")).expect("begun");
        pending.tile(6, [0, 0], [1, 1], &[1]).expect("written");
        assert_eq!(files(&cache), 1, "under way");
        drop(pending);
        assert_eq!(files(&cache), 0, "gone");
        let empty = cache.begin(description("a")).expect("begun");
        assert!(empty.commit().is_none(), "its tile is missing");
        assert_eq!((files(&cache), cache.take_complaint().is_some()), (0, true), "gone, with a complaint");
        assert!(cache.begin(description("a")).is_none(), "what has failed once is not tried again");
    }

    #[test]
    fn damaged_entries_are_removed() {
        let cache = cache("damaged", 1 << 20);
        add(&cache, "a", 1);
        fs::write(cache.path("a"), b"II no").expect("written");
        assert!(cache.find("a").is_none(), "damaged");
        assert_eq!(files(&cache), 0, "and removed");
    }

    #[test]
    fn the_oldest_entries_are_evicted_first() {
        let one = add(&cache("one", 0), "0", 1).bytes();
        let cache = cache("limit", 3 * one);
        let age = |key: &str, hours: u64| {
            let then = SystemTime::now() - Duration::from_secs(3600 * hours);
            File::options().append(true).open(cache.path(key)).and_then(|f| f.set_modified(then)).expect("marked");
        };
        for (key, hours) in [("a", 3), ("b", 5), ("c", 4)] {
            add(&cache, key, 1);
            age(key, hours);
        }
        assert!(cache.find("b").is_some(), "it is used, and so the newest");
        let left = cache.path("left").with_extension("1-1.part");
        let foreign = cache.folder.join("wood.tx");
        fs::write(&foreign, b"of the user's own").expect("written");
        fs::write(&left, b"of a process that died").expect("written");
        for old in [&left, &foreign] {
            let days = SystemTime::now() - 3 * STALE;
            File::options().append(true).open(old).and_then(|f| f.set_modified(days)).expect("marked");
        }
        add(&cache, "d", 1);
        let there: Vec<_> = ["a", "b", "c", "d"].into_iter().filter(|key| cache.find(key).is_some()).collect();
        assert_eq!(there, ["a", "b", "d"], "c was not used for longest");
        assert!(!left.exists(), "what was left behind is gone");
        assert!(foreign.exists(), "a file that is none of ours stays");
    }

    /// What another process would find.
    fn another(cache: &DiskCache) -> DiskCache {
        DiskCache::new(cache.folder.clone(), cache.limit)
    }

    #[test]
    fn entries_that_a_process_uses_are_not_evicted() {
        let one = add(&cache("size", 0), "0", 1).bytes();
        let cache = cache("used", 2 * one);
        let (mine, found) = (add(&cache, "a", 1), another(&cache));
        let found = found.find("a").expect("there");
        drop(mine);
        let other = another(&cache);
        for key in 0..20 {
            add(&other, &key.to_string(), 2);
        }
        assert!(another(&cache).find("a").is_some(), "a process has found it");
        assert_eq!(files(&cache), 2, "all others but the newest are gone");
        drop(found);
        add(&other, "b", 2);
        assert!(another(&cache).find("a").is_none(), "nobody uses it");
    }

    #[test]
    fn an_entry_that_a_process_uses_is_not_replaced() {
        use std::os::unix::fs::MetadataExt as _;
        let cache = cache("replaced", 1 << 20);
        let number = || fs::metadata(cache.path("a")).expect("there").ino();
        let first = add(&another(&cache), "a", 1);
        let used = number();
        let second = add(&another(&cache), "a", 1);
        assert_eq!([texel(&first), texel(&second)], [1, 1], "both have an entry");
        assert_eq!((number(), files(&cache)), (used, 1), "the same one, and there is no other file");
    }

    #[test]
    fn processes_that_clean_one_folder_take_nothing_from_each_other() {
        let one = add(&cache("sizes", 0), "0", 1).bytes();
        let cache = cache("together", 4 * one);
        let run = |first: u32| {
            let own = another(&cache);
            for step in 0..200 {
                let value = u8::try_from((first + step * 7) % 12).expect("small");
                let key = value.to_string();
                let entry = own.find(&key).unwrap_or_else(|| add(&own, &key, value));
                assert_eq!(texel(&entry), value, "of its own key");
                // A process that has made room by then found no other use of it. For a moment it may be aside.
                let is_there = |_| {
                    std::thread::yield_now();
                    own.path(&key).exists()
                };
                assert!((0..1 << 20).any(is_there), "{key} is used");
            }
            assert!(own.take_complaint().is_none(), "all could be written");
        };
        std::thread::scope(|scope| {
            for first in [0, 3, 6] {
                scope.spawn(move || run(first));
            }
        });
        drop(add(&another(&cache), "last", 1));
        assert!(files(&cache) <= 4, "within the limit once nobody uses them");
    }

    #[test]
    fn leftovers_of_processes_with_the_same_number_are_in_nobodys_way() {
        let cache = cache("numbers", 1 << 20);
        fs::create_dir_all(&cache.folder).expect("made");
        for number in 0..100 {
            let left = format!("{}-{number}.{UNDER_WAY}", std::process::id());
            fs::write(cache.path("a").with_extension(left), b"").expect("written");
        }
        assert_eq!(texel(&add(&cache, "a", 1)), 1, "processes of containers have the same few numbers");
    }

    #[test]
    fn an_uncreatable_folder_gives_one_warning() {
        let file = std::env::temp_dir().join(format!("oocpt-cache-file-{}", std::process::id()));
        fs::write(&file, b"no folder").expect("written");
        let cache = DiskCache::new(file.join("below"), 1 << 20);
        assert!(cache.begin(description("a")).is_none() && cache.begin(description("b")).is_none(), "no entry");
        let complaint = cache.take_complaint().expect("said");
        assert!(complaint.contains("cannot be written"), "{complaint}");
        assert!(cache.take_complaint().is_none(), "once");
        fs::remove_file(file).expect("removed");
    }
}
