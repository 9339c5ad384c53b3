// SPDX-License-Identifier: Apache-2.0
//! What may be wrong with films and their files.

use std::path::{Path, PathBuf};

/// The reasons why films are not read, written or merged. Each names its file.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    /// The file cannot be opened, read or written.
    #[error("{path}: {1}", path = .0.display())]
    File(PathBuf, #[source] std::io::Error),
    /// It is something else than a film, or one of another version.
    #[error("{path}: {1}", path = .0.display())]
    Foreign(PathBuf, String),
    /// It is cut, or its bytes are not those that were written.
    #[error("{path}: damaged: {1}", path = .0.display())]
    Damaged(PathBuf, String),
    /// Samples of films do not belong together.
    #[error("{}: does not merge with {}: {what}", .path.display(), .with.display())]
    Apart {
        /// The file that is refused.
        path: PathBuf,
        /// A file before it.
        with: PathBuf,
        /// Why.
        what: String,
    },
    /// What was asked for is not in the film.
    #[error("{path}: {1}", path = .0.display())]
    Missing(PathBuf, String),
    /// What was to be put into a film does not fit it.
    #[error("a film cannot take this: {0}")]
    Unfit(String),
}

impl FilmError {
    pub(crate) fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        move |error| Self::File(path.to_owned(), error)
    }

    pub(crate) fn damaged(path: &Path, what: impl Into<String>) -> Self {
        Self::Damaged(path.to_owned(), what.into())
    }

    pub(crate) fn unfit(what: impl Into<String>) -> Self {
        Self::Unfit(what.into())
    }
}
