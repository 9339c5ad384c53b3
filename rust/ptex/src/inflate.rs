// SPDX-License-Identifier: Apache-2.0
//! Reads bytes of the file and inflates its compressed parts: nothing is read, inflated or allocated before its length
//! is known to be possible.

use flate2::{Decompress, FlushDecompress, Status};

use crate::{MAX_BYTES, PtexError, ReadAt};

/// Largest ratio of deflate: a match of 258 bytes in two bits.
const MAX_RATIO: u64 = 1032;

/// The file, and its length when it was opened.
pub(crate) struct FileBytes {
    source: Box<dyn ReadAt>,
    size: u64,
}

/// The position of a part in the file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StoredPart {
    pub(crate) name: &'static str,
    pub(crate) at: u64,
    /// Bytes in the file.
    pub(crate) stored: u64,
}

impl FileBytes {
    pub(crate) fn new(source: Box<dyn ReadAt>) -> Self {
        let size = source.size();
        Self { source, size }
    }

    pub(crate) fn size(&self) -> u64 {
        self.size
    }

    /// Fails unless the file contains all of a part.
    pub(crate) fn check(&self, part: StoredPart) -> Result<(), PtexError> {
        let end = part.at.checked_add(part.stored);
        end.filter(|end| *end <= self.size).map(|_| ()).ok_or(PtexError::Truncated(part.name))
    }

    pub(crate) fn fill(&self, name: &'static str, at: u64, out: &mut [u8]) -> Result<(), PtexError> {
        let stored = u64::try_from(out.len()).unwrap_or(u64::MAX);
        self.check(StoredPart { name, at, stored })?;
        Ok(self.source.read_at(at, out)?)
    }

    pub(crate) fn array<const N: usize>(&self, name: &'static str, at: u64) -> Result<[u8; N], PtexError> {
        let mut bytes = [0; N];
        self.fill(name, at, &mut bytes)?;
        Ok(bytes)
    }
}

/// Inflates parts, one after the other. It reuses its memory between them.
pub(crate) struct Inflater {
    decompress: Decompress,
    stored: Vec<u8>,
}

impl Inflater {
    pub(crate) fn new() -> Self {
        Self { decompress: Decompress::new(true), stored: Vec::new() }
    }

    /// Fills `out` with the inflated bytes of a part. Fails unless their number is exactly its length.
    pub(crate) fn fill(&mut self, file: &FileBytes, part: StoredPart, out: &mut [u8]) -> Result<(), PtexError> {
        check_ratio(part, u64::try_from(out.len()).unwrap_or(u64::MAX))?;
        file.check(part)?;
        resize(&mut self.stored, part.stored)?;
        file.fill(part.name, part.at, &mut self.stored)?;
        self.decompress.reset(true);
        let status = self.decompress.decompress(&self.stored, out, FlushDecompress::Finish);
        let is_whole = usize::try_from(self.decompress.total_out()) == Ok(out.len());
        match status {
            // Bytes that follow the stream inside of its part have no meaning.
            Ok(Status::StreamEnd) if is_whole => Ok(()),
            _ => Err(PtexError::Damaged(part.name)),
        }
    }

    /// Reads a part that inflates to `bytes`.
    pub(crate) fn table(&mut self, file: &FileBytes, part: StoredPart, bytes: u64) -> Result<Vec<u8>, PtexError> {
        check_table(part, bytes)?;
        file.check(part)?;
        let mut out = Vec::new();
        resize(&mut out, bytes)?;
        self.fill(file, part, &mut out)?;
        Ok(out)
    }
}

/// Fails if a part cannot be a table of `bytes`.
pub(crate) fn check_table(part: StoredPart, bytes: u64) -> Result<(), PtexError> {
    if bytes > MAX_BYTES {
        return Err(PtexError::TooLarge { part: part.name, bytes });
    }
    check_ratio(part, bytes)
}

/// Fails if no stream of this length inflates to `bytes`.
pub(crate) fn check_ratio(part: StoredPart, bytes: u64) -> Result<(), PtexError> {
    let StoredPart { name, stored, .. } = part;
    if bytes > stored.saturating_mul(MAX_RATIO) {
        return Err(PtexError::ImpossibleSize { part: name, bytes, stored });
    }
    Ok(())
}

/// Makes `out` have `bytes` bytes of any value. Fails instead of ending the process if there is no memory for them.
pub(crate) fn resize(out: &mut Vec<u8>, bytes: u64) -> Result<(), PtexError> {
    let length = usize::try_from(bytes).map_err(|_too_many| PtexError::OutOfMemory(bytes))?;
    let more = length.saturating_sub(out.len());
    out.try_reserve_exact(more).map_err(|_no_memory| PtexError::OutOfMemory(bytes))?;
    out.resize(length, 0);
    Ok(())
}
