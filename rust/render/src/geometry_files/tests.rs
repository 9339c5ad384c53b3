// SPDX-License-Identifier: Apache-2.0
//! Files of built meshes: records that are found, rejected and removed.

use super::pack::PackFile;
use super::{GeometryFiles, GeometrySetting};
use crate::job::shared::SharedState;
use oocpt_core::mesh::{MeshFiles, PayloadError, PayloadSource};
use oocpt_core::settings::Settings;
use std::fs::{self, File};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

/// A folder that is removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("oocpt-geometry-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("made");
        Self(folder)
    }

    fn files(&self) -> Vec<PathBuf> {
        let mut files: Vec<PathBuf> =
            fs::read_dir(&self.0).expect("read").map(|file| file.expect("one").path()).collect();
        files.sort();
        files
    }

    fn open(&self, is_persistent: bool, limit: u64) -> (GeometryFiles, Arc<SharedState>) {
        let shared = Arc::default();
        let setting = GeometrySetting { folder: self.0.clone(), is_persistent, limit };
        (GeometryFiles::new(setting, &shared), shared)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).expect("removed");
    }
}

fn read(payload: &Arc<dyn PayloadSource>) -> Result<Vec<u8>, PayloadError> {
    let mut bytes = vec![0; usize::try_from(payload.size()).expect("small")];
    let (first, rest) = bytes.split_at_mut(payload.size().min(3) as usize);
    payload.read(&mut [first, rest])?;
    Ok(bytes)
}

fn add(files: &GeometryFiles, key: u128, byte: u8, count: usize) -> Vec<Arc<dyn PayloadSource>> {
    let (small, large) = (vec![byte; 5], vec![byte; count]);
    files.add(Some(key), &[byte; 4], &[vec![&small, &[]], vec![&large, &[byte, byte]]]).expect("written")
}

fn found(files: &GeometryFiles, key: u128) -> Option<Vec<Vec<u8>>> {
    let entry = files.find(key)?;
    let payloads = entry.payloads.iter().map(|payload| read(payload).expect("whole"));
    Some(std::iter::once(entry.head).chain(payloads).collect())
}

fn messages(shared: &SharedState) -> Vec<String> {
    crate::sync::lock(&shared.messages).iter().map(|message| message.text.clone()).collect()
}

#[test]
fn stored_entries_are_found_in_this_and_later_processes() {
    let folder = Folder::new("back");
    let (first, shared) = folder.open(true, u64::MAX);
    let stored = add(&first, 7, 1, 1 << 20);
    add(&first, 8, 2, 10);
    let expected = |byte: u8, count: usize| Some(vec![vec![byte; 4], vec![byte; 5], vec![byte; count + 2]]);
    assert_eq!(read(&stored[1]), Ok(vec![1; (1 << 20) + 2]));
    assert_eq!((found(&first, 7), found(&first, 8)), (expected(1, 1 << 20), expected(2, 10)));
    let (second, _) = folder.open(true, u64::MAX);
    assert_eq!((found(&second, 7), found(&second, 8)), (expected(1, 1 << 20), expected(2, 10)));
    assert!(found(&second, 9).is_none() && found(&second, 0).is_none());
    assert_eq!(folder.files().len(), 1, "the second one has written nothing");
    assert!(messages(&shared).is_empty());
    assert_eq!(stored[0].read(&mut [&mut [0; 4]]), Err(PayloadError::Damaged), "parts of another size");
}

#[test]
fn a_scratch_store_leaves_no_files() {
    let folder = Folder::new("scratch");
    let (files, _) = folder.open(false, u64::MAX);
    let stored = add(&files, 7, 1, 1000);
    assert!(folder.files().is_empty(), "the file has no name");
    assert_eq!(read(&stored[1]), Ok(vec![1; 1002]), "and can be read");
    assert!(found(&files, 7).is_none() && files.bytes() >= 1000);
}

#[test]
fn a_truncated_file_gives_its_complete_entries() {
    let folder = Folder::new("cut");
    let (files, _) = folder.open(true, u64::MAX);
    for key in 1..6 {
        add(&files, key, 3, 100);
    }
    let path = folder.files().remove(0);
    let whole = fs::read(&path).expect("read");
    let record = whole.len().next_multiple_of(64) / 5;
    for length in (0..whole.len()).step_by(37) {
        fs::write(&path, &whole[..length]).expect("written");
        let pack = PackFile::open(path.clone()).expect("opened");
        for key in 1..6 {
            // The last record has no padding after it.
            let is_whole = (key as usize - 1) * record + whole.len() - 4 * record <= length;
            assert_eq!(pack.has(key), is_whole, "key {key} at {length} of {}", whole.len());
        }
    }
}

#[test]
fn any_corrupt_byte_is_detected_and_reported_once() {
    let folder = Folder::new("damaged");
    let (files, _) = folder.open(true, u64::MAX);
    add(&files, 1, 9, 100);
    drop(files);
    let path = folder.files().remove(0);
    let whole = fs::read(&path).expect("read");
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        fs::write(&path, &bytes).expect("written");
        let (files, shared) = folder.open(true, u64::MAX);
        let Some(entry) = files.find(1) else {
            continue;
        };
        let errors = entry.payloads.iter().filter(|payload| read(payload) == Err(PayloadError::Damaged)).count();
        assert_eq!(errors, 1, "byte {at}");
        for _ in 0..2 {
            files.damaged(Some(1), &PayloadError::Damaged);
        }
        assert_eq!(messages(&shared).len(), 1, "told once");
        assert!(!path.exists() && files.find(1).is_none(), "nobody meets it again");
    }
    fs::write(&path, &whole[..40]).expect("written");
    let (files, shared) = folder.open(true, u64::MAX);
    assert!(files.find(1).is_none() && messages(&shared).is_empty(), "a process that died is no damage");
}

#[test]
fn hostile_headers_allocate_nothing() {
    let folder = Folder::new("hostile");
    let (files, _) = folder.open(true, u64::MAX);
    add(&files, 1, 9, 100);
    let path = folder.files().remove(0);
    let mut bytes = fs::read(&path).expect("read");
    // Sizes are beyond the file, with a right hash of the header.
    for (at, value) in [(32, u64::MAX), (40, u64::MAX), (32, 1 << 60), (8, u64::MAX)] {
        let old: [u8; 8] = bytes[at..at + 8].try_into().expect("eight");
        bytes[at..at + 8].copy_from_slice(&u64::to_le_bytes(value));
        let hash = xxhash_rust::xxh3::xxh3_64(&bytes[..56]);
        bytes[56..64].copy_from_slice(&hash.to_le_bytes());
        fs::write(&path, &bytes).expect("written");
        let (files, _) = folder.open(true, u64::MAX);
        assert!(files.find(1).is_none(), "{value} at {at}");
        bytes[at..at + 8].copy_from_slice(&old);
    }
}

#[test]
fn the_oldest_foreign_files_are_evicted() {
    let folder = Folder::new("limit");
    let age = |path: &PathBuf, hours: u64| {
        let then = SystemTime::now() - Duration::from_secs(3600 * hours);
        File::options().append(true).open(path).and_then(|file| file.set_modified(then)).expect("marked");
    };
    for (key, hours) in [(1, 9), (2, 5), (3, 7)] {
        let before = folder.files();
        let (files, _) = folder.open(true, u64::MAX);
        add(&files, key, 3, 1000);
        age(folder.files().iter().find(|path| !before.contains(path)).expect("a new one"), hours);
    }
    let foreign = folder.0.join("wood.txt");
    fs::write(&foreign, vec![0; 10_000]).expect("written");
    let one = fs::metadata(&folder.files()[0]).expect("there").len();
    let (files, _) = folder.open(true, 3 * one + 200);
    assert!(found(&files, 1).is_some(), "used now, so the newest");
    add(&files, 4, 4, 1000);
    let left: Vec<u128> = (1..5).filter(|key| found(&folder.open(true, u64::MAX).0, *key).is_some()).collect();
    assert_eq!(left, [1, 2, 4], "3 was not used for longest");
    assert!(foreign.exists(), "a file that is none of ours stays");
    // Entries beyond the limit go to the file that does not last.
    let stored = add(&files, 5, 5, 4000);
    assert_eq!(read(&stored[1]), Ok(vec![5; 4002]));
    assert!(found(&folder.open(true, u64::MAX).0, 5).is_none());
}

#[test]
fn files_that_a_process_uses_are_not_evicted() {
    let folder = Folder::new("used");
    let (first, _) = folder.open(true, u64::MAX);
    add(&first, 1, 1, 1000);
    let one = fs::metadata(&folder.files()[0]).expect("there").len();
    let second = || folder.open(true, one + one / 2).0;
    let there = |key: u128| found(&folder.open(true, u64::MAX).0, key).is_some();
    add(&second(), 2, 2, 1000);
    assert!(there(1) && !there(2), "the first process may write more");
    let (reader, _) = folder.open(true, u64::MAX);
    assert!(found(&reader, 1).is_some());
    drop(first);
    let stored = add(&second(), 2, 2, 1000);
    assert_eq!(read(&stored[1]), Ok(vec![2; 1002]), "what does not last can be read");
    assert!(there(1) && !there(2), "a process has found something in it");
    drop(reader);
    add(&second(), 2, 2, 1000);
    assert!(!there(1) && there(2), "nobody uses it");
}

#[test]
fn processes_that_clean_one_folder_take_nothing_from_each_other() {
    let folder = Folder::new("together");
    let run = |first: u128| {
        for step in 0..40 {
            let key = 1 + (first + step * 7) % 12;
            let (files, shared) = folder.open(true, 5000);
            let byte = u8::try_from(key).expect("small");
            let expected = [vec![byte; 4], vec![byte; 5], vec![byte; 1002]];
            match found(&files, key) {
                Some(entry) => assert_eq!(entry, expected, "of its own key"),
                None => assert_eq!(read(&add(&files, key, byte, 1000)[1]), Ok(expected[2].clone())),
            }
            assert!(messages(&shared).is_empty(), "all could be written and read");
        }
    };
    std::thread::scope(|scope| {
        for first in [0, 3, 6] {
            scope.spawn(move || run(first));
        }
    });
    let (files, _) = folder.open(true, 5000);
    add(&files, 100, 1, 1000);
    let bytes: u64 = folder.files().iter().map(|file| fs::metadata(file).expect("there").len()).sum();
    assert!(bytes <= 5000, "{bytes} within the limit once nobody uses them");
}

#[test]
fn an_unwritable_folder_gives_one_warning() {
    let folder = Folder::new("file");
    let file = folder.0.join("file");
    fs::write(&file, b"no folder").expect("written");
    let shared = Arc::default();
    let files = GeometryFiles::new(
        GeometrySetting { folder: file.join("below"), is_persistent: true, limit: 1 << 20 },
        &shared,
    );
    for _ in 0..2 {
        assert!(files.add(Some(1), &[], &[]).is_none() && files.find(1).is_none());
    }
    let messages = messages(&shared);
    assert!(messages.len() == 1 && messages[0].contains("stays in memory"), "{messages:?}");
}

#[test]
fn the_setting_names_the_folder() {
    let of = |cache: &str| GeometrySetting::of(&Settings { geometry_cache: cache.into(), ..Settings::default() });
    assert_eq!(of("0"), None);
    let given = of("/x/y").expect("a folder");
    assert_eq!((given.folder.to_str(), given.is_persistent, given.limit), (Some("/x/y"), true, 32 << 30));
    let own = of("").expect("the user's");
    assert!(own.folder.ends_with("oocpt/geometry") && !own.is_persistent);
}
