// SPDX-License-Identifier: Apache-2.0
//! Light linking: the categories that lights name. Pure.
//!
//! Hydra computes each collection of a light as a category; a prim lists the categories that it is in
//! ([`SurfaceTables::category_sets`](crate::scene::SurfaceTables::category_sets)). Only those that some light names are
//! numbered.

use std::sync::Arc;

use rustc_hash::FxHashMap;

/// The numbers of the categories that lights name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LinkTable {
    categories: FxHashMap<Arc<str>, u32>,
}

impl LinkTable {
    /// Number of the category that a light names, from 1 on; 0 for none, which is all prims.
    pub fn category(&mut self, name: Option<&Arc<str>>) -> u32 {
        let Some(name) = name.filter(|name| !name.is_empty()) else {
            return 0;
        };
        // A scene has fewer lights than 2^32.
        let next = u32::try_from(self.categories.len() + 1).unwrap_or(u32::MAX);
        *self.categories.entry(name.clone()).or_insert(next)
    }

    /// Returns true if no light names a category.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.categories.is_empty()
    }

    /// Words of 32 bits that a set of categories takes.
    #[must_use]
    pub fn words(&self) -> usize {
        self.categories.len() / 32 + 1
    }

    /// The set of these names: category `c` is bit `c % 32` of word `c / 32`. Names that no light has do not show.
    #[must_use]
    pub fn bits(&self, names: &[Arc<str>]) -> Vec<u32> {
        let mut bits = vec![0_u32; self.words()];
        for number in names.iter().filter_map(|name| self.categories.get(name)) {
            if let Some(word) = bits.get_mut(*number as usize / 32) {
                *word |= 1 << (number % 32);
            }
        }
        bits
    }
}
