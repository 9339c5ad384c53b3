// SPDX-License-Identifier: Apache-2.0
//! Writes an asset's bytes into staging memory piece by piece and records the copies. Runs on the loader's threads.

use super::copied::CopiedAssets;
use super::level::EncodedPiece;
use super::source::MeshLayout;
use super::surfaces::attributes;
use crate::error::RenderError;
use oocpt_abi::{GpuPoint, GpuTriangle};
use oocpt_core::mesh::{Attribute, LeafKind, MeshAsset, SceneMesh, Triangle};
use oocpt_gpu::{CommandList, DeviceRange, Gpu, StagingRing, StagingSlice, Submission};
use std::sync::Arc;

/// Staging bytes of one piece.
pub(crate) const PIECE_BYTES: usize = 1 << 20;
/// Staging bytes after which a command list is submitted.
const SUBMIT_BYTES: usize = 4 << 20;
/// Byte offset of the number of a triangle's subset.
const SUBSET: usize = std::mem::offset_of!(GpuTriangle, subset_and_sides);
/// Byte offset of the number of sides of its authored face.
const SIDES: usize = SUBSET + 2;
/// Byte offset of its place in a Ptex file.
const PTEX: usize = std::mem::offset_of!(GpuTriangle, ptex);

/// The copies of one asset under way.
pub(crate) struct AssetCopier<'a> {
    gpu: &'a Arc<Gpu>,
    ring: &'a StagingRing,
    commands: Option<CommandList>,
    pending: usize,
    submissions: Vec<Submission>,
    bytes: u64,
}

impl<'a> AssetCopier<'a> {
    pub(crate) fn new(gpu: &'a Arc<Gpu>, ring: &'a StagingRing) -> Self {
        Self { gpu, ring, commands: None, pending: 0, submissions: Vec::new(), bytes: 0 }
    }

    /// Fills `count` items of `stride` bytes at `offset` of `target`: `fill` writes items `first..` to the bytes it is
    /// given.
    pub(super) fn section(
        &mut self,
        target: &dyn DeviceRange,
        offset: u64,
        (count, stride): (usize, usize),
        mut fill: impl FnMut(usize, &mut [u8]),
    ) -> Result<(), RenderError> {
        let step = (PIECE_BYTES / stride).max(1);
        for first in (0..count).step_by(step) {
            let bytes = step.min(count - first) * stride;
            let at = offset + (first * stride) as u64;
            // Host memory takes the bytes without staging.
            if target.fill(at, bytes, &mut |out| fill(first, out))? {
                self.bytes += bytes as u64;
                continue;
            }
            let mut slice = self.reserve(bytes)?;
            fill(first, slice.bytes_mut());
            slice.copy_to(self.commands()?, 0, target, at, bytes as u64);
            self.staged(bytes)?;
        }
        Ok(())
    }

    /// Reserves staging memory. Copies in hand are submitted before it waits: space is freed in order, so a thread that
    /// holds the oldest would wait for itself.
    fn reserve(&mut self, bytes: usize) -> Result<StagingSlice, RenderError> {
        if let Some(slice) = self.ring.try_reserve(bytes as u64, 16)? {
            return Ok(slice);
        }
        self.submit()?;
        Ok(self.ring.reserve(bytes as u64, 16)?)
    }

    fn commands(&mut self) -> Result<&mut CommandList, RenderError> {
        match &mut self.commands {
            Some(commands) => Ok(commands),
            none => {
                let commands = none.insert(self.gpu.transfer_commands("load")?);
                // No two of a writer's copies have the same target.
                commands.all_concurrent();
                Ok(commands)
            }
        }
    }

    fn staged(&mut self, bytes: usize) -> Result<(), RenderError> {
        self.pending += bytes;
        self.bytes += bytes as u64;
        if self.pending >= SUBMIT_BYTES { self.submit() } else { Ok(()) }
    }

    /// Submits the copies in hand.
    pub(crate) fn submit(&mut self) -> Result<(), RenderError> {
        self.pending = 0;
        if let Some(commands) = self.commands.take() {
            self.submissions.push(commands.submit()?);
        }
        Ok(())
    }

    /// Submits the rest; returns what to wait for, and the bytes copied.
    pub(crate) fn finish(mut self) -> Result<CopiedAssets, RenderError> {
        self.submit()?;
        Ok(CopiedAssets { submissions: self.submissions, bytes: self.bytes, ..CopiedAssets::default() })
    }

    /// Copies pieces of an asset.
    pub(crate) fn pieces(&mut self, pieces: &[EncodedPiece], target: &dyn DeviceRange) -> Result<(), RenderError> {
        pieces.iter().try_for_each(|piece| self.bytes(target, piece.offset, &piece.bytes))
    }

    /// Copies plain bytes.
    pub(crate) fn bytes(&mut self, target: &dyn DeviceRange, offset: u64, data: &[u8]) -> Result<(), RenderError> {
        self.section(target, offset, (data.len(), 1), |first, out| out.copy_from_slice(&data[first..first + out.len()]))
    }

    /// Copies a mesh.
    pub(crate) fn mesh(
        &mut self,
        (summary, mesh): (&SceneMesh, &MeshAsset),
        target: &dyn DeviceRange,
    ) -> Result<(), RenderError> {
        let layout = MeshLayout::new(summary);
        let nodes = &mesh.bvh.nodes;
        self.bytes(target, 0, bytemuck::cast_slice(nodes))?;
        let count = mesh.triangles.len();
        let item_bytes = usize::try_from(summary.item_bytes()).unwrap_or(size_of::<GpuTriangle>());
        let stride = (count * item_bytes) as u64;
        for key in 0..mesh.keys.times.len().max(1) {
            let offset = layout.triangles + key as u64 * stride;
            // Faces, subsets and places in Ptex files are those of the first key at all keys.
            let later = key.checked_sub(1).and_then(|key| mesh.keys.vertices.chunks(count.max(1)).nth(key));
            self.section(target, offset, (count, item_bytes), |first, out| {
                let vertices = later.map_or(&[][..], |later| &later[first..]);
                match mesh.kind {
                    LeafKind::Points => points(mesh, vertices, first, out),
                    _ => triangles(mesh, vertices, first, out),
                }
            })?;
        }
        let keys = mesh.keys.times.len();
        let times = layout.triangles + stride * keys as u64;
        self.bytes(target, times, bytemuck::cast_slice(&mesh.keys.times))?;
        let radii = layout.triangles + stride * keys.max(1) as u64 + size_of_val(&*mesh.keys.times) as u64;
        let radius_count = usize::try_from(summary.radii).unwrap_or(0);
        self.section(target, radii, (radius_count, size_of::<f32>()), |first, out| {
            for (at, bytes) in (first..).zip(out.chunks_exact_mut(size_of::<f32>())) {
                bytes.copy_from_slice(&radius(mesh, at / keys.max(1), at % keys.max(1)).to_ne_bytes());
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
        let first_normals = size_of_val(values(mesh.normals.as_ref())) as u64;
        self.bytes(target, layout.normals + first_normals, bytemuck::cast_slice(&mesh.keys.normals))?;
        let table = attributes(summary, layout.primvars, &layout.primvar_values);
        self.bytes(target, layout.primvars, bytemuck::cast_slice(&table))?;
        for (primvar, offset) in mesh.primvars.iter().zip(&layout.primvar_values) {
            self.bytes(target, *offset, bytemuck::cast_slice(primvar.values.floats()))?;
        }
        Ok(())
    }
}

/// Writes triangles from number `first` on, as many as fit `out`, with `vertices` in place of their own if there are
/// any.
fn triangles(mesh: &MeshAsset, vertices: &[[[f32; 3]; 3]], first: usize, out: &mut [u8]) {
    if vertices.is_empty() {
        convert(&mesh.triangles[first..], out, triangle);
    } else {
        let posed = mesh.triangles[first..].iter().zip(vertices);
        for ((item, &vertices), bytes) in posed.zip(out.chunks_exact_mut(size_of::<GpuTriangle>())) {
            bytes.copy_from_slice(bytemuck::bytes_of(&triangle(&Triangle { vertices, ..*item })));
        }
    }
    for (subset, bytes) in mesh.subsets.iter().skip(first).zip(out.chunks_exact_mut(size_of::<GpuTriangle>())) {
        bytes[SUBSET..SUBSET + 2].copy_from_slice(&subset.to_le_bytes());
    }
    for (place, bytes) in mesh.ptex.iter().skip(first).zip(out.chunks_exact_mut(size_of::<GpuTriangle>())) {
        bytes[SIDES..SIDES + 2].copy_from_slice(&place.sides.to_le_bytes());
        bytes[PTEX..PTEX + 4].copy_from_slice(&place.word().to_le_bytes());
    }
}

/// Writes points from number `first` on, as [`triangles`] does.
fn points(mesh: &MeshAsset, vertices: &[[[f32; 3]; 3]], first: usize, out: &mut [u8]) {
    let items = mesh.triangles[first..].iter().enumerate();
    for ((at, item), bytes) in items.zip(out.chunks_exact_mut(size_of::<GpuPoint>())) {
        let &[center, ..] = vertices.get(at).unwrap_or(&item.vertices);
        bytes.copy_from_slice(bytemuck::bytes_of(&GpuPoint { center, face: item.face }));
    }
}

/// The radius of a point at a key.
fn radius(mesh: &MeshAsset, point: usize, key: usize) -> f32 {
    let own = || mesh.triangles.get(point).map(|item| item.vertices[2][0]);
    let later = |key: usize| mesh.keys.vertices.get(key * mesh.triangles.len() + point).map(|item| item[2][0]);
    key.checked_sub(1).map_or_else(own, later).unwrap_or(0.0)
}

/// Values of an attribute, none if it is absent.
fn values<T>(attribute: Option<&Attribute<T>>) -> &[T] {
    attribute.map_or(&[], |attribute| &attribute.values)
}

/// Writes `convert(item)` for as many items as fit `out`.
fn convert<T, G: bytemuck::Pod>(items: &[T], out: &mut [u8], convert: impl Fn(&T) -> G) {
    for (item, bytes) in items.iter().zip(out.chunks_exact_mut(size_of::<G>())) {
        bytes.copy_from_slice(bytemuck::bytes_of(&convert(item)));
    }
}

fn triangle(triangle: &Triangle) -> GpuTriangle {
    let [v0, v1, v2] = triangle.vertices;
    GpuTriangle { v0, face: triangle.face, v1, subset_and_sides: 0, v2, ptex: 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_gpu::{Buffer, BufferUsage, OpenOptions};
    use std::sync::mpsc;
    use std::time::Duration;

    #[test]
    fn encoders_sharing_a_small_staging_ring_do_not_deadlock() {
        let selector = std::env::var("OOCPT_TEST_DEVICE").ok();
        let gpu = Gpu::open(&OpenOptions { selector, ..OpenOptions::default() }).expect("a device to test on");
        let ring = Arc::new(StagingRing::new(&gpu, 3 << 20).expect("staging memory"));
        let (done, results) = mpsc::channel();
        let bytes = 12 << 20;
        for thread in 0..4_u8 {
            let (gpu, ring, done) = (Arc::clone(&gpu), Arc::clone(&ring), done.clone());
            std::thread::spawn(move || {
                let target = Buffer::new(&gpu, "target", bytes, BufferUsage::Readback).expect("memory");
                let mut writer = AssetCopier::new(&gpu, &ring);
                let data = vec![thread; usize::try_from(bytes).expect("small")];
                let written = writer.bytes(&target, 0, &data).and_then(|()| writer.finish());
                let written = written.expect("written");
                let ended = written.submissions.iter().all(|copy| copy.wait(Duration::from_secs(60)) == Ok(true));
                let same = target.map(|all| all.iter().all(|byte| *byte == thread)).expect("mapped");
                done.send(ended && same && written.bytes == bytes).expect("the test waits");
            });
        }
        for _ in 0..4 {
            let result = results.recv_timeout(Duration::from_secs(60));
            assert_eq!(result, Ok(true), "a writer waits for ever, or its bytes did not arrive");
        }
    }
}
