// SPDX-License-Identifier: Apache-2.0
//! Which meshes are built at a time where there is a budget of host memory: as many as it has room for, and one where
//! it has none. No thread waits for room: a build that ends starts those that fit then. Runs on the caller's rayon
//! pool.

use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rayon::Scope;

use crate::mesh::{BuildFootprint, BuildGrant, HostMemory};

/// Builds that are to be done.
struct BuildQueue<'q, R, F> {
    memory: &'q Arc<HostMemory>,
    footprints: &'q [BuildFootprint],
    build: F,
    /// Builds and clusters of one that run side by side.
    most: usize,
    state: Mutex<BuildQueueState<R>>,
}

struct BuildQueueState<R> {
    /// What each needs at least, and its number: of equal ones the first comes last, and is taken first.
    waiting: BTreeSet<(u64, Reverse<usize>)>,
    running: usize,
    results: Vec<Option<R>>,
}

/// Runs `build` for each of `footprints`, side by side as far as `memory` has room; gives the results in order.
///
/// The largest that fits comes first. One that fits beside nothing runs alone, with as little as it can.
pub(crate) fn run_within<R: Send>(
    memory: &Arc<HostMemory>,
    footprints: &[BuildFootprint],
    build: impl Fn(usize, BuildGrant) -> R + Sync,
) -> Vec<Option<R>> {
    let waiting = footprints.iter().zip(0..).map(|(footprint, at)| (footprint.least(), Reverse(at))).collect();
    let results = footprints.iter().map(|_| None).collect();
    let state = Mutex::new(BuildQueueState { waiting, running: 0, results });
    let queue = BuildQueue { memory, footprints, build, most: rayon::current_num_threads(), state };
    rayon::scope(|scope| queue.start(scope));
    queue.state.into_inner().unwrap_or_else(PoisonError::into_inner).results
}

impl<R: Send, F: Fn(usize, BuildGrant) -> R + Sync> BuildQueue<'_, R, F> {
    fn state(&self) -> MutexGuard<'_, BuildQueueState<R>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts what fits now.
    fn start<'s>(&'s self, scope: &Scope<'s>) {
        while let Some((at, grant)) = self.next() {
            scope.spawn(move |scope| {
                // What it has reserved is given back with its end.
                let result = (self.build)(at, grant);
                let mut state = self.state();
                state.running -= 1;
                if let Some(slot) = state.results.get_mut(at) {
                    *slot = Some(result);
                }
                drop(state);
                self.start(scope);
            });
        }
    }

    /// The next build, with memory reserved for it.
    fn next(&self) -> Option<(usize, BuildGrant)> {
        let mut state = self.state();
        if state.running >= self.most {
            return None;
        }
        let left = self.memory.left();
        let fits = state.waiting.range(..=(left, Reverse(0))).next_back();
        let (needed, number) = *if state.running == 0 { state.waiting.last() } else { fits }?;
        let Reverse(at) = number;
        let (at_once, bytes) = self.footprints.get(at)?.within(left, self.most);
        let reserved = match self.memory.try_reserve(bytes) {
            Some(reserved) => reserved,
            // Somebody else took it meanwhile: who runs comes back.
            None if state.running > 0 => return None,
            None => self.memory.reserve(bytes),
        };
        state.waiting.remove(&(needed, number));
        state.running += 1;
        Some((at, BuildGrant { reserved: Some(reserved), at_once }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

    /// Runs builds of these sizes within a room; gives their order, the most that ran at once, and the most memory
    /// that was taken.
    fn run(room: u64, sizes: &[u64]) -> (Vec<usize>, usize, u64) {
        let memory = Arc::new(HostMemory::default());
        memory.set_room(room);
        let footprints: Vec<BuildFootprint> = sizes.iter().map(|size| BuildFootprint::plain(*size)).collect();
        let (running, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let order = Mutex::new(Vec::new());
        let build = |at: usize, grant: BuildGrant| {
            assert!(grant.reserved.is_some() && grant.at_once == 1);
            order.lock().expect("not poisoned").push(at);
            most.fetch_max(running.fetch_add(1, Ordering::Relaxed) + 1, Ordering::Relaxed);
            std::thread::yield_now();
            running.fetch_sub(1, Ordering::Relaxed);
            at * 10
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().expect("threads");
        let results = pool.install(|| run_within(&memory, &footprints, build));
        assert_eq!(results, (0..sizes.len()).map(|at| Some(at * 10)).collect::<Vec<_>>(), "in order");
        assert_eq!(memory.left(), room, "all was given back");
        (order.into_inner().expect("not poisoned"), most.into_inner(), memory.most_taken())
    }

    #[test]
    fn builds_never_take_more_than_there_is_unless_one_alone_does() {
        let sizes: Vec<u64> = (0..500).map(|at| 1 + at * 7919 % 97).collect();
        for room in [97, 100, 150, 400] {
            let (_, _, taken) = run(room, &sizes);
            assert!(taken <= room, "{taken} of {room}");
        }
        let (order, most, taken) = run(1, &[5, 9, 7]);
        assert_eq!((order, most, taken), (vec![1, 2, 0], 1, 9), "one after the other, the largest first");
        let (_, most, _) = run(u64::MAX, &sizes);
        assert!(most <= 4, "{most} on four threads");
        assert_eq!(run(10, &[]), (Vec::new(), 0, 0));
        assert_eq!(run(10, &[u64::MAX, 3]).2, u64::MAX, "no overflow");
    }

    #[test]
    fn small_builds_run_beside_a_large_one() {
        let memory = Arc::new(HostMemory::default());
        memory.set_room(100);
        let footprints = [90, 10, 10].map(BuildFootprint::plain);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
        let others = AtomicU64::new(0);
        let build = |at: usize, _grant: BuildGrant| {
            // The large one comes to its end only beside the others.
            while at == 0 && others.load(Ordering::Acquire) < 2 {
                std::thread::yield_now();
            }
            others.fetch_add(u64::from(at > 0), Ordering::Release);
        };
        let results = pool.install(|| run_within(&memory, &footprints, build));
        assert!(results.iter().all(Option::is_some) && memory.most_taken() == 100, "{}", memory.most_taken());
    }
}
