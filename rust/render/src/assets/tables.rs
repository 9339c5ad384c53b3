// SPDX-License-Identifier: Apache-2.0
//! The tables of addresses that rays read: chunk instances and the tree over them, chunks, assemblies, meshes, lights,
//! textures and the pages of their tiles.
//!
//! Always resident. An entry of zero is absent. The host keeps a mirror and writes changes in a command list, so that
//! they take effect between two submissions and never inside one. Render thread only.

use super::catalog::{AssetSlot, SceneAssets};
use super::encode::AssetCopier;
use super::surfaces::SurfaceEntries;
use super::values::ValueLayout;
use crate::device::Device;
use crate::error::RenderError;
use crate::textures::TextureSet;
use bytemuck::{Pod, Zeroable};
use oocpt_abi::{GpuAssembly, GpuChunk, GpuChunkInstance, GpuMesh, GpuTexture, LevelNode, PAGE_BROKEN, TEXTURE_SRGB};
use oocpt_core::inventory::RenderInventory;
use oocpt_core::partition::{ChunkInstance, PartitionedWorld, PlacedValues};
use oocpt_core::residency::AssetId;
use oocpt_gpu::{CommandList, HeapRange};
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

/// Most bytes that a command writes: the limit of Vulkan.
const MAX_UPDATE_BYTES: usize = 64 << 10;
/// Unchanged bytes between two changed entries that are written along: a command costs more than these.
const MAX_GAP_BYTES: usize = 1 << 10;
/// The longest time that writing the tables may take before the device counts as lost.
pub(super) const WRITE_TIMEOUT: Duration = Duration::from_secs(60);

/// The tables of a scene on the device.
#[derive(Debug)]
pub(crate) struct SceneTables {
    pub(crate) top_nodes: HeapRange,
    /// False until `top_nodes` has nodes.
    has_top: bool,
    pub(crate) chunk_instances: HeapRange,
    pub(crate) chunks: HeapRange,
    pub(crate) assemblies: HeapRange,
    pub(crate) meshes: HeapRange,
    /// `None` if no mesh has a material.
    pub(crate) surfaces: Option<SurfaceRanges>,
    /// `None` if no placement of an opened assembly has values.
    pub(crate) placed_values: Option<HeapRange>,
    /// `None` if nothing reads a texture.
    pub(crate) textures: Option<TextureTables>,
}

/// The tables of materials, of prims and of their slots.
#[derive(Debug)]
pub(crate) struct SurfaceRanges {
    pub(crate) materials: HeapRange,
    pub(crate) prims: HeapRange,
    pub(crate) slots: HeapRange,
    /// `None` if no material has a program.
    pub(crate) programs: Option<HeapRange>,
    /// The masks of the cutouts; the materials point to them.
    masks: Option<HeapRange>,
}

/// The tables of textures.
#[derive(Debug)]
pub(crate) struct TextureTables {
    pub(crate) records: HeapRange,
    pub(crate) pages: HeapRange,
    /// The places of the texels of Ptex faces; the records point to them.
    _directories: Option<HeapRange>,
    /// The linear values of the bytes of sRGB images; the records point to them.
    _decode: HeapRange,
}

/// What the tables on the device show of the top level, until that of an edit is written.
#[derive(Debug)]
pub(super) struct ShownTop {
    pub(super) world: Arc<PartitionedWorld>,
    pub(super) nodes: Vec<LevelNode>,
}

/// The entries that the tables are to hold: the host's mirror.
#[derive(Debug, Default)]
pub(crate) struct TableEntries {
    chunks: Vec<GpuChunk>,
    assemblies: Vec<GpuAssembly>,
    meshes: Vec<GpuMesh>,
    /// Addresses of tiles.
    pages: Vec<u64>,
}

impl TableEntries {
    /// Absent entries for the assets of a scene.
    pub(crate) fn new(assets: &SceneAssets) -> Self {
        let snapshot = &assets.snapshot;
        Self {
            chunks: vec![GpuChunk::zeroed(); snapshot.world.chunks.len()],
            assemblies: vec![GpuAssembly::zeroed(); snapshot.assemblies.len()],
            meshes: vec![GpuMesh::zeroed(); snapshot.meshes.len()],
            pages: vec![0; assets.textures.tile_count()],
        }
    }

    /// Notes that `asset` lies at `address`. A chunk is shown only if everything it needs is noted.
    pub(crate) fn set(&mut self, assets: &SceneAssets, asset: AssetId, address: u64) {
        let Some(source) = assets.source(asset) else { return };
        match assets.slot(asset) {
            AssetSlot::Mesh(at) => {
                if let (Some(slot), Some(entry)) = (self.meshes.get_mut(at), source.mesh_entry(address)) {
                    *slot = entry;
                }
            }
            AssetSlot::Assembly(at) => {
                if let Some(slot) = self.assemblies.get_mut(at) {
                    *slot = source.level_entry(address);
                }
            }
            AssetSlot::Chunk(at) => {
                if let Some(slot) = self.chunks.get_mut(at) {
                    let GpuAssembly { nodes, instances, primvars } = source.level_entry(address);
                    *slot = GpuChunk { nodes, instances, primvars };
                }
            }
            AssetSlot::Tile(at) => {
                if let Some(slot) = self.pages.get_mut(at) {
                    *slot = if source.is_broken() { address | PAGE_BROKEN } else { address };
                }
            }
        }
    }

    /// Notes that `asset` was evicted.
    pub(crate) fn clear(&mut self, assets: &SceneAssets, asset: AssetId) {
        match assets.slot(asset) {
            AssetSlot::Mesh(at) => zero(&mut self.meshes, at),
            AssetSlot::Assembly(at) => zero(&mut self.assemblies, at),
            AssetSlot::Chunk(at) => zero(&mut self.chunks, at),
            AssetSlot::Tile(at) => zero(&mut self.pages, at),
        }
    }
}

fn zero<T: Zeroable>(entries: &mut [T], at: usize) {
    if let Some(entry) = entries.get_mut(at) {
        *entry = T::zeroed();
    }
}

impl SceneTables {
    /// Bytes of the tables of a scene.
    pub(crate) fn bytes(assets: &SceneAssets) -> u64 {
        let (snapshot, world) = (&assets.snapshot, &assets.snapshot.world);
        let tables = [
            (assets.top.nodes.len(), size_of::<LevelNode>()),
            (world.instances.len(), size_of::<GpuChunkInstance>()),
            (world.chunks.len(), size_of::<GpuChunk>()),
            (snapshot.assemblies.len(), size_of::<GpuAssembly>()),
            (snapshot.meshes.len(), size_of::<GpuMesh>()),
        ];
        let surfaces = SurfaceEntries::sizes(&snapshot.surfaces);
        let textures = &assets.textures;
        let of_textures = [
            (textures.records.len(), size_of::<GpuTexture>()),
            (textures.tile_count(), size_of::<u64>()),
            (256, size_of::<f32>()),
        ];
        let directories = directory_words(textures);
        let placed = ValueLayout::new(&world.placed.columns, world.placed.rows()).bytes;
        let placed = (usize::try_from(placed).unwrap_or(usize::MAX), usize::from(placed > 0));
        let of_textures = of_textures.into_iter().filter(|_| !textures.is_empty());
        tables
            .into_iter()
            .chain(surfaces)
            .chain(of_textures)
            .chain(Some(placed).filter(|(_, count)| *count > 0))
            .chain(Some((assets.masks.words.len(), size_of::<u32>())).filter(|(count, _)| *count > 0))
            .chain(Some((directories, size_of::<u32>())).filter(|(count, _)| *count > 0))
            .map(|(count, stride)| ((count * stride).max(16) as u64).next_multiple_of(256))
            .sum()
    }

    /// Lists the tables in the inventory.
    pub(crate) fn list(&self, inventory: &mut RenderInventory) {
        let Self { top_nodes, chunk_instances, chunks, assemblies, meshes, .. } = self;
        for table in [top_nodes, chunk_instances, chunks, assemblies, meshes] {
            inventory.add(table.name(), table.size());
        }
        let surfaces = self.surfaces.iter().flat_map(|s| [&s.materials, &s.prims, &s.slots]);
        let textures = self.textures.iter().flat_map(|t| [&t.records, &t.pages, &t._decode]);
        let directories = self.textures.iter().filter_map(|t| t._directories.as_ref());
        let programs = self.surfaces.iter().flat_map(|s| s.programs.iter().chain(&s.masks));
        for table in surfaces.chain(programs).chain(textures).chain(directories).chain(&self.placed_values) {
            inventory.add(table.name(), table.size());
        }
        let optional = [
            ("material table", self.surfaces.is_some()),
            ("prim table", self.surfaces.is_some()),
            ("material slots", self.surfaces.is_some()),
            ("pattern programs", self.surfaces.as_ref().is_some_and(|s| s.programs.is_some())),
            ("texture table", self.textures.is_some()),
            ("texture pages", self.textures.is_some()),
            ("sRGB table", self.textures.is_some()),
            ("values of placements", self.placed_values.is_some()),
        ];
        for (name, _) in optional.iter().filter(|(_, is_made)| !is_made) {
            // The table of an empty list is left out.
            inventory.leave_out(name, 0);
        }
    }

    /// Allocates the tables and fills them.
    pub(crate) fn new(device: &Device, assets: &SceneAssets, entries: &TableEntries) -> Result<Self, RenderError> {
        let world = &assets.snapshot.world;
        let instances: Vec<GpuChunkInstance> = world.instances.iter().map(chunk_instance).collect();
        let ring = device.loader()?.ring();
        let mut writer = AssetCopier::new(&device.gpu, ring);
        let tables = Self {
            has_top: true,
            top_nodes: table(device, &mut writer, "top level", bytemuck::cast_slice(&assets.top.nodes))?,
            chunk_instances: table(device, &mut writer, "chunk instances", bytemuck::cast_slice(&instances))?,
            chunks: table(device, &mut writer, "chunk table", bytemuck::cast_slice(&entries.chunks))?,
            assemblies: table(device, &mut writer, "assembly table", bytemuck::cast_slice(&entries.assemblies))?,
            meshes: table(device, &mut writer, "mesh table", bytemuck::cast_slice(&entries.meshes))?,
            surfaces: surface_ranges(device, &mut writer, assets)?,
            placed_values: placed_values(device, &mut writer, &world.placed)?,
            textures: texture_tables(device, &mut writer, assets, entries)?,
        };
        let copies = writer.finish()?.submissions;
        for copy in &copies {
            if !copy.wait(WRITE_TIMEOUT)? {
                return Err(RenderError::Internal("writing the scene's tables did not finish".into()));
            }
        }
        Ok(tables)
    }

    /// Records commands that make the entries of `changed` (sorted) those of `entries`; returns their bytes. A step may
    /// change thousands of meshes and tiles: those that lie near each other are written by one command, with the
    /// entries between them.
    pub(crate) fn update(
        &self,
        commands: &mut CommandList,
        assets: &SceneAssets,
        entries: &TableEntries,
        changed: &[AssetId],
    ) -> u64 {
        let [mut meshes, mut assemblies, mut chunks, mut tiles] = [const { Vec::new() }; 4];
        for &asset in changed {
            match assets.slot(asset) {
                AssetSlot::Mesh(at) => meshes.push(at),
                AssetSlot::Assembly(at) => assemblies.push(at),
                AssetSlot::Chunk(at) => chunks.push(at),
                AssetSlot::Tile(at) => tiles.push(at),
            }
        }
        let mut bytes = write(commands, &self.meshes, &entries.meshes, &meshes)
            + write(commands, &self.assemblies, &entries.assemblies, &assemblies)
            + write(commands, &self.chunks, &entries.chunks, &chunks);
        if let Some(textures) = &self.textures {
            bytes += write(commands, &textures.pages, &entries.pages, &tiles);
        }
        bytes
    }

    /// Makes room for the nodes of another top level, of which nothing is there yet.
    pub(super) fn make_room(&mut self, device: &Device, assets: &SceneAssets) -> Result<(), RenderError> {
        let bytes = size_of_val(&assets.top.nodes[..]) as u64;
        if bytes > self.top_nodes.size() {
            self.top_nodes = device.heap.alloc("top level", bytes, 16)?;
            self.has_top = false;
        }
        Ok(())
    }

    /// Records commands that make the top level that of `assets`, which places as many chunks as `before`; returns
    /// their bytes.
    pub(super) fn update_top(&mut self, commands: &mut CommandList, assets: &SceneAssets, before: &ShownTop) -> u64 {
        let (nodes, instances) = (&assets.top.nodes, &assets.snapshot.world.instances);
        let is_there = std::mem::replace(&mut self.has_top, true);
        let is_new = |at: &usize| !is_there || before.nodes.get(*at) != nodes.get(*at);
        let changed: Vec<usize> = (0..nodes.len()).filter(is_new).collect();
        let bytes = write(commands, &self.top_nodes, nodes, &changed);
        let is_new = |at: &usize| before.world.instances.get(*at) != instances.get(*at);
        let changed: Vec<usize> = (0..instances.len()).filter(is_new).collect();
        runs(&changed, size_of::<GpuChunkInstance>()).into_iter().fold(bytes, |bytes, run| {
            let offset = (run.start * size_of::<GpuChunkInstance>()) as u64;
            let placed: Vec<GpuChunkInstance> =
                instances.get(run).unwrap_or_default().iter().map(chunk_instance).collect();
            commands.update(&self.chunk_instances, offset, bytemuck::cast_slice(&placed));
            bytes + size_of_val(&placed[..]) as u64
        })
    }
}

/// Writes the entries at `places` (sorted) of a table; returns their bytes.
fn write<T: Pod>(commands: &mut CommandList, table: &HeapRange, entries: &[T], places: &[usize]) -> u64 {
    let mut bytes = 0;
    for run in runs(places, size_of::<T>()) {
        let offset = (run.start * size_of::<T>()) as u64;
        if let Some(entries) = entries.get(run) {
            commands.update(table, offset, bytemuck::cast_slice(entries));
            bytes += size_of_val(entries) as u64;
        }
    }
    bytes
}

/// Ranges that hold all of `places` (sorted) and few others, none longer than a command takes; entries have so many
/// bytes.
fn runs(places: &[usize], bytes: usize) -> Vec<Range<usize>> {
    let (most, between) = (MAX_UPDATE_BYTES / bytes, MAX_GAP_BYTES / bytes);
    let mut runs: Vec<Range<usize>> = Vec::new();
    for &at in places {
        match runs.last_mut().filter(|run| at < run.end + between && at < run.start + most) {
            Some(run) => run.end = run.end.max(at + 1),
            None => runs.push(at..at + 1),
        }
    }
    runs
}

fn surface_ranges(
    device: &Device,
    writer: &mut AssetCopier<'_>,
    assets: &SceneAssets,
) -> Result<Option<SurfaceRanges>, RenderError> {
    let Some(entries) = SurfaceEntries::new(&assets.snapshot.surfaces) else { return Ok(None) };
    let masks = match &assets.masks.words[..] {
        [] => None,
        words => Some(table(device, writer, "opacity masks", bytemuck::cast_slice(words))?),
    };
    let entries = entries.with_masks(&assets.masks, masks.as_ref().map_or(0, HeapRange::address));
    Ok(Some(SurfaceRanges {
        materials: table(device, writer, "material table", bytemuck::cast_slice(&entries.materials))?,
        prims: table(device, writer, "prim table", bytemuck::cast_slice(&entries.prims))?,
        slots: table(device, writer, "material slots", bytemuck::cast_slice(&entries.slots))?,
        programs: match &entries.programs[..] {
            [] => None,
            programs => Some(table(device, writer, "pattern programs", bytemuck::cast_slice(programs))?),
        },
        masks,
    }))
}

fn placed_values(
    device: &Device,
    writer: &mut AssetCopier<'_>,
    placed: &PlacedValues,
) -> Result<Option<HeapRange>, RenderError> {
    if placed.columns.is_empty() {
        return Ok(None);
    }
    let layout = ValueLayout::new(&placed.columns, placed.rows());
    let range = device.heap.alloc("values of placements", layout.bytes, 16)?;
    writer.bytes(&range, 0, bytemuck::cast_slice(&layout.entries()))?;
    for ((_, at), values) in layout.columns.iter().zip(&placed.values) {
        writer.bytes(&range, *at, bytemuck::cast_slice(values))?;
    }
    Ok(Some(range))
}

fn texture_tables(
    device: &Device,
    writer: &mut AssetCopier<'_>,
    assets: &SceneAssets,
    entries: &TableEntries,
) -> Result<Option<TextureTables>, RenderError> {
    if assets.textures.is_empty() {
        return Ok(None);
    }
    #[expect(clippy::cast_possible_truncation, reason = "rounded to single precision")]
    let decoded = |byte: u8| oocpt_core::texture::linear_from_srgb(f64::from(byte) / 255.0) as f32;
    let values: Vec<f32> = (0..=255).map(decoded).collect();
    let decode = table(device, writer, "sRGB table", bytemuck::cast_slice(&values))?;
    let mut records = assets.textures.records.clone();
    for record in &mut records {
        record.decode = if record.flags & TEXTURE_SRGB == 0 { 0 } else { decode.address() };
    }
    let directories = directories(device, writer, &assets.textures, &mut records)?;
    Ok(Some(TextureTables {
        records: table(device, writer, "texture table", bytemuck::cast_slice(&records))?,
        pages: table(device, writer, "texture pages", bytemuck::cast_slice(&entries.pages))?,
        _directories: directories,
        _decode: decode,
    }))
}

/// Words of the directories of all Ptex textures.
fn directory_words(textures: &TextureSet) -> usize {
    textures.directories.iter().map(|(_, faces)| faces.directory_words()).sum()
}

/// The directories of Ptex textures, one behind the other; sets their places in the records.
fn directories(
    device: &Device,
    writer: &mut AssetCopier<'_>,
    textures: &TextureSet,
    records: &mut [GpuTexture],
) -> Result<Option<HeapRange>, RenderError> {
    let words = directory_words(textures);
    if words == 0 {
        return Ok(None);
    }
    let range = device.heap.alloc("Ptex directories", (words * size_of::<u32>()) as u64, 16)?;
    let mut at = 0;
    for (record, faces) in &textures.directories {
        let directory = faces.directory();
        writer.bytes(&range, at, bytemuck::cast_slice(&directory))?;
        if let Some(record) = records.get_mut(*record) {
            record.directory = range.address() + at;
        }
        at += size_of_val(&directory[..]) as u64;
    }
    Ok(Some(range))
}

fn table(device: &Device, writer: &mut AssetCopier<'_>, name: &str, bytes: &[u8]) -> Result<HeapRange, RenderError> {
    let range = device.heap.alloc(name, (bytes.len() as u64).max(16), 16)?;
    writer.bytes(&range, 0, bytes)?;
    Ok(range)
}

fn chunk_instance(instance: &ChunkInstance) -> GpuChunkInstance {
    let ChunkInstance { chunk_from_world, origin, chunk, instance_id, row, .. } = instance;
    GpuChunkInstance::new(*chunk_from_world, origin.to_array(), *chunk, *instance_id, *row)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dirty_ranges_cover_every_changed_row_within_command_limits() {
        assert!(runs(&[], 8).is_empty(), "nothing changed");
        assert_eq!(runs(&[3, 5, 5, 4000, 4001], 8), [3..6, 4000..4002], "what is near goes together");
        for bytes in [size_of::<u64>(), size_of::<GpuMesh>(), size_of::<GpuChunk>()] {
            let most = MAX_UPDATE_BYTES / bytes;
            let dense: Vec<usize> = (0..3 * most).step_by(2).collect();
            let cut = runs(&dense, bytes);
            assert!(cut.iter().all(|run| run.len() <= most), "{cut:?}");
            assert!(dense.iter().all(|at| cut.iter().any(|run| run.contains(at))), "all are written");
            assert!((3..=4).contains(&cut.len()), "as few as can be: {cut:?}");
        }
    }
}
