// SPDX-License-Identifier: Apache-2.0
//! An LRU cache of the compute pipelines of a device. A session that is edited for hours goes through hundreds of
//! specialisations, and each pipeline takes megabytes of the driver. Pipelines in use are never evicted.

use rustc_hash::FxHashMap;
use std::hash::Hash;
use std::sync::Arc;

/// Pipelines that the cache keeps: about ten specialisations of all passes.
const CAPACITY: usize = 256;

/// A cached pipeline.
#[derive(Debug)]
struct CompiledPipeline<T> {
    pipeline: Arc<T>,
    /// Seconds of `vkCreateComputePipelines` and of the warm-up.
    compile_secs: f64,
    /// A submission has used it: a software driver generates its machine code then.
    is_warm: bool,
    /// Value of the cache's clock at the last lookup.
    last_used: u64,
}

/// LRU cache of pipelines `T` by specialisation `K`.
#[derive(Debug)]
pub(crate) struct CompiledPipelines<K, T> {
    entries: FxHashMap<K, CompiledPipeline<T>>,
    /// Lookups so far.
    clock: u64,
    capacity: usize,
}

impl<K, T> Default for CompiledPipelines<K, T> {
    fn default() -> Self {
        Self { entries: FxHashMap::default(), clock: 0, capacity: CAPACITY }
    }
}

impl<K: Clone + Eq + Hash, T> CompiledPipelines<K, T> {
    /// The pipeline of a key, which becomes the most recently used one.
    pub(crate) fn get(&mut self, key: &K) -> Option<Arc<T>> {
        self.clock += 1;
        let entry = self.entries.get_mut(key)?;
        entry.last_used = self.clock;
        Some(Arc::clone(&entry.pipeline))
    }

    /// Adds a pipeline that took `compile_secs`, unless another thread has added one for the key meanwhile, and returns
    /// the cached one. Beyond the capacity it evicts the least recently used pipelines that nobody else holds.
    pub(crate) fn insert(&mut self, key: &K, pipeline: T, compile_secs: f64) -> Arc<T> {
        if let Some(cached) = self.get(key) {
            return cached;
        }
        let pipeline = Arc::new(pipeline);
        let last_used = self.clock;
        let entry = CompiledPipeline { pipeline: Arc::clone(&pipeline), compile_secs, is_warm: false, last_used };
        self.entries.insert(key.clone(), entry);
        while self.entries.len() > self.capacity {
            let idle = self.entries.iter().filter(|(_, entry)| Arc::strong_count(&entry.pipeline) == 1);
            let Some(oldest) = idle.min_by_key(|(_, entry)| entry.last_used).map(|(key, _)| key.clone()) else { break };
            self.entries.remove(&oldest);
        }
        pipeline
    }

    fn entry_of(&mut self, pipeline: &Arc<T>) -> Option<&mut CompiledPipeline<T>> {
        self.entries.values_mut().find(|entry| Arc::ptr_eq(&entry.pipeline, pipeline))
    }

    /// True if a submission has used the pipeline.
    pub(crate) fn is_warm(&mut self, pipeline: &Arc<T>) -> bool {
        self.entry_of(pipeline).is_some_and(|entry| entry.is_warm)
    }

    /// Notes that a submission has used the pipeline and took so long.
    pub(crate) fn mark_warm(&mut self, pipeline: &Arc<T>, secs: f64) {
        if let Some(entry) = self.entry_of(pipeline) {
            entry.compile_secs += secs;
            entry.is_warm = true;
        }
    }

    /// Seconds that compiling the pipeline took, its warm-up included; 0 if it is not cached.
    pub(crate) fn compile_secs(&mut self, pipeline: &Arc<T>) -> f64 {
        self.entry_of(pipeline).map_or(0.0, |entry| entry.compile_secs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pipelines_in_use_stay_and_the_oldest_idle_one_goes() {
        let mut compiled = CompiledPipelines { capacity: 3, ..CompiledPipelines::default() };
        let held = compiled.insert(&"held", 0, 1.0);
        for name in ["a", "b", "c"] {
            compiled.insert(&name, 1, 1.0);
        }
        assert!(compiled.get(&"a").is_none(), "asked for longest ago");
        assert!(compiled.get(&"b").is_some() && compiled.get(&"held").is_some(), "b is asked for again");
        compiled.insert(&"d", 1, 1.0);
        assert!(compiled.get(&"c").is_none() && compiled.get(&"b").is_some(), "c is the oldest now");
        let others: Vec<_> = ["e", "f", "g"].iter().map(|name| compiled.insert(name, 1, 1.0)).collect();
        assert_eq!(compiled.entries.len(), 4, "all in use stay, whatever the limit");
        drop((held, others));
    }

    #[test]
    fn a_pipeline_made_twice_is_kept_once() {
        let mut compiled = CompiledPipelines::default();
        let first = compiled.insert(&1, "first", 2.0);
        assert!(Arc::ptr_eq(&first, &compiled.insert(&1, "second", 5.0)), "the first one stays");
        assert!(!compiled.is_warm(&first));
        compiled.mark_warm(&first, 0.5);
        assert!(compiled.is_warm(&first));
        assert_eq!(compiled.compile_secs(&first), 2.5);
        assert_eq!(compiled.compile_secs(&Arc::new("other")), 0.0, "of another device");
    }
}
