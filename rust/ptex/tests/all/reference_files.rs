// SPDX-License-Identifier: Apache-2.0
//! Files that the reference writer wrote: every texel and every neighbour against the formulas of
//! `tests/data/README.md`.

use oocpt_ptex::BorderMode::{Black, Clamp, Periodic};
use oocpt_ptex::{BorderMode, DataType, MeshType, PtexFile};

use crate::support::Kind::{Constant, Missing, Quarter, Varied};
use crate::support::{Format, Kind, fixture, open, read, texels};

struct Fixture {
    name: &'static str,
    mesh_type: MeshType,
    data_type: DataType,
    channels: u32,
    alpha_channel: Option<u32>,
    border_modes: [BorderMode; 2],
    seed: u32,
    faces: &'static [([u8; 2], Kind)],
}

const QUAD: Fixture = Fixture {
    name: "",
    mesh_type: MeshType::Quad,
    data_type: DataType::U8,
    channels: 0,
    alpha_channel: None,
    border_modes: [Clamp; 2],
    seed: 0,
    faces: &[],
};
const TRIANGLE: Fixture = Fixture { mesh_type: MeshType::Triangle, ..QUAD };

const EIGHT: &[([u8; 2], Kind)] = &[
    ([3, 2], Varied),
    ([1, 4], Varied),
    ([2, 2], Constant),
    ([0, 0], Varied),
    ([4, 0], Varied),
    ([2, 3], Missing),
    ([5, 5], Quarter),
    ([0, 3], Varied),
];
const EDITED: &[([u8; 2], Kind)] =
    &[([2, 3], Varied), ([3, 1], Constant), ([1, 1], Varied), ([2, 2], Quarter), ([0, 2], Missing)];

const FIXTURES: [Fixture; 12] = [
    Fixture { name: "quad_u8_3.ptx", channels: 3, seed: 1, faces: EIGHT, ..QUAD },
    Fixture {
        name: "quad_u16_4_alpha.ptx",
        data_type: DataType::U16,
        channels: 4,
        alpha_channel: Some(3),
        border_modes: [Periodic, Black],
        seed: 2,
        faces: &[([2, 3], Varied), ([3, 3], Quarter), ([1, 1], Constant)],
        ..QUAD
    },
    Fixture {
        name: "quad_f16_1.ptx",
        data_type: DataType::F16,
        channels: 1,
        border_modes: [Black, Clamp],
        seed: 3,
        faces: &[([4, 3], Varied), ([2, 2], Constant), ([1, 3], Varied)],
        ..QUAD
    },
    Fixture {
        name: "quad_f32_2.ptx",
        data_type: DataType::F32,
        channels: 2,
        border_modes: [Clamp, Periodic],
        seed: 4,
        faces: &[([2, 1], Varied), ([3, 3], Quarter), ([0, 0], Constant)],
        ..QUAD
    },
    Fixture {
        name: "quad_u8_5_alpha0.ptx",
        channels: 5,
        alpha_channel: Some(0),
        seed: 5,
        faces: &[([3, 3], Varied), ([1, 2], Varied)],
        ..QUAD
    },
    Fixture {
        name: "triangle_u8_4.ptx",
        channels: 4,
        seed: 6,
        faces: &[([3, 3], Varied), ([2, 2], Constant), ([4, 4], Quarter), ([0, 0], Varied)],
        ..TRIANGLE
    },
    Fixture {
        name: "triangle_f32_3.ptx",
        data_type: DataType::F32,
        channels: 3,
        seed: 7,
        faces: &[([2, 2], Varied), ([1, 1], Varied)],
        ..TRIANGLE
    },
    Fixture { name: "edits_u16_2.ptx", data_type: DataType::U16, channels: 2, seed: 8, faces: EDITED, ..QUAD },
    Fixture {
        name: "edits_bare_u8_3.ptx",
        channels: 3,
        alpha_channel: Some(2),
        seed: 9,
        faces: &[([3, 2], Varied), ([2, 2], Varied), ([2, 1], Constant), ([3, 3], Varied)],
        ..QUAD
    },
    Fixture {
        name: "tiled_u8_1.ptx",
        channels: 1,
        seed: 10,
        faces: &[([9, 8], Quarter), ([8, 10], Quarter), ([2, 2], Varied)],
        ..QUAD
    },
    Fixture {
        name: "tiled_f32_1.ptx",
        data_type: DataType::F32,
        channels: 1,
        seed: 11,
        faces: &[([8, 7], Quarter), ([7, 8], Constant)],
        ..QUAD
    },
    Fixture { name: "tiled_triangle_u8_2.ptx", channels: 2, seed: 12, faces: &[([8, 8], Quarter)], ..TRIANGLE },
];

/// Resolution and kind of an edited face, and its seed. The second edit has the faces after those of the first.
fn edited(face: u32, seed: u32, log2: [u8; 2], kind: Kind) -> (u32, [u8; 2], Kind) {
    let kind = if kind == Constant || face.is_multiple_of(2) { Varied } else { Constant };
    (seed + 1000 + face % 3, [log2[1], log2[0]], kind)
}

fn neighbour(fixture: &Fixture, face: u32, edge: u32) -> Option<(u32, u8)> {
    let (faces, edges) = match fixture.mesh_type {
        MeshType::Triangle => (fixture.faces.len(), 3),
        MeshType::Quad => (fixture.faces.len(), 4),
    };
    let faces = u32::try_from(faces).unwrap();
    let is_none = edge >= edges || (face + edge).is_multiple_of(3);
    (!is_none).then(|| ((face + edge + 1) % faces, u8::try_from((face * 2 + edge) % edges).unwrap()))
}

fn check_face(fixture: &Fixture, file: &PtexFile, number: u32) {
    let Fixture { name, data_type, channels, .. } = *fixture;
    let (log2, kind) = fixture.faces[number as usize];
    let is_edited = name.starts_with("edits") && number % 3 < 2;
    let (seed, log2, kind) =
        if is_edited { edited(number, fixture.seed, log2, kind) } else { (fixture.seed, log2, kind) };
    let log2 = if kind == Missing { [0, 0] } else { log2 };
    let face = &file.faces()[number as usize];
    assert_eq!(face.log2, log2, "{name}, face {number}");
    assert_eq!(face.has_edits, is_edited, "{name}, face {number}");
    let is_constant = matches!(kind, Constant | Missing) || log2 == [0, 0];
    assert_eq!(face.is_constant, is_constant, "{name}, face {number}");
    let is_quad = fixture.mesh_type == MeshType::Quad;
    assert_eq!(face.is_subface, is_quad && kind != Missing && number % 5 == 3, "{name}, face {number}");
    for (edge, adjacent) in (0..).zip(face.adjacent) {
        let expected = if kind == Missing { None } else { neighbour(fixture, number, edge) };
        assert_eq!(adjacent, expected, "{name}, face {number}, edge {edge}");
    }
    let expected = texels(Format { data_type, channels }, number + seed, log2, kind);
    assert_eq!(file.face_bytes(number).unwrap(), expected.len() as u64, "{name}, face {number}");
    assert!(read(file, number).unwrap() == expected, "{name}: texels of face {number}");
    assert_eq!(file.constant(number), is_constant.then(|| &expected[..file.texel_bytes()]), "{name}, face {number}");
}

#[test]
fn reference_files_are_read_exactly() {
    for fixture in FIXTURES {
        let file = open(crate::support::fixture(fixture.name)).unwrap();
        assert_eq!(file.mesh_type(), fixture.mesh_type, "{}", fixture.name);
        assert_eq!(file.data_type(), fixture.data_type, "{}", fixture.name);
        assert_eq!(file.channels(), fixture.channels, "{}", fixture.name);
        assert_eq!(file.alpha_channel(), fixture.alpha_channel, "{}", fixture.name);
        assert_eq!(file.border_modes(), fixture.border_modes, "{}", fixture.name);
        assert_eq!(file.faces().len(), fixture.faces.len(), "{}", fixture.name);
        for number in (0..).take(fixture.faces.len()) {
            check_face(&fixture, &file, number);
        }
    }
}

#[test]
fn files_and_shared_bytes_are_read_by_several_threads() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/tiled_u8_1.ptx");
    let from_file = PtexFile::open(Box::new(std::fs::File::open(path).unwrap())).unwrap();
    let shared: std::sync::Arc<[u8]> = fixture("tiled_u8_1.ptx").into();
    let from_memory = PtexFile::open(Box::new(shared)).unwrap();
    let expected = read(&from_memory, 1).unwrap();
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| assert!(read(&from_file, 1).unwrap() == expected, "the same texels in each thread"));
        }
    });
}

#[test]
fn an_out_of_range_face_is_an_error() {
    let file = open(fixture("quad_u8_3.ptx")).unwrap();
    assert_eq!(read(&file, 8).unwrap_err().to_string(), "there is no face 8");
    assert_eq!(file.face_bytes(u32::MAX).unwrap_err().to_string(), "there is no face 4294967295");
    assert_eq!(file.constant(8), None, "no face, no texel");
}
