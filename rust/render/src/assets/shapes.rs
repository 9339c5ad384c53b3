// SPDX-License-Identifier: Apache-2.0
//! Shapes of the trees over records that move: a chunk of a live scene whose records are elsewhere gets the tree that
//! it had, with other boxes. A shape that has worn out is dropped, so that the next load builds a tree, within a number
//! of records for each snapshot. Any thread.

use crate::job::timings::LevelCounts;
use crate::sync::lock;
use oocpt_core::Aabb;
use oocpt_core::mesh::{LevelShape, LevelTree, build_level};
use rustc_hash::FxHashMap;
use std::sync::{Arc, Mutex};

/// Records whose trees are built for a snapshot in place of worn ones: a few milliseconds of one core.
const REBUILT_RECORDS: usize = 1 << 16;

/// Shapes by the number of the chunk's shape, within a limit of bytes.
#[derive(Debug, Default)]
pub(crate) struct LevelShapes {
    state: Mutex<KeptShapes>,
}

#[derive(Debug, Default)]
struct KeptShapes {
    /// Most bytes.
    most: u64,
    bytes: u64,
    shapes: FxHashMap<u64, Arc<LevelShape>>,
    /// Shapes that have worn out, with their growth and the number of records.
    worn: Vec<(u64, f64, usize)>,
    counts: LevelCounts,
}

impl LevelShapes {
    /// Sets the limit; drops everything if more is held.
    pub(crate) fn limit(&self, most: u64) {
        let mut state = lock(&self.state);
        state.most = most;
        if state.bytes > most {
            (state.bytes, state.shapes, state.worn) = (0, FxHashMap::default(), Vec::new());
        }
    }

    /// Bytes of host memory held.
    pub(crate) fn bytes(&self) -> u64 {
        lock(&self.state).bytes
    }

    /// Trees made since the last call.
    pub(crate) fn take_counts(&self) -> LevelCounts {
        std::mem::take(&mut lock(&self.state).counts)
    }

    /// Forgets a shape, so that the next tree of it is built.
    pub(crate) fn forget(&self, shape: u64) {
        let mut state = lock(&self.state);
        if let Some(shape) = state.shapes.remove(&shape) {
            state.bytes = state.bytes.saturating_sub(shape.host_bytes());
        }
    }

    /// Counts trees over so many records that the device refitted; some have worn out.
    pub(crate) fn note_placed(&self, trees: u64, records: u64, worn: u64) {
        let counts = &mut lock(&self.state).counts;
        counts.refitted += trees;
        counts.refitted_records += records;
        counts.placed_records += records;
        counts.worn += worn;
    }

    /// Begins another snapshot: drops the shapes that `keep` rejects, and those that have worn out most.
    pub(crate) fn begin(&self, keep: impl Fn(u64) -> bool) {
        let mut state = lock(&self.state);
        let mut worn = std::mem::take(&mut state.worn);
        // Threads note them in any order.
        worn.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        let mut room = REBUILT_RECORDS;
        for (at, (shape, _, records)) in worn.into_iter().enumerate() {
            // One at least, however large it is.
            if at > 0 && records > room {
                break;
            }
            room = room.saturating_sub(records);
            state.shapes.remove(&shape);
        }
        state.shapes.retain(|shape, _| keep(*shape));
        state.bytes = state.shapes.values().map(|shape| shape.host_bytes()).sum();
    }

    /// The tree over `boxes`: of the `shape` of records that move, if that is given and known, else built.
    pub(crate) fn tree(&self, shape: Option<u64>, boxes: &[Aabb]) -> LevelTree {
        let known = shape.and_then(|shape| Some((shape, self.get(shape)?)));
        if let Some((shape, refitted)) = known.and_then(|(shape, known)| Some((shape, known.refit(boxes)?))) {
            let mut state = lock(&self.state);
            state.counts.refitted += 1;
            state.counts.refitted_records += boxes.len() as u64;
            if refitted.is_worn() {
                state.counts.worn += 1;
                state.worn.push((shape, refitted.growth, boxes.len()));
            }
            return refitted.tree;
        }
        let tree = build_level(boxes);
        let made = shape.map(|shape| (shape, LevelShape::of(&tree, boxes)));
        let mut state = lock(&self.state);
        state.counts.built += 1;
        if let Some((shape, made)) = made {
            state.keep(shape, made);
        }
        tree
    }

    fn get(&self, shape: u64) -> Option<Arc<LevelShape>> {
        lock(&self.state).shapes.get(&shape).cloned()
    }
}

impl KeptShapes {
    /// Keeps a shape if there is room.
    fn keep(&mut self, shape: u64, made: LevelShape) {
        let bytes = made.host_bytes();
        if self.bytes + bytes <= self.most && !self.shapes.contains_key(&shape) {
            self.bytes += bytes;
            self.shapes.insert(shape, Arc::new(made));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(n: u8, by: f32) -> Vec<Aabb> {
        let place = |k: u8| {
            let at = f32::from(k);
            let min = [at + by * (at * 7.0).sin(), by * (at * 5.0).cos(), 0.0];
            Aabb { min, max: min.map(|v| v + 1.0) }
        };
        (0..n).map(place).collect()
    }

    fn counts(built: u64, refitted: u64, refitted_records: u64, worn: u64) -> LevelCounts {
        LevelCounts { built, refitted, refitted_records, worn, ..LevelCounts::default() }
    }

    #[test]
    fn trees_of_known_shapes_are_refitted_until_they_are_worn() {
        let shapes = LevelShapes::default();
        shapes.limit(1 << 20);
        shapes.tree(None, &boxes(100, 0.0));
        shapes.tree(Some(1), &boxes(100, 0.0));
        assert_eq!(shapes.take_counts(), counts(2, 0, 0, 0), "nothing is known");
        let near = boxes(100, 0.1);
        assert_ne!(shapes.tree(Some(1), &near), shapes.tree(None, &boxes(100, 0.0)), "moved");
        assert_eq!(shapes.take_counts(), counts(1, 1, 100, 0));
        assert_eq!(shapes.tree(Some(1), &boxes(99, 0.0)), build_level(&boxes(99, 0.0)), "other records");
        shapes.take_counts();
        shapes.tree(Some(1), &boxes(100, 90.0));
        assert_eq!(shapes.take_counts(), counts(0, 1, 100, 1), "worn, and used once more");
        shapes.begin(|_| true);
        let far = boxes(100, 91.0);
        assert_eq!(shapes.tree(Some(1), &far), build_level(&far));
        assert_eq!(shapes.take_counts(), counts(1, 0, 0, 0), "built");
        shapes.tree(Some(1), &boxes(100, 91.0));
        assert_eq!(shapes.take_counts(), counts(0, 1, 100, 0), "its shape is another one now");
        shapes.begin(|_| false);
        assert_eq!(shapes.bytes(), 0, "nobody needs it");
    }

    #[test]
    fn shapes_stay_within_their_limit() {
        let shapes = LevelShapes::default();
        shapes.tree(Some(1), &boxes(100, 0.0));
        assert_eq!(shapes.bytes(), 0, "nothing is kept without a limit");
        shapes.limit(1500);
        (1..4).for_each(|shape| _ = shapes.tree(Some(shape), &boxes(100, 0.0)));
        let held = shapes.bytes();
        assert!((1000..=1500).contains(&held), "{held}: two of three");
        (1..4).for_each(|shape| _ = shapes.tree(Some(shape), &boxes(100, 0.1)));
        assert_eq!(shapes.take_counts(), counts(5, 2, 200, 0), "the third is built again");
        shapes.limit(held - 1);
        assert_eq!(shapes.bytes(), 0, "a lower limit holds at once");
    }

    #[test]
    fn as_many_worn_trees_are_built_as_a_snapshot_has_time_for() {
        let shapes = LevelShapes::default();
        shapes.limit(1 << 30);
        let large = |by: f32| -> Vec<Aabb> {
            let all = (0..REBUILT_RECORDS / 2).map(|k| k as f32);
            all.map(|k| Aabb { min: [k, by * (k * 7.0).sin(), 0.0], max: [k + 1.0, by + 1.0, 1.0] }).collect()
        };
        (1..5).for_each(|shape| _ = shapes.tree(Some(shape), &large(0.0)));
        for built in [0, 2, 2, 0] {
            shapes.take_counts();
            shapes.begin(|_| true);
            (1..5).for_each(|shape| _ = shapes.tree(Some(shape), &large(50.0)));
            assert_eq!(shapes.take_counts().built, built, "trees");
        }
    }
}
