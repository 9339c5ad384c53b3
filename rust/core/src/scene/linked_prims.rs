// SPDX-License-Identifier: Apache-2.0
//! Finds the prims that are seen in several sets of collections of light linking, and numbers them. Pure.

use std::collections::BTreeMap;
use std::sync::Arc;

use oocpt_abi::MAX_PRIM_ID;
use rustc_hash::FxHashMap;

use super::entries::MeshEntry;
use super::linking::LinkCategories;

/// Largest number of prims that are seen in sets of collections other than their own.
pub(crate) const MAX_LINKED_PRIMS: usize = 1 << 20;

/// A mesh that is seen in collections besides its own, under a prim id that no prim has.
#[derive(Clone, Debug)]
pub(crate) struct LinkedPrim {
    pub(crate) path: Arc<str>,
    pub(crate) prim_id: i32,
    pub(crate) categories: LinkCategories,
}

/// The prims of a plan that are seen in collections besides their own, numbered in the order of the plan.
#[derive(Debug, Default)]
pub(crate) struct LinkedPrims {
    known: FxHashMap<(Arc<str>, LinkCategories), i32>,
    list: Vec<LinkedPrim>,
    /// First of their prim ids, once one is needed.
    first: Option<usize>,
}

impl LinkedPrims {
    /// The prim id of a mesh below instances that are in `categories`; `None`: there are too many of them.
    pub(crate) fn prim_id(
        &mut self,
        meshes: &BTreeMap<Arc<str>, MeshEntry>,
        entry: &MeshEntry,
        categories: &LinkCategories,
    ) -> Option<i32> {
        if categories.iter().all(|name| entry.desc.categories.contains(name)) {
            return Some(entry.desc.prim_id);
        }
        let key = (Arc::clone(&entry.desc.prim.path), Arc::clone(categories));
        if let Some(known) = self.known.get(&key) {
            return Some(*known);
        }
        let first = *self.first.get_or_insert_with(|| {
            let ids = meshes.values().filter_map(|mesh| usize::try_from(mesh.desc.prim_id).ok());
            // A few more prims do not change the numbers.
            ids.filter(|&id| id < MAX_PRIM_ID as usize).max().map_or(1, |last| (last + 1).next_power_of_two())
        });
        let number =
            Some(first + self.list.len()).filter(|&id| id < MAX_PRIM_ID as usize && self.list.len() < MAX_LINKED_PRIMS);
        let prim_id = i32::try_from(number?).ok()?;
        self.list.push(LinkedPrim { path: Arc::clone(&key.0), prim_id, categories: Arc::clone(categories) });
        self.known.insert(key, prim_id);
        Some(prim_id)
    }

    pub(crate) fn list(&self) -> &[LinkedPrim] {
        &self.list
    }
}
