// SPDX-License-Identifier: Apache-2.0
//! Members of the records of a chunk, as places in the list of its assembly: a chunk that an edit does not touch takes
//! over the assembly of after the edit by one pointer.

use std::sync::Arc;

use crate::instancing::assembly::{Assembly, AssemblyMember};

/// The members of a chunk, in the order of [`super::chunk::Chunk::ids`].
#[derive(Clone, Debug)]
pub(crate) struct ChunkMembers {
    assembly: Arc<Assembly>,
    /// Number of each in the assembly.
    numbers: Arc<[u32]>,
}

impl ChunkMembers {
    /// The members of an assembly with these numbers.
    pub(crate) fn new(assembly: &Arc<Assembly>, numbers: Arc<[u32]>) -> Self {
        Self { assembly: Arc::clone(assembly), numbers }
    }

    /// The same numbers in another assembly.
    pub(crate) fn in_assembly(&self, assembly: &Arc<Assembly>) -> Self {
        Self::new(assembly, Arc::clone(&self.numbers))
    }

    /// Whether they are in this assembly.
    pub(crate) fn is_in(&self, assembly: &Arc<Assembly>) -> bool {
        Arc::ptr_eq(&self.assembly, assembly)
    }

    /// Member `which` of the chunk.
    #[inline]
    pub(crate) fn get(&self, which: u32) -> Option<&AssemblyMember> {
        self.assembly.members().get(*self.numbers.get(which as usize)? as usize)
    }

    /// All, in order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &AssemblyMember> {
        self.numbers.iter().filter_map(|number| self.assembly.members().get(*number as usize))
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.numbers.len()
    }
}
