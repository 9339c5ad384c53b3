// SPDX-License-Identifier: Apache-2.0
//! Faces whose texels a formula gives (see `tests/data/README.md`).

use std::path::PathBuf;

use half::f16;
use oocpt_ptex::{DataType, PtexError, PtexFile};

/// Variation of the texels of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Varied,
    Constant,
    Quarter,
    Missing,
}

/// The format that all faces of a file share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Format {
    pub(crate) data_type: DataType,
    pub(crate) channels: u32,
}

fn number(face: u32, u: u32, v: u32, channel: u32) -> u32 {
    face * 131 + u * 7 + v * 13 + channel * 29 + (u * v) % 11
}

fn value(data_type: DataType, number: u32) -> Vec<u8> {
    let small = |modulus: u32| f32::from(u16::try_from(number % modulus).unwrap());
    match data_type {
        DataType::U8 => vec![u8::try_from(number % 256).unwrap()],
        DataType::U16 => u16::try_from(number * 257 % 65536).unwrap().to_ne_bytes().to_vec(),
        DataType::F16 => f16::from_f32(small(2048) * 0.125 - 64.0).to_ne_bytes().to_vec(),
        DataType::F32 => (small(65536) * 0.25 - 100.0).to_ne_bytes().to_vec(),
    }
}

/// The texels of face `face` (its seed added) as a reader gives them.
pub(crate) fn texels(format: Format, face: u32, log2: [u8; 2], kind: Kind) -> Vec<u8> {
    let size = log2.map(|log2| 1_u32 << log2);
    let mut texels = Vec::new();
    for v in 0..size[1] {
        for u in 0..size[0] {
            let is_varied = match kind {
                Kind::Varied => true,
                Kind::Constant | Kind::Missing => false,
                Kind::Quarter => u >= size[0] / 2 && v < size[1] / 2,
            };
            let [u, v] = if is_varied { [u, v] } else { [0, 0] };
            for channel in 0..format.channels {
                let number = if kind == Kind::Missing { 0 } else { number(face, u, v, channel) };
                let mut value = value(format.data_type, number);
                if kind == Kind::Missing {
                    value.fill(0);
                }
                texels.extend(value);
            }
        }
    }
    texels
}

pub(crate) fn fixture(name: &str) -> Vec<u8> {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "tests", "data", name].iter().collect();
    std::fs::read(path).unwrap()
}

pub(crate) fn open(bytes: Vec<u8>) -> Result<PtexFile, PtexError> {
    PtexFile::open(Box::new(bytes))
}

pub(crate) fn read(file: &PtexFile, face: u32) -> Result<Vec<u8>, PtexError> {
    let mut out = vec![1, 2, 3];
    file.read_face(face, &mut out).map(|()| out)
}
