// SPDX-License-Identifier: Apache-2.0
//! Interfaces of the storage for built meshes outside host memory. The code that reads and writes files implements
//! these traits. Any thread.

use std::fmt::Debug;
use std::sync::Arc;
use std::time::Duration;

/// Stores built meshes, as bytes.
///
/// Called by several threads at once; must not wait for work of the rayon pool.
pub trait MeshFiles: Send + Sync + Debug {
    /// Returns true if another process can find an entry again: then all meshes are added, not only those for which
    /// there is no host memory.
    fn is_persistent(&self) -> bool;

    /// The entry of a key, written by this process or an earlier one.
    fn find(&self, key: u128) -> Option<StoredEntry>;

    /// Writes an entry: `head`, which is read at once, and payloads, which are read when they are needed, each given in
    /// parts. An entry without a key is not found again. `None` if it cannot be written; the implementation has then
    /// reported it to the user.
    fn add(&self, key: Option<u128>, head: &[u8], payloads: &[Vec<&[u8]>]) -> Option<Vec<Arc<dyn PayloadSource>>>;

    /// Takes note of an entry that can no longer be read.
    fn damaged(&self, key: Option<u128>, error: &PayloadError);

    /// Waits before a read that failed is tried again.
    fn wait(&self, pause: Duration);
}

/// An entry that was written before.
#[derive(Debug)]
pub struct StoredEntry {
    /// Head as it was given to [`MeshFiles::add`].
    pub head: Vec<u8>,
    /// Payloads, one for each that was given.
    pub payloads: Vec<Arc<dyn PayloadSource>>,
}

/// Bytes that are stored elsewhere and read on demand.
pub trait PayloadSource: Send + Sync + Debug {
    /// Number of bytes.
    fn size(&self) -> u64;

    /// Reads the whole payload into `parts` one after the other, which together have [`Self::size`] bytes.
    ///
    /// # Errors
    /// It cannot be read, or its bytes are not those that were written; `parts` have any content then.
    fn read(&self, parts: &mut [&mut [u8]]) -> Result<(), PayloadError>;
}

/// Reason why a payload cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PayloadError {
    /// The system's message about a read that failed.
    #[error("{0}")]
    Read(String),
    /// The content fails its hash, or has another length than expected.
    #[error("its content is not what was written")]
    Damaged,
}
