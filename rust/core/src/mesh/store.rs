// SPDX-License-Identifier: Apache-2.0
//! Where built meshes may be kept besides host memory, and how much of that they may take. Who reads and writes files
//! says so through traits. Any thread.

use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
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
    fn add(&self, key: Option<u128>, head: &[u8], payloads: &[Vec<&[u8]>]) -> Option<Vec<Arc<dyn Payload>>>;

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
    pub payloads: Vec<Arc<dyn Payload>>,
}

/// Bytes that are somewhere else.
pub trait Payload: Send + Sync + Debug {
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

/// How much host memory assets may take, and how much they do.
#[derive(Debug)]
pub struct HostMemory {
    limit: AtomicU64,
    /// Of everything, not of assets alone.
    budget: AtomicU64,
    held: AtomicU64,
}

impl Default for HostMemory {
    fn default() -> Self {
        let [limit, budget] = [u64::MAX; 2].map(AtomicU64::new);
        Self { limit, budget, held: AtomicU64::new(0) }
    }
}

impl HostMemory {
    /// Sets the limit, bytes. What is held stays.
    pub fn set_limit(&self, bytes: u64) {
        self.limit.store(bytes, Ordering::Relaxed);
    }

    /// Says what there may be in all, bytes: a prim whose assets alone are larger is told of.
    pub fn set_budget(&self, bytes: u64) {
        self.budget.store(bytes, Ordering::Relaxed);
    }

    /// What is to be said of a prim whose assets take so many bytes while they are built.
    pub(crate) fn note_of(&self, bytes: u64) -> Option<String> {
        let budget = self.budget.load(Ordering::Relaxed);
        let mib = |bytes: u64| bytes.div_ceil(1 << 20);
        (bytes > budget).then(|| {
            let (needs, budget) = (mib(bytes), mib(budget));
            format!(
                "needs {needs} MiB of host memory to be built, more than the {budget} MiB of oocpt:hostMemoryBudget"
            )
        })
    }

    /// Bytes held.
    #[must_use]
    pub fn held(&self) -> u64 {
        self.held.load(Ordering::Relaxed)
    }

    /// Takes memory if it is below the limit then.
    pub(crate) fn try_hold(self: &Arc<Self>, bytes: u64) -> Option<HeldMemory> {
        let limit = self.limit.load(Ordering::Relaxed);
        let more = |held: u64| held.checked_add(bytes).filter(|held| *held <= limit);
        self.held.fetch_update(Ordering::Relaxed, Ordering::Relaxed, more).ok()?;
        Some(HeldMemory { memory: self.clone(), bytes })
    }

    /// Takes memory whatever the limit is.
    pub(crate) fn hold(self: &Arc<Self>, bytes: u64) -> HeldMemory {
        self.held.fetch_add(bytes, Ordering::Relaxed);
        HeldMemory { memory: self.clone(), bytes }
    }
}

/// Host memory that is taken until this is dropped.
#[derive(Debug)]
pub(crate) struct HeldMemory {
    memory: Arc<HostMemory>,
    bytes: u64,
}

impl Drop for HeldMemory {
    fn drop(&mut self) {
        self.memory.held.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prim_above_the_host_budget_gives_a_note() {
        let memory = HostMemory::default();
        assert_eq!(memory.note_of(u64::MAX), None, "no budget");
        memory.set_budget(8 << 20);
        assert_eq!(memory.note_of(8 << 20), None, "all of it");
        let note = memory.note_of((8 << 20) + 1).expect("more");
        assert!(note.contains("9 MiB") && note.contains("8 MiB of oocpt:hostMemoryBudget"), "{note}");
    }

    #[test]
    fn host_memory_is_held_up_to_the_limit_and_released() {
        let memory = Arc::new(HostMemory::default());
        memory.set_limit(100);
        let first = memory.try_hold(60).expect("there is room");
        assert!(memory.try_hold(41).is_none(), "no room");
        assert!(memory.try_hold(u64::MAX).is_none(), "no overflow");
        let rest = memory.try_hold(40).expect("just fits");
        let beyond = memory.hold(7);
        assert_eq!(memory.held(), 107);
        drop((first, beyond));
        assert_eq!(memory.held(), 40);
        drop(rest);
        assert_eq!(memory.held(), 0);
    }
}
