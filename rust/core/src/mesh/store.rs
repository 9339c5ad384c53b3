// SPDX-License-Identifier: Apache-2.0
//! Where built meshes may be kept besides host memory. Who reads and writes files says so through traits. Any thread.

use std::fmt::Debug;
use std::sync::Arc;
use std::time::Duration;

/// Keeps what meshes were built to, as bytes.
///
/// Called by several threads at once; must not wait for work of the rayon pool.
pub trait MeshFiles: Send + Sync + Debug {
    /// True where an entry can be found again by another process: then all meshes are added, not only those for which
    /// there is no host memory.
    fn lasts(&self) -> bool;

    /// The entry of a key, of this process or an earlier one.
    fn find(&self, key: u128) -> Option<StoredEntry>;

    /// Writes an entry: what is read at once, and what is read as it is needed, each payload in parts. Without a key it
    /// is not found again. `None` where it cannot be written; the implementation has said so to the user.
    fn add(&self, key: Option<u128>, head: &[u8], payloads: &[Vec<&[u8]>]) -> Option<Vec<Arc<dyn PayloadSource>>>;

    /// Takes note of an entry that can no longer be read.
    fn damaged(&self, key: Option<u128>, error: &PayloadError);

    /// Waits before a read that failed is tried again.
    fn wait(&self, pause: Duration);
}

/// An entry that was written before.
#[derive(Debug)]
pub struct StoredEntry {
    /// As it was given to [`MeshFiles::add`].
    pub head: Vec<u8>,
    /// One for each payload that was given.
    pub payloads: Vec<Arc<dyn PayloadSource>>,
}

/// Bytes that are somewhere else.
pub trait PayloadSource: Send + Sync + Debug {
    /// How many there are.
    fn size(&self) -> u64;

    /// Reads all of them, into `parts` one after the other, which together are [`Self::size`] long.
    ///
    /// # Errors
    /// They cannot be read, or are not those that were written; `parts` have any content then.
    fn read(&self, parts: &mut [&mut [u8]]) -> Result<(), PayloadError>;
}

/// Why a payload cannot be had.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PayloadError {
    /// What the system says.
    #[error("{0}")]
    Read(String),
    /// The content fails its hash, or has another length than expected.
    #[error("its content is not what was written")]
    Damaged,
}
