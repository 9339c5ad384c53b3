// SPDX-License-Identifier: Apache-2.0
//! The source of a file's bytes.

use std::io::{Error, ErrorKind, Result};
use std::sync::Arc;

/// A source of a file's bytes. Several threads read at once.
pub trait ReadAt: Send + Sync {
    /// Size of the file, bytes.
    fn size(&self) -> u64;

    /// Fills `out` from `offset` on, or fails, in which case `out` may contain anything.
    fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()>;
}

impl ReadAt for [u8] {
    fn size(&self) -> u64 {
        u64::try_from(self.len()).unwrap_or(u64::MAX)
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        let start = usize::try_from(offset).ok();
        let end = start.and_then(|start| start.checked_add(out.len()));
        let range = start.zip(end).map(|(start, end)| start..end);
        let bytes = range.and_then(|range| self.get(range)).ok_or_else(|| Error::from(ErrorKind::UnexpectedEof))?;
        out.copy_from_slice(bytes);
        Ok(())
    }
}

impl ReadAt for Vec<u8> {
    fn size(&self) -> u64 {
        self.as_slice().size()
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        self.as_slice().read_at(offset, out)
    }
}

impl ReadAt for Arc<[u8]> {
    fn size(&self) -> u64 {
        self.as_ref().size()
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        self.as_ref().read_at(offset, out)
    }
}

#[cfg(unix)]
impl ReadAt for std::fs::File {
    /// Size of the file; 0 if its length cannot be read.
    fn size(&self) -> u64 {
        self.metadata().map_or(0, |metadata| metadata.len())
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(self, out, offset)
    }
}
