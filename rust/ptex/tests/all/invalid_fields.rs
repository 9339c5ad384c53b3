// SPDX-License-Identifier: Apache-2.0
//! Each field of the header and of the records at invalid values, and the resulting error.

use oocpt_ptex::{MAX_BYTES, PtexError, PtexFile, ReadAt};

use crate::raw::{
    CONSTANTS_LENGTH, EXTENDED_LENGTH, FACE_COUNT, FACES_LENGTH, LEVEL_DATA_LENGTH, LEVEL_INFO_LENGTH, Raw, put,
    u32_at, u64_at,
};
use crate::support::{fixture, open, read};

const NAME: &str = "quad_u8_3.ptx";

/// The error of a file in which some bytes were changed.
fn refused(name: &str, changes: &[(usize, &[u8])]) -> String {
    let mut bytes = fixture(name);
    changes.iter().for_each(|(at, field)| put(&mut bytes, *at, field));
    open(bytes).unwrap_err().to_string()
}

fn header(at: usize, field: u32) -> String {
    refused(NAME, &[(at, &field.to_le_bytes())])
}

#[test]
fn other_files_are_not_ptex_files() {
    assert_eq!(open(vec![0; 200]).unwrap_err().to_string(), "not a Ptex file", "zeros");
    assert_eq!(header(0, u32::from_le_bytes(*b"PTEX")), "not a Ptex file", "large letters");
    assert!(header(4, 0).contains("version 0"), "before the first");
    assert!(header(4, 2).contains("version 2"), "after the last");
}

#[test]
fn fields_of_the_header_are_checked() {
    assert_eq!(header(8, 2), "the header's type of mesh is 2");
    assert_eq!(header(12, 4), "the header's type of data is 4");
    assert_eq!(header(12, u32::MAX), "the header's type of data is 4294967295");
    assert_eq!(refused(NAME, &[(20, &[0, 0])]), "the header's number of channels is 0");
    assert_eq!(refused(NAME, &[(20, &[65, 0])]), "the header's number of channels is 65");
    assert_eq!(refused(NAME, &[(20, &[255, 255])]), "the header's number of channels is 65535");
    assert_eq!(refused(NAME, &[(22, &[0, 0])]), "the header's number of levels is 0");
    assert_eq!(header(FACE_COUNT, 0), "the header's number of faces is 0");
    assert_eq!(header(FACE_COUNT, (1 << 26) + 1), "the header's number of faces is 67108865");
    assert_eq!(header(FACE_COUNT, u32::MAX), "the header's number of faces is 4294967295");
    assert_eq!(header(FACE_COUNT, 7), "the header's number of faces in level 0 is 8");
    assert_eq!(refused(NAME, &[(64, &[3, 0])]), "the header's border mode is 3");
    assert_eq!(refused(NAME, &[(68, &[0, 255])]), "the header's border mode is 65280");
}

#[test]
fn an_out_of_range_alpha_channel_is_ignored() {
    for alpha in [3, 4, i32::MAX, -1, -2, i32::MIN] {
        let mut bytes = fixture(NAME);
        put(&mut bytes, 16, &alpha.to_le_bytes());
        assert_eq!(open(bytes).unwrap().alpha_channel(), None, "alpha channel {alpha} of 3");
    }
    let mut bytes = fixture(NAME);
    put(&mut bytes, 16, &2_u32.to_le_bytes());
    assert_eq!(open(bytes).unwrap().alpha_channel(), Some(2), "the last");
}

#[test]
fn lengths_beyond_the_end_are_errors() {
    for length in [EXTENDED_LENGTH, FACES_LENGTH, CONSTANTS_LENGTH, LEVEL_INFO_LENGTH, LEVEL_DATA_LENGTH] {
        assert!(header(length, u32::MAX).contains("does not end inside the file"), "length at {length}");
    }
    let all = u64::MAX.to_le_bytes();
    assert!(refused(NAME, &[(LEVEL_DATA_LENGTH, &all)]).contains("does not end inside the file"), "beyond 2^64");
    assert!(header(LEVEL_INFO_LENGTH, 15).contains("the table of levels does not end"), "less than a level");
    // Large metadata comes last, and its place is all that is asked for.
    assert!(refused(NAME, &[(64 + 16, &all)]).contains("the metadata does not end"), "beyond 2^64");
    assert!(header(FACES_LENGTH, 0).contains("cannot hold"), "faces without a byte");
}

#[test]
fn files_cut_short_are_errors() {
    for name in [NAME, "edits_u16_2.ptx", "triangle_u8_4.ptx"] {
        let bytes = fixture(name);
        let raw = Raw::new(&bytes);
        let needed = bytes.len() - if name.starts_with("edits") { 0 } else { raw.rest.len() };
        for length in 0..needed {
            open(bytes[..length].to_vec()).unwrap_err();
        }
        for length in needed..bytes.len() {
            open(bytes[..length].to_vec()).unwrap();
        }
    }
}

/// A file whose tables are as a test wants them.
fn changed(change: impl FnOnce(&mut Raw)) -> Result<PtexFile, PtexError> {
    let mut raw = Raw::new(&fixture(NAME));
    change(&mut raw);
    open(raw.build())
}

#[test]
fn a_file_taken_apart_and_put_together_is_the_same() {
    for name in [NAME, "edits_u16_2.ptx", "tiled_u8_1.ptx", "quad_f32_2.ptx"] {
        let [before, after] = [fixture(name), Raw::new(&fixture(name)).build()].map(|bytes| open(bytes).unwrap());
        assert_eq!(before.faces(), after.faces(), "{name}");
        for face in 0..u32::try_from(before.faces().len()).unwrap() {
            assert!(read(&before, face).unwrap() == read(&after, face).unwrap(), "{name}, face {face}");
        }
    }
}

#[test]
fn resolutions_are_checked() {
    let face = |log2: [u8; 2]| changed(|raw| put(&mut raw.faces, 20, &log2));
    assert_eq!(face([15, 0]).unwrap_err().to_string(), "face 1 has a resolution of 2^15 x 2^0 texels");
    assert_eq!(face([2, 255]).unwrap_err().to_string(), "face 1 has a resolution of 2^2 x 2^-1 texels");
    let file = face([14, 14]).unwrap();
    assert_eq!(file.face_bytes(1).unwrap(), 3 << 28, "the largest");
    let refused = read(&file, 1).unwrap_err();
    assert!(matches!(refused, PtexError::ImpossibleSize { bytes, .. } if bytes == 3 << 28), "{refused}");
}

#[test]
fn oversized_faces_are_refused() {
    let file = changed(|raw| {
        // 9 channels: 2^28 texels are more than 2 GiB. The tables follow.
        put(&mut raw.header, 20, &9_u16.to_le_bytes());
        raw.constants = vec![1; 8 * 9];
        put(&mut raw.faces, 40, &[14, 14]);
    });
    let file = file.unwrap();
    assert!(file.constant(2).is_some(), "its texel may be asked for");
    let expected = "the face would be 2415919104 bytes, which is too many";
    assert_eq!(read(&file, 2).unwrap_err().to_string(), expected);
    assert_eq!(file.face_bytes(2).unwrap_err().to_string(), expected);
}

#[test]
fn table_lengths_must_match_the_face_count() {
    let refused = |change: fn(&mut Raw)| changed(change).unwrap_err().to_string();
    assert_eq!(refused(|raw| raw.faces.push(0)), "the table of faces is damaged");
    assert_eq!(refused(|raw| raw.faces.truncate(159)), "the table of faces is damaged");
    assert_eq!(refused(|raw| raw.constants.push(0)), "the table of constants is damaged");
    assert_eq!(refused(|raw| raw.constants.truncate(23)), "the table of constants is damaged");
    assert_eq!(refused(|raw| raw.words.truncate(28)), "the table of blocks is damaged");
    assert_eq!(refused(|raw| raw.words.extend([0; 4])), "the table of blocks is damaged");
    let last_word = |raw: &mut Raw| put(&mut raw.words, 28, &[0xff, 0xff, 0xff, 0x7f]);
    assert_eq!(refused(last_word), "level 0 does not end inside the file: cut short, or its length is wrong");
}

#[test]
fn levels_lie_inside_their_part() {
    let good = Raw::new(&fixture(NAME)).build();
    let lengths = [EXTENDED_LENGTH, FACES_LENGTH, CONSTANTS_LENGTH].map(|length| u32_at(&good, length) as usize);
    let level = 64 + lengths.iter().sum::<usize>();
    let data = u64_at(&good, LEVEL_DATA_LENGTH);
    let refused = |at: usize, field: &[u8]| {
        let mut bytes = good.clone();
        put(&mut bytes, at, field);
        open(bytes).unwrap_err().to_string()
    };
    let expected = "level 0 does not end inside the file: cut short, or its length is wrong";
    assert_eq!(refused(level, &(data + 1).to_le_bytes()), expected, "a byte of the metadata");
    assert_eq!(refused(level, &10_u64.to_le_bytes()), expected, "shorter than its table");
    assert_eq!(refused(level + 8, &u32::try_from(data + 1).unwrap().to_le_bytes()), expected, "a longer table");
}

#[test]
fn a_one_texel_face_is_read_from_the_constant_table() {
    let file = changed(|raw| raw.faces[3 * 20 + 3] = 0).unwrap();
    assert!(file.faces()[3].is_constant, "though the file does not say so");
    let before = read(&open(fixture(NAME)).unwrap(), 3).unwrap();
    assert_eq!(read(&file, 3).unwrap(), before, "the same texel");
}

#[test]
fn damage_inside_of_texels_is_found_by_their_checksum() {
    let good = Raw::new(&fixture(NAME));
    let mut raw = good.clone();
    let last = usize::try_from(u32_at(&raw.words, 0) & 0x3fff_ffff).unwrap() - 1;
    raw.blocks[last] ^= 1;
    let file = open(raw.build()).unwrap();
    assert_eq!(read(&file, 0).unwrap_err().to_string(), "the face is damaged");
    read(&file, 1).unwrap();
}

#[test]
fn a_large_face_count_in_a_small_file_is_refused() {
    let most = 1_u32 << 26;
    let refused = header(FACE_COUNT, most);
    assert!(refused.starts_with("the table of faces claims 1342177280 bytes, which "), "{refused}");
    let cannot_be = changed(|raw| {
        // Tables of faces and constants of so many, but not of blocks.
        raw.faces = vec![0; 20 << 12];
        raw.constants = vec![0; 3 << 12];
        put(&mut raw.header, FACE_COUNT, &(1_u32 << 12).to_le_bytes());
        put(&mut raw.level, 12, &(1_u32 << 12).to_le_bytes());
        raw.words.clear();
    });
    let error = cannot_be.unwrap_err().to_string();
    assert_eq!(error, "the table of blocks claims 16384 bytes, which 8 compressed bytes cannot hold");
}

/// A file that claims to have a TiB.
struct Large(Vec<u8>);

impl ReadAt for Large {
    fn size(&self) -> u64 {
        1 << 40
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> std::io::Result<()> {
        self.0.read_at(offset, out)
    }
}

#[test]
fn oversized_tables_are_refused() {
    let mut bytes = fixture(NAME);
    // Texels of 64 channels of 4 bytes.
    put(&mut bytes, 12, &3_u32.to_le_bytes());
    put(&mut bytes, 20, &[64, 0]);
    put(&mut bytes, FACE_COUNT, &((1_u32 << 23) + 1).to_le_bytes());
    for length in [FACES_LENGTH, CONSTANTS_LENGTH] {
        put(&mut bytes, length, &(1_u32 << 30).to_le_bytes());
    }
    let error = PtexFile::open(Box::new(Large(bytes))).unwrap_err().to_string();
    let expected = format!("the table of constants would be {} bytes, which is too many", MAX_BYTES + 256);
    assert_eq!(error, expected);
}

#[test]
fn edits_are_checked() {
    const EDITS: &str = "edits_u16_2.ptx";
    let good = fixture(EDITS);
    let at = usize::try_from(u64_at(&good, 64 + 32)).unwrap();
    let length = |field: u32| refused(EDITS, &[(at + 1, &field.to_le_bytes())]);
    assert_eq!(length(31), format!("the edit at byte {at} is damaged"), "shorter than what all edits have");
    assert_eq!(length(u32::MAX), format!("the edit at byte {at} is damaged"), "beyond the end");
    assert_eq!(refused(EDITS, &[(at + 5, &[5])]), format!("the edit at byte {at} is damaged"), "no face 5");
    let word = at + 5 + 24;
    assert_eq!(refused(EDITS, &[(word, &[255])]), format!("the edit at byte {at} is damaged"), "texels beyond its end");
    assert_eq!(refused(EDITS, &[(at + 9, &[77])]), "face 0 has a resolution of 2^77 x 2^2 texels");
    let beyond = "the edits does not end inside the file: cut short, or its length is wrong";
    assert_eq!(refused(EDITS, &[(64 + 24, &u64::MAX.to_le_bytes())]), beyond, "beyond 2^64");
    assert_eq!(refused(EDITS, &[(64 + 32, &u64::MAX.to_le_bytes())]), beyond, "begin beyond 2^64");
}

#[test]
fn old_files_have_edits_up_to_their_end() {
    let mut raw = Raw::new(&fixture("edits_u16_2.ptx"));
    let new = open(raw.build()).unwrap();
    // As old files: nothing about edits in the extended header, or less of it, or none.
    for length in [40, 24, 8, 0] {
        put(&mut raw.extended, 24, &[0; 16]);
        let mut old = raw.clone();
        old.extended.truncate(length);
        let file = open(old.build()).unwrap();
        assert_eq!(file.faces(), new.faces(), "extended header of {length} bytes");
        for face in 0..5 {
            assert!(read(&file, face).unwrap() == read(&new, face).unwrap(), "face {face}, {length} bytes");
        }
        // Bytes that follow the last edit, or an edit without length, are ignored.
        old.rest.extend([0; 9]);
        assert_eq!(open(old.build()).unwrap().faces(), new.faces(), "zeros behind");
    }
}

#[test]
fn unknown_edits_are_skipped() {
    let bytes = fixture("edits_u16_2.ptx");
    let at = usize::try_from(u64_at(&bytes, 64 + 32)).unwrap();
    let mut other = bytes.clone();
    other[at] = 9;
    let [before, after] = [bytes, other].map(|bytes| open(bytes).unwrap());
    assert!(before.faces()[0].has_edits && !after.faces()[0].has_edits, "the first edit was of face 0");
    assert_eq!(before.faces()[1..], after.faces()[1..], "the others were of the others");
}

#[test]
fn read_errors_are_distinguished_from_bad_files() {
    struct Failing;
    impl ReadAt for Failing {
        fn size(&self) -> u64 {
            1000
        }
        fn read_at(&self, _offset: u64, _out: &mut [u8]) -> std::io::Result<()> {
            Err(std::io::Error::other("unplugged"))
        }
    }
    let error = PtexFile::open(Box::new(Failing)).unwrap_err();
    assert_eq!(error.to_string(), "reading failed: unplugged");
}
