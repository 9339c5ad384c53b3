// SPDX-License-Identifier: Apache-2.0
//! The scene on the device, kept from frame to frame: only what changed since the last snapshot is uploaded and built.
//!
//! Order: what the new snapshot no longer uses is freed first, then meshes, then assemblies children first, then the
//! tables that point to them. Render thread only.

mod assembly;
mod lights;
mod mesh;
mod uploader;

pub(crate) use lights::LightTable;

use crate::device::Device;
use crate::error::RenderError;
use crate::timings::Timings;
use assembly::{PendingBuild, ResidentAssembly};
use mesh::ResidentMesh;
use oocpt_core::scene::Snapshot;
use oocpt_gpu::{Buffer, Commands, HeapRange, Usage};
use oocpt_shader_abi::{GpuAssembly, GpuChunk, GpuChunkInstance, GpuLight, GpuMesh, GpuNode};
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::hash_map::Entry;
use std::time::{Duration, Instant};
use uploader::Uploader;

/// Longest chain of instance records that traversal supports.
const MAX_LEVELS: u32 = 16;
/// How long building the instance levels may take before the device counts as lost.
const BUILD_TIMEOUT: Duration = Duration::from_secs(120);
/// Builds whose scratch memory may be alive at the same time.
const BUILDS_AT_ONCE: usize = 32;

/// What the passes need to know of the scene.
#[derive(Clone, Debug)]
pub(crate) struct SceneView {
    pub(crate) top_nodes: u64,
    pub(crate) chunk_instances: u64,
    pub(crate) chunks: u64,
    pub(crate) assemblies: u64,
    pub(crate) meshes: u64,
    pub(crate) lights: u64,
    pub(crate) max_levels: u32,
    pub(crate) stack_size: u32,
}

/// The resident scene.
#[derive(Debug, Default)]
pub(crate) struct SceneCache {
    meshes: FxHashMap<u128, ResidentMesh>,
    assemblies: FxHashMap<u64, ResidentAssembly>,
    tables: Option<Tables>,
    uploader: Option<Uploader>,
}

/// Tables of addresses, made anew for each snapshot.
#[derive(Debug)]
struct Tables {
    /// Top level: nodes, then chunk instances, then chunks, one range each.
    world: [HeapRange; 3],
    meshes: HeapRange,
    assemblies: HeapRange,
    lights: HeapRange,
}

impl SceneCache {
    /// Brings the device up to date with `snapshot` and returns what the passes read.
    pub(crate) fn sync(
        &mut self,
        device: &Device,
        snapshot: &Snapshot,
        lights: &LightTable,
        timings: &mut Timings,
    ) -> Result<SceneView, RenderError> {
        if snapshot.max_levels > MAX_LEVELS {
            return Err(RenderError::TooDeep { levels: snapshot.max_levels, limit: MAX_LEVELS });
        }
        let started = Instant::now();
        self.free_unused(snapshot);
        let mut uploader = match self.uploader.take() {
            Some(uploader) => uploader,
            None => Uploader::new(&device.gpu)?,
        };
        for mesh in &snapshot.meshes {
            if let Entry::Vacant(slot) = self.meshes.entry(mesh.key) {
                slot.insert(ResidentMesh::upload(device, mesh, &mut uploader)?);
            }
        }
        timings.uploaded_bytes += uploader.finish()?;
        timings.upload_secs += started.elapsed().as_secs_f64();
        let started = Instant::now();
        timings.uploaded_bytes += self.sync_assemblies(device, snapshot, &mut uploader)?;
        self.write_tables(device, snapshot, lights, &mut uploader)?;
        self.uploader = Some(uploader);
        timings.build_secs += started.elapsed().as_secs_f64();
        self.view(snapshot)
    }

    fn free_unused(&mut self, snapshot: &Snapshot) {
        let meshes: FxHashSet<u128> = snapshot.meshes.iter().map(|mesh| mesh.key).collect();
        let assemblies: FxHashSet<u64> = snapshot.assemblies.iter().map(|assembly| assembly.key()).collect();
        self.meshes.retain(|key, _| meshes.contains(key));
        self.assemblies.retain(|key, _| assemblies.contains(key));
        self.tables = None;
    }

    /// Uploads and builds what is new, children before parents, in batches that bound the scratch memory.
    fn sync_assemblies(
        &mut self,
        device: &Device,
        snapshot: &Snapshot,
        uploader: &mut Uploader,
    ) -> Result<u64, RenderError> {
        let new: Vec<_> =
            snapshot.assemblies.iter().filter(|assembly| !self.assemblies.contains_key(&assembly.key())).collect();
        let mut bytes = 0;
        for batch in new.chunks(BUILDS_AT_ONCE) {
            let depths = Buffer::new(&device.gpu, "instance tree depths", 4 * BUILDS_AT_ONCE as u64, Usage::Readback)?;
            let mut commands = device.gpu.commands("build instance levels")?;
            let mut pending: Vec<(u64, PendingBuild)> = Vec::new();
            for (slot, assembly) in batch.iter().enumerate() {
                let depth_at = depths.address() + 4 * slot as u64;
                let mesh_depth = |index: u32| {
                    let mesh = snapshot.meshes.get(index as usize).and_then(|mesh| self.meshes.get(&mesh.key));
                    mesh.map_or(0, |mesh| mesh.depth)
                };
                let (resident, build) = ResidentAssembly::upload(device, assembly, uploader, &mesh_depth, depth_at)?;
                self.assemblies.insert(assembly.key(), resident);
                pending.push((assembly.key(), build));
            }
            bytes += uploader.finish()?;
            for (_, build) in &pending {
                build.record(device, &mut commands)?;
            }
            self.finish_builds(commands, &depths, &pending)?;
        }
        Ok(bytes)
    }

    fn finish_builds(
        &mut self,
        commands: Commands,
        depths: &Buffer,
        pending: &[(u64, PendingBuild)],
    ) -> Result<(), RenderError> {
        if !commands.submit()?.wait(BUILD_TIMEOUT)? {
            return Err(RenderError::Internal("building the instance levels did not finish".into()));
        }
        for (slot, (key, _)) in pending.iter().enumerate() {
            let mut depth = [0_u8; 4];
            depths.read(4 * slot as u64, &mut depth)?;
            if let Some(assembly) = self.assemblies.get_mut(key) {
                assembly.depth = u32::from_ne_bytes(depth);
            }
        }
        Ok(())
    }

    fn write_tables(
        &mut self,
        device: &Device,
        snapshot: &Snapshot,
        lights: &LightTable,
        uploader: &mut Uploader,
    ) -> Result<(), RenderError> {
        let meshes: Vec<GpuMesh> =
            snapshot.meshes.iter().filter_map(|mesh| self.meshes.get(&mesh.key)).map(|mesh| mesh.entry).collect();
        let assemblies: Vec<GpuAssembly> = snapshot
            .assemblies
            .iter()
            .filter_map(|assembly| self.assemblies.get(&assembly.key()))
            .map(|assembly| assembly.entry)
            .collect();
        let world = self.world(snapshot);
        let mut table = |name: &str, bytes: &[u8]| -> Result<HeapRange, RenderError> {
            let range = device.heap.alloc(name, (bytes.len() as u64).max(16), 16)?;
            uploader.write(&range, 0, bytes)?;
            Ok(range)
        };
        self.tables = Some(Tables {
            world: [
                table("top level", bytemuck::bytes_of(&world.0))?,
                table("chunk instances", bytemuck::bytes_of(&world.1))?,
                table("chunk table", bytemuck::bytes_of(&world.2))?,
            ],
            meshes: table("mesh table", bytemuck::cast_slice(&meshes))?,
            assemblies: table("assembly table", bytemuck::cast_slice(&assemblies))?,
            lights: table("light table", bytemuck::cast_slice::<GpuLight, u8>(&lights.distant))?,
        });
        uploader.finish()?;
        Ok(())
    }

    /// The whole scene as one chunk that is the root assembly, and a top level of one node.
    fn world(&self, snapshot: &Snapshot) -> (GpuNode, GpuChunkInstance, GpuChunk) {
        const IDENTITY: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        const NOWHERE: ([f32; 3], [f32; 3]) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let root = snapshot.assemblies.last();
        let (min, max) = root.map_or(NOWHERE, |root| (root.bounds().min, root.bounds().max));
        let node = GpuNode { min: [min, NOWHERE.0], max: [max, NOWHERE.1], child: [0; 2], count: [1; 2] };
        let resident = root.and_then(|root| self.assemblies.get(&root.key()));
        let chunk =
            resident.map(|resident| GpuChunk { nodes: resident.entry.nodes, instances: resident.entry.instances });
        (node, GpuChunkInstance::new(IDENTITY, [0.0; 3], 0, 0), chunk.unwrap_or_default())
    }

    /// Stack entries that traversal needs from the root down: levels of nodes on the worst chain of trees.
    fn stack_entries(&self, snapshot: &Snapshot) -> u32 {
        let mut entries: Vec<u32> = Vec::with_capacity(snapshot.assemblies.len());
        for assembly in &snapshot.assemblies {
            let needed = self.assemblies.get(&assembly.key()).map_or(0, |resident| {
                let children = resident.children.iter().filter_map(|child| entries.get(*child as usize));
                resident.depth + children.copied().max().unwrap_or(0).max(resident.mesh_depth)
            });
            entries.push(needed);
        }
        entries.last().copied().unwrap_or(0)
    }

    fn view(&self, snapshot: &Snapshot) -> Result<SceneView, RenderError> {
        let Some(tables) = &self.tables else {
            return Err(RenderError::Internal("the snapshot has no root assembly".into()));
        };
        let levels = snapshot.max_levels.max(1);
        // Rounded up, so that small edits do not ask for new pipelines.
        let stack_size = (1 + self.stack_entries(snapshot) + levels + 2).next_multiple_of(16);
        Ok(SceneView {
            top_nodes: tables.world[0].address(),
            chunk_instances: tables.world[1].address(),
            chunks: tables.world[2].address(),
            assemblies: tables.assemblies.address(),
            meshes: tables.meshes.address(),
            lights: tables.lights.address(),
            max_levels: levels,
            stack_size,
        })
    }
}
