// SPDX-License-Identifier: Apache-2.0
//! Built meshes on disk: the same picture with any host memory, from an earlier process's files, and from damaged ones.

use super::{BEACH, options, request_of, small_chunks};
use crate::scenes::{prim, sphere};
use crate::support::{read_all, render_with_messages};
use glam::{DMat4, DVec3};
use oocpt_core::SceneDb;
use oocpt_core::settings::Settings;
use oocpt_render::{Session, SessionOptions};
use std::fs;
use std::path::PathBuf;

/// A folder that is removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn files(&self) -> Vec<PathBuf> {
        let files = fs::read_dir(&self.0).into_iter().flatten();
        files.map(|file| file.expect("one").path()).collect()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).expect("removed");
    }
}

/// The beach, and meshes that are too large for half a MiB of host memory.
fn build(db: &mut SceneDb) {
    (BEACH.build)(db);
    for (id, rings) in (700..).zip([44, 48, 52, 56]) {
        let place = DMat4::from_translation(DVec3::new(f64::from(rings - 50) / 4.0, 1.0, 0.0));
        db.upsert_mesh(sphere(prim(&format!("/ball{rings}"), place), id, rings, 0.5));
    }
}

/// Three eighths of an eighth of the budget are for meshes where arrays and staging memory take the rest of it: then
/// building any mesh takes more than there is for it.
///
/// Images, messages but for that one, and the bytes of host memory that scene data took.
fn render(host_memory_budget_mib: u32, cache: &str, streams: bool) -> (Vec<Vec<u8>>, Vec<String>, u64) {
    let settings = Settings { host_memory_budget_mib, geometry_cache: cache.into(), ..small_chunks() };
    let session = Session::with_options(settings, SessionOptions { force_streaming: streams, ..options() });
    session.with_scene(build);
    let request = request_of(&BEACH);
    let messages = render_with_messages(&session, &request);
    let bytes = session.stats().host_bytes;
    let mut texts: Vec<String> = messages.into_iter().map(|message| message.text).collect();
    texts.retain(|text| !text.contains("building meshes takes up to"));
    (read_all(&session, &request), texts, bytes)
}

#[test]
fn bits_do_not_depend_on_host_memory_or_stored_meshes() {
    let (whole, messages, all) = render(0, "0", false);
    assert!(messages.is_empty() && all > 1 << 20, "{messages:?}, {all} bytes are enough to test");
    let folder = Folder(std::env::temp_dir().join(format!("oocpt-host-{}", std::process::id())));
    let cache = folder.0.to_str().expect("text").to_owned();

    let same = |what: &str, (images, messages, bytes): (Vec<Vec<u8>>, Vec<String>, u64), told: usize| {
        assert!(images == whole, "{what}: the picture differs");
        assert_eq!(messages.len(), told, "{what}: {messages:?}");
        bytes
    };
    for streams in [false, true] {
        let mut before = 0;
        for budget in [8, 16, 256] {
            let bytes = same("some meshes in memory, the others on disk", render(budget, "", streams), 0);
            assert!(bytes >= before && (bytes < all) == (budget < 256), "{budget} MiB: {bytes} of {all} bytes");
            before = bytes;
        }
        let (images, messages, bytes) = render(8, "0", streams);
        assert!(messages.iter().all(|text| text.contains("there is no file for them")), "{messages:?}");
        same("some meshes, without a disk", (images, Vec::new(), bytes), 0);
        assert_eq!(bytes, all, "they stay in memory");
    }
    same("the first with a cache", render(8, &cache, true), 0);
    let written = folder.files();
    assert_eq!(written.len(), 1, "its file");
    for streams in [false, true] {
        let bytes = same("one that finds all", render(0, &cache, streams), 0);
        assert!(bytes < all, "{bytes} of {all} bytes are in memory");
    }
    assert_eq!(folder.files(), written, "nothing is written again");

    // This is the file as a process leaves it that is killed while it writes.
    let content = fs::read(&written[0]).expect("read");
    fs::write(&written[0], &content[..content.len() / 2]).expect("written");
    same("half a file", render(8, &cache, true), 0);
    folder.files().iter().for_each(|file| fs::remove_file(file).expect("removed"));

    // The heads stay whole, so that all records are found; the last payload of each record is damaged.
    let mut damaged = content.clone();
    let step = 997;
    (0..damaged.len()).skip(step).step_by(step).for_each(|at| damaged[at] ^= 0x55);
    fs::write(&written[0], damaged).expect("written");
    let (images, messages, _) = render(8, &cache, true);
    assert!(images == whole, "a damaged file: the picture differs");
    assert!(messages.len() <= 1 && messages.iter().all(|text| text.contains("built again")), "{messages:?}");
    folder.files().iter().for_each(|file| fs::remove_file(file).expect("removed"));

    // Damage that only payloads have: the last byte of the file is one of the last payload.
    let mut damaged = content;
    let last = damaged.len() - 1;
    damaged[last] ^= 1;
    fs::write(&written[0], damaged).expect("written");
    let told = render(8, &cache, true);
    assert!(told.1.iter().all(|text| text.contains("built again")), "{:?}", told.1);
    same("one damaged payload", told, 1);
}
