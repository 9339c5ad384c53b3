// SPDX-License-Identifier: Apache-2.0
//! The compiled pipelines of a device: those in use, and the ones used last beside them. A session that is edited for
//! hours goes through hundreds of specialisations, of which each takes megabytes of the driver.

use rustc_hash::FxHashMap;
use std::hash::Hash;
use std::sync::Arc;

/// Pipelines that are kept, unless more are in use: about ten specialisations of all passes.
const MOST: usize = 256;

/// One of them.
#[derive(Debug)]
struct CompiledPipeline<T> {
    pipeline: Arc<T>,
    /// What compiling it took.
    secs: f64,
    /// Whether a submission had it.
    is_translated: bool,
    /// When it was asked for last.
    asked: u64,
}

/// See the module. `T` is a pipeline.
#[derive(Debug)]
pub(crate) struct CompiledPipelines<K, T> {
    entries: FxHashMap<K, CompiledPipeline<T>>,
    clock: u64,
    most: usize,
}

impl<K, T> Default for CompiledPipelines<K, T> {
    fn default() -> Self {
        Self { entries: FxHashMap::default(), clock: 0, most: MOST }
    }
}

impl<K: Clone + Eq + Hash, T> CompiledPipelines<K, T> {
    /// The pipeline of that key.
    pub(crate) fn get(&mut self, key: &K) -> Option<Arc<T>> {
        self.clock += 1;
        let entry = self.entries.get_mut(key)?;
        entry.asked = self.clock;
        Some(Arc::clone(&entry.pipeline))
    }

    /// Adds one that took `secs` to compile, unless another thread was faster; gives the one that is kept. Where there
    /// are too many, those go that nobody holds and that were asked for longest ago.
    pub(crate) fn insert(&mut self, key: &K, pipeline: T, secs: f64) -> Arc<T> {
        if let Some(made) = self.get(key) {
            return made;
        }
        let pipeline = Arc::new(pipeline);
        let entry = CompiledPipeline { pipeline: Arc::clone(&pipeline), secs, is_translated: false, asked: self.clock };
        self.entries.insert(key.clone(), entry);
        while self.entries.len() > self.most {
            let idle = self.entries.iter().filter(|(_, entry)| Arc::strong_count(&entry.pipeline) == 1);
            let Some(oldest) = idle.min_by_key(|(_, entry)| entry.asked).map(|(key, _)| key.clone()) else { break };
            self.entries.remove(&oldest);
        }
        pipeline
    }

    fn entry_of(&mut self, pipeline: &Arc<T>) -> Option<&mut CompiledPipeline<T>> {
        self.entries.values_mut().find(|entry| Arc::ptr_eq(&entry.pipeline, pipeline))
    }

    /// Whether a submission had the pipeline.
    pub(crate) fn is_translated(&mut self, pipeline: &Arc<T>) -> bool {
        self.entry_of(pipeline).is_some_and(|entry| entry.is_translated)
    }

    /// A submission had it, which took the driver so long.
    pub(crate) fn translated(&mut self, pipeline: &Arc<T>, secs: f64) {
        if let Some(entry) = self.entry_of(pipeline) {
            entry.secs += secs;
            entry.is_translated = true;
        }
    }

    /// Seconds that compiling it took, translation included.
    pub(crate) fn secs(&mut self, pipeline: &Arc<T>) -> f64 {
        self.entry_of(pipeline).map_or(0.0, |entry| entry.secs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pipelines_in_use_stay_and_the_oldest_idle_one_goes() {
        let mut compiled = CompiledPipelines { most: 3, ..CompiledPipelines::default() };
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
        assert!(!compiled.is_translated(&first));
        compiled.translated(&first, 0.5);
        assert!(compiled.is_translated(&first));
        assert_eq!(compiled.secs(&first), 2.5);
        assert_eq!(compiled.secs(&Arc::new("other")), 0.0, "of another device");
    }
}
