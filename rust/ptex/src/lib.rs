// SPDX-License-Identifier: Apache-2.0
//! Ptex files (`.ptx`): a texture for each face of a mesh, without texture coordinates (Burley & Lacewell 2008, "Ptex:
//! Per-Face Texture Mapping for Production Rendering"). A reader of the file format, version 1, and a writer.

#![forbid(unsafe_code)]

mod edits;
mod error;
mod face;
mod file;
mod format;
mod inflate;
mod read;
mod source;
mod texels;
mod write;

pub use error::PtexError;
pub use face::{BorderMode, DataType, Face, MeshType};
pub use file::PtexFile;
pub use source::ReadAt;
pub use write::PtexWriter;

/// Most faces of a file.
pub const MAX_FACES: u32 = 1 << 26;
/// Most channels of a texel.
pub const MAX_CHANNELS: u32 = 64;
/// Most texels of a face along u and along v, as a logarithm of base 2.
pub const MAX_LOG2: u8 = 14;
/// Most bytes of the texels of a face, and of each table of a file once inflated.
pub const MAX_BYTES: u64 = 1 << 31;
/// Most edits of a file.
pub const MAX_EDITS: u32 = 1 << 24;
