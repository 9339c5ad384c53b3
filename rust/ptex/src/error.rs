// SPDX-License-Identifier: Apache-2.0
//! The error type of reading and writing.

/// Why a file cannot be read or written. The file itself is at fault, except for [`Self::Io`], [`Self::OutOfMemory`],
/// [`Self::FaceOutOfRange`] and [`Self::InvalidArgument`].
#[derive(Debug, thiserror::Error)]
pub enum PtexError {
    /// The source of the bytes failed.
    #[error("reading failed: {0}")]
    Io(#[from] std::io::Error),
    /// The first four bytes are not `Ptex`.
    #[error("not a Ptex file")]
    NotPtex,
    /// The major version is not 1: other versions have another layout.
    #[error("Ptex files of version {0} are not supported (only 1 is)")]
    UnsupportedVersion(u32),
    /// A field of the header has a value that the format does not define, or one above the limits of this crate.
    #[error("the header's {field} is {value}")]
    InvalidHeader {
        /// Name of the field, for the message.
        field: &'static str,
        /// The field's value in the file.
        value: u64,
    },
    /// A part of the file (a table, a block, a tile) reaches beyond the end of what contains it.
    #[error("{0} does not end inside the file: cut short, or its length is wrong")]
    Truncated(&'static str),
    /// A part claims more bytes than deflate can make of its compressed bytes (at most 1032 to 1).
    #[error("{part} claims {bytes} bytes, which {stored} compressed bytes cannot hold")]
    ImpossibleSize {
        /// Name of the part, for the message.
        part: &'static str,
        /// Inflated bytes.
        bytes: u64,
        /// Compressed bytes.
        stored: u64,
    },
    /// A compressed part does not inflate, or inflates to another length than the file says.
    #[error("{0} is damaged")]
    Damaged(&'static str),
    /// The resolution of a face is negative or too large.
    #[error("face {face} has a resolution of 2^{} x 2^{} texels", log2[0], log2[1])]
    InvalidResolution {
        /// Index of the face.
        face: u32,
        /// Base-2 logarithms of the resolution along u and v, as in the file.
        log2: [i8; 2],
    },
    /// A part inflates to more than [`crate::MAX_BYTES`].
    #[error("{part} would be {bytes} bytes, which is too many")]
    TooLarge {
        /// Name of the part, for the message.
        part: &'static str,
        /// Inflated bytes.
        bytes: u64,
    },
    /// The edit at this byte offset is malformed, or there are more than [`crate::MAX_EDITS`].
    #[error("the edit at byte {0} is damaged")]
    DamagedEdit(u64),
    /// An allocation of this many bytes failed.
    #[error("no memory for {0} bytes")]
    OutOfMemory(u64),
    /// The file has no such face.
    #[error("there is no face {0}")]
    FaceOutOfRange(u32),
    /// The caller asks the writer for something that the format cannot store.
    #[error("the file cannot be written: {0}")]
    InvalidArgument(&'static str),
}
