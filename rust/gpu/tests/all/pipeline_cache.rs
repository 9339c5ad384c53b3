// SPDX-License-Identifier: Apache-2.0
//! Compiled pipelines on disk: found again, and never trusted blindly.

use std::path::{Path, PathBuf};

use oocpt_gpu::{Buffer, BufferUsage, Heap, OpenOptions};

use crate::support::{self, affine, affine_push, finish, read_words};

/// A folder of this test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        Self(Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}", std::process::id())))
    }

    fn files(&self) -> Vec<PathBuf> {
        let Ok(entries) = std::fs::read_dir(&self.0) else { return Vec::new() };
        entries.map(|entry| entry.expect("readable").path()).collect()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).ok();
    }
}

/// Opens a device with its cache in `folder`, and computes something.
fn render(folder: &Folder) {
    let gpu = support::open_with(&OpenOptions { pipeline_cache: Some(folder.0.clone()), ..support::options() });
    let pipeline = affine(&gpu, 3);
    let data = Buffer::new(&gpu, "data", 256, BufferUsage::Readback).expect("memory");
    let mut commands = gpu.commands("work").expect("a command list");
    commands.fill(&data, 0, 256, 5);
    commands.dispatch(&pipeline, &affine_push(data.address(), data.address(), 64, 1), [1, 1, 1]);
    finish(&commands.submit().expect("submitted"));
    assert_eq!(read_words(&data, 64), [16; 64], "whatever the cache is like");
}

#[test]
fn one_file_is_kept_and_replaced_when_it_is_bad() {
    let folder = Folder::new("cache");
    render(&folder);
    let files = folder.files();
    assert_eq!(files.len(), 1, "one file for the device: {files:?}");
    let good = std::fs::read(&files[0]).expect("readable");
    render(&folder);
    assert_eq!(folder.files(), files, "used, not added to");
    let mut foreign = good.clone();
    // The vendor in Vulkan's header; the checksum tells, and so would the header.
    foreign[24 + 8] ^= 0xFF;
    let bad = [Vec::new(), vec![0xA5; 1000], good[..good.len() - 1].to_vec(), [&good[..], b"more"].concat(), foreign];
    for (i, bytes) in bad.iter().enumerate() {
        std::fs::write(&files[0], bytes).expect("writable");
        render(&folder);
        let healed = std::fs::read(&files[0]).expect("readable");
        assert!(healed != *bytes && healed.starts_with(b"OocPTpc1"), "bad file {i} was kept");
    }
    assert_eq!(folder.files(), files, "nothing is left beside it");
}

#[test]
fn it_can_be_saved_before_closing() {
    let folder = Folder::new("saved");
    let gpu = support::open_with(&OpenOptions { pipeline_cache: Some(folder.0.clone()), ..support::options() });
    let pipeline = affine(&gpu, 2);
    assert_eq!(folder.files().len(), 0, "not yet");
    gpu.save_pipeline_cache();
    assert_eq!(folder.files().len(), 1, "written");
    drop((pipeline, gpu));
}

#[test]
fn it_is_saved_when_the_handle_goes() {
    let folder = Folder::new("outlived");
    let gpu = support::open_with(&OpenOptions { pipeline_cache: Some(folder.0.clone()), ..support::options() });
    let (pipeline, heap) = (affine(&gpu, 2), Heap::new(&gpu, "heap", 1 << 20).expect("a heap"));
    drop(gpu);
    assert_eq!(folder.files().len(), 1, "whatever outlives it");
    drop((pipeline, heap));
}

#[test]
fn a_folder_that_cannot_be_is_no_failure() {
    let folder = Folder::new("file-in-the-way");
    std::fs::write(&folder.0, b"no folder").expect("writable");
    render(&folder);
    assert_eq!(std::fs::read(&folder.0).expect("readable"), b"no folder", "left alone");
    std::fs::remove_file(&folder.0).expect("own files can be removed");
}
