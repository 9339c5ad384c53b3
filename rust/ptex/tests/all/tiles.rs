// SPDX-License-Identifier: Apache-2.0
//! Faces in tiles, made by hand: what tiles may be, and what not.

use oocpt_ptex::PtexError;

use crate::raw::{Raw, put, u32_at, zipped};
use crate::support::{open, read};
use oocpt_ptex::{DataType, MeshType, PtexFace, PtexWriter};

const CONSTANT: u32 = 0;
const ZIPPED: u32 = 1;
const TILED: u32 = 3;

/// A file of one face of 4 x 4 texels (U8, one channel), whose block is `block`, encoded as `encoding` says.
pub(crate) fn one_face(encoding: u32, block: &[u8]) -> Vec<u8> {
    let mut writer = PtexWriter::new(Vec::new(), MeshType::Quad, DataType::U8, 1, None, 1).unwrap();
    let texels: Vec<u8> = (0..16).collect();
    writer.push_face(&PtexFace::new([2, 2]), &texels).unwrap();
    let mut raw = Raw::new(&writer.finish().unwrap());
    raw.blocks = block.to_vec();
    raw.words = (u32::try_from(block.len()).unwrap() | encoding << 30).to_le_bytes().to_vec();
    raw.build()
}

/// A block of tiles of `log2`, given as their encodings and bytes.
pub(crate) fn tiled(log2: [u8; 2], tiles: &[(u32, Vec<u8>)]) -> Vec<u8> {
    let words =
        tiles.iter().flat_map(|(encoding, tile)| (u32::try_from(tile.len()).unwrap() | encoding << 30).to_le_bytes());
    let words = zipped(&words.collect::<Vec<u8>>());
    let length = u32::try_from(words.len()).unwrap().to_le_bytes();
    let tiles: Vec<u8> = tiles.iter().flat_map(|(_, tile)| tile.clone()).collect();
    [log2.to_vec(), length.to_vec(), words, tiles].concat()
}

/// Four tiles of 2 x 2 texels: two of them constant, one as it is, one as differences.
pub(crate) fn four_tiles() -> Vec<(u32, Vec<u8>)> {
    let differences = zipped(&[10, 1, 255, 2]);
    vec![(CONSTANT, vec![7]), (ZIPPED, zipped(&[1, 2, 3, 4])), (2, differences), (CONSTANT, vec![9])]
}

fn read_tiled(block: &[u8]) -> Result<Vec<u8>, PtexError> {
    read(&open(one_face(TILED, block)).unwrap(), 0)
}

#[test]
fn tiles_are_assembled_in_place() {
    let expected = [7, 7, 1, 2, 7, 7, 3, 4, 10, 11, 9, 9, 10, 12, 9, 9];
    assert_eq!(read_tiled(&tiled([1, 1], &four_tiles())).unwrap(), expected, "2 x 2 tiles of 2 x 2 texels");
    let rows: Vec<_> = (0..4).map(|v| (ZIPPED, zipped(&[v, 10 + v, 20 + v, 30 + v]))).collect();
    let expected = [0, 10, 20, 30, 1, 11, 21, 31, 2, 12, 22, 32, 3, 13, 23, 33];
    assert_eq!(read_tiled(&tiled([2, 0], &rows)).unwrap(), expected, "rows");
    let columns: Vec<_> = (0..2).map(|u| (ZIPPED, zipped(&[u, 2, 3, 4, u, 6, 7, 8]))).collect();
    let expected = [0, 2, 1, 2, 3, 4, 3, 4, 0, 6, 1, 6, 7, 8, 7, 8];
    assert_eq!(read_tiled(&tiled([1, 2], &columns)).unwrap(), expected, "columns");
}

#[test]
fn one_tile_and_a_constant_block_are_faces_too() {
    let texels: Vec<u8> = (0..16).collect();
    assert_eq!(read_tiled(&tiled([2, 2], &[(ZIPPED, zipped(&texels))])).unwrap(), texels, "one tile");
    let constant = open(one_face(CONSTANT, &[5])).unwrap();
    assert_eq!(read(&constant, 0).unwrap(), [5; 16], "one texel, in a face that does not say so");
    assert_eq!(constant.constant(0), None, "it does not say so");
}

#[test]
fn invalid_tiles_are_errors() {
    let fails = |block: &[u8]| read_tiled(block).unwrap_err().to_string();
    let good = tiled([1, 1], &four_tiles());
    for length in 0..good.len() {
        read_tiled(&good[..length]).unwrap_err();
    }
    let four = four_tiles();
    assert_eq!(fails(&tiled([3, 1], &four)), "the table of tiles is damaged", "wider than the face");
    assert_eq!(fails(&tiled([1, 255], &four)), "the table of tiles is damaged", "higher than the face");
    assert_eq!(fails(&tiled([0, 1], &four)), "the table of tiles is damaged", "a table of four tiles for eight");
    let within = tiled([1, 1], &[(TILED, good.clone()), four[1].clone(), four[2].clone(), four[3].clone()]);
    assert_eq!(fails(&within), "the table of tiles is damaged", "tiles in a tile");
    let empty = tiled([1, 1], &[(CONSTANT, vec![]), four[1].clone(), four[2].clone(), four[3].clone()]);
    assert!(fails(&empty).starts_with("a texel does not end"), "a constant tile without its texel");
    let short = tiled([1, 1], &[four[0].clone(), (ZIPPED, zipped(&[1, 2, 3])), four[2].clone(), four[3].clone()]);
    assert_eq!(fails(&short), "the face is damaged", "three texels for four");
    let long = tiled([1, 1], &[four[0].clone(), (ZIPPED, zipped(&[1, 2, 3, 4, 5])), four[2].clone(), four[3].clone()]);
    assert_eq!(fails(&long), "the face is damaged", "five texels for four");
}

#[test]
fn tile_counts_are_bounded_by_the_file_size() {
    let mut raw = Raw::new(&one_face(TILED, &tiled([0, 0], &four_tiles())));
    put(&mut raw.faces, 0, &[14, 14]);
    let file = open(raw.build()).unwrap();
    assert!(matches!(read(&file, 0), Err(PtexError::Truncated(_))), "2^28 tiles in fewer bytes");
    put(&mut raw.blocks, 0, &[14, 14]);
    let table = u32_at(&raw.blocks, 2);
    let file = open(raw.build()).unwrap();
    assert!(matches!(read(&file, 0), Err(PtexError::Damaged(_))), "a table of {table} bytes for one tile");
}
