// SPDX-License-Identifier: Apache-2.0
//! Streaming: the items that a ray has come to and could not visit, the first four (traversal/pending.glsl). Pure, any
//! thread.

use oocpt_abi::{NO_MESH, pack_waiting, waiting_count};

const MAX: usize = oocpt_abi::MAX_PENDING as usize;

/// A distance and a number, in the order of a ray.
pub(crate) type EntryKey = (f32, u32);

/// Whether `a` comes before `b`.
pub(crate) fn before(a: EntryKey, b: EntryKey) -> bool {
    a.0 < b.0 || (a.0 == b.0 && a.1 < b.1)
}

/// A chunk instance whose chunk is absent, or, in one that is there, all records of a mesh that the ray enters at one
/// distance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PendingItem {
    /// The chunk instance and where it is entered.
    pub(crate) chunk: EntryKey,
    /// The mesh and where its records are entered.
    pub(crate) record: EntryKey,
}

impl PendingItem {
    /// A whole chunk instance.
    pub(crate) fn of_chunk(chunk: EntryKey) -> Self {
        Self { chunk, record: (0.0, NO_MESH) }
    }

    /// Whether it comes before `other`.
    pub(crate) fn is_before(&self, other: &Self) -> bool {
        if self.chunk == other.chunk { before(self.record, other.record) } else { before(self.chunk, other.chunk) }
    }

    /// Whether nothing of its chunk instance was visited.
    pub(crate) fn is_whole(&self) -> bool {
        self.record.1 == NO_MESH
    }
}

/// The list that a ray came back with.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ListedItems {
    pub(crate) items: [PendingItem; MAX],
    pub(crate) count: usize,
    /// What is behind the last item is to be visited.
    pub(crate) more: bool,
}

impl ListedItems {
    /// The items of a ray of these flags.
    pub(crate) fn new(flags: u32, items: [PendingItem; MAX]) -> Self {
        Self { items, count: (waiting_count(flags) as usize).min(MAX), more: false }
    }

    pub(crate) fn items(&self) -> &[PendingItem] {
        &self.items[..self.count]
    }

    /// Those of a chunk instance.
    pub(crate) fn of_chunk(&self, chunk_instance: u32) -> impl Iterator<Item = &PendingItem> {
        self.items().iter().filter(move |item| item.chunk.1 == chunk_instance)
    }

    /// Whether a chunk instance that is not listed is to be visited.
    pub(crate) fn has_chunk_due(&self, chunk: EntryKey) -> bool {
        !self.more || self.items().last().is_none_or(|last| before(last.chunk, chunk))
    }

    /// Whether records of a chunk instance of which items are listed are still to be visited.
    pub(crate) fn is_due(&self, item: &PendingItem) -> bool {
        let is_behind = self.more && self.items().last().is_some_and(|last| last.is_before(item));
        is_behind || self.items().contains(item)
    }
}

/// See the module.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PendingList {
    items: [PendingItem; MAX],
    count: usize,
    /// There are others, behind all of the list.
    pub(crate) more: bool,
}

impl PendingList {
    pub(crate) fn clear(&mut self) {
        (self.count, self.more) = (0, false);
    }

    /// Those of the list, in order.
    pub(crate) fn items(&self) -> &[PendingItem] {
        &self.items[..self.count]
    }

    /// Notes an item, once; of more than four the first stay.
    pub(crate) fn remember(&mut self, item: PendingItem) {
        let at = self.items().iter().position(|other| !other.is_before(&item)).unwrap_or(self.count);
        if self.items().get(at) == Some(&item) {
            return;
        }
        if self.count < MAX {
            self.count += 1;
        } else {
            self.more = true;
        }
        if at < self.count {
            self.items.copy_within(at..self.count - 1, at + 1);
            self.items[at] = item;
        }
    }

    /// Drops what is entered behind `limit`. Where other items may begin before it, the last one stays: it says which.
    pub(crate) fn forget_behind(&mut self, limit: f32) {
        if self.items().last().is_none_or(|last| last.chunk.0 > limit) {
            self.more = false;
        }
        let mut kept = 0;
        for i in 0..self.count {
            let item = self.items[i];
            let is_behind = item.chunk.0.max(item.record.0) > limit;
            if !is_behind || (self.more && i + 1 == self.count) {
                self.items[kept] = item;
                kept += 1;
            }
        }
        self.count = kept;
    }

    /// The flags of a ray that waits for these.
    pub(crate) fn flags(&self) -> u32 {
        pack_waiting(u32::try_from(self.count).unwrap_or(0), self.more)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(chunk: EntryKey, record: EntryKey) -> PendingItem {
        PendingItem { chunk, record }
    }

    fn pending(items: &[PendingItem]) -> PendingList {
        let mut pending = PendingList::default();
        items.iter().for_each(|item| pending.remember(*item));
        pending
    }

    const FIRST: PendingItem = PendingItem { chunk: (1.0, 7), record: (5.0, 2) };
    const SECOND: PendingItem = PendingItem { chunk: (1.0, 7), record: (6.0, 1) };
    const THIRD: PendingItem = PendingItem { chunk: (2.0, 3), record: (2.0, 9) };
    const FOURTH: PendingItem = PendingItem { chunk: (3.0, 1), record: (0.0, NO_MESH) };
    const FIFTH: PendingItem = PendingItem { chunk: (3.0, 2), record: (3.0, 0) };

    #[test]
    fn the_first_four_items_stay_in_order() {
        let mut some = pending(&[FOURTH, SECOND, SECOND, THIRD]);
        assert_eq!((some.items(), some.more), (&[SECOND, THIRD, FOURTH][..], false), "each once");
        some.remember(FIRST);
        some.remember(FOURTH);
        assert!(!some.more, "the last one again is no other one");
        some.remember(FIFTH);
        assert_eq!((some.items(), some.more), (&[FIRST, SECOND, THIRD, FOURTH][..], true), "a fifth");
        let mut full = pending(&[FIFTH, THIRD, FOURTH, SECOND]);
        assert!(!full.more, "four");
        full.remember(FIRST);
        assert_eq!((full.items(), full.more), (&[FIRST, SECOND, THIRD, FOURTH][..], true), "the last one goes");
    }

    #[test]
    fn items_behind_the_hit_are_dropped_by_their_own_entries() {
        let mut some = pending(&[FIRST, SECOND, THIRD]);
        some.forget_behind(2.5);
        assert_eq!(some.items(), [THIRD], "of an early chunk what is entered late");
        let mut full = pending(&[FIRST, SECOND, THIRD, item((3.0, 1), (9.0, 4)), FIFTH]);
        full.forget_behind(4.0);
        assert_eq!((full.items(), full.more), (&[THIRD, item((3.0, 1), (9.0, 4))][..], true), "the last says which");
        full.forget_behind(2.5);
        assert_eq!((full.items(), full.more), (&[THIRD][..], false), "all others begin behind the hit");
        full.forget_behind(1.0);
        assert_eq!((full.items(), full.flags()), (&[][..], 0), "nothing is left");
    }

    #[test]
    fn a_ray_comes_back_to_what_is_listed_and_to_what_is_behind() {
        let items = [FIRST, THIRD, PendingItem::default(), PendingItem::default()];
        let flags = pack_waiting(2, true);
        let listed = |more: bool| ListedItems { more, ..ListedItems::new(flags, items) };
        for more in [false, true] {
            assert!(listed(more).is_due(&FIRST) && !listed(more).is_due(&SECOND), "the second one is done");
            assert_eq!(listed(more).is_due(&item((2.0, 3), (2.0, 10))), more, "behind the last");
        }
        assert!(
            listed(true).has_chunk_due((2.0, 4)) && !listed(true).has_chunk_due((2.0, 3)),
            "chunks behind the last"
        );
        assert_eq!(listed(true).of_chunk(7).count(), 1, "one of that chunk");
    }
}
