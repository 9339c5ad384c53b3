// SPDX-License-Identifier: Apache-2.0
//! Files of strangers: cut, bent, and made to deceive, with checksums that are right.

use crate::support::{Folder, bytes, film, header};
use oocpt_film::{ExactFilm, FilmError, FilmHeader, FilmReader, SampleRange, merge, picture, write_film};
use proptest::prelude::*;
use std::path::Path;
use xxhash_rust::xxh3::{Xxh3, xxh3_128};

/// A small film with two planes.
fn small(folder: &Folder) -> Vec<u8> {
    let path = folder.path("film");
    film([3, 2], SampleRange::new(0, 7)).write(&path).expect("it can be written");
    bytes(&path)
}

/// What reading all of a file says.
fn read(path: &Path) -> Result<(), FilmError> {
    let films = [path.to_owned()];
    picture(&films, true)?;
    merge(&films, &path.with_extension("out"))?;
    ExactFilm::read(path, 1 << 30).map(|_film| ())
}

#[test]
fn a_file_that_is_cut_is_refused_at_any_length() {
    let folder = Folder::new("cut");
    let (whole, path) = (small(&folder), folder.path("cut.film"));
    for length in 0..whole.len() {
        std::fs::write(&path, &whole[..length]).expect("it can be written");
        let error = FilmReader::open(&path).expect_err("it is cut").to_string();
        assert!(error.contains("cut.film: "), "{length} bytes: {error}");
    }
    std::fs::write(&path, [&whole[..], &[0]].concat()).expect("it can be written");
    assert!(FilmReader::open(&path).is_err(), "a byte too much");
    std::fs::write(&path, &whole).expect("it can be written");
    read(&path).expect("it is whole");
}

#[test]
fn no_bit_of_a_file_may_differ() {
    let folder = Folder::new("bent");
    let (whole, path) = (small(&folder), folder.path("bent.film"));
    for at in 0..whole.len() {
        let mut bent = whole.clone();
        bent[at] ^= 1 << (at % 8);
        std::fs::write(&path, &bent).expect("it can be written");
        assert!(read(&path).is_err(), "byte {at} of {}", whole.len());
        assert!(FilmReader::open(&path).and_then(|film| film.verify()).is_err(), "byte {at} is told by a check alone");
    }
}

#[test]
fn headers_that_lie_are_refused() {
    let folder = Folder::new("lies");
    let path = folder.path("film");
    let lies = |change: &dyn Fn(&mut FilmHeader)| {
        let mut header = header([3, 2]);
        header.planes = vec![vec![SampleRange::new(0, 4)]];
        change(&mut header);
        write_film(&path, &header, |writer| writer.block("planes", &[0; 960])).expect("it can be written");
        read(&path).expect_err("it lies").to_string()
    };
    let range = SampleRange::new;
    let windows =
        [[0, 0, 0, 2], [0, 0, u32::MAX, u32::MAX], [5, 0, 3, 2], [u32::MAX, 0, 3, 2], [0, 0, 1 << 15, 1 << 14]];
    for window in windows {
        let said = lies(&|header| {
            header.identity.request.window = window;
            if window[2] == 1 << 15 {
                header.identity.request.size = [1 << 15; 2];
            }
        });
        assert!(said.contains("window is no part"), "{window:?}: {said}");
    }
    let planes: [&[&[SampleRange]]; 12] = [
        &[&[]],
        &[&[range(0, 3)]],
        &[&[range(0, 4), range(4, 8)]],
        &[&[range(0, 4)], &[range(4, 8)]],
        &[&[range(0, 4)], &[range(2, 3)]],
        &[&[range(0, 4)], &[range(4, 9)]],
        &[&[range(5, 6)], &[range(7, 8)]],
        &[&[range(5, 6), range(6, 7)]],
        &[&[range(6, 7), range(4, 5)]],
        &[&[range(7, 5)]],
        &[&[range(u32::MAX - 1, u32::MAX)]],
        &[&[range(1 << 30, 1 << 31)], &[range(1 << 31, u32::MAX)]],
    ];
    for planes in planes {
        let said = lies(&|header| header.planes = planes.iter().map(|plane| plane.to_vec()).collect());
        assert!(said.contains("plane"), "{planes:?}: {said}");
        assert!(!said.contains("another size"), "{planes:?} are refused for what they are: {said}");
    }
    assert!(lies(&|_| {}).contains("planes have another size"), "no records of 160 bytes");
}

fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize)
}

fn sum(seed: u64, parts: [&[u8]; 2]) -> [u8; 8] {
    let mut hash = Xxh3::with_seed(seed);
    parts.iter().for_each(|part| hash.update(part));
    hash.digest().to_le_bytes()
}

/// Makes all checksums right, as far as the lengths make sense: by the book's table, not by the code.
fn reseal(bytes: &mut [u8]) -> Option<()> {
    let text = u32_at(bytes, 12)?;
    let hash = xxh3_128(&[bytes.get(..16)?, bytes.get(32..32 + text)?].concat());
    bytes[16..32].copy_from_slice(&hash.to_le_bytes());
    let seed = hash as u64;
    let mut at = 32 + text;
    while at < bytes.len() {
        let head = at;
        let packed = u32_at(bytes, head + 16)?;
        let checksum = sum(seed.wrapping_add(head as u64), [bytes.get(head..head + 40)?, &[]]);
        bytes.get_mut(head + 40..head + 48)?.copy_from_slice(&checksum);
        at += 48;
        let end = at + packed;
        while at < end {
            let length = u32_at(bytes, at + 4)?;
            let checksum =
                sum(seed.wrapping_add(at as u64), [bytes.get(at..at + 8)?, bytes.get(at + 16..at + 16 + length)?]);
            bytes[at + 8..at + 16].copy_from_slice(&checksum);
            at += 16 + length;
        }
    }
    Some(())
}

#[test]
fn resealing_is_the_format() {
    let folder = Folder::new("reseal");
    let (whole, path) = (small(&folder), folder.path("film"));
    let mut empty = whole.clone();
    let text = u32_at(&whole, 12).expect("whole");
    empty[16..32].fill(0);
    empty[32 + text + 40..32 + text + 48].fill(0);
    assert_eq!(reseal(&mut empty), Some(()));
    assert!(empty == whole, "all checksums are as they were");
    // Another scene, in the same number of bytes.
    let at = whole.windows(16).position(|part| part == b"0123456789abcdef").expect("the scene");
    empty[at..at + 16].copy_from_slice(b"fedcba9876543210");
    assert_eq!(reseal(&mut empty), Some(()));
    std::fs::write(&path, &empty).expect("it can be written");
    read(&path).expect("a film of another scene");
}

#[test]
fn pixels_that_no_samples_give_are_refused() {
    let folder = Folder::new("pixels");
    let (whole, path) = (small(&folder), folder.path("film"));
    let chunk = 32 + u32_at(&whole, 12).expect("whole") + 48;
    // Behind the chunk's other lanes: the highest byte of `lowest`, and `samples`, which all pixels have alike.
    let end = chunk + 16 + u32_at(&whole, chunk + 4).expect("whole");
    assert_eq!(whole[end - 5..end], [0, 4, 0, 0, 0], "samples 0..4");
    for (at, value) in [(end - 4, 5), (end - 5, 1)] {
        let mut bent = whole.clone();
        bent[at] = value;
        assert_eq!(reseal(&mut bent), Some(()));
        std::fs::write(&path, &bent).expect("it can be written");
        let said = read(&path).expect_err("no samples give that").to_string();
        assert!(said.ends_with("film: damaged: pixels are not what its samples give"), "{said}");
    }
}

#[test]
fn parts_of_one_file_do_not_pass_for_parts_of_another() {
    let folder = Folder::new("swapped");
    let path = folder.path("film");
    // Two tiles, whose chunks have one length.
    let written = |scene: &str| {
        let mut header = header([128, 64]);
        header.identity.scene = scene.to_owned();
        let mut film = ExactFilm::new(header).expect("a sound header");
        let pixel = |value: f32| {
            let mut pixel = oocpt_film::ExactPixel::default();
            oocpt_film::ExactSums::add_sample(&mut pixel, [value; 4]);
            pixel
        };
        film.add(SampleRange::new(0, 1), [vec![pixel(0.5); 4096], vec![pixel(0.25); 4096]].concat()).expect("it fits");
        film.write(&path).expect("it can be written");
        bytes(&path)
    };
    let (one, other) = (written("a"), written("b"));
    let first = 32 + u32_at(&one, 12).expect("whole") + 48;
    let length = 16 + u32_at(&one, first + 4).expect("whole");
    let mut swapped = one.clone();
    swapped[first..first + 2 * length].rotate_left(length);
    let mut mixed = one.clone();
    mixed[first..].copy_from_slice(&other[first..]);
    for bent in [swapped, mixed] {
        assert!(bent != one && bent.len() == one.len(), "chunks of one length");
        std::fs::write(&path, &bent).expect("it can be written");
        assert!(matches!(read(&path), Err(FilmError::Damaged(..))), "checksums are of a place in a file");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn files_with_right_checksums_and_wrong_contents_do_no_harm(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
    ) {
        thread_local! {
            static FILM: (Folder, Vec<u8>) = {
                let folder = Folder::new("sealed");
                let whole = small(&folder);
                (folder, whole)
            };
        }
        FILM.with(|(folder, whole)| {
            let mut bent = whole.clone();
            for (index, value) in &changes {
                bent[index.index(whole.len())] = *value;
            }
            reseal(&mut bent);
            let path = folder.path("sealed.film");
            std::fs::write(&path, &bent).expect("it can be written");
            if let Err(error) = read(&path) {
                prop_assert!(error.to_string().contains("sealed.film: "), "{}", error);
            }
            Ok(())
        })?;
    }
}
