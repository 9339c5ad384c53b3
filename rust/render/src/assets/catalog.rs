// SPDX-License-Identifier: Apache-2.0
//! The device data of a snapshot: assets (meshes, assemblies that are referenced whole, chunks' own blocks, tiles of
//! textures) and the units that the planner loads and evicts: chunks, each with the assemblies that it needs, then
//! meshes, then tiles. A ray that reaches a mesh needs its chunk at the same time: chunks are the *bases* of the
//! planner's catalog.
//!
//! Asset ids: meshes first (the mesh index), then assemblies (index + meshes), then chunks (index + meshes +
//! assemblies), then tiles (their number + all those). Unit ids: chunks first, then meshes, then tiles. Pure; any
//! thread.

use super::source::{AssetKey, AssetSource};
use crate::error::RenderError;
use crate::textures::{OpacityMasks, TextureSet};
use oocpt_abi::{LevelNode, MAX_LEVELS};
use oocpt_core::inventory::RenderInventory;
use oocpt_core::mesh::level_nodes;
use oocpt_core::partition::{Chunk, PartitionedWorld};
use oocpt_core::residency::{AssetId, UnitCatalog, UnitId};
use oocpt_core::scene::{InstanceTarget, Snapshot};
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Most meshes, assemblies or chunk instances: their indices share 32 bits with a flag.
const MAX_TARGETS: u64 = 1 << 31;

/// The assets of a snapshot.
#[derive(Debug)]
pub(crate) struct SceneAssets {
    pub(crate) snapshot: Arc<Snapshot>,
    pub(crate) textures: Arc<TextureSet>,
    /// The opacity masks of the cutouts.
    pub(crate) masks: Arc<OpacityMasks>,
    /// Sources by asset id, without those of tiles: there may be millions.
    sources: Vec<AssetSource>,
    /// Bytes of every asset and the assets of every unit.
    pub(crate) catalog: Arc<UnitCatalog>,
    /// The assets that some chunk or ray needs: all but tiles.
    pub(crate) needed: Vec<AssetId>,
    /// Bytes of the needed assets and of all tiles.
    pub(crate) bytes: u64,
    /// Bytes of tiles among these.
    pub(crate) tile_bytes: u64,
    /// Bytes of the largest asset that is not a tile.
    pub(crate) largest_bytes: u64,
    /// The tree over chunk instances.
    pub(crate) top: TopLevel,
    /// True if some chunk's records move.
    pub(super) has_held: bool,
    /// `bytes` by content.
    sections: [u64; AssetSource::SECTIONS.len()],
    meshes: usize,
    assemblies: usize,
}

/// The tree over chunk instances as the device walks it.
#[derive(Debug)]
pub(crate) struct TopLevel {
    pub(crate) nodes: Vec<LevelNode>,
    /// Stack entries that a walk needs.
    pub(crate) stack: u32,
}

impl TopLevel {
    fn new(world: &PartitionedWorld) -> Self {
        let (nodes, stack) = level_nodes(&world.top);
        Self { nodes, stack }
    }
}

/// The table entry of an asset id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AssetSlot {
    Mesh(usize),
    Assembly(usize),
    Chunk(usize),
    Tile(usize),
}

impl SceneAssets {
    /// Lists the assets of `snapshot`, whose textures and masks are given.
    pub(crate) fn new(
        snapshot: &Arc<Snapshot>,
        textures: &Arc<TextureSet>,
        masks: Arc<OpacityMasks>,
    ) -> Result<Self, RenderError> {
        check(snapshot)?;
        let world = &snapshot.world;
        let meshes = snapshot.meshes.iter().cloned().map(AssetSource::Mesh);
        let assemblies = snapshot.assemblies.iter().cloned().map(AssetSource::Assembly);
        let chunks = world.chunks.iter().cloned().map(AssetSource::Chunk);
        let sources: Vec<AssetSource> = meshes.chain(assemblies).chain(chunks).collect();
        let (meshes, assemblies) = (snapshot.meshes.len(), snapshot.assemblies.len());
        let closures = closures(snapshot, meshes);
        let chunk_rows: Vec<Vec<AssetId>> = world
            .chunks
            .par_iter()
            .enumerate()
            .map(|(index, chunk)| {
                let own = asset_id(meshes + assemblies + index);
                closure_of(chunk.targets().iter().copied(), own, &closures)
            })
            .collect();
        let needed = needed(snapshot, sources.len(), meshes, &chunk_rows);
        let of_needed = || needed.iter().filter_map(|id| sources.get(*id as usize));
        let tiles: Vec<u64> = textures.images().flat_map(|(image, _)| image.layout().all_tile_bytes()).collect();
        let tiles: Vec<u64> = tiles.into_iter().map(AssetSource::held_bytes).collect();
        let tile_bytes = tiles.iter().sum();
        let bytes = of_needed().map(AssetSource::bytes).sum::<u64>() + tile_bytes;
        let largest_bytes = of_needed().map(AssetSource::bytes).max().unwrap_or(0);
        let mut sections = [0; AssetSource::SECTIONS.len()];
        for source in of_needed() {
            sections.iter_mut().zip(source.sections()).for_each(|(sum, bytes)| *sum += bytes);
        }
        sections[AssetSource::TILES] = tile_bytes;
        let rows = chunk_rows.into_iter().chain((0..meshes).map(|mesh| vec![asset_id(mesh)]));
        let listed = UnitCatalog::new(sources.iter().map(AssetSource::bytes).collect(), rows).and_then(|catalog| {
            let mut catalog = catalog.with_bases(world.chunks.len());
            // A lookup of a texture needs no chunk.
            catalog.push_singles(&tiles)?;
            Ok(catalog)
        });
        let catalog = listed.map_err(|error| RenderError::Internal(format!("the scene's assets: {error}")))?;
        Ok(Self {
            snapshot: Arc::clone(snapshot),
            textures: Arc::clone(textures),
            masks,
            sources,
            catalog: Arc::new(catalog),
            needed,
            bytes,
            tile_bytes,
            largest_bytes,
            top: TopLevel::new(world),
            has_held: world.chunks.iter().any(|chunk| chunk.is_held()),
            sections,
            meshes,
            assemblies,
        })
    }

    /// Whether a later snapshot, whose textures are given, has the materials of this one.
    pub(super) fn has_surfaces_of(&self, snapshot: &Snapshot, textures: &Arc<TextureSet>) -> bool {
        Arc::ptr_eq(&self.textures, textures) && self.snapshot.surfaces.is_same(&snapshot.surfaces)
    }

    /// The assets of a later snapshot, if it has the geometry and textures of this one: an edit of a light, say.
    pub(crate) fn with_same_geometry(
        &self,
        snapshot: &Arc<Snapshot>,
        textures: &Arc<TextureSet>,
        masks: &Arc<OpacityMasks>,
    ) -> Option<Self> {
        fn same<T>(a: &[Arc<T>], b: &[Arc<T>]) -> bool {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| Arc::ptr_eq(a, b))
        }
        let old = &self.snapshot;
        let has_same = same(&old.meshes, &snapshot.meshes)
            && same(&old.assemblies, &snapshot.assemblies)
            && same(&old.world.chunks, &snapshot.world.chunks)
            && Arc::ptr_eq(&self.textures, textures);
        has_same.then(|| Self {
            snapshot: Arc::clone(snapshot),
            textures: Arc::clone(textures),
            masks: Arc::clone(masks),
            sources: self.sources.clone(),
            catalog: Arc::clone(&self.catalog),
            needed: self.needed.clone(),
            top: TopLevel::new(&snapshot.world),
            ..*self
        })
    }

    /// Makes these the assets of a later snapshot of which the chunks at `changed` differ, with the same targets, and
    /// the root. Returns the nodes of the top level of before if there is another.
    pub(super) fn replace_chunks(
        &mut self,
        snapshot: &Arc<Snapshot>,
        masks: &Arc<OpacityMasks>,
        changed: &[usize],
    ) -> Option<Vec<LevelNode>> {
        let old = std::mem::replace(&mut self.snapshot, Arc::clone(snapshot));
        self.masks = Arc::clone(masks);
        if let Some((root, at)) = snapshot.assemblies.last().zip(self.assemblies.checked_sub(1)) {
            // Chunks have its records.
            self.replace(asset_id(self.meshes + at), None, AssetSource::Assembly(Arc::clone(root)));
        }
        for &at in changed {
            let Some(chunk) = snapshot.world.chunks.get(at) else { continue };
            let (own, unit) = (self.chunk_asset(at), UnitId::try_from(at).ok());
            let [before, after] = [self.replace(own, unit, AssetSource::Chunk(Arc::clone(chunk))), self.parts_of(own)];
            for (sum, (before, after)) in self.sections.iter_mut().zip(before.into_iter().zip(after)) {
                *sum = sum.saturating_sub(before).saturating_add(after);
            }
        }
        if !changed.is_empty() {
            self.bytes = self.sections.iter().sum();
            self.largest_bytes = self.needed.iter().map(|asset| self.catalog.bytes(*asset)).max().unwrap_or(0);
        }
        let is_same = Arc::ptr_eq(&old.world, &snapshot.world);
        (!is_same).then(|| std::mem::replace(&mut self.top, TopLevel::new(&snapshot.world)).nodes)
    }

    /// Replaces a source; returns the sections of the one before.
    fn replace(
        &mut self,
        asset: AssetId,
        unit: Option<UnitId>,
        source: AssetSource,
    ) -> [u64; AssetSource::SECTIONS.len()] {
        let before = self.parts_of(asset);
        Arc::make_mut(&mut self.catalog).resize(asset, unit, source.bytes());
        if let Some(slot) = self.sources.get_mut(asset as usize) {
            *slot = source;
        }
        before
    }

    fn parts_of(&self, asset: AssetId) -> [u64; AssetSource::SECTIONS.len()] {
        self.sources.get(asset as usize).map(AssetSource::sections).unwrap_or_default()
    }

    /// The block of a chunk's records.
    pub(super) fn chunk_asset(&self, chunk: usize) -> AssetId {
        asset_id(self.meshes + self.assemblies + chunk)
    }

    /// Number of assets that are no tiles.
    pub(super) fn source_count(&self) -> usize {
        self.sources.len()
    }

    /// The source of an asset's bytes.
    pub(crate) fn source(&self, asset: AssetId) -> Option<AssetSource> {
        if let Some(source) = self.sources.get(asset as usize) {
            return Some(source.clone());
        }
        let (image, tile) = self.textures.locate(asset.checked_sub(self.first_tile())?)?;
        Some(AssetSource::Tile(Arc::clone(image), tile))
    }

    /// The content key of an asset.
    pub(crate) fn key(&self, asset: AssetId) -> Option<AssetKey> {
        if let Some(source) = self.sources.get(asset as usize) {
            return Some(source.key());
        }
        let (image, tile) = self.textures.locate(asset.checked_sub(self.first_tile())?)?;
        Some(AssetKey::Tile(image.id(), tile))
    }

    /// The asset of the first tile; the others follow.
    pub(crate) fn first_tile(&self) -> AssetId {
        asset_id(self.sources.len())
    }

    /// The unit of a tile of the scene.
    pub(crate) fn tile_unit(&self, tile: u32) -> UnitId {
        self.geometry_count().saturating_add(tile)
    }

    /// The unit of a mesh.
    pub(crate) fn mesh_unit(&self, mesh: u32) -> UnitId {
        u32::try_from(self.chunk_count()).unwrap_or(u32::MAX).saturating_add(mesh)
    }

    /// Number of chunks and meshes, which are the units before the tiles.
    pub(crate) fn geometry_count(&self) -> u32 {
        u32::try_from(self.chunk_count() + self.meshes).unwrap_or(u32::MAX)
    }

    /// Chunks, and the meshes that some chunk needs.
    pub(crate) fn geometry_units(&self) -> impl Iterator<Item = UnitId> + '_ {
        let meshes = self.needed.iter().copied().take_while(|asset| (*asset as usize) < self.meshes);
        (0..).take(self.chunk_count()).chain(meshes.map(|mesh| self.mesh_unit(mesh)))
    }

    /// Returns true if the unit is a tile.
    pub(crate) fn is_tile(&self, unit: UnitId) -> bool {
        unit >= self.geometry_count()
    }

    /// A description of a unit, for messages.
    pub(crate) fn describe(&self, unit: UnitId) -> String {
        match self.slot(self.own_asset(unit)) {
            AssetSlot::Mesh(mesh) => {
                let triangles = self.snapshot.meshes.get(mesh).map_or(0, |mesh| mesh.triangles);
                format!("mesh {mesh} of {triangles} items")
            }
            AssetSlot::Assembly(assembly) => format!("assembly {assembly}"),
            AssetSlot::Chunk(chunk) => format!("chunk {chunk}"),
            AssetSlot::Tile(tile) => format!("tile {tile} of the textures"),
        }
    }

    /// Bytes of all but tiles.
    pub(crate) fn geometry_bytes(&self) -> u64 {
        self.bytes - self.tile_bytes
    }

    /// Lists the bytes of the assets that some unit needs, by content.
    pub(crate) fn list(&self, inventory: &mut RenderInventory) {
        for (name, bytes) in AssetSource::SECTIONS.into_iter().zip(self.sections) {
            inventory.add(name, bytes);
        }
    }

    /// Shapes of the chunks whose records move.
    pub(crate) fn shapes(&self) -> impl Iterator<Item = u64> + '_ {
        // Most scenes have none, and very many chunks.
        let sources = if self.has_held { &self.sources[..] } else { &[] };
        sources.iter().filter_map(AssetSource::shape)
    }

    /// Makes the top level that of `world`, which is the snapshot's with other bounds.
    pub(super) fn bound(&mut self, world: &PartitionedWorld) {
        self.top = TopLevel::new(world);
    }

    /// The chunks whose records move.
    pub(super) fn held_chunks(&self) -> impl Iterator<Item = &Arc<Chunk>> {
        self.chunks().filter(|chunk| self.has_held && chunk.is_held())
    }

    /// All chunks.
    pub(super) fn chunks(&self) -> impl Iterator<Item = &Arc<Chunk>> {
        self.snapshot.world.chunks.iter()
    }

    /// The table entry of `asset`.
    pub(crate) fn slot(&self, asset: AssetId) -> AssetSlot {
        let at = asset as usize;
        if at < self.meshes {
            AssetSlot::Mesh(at)
        } else if at < self.meshes + self.assemblies {
            AssetSlot::Assembly(at - self.meshes)
        } else if at < self.meshes + self.assemblies + self.chunk_count() {
            AssetSlot::Chunk(at - self.meshes - self.assemblies)
        } else {
            AssetSlot::Tile(at - self.meshes - self.assemblies - self.chunk_count())
        }
    }

    /// Number of chunks, which are the first units.
    pub(crate) fn chunk_count(&self) -> usize {
        self.snapshot.world.chunks.len()
    }

    /// The asset that is a unit's own block: the records of a chunk, the whole of a mesh or tile.
    pub(crate) fn own_asset(&self, unit: UnitId) -> AssetId {
        let (unit, chunks) = (unit as usize, self.chunk_count());
        match unit.checked_sub(chunks) {
            None => self.chunk_asset(unit),
            Some(mesh) if mesh < self.meshes => asset_id(mesh),
            Some(later) => asset_id(self.sources.len() + later - self.meshes),
        }
    }

    /// Every needed asset with its content key.
    pub(crate) fn keys(&self) -> impl Iterator<Item = (AssetId, AssetKey)> + '_ {
        self.needed.iter().filter_map(|id| Some((*id, self.sources.get(*id as usize)?.key())))
    }

    /// Traversal stack entries below the top level that a walk through a chunk may need; `own` returns those of the
    /// trees of chunks and assemblies. 0 for other units.
    pub(crate) fn stack_of(&self, chunk: UnitId, own: impl Fn(AssetId) -> u32) -> u32 {
        if chunk as usize >= self.chunk_count() {
            return 0;
        }
        // Ids of a closure ascend, so children come before what places them and the chunk itself comes last.
        let mut entries: FxHashMap<AssetId, u32> = FxHashMap::default();
        let mut last = 0;
        for &asset in self.catalog.assets(chunk) {
            last = own(asset) + self.below(asset, |below| entries.get(&below).copied());
            entries.insert(asset, last);
        }
        last
    }

    /// [`Self::stack_of`] of each asset that some chunk needs, by its id; 0 of others.
    pub(crate) fn stacks(&self, own: impl Fn(AssetId) -> u32) -> Vec<u32> {
        let mut stacks = vec![0; self.sources.len()];
        // Each asset is visited once, after what it places: many chunks place the same assemblies.
        self.renew_stacks(&mut stacks, &self.needed, own);
        stacks
    }

    /// Makes the stacks of `changed` (sorted) anew.
    pub(super) fn renew_stacks(&self, stacks: &mut [u32], changed: &[AssetId], own: impl Fn(AssetId) -> u32) {
        for &asset in changed {
            let stack = own(asset) + self.below(asset, |below| stacks.get(below as usize).copied());
            if let Some(slot) = stacks.get_mut(asset as usize) {
                *slot = stack;
            }
        }
    }

    /// The stack entries that a walk of any chunk most likely needs, estimated before there are trees over instances.
    pub(crate) fn likely_stack(&self) -> u32 {
        let own = |asset: AssetId| self.sources.get(asset as usize).map_or(0, AssetSource::likely_stack);
        self.stacks(own).into_iter().max().unwrap_or(0)
    }

    /// Stack entries that the targets of `asset` need.
    fn below(&self, asset: AssetId, entries: impl Fn(AssetId) -> Option<u32>) -> u32 {
        match self.sources.get(asset as usize) {
            Some(AssetSource::Assembly(assembly)) => self.deepest(&assembly.targets(), entries),
            Some(AssetSource::Chunk(chunk)) => self.deepest(chunk.targets(), entries),
            Some(AssetSource::Mesh(_) | AssetSource::Tile(..)) | None => 0,
        }
    }

    fn deepest(&self, targets: &[InstanceTarget], entries: impl Fn(AssetId) -> Option<u32>) -> u32 {
        // The depth of a mesh's tree is known before it is loaded.
        let of = |target: &InstanceTarget| match *target {
            InstanceTarget::Mesh(mesh) => self.sources.get(mesh as usize).map(AssetSource::likely_stack),
            InstanceTarget::Assembly(index) => entries(asset_id(self.meshes + index as usize)),
        };
        targets.iter().filter_map(of).max().unwrap_or(0)
    }
}

/// Fails if the scene has more objects than the tables can number.
fn check(snapshot: &Snapshot) -> Result<(), RenderError> {
    let world = &snapshot.world;
    if world.levels > MAX_LEVELS {
        return Err(RenderError::TooDeep { levels: world.levels, limit: MAX_LEVELS });
    }
    let counts = [
        ("meshes", snapshot.meshes.len()),
        ("instancers", snapshot.assemblies.len()),
        ("chunk placements", world.instances.len()),
    ];
    for (what, count) in counts {
        if count as u64 >= MAX_TARGETS {
            return Err(RenderError::TooMany { what, count: count as u64, limit: MAX_TARGETS });
        }
    }
    Ok(())
}

/// Ids were counted against [`MAX_TARGETS`].
fn asset_id(index: usize) -> AssetId {
    AssetId::try_from(index).unwrap_or(AssetId::MAX)
}

/// The assemblies that every assembly referenced whole needs, its own included; children come before parents.
fn closures(snapshot: &Snapshot, meshes: usize) -> Vec<Vec<AssetId>> {
    let mut closures: Vec<Vec<AssetId>> = Vec::with_capacity(snapshot.assemblies.len());
    for (index, assembly) in snapshot.assemblies.iter().enumerate() {
        let closure = closure_of(assembly.targets().into_iter(), asset_id(meshes + index), &closures);
        closures.push(closure);
    }
    closures
}

/// The assets of all chunks and of what they place, sorted.
fn needed(snapshot: &Snapshot, assets: usize, meshes: usize, chunk_rows: &[Vec<AssetId>]) -> Vec<AssetId> {
    let mut needed = vec![false; assets];
    let need = |needed: &mut [bool], asset: AssetId| {
        if let Some(is_needed) = needed.get_mut(asset as usize) {
            *is_needed = true;
        }
    };
    chunk_rows.iter().flatten().for_each(|asset| need(&mut needed, *asset));
    let is_placed = |index: &usize| needed.get(meshes + index) == Some(&true);
    let assemblies: Vec<usize> = (0..snapshot.assemblies.len()).filter(is_placed).collect();
    let mut place = |target: &InstanceTarget| {
        if let InstanceTarget::Mesh(mesh) = *target {
            need(&mut needed, mesh);
        }
    };
    for assembly in assemblies.into_iter().filter_map(|index| snapshot.assemblies.get(index)) {
        assembly.targets().iter().for_each(&mut place);
    }
    snapshot.world.chunks.iter().flat_map(|chunk| chunk.targets()).for_each(&mut place);
    needed.iter().enumerate().filter(|(_, is_needed)| **is_needed).map(|(asset, _)| asset_id(asset)).collect()
}

/// `own` and all assemblies that the targets need, sorted.
fn closure_of(
    targets: impl Iterator<Item = InstanceTarget>,
    own: AssetId,
    assemblies: &[Vec<AssetId>],
) -> Vec<AssetId> {
    let mut closure = vec![own];
    for target in targets {
        if let InstanceTarget::Assembly(index) = target {
            closure.extend(assemblies.get(index as usize).into_iter().flatten());
        }
    }
    closure.sort_unstable();
    closure.dedup();
    closure
}
