// SPDX-License-Identifier: Apache-2.0
//! The tables of addresses that rays go through: chunk instances and the tree over them, chunks, assemblies, meshes, lights.
//!
//! Always resident. An entry that is zero is absent. The host keeps a mirror and writes changes in a command list, so that
//! they take effect between two submissions and never inside one. Render thread only.

use super::catalog::{SceneAssets, Slot};
use super::encode::Writer;
use crate::device::Device;
use crate::error::RenderError;
use bytemuck::{Pod, Zeroable};
use oocpt_core::partition::ChunkInstance;
use oocpt_core::residency::AssetId;
use oocpt_gpu::{Commands, HeapRange};
use oocpt_shader_abi::{GpuAssembly, GpuChunk, GpuChunkInstance, GpuLight, GpuMesh, GpuNode};
use std::time::Duration;

/// How long writing the tables may take before the device counts as lost.
const WRITE_TIMEOUT: Duration = Duration::from_secs(60);

/// See the module.
#[derive(Debug)]
pub(crate) struct Tables {
    pub(crate) top_nodes: HeapRange,
    pub(crate) chunk_instances: HeapRange,
    pub(crate) chunks: HeapRange,
    pub(crate) assemblies: HeapRange,
    pub(crate) meshes: HeapRange,
    pub(crate) lights: HeapRange,
}

/// What the tables are to hold; the host's mirror.
#[derive(Debug, Default)]
pub(crate) struct Entries {
    chunks: Vec<GpuChunk>,
    assemblies: Vec<GpuAssembly>,
    meshes: Vec<GpuMesh>,
}

impl Entries {
    /// Entries of nothing for the assets of a scene.
    pub(crate) fn new(assets: &SceneAssets) -> Self {
        let snapshot = &assets.snapshot;
        Self {
            chunks: vec![GpuChunk::zeroed(); snapshot.world.chunks.len()],
            assemblies: vec![GpuAssembly::zeroed(); snapshot.assemblies.len()],
            meshes: vec![GpuMesh::zeroed(); snapshot.meshes.len()],
        }
    }

    /// Notes that `asset` lies at `address`. A chunk is shown only when everything it needs is noted.
    pub(crate) fn set(&mut self, assets: &SceneAssets, asset: AssetId, address: u64) {
        let Some(source) = assets.sources.get(asset as usize) else { return };
        match assets.slot(asset) {
            Slot::Mesh(at) => {
                if let (Some(slot), Some(entry)) = (self.meshes.get_mut(at), source.mesh_entry(address)) {
                    *slot = entry;
                }
            }
            Slot::Assembly(at) => {
                if let Some(slot) = self.assemblies.get_mut(at) {
                    *slot = source.level_entry(address);
                }
            }
            Slot::Chunk(at) => {
                if let Some(slot) = self.chunks.get_mut(at) {
                    let GpuAssembly { nodes, instances } = source.level_entry(address);
                    *slot = GpuChunk { nodes, instances };
                }
            }
        }
    }

    /// Notes that `asset` is gone.
    pub(crate) fn clear(&mut self, assets: &SceneAssets, asset: AssetId) {
        match assets.slot(asset) {
            Slot::Mesh(at) => zero(&mut self.meshes, at),
            Slot::Assembly(at) => zero(&mut self.assemblies, at),
            Slot::Chunk(at) => zero(&mut self.chunks, at),
        }
    }
}

fn zero<T: Zeroable>(entries: &mut [T], at: usize) {
    if let Some(entry) = entries.get_mut(at) {
        *entry = T::zeroed();
    }
}

impl Tables {
    /// Bytes of the tables of a scene.
    pub(crate) fn bytes(assets: &SceneAssets, lights: usize) -> u64 {
        let (snapshot, world) = (&assets.snapshot, &assets.snapshot.world);
        let tables = [
            (world.top.nodes.len(), size_of::<GpuNode>()),
            (world.instances.len(), size_of::<GpuChunkInstance>()),
            (world.chunks.len(), size_of::<GpuChunk>()),
            (snapshot.assemblies.len(), size_of::<GpuAssembly>()),
            (snapshot.meshes.len(), size_of::<GpuMesh>()),
            (lights, size_of::<GpuLight>()),
        ];
        tables.iter().map(|(count, stride)| ((count * stride).max(16) as u64).next_multiple_of(256)).sum()
    }

    /// Makes the tables and fills them.
    pub(crate) fn new(
        device: &Device,
        assets: &SceneAssets,
        entries: &Entries,
        lights: &[GpuLight],
    ) -> Result<Self, RenderError> {
        let world = &assets.snapshot.world;
        let instances: Vec<GpuChunkInstance> = world.instances.iter().map(chunk_instance).collect();
        let ring = device.loader()?.ring();
        let mut writer = Writer::new(&device.gpu, ring);
        let tables = Self {
            // BvhNode has the layout of GpuNode; the shader_abi tests compare them.
            top_nodes: table(device, &mut writer, "top level", bytemuck::cast_slice(&world.top.nodes))?,
            chunk_instances: table(device, &mut writer, "chunk instances", bytemuck::cast_slice(&instances))?,
            chunks: table(device, &mut writer, "chunk table", bytemuck::cast_slice(&entries.chunks))?,
            assemblies: table(device, &mut writer, "assembly table", bytemuck::cast_slice(&entries.assemblies))?,
            meshes: table(device, &mut writer, "mesh table", bytemuck::cast_slice(&entries.meshes))?,
            lights: table(device, &mut writer, "light table", bytemuck::cast_slice(lights))?,
        };
        let (copies, _) = writer.finish()?;
        for copy in &copies {
            if !copy.wait(WRITE_TIMEOUT)? {
                return Err(RenderError::Internal("writing the scene's tables did not finish".into()));
            }
        }
        Ok(tables)
    }

    /// Records that the entry of `asset` becomes what `entries` says.
    pub(crate) fn update(&self, commands: &mut Commands, assets: &SceneAssets, entries: &Entries, asset: AssetId) {
        match assets.slot(asset) {
            Slot::Mesh(at) => write(commands, &self.meshes, &entries.meshes, at),
            Slot::Assembly(at) => write(commands, &self.assemblies, &entries.assemblies, at),
            Slot::Chunk(at) => write(commands, &self.chunks, &entries.chunks, at),
        }
    }
}

fn write<T: Pod>(commands: &mut Commands, table: &HeapRange, entries: &[T], at: usize) {
    if let Some(entry) = entries.get(at) {
        commands.update(table, (at * size_of::<T>()) as u64, bytemuck::bytes_of(entry));
    }
}

fn table(device: &Device, writer: &mut Writer<'_>, name: &str, bytes: &[u8]) -> Result<HeapRange, RenderError> {
    let range = device.heap.alloc(name, (bytes.len() as u64).max(16), 16)?;
    writer.bytes(&range, 0, bytes)?;
    Ok(range)
}

fn chunk_instance(instance: &ChunkInstance) -> GpuChunkInstance {
    let ChunkInstance { chunk_from_world, origin, chunk, instance_id, .. } = instance;
    GpuChunkInstance::new(*chunk_from_world, origin.to_array(), *chunk, *instance_id)
}
