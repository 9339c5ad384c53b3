// SPDX-License-Identifier: Apache-2.0
//! Edits of a scene that wait for the commit thread, in order. Pure.

use oocpt_core::scene::SceneDb;
use rustc_hash::FxHashSet;
use std::fmt;
use std::sync::Arc;

/// The work of an edit.
type ApplyEdit = Box<dyn FnOnce(&mut SceneDb) + Send>;

/// One edit of a scene. What it takes, such as comparing arrays, is done by the commit thread.
pub enum SceneEdit {
    /// Removes the prims at a path and below it.
    Remove(String),
    /// Adds the prim at a path or replaces it, and does nothing else. Is left out if a later edit of the same path
    /// comes before the next commit.
    Upsert {
        /// Path of the prim.
        path: String,
        /// Adds it.
        apply: ApplyEdit,
    },
    /// Something that is not about a single prim.
    Other(ApplyEdit),
}

impl SceneEdit {
    /// The edit that adds or replaces the prim at `path`.
    pub fn upsert(path: impl Into<String>, apply: impl FnOnce(&mut SceneDb) + Send + 'static) -> Self {
        Self::Upsert { path: path.into(), apply: Box::new(apply) }
    }

    /// An edit that is not about a single prim.
    pub fn other(apply: impl FnOnce(&mut SceneDb) + Send + 'static) -> Self {
        Self::Other(Box::new(apply))
    }

    /// Edits the scene.
    pub(crate) fn apply(self, scene: &mut SceneDb) {
        match self {
            Self::Remove(path) => scene.remove(&path),
            Self::Upsert { apply, .. } | Self::Other(apply) => apply(scene),
        }
    }

    /// The prim that is edited, for messages.
    pub(crate) fn path(&self) -> &str {
        match self {
            Self::Remove(path) | Self::Upsert { path, .. } => path,
            Self::Other(_) => "/",
        }
    }
}

impl fmt::Debug for SceneEdit {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self {
            Self::Remove(_) => "Remove",
            Self::Upsert { .. } => "Upsert",
            Self::Other(_) => "Other",
        };
        write!(formatter, "{kind}({})", self.path())
    }
}

/// Edits that wait. They hold the arrays that the host has lent for them, which no budget counts before they are
/// applied; so of each prim at most the last edit waits, however often a host edits it during a long commit.
#[derive(Debug, Default)]
pub(crate) struct EditQueue(Vec<SceneEdit>);

impl EditQueue {
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether they replace or remove one of these prims.
    pub(crate) fn make_moot(&self, prims: &[Arc<str>]) -> bool {
        let moot = MootPaths::of(&self.0);
        prims.iter().any(|path| moot.replaced.contains(&**path) || moot.is_removed(path))
    }

    /// Adds later edits. Those before which they make moot are dropped.
    pub(crate) fn then(&mut self, later: Self) {
        if !self.0.is_empty() {
            let moot = MootPaths::of(&later.0);
            self.0.retain(|edit| !moot.has(edit));
        }
        self.0.extend(later.0);
    }
}

impl From<Vec<SceneEdit>> for EditQueue {
    fn from(edits: Vec<SceneEdit>) -> Self {
        Self(edits)
    }
}

impl IntoIterator for EditQueue {
    type Item = SceneEdit;
    type IntoIter = std::vec::IntoIter<SceneEdit>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

/// Where earlier edits do not count.
struct MootPaths<'a> {
    replaced: FxHashSet<&'a str>,
    /// Without the slash at the end; with all that is below them.
    removed: FxHashSet<&'a str>,
}

impl<'a> MootPaths<'a> {
    fn of(later: &'a [SceneEdit]) -> Self {
        let mut moot = Self { replaced: FxHashSet::default(), removed: FxHashSet::default() };
        for edit in later {
            match edit {
                SceneEdit::Remove(path) => _ = moot.removed.insert(path.trim_end_matches('/')),
                SceneEdit::Upsert { path, .. } => _ = moot.replaced.insert(path),
                SceneEdit::Other(_) => {}
            }
        }
        moot
    }

    fn has(&self, edit: &SceneEdit) -> bool {
        match edit {
            SceneEdit::Remove(path) => self.is_removed(path),
            SceneEdit::Upsert { path, .. } => self.replaced.contains(&**path) || self.is_removed(path),
            SceneEdit::Other(_) => false,
        }
    }

    fn is_removed(&self, path: &str) -> bool {
        let path = path.trim_end_matches('/');
        let parents = path.match_indices('/').map(|(at, _)| &path[..at]);
        !self.removed.is_empty() && parents.chain([path]).any(|parent| self.removed.contains(parent))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_core::scene::{LightDesc, PrimDesc};

    fn light(path: &str, intensity: f32) -> SceneEdit {
        let prim = PrimDesc { path: path.into(), ..PrimDesc::default() };
        let light = LightDesc { prim, intensity, ..LightDesc::default() };
        SceneEdit::upsert(path, move |scene| scene.upsert_light(light))
    }

    fn remove(path: &str) -> SceneEdit {
        SceneEdit::Remove(path.into())
    }

    fn waiting(batches: Vec<Vec<SceneEdit>>) -> EditQueue {
        let mut queue = EditQueue::default();
        batches.into_iter().for_each(|batch| queue.then(batch.into()));
        queue
    }

    fn names(queue: &EditQueue) -> Vec<String> {
        queue.0.iter().map(|edit| format!("{edit:?}")).collect()
    }

    #[test]
    fn of_each_prim_the_last_edit_waits() {
        let frames = (0..1000_u16).map(|frame| vec![light("/a", frame.into()), light("/b", 1.0)]);
        let queue = waiting(frames.collect());
        assert_eq!(names(&queue), ["Upsert(/a)", "Upsert(/b)"], "one edit of each");
    }

    #[test]
    fn what_is_removed_does_not_wait_and_its_neighbours_do() {
        let before = || vec![light("/a/x", 1.0), remove("/a/y"), light("/ab", 1.0), SceneEdit::other(|_| {})];
        let queue = waiting(vec![before(), vec![remove("/a"), light("/a/z", 1.0)]]);
        assert_eq!(names(&queue), ["Upsert(/ab)", "Other(/)", "Remove(/a)", "Upsert(/a/z)"], "with all below");
        let queue = waiting(vec![before(), vec![remove("/")]]);
        assert_eq!(names(&queue), ["Other(/)", "Remove(/)"], "the whole scene");
    }

    #[test]
    fn prims_are_moot_that_are_edited_or_removed_with_what_is_above_them() {
        let queue = waiting(vec![vec![light("/a/x", 1.0), remove("/b"), SceneEdit::other(|_| {})]]);
        let paths = |paths: &[&str]| paths.iter().map(|path| Arc::from(*path)).collect::<Vec<Arc<str>>>();
        let moot = |of: &[&str]| queue.make_moot(&paths(of));
        assert!(moot(&["/c", "/a/x"]) && moot(&["/b/y/z"]), "edited, and below what is removed");
        assert!(!moot(&["/a", "/a/x/y", "/ba"]) && !moot(&[]), "none of these");
    }

    /// A pseudo-random number below `below`.
    fn next(random: &mut u64, below: u64) -> u64 {
        *random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*random >> 33) % below
    }

    #[test]
    fn what_waited_together_edits_as_if_it_had_not_waited() {
        let mut random = 7;
        for _ in 0..300 {
            let edit = |random: &mut u64| {
                let path =
                    ["/a", "/a/b", "/a/b/c", "/ab", "/d", "/d/b"][usize::try_from(next(random, 6)).expect("few")];
                if next(random, 3) == 0 { (path, None) } else { (path, Some(1.0 + next(random, 50) as f32)) }
            };
            let batches = (0..4).map(|_| (0..next(&mut random, 5)).map(|_| edit(&mut random)).collect());
            let batches: Vec<Vec<(&str, Option<f32>)>> = batches.collect();
            let edits = |batch: &[(&str, Option<f32>)]| -> Vec<SceneEdit> {
                batch.iter().map(|(path, of)| of.map_or_else(|| remove(path), |of| light(path, of))).collect()
            };
            let [mut alone, mut together] = [SceneDb::new(), SceneDb::new()];
            batches.iter().flat_map(|batch| edits(batch)).for_each(|edit| edit.apply(&mut alone));
            let queue = waiting(batches.iter().map(|batch| edits(batch)).collect());
            queue.into_iter().for_each(|edit| edit.apply(&mut together));
            assert_eq!(alone.commit().snapshot.lights, together.commit().snapshot.lights, "{batches:?}");
        }
    }
}
