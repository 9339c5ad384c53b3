// SPDX-License-Identifier: Apache-2.0
//! The meshes of a snapshot: summaries in memory, assets in memory as far as it goes, else in files.

use std::ops::Deref;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_128;

use super::build::{BuiltMesh, build_mesh_with};
use super::demand::{Demand, Displacements};
use super::dicing::Dicing;
use super::payload::{self, parts, payload_bytes, ptex_words};
use super::store::{HeldMemory, HostMemory, MeshFiles, Payload, PayloadError};
use super::summary::MeshSummary;
use super::{MeshAsset, WantedPrimvar};
use crate::again::again;
use crate::desc::{DroppedData, MeshDesc};
use crate::texture::{HeightFiles, Heights};

/// Raised whenever a description is built to other bits than before, or they are stored otherwise: entries of other
/// versions are not found.
const VERSION: u32 = 4;

/// What tests have a payload say that is not to be built again either.
#[cfg(feature = "faults")]
pub const LOST_FOR_GOOD: &str = "lost for good";

/// Pauses before a read that failed is tried again.
const PAUSES: [Duration; 3] = [Duration::from_millis(100), Duration::from_millis(400), Duration::from_millis(1600)];

/// Why the asset of a mesh cannot be had.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{path}: the mesh cannot be read back ({cause}), nor built again")]
pub struct StoredError {
    path: Arc<str>,
    cause: PayloadError,
}

/// What a mesh is built from.
#[derive(Debug)]
pub(crate) struct Recipe {
    pub(crate) desc: MeshDesc,
    pub(crate) wanted: Vec<WantedPrimvar>,
    pub(crate) dicing: Dicing,
    pub(crate) displacements: Displacements,
    pub(crate) height_files: Option<Arc<dyn HeightFiles>>,
    /// [`super::mesh_key_with`] of all that.
    pub(crate) key: u128,
    /// A larger mesh is split.
    pub(crate) limit_bytes: u64,
    /// Into clusters of so many bytes.
    pub(crate) cluster_bytes: u64,
}

impl Recipe {
    fn demand(&self) -> Demand<'_> {
        let Self { wanted, dicing, displacements, .. } = self;
        Demand { wanted, dicing: Some(dicing), displacements, heights: None }
    }

    fn build(&self, heights: &Heights) -> BuiltMesh {
        let demand = Demand { heights: Some(heights), ..self.demand() };
        build_mesh_with(&self.desc, &demand, self.key, self.limit_bytes, self.cluster_bytes)
    }

    /// What tells its entry in files; none where it depends on more than the description: the textures of displacements
    /// may have changed when another process reads it.
    fn entry_key(&self) -> Option<u128> {
        let words = [VERSION.into(), self.key, self.limit_bytes.into(), self.cluster_bytes.into()];
        (!self.demand().displaces(&self.desc)).then(|| xxh3_128(bytemuck::cast_slice::<u128, u8>(&words)))
    }
}

/// Where assets are put.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shelf {
    pub(crate) memory: Arc<HostMemory>,
    pub(crate) files: Option<Arc<dyn MeshFiles>>,
    /// The last read failed, all tries of it.
    pub(crate) is_unreadable: Arc<AtomicBool>,
}

/// The head of an entry.
#[derive(Debug, Serialize, Deserialize)]
struct Head {
    is_split: bool,
    meshes: Vec<MeshSummary>,
    dropped: DroppedData,
    notes: Vec<String>,
}

/// A [`BuiltMesh`] whose assets are put away.
#[derive(Debug)]
pub(crate) struct KeptMesh {
    pub(crate) asset: Option<Arc<SceneMesh>>,
    pub(crate) clusters: Vec<Arc<SceneMesh>>,
    pub(crate) dropped: DroppedData,
    pub(crate) notes: Vec<String>,
}

impl KeptMesh {
    /// Builds a mesh, unless it is found in files, and puts it away.
    pub(crate) fn make(recipe: Recipe, heights: &Heights, shelf: &Shelf) -> Self {
        let recipe = Arc::new(recipe);
        let lasting = shelf.files.as_ref().filter(|files| files.lasts());
        let key = lasting.and_then(|_| recipe.entry_key());
        if let (Some(files), Some(key)) = (lasting, key)
            && let Some(entry) = files.find(key)
        {
            match Self::found(&entry.head, entry.payloads, &recipe, shelf, key) {
                Some(found) => return found,
                None => files.damaged(Some(key), &PayloadError::Damaged),
            }
        }
        let built = recipe.build(heights);
        let is_split = built.asset.is_none();
        let assets: Vec<&Arc<MeshAsset>> = built.asset.iter().chain(&built.clusters).collect();
        let held: Vec<Option<HeldMemory>> =
            assets.iter().map(|asset| shelf.memory.try_hold(asset.host_bytes())).collect();
        let files = shelf.files.as_ref().filter(|files| files.lasts() || held.iter().any(Option::is_none));
        let stored = files.and_then(|files| {
            let meshes = assets.iter().map(|asset| MeshSummary::of(asset)).collect();
            let head = Head { is_split, meshes, dropped: built.dropped, notes: built.notes.clone() };
            let head = postcard::to_allocvec(&head).ok()?;
            let ptex: Vec<_> = assets.iter().map(|asset| ptex_words(asset)).collect();
            let payloads: Vec<_> = assets.iter().zip(&ptex).map(|(asset, ptex)| parts(asset, ptex)).collect();
            files.add(key, &head, &payloads).filter(|stored| stored.len() == assets.len())
        });
        let all = assets.iter().map(|asset| asset.host_bytes()).sum();
        let mut notes = built.notes.clone();
        notes.extend(shelf.memory.note_of(all));
        let mut stored = stored.into_iter().flatten();
        let mesh = |(number, (asset, held)): (usize, (&Arc<MeshAsset>, Option<HeldMemory>))| {
            let stored = stored.next().map(|payload| Stored::new(payload, number, key, &recipe, shelf));
            let held = match (held, &stored) {
                (None, Some(_)) => None,
                (held, _) => Some(held.unwrap_or_else(|| shelf.memory.hold(asset.host_bytes()))),
            };
            let host = OnceLock::new();
            if let Some(held) = held {
                host.get_or_init(|| (asset.clone(), held));
            }
            Arc::new(SceneMesh { summary: MeshSummary::of(asset), host, stored })
        };
        let meshes = assets.iter().copied().zip(held).enumerate().map(mesh).collect();
        Self::of(is_split, meshes, built.dropped, notes)
    }

    fn of(is_split: bool, mut meshes: Vec<Arc<SceneMesh>>, dropped: DroppedData, notes: Vec<String>) -> Self {
        let asset = if is_split { None } else { meshes.pop() };
        Self { asset, clusters: meshes, dropped, notes }
    }

    /// The entry of a recipe; `None` where it makes no sense.
    fn found(
        head: &[u8],
        payloads: Vec<Arc<dyn Payload>>,
        recipe: &Arc<Recipe>,
        shelf: &Shelf,
        key: u128,
    ) -> Option<Self> {
        let Head { is_split, meshes, dropped, notes } = postcard::from_bytes(head).ok()?;
        let fits = |(mesh, payload): (&MeshSummary, &Arc<dyn Payload>)| payload_bytes(mesh) == Some(payload.size());
        if meshes.len() != payloads.len() || (!is_split && meshes.len() != 1) || !meshes.iter().zip(&payloads).all(fits)
        {
            return None;
        }
        let mesh = |(number, (summary, payload)): (usize, (MeshSummary, Arc<dyn Payload>))| {
            let stored = Some(Stored::new(payload, number, Some(key), recipe, shelf));
            Arc::new(SceneMesh { summary, host: OnceLock::new(), stored })
        };
        let meshes = meshes.into_iter().zip(payloads).enumerate().map(mesh).collect();
        Some(Self::of(is_split, meshes, dropped, notes))
    }
}

/// An asset in a file.
#[derive(Debug)]
struct Stored {
    payload: Arc<dyn Payload>,
    /// Of the assets of its recipe.
    number: usize,
    key: Option<u128>,
    recipe: Arc<Recipe>,
    shelf: Shelf,
}

impl Stored {
    fn new(payload: Arc<dyn Payload>, number: usize, key: Option<u128>, recipe: &Arc<Recipe>, shelf: &Shelf) -> Self {
        Self { payload, number, key, recipe: recipe.clone(), shelf: shelf.clone() }
    }

    /// Builds the asset again, where its file cannot be read any more.
    fn build_again(&self, summary: &MeshSummary, cause: &PayloadError) -> Option<Arc<MeshAsset>> {
        #[cfg(feature = "faults")]
        if *cause == PayloadError::Read(LOST_FOR_GOOD.into()) {
            return None;
        }
        if let Some(files) = &self.shelf.files {
            files.damaged(self.key, cause);
        }
        let built = self.recipe.build(&Heights::new(self.recipe.height_files.clone()));
        let asset = built.asset.iter().chain(&built.clusters).nth(self.number)?;
        (MeshSummary::of(asset) == *summary).then(|| asset.clone())
    }
}

/// A mesh of a snapshot. Derefs to what is known of it without reading a file.
#[derive(Debug)]
pub struct SceneMesh {
    summary: MeshSummary,
    /// The asset, where it is in memory.
    host: OnceLock<(Arc<MeshAsset>, HeldMemory)>,
    /// Where else it is. One of both is there.
    stored: Option<Stored>,
}

impl Deref for SceneMesh {
    type Target = MeshSummary;

    fn deref(&self) -> &MeshSummary {
        &self.summary
    }
}

impl SceneMesh {
    /// The asset. Reads it from a file where it is not in memory; it is not kept then. Any thread. What cannot be read
    /// is tried again within two seconds; where that fails, and where a file is damaged, builds the asset again on the
    /// rayon pool, and keeps it.
    ///
    /// # Errors
    /// The file cannot be read, and the asset not be built again.
    pub fn asset(&self) -> Result<Arc<MeshAsset>, StoredError> {
        if let Some((asset, _)) = self.host.get() {
            return Ok(asset.clone());
        }
        let path = |stored: Option<&Stored>| stored.map_or_else(|| "".into(), |s| s.recipe.desc.prim.path.clone());
        let error = |cause| StoredError { path: path(self.stored.as_ref()), cause };
        let stored = self.stored.as_ref().ok_or_else(|| error(PayloadError::Damaged))?;
        let read = || payload::read(&self.summary, &*stored.payload);
        // A disk may be busy or far away. What has failed in spite of that is not waited for with every mesh.
        let pauses = if stored.shelf.is_unreadable.load(Ordering::Relaxed) { &[][..] } else { &PAUSES };
        let wait = |pause| {
            if let Some(files) = &stored.shelf.files {
                files.wait(pause);
            }
        };
        match again(pauses, |error| matches!(error, PayloadError::Read(_)), wait, read) {
            Ok(asset) => {
                stored.shelf.is_unreadable.store(false, Ordering::Relaxed);
                Ok(Arc::new(asset))
            }
            Err(cause) => {
                if matches!(cause, PayloadError::Read(_)) {
                    stored.shelf.is_unreadable.store(true, Ordering::Relaxed);
                }
                let asset = stored.build_again(&self.summary, &cause).ok_or_else(|| error(cause))?;
                let held = stored.shelf.memory.hold(asset.host_bytes());
                Ok(self.host.get_or_init(|| (asset, held)).0.clone())
            }
        }
    }

    /// Bytes of host memory held.
    #[must_use]
    pub fn host_bytes(&self) -> u64 {
        let asset = self.host.get().map_or(0, |(asset, _)| asset.host_bytes());
        size_of::<Self>() as u64 + asset
    }
}
