// SPDX-License-Identifier: Apache-2.0
//! Writes files, for tests and generators of scenes. One level, no metadata, no edits: as much as readers require.

mod average;

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;

use crate::format::{
    BARRIER_BYTES, BlockEncoding, EXTENDED_BYTES, ExtendedHeader, FACE_BYTES, LEVEL_BYTES, PtexHeader, block_word,
    face_record,
};
use crate::texels::{FaceRect, TexelLayout, make_differences};
use crate::{BorderMode, DataType, MAX_BYTES, MAX_CHANNELS, MAX_FACES, MAX_LOG2, MeshType, PtexError, PtexFace};

/// Faces of more bytes are cut into tiles of at most this.
const TILE_BYTES: usize = 1 << 16;

/// Writes a file face by face. The compressed texels stay in memory until [`Self::finish`], since what comes before
/// them in the file is known only then.
pub struct PtexWriter<W: Write> {
    sink: W,
    header: PtexHeader,
    border_modes: [BorderMode; 2],
    texel: TexelLayout,
    records: Vec<u8>,
    constants: Vec<u8>,
    /// The words of the faces' blocks.
    words: Vec<u8>,
    /// The faces' blocks.
    blocks: Vec<u8>,
}

impl<W: Write> std::fmt::Debug for PtexWriter<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PtexWriter").field("header", &self.header).finish_non_exhaustive()
    }
}

impl<W: Write> PtexWriter<W> {
    /// Begins a file of `faces` faces, whose borders are [`BorderMode::Clamp`]. Nothing is written yet.
    pub fn new(
        sink: W,
        mesh_type: MeshType,
        data_type: DataType,
        channels: u32,
        alpha_channel: Option<u32>,
        faces: u32,
    ) -> Result<Self, PtexError> {
        let has_channels = (1..=MAX_CHANNELS).contains(&channels);
        let Some(known) = u16::try_from(channels).ok().filter(|_| has_channels) else {
            return Err(PtexError::Caller("a number of channels out of range"));
        };
        if alpha_channel.is_some_and(|alpha| alpha >= channels) {
            return Err(PtexError::Caller("an alpha channel that texels do not have"));
        }
        if faces == 0 || faces > MAX_FACES {
            return Err(PtexError::Caller("a number of faces out of range"));
        }
        let header = PtexHeader {
            mesh_type,
            data_type,
            alpha_channel,
            channels: known,
            levels: 1,
            faces,
            extended_bytes: EXTENDED_BYTES,
            face_bytes: 0,
            constant_bytes: 0,
            level_info_bytes: LEVEL_BYTES,
            level_data_bytes: 0,
            metadata_bytes: 0,
        };
        Ok(Self {
            sink,
            header,
            border_modes: [BorderMode::Clamp; 2],
            texel: TexelLayout { data_type, channels: channels as usize },
            records: Vec::new(),
            constants: Vec::new(),
            words: Vec::new(),
            blocks: Vec::new(),
        })
    }

    /// Says what filters take beyond edges without neighbours, along u and v.
    pub fn set_border_modes(&mut self, border_modes: [BorderMode; 2]) {
        self.border_modes = border_modes;
    }

    /// Appends the next face. `texels` is as [`crate::PtexFile::read_face`] gives it, or one texel if the face is
    /// constant. Faces whose texels are all equal become constant. `face.has_edits` means nothing.
    pub fn push_face(&mut self, face: &PtexFace, texels: &[u8]) -> Result<(), PtexError> {
        if self.faces() >= self.header.faces as usize {
            return Err(PtexError::Caller("more faces than announced"));
        }
        if face.log2.iter().any(|log2| *log2 > MAX_LOG2) {
            return Err(PtexError::Caller("a resolution out of range"));
        }
        if self.header.mesh_type == MeshType::Triangle && face.log2[0] != face.log2[1] {
            return Err(PtexError::Caller("a triangle that is not as many texels along u as along v"));
        }
        let size = face.log2.map(|log2| 1_usize << log2);
        let all = size[0] * size[1] * self.texel.bytes();
        if all as u64 > MAX_BYTES && !face.is_constant {
            return Err(PtexError::Caller("a face of more than 2 GiB"));
        }
        if texels.len() != if face.is_constant { self.texel.bytes() } else { all } {
            return Err(PtexError::Caller("texels of another number than their face"));
        }
        let (first, others) = texels.split_at(self.texel.bytes());
        let is_constant = others.chunks_exact(self.texel.bytes()).all(|texel| texel == first);
        if is_constant {
            self.words.extend([0; 4]);
        } else {
            let before = self.blocks.len();
            let encoding = self.push_texels(texels, face.log2)?;
            let word = block_word(encoding, self.blocks.len() - before)?;
            self.words.extend(word.to_le_bytes());
        }
        let mut constant =
            if is_constant { first.to_vec() } else { average::average(self.texel, self.header.alpha_channel, texels) };
        self.texel.swap_bytes(&mut constant);
        self.constants.extend(constant);
        self.records.extend(face_record(&PtexFace { is_constant, ..*face }));
        Ok(())
    }

    /// Writes the file, and gives the sink back. Fails unless all faces have come.
    pub fn finish(mut self) -> Result<W, PtexError> {
        if self.faces() != self.header.faces as usize {
            return Err(PtexError::Caller("fewer faces than announced"));
        }
        let too_large = |_too_many| PtexError::Caller("a table of more than 4 GiB");
        let records = zipped(&self.records)?;
        let constants = zipped(&self.constants)?;
        let words = zipped(&self.words)?;
        self.header.face_bytes = u32::try_from(records.len()).map_err(too_large)?;
        self.header.constant_bytes = u32::try_from(constants.len()).map_err(too_large)?;
        self.header.level_data_bytes = (words.len() + self.blocks.len()) as u64;
        let words_bytes = u32::try_from(words.len()).map_err(too_large)?;
        let mut level = self.header.level_data_bytes.to_le_bytes().to_vec();
        level.extend(words_bytes.to_le_bytes());
        level.extend(self.header.faces.to_le_bytes());

        let header = self.header.to_bytes();
        let barrier = [0; BARRIER_BYTES as usize];
        let parts = [&records, &constants, &level, &words, &self.blocks, &barrier.to_vec()];
        let length = header.len() + EXTENDED_BYTES as usize + parts.iter().map(|part| part.len()).sum::<usize>();
        self.sink.write_all(&header)?;
        self.sink.write_all(&ExtendedHeader::new_bytes(self.border_modes, length as u64))?;
        for part in parts {
            self.sink.write_all(part)?;
        }
        self.sink.flush()?;
        Ok(self.sink)
    }

    /// How many faces have come.
    fn faces(&self) -> usize {
        self.records.len() / FACE_BYTES as usize
    }

    /// Appends the block of a face, in tiles if it is large.
    fn push_texels(&mut self, texels: &[u8], log2: [u8; 2]) -> Result<BlockEncoding, PtexError> {
        let [mut u, mut v] = log2;
        while self.texel.bytes() << (u + v) > TILE_BYTES && u + v > 0 {
            if u >= v { u -= 1 } else { v -= 1 }
        }
        let size = log2.map(|log2| 1 << log2);
        let tile = [1 << u, 1 << v];
        let all = FaceRect { at: [0; 2], size, face_width: size[0] };
        if tile == size {
            let (encoding, block) = self.compressed(texels, all)?;
            self.blocks.extend(block);
            return Ok(encoding);
        }
        let (mut words, mut tiles) = (Vec::new(), Vec::new());
        for low in (0..size[1]).step_by(tile[1]) {
            for left in (0..size[0]).step_by(tile[0]) {
                let (encoding, block) = self.compressed(texels, FaceRect { at: [left, low], size: tile, ..all })?;
                words.extend(block_word(encoding, block.len())?.to_le_bytes());
                tiles.extend(block);
            }
        }
        let words = zipped(&words)?;
        let words_bytes = u32::try_from(words.len()).map_err(|_too_many| PtexError::Caller("too many tiles"))?;
        self.blocks.extend([u, v]);
        self.blocks.extend(words_bytes.to_le_bytes());
        self.blocks.extend(words);
        self.blocks.extend(tiles);
        Ok(BlockEncoding::Tiled)
    }

    /// A rectangle of a face as it is stored.
    fn compressed(&self, texels: &[u8], rect: FaceRect) -> Result<(BlockEncoding, Vec<u8>), PtexError> {
        let mut planes = self.texel.planes(texels, rect);
        let value = self.texel.data_type.bytes();
        let mut channels = planes.chunks_exact(rect.size[0] * rect.size[1] * value);
        if channels.all(|plane| plane.chunks_exact(value).all(|each| plane.starts_with(each))) {
            let channels = planes.chunks_exact(rect.size[0] * rect.size[1] * value);
            return Ok((
                BlockEncoding::Constant,
                channels.flat_map(|plane| plane.iter().take(value).copied()).collect(),
            ));
        }
        let encoding = match self.texel.data_type {
            DataType::U8 | DataType::U16 => BlockEncoding::DiffZipped,
            DataType::F16 | DataType::F32 => BlockEncoding::Zipped,
        };
        make_differences(&mut planes, self.texel.data_type);
        Ok((encoding, zipped(&planes)?))
    }
}

fn zipped(bytes: &[u8]) -> Result<Vec<u8>, PtexError> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes)?;
    Ok(encoder.finish()?)
}
