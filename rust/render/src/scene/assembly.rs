// SPDX-License-Identifier: Apache-2.0
//! An assembly on the device: its instance records and the tree over them, built there.
//!
//! Records are computed straight into staging memory; their boxes travel in a scratch range that is given back when the
//! tree is built.

use super::uploader::Uploader;
use crate::device::{Device, Specialisation};
use crate::error::RenderError;
use crate::sync::lock;
use oocpt_core::scene::{Assembly, InstanceFlags, InstanceRecord, Target};
use oocpt_gpu::{Commands, HeapRange};
use oocpt_shader_abi::{
    GpuAssembly, GpuInstance, GpuNode, LBVH_MAX_ITEMS, LbvhBounds, LbvhJob, TARGET_ASSEMBLY, lbvh_scratch_bytes,
    lbvh_steps,
};
use rayon::prelude::*;
use rustc_hash::FxHashSet;
use std::sync::{Mutex, PoisonError};

/// Alignment of nodes and instance records, bytes.
const ALIGN: u64 = 16;
/// Records encoded by one worker at a time.
const BLOCK: usize = 4096;
/// Set in `prototype_count` of a record whose map flips handedness.
const FLIPS_HANDEDNESS: u32 = 1 << 31;

/// An assembly that is resident.
#[derive(Debug)]
pub(crate) struct ResidentAssembly {
    /// Instance records and nodes; dropping them frees them.
    _memory: [HeapRange; 2],
    pub(crate) entry: GpuAssembly,
    /// Levels of nodes of its tree; known once the build is done.
    pub(crate) depth: u32,
    /// Levels of nodes of the deepest mesh it places itself.
    pub(crate) mesh_depth: u32,
    /// Indices of the assemblies it places.
    pub(crate) children: Vec<u32>,
}

/// A build that waits for its commands.
#[derive(Debug)]
pub(crate) struct PendingBuild {
    scratch: HeapRange,
    bounds: HeapRange,
    job: LbvhJob,
}

/// What the records of an assembly place, gathered while they are encoded.
#[derive(Debug, Default)]
struct Placed {
    meshes: FxHashSet<u32>,
    assemblies: FxHashSet<u32>,
}

impl ResidentAssembly {
    /// Places `assembly` on the device and queues the upload of its records. `mesh_depth` tells the tree depth of a mesh
    /// index; `depth` is where the build leaves the number of levels. The tree is there once the commands of
    /// [`PendingBuild::record`] have run.
    pub(crate) fn upload(
        device: &Device,
        assembly: &Assembly,
        uploader: &mut Uploader,
        mesh_depth: &dyn Fn(u32) -> u32,
        depth: u64,
    ) -> Result<(Self, PendingBuild), RenderError> {
        let len = assembly.len();
        let count = u32::try_from(len).ok().filter(|count| *count <= LBVH_MAX_ITEMS).ok_or(RenderError::TooMany {
            what: "instances in one instancer",
            count: len as u64,
            limit: u64::from(LBVH_MAX_ITEMS),
        })?;
        let alloc = |name: &str, bytes: usize| device.heap.alloc(name, (bytes as u64).max(ALIGN), ALIGN);
        let instances = alloc("instances", len * size_of::<GpuInstance>())?;
        let nodes = alloc("instance nodes", len.saturating_sub(1).max(1) * size_of::<GpuNode>())?;
        let bounds = alloc("instance bounds", len * size_of::<LbvhBounds>())?;
        let scratch = device.heap.alloc("instance build", lbvh_scratch_bytes(count), ALIGN)?;
        let placed = upload_records(assembly, uploader, &instances, &bounds)?;
        let around = assembly.bounds();
        let job = LbvhJob {
            bounds: bounds.address(),
            nodes: nodes.address(),
            scratch: scratch.address(),
            depth,
            count,
            around: LbvhBounds { min: around.min, max: around.max },
        };
        let entry = GpuAssembly { nodes: nodes.address(), instances: instances.address() };
        let mut children: Vec<u32> = placed.assemblies.into_iter().collect();
        children.sort_unstable();
        let mesh_depth = placed.meshes.into_iter().map(mesh_depth).max().unwrap_or(0);
        let resident = Self { _memory: [instances, nodes], entry, depth: 0, mesh_depth, children };
        Ok((resident, PendingBuild { scratch, bounds, job }))
    }
}

/// Queues the upload of the records and of their boxes; returns what they place.
fn upload_records(
    assembly: &Assembly,
    uploader: &mut Uploader,
    instances: &HeapRange,
    bounds: &HeapRange,
) -> Result<Placed, RenderError> {
    const RECORD: usize = size_of::<GpuInstance>();
    const BOX: usize = size_of::<LbvhBounds>();
    let placed = Mutex::new(Placed::default());
    uploader.produce(instances, 0, (assembly.len(), RECORD), |range, out| {
        each_block(assembly, range.start, out, RECORD, |records, bytes| {
            lock(&placed).add(records);
            for (record, bytes) in records.iter().zip(bytes.chunks_exact_mut(RECORD)) {
                bytes.copy_from_slice(bytemuck::bytes_of(&instance(record)));
            }
        });
    })?;
    uploader.produce(bounds, 0, (assembly.len(), BOX), |range, out| {
        each_block(assembly, range.start, out, BOX, |records, bytes| {
            for (record, bytes) in records.iter().zip(bytes.chunks_exact_mut(BOX)) {
                let [min, max] = record.bounds;
                bytes.copy_from_slice(bytemuck::bytes_of(&LbvhBounds { min, max }));
            }
        });
    })?;
    Ok(placed.into_inner().unwrap_or_else(PoisonError::into_inner))
}

impl PendingBuild {
    /// Records the dispatches that build the tree.
    pub(crate) fn record(&self, device: &Device, commands: &mut Commands) -> Result<(), RenderError> {
        let plain = Specialisation { max_levels: 1, stack_size: 1, features: 0 };
        for step in lbvh_steps(&self.job) {
            let pipeline = device.pipeline(step.module, plain)?;
            commands.dispatch(&pipeline, bytemuck::bytes_of(&step.push), step.groups);
        }
        commands.keep(&self.scratch);
        commands.keep(&self.bounds);
        Ok(())
    }
}

/// Calls `write` with blocks of records and the bytes they go to, from record `start` on, as many as fit `out`, in
/// parallel.
fn each_block(
    assembly: &Assembly,
    start: usize,
    out: &mut [u8],
    stride: usize,
    write: impl Fn(&[InstanceRecord], &mut [u8]) + Sync,
) {
    out.par_chunks_mut(BLOCK * stride).enumerate().for_each(|(block, bytes)| {
        let first = start + block * BLOCK;
        let mut records = vec![InstanceRecord::default(); bytes.len() / stride];
        assembly.encode(first..first + records.len(), &mut records);
        write(&records, bytes);
    });
}

impl Placed {
    fn add(&mut self, records: &[InstanceRecord]) {
        for record in records {
            match record.target {
                Target::Mesh(index) => self.meshes.insert(index),
                Target::Assembly(index) => self.assemblies.insert(index),
            };
        }
    }
}

fn instance(record: &InstanceRecord) -> GpuInstance {
    let flip = if record.flags.contains(InstanceFlags::FLIPS_HANDEDNESS) { FLIPS_HANDEDNESS } else { 0 };
    GpuInstance {
        object_from_parent: record.object_from_parent,
        target: match record.target {
            Target::Mesh(index) => index,
            Target::Assembly(index) => index | TARGET_ASSEMBLY,
        },
        prim_id: record.prim_id,
        index_in_prototype: record.index_in_prototype,
        prototype_count: record.prototype_count | flip,
    }
}
