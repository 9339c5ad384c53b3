// SPDX-License-Identifier: Apache-2.0
//! Built meshes on disk: those that find no room in host memory, and with `oocpt:geometryCache` all, for the next
//! process.
//!
//! Without that setting they go to a file that has no name once it is open, so that nothing is left behind however the
//! process ends. With it, they go to a file of this process in that folder ([`pack`]); files of other processes are
//! read, too, and the least recently used ones are removed if all together exceed the limit, but none that a process
//! writes or has found an entry in. Any thread.

mod pack;
#[cfg(test)]
mod tests;

use crate::device::cache_folder::cache_folder;
use crate::job::request::Severity;
use crate::job::shared::SharedState;
use crate::sync::lock;
use oocpt_core::mesh::{MeshFiles, PayloadError, PayloadSource, StoredEntry};
use oocpt_core::settings::Settings;
use pack::PackFile;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, SystemTime};

/// The extension of the files.
const ENDING: &str = "oocptgeo";

/// The settings of the cache.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct GeometrySetting {
    folder: PathBuf,
    is_persistent: bool,
    /// Limit of all persistent files, bytes.
    limit: u64,
}

impl GeometrySetting {
    /// Parses the setting: "0" means none; empty means the user's own folder, for files that do not last; otherwise a
    /// folder for permanent files.
    pub(crate) fn of(settings: &Settings) -> Option<Self> {
        let limit = u64::from(settings.geometry_cache_mib) << 20;
        match settings.geometry_cache.as_str() {
            "0" => None,
            "" => Some(Self { folder: cache_folder("geometry")?, is_persistent: false, limit }),
            path => Some(Self { folder: PathBuf::from(path), is_persistent: true, limit }),
        }
    }
}

/// The files that this process writes and reads.
#[derive(Debug)]
pub(crate) struct GeometryFiles {
    setting: GeometrySetting,
    packs: Mutex<PackFiles>,
    /// True if a write failed; nothing is written from then on.
    failed: AtomicBool,
    /// True if the user was told of a damaged entry.
    is_reported: AtomicBool,
    shared: Weak<SharedState>,
}

#[derive(Debug, Default)]
struct PackFiles {
    /// The files of other processes; `None` before they were looked for.
    others: Option<Vec<Arc<PackFile>>>,
    /// The persistent pack that this process writes.
    own: Option<Arc<PackFile>>,
    /// The pack that is deleted with this process.
    scratch: Option<Arc<PackFile>>,
    /// Bytes of the files of other processes, when they were last measured.
    others_bytes: Option<u64>,
    /// Other processes use what takes the room: nothing is added any more.
    is_full: bool,
    /// Files of other processes that are already marked as used.
    marked: Vec<PathBuf>,
}

impl GeometryFiles {
    /// Creates the cache; files are opened when they are needed. Complaints go to `shared`.
    pub(crate) fn new(setting: GeometrySetting, shared: &Arc<SharedState>) -> Self {
        Self {
            setting,
            packs: Mutex::default(),
            failed: AtomicBool::new(false),
            is_reported: AtomicBool::new(false),
            shared: Arc::downgrade(shared),
        }
    }

    pub(crate) fn setting(&self) -> &GeometrySetting {
        &self.setting
    }

    fn complain(&self, text: String) {
        tracing::debug!("{text}");
        if let Some(shared) = self.shared.upgrade() {
            shared.report(Severity::Warning, text);
        }
    }

    /// The file that `bytes` more go to, and whether they last there.
    fn pack_for(&self, is_persistent: bool, bytes: u64) -> io::Result<(Arc<PackFile>, bool)> {
        let mut packs = lock(&self.packs);
        let is_persistent = is_persistent && self.make_room(&mut packs, bytes);
        let slot = if is_persistent { &mut packs.own } else { &mut packs.scratch };
        let pack = match slot {
            Some(pack) => pack.clone(),
            none => none.insert(Arc::new(self.begin(is_persistent)?)).clone(),
        };
        Ok((pack, is_persistent))
    }

    /// A new file.
    fn begin(&self, is_persistent: bool) -> io::Result<PackFile> {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_nanos();
        let name = format!("{now:024x}-{}.{ENDING}", oocpt_files::unique_number());
        let path = self.setting.folder.join(name);
        let create = || File::options().read(true).write(true).create_new(true).open(&path);
        let file = oocpt_files::create_in(&self.setting.folder, create)?;
        if is_persistent {
            let is_there = oocpt_files::hold(&file);
            tracing::trace!(is_there, path = %path.display(), "new geometry file");
            return Ok(PackFile::new(file, Some(path)));
        }
        match fs::remove_file(&path) {
            // A process that makes room was faster.
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(PackFile::new(file, None)),
        }
    }

    /// Removes files of other processes until there is room for `bytes`; returns false if that is not enough.
    fn make_room(&self, packs: &mut PackFiles, bytes: u64) -> bool {
        let needed = packs.own.as_ref().map_or(0, |own| own.bytes()).saturating_add(bytes);
        if needed > self.setting.limit || packs.is_full {
            return false;
        }
        let own = packs.own.as_ref().and_then(|own| own.path()).cloned();
        // The folder is measured again only if it may matter.
        if needed.saturating_add(packs.others_bytes.unwrap_or(u64::MAX)) <= self.setting.limit {
            return true;
        }
        let mut others = files_of(&self.setting.folder);
        others.retain(|file| Some(&file.path) != own.as_ref());
        others.sort_by_key(|file| file.used);
        let mut sum: u64 = others.iter().map(|file| file.bytes).sum();
        for file in others {
            if needed.saturating_add(sum) <= self.setting.limit {
                break;
            }
            if remove(&file.path) {
                sum = sum.saturating_sub(file.bytes);
            }
        }
        packs.others_bytes = Some(sum);
        packs.is_full = needed.saturating_add(sum) > self.setting.limit;
        !packs.is_full
    }

    /// The files that may have an entry, opened at the first call.
    fn known(&self) -> Vec<Arc<PackFile>> {
        let mut packs = lock(&self.packs);
        let own = packs.own.clone();
        let others = packs.others.get_or_insert_with(|| {
            let mut files = files_of(&self.setting.folder);
            files.sort_by_key(|file| std::cmp::Reverse(file.used));
            let own = own.as_ref().and_then(|own| own.path());
            let open = |file: FileOfFolder| {
                let opened = PackFile::open(file.path).inspect_err(|error| tracing::debug!(%error, "a geometry file"));
                opened.ok().map(Arc::new)
            };
            files.into_iter().filter(|file| Some(&file.path) != own).filter_map(open).collect()
        });
        own.into_iter().chain(others.iter().cloned()).collect()
    }

    /// Marks a file of another process as used.
    fn mark(&self, pack: &PackFile) {
        let mut packs = lock(&self.packs);
        if let Some(path) = pack.path().filter(|path| !packs.marked.contains(path)).cloned() {
            packs.marked.push(path);
            pack.mark();
        }
    }
}

impl MeshFiles for GeometryFiles {
    fn wait(&self, pause: Duration) {
        std::thread::sleep(pause);
    }

    fn is_persistent(&self) -> bool {
        self.setting.is_persistent
    }

    fn find(&self, key: u128) -> Option<StoredEntry> {
        for pack in self.known() {
            match pack.find(key) {
                Some(Ok(entry)) => {
                    self.mark(&pack);
                    return Some(entry);
                }
                Some(Err(error)) => {
                    self.damaged(Some(key), &error);
                    return None;
                }
                None => {}
            }
        }
        None
    }

    fn add(&self, key: Option<u128>, head: &[u8], payloads: &[Vec<&[u8]>]) -> Option<Vec<Arc<dyn PayloadSource>>> {
        if self.failed.load(Ordering::Relaxed) {
            return None;
        }
        let bytes = payloads.iter().flatten().map(|part| part.len() as u64).sum();
        let is_persistent = self.setting.is_persistent && key.is_some();
        let added = self.pack_for(is_persistent, bytes).and_then(|(pack, is_persistent)| {
            let key = key.filter(|_| is_persistent).unwrap_or(0);
            pack.append(key, head, payloads)
        });
        match added {
            Ok(payloads) => Some(payloads),
            Err(error) => {
                if !self.failed.swap(true, Ordering::Relaxed) {
                    let written = self.bytes() >> 20;
                    self.complain(format!(
                        "geometry files in {}: {error} after {written} MiB; from now on geometry stays in memory",
                        self.setting.folder.display()
                    ));
                }
                None
            }
        }
    }

    fn damaged(&self, key: Option<u128>, error: &PayloadError) {
        for pack in self.known().iter().filter(|pack| key.is_some_and(|key| pack.has(key))) {
            // No later lookup should find the damaged entry. Who else uses the file, or writes it, keeps it.
            pack.forget();
            if let Some(path) = pack.path() {
                remove(path);
            }
        }
        if !self.is_reported.swap(true, Ordering::Relaxed) {
            let folder = self.setting.folder.display();
            self.complain(format!("geometry files in {folder}: {error}; what cannot be read is built again"));
        }
    }
}

impl GeometryFiles {
    /// Bytes that this process has written.
    pub(crate) fn bytes(&self) -> u64 {
        let packs = lock(&self.packs);
        [&packs.own, &packs.scratch].into_iter().flatten().map(|pack| pack.bytes()).sum()
    }
}

/// A file of the folder with a name of ours.
struct FileOfFolder {
    path: PathBuf,
    used: SystemTime,
    bytes: u64,
}

fn files_of(folder: &Path) -> Vec<FileOfFolder> {
    let file = |entry: fs::DirEntry| {
        let path = entry.path();
        let metadata = entry.metadata().ok().filter(fs::Metadata::is_file)?;
        let used = metadata.modified().unwrap_or(SystemTime::UNIX_EPOCH);
        let is_ours = path.extension().is_some_and(|ending| ending == ENDING);
        is_ours.then_some(FileOfFolder { path, used, bytes: metadata.len() })
    };
    fs::read_dir(folder).into_iter().flatten().flatten().filter_map(file).collect()
}

/// Removes a file that no process uses. Returns true if it is gone; another process may have been faster.
fn remove(path: &Path) -> bool {
    match oocpt_files::remove_unused(path) {
        Ok(is_removed) => is_removed,
        Err(error) => {
            tracing::debug!(path = %path.display(), %error, "cannot be removed");
            error.kind() == io::ErrorKind::NotFound
        }
    }
}
