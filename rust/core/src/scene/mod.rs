// SPDX-License-Identifier: Apache-2.0
//! The scene database: edits in, one commit, an immutable snapshot out.
//!
//! One thread owns a [`SceneDb`]; the snapshots it gives may be read anywhere.

mod assembly;
pub mod desc;
mod light;
mod report;
pub mod snapshot;

use std::sync::Arc;

pub use desc::{
    InstancedBy, InstancerDesc, InstancerPrototype, Interpolation, LightDesc, LightKind, MeshDesc, PrimDesc, Primvar,
    Subdivision,
};
pub use snapshot::{
    Aabb, Assembly, Attribute, AttributeRate, Bvh2, BvhError, BvhNode, DroppedData, InstanceFlags, InstanceRecord,
    Light, MeshAsset, SceneCounts, SceneFeatures, SceneWarning, Snapshot, SnapshotError, Target, Triangle,
};

/// The result of [`SceneDb::commit`].
#[derive(Clone, Debug)]
pub struct Commit {
    /// The scene as of now; the same `Arc` as before when nothing changed.
    pub snapshot: Arc<Snapshot>,
    /// Warnings that were not given before, in path order.
    pub warnings: Vec<SceneWarning>,
    /// True when the snapshot differs from the one of the commit before.
    pub changed: bool,
}

/// The scene under edit.
#[derive(Debug, Default)]
pub struct SceneDb {}

impl SceneDb {
    /// An empty scene; purposes "default" and "render" are shown.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a mesh or replaces the one of the same path.
    pub fn upsert_mesh(&mut self, desc: MeshDesc) {
        drop(desc);
    }

    /// Adds an instancer or replaces the one of the same path.
    pub fn upsert_instancer(&mut self, desc: InstancerDesc) {
        drop(desc);
    }

    /// Adds a light or replaces the one of the same path.
    pub fn upsert_light(&mut self, desc: LightDesc) {
        drop(desc);
    }

    /// Removes the prim at `path` and all below it.
    pub fn remove(&mut self, path: &str) {
        let _ = path;
    }

    /// Shows meshes of these purposes only; an empty list shows all.
    pub fn set_purposes(&mut self, purposes: &[&str]) {
        let _ = purposes;
    }

    /// Works out the edits since the last commit. Builds what is new on the rayon pool; everything else is shared with
    /// the snapshot before.
    pub fn commit(&mut self) -> Commit {
        todo!()
    }
}
