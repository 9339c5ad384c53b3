// SPDX-License-Identifier: Apache-2.0
//! Writes an asset's bytes into staging memory piece by piece and records the copies. Runs on the loader's threads.

use super::source::{MeshLayout, Source, values};
use super::surfaces::attributes;
use super::values::ValueLayout;
use crate::error::RenderError;
use oocpt_core::mesh::{Bvh4Node, MeshAsset, Triangle};
use oocpt_core::scene::{InstanceFlags, InstanceRecord, MotionKey, Target};
use oocpt_gpu::{Commands, DeviceRange, Gpu, StagingRing, StagingSlice, Submission};
use oocpt_shader_abi::{
    GpuInstance, GpuMeshNode, GpuMotionKey, GpuTriangle, LbvhBounds, TARGET_ASSEMBLY, TARGET_MOVING,
};
use std::ops::Range;
use std::sync::Arc;

/// Staging bytes of one piece.
pub(crate) const PIECE_BYTES: usize = 1 << 20;
/// Staging bytes after which a command list is submitted.
const SUBMIT_BYTES: usize = 4 << 20;
/// Records of one piece of staging memory.
const PIECE_RECORDS: usize = 4096;
/// Records that one thread encodes at a time.
const PART_RECORDS: usize = 4096;
/// Where a triangle keeps the number of its subset.
const SUBSET: usize = std::mem::offset_of!(GpuTriangle, subset_and_sides);
/// Where it keeps the sides of its authored face.
const SIDES: usize = SUBSET + 2;
/// Where it keeps its place in a Ptex file.
const PTEX: usize = std::mem::offset_of!(GpuTriangle, ptex);
/// Set in `prototype_count` of a record whose map flips handedness.
const FLIPS_HANDEDNESS: u32 = 1 << 31;

/// A part of an asset that one thread writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// All of it.
    Whole,
    /// These instance records.
    Records(Range<usize>),
}

/// Copies of one asset under way.
pub(crate) struct Writer<'a> {
    gpu: &'a Arc<Gpu>,
    ring: &'a StagingRing,
    commands: Option<Commands>,
    pending: usize,
    submissions: Vec<Submission>,
    bytes: u64,
}

impl<'a> Writer<'a> {
    pub(crate) fn new(gpu: &'a Arc<Gpu>, ring: &'a StagingRing) -> Self {
        Self { gpu, ring, commands: None, pending: 0, submissions: Vec::new(), bytes: 0 }
    }

    /// Fills `count` items of `stride` bytes at `offset` of `target`: `fill` writes items `first..` to the bytes it is
    /// given.
    fn section(
        &mut self,
        target: &dyn DeviceRange,
        offset: u64,
        (count, stride): (usize, usize),
        mut fill: impl FnMut(usize, &mut [u8]),
    ) -> Result<(), RenderError> {
        let step = (PIECE_BYTES / stride).max(1);
        for first in (0..count).step_by(step) {
            let bytes = step.min(count - first) * stride;
            let mut slice = self.reserve(bytes)?;
            fill(first, slice.bytes_mut());
            let at = offset + (first * stride) as u64;
            slice.copy_to(self.commands()?, 0, target, at, bytes as u64);
            self.staged(bytes)?;
        }
        Ok(())
    }

    /// Staging memory. Nobody waits for it with copies in hand that are not submitted: space comes back in order, so
    /// the one who holds the oldest would wait for himself.
    fn reserve(&mut self, bytes: usize) -> Result<StagingSlice, RenderError> {
        if let Some(slice) = self.ring.try_reserve(bytes as u64, 16)? {
            return Ok(slice);
        }
        self.submit()?;
        Ok(self.ring.reserve(bytes as u64, 16)?)
    }

    fn commands(&mut self) -> Result<&mut Commands, RenderError> {
        match &mut self.commands {
            Some(commands) => Ok(commands),
            none => Ok(none.insert(self.gpu.transfer_commands("load")?)),
        }
    }

    fn staged(&mut self, bytes: usize) -> Result<(), RenderError> {
        self.pending += bytes;
        self.bytes += bytes as u64;
        if self.pending >= SUBMIT_BYTES { self.submit() } else { Ok(()) }
    }

    fn submit(&mut self) -> Result<(), RenderError> {
        self.pending = 0;
        if let Some(commands) = self.commands.take() {
            self.submissions.push(commands.submit()?);
        }
        Ok(())
    }

    /// Submits what is left; what to wait for, and the bytes copied.
    pub(crate) fn finish(mut self) -> Result<(Vec<Submission>, u64), RenderError> {
        self.submit()?;
        Ok((self.submissions, self.bytes))
    }

    /// Copies plain bytes.
    pub(crate) fn bytes(&mut self, target: &dyn DeviceRange, offset: u64, data: &[u8]) -> Result<(), RenderError> {
        self.section(target, offset, (data.len(), 1), |first, out| out.copy_from_slice(&data[first..first + out.len()]))
    }

    /// The parts that threads may write independently: all of a mesh, or stretches of records.
    pub(crate) fn parts(source: &Source) -> Vec<Part> {
        if matches!(source, Source::Mesh(_) | Source::Tile(..)) {
            return vec![Part::Whole];
        }
        let count = source.records();
        let firsts = (0..count.max(1)).step_by(PART_RECORDS);
        firsts.map(|first| Part::Records(first..(first + PART_RECORDS).min(count))).collect()
    }

    /// Writes a part of `source` to `target`, and the boxes of its records to the start of `workspace`.
    pub(crate) fn part(
        &mut self,
        source: &Source,
        part: &Part,
        target: &dyn DeviceRange,
        workspace: Option<&dyn DeviceRange>,
    ) -> Result<(), RenderError> {
        match (source, part, workspace) {
            (Source::Mesh(mesh), ..) => self.mesh(mesh, target),
            (Source::Tile(image, tile), ..) => self.bytes(target, 0, &image.tile(*tile)),
            (_, Part::Records(range), Some(workspace)) => {
                self.records(source, range.clone(), target, workspace)?;
                self.values(source, range.clone(), target)?;
                self.keys(source, range.clone(), target)
            }
            _ => Err(RenderError::Internal("no workspace for instance records".into())),
        }
    }

    fn mesh(&mut self, mesh: &MeshAsset, target: &dyn DeviceRange) -> Result<(), RenderError> {
        let layout = MeshLayout::new(mesh);
        let nodes = &mesh.bvh.nodes;
        self.section(target, 0, (nodes.len(), size_of::<GpuMeshNode>()), |first, out| {
            convert(&nodes[first..], out, node)
        })?;
        let triangles = &mesh.triangles;
        let items = (triangles.len(), size_of::<GpuTriangle>());
        self.section(target, layout.triangles, items, |first, out| {
            convert(&triangles[first..], out, triangle);
            for (subset, bytes) in mesh.subsets.iter().skip(first).zip(out.chunks_exact_mut(size_of::<GpuTriangle>())) {
                bytes[SUBSET..SUBSET + 2].copy_from_slice(&subset.to_le_bytes());
            }
            for (place, bytes) in mesh.ptex.iter().skip(first).zip(out.chunks_exact_mut(size_of::<GpuTriangle>())) {
                bytes[SIDES..SIDES + 2].copy_from_slice(&place.sides.to_le_bytes());
                bytes[PTEX..PTEX + 4].copy_from_slice(&place.word().to_le_bytes());
            }
        })?;
        let sections: [(u64, &[u8]); 4] = [
            (layout.corners, bytemuck::cast_slice(&mesh.corner_indices)),
            (layout.normals, bytemuck::cast_slice(values(mesh.normals.as_ref()))),
            (layout.colors, bytemuck::cast_slice(values(mesh.colors.as_ref()))),
            (layout.opacities, bytemuck::cast_slice(values(mesh.opacities.as_ref()))),
        ];
        for (offset, data) in sections {
            self.bytes(target, offset, data)?;
        }
        let table = attributes(mesh, layout.primvars, &layout.primvar_values);
        self.bytes(target, layout.primvars, bytemuck::cast_slice(&table))?;
        for (primvar, offset) in mesh.primvars.iter().zip(&layout.primvar_values) {
            self.bytes(target, *offset, bytemuck::cast_slice(primvar.values.floats()))?;
        }
        Ok(())
    }

    /// The values of records; with those of the first record, the table's entries.
    fn values(&mut self, source: &Source, range: Range<usize>, target: &dyn DeviceRange) -> Result<(), RenderError> {
        let layout = ValueLayout::new(source.columns(), source.records());
        let table = source.values_at();
        if range.start == 0 && !layout.columns.is_empty() {
            self.bytes(target, table, bytemuck::cast_slice(&layout.entries()))?;
        }
        for (column, at) in &layout.columns {
            let stride = 4 * column.width as usize;
            let offset = table + at + (range.start * stride) as u64;
            let mut values = Vec::new();
            self.section(target, offset, (range.len(), stride), |first, out| {
                values.clear();
                values.resize(out.len() / 4, 0.0_f32);
                let first = range.start + first;
                source.encode_values(*column, first..first + out.len() / stride, &mut values);
                out.copy_from_slice(bytemuck::cast_slice(&values));
            })?;
        }
        Ok(())
    }

    /// The keys of those records that move.
    fn keys(&mut self, source: &Source, range: Range<usize>, target: &dyn DeviceRange) -> Result<(), RenderError> {
        let first = source.keys_before(range.start);
        if source.keys_before(range.end) == first {
            return Ok(());
        }
        let mut keys: Vec<GpuMotionKey> = Vec::new();
        source.encode_keys(range, |of_record| keys.extend(of_record.iter().map(motion_key)));
        let offset = source.keys_at() + (first * size_of::<GpuMotionKey>()) as u64;
        self.bytes(target, offset, bytemuck::cast_slice(&keys))
    }

    fn records(
        &mut self,
        source: &Source,
        range: Range<usize>,
        target: &dyn DeviceRange,
        bounds: &dyn DeviceRange,
    ) -> Result<(), RenderError> {
        const RECORD: usize = size_of::<GpuInstance>();
        const BOX: usize = size_of::<LbvhBounds>();
        let mut records = vec![InstanceRecord::default(); PIECE_RECORDS.min(range.len())];
        for first in range.clone().step_by(PIECE_RECORDS) {
            let n = PIECE_RECORDS.min(range.end - first);
            let records = &mut records[..n];
            source.encode(first..first + n, records);
            let mut slice = self.reserve(n * (RECORD + BOX))?;
            let (out, boxes) = slice.bytes_mut().split_at_mut(n * RECORD);
            let mut key = source.keys_before(first);
            convert_mut(records, out, |record| {
                let mut instance = instance(record);
                if record.keys != 0 {
                    // A target beyond 2^30 is refused before it is encoded.
                    let at = source.keys_at() / 16 + (key * size_of::<GpuMotionKey>() / 16) as u64;
                    instance.target |= TARGET_MOVING;
                    instance.object_from_parent = [[0.0; 4]; 3];
                    let words = [u32::try_from(at).unwrap_or(0), record.keys];
                    instance.object_from_parent[0][..2].copy_from_slice(&words.map(f32::from_bits));
                    key += record.keys as usize;
                }
                instance
            });
            convert(records, boxes, |record| LbvhBounds { min: record.bounds[0], max: record.bounds[1] });
            let commands = self.commands()?;
            slice.copy_to(commands, 0, target, (first * RECORD) as u64, (n * RECORD) as u64);
            slice.copy_to(commands, (n * RECORD) as u64, bounds, (first * BOX) as u64, (n * BOX) as u64);
            self.staged(n * (RECORD + BOX))?;
        }
        Ok(())
    }
}

/// Writes `convert(item)` for as many items as fit `out`.
fn convert<T, G: bytemuck::Pod>(items: &[T], out: &mut [u8], convert: impl Fn(&T) -> G) {
    convert_mut(items, out, convert);
}

fn convert_mut<T, G: bytemuck::Pod>(items: &[T], out: &mut [u8], mut convert: impl FnMut(&T) -> G) {
    for (item, bytes) in items.iter().zip(out.chunks_exact_mut(size_of::<G>())) {
        bytes.copy_from_slice(bytemuck::bytes_of(&convert(item)));
    }
}

fn node(node: &Bvh4Node) -> GpuMeshNode {
    let Bvh4Node { origin, cell_and_counts, lower, upper, first_child, first_triangle } = *node;
    GpuMeshNode { origin, cell_and_counts, lower, upper, first_child, first_triangle }
}

fn triangle(triangle: &Triangle) -> GpuTriangle {
    let [v0, v1, v2] = triangle.vertices;
    GpuTriangle { v0, face: triangle.face, v1, subset_and_sides: 0, v2, ptex: 0 }
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
pub(crate) fn motion_key(key: &MotionKey) -> GpuMotionKey {
    let [xx, xy, xz, _, yy, yz, _, _, zz] = key.stretch.to_cols_array().map(|v| v as f32);
    let half_angle = key.half_angle as f32;
    GpuMotionKey {
        translation: key.translation.as_vec3().to_array(),
        time: key.time,
        rotation: key.rotation.as_quat().to_array(),
        stretch: [xx, yy, zz],
        // Below, the sine of the angle is the angle, and quotients of them no numbers any more.
        half_angle: if half_angle > 1e-6 { half_angle } else { 0.0 },
        shear: [xy, xz, yz],
        pad: 0,
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

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_gpu::{Buffer, OpenOptions, Usage};
    use std::sync::mpsc;
    use std::time::Duration;

    #[test]
    fn writers_that_share_too_small_a_ring_all_come_to_their_end() {
        let selector = std::env::var("OOCPT_TEST_DEVICE").ok();
        let gpu = Gpu::open(&OpenOptions { selector, ..OpenOptions::default() }).expect("a device to test on");
        let ring = Arc::new(StagingRing::new(&gpu, 3 << 20).expect("staging memory"));
        let (done, results) = mpsc::channel();
        let bytes = 12 << 20;
        for thread in 0..4_u8 {
            let (gpu, ring, done) = (Arc::clone(&gpu), Arc::clone(&ring), done.clone());
            std::thread::spawn(move || {
                let target = Buffer::new(&gpu, "target", bytes, Usage::Readback).expect("memory");
                let mut writer = Writer::new(&gpu, &ring);
                let data = vec![thread; usize::try_from(bytes).expect("small")];
                let written = writer.bytes(&target, 0, &data).and_then(|()| writer.finish());
                let (copies, copied) = written.expect("written");
                let ended = copies.iter().all(|copy| copy.wait(Duration::from_secs(60)) == Ok(true));
                let same = target.map(|all| all.iter().all(|byte| *byte == thread)).expect("mapped");
                done.send(ended && same && copied == bytes).expect("the test waits");
            });
        }
        for _ in 0..4 {
            let result = results.recv_timeout(Duration::from_secs(60));
            assert_eq!(result, Ok(true), "a writer waits for ever, or its bytes did not arrive");
        }
    }
}
