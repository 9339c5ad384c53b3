// SPDX-License-Identifier: Apache-2.0
//! Files with blocks of others: checkpoints.

use crate::support::{Folder, bytes, header};
use oocpt_film::{FilmError, FilmHeader, FilmKind, FilmReader, merge, picture, write_film};

#[test]
fn blocks_come_back_as_they_were() {
    let folder = Folder::new("blocks");
    let path = folder.path("checkpoint");
    let long: Vec<u8> = (0..3_000_001_u32).map(|k| ((k * k) >> 7) as u8).collect();
    let written = FilmHeader { kind: FilmKind::Sums, ..header([3, 2]) };
    write_film(&path, &written, |writer| {
        writer.block("film", &long)?;
        writer.block("state", br#"{"a":1}"#)?;
        writer.block("empty", b"")
    })
    .expect("it can be written");
    let reader = FilmReader::open(&path).expect("it is a film");
    assert_eq!(*reader.header(), written);
    assert_eq!(reader.block_bytes("film"), Some(3_000_001));
    assert!(reader.block("film", 3_000_001).expect("whole") == long, "the same bytes");
    assert_eq!(reader.block("state", 100).expect("whole"), br#"{"a":1}"#);
    assert_eq!(reader.block("empty", 0).expect("whole"), b"");
    assert!(matches!(reader.block("film", 3_000_000), Err(FilmError::Missing(..))), "a byte too much");
    assert!(matches!(reader.block("none", 100), Err(FilmError::Missing(..))), "no such block");
    assert_eq!(reader.file_bytes(), bytes(&path).len() as u64);
    for refused in [merge(std::slice::from_ref(&path), &folder.path("out")).err(), picture(&[path], false).err()] {
        let said = refused.expect("no sums that merge").to_string();
        assert!(said.ends_with("checkpoint: it is a checkpoint, from which only its own render goes on"), "{said}");
    }
}

#[test]
fn a_file_that_cannot_be_written_whole_leaves_the_old_one() {
    let folder = Folder::new("old");
    let path = folder.path("film");
    let write = |value: &[u8], fails: bool| {
        write_film(&path, &header([1, 1]), |writer| {
            writer.block("a", value)?;
            if fails { writer.block("a name that is longer than it may be", b"") } else { Ok(()) }
        })
    };
    write(b"old", false).expect("it can be written");
    assert!(matches!(write(b"new", true), Err(FilmError::Unfit(_))), "the reason is told");
    assert_eq!(FilmReader::open(&path).and_then(|reader| reader.block("a", 9)).expect("there"), b"old");
    assert_eq!(std::fs::read_dir(path.parent().expect("a folder")).expect("there").count(), 1, "nothing is left");
    let nowhere = write_film(&folder.path("none/film"), &header([1, 1]), |_| Ok(())).expect_err("no such folder");
    assert!(nowhere.to_string().contains("none/film: No such file"), "{nowhere}");
}
