// SPDX-License-Identifier: Apache-2.0
//! The pipeline cache, and its file: one for each device, driver version and set of shaders, in a folder of the
//! caller's.
//!
//! A file that is damaged, cut, too large or another device's is ignored and replaced; errors of the disk are only
//! logged. Files are written under another name and renamed, so that readers see a whole one, old or new. The checksum
//! finds accidents, not malice: the contents of the folder are as trusted as the program itself. Any thread.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use ash::vk;
use xxhash_rust::xxh3::xxh3_64;

use crate::device::logical::LogicalDevice;
use crate::error::GpuError;
use crate::instance::probe::ProbedDevice;
use crate::instance::vulkan::vulkan_error;

/// Most bytes of a cache that is read or written.
const MAX_FILE_BYTES: u64 = 64 << 20;
/// Most bytes of all files of the folder; their largest number follows. The files that were not used for longest are
/// removed.
const MAX_FOLDER_BYTES: u64 = 256 << 20;
const MAX_FILES: usize = 16;
/// A file is marked as used no more often than this; an unfinished one that is older was left by a process that died.
const DAY: Duration = Duration::from_secs(24 * 60 * 60);
/// Beginning and end of the names of files, and the end of names of unfinished files (`oocpt_files::replace`).
const PREFIX: &str = "pipelines-";
const ENDING: &str = "bin";
const UNDER_WAY: &str = "tmp";
const MAGIC: [u8; 8] = *b"OocPTpc1";
/// Bytes of the header: magic, payload length, payload checksum.
const HEADER_BYTES: usize = 24;
/// Bytes of Vulkan's own header (version one), with which the payload begins.
const VULKAN_HEADER_BYTES: u32 = 32;

/// The file of one device.
#[derive(Debug)]
pub(crate) struct CacheFile {
    path: PathBuf,
    /// Beginning of the payload for this device and driver.
    vulkan_header: Vec<u8>,
    /// Checksum of the file on the disk, as far as it is known; 0 = there is no usable one.
    stored: AtomicU64,
}

impl CacheFile {
    pub(crate) fn new(folder: &Path, probed: &ProbedDevice, key: u64) -> Self {
        let properties = &probed.properties;
        let uuid: String = probed.device_uuid.iter().map(|byte| format!("{byte:02x}")).collect();
        let name = format!("{PREFIX}{uuid}-{:08x}-{key:016x}.{ENDING}", properties.driver_version);
        let version = vk::PipelineCacheHeaderVersion::ONE.as_raw().to_le_bytes();
        let ids = [VULKAN_HEADER_BYTES, properties.vendor_id, properties.device_id].map(u32::to_le_bytes);
        let vulkan_header = [&ids[0][..], &version, &ids[1], &ids[2], &properties.pipeline_cache_uuid].concat();
        Self { path: folder.join(name), vulkan_header, stored: AtomicU64::new(0) }
    }

    /// The data that the driver stored last time; `None` if there is nothing usable.
    fn load(&self) -> Option<Vec<u8>> {
        let bytes = match oocpt_files::read(&self.path, MAX_FILE_BYTES + HEADER_BYTES as u64) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return None,
            Err(error) => {
                tracing::warn!(%error, path = %self.path.display(), "the pipeline cache was not read");
                return None;
            }
        };
        match payload_of(&bytes, &self.vulkan_header) {
            Ok(payload) => {
                self.stored.store(xxh3_64(payload), Ordering::Relaxed);
                self.mark();
                Some(payload.to_vec())
            }
            Err(reason) => {
                tracing::info!(reason, path = %self.path.display(), "the pipeline cache is ignored");
                None
            }
        }
    }

    /// Replaces the file unless it holds these bytes already.
    fn store(&self, payload: &[u8]) {
        let checksum = xxh3_64(payload);
        if payload.len() as u64 > MAX_FILE_BYTES || self.stored.load(Ordering::Relaxed) == checksum {
            return;
        }
        let folder = self.path.parent().unwrap_or(Path::new("."));
        let written =
            std::fs::create_dir_all(folder).and_then(|()| oocpt_files::replace(&self.path, &file_of(payload)));
        match written {
            Ok(()) => {
                self.stored.store(checksum, Ordering::Relaxed);
                self.clean(folder);
            }
            Err(error) => tracing::warn!(%error, path = %self.path.display(), "the pipeline cache was not written"),
        }
    }

    /// Marks the file as used.
    fn mark(&self) {
        let now = SystemTime::now();
        let is_old = |file: &File| {
            let used = file.metadata().and_then(|metadata| metadata.modified()).ok();
            used.is_some_and(|used| now.duration_since(used).is_ok_and(|age| age > DAY))
        };
        // If the folder cannot be written, the times of its files do not matter.
        let marked =
            oocpt_files::open(&self.path).and_then(|file| if is_old(&file) { file.set_modified(now) } else { Ok(()) });
        tracing::trace!(?marked, "used");
    }

    /// Removes the files that were not used for longest, but not its own, until the bounds of the folder hold.
    fn clean(&self, folder: &Path) {
        let now = SystemTime::now();
        let mut files = Vec::new();
        for file in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let (path, name) = (file.path(), file.file_name());
            let Some(metadata) = file.metadata().ok().filter(std::fs::Metadata::is_file) else { continue };
            if !name.to_str().is_some_and(is_ours) || path == self.path {
                continue;
            }
            let used = metadata.modified().unwrap_or(now);
            match path.extension().and_then(|ending| ending.to_str()) {
                Some(ENDING) => files.push((used, metadata.len(), path)),
                Some(UNDER_WAY) if now.duration_since(used).is_ok_and(|age| age > DAY) => remove(&path),
                _ => {}
            }
        }
        files.sort();
        let own = std::fs::metadata(&self.path).map_or(0, |metadata| metadata.len());
        let mut sum = files.iter().fold(own, |sum, (_, bytes, _)| sum.saturating_add(*bytes));
        let mut count = files.len() + 1;
        for (_, bytes, path) in files {
            if sum <= MAX_FOLDER_BYTES && count <= MAX_FILES {
                break;
            }
            remove(&path);
            (sum, count) = (sum.saturating_sub(bytes), count - 1);
        }
    }
}

/// Returns true if a file of the folder has a name that [`CacheFile::new`] may have given: the user's own stay.
fn is_ours(name: &str) -> bool {
    name.strip_prefix(PREFIX).is_some_and(|rest| {
        let stem = rest.split('.').next().unwrap_or_default();
        stem.bytes().all(|byte| byte.is_ascii_hexdigit() || byte == b'-')
    })
}

fn remove(path: &Path) {
    // Another process may have been faster.
    if let Err(error) = std::fs::remove_file(path) {
        tracing::debug!(%error, path = %path.display(), "not removed");
    }
}

fn file_of(payload: &[u8]) -> Vec<u8> {
    let (length, checksum) = ((payload.len() as u64).to_le_bytes(), xxh3_64(payload).to_le_bytes());
    [&MAGIC[..], &length, &checksum, payload].concat()
}

/// The payload of a file, or the reason why it is unusable.
fn payload_of<'a>(file: &'a [u8], vulkan_header: &[u8]) -> Result<&'a [u8], &'static str> {
    let (header, payload) = file.split_at_checked(HEADER_BYTES).ok_or("cut")?;
    if header[..8] != MAGIC {
        return Err("no pipeline cache");
    }
    if header[8..16] != (payload.len() as u64).to_le_bytes() {
        return Err("cut, or too long");
    }
    if header[16..] != xxh3_64(payload).to_le_bytes() {
        return Err("damaged");
    }
    if !payload.starts_with(vulkan_header) {
        return Err("of another device or driver");
    }
    Ok(payload)
}

/// The pipelines compiled so far; written to the file, if there is one, when it is dropped.
#[derive(Debug)]
pub(crate) struct PipelineCache {
    device: Arc<LogicalDevice>,
    raw: vk::PipelineCache,
    file: Option<CacheFile>,
}

impl PipelineCache {
    /// Creates the cache, from the file if there is one.
    pub(crate) fn new(device: &Arc<LogicalDevice>, file: Option<CacheFile>) -> Result<Self, GpuError> {
        let stored = file.as_ref().and_then(CacheFile::load).unwrap_or_default();
        let info = vk::PipelineCacheCreateInfo::default().initial_data(&stored);
        // SAFETY: the device is alive; the data is empty, or was checked to be what this driver gave for this device.
        let mut cache = unsafe { device.raw.create_pipeline_cache(&info, None) };
        if cache.is_err() && !stored.is_empty() {
            let info = vk::PipelineCacheCreateInfo::default();
            // SAFETY: as above, without data.
            cache = unsafe { device.raw.create_pipeline_cache(&info, None) };
        }
        let raw = cache.map_err(|code| vulkan_error("vkCreatePipelineCache", code))?;
        Ok(Self { device: Arc::clone(device), raw, file })
    }

    /// Handle for the creation of pipelines; valid as long as `self`.
    pub(crate) fn raw(&self) -> vk::PipelineCache {
        self.raw
    }

    /// Writes the cache to its file, if it has one.
    pub(crate) fn save(&self) {
        let Some(file) = &self.file else { return };
        if self.device.check_alive().is_err() {
            return;
        }
        // SAFETY: the cache is alive and of this device; it synchronises itself.
        match unsafe { self.device.raw.get_pipeline_cache_data(self.raw) } {
            Ok(payload) => file.store(&payload),
            Err(code) => tracing::warn!("vkGetPipelineCacheData failed: {code:?}"),
        }
    }
}

impl Drop for PipelineCache {
    fn drop(&mut self) {
        self.save();
        // SAFETY: no pipeline is being made: each making borrows the cache's owner.
        unsafe { self.device.raw.destroy_pipeline_cache(self.raw, None) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_files_of_the_same_device_are_used() {
        let payload = [&b"device"[..], &[7; 100]].concat();
        let good = file_of(&payload);
        assert_eq!(payload_of(&good, b"device"), Ok(&payload[..]), "as written");
        assert_eq!(payload_of(&good, b"driver"), Err("of another device or driver"), "foreign");
        for length in 0..good.len() {
            assert!(payload_of(&good[..length], b"device").is_err(), "cut at {length}");
        }
        assert!(payload_of(&[&good[..], &[0]].concat(), b"device").is_err(), "longer than it says");
        for i in 0..good.len() {
            let mut bad = good.clone();
            bad[i] ^= 1;
            assert!(payload_of(&bad, b"device").is_err(), "a bit of byte {i} flipped");
        }
    }

    #[test]
    fn files_are_replaced_whole_and_only_when_needed() {
        let folder = std::env::temp_dir().join(format!("oocpt-cache-{}", std::process::id())).join("made when needed");
        let new = || CacheFile {
            path: folder.join("pipelines.bin"),
            vulkan_header: b"device".to_vec(),
            stored: AtomicU64::new(0),
        };
        let file = new();
        assert_eq!(file.load(), None, "nothing there");
        file.store(b"device one");
        assert_eq!(new().load().as_deref(), Some(&b"device one"[..]), "found again");
        std::fs::write(&file.path, b"planted").expect("writable");
        file.store(b"device one");
        assert_eq!(std::fs::read(&file.path).expect("readable"), b"planted", "the same bytes are not written again");
        assert_eq!(new().load(), None, "damaged");
        file.store(b"device two");
        assert_eq!(new().load().as_deref(), Some(&b"device two"[..]), "replaced");
        let names: Vec<_> =
            std::fs::read_dir(&folder).expect("readable").map(|e| e.expect("entry").file_name()).collect();
        assert_eq!(names, ["pipelines.bin"], "nothing else is left there");
        let huge = vec![1; usize::try_from(MAX_FILE_BYTES).expect("small") + 1];
        file.store(&huge);
        assert_eq!(new().load().as_deref(), Some(&b"device two"[..]), "too large to be stored");
        std::fs::remove_dir_all(folder.parent().expect("made above")).expect("own files can be removed");
    }

    #[test]
    fn files_that_were_not_used_for_longest_go() {
        let folder = std::env::temp_dir().join(format!("oocpt-caches-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        let plant = |name: &str, days: u32| {
            let path = folder.join(name);
            std::fs::write(&path, b"x").expect("writable");
            let file = File::options().append(true).open(&path).expect("there");
            file.set_modified(SystemTime::now() - DAY * days).expect("a time");
        };
        for day in 1..30 {
            plant(&format!("pipelines-00-{day:08x}-00.bin"), day);
        }
        plant("pipelines-00-00-00.bin.7-0.tmp", 2);
        plant("pipelines-00-00-01.bin.8-0.tmp", 0);
        plant("pipelines-of-mine.bin", 90);
        plant("letter.txt", 90);
        let own = CacheFile {
            path: folder.join("pipelines-00-0000002a-00.bin"),
            vulkan_header: b"device".to_vec(),
            stored: AtomicU64::new(0),
        };
        own.store(b"device");
        let mut names: Vec<String> = std::fs::read_dir(&folder)
            .expect("readable")
            .map(|entry| entry.expect("entry").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        let mut expected: Vec<String> = (1..MAX_FILES).map(|day| format!("pipelines-00-{day:08x}-00.bin")).collect();
        let others =
            ["letter.txt", "pipelines-00-00-01.bin.8-0.tmp", "pipelines-of-mine.bin", "pipelines-00-0000002a-00.bin"];
        expected.extend(others.map(str::to_owned));
        expected.sort();
        assert_eq!(names, expected, "the newest, its own, what is under way, and what others keep there");
        std::fs::remove_dir_all(&folder).expect("own files can be removed");
    }
}
