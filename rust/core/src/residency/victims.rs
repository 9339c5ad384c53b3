// SPDX-License-Identifier: Apache-2.0
//! The resident units of one step in the order in which they would go.

use super::UnitId;
use super::policy::{LoadPolicy, PolicyView};
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// A value with its unit, ordered by value, then id.
#[derive(Clone, Copy, Debug)]
pub(super) struct EvictionVictim {
    pub(super) loss: f64,
    pub(super) unit: UnitId,
}

impl Ord for EvictionVictim {
    fn cmp(&self, other: &Self) -> Ordering {
        self.loss.total_cmp(&other.loss).then(self.unit.cmp(&other.unit))
    }
}

impl PartialOrd for EvictionVictim {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for EvictionVictim {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for EvictionVictim {}

/// Resident units that may go now, least loss first. Losses are those of the moment they were listed.
#[derive(Debug, Default)]
pub(super) struct EvictionHeap {
    heap: BinaryHeap<Reverse<EvictionVictim>>,
    /// Resident when the step began and not looked at yet; from the end.
    rest: Vec<UnitId>,
}

impl EvictionHeap {
    pub(super) fn new(rest: Vec<UnitId>) -> Self {
        Self { heap: BinaryHeap::new(), rest }
    }

    /// Looks at up to `limit` more units. `false` when there are none.
    pub(super) fn list(
        &mut self,
        policy: &dyn LoadPolicy,
        view: &PolicyView<'_>,
        limit: usize,
        may_go: impl Fn(&UnitId) -> bool,
    ) -> bool {
        let more = !self.rest.is_empty();
        let some = self.rest.drain(self.rest.len().saturating_sub(limit)..).filter(may_go);
        self.heap.extend(some.map(|unit| Reverse(EvictionVictim { loss: policy.loss(view, unit), unit })));
        more
    }

    pub(super) fn first(&self) -> Option<EvictionVictim> {
        self.heap.peek().map(|first| first.0)
    }

    pub(super) fn pop(&mut self) -> Option<EvictionVictim> {
        self.heap.pop().map(|first| first.0)
    }

    pub(super) fn put_back(&mut self, victim: EvictionVictim) {
        self.heap.push(Reverse(victim));
    }
}
