// SPDX-License-Identifier: Apache-2.0
//! Ptex files as textures: their properties, and their conversion to tiles of texels by face
//! (`oocpt_core::texture::FaceLayout`). Any thread.

mod assemble;
mod border;
mod pyramid;

use super::convert::{TileSink, make_finite};
use super::image::{ColorTransform, ImageError, ImageInfo};
use super::texels::StoredTexels;
use assemble::FaceAssembler;
use border::{FaceSurroundings, fits, neighbours};
use oocpt_abi::TILE_SIDE;
use oocpt_core::texture::{FaceLayout, TexelFormat};
use oocpt_ptex::{DataType, MeshType, PtexFace, PtexFile, ReadAt};
use pyramid::{FaceEdges, FacePyramid};
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Texels of faces that are decoded at a time.
const BATCH_TEXELS: u64 = 1 << 21;
/// Most faces of a batch.
const BATCH_FACES: u32 = 1 << 14;
/// Most bytes of edges that are kept for later faces.
const MAX_EDGE_BYTES: usize = 256 << 20;
/// Constant faces are stored with at most this many texels a side, as a power of two: they blend with their neighbours
/// over 1/32 of a side.
const CONSTANT_LOG2: u8 = 4;
/// Bytes of texels that a file of any size may have; beyond, at most [`MAX_EXPANSION`] for each byte of it.
const ALWAYS_ALLOWED_BYTES: u64 = 64 << 20;
/// Most bytes of texels for each byte of a larger file. Deflate expands by at most 1032; the rest is for tiles of one
/// colour.
const MAX_EXPANSION: u64 = 2048;
/// Most texels of a face: its levels are held as floats.
const MAX_FACE_TEXELS: u64 = 1 << 26;

/// An open Ptex file.
#[derive(Debug)]
pub(super) struct PtexSource {
    file: PtexFile,
    layout: Arc<FaceLayout>,
    /// Channels of the file that are read.
    picked: Vec<usize>,
    info: ImageInfo,
}

/// The stored formats of texels, and the conversion that makes them linear.
#[derive(Clone, Copy)]
pub(super) struct TexelConversion<'a> {
    /// The format in the file.
    pub(super) from: &'a StoredTexels,
    /// The format that is kept.
    pub(super) to: &'a StoredTexels,
    pub(super) transform: Option<&'a dyn ColorTransform>,
}

impl PtexSource {
    pub(super) fn open(bytes: Box<dyn ReadAt>) -> Result<Self, ImageError> {
        let file_bytes = bytes.size();
        let file = PtexFile::open(bytes).map_err(|error| ImageError(error.to_string()))?;
        if file.mesh_type() != MeshType::Quad {
            return Err(ImageError("is Ptex for triangles, which is not supported".into()));
        }
        let too_large = file.faces().iter().find(|face| texels(kept_log2(face)) > MAX_FACE_TEXELS);
        if let Some(face) = too_large {
            return Err(ImageError(format!("a face of 2^{} by 2^{} texels is too large", face.log2[0], face.log2[1])));
        }
        let layout = FaceLayout::new(file.faces().iter().map(kept_log2).collect());
        let layout = layout.map_err(|error| ImageError(error.to_string()))?;
        let decoded = u64::from(layout.texels()) * file.texel_bytes() as u64;
        if decoded > ALWAYS_ALLOWED_BYTES.max(file_bytes.saturating_mul(MAX_EXPANSION)) {
            return Err(ImageError(format!("says that it has {decoded} bytes of texels, in a file of {file_bytes}")));
        }
        let picked = pick(file.channels(), file.alpha_channel());
        let info = ImageInfo {
            levels: vec![[TILE_SIDE, layout.texels().div_ceil(TILE_SIDE)]],
            channels: u32::try_from(picked.len()).unwrap_or(4),
            format: match file.data_type() {
                DataType::U8 => TexelFormat::U8,
                DataType::F16 => TexelFormat::F16,
                DataType::U16 | DataType::F32 => TexelFormat::F32,
            },
            tile_friendly: false,
            is_srgb: None,
            wrap: None,
        };
        Ok(Self { file, layout: Arc::new(layout), picked, info })
    }

    /// The layout of the texels of faces.
    pub(super) fn layout(&self) -> &Arc<FaceLayout> {
        &self.layout
    }

    /// The properties of an image of one level with the same texels.
    pub(super) fn info(&self) -> &ImageInfo {
        &self.info
    }

    /// Passes every tile to `sink`, in no order. Every face is decoded once, and those at the border of a batch a
    /// second time; a face that cannot be decoded is an error.
    pub(super) fn convert(&self, meaning: TexelConversion<'_>, sink: &mut dyn TileSink) -> Result<(), ImageError> {
        let mut assembler = FaceAssembler::new(&self.layout, meaning.to.file_bytes());
        let mut kept: FxHashMap<u32, FaceEdges> = FxHashMap::default();
        let mut kept_bytes = 0;
        let faces = self.file.faces();
        let mut next = 0;
        while let Some(batch) = self.batch(next) {
            next = batch.end;
            let pyramids: Vec<FacePyramid> =
                batch.clone().into_par_iter().map(|face| self.pyramid(face, meaning)).collect::<Result<_, _>>()?;
            if kept_bytes > MAX_EDGE_BYTES {
                kept.clear();
                kept_bytes = 0;
            }
            let mut around: Vec<u32> = batch.clone().flat_map(|face| neighbours(faces, face)).collect();
            around.sort_unstable();
            around.dedup();
            around.retain(|face| !batch.contains(face) && !kept.contains_key(face));
            let channels = meaning.to.channels();
            // Large faces are decoded one after the other: in parallel, each thread would hold one as floats.
            let is_large = |face: &u32| texels(self.log2(*face)) > BATCH_TEXELS;
            let (large, small): (Vec<u32>, Vec<u32>) = around.into_iter().partition(is_large);
            let edges_of = |face: u32| Ok((face, self.pyramid(face, meaning)?.edges(channels)));
            let mut edges = small.into_par_iter().map(edges_of).collect::<Result<Vec<_>, ImageError>>()?;
            for face in large {
                edges.push(edges_of(face)?);
            }
            edges.extend(batch.clone().zip(&pyramids).map(|(face, own)| (face, own.edges(channels))));
            kept_bytes += edges.iter().map(|(_, edges)| edges.bytes()).sum::<usize>();
            kept.extend(edges);
            let border_modes = self.file.border_modes();
            let surroundings = FaceSurroundings { faces, channels, border_modes, edges: &kept };
            let made: Vec<Vec<(u32, u32, Vec<u8>)>> = batch
                .clone()
                .into_par_iter()
                .zip(&pyramids)
                .map(|(face, pyramid)| self.blocks(face, pyramid, &surroundings, meaning))
                .collect::<Result<_, _>>()?;
            for (class, first, bytes) in made.into_iter().flatten() {
                assembler.block(class, first, &bytes)?;
            }
            assembler.flush(sink)?;
        }
        assembler.finish(sink)
    }

    /// The next faces to make.
    fn batch(&self, first: u32) -> Option<std::ops::Range<u32>> {
        let mut sum = 0;
        let fits = |face: &&PtexFace| {
            let own = texels(kept_log2(face));
            let is_first = sum == 0;
            sum += own;
            is_first || sum <= BATCH_TEXELS
        };
        let count = self.file.faces().iter().skip(first as usize).take(BATCH_FACES as usize).take_while(fits).count();
        let end = first + u32::try_from(count).ok()?;
        (end > first).then_some(first..end)
    }

    /// Texels of a face as they are kept, as powers of two.
    fn log2(&self, face: u32) -> [u8; 2] {
        self.file.faces().get(face as usize).map_or([0; 2], kept_log2)
    }

    /// The levels of a face as linear values.
    fn pyramid(&self, face: u32, meaning: TexelConversion<'_>) -> Result<FacePyramid, ImageError> {
        let log2 = self.log2(face);
        let mut bytes = Vec::new();
        match self.file.constant(face) {
            Some(texel) => bytes = texel.repeat(usize::try_from(texels(log2)).unwrap_or(0)),
            None => {
                let wrong = |error| ImageError(format!("face {face}: {error}"));
                self.file.read_face(face, &mut bytes).map_err(wrong)?;
            }
        }
        let channels = self.picked.len();
        let stored = self.stored(&bytes);
        let count = usize::try_from(texels(log2)).unwrap_or(0);
        if stored.len() != count * meaning.from.file_bytes() {
            return Err(ImageError(format!("face {face} has another size than it says")));
        }
        let mut values = vec![0.0; count * channels];
        meaning.from.decode(&stored, &mut values);
        make_finite(&mut values);
        if let Some(transform) = meaning.transform {
            transform.apply(&mut values, u32::try_from(channels).unwrap_or(4))?;
            make_finite(&mut values);
        }
        Ok(FacePyramid::new(log2, values, channels))
    }

    /// The picked channels of texels, in the format of [`Self::info`].
    fn stored(&self, bytes: &[u8]) -> Vec<u8> {
        let channel = self.file.data_type().bytes();
        let mut out = Vec::with_capacity(bytes.len());
        for texel in bytes.chunks_exact(self.file.texel_bytes().max(1)) {
            for &pick in &self.picked {
                let value = texel.get(pick * channel..(pick + 1) * channel).unwrap_or_default();
                match (self.file.data_type(), value) {
                    (DataType::U16, &[low, high]) => {
                        out.extend((f32::from(u16::from_ne_bytes([low, high])) / 65535.0).to_ne_bytes());
                    }
                    _ => out.extend_from_slice(value),
                }
            }
        }
        out
    }

    /// Class, first texel and bytes of every block of a face.
    fn blocks(
        &self,
        face: u32,
        pyramid: &FacePyramid,
        surroundings: &FaceSurroundings<'_>,
        meaning: TexelConversion<'_>,
    ) -> Result<Vec<(u32, u32, Vec<u8>)>, ImageError> {
        let wrong = || ImageError(format!("face {face} has no place"));
        let own = surroundings.edges.get(&face).ok_or_else(wrong)?;
        let log2 = self.log2(face);
        let block = |level: usize| {
            let class = pyramid.class_of(level);
            let block = self.layout.block(class, face).filter(|block| fits(block, log2, class)).ok_or_else(wrong)?;
            let mut bytes = Vec::new();
            meaning.to.encode(&surroundings.block(face, level, pyramid, own), &mut bytes);
            Ok((class, block.first, bytes))
        };
        (0..pyramid.levels()).map(block).collect()
    }
}

/// Texels of a face as they are kept, as powers of two.
fn kept_log2(face: &PtexFace) -> [u8; 2] {
    if face.is_constant { face.log2.map(|log2| log2.min(CONSTANT_LOG2)) } else { face.log2 }
}

/// Texels of a face.
fn texels(log2: [u8; 2]) -> u64 {
    1 << (u32::from(log2[0]) + u32::from(log2[1])).min(63)
}

/// The channels that are read: all if there are up to four, else colour, with alpha if that is the fourth.
fn pick(channels: u32, alpha: Option<u32>) -> Vec<usize> {
    let count = match channels {
        0..=4 => channels,
        _ if alpha == Some(3) => 4,
        _ => 3,
    };
    (0..count as usize).collect()
}
