// SPDX-License-Identifier: Apache-2.0
//! Errors of reading and writing files.

/// Reason why a file is not read or written. The file is at fault, except for [`Self::Io`], [`Self::OutOfMemory`],
/// [`Self::NoFace`] and [`Self::Caller`].
#[derive(Debug, thiserror::Error)]
pub enum PtexError {
    /// The source of the bytes failed.
    #[error("reading failed: {0}")]
    Io(#[from] std::io::Error),
    /// The first four bytes are not `Ptex`.
    #[error("not a Ptex file")]
    Magic,
    /// The file has another major version, whose layout differs.
    #[error("Ptex files of version {0} are not supported (only 1 is)")]
    Version(u32),
    /// A field of the header has a value that the format does not allow, or above the limits of this crate.
    #[error("the header's {field} is {value}")]
    Header {
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        value: u64,
    },
    /// A part lies, wholly or in part, beyond the end of the part or file that contains it.
    #[error("{0} does not end inside the file: cut short, or its length is wrong")]
    Truncated(&'static str),
    /// A compressed part claims to inflate to more than its compressed bytes can.
    #[error("{part} is to be {bytes} bytes, compressed to {stored}, which cannot be")]
    Ratio {
        /// Name of the part.
        part: &'static str,
        /// Bytes once inflated.
        bytes: u64,
        /// Bytes in the file.
        stored: u64,
    },
    /// A compressed part does not inflate, or not to the length that it should have.
    #[error("{0} is damaged")]
    Damaged(&'static str),
    /// A face has an impossible resolution.
    #[error("face {face} has a resolution of 2^{} x 2^{} texels", log2[0], log2[1])]
    Resolution {
        /// Number of the face.
        face: u32,
        /// Logarithms of base 2 of its resolution along u and v, as the file has them.
        log2: [i8; 2],
    },
    /// A part is more than [`crate::MAX_BYTES`] once inflated.
    #[error("{part} would be {bytes} bytes, which is too many")]
    TooLarge {
        /// Name of the part.
        part: &'static str,
        /// Bytes once inflated.
        bytes: u64,
    },
    /// An edit of an unknown kind, or one more than [`crate::MAX_EDITS`].
    #[error("the edit at byte {0} is damaged")]
    Edit(u64),
    /// There is no memory for this many bytes.
    #[error("no memory for {0} bytes")]
    OutOfMemory(u64),
    /// The file has no such face.
    #[error("there is no face {0}")]
    NoFace(u32),
    /// The caller of the writer asks for something that the format does not have.
    #[error("the file cannot be written: {0}")]
    Caller(&'static str),
}
