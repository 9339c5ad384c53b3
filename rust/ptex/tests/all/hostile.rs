// SPDX-License-Identifier: Apache-2.0
//! Corrupt files: many changes of good ones, the same in each run. Nothing may panic, and no file of a few kilobytes
//! may cost much memory.

use oocpt_ptex::PtexFile;

use crate::raw::{Raw, put, zipped};
use crate::support::{fixture, open};
use crate::tiles::{four_tiles, one_face, tiled};

/// Bytes above which faces are not read, as by callers that ask first.
const MAX_FACE_BYTES: u64 = 1 << 16;
/// Most memory of a process of all tests of this crate, KiB. It is far less than the files ask for.
const MAX_RESIDENT_KIB: u64 = 400 << 10;

/// Steele, Lea & Flood 2014, `SplitMix64`.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        usize::try_from(self.next() % u64::try_from(end.max(1)).unwrap()).unwrap()
    }

    /// A number that lengths are likely to be wrong with.
    fn field(&mut self) -> [u8; 4] {
        let any = self.next().to_le_bytes();
        let any = u32::from_le_bytes(any[..4].try_into().unwrap());
        let likely = [0, 1, 2, 15, 16, 63, 255, 256, 65535, 1 << 26, 1 << 30, 0x7fff_ffff, u32::MAX - 1, u32::MAX];
        match self.below(3) {
            0 => any.to_le_bytes(),
            1 => (any >> self.below(32)).to_le_bytes(),
            _ => likely[self.below(likely.len())].to_le_bytes(),
        }
    }
}

/// Changes bytes in place, or how many there are.
fn change(bytes: &mut Vec<u8>, random: &mut Random) {
    if bytes.is_empty() {
        return;
    }
    let at = random.below(bytes.len());
    match random.below(6) {
        0 => bytes[at] ^= 1 << random.below(8),
        1 => bytes[at] = random.next().to_le_bytes()[0],
        2 if at + 4 <= bytes.len() => put(bytes, at, &random.field()),
        3 => bytes.truncate(at),
        4 => {
            let length = random.below(bytes.len() - at).min(64);
            let to = random.below(bytes.len() - length + 1);
            bytes.copy_within(at..at + length, to);
        }
        _ => bytes.splice(at..at, random.field()).for_each(drop),
    }
}

/// A change of the file as it is: mostly of its headers, which describe the parts that follow.
fn outside(good: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for _ in 0..=random.below(3) {
        match random.below(4) {
            0 => change(&mut bytes, random),
            1 => {
                let at = random.below(bytes.len().saturating_sub(4));
                put(&mut bytes, at, &random.field()[..4.min(good.len())]);
            }
            2 => put(&mut bytes, 4 * (2 + random.below(24)), &random.field()),
            _ => bytes[8 + random.below(96)] ^= 1 << random.below(8),
        }
        if bytes.len() < 104 {
            break;
        }
    }
    bytes
}

/// A change inside compressed tables, so that no checksum detects it.
fn inside(good: &Raw, random: &mut Random) -> Vec<u8> {
    let mut raw = good.clone();
    for _ in 0..=random.below(3) {
        let part = match random.below(8) {
            0 | 1 => &mut raw.faces,
            2 => &mut raw.constants,
            3 | 4 => &mut raw.words,
            5 => &mut raw.blocks,
            6 => &mut raw.rest,
            _ => &mut raw.level,
        };
        let length = part.len();
        change(part, random);
        // Tables of other lengths are refused at once, so most keep theirs.
        if random.below(8) > 0 {
            part.resize(length, 0);
        }
    }
    raw.level.resize(16, 0);
    raw.build()
}

/// Nothing but a header, of numbers that may be.
fn header(random: &mut Random) -> Vec<u8> {
    let mut bytes: Vec<u8> = (0..25).flat_map(|_| random.field()).collect();
    bytes.extend((0..random.below(400)).map(|_| random.next().to_le_bytes()[0]));
    let valid = [u32::from_le_bytes(*b"Ptex"), 1, u32::from(random.below(2) > 0), 2 * u32::from(random.below(2) > 0)];
    valid.iter().enumerate().for_each(|(field, value)| put(&mut bytes, field * 4, &value.to_le_bytes()));
    put(&mut bytes, 20, &[1, 0, 1, 0]);
    for field in [24, 28, 32, 36, 40] {
        let few = u32::try_from(random.below(100)).unwrap();
        put(&mut bytes, field, &few.to_le_bytes());
    }
    bytes
}

/// A face in tiles, whose table contradicts the data.
fn tiles(random: &mut Random) -> Vec<u8> {
    let tiles = four_tiles();
    let mut words: Vec<u8> = Vec::new();
    for (encoding, tile) in &tiles {
        words.extend((u32::try_from(tile.len()).unwrap() | encoding << 30).to_le_bytes());
    }
    let mut tiles: Vec<u8> = tiles.into_iter().flat_map(|(_, tile)| tile).collect();
    let mut log2 = vec![1, 1];
    let part = match random.below(4) {
        0 => &mut log2,
        1 => &mut tiles,
        _ => &mut words,
    };
    let length = part.len();
    change(part, random);
    part.resize(length, 0);
    let words = zipped(&words);
    let length = u32::try_from(words.len()).unwrap().to_le_bytes();
    one_face(3, &[log2, length.to_vec(), words, tiles].concat())
}

#[derive(Debug, Default)]
struct Seen {
    refused: u32,
    faces_read: u32,
    faces_refused: u32,
}

fn use_file(file: &PtexFile, out: &mut Vec<u8>, seen: &mut Seen) {
    for number in 0..u32::try_from(file.faces().len()).unwrap().min(20) {
        let constant = file.constant(number);
        assert!(constant.is_none_or(|texel| texel.len() == file.texel_bytes()), "one texel");
        let faces = file.faces().len();
        let face = &file.faces()[number as usize];
        assert!(face.adjacent.iter().flatten().all(|(face, edge)| (*face as usize) < faces && *edge < 4), "neighbours");
        match file.face_bytes(number) {
            Ok(bytes) if bytes <= MAX_FACE_BYTES => {
                let is_read = file.read_face(number, out).is_ok();
                assert!(out.len() as u64 <= bytes && (!is_read || out.len() as u64 == bytes), "{} bytes", out.len());
                seen.faces_read += u32::from(is_read);
                seen.faces_refused += u32::from(!is_read);
            }
            // Large and constant, or made of large constant tiles: a few bytes may well say so.
            Ok(_) => {}
            Err(_) => seen.faces_refused += 1,
        }
    }
}

fn resident_peak_kib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}

#[test]
fn mutated_files_never_panic_and_use_little_memory() {
    let names =
        ["quad_u8_3.ptx", "quad_u16_4_alpha.ptx", "quad_f16_1.ptx", "quad_u8_5_alpha0.ptx", "triangle_u8_4.ptx"];
    let mut good: Vec<Vec<u8>> = names.into_iter().map(fixture).collect();
    good.extend(["edits_u16_2.ptx", "edits_bare_u8_3.ptx", "triangle_f32_3.ptx"].map(fixture));
    good.push(one_face(3, &tiled([1, 1], &four_tiles())));
    let raw: Vec<Raw> = good.iter().map(|bytes| Raw::new(bytes)).collect();
    let mut random = Random(2026);
    let mut seen = Seen::default();
    let mut out = Vec::new();
    for round in 0..30_000 {
        let which = random.below(good.len());
        let bytes = match round % 6 {
            0 | 1 => outside(&good[which], &mut random),
            2 | 3 => inside(&raw[which], &mut random),
            4 => tiles(&mut random),
            _ => header(&mut random),
        };
        match open(bytes) {
            Ok(file) => use_file(&file, &mut out, &mut seen),
            Err(_) => seen.refused += 1,
        }
    }
    assert!(out.capacity() as u64 <= 2 * MAX_FACE_BYTES, "no more than faces have: {}", out.capacity());
    // Unless all ways are taken, the changes are too rough or too fine.
    assert!(seen.refused > 10_000 && seen.faces_read > 10_000 && seen.faces_refused > 3000, "{seen:?}");
    if let Some(peak) = resident_peak_kib() {
        assert!(peak < MAX_RESIDENT_KIB, "{peak} KiB of memory");
    }
}

#[test]
fn mutated_large_faces_use_memory_for_their_texels_only() {
    // Only the faces that the test above leaves out, and only those that are not a constant: all must be refused before
    // memory is taken, unless constant tiles make them up.
    let good = Raw::new(&fixture("quad_u8_3.ptx"));
    let mut random = Random(7);
    let mut out = Vec::new();
    let mut large = 0;
    for _ in 0..300 {
        let mut raw = good.clone();
        for face in 0..8 {
            let log2 = [10 + random.below(5), 10 + random.below(5)].map(|log2| u8::try_from(log2).unwrap());
            put(&mut raw.faces, face * 20, &log2);
        }
        let file = open(raw.build()).unwrap();
        for face in (0..8).filter(|face| file.constant(*face).is_none()) {
            file.read_face(face, &mut out).unwrap_err();
            large += 1;
        }
    }
    assert!(large > 1000, "{large} large faces");
    assert_eq!(out.capacity(), 0, "no memory was taken");
}
