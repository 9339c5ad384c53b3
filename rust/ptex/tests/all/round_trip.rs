// SPDX-License-Identifier: Apache-2.0
//! Files of our writer, read by our reader. That the reference library reads them equally was seen by hand.

use oocpt_ptex::{BorderMode, DataType, MeshType, PtexFace, PtexWriter};

use crate::support::Kind::{Constant, Quarter, Varied};
use crate::support::{Format, open, read, texels};

const DATA_TYPES: [DataType; 4] = [DataType::U8, DataType::U16, DataType::F16, DataType::F32];

#[test]
fn written_files_read_back_equal() {
    let kinds = [([3, 2], Varied), ([0, 0], Varied), ([1, 5], Quarter), ([4, 4], Constant), ([10, 7], Quarter)];
    for data_type in DATA_TYPES {
        for channels in [1, 2, 3, 4, 5, 64] {
            let format = Format { data_type, channels };
            let alpha = (channels > 1).then_some(channels - 1);
            let mut writer = PtexWriter::new(Vec::new(), MeshType::Quad, data_type, channels, alpha, 5).unwrap();
            let mut expected = Vec::new();
            for (number, (log2, kind)) in (0..).zip(kinds) {
                // Large faces of many channels take long in a build without optimisation.
                let log2 = if channels > 4 { log2.map(|log2: u8| log2.min(4)) } else { log2 };
                let texels = texels(format, number, log2, kind);
                writer.push_face(&PtexFace::new(log2), &texels).unwrap();
                expected.push((log2, texels));
            }
            let file = open(writer.finish().unwrap()).unwrap();
            assert_eq!(file.alpha_channel(), alpha, "{format:?}");
            for (number, (log2, texels)) in (0..).zip(expected) {
                assert_eq!(file.faces()[number as usize].log2, log2, "{format:?}, face {number}");
                assert!(read(&file, number).unwrap() == texels, "{format:?}, face {number}");
            }
        }
    }
}

#[test]
fn face_flags_and_adjacency_round_trip() {
    let faces = [
        PtexFace {
            adjacent: [Some((1, 3)), None, Some((0, 2)), Some((1, 0))],
            is_subface: true,
            ..PtexFace::new([1, 2])
        },
        PtexFace { adjacent: [None, Some((0, 1)), None, None], is_constant: true, ..PtexFace::new([5, 3]) },
    ];
    let mut writer = PtexWriter::new(Vec::new(), MeshType::Quad, DataType::U8, 1, None, 2).unwrap();
    writer.set_border_modes([BorderMode::Periodic, BorderMode::Black]);
    writer.push_face(&faces[0], &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap();
    writer.push_face(&faces[1], &[9]).unwrap();
    let file = open(writer.finish().unwrap()).unwrap();
    assert_eq!(file.faces(), faces, "all fields");
    assert_eq!(file.border_modes(), [BorderMode::Periodic, BorderMode::Black], "as set");
    assert_eq!(read(&file, 0).unwrap(), [1, 2, 3, 4, 5, 6, 7, 8], "rows of increasing v");
    assert_eq!(read(&file, 1).unwrap(), [9; 32 * 8], "one texel everywhere");
}

#[test]
fn triangles_have_three_edges() {
    let face = PtexFace { adjacent: [Some((0, 2)), None, Some((0, 3)), Some((0, 0))], ..PtexFace::new([1, 1]) };
    let mut writer = PtexWriter::new(Vec::new(), MeshType::Triangle, DataType::U8, 1, None, 1).unwrap();
    writer.push_face(&face, &[1, 2, 3, 4]).unwrap();
    let file = open(writer.finish().unwrap()).unwrap();
    assert_eq!(file.mesh_type(), MeshType::Triangle, "as written");
    assert_eq!(file.faces()[0].adjacent, [Some((0, 2)), None, None, None], "no edge 3, neither ours nor another's");
}

#[test]
fn missing_neighbours_are_none() {
    let face =
        PtexFace { adjacent: [Some((1, 0)), Some((0, 0)), Some((u32::MAX - 1, 0)), None], ..PtexFace::new([0, 0]) };
    let mut writer = PtexWriter::new(Vec::new(), MeshType::Quad, DataType::U8, 1, None, 1).unwrap();
    writer.push_face(&face, &[1]).unwrap();
    let file = open(writer.finish().unwrap()).unwrap();
    assert_eq!(file.faces()[0].adjacent, [None, Some((0, 0)), None, None], "only face 0 is one");
}

#[test]
fn writer_misuse_gives_a_specific_error() {
    let new = |mesh, channels, alpha, faces| {
        PtexWriter::new(Vec::new(), mesh, DataType::U16, channels, alpha, faces).map_err(|error| error.to_string())
    };
    let refused = |channels, alpha, faces| new(MeshType::Quad, channels, alpha, faces).unwrap_err();
    assert!(refused(0, None, 1).contains("number of channels"), "none");
    assert!(refused(65, None, 1).contains("number of channels"), "too many");
    assert!(refused(3, Some(3), 1).contains("alpha channel"), "beyond the last");
    assert!(refused(3, None, 0).contains("number of faces"), "none");
    assert!(refused(3, None, (1 << 26) + 1).contains("number of faces"), "too many");

    let mut triangles = new(MeshType::Triangle, 1, None, 1).unwrap();
    let mut push = |log2, texels: &[u8]| triangles.push_face(&PtexFace::new(log2), texels).map_err(|e| e.to_string());
    assert!(push([1, 2], &[0; 16]).unwrap_err().contains("along u as along v"), "not square");
    assert!(push([15, 15], &[]).unwrap_err().contains("resolution"), "too large");
    assert!(push([1, 1], &[0; 7]).unwrap_err().contains("texels"), "too few");
    push([1, 1], &[0; 8]).unwrap();
    assert!(push([1, 1], &[0; 8]).unwrap_err().contains("more faces"), "one too many");
    let fewer = new(MeshType::Quad, 1, None, 1).unwrap().finish().unwrap_err();
    assert!(fewer.to_string().contains("fewer faces"), "none of one");
}
