// SPDX-License-Identifier: Apache-2.0
//! A file taken apart into its fields, so that tests can change them: tables are inflated, and compressed again by
//! [`Raw::build`], which corrects the lengths unless told otherwise.

use std::io::{Read as _, Write as _};

use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;

#[derive(Clone)]
pub(crate) struct Raw {
    pub(crate) header: Vec<u8>,
    pub(crate) extended: Vec<u8>,
    /// Records of 20 bytes.
    pub(crate) faces: Vec<u8>,
    pub(crate) constants: Vec<u8>,
    /// Level 0 alone.
    pub(crate) level: Vec<u8>,
    /// Words of 4 bytes.
    pub(crate) words: Vec<u8>,
    pub(crate) blocks: Vec<u8>,
    /// Metadata, barrier and edits, as they are.
    pub(crate) rest: Vec<u8>,
}

pub(crate) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

pub(crate) fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

pub(crate) fn put(bytes: &mut [u8], at: usize, field: &[u8]) {
    bytes[at..at + field.len()].copy_from_slice(field);
}

pub(crate) fn zipped(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn inflated(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    ZlibDecoder::new(bytes).read_to_end(&mut out).unwrap();
    out
}

/// Lengths of the parts, in the header.
pub(crate) const FACE_COUNT: usize = 24;
pub(crate) const EXTENDED_LENGTH: usize = 28;
pub(crate) const FACES_LENGTH: usize = 32;
pub(crate) const CONSTANTS_LENGTH: usize = 36;
pub(crate) const LEVEL_INFO_LENGTH: usize = 40;
pub(crate) const LEVEL_DATA_LENGTH: usize = 48;

impl Raw {
    /// Takes a file apart that is as it should be.
    pub(crate) fn new(file: &[u8]) -> Self {
        let (header, mut left) = file.split_at(64);
        let mut part = |bytes: usize| {
            let part;
            (part, left) = left.split_at(bytes);
            part.to_vec()
        };
        let length = |at| u32_at(header, at) as usize;
        let extended = part(length(EXTENDED_LENGTH));
        let faces = inflated(&part(length(FACES_LENGTH)));
        let constants = inflated(&part(length(CONSTANTS_LENGTH)));
        let level = part(length(LEVEL_INFO_LENGTH))[..16].to_vec();
        let data = part(usize::try_from(u64_at(header, LEVEL_DATA_LENGTH)).unwrap());
        let level_bytes = usize::try_from(u64_at(&level, 0)).unwrap();
        let (words, blocks) = data[..level_bytes].split_at(u32_at(&level, 8) as usize);
        let words = inflated(words);
        let rest = left.to_vec();
        Self { header: header.to_vec(), extended, faces, constants, level, words, blocks: blocks.to_vec(), rest }
    }

    /// The file, with right lengths.
    pub(crate) fn build(&self) -> Vec<u8> {
        let (faces, constants, words) = (zipped(&self.faces), zipped(&self.constants), zipped(&self.words));
        let length = |part: &[u8]| u32::try_from(part.len()).unwrap().to_le_bytes();
        let level_bytes = u64::try_from(words.len() + self.blocks.len()).unwrap().to_le_bytes();
        let mut header = self.header.clone();
        put(&mut header, EXTENDED_LENGTH, &length(&self.extended));
        put(&mut header, FACES_LENGTH, &length(&faces));
        put(&mut header, CONSTANTS_LENGTH, &length(&constants));
        put(&mut header, LEVEL_INFO_LENGTH, &length(&self.level));
        put(&mut header, LEVEL_DATA_LENGTH, &level_bytes);
        put(&mut header, 18, &1_u16.to_le_bytes());
        let mut level = self.level.clone();
        put(&mut level, 0, &level_bytes);
        put(&mut level, 8, &length(&words));
        let mut file = [header, self.extended.clone(), faces, constants, level, words, self.blocks.clone()].concat();
        // Where edits begin: behind metadata and barrier, which are all that is left.
        if self.extended.len() >= 40 && u64_at(&self.extended, 32) != 0 {
            let edit_bytes = usize::try_from(u64_at(&self.extended, 24)).unwrap();
            let edits_at = file.len() + self.rest.len().saturating_sub(edit_bytes);
            put(&mut file, 64 + 32, &u64::try_from(edits_at).unwrap().to_le_bytes());
        }
        file.extend(&self.rest);
        file
    }
}
