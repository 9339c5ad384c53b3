// SPDX-License-Identifier: Apache-2.0
//! Files written, read, and damaged.

#![expect(clippy::cast_possible_truncation, reason = "images of tests are small")]

use super::*;
use std::fs::File;
use std::path::PathBuf;

/// A folder of its own, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("oocpt-tx-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a folder");
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).expect("removed");
    }
}

fn info(size: [u32; 2], channels: u32, format: TexelFormat) -> ImageInfo {
    let wrap = Some([Wrap::Repeat, Wrap::Mirror]);
    ImageInfo { levels: vec![size], channels, format, tile_friendly: false, is_srgb: Some(true), wrap }
}

fn byte(level: u32, x: u32, y: u32, k: usize) -> u8 {
    ((level * 31 + x * 7 + y * 13) as usize + k * 3) as u8
}

/// Level, place, size and texels of a tile.
type Tile = (u32, [u32; 2], [u32; 2], Vec<u8>);

/// The tiles of an image and what they hold.
fn tiles(description: &TxDescription) -> Vec<Tile> {
    let mut all = Vec::new();
    for (level, cut) in (description.first_level..).zip(description.levels()) {
        for row in 0..cut.tiles[1] {
            for column in 0..cut.tiles[0] {
                let at = [column * cut.tile[0], row * cut.tile[1]];
                let size = [0, 1].map(|k: usize| cut.tile[k].min(cut.size[k] - at[k]));
                let mut texels = Vec::new();
                for y in at[1]..at[1] + size[1] {
                    for x in at[0]..at[0] + size[0] {
                        texels.extend((0..description.texel_bytes()).map(|k| byte(level, x, y, k)));
                    }
                }
                all.push((level, at, size, texels));
            }
        }
    }
    all
}

fn write(path: &PathBuf, description: &TxDescription) {
    let mut writer = TxWriter::new(File::create(path).expect("created"), description.clone()).expect("begun");
    // In an order of no kind.
    let mut tiles = tiles(description);
    tiles.sort_by_key(|(level, at, ..)| (at[0].wrapping_mul(0x9e37_79b9) ^ at[1], *level));
    for (level, at, size, texels) in tiles {
        writer.tile(level, at, size, &texels).expect("written");
    }
    writer.finish().expect("finished");
}

#[test]
fn every_tile_round_trips() {
    let folder = Folder::new("back");
    for size in [[1, 1], [300, 260], [16384, 1], [128, 128], [129, 3]] {
        for (channels, format) in
            [(1, TexelFormat::U8), (3, TexelFormat::U8), (2, TexelFormat::F16), (4, TexelFormat::F32)]
        {
            for first in [0, 1, 3] {
                let description = TxDescription::new("key", &info(size, channels, format), false, first);
                if !description.is_possible() {
                    continue;
                }
                let path = folder.0.join("a.tx");
                write(&path, &description);
                let file = TxFile::open(File::open(&path).expect("there")).expect("whole");
                assert_eq!(file.description(), &description, "{size:?}");
                assert_eq!(file.description().info(), info(size, channels, format), "what the source said");
                for (level, at, size, texels) in tiles(&description) {
                    let mut out = vec![0; texels.len()];
                    file.tile(level, at, size, &mut out).expect("there");
                    assert!(out == texels, "level {level}, {at:?}");
                }
                if first > 0 {
                    assert!(file.tile(first - 1, [0, 0], [1, 1], &mut [0; 16]).is_err(), "a level that is not there");
                }
            }
        }
    }
}

#[test]
fn an_unfinished_file_is_not_found() {
    let folder = Folder::new("half");
    let description = TxDescription::new("key", &info([300, 260], 4, TexelFormat::U8), false, 0);
    let path = folder.0.join("a.tx");
    let mut writer = TxWriter::new(File::create(&path).expect("created"), description.clone()).expect("begun");
    let all = tiles(&description);
    for (level, at, size, texels) in all.iter().skip(1) {
        writer.tile(*level, *at, *size, texels).expect("written");
    }
    assert!(writer.finish().is_err(), "a tile is missing");
    assert!(TxFile::open(File::open(&path).expect("there")).is_err(), "nobody takes it for a file");
}

/// Bytes changed, cut off and made up: an error, or what was written; never a panic or a large allocation.
#[test]
fn damaged_files_are_errors() {
    let folder = Folder::new("damage");
    let description = TxDescription::new("key", &info([200, 150], 3, TexelFormat::U8), false, 0);
    let path = folder.0.join("a.tx");
    write(&path, &description);
    let whole = std::fs::read(&path).expect("there");
    let directory = u64::from_le_bytes(whole[8..16].try_into().expect("8 bytes")) as usize;
    let mut refused = 0;
    let mut random = 1_u32;
    let mut next = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 8) as usize
    };
    for round in 0..3000 {
        let mut bytes = whole.clone();
        // Most of them where the directories are.
        let from = if round % 4 == 0 { 0 } else { directory.saturating_sub(2000) };
        for _ in 0..=next() % 3 {
            let at = from + next() % (bytes.len() - from);
            bytes[at] = [0, 0xff, bytes[at] ^ 1, next() as u8][next() % 4];
        }
        if round % 10 == 0 {
            bytes.truncate(next() % whole.len());
        }
        std::fs::write(&path, &bytes).expect("written");
        let Ok(file) = TxFile::open(File::open(&path).expect("there")) else {
            refused += 1;
            continue;
        };
        if file.description() != &description {
            continue; // Its text says another image, and the cache compares that.
        }
        for (level, at, size, texels) in tiles(&description) {
            let mut out = vec![0; texels.len()];
            match file.tile(level, at, size, &mut out) {
                Ok(()) => assert!(out == texels, "round {round}: wrong texels, level {level}, {at:?}"),
                Err(_damaged) => refused += 1,
            }
        }
    }
    assert!(refused > 1000, "damage was seen {refused} times");
}
