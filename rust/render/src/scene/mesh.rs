// SPDX-License-Identifier: Apache-2.0
//! A mesh asset on the device: one range of memory that holds its nodes, triangles and attributes.

use super::uploader::Uploader;
use crate::device::Device;
use crate::error::RenderError;
use oocpt_core::mesh::{Attribute, AttributeRate, BvhNode, MeshAsset, Triangle};
use oocpt_gpu::HeapRange;
use oocpt_shader_abi as abi;
use oocpt_shader_abi::{GpuMesh, GpuNode, GpuTriangle, MeshFlags};
use rayon::prelude::*;

/// Alignment of every section, bytes.
const ALIGN: u64 = 16;
/// Most nodes or triangles of one mesh: the traversal packs indices and counts into 32 bits.
const MAX_ITEMS: u64 = 1 << 28;

/// A mesh that is resident.
#[derive(Debug)]
pub(crate) struct ResidentMesh {
    /// Holds every section; dropping it frees them.
    _memory: HeapRange,
    /// Addresses for the mesh table.
    pub(crate) entry: GpuMesh,
    /// Levels of nodes of its tree.
    pub(crate) depth: u32,
}

/// Byte offsets of the sections; `bytes` is the end.
struct Layout {
    triangles: u64,
    corners: u64,
    normals: u64,
    colors: u64,
    opacities: u64,
    bytes: u64,
}

fn values<T>(attribute: Option<&Attribute<T>>) -> &[T] {
    attribute.map_or(&[], |attribute| &attribute.values)
}

impl Layout {
    fn new(mesh: &MeshAsset) -> Self {
        let mut end = 0_u64;
        let mut section = |bytes: u64| {
            let start = end;
            end = (end + bytes).next_multiple_of(ALIGN);
            start
        };
        section((mesh.bvh.nodes.len() * size_of::<GpuNode>()) as u64);
        Self {
            triangles: section((mesh.triangles.len() * size_of::<GpuTriangle>()) as u64),
            corners: section(size_of_val(mesh.corner_indices.as_slice()) as u64),
            normals: section(size_of_val(values(mesh.normals.as_ref())) as u64),
            colors: section(size_of_val(values(mesh.colors.as_ref())) as u64),
            opacities: section(size_of_val(values(mesh.opacities.as_ref())) as u64),
            bytes: end,
        }
    }
}

impl ResidentMesh {
    /// Places `mesh` in the device's heap and queues its upload.
    pub(crate) fn upload(device: &Device, mesh: &MeshAsset, uploader: &mut Uploader) -> Result<Self, RenderError> {
        let largest = mesh.triangles.len().max(mesh.bvh.nodes.len()) as u64;
        if largest >= MAX_ITEMS {
            return Err(RenderError::TooMany { what: "triangles in one mesh", count: largest, limit: MAX_ITEMS - 1 });
        }
        let layout = Layout::new(mesh);
        let range = device.heap.alloc("mesh", layout.bytes, ALIGN)?;
        let nodes = (mesh.bvh.nodes.len(), size_of::<GpuNode>());
        uploader.produce(&range, 0, nodes, |items, out| encode(&mesh.bvh.nodes[items], out, node))?;
        let triangles = (mesh.triangles.len(), size_of::<GpuTriangle>());
        uploader.produce(&range, layout.triangles, triangles, |items, out| {
            encode(&mesh.triangles[items], out, triangle);
        })?;
        let corners = bytemuck::cast_slice(&mesh.corner_indices);
        let normals = bytemuck::cast_slice(values(mesh.normals.as_ref()));
        let colors = bytemuck::cast_slice(values(mesh.colors.as_ref()));
        let opacities = bytemuck::cast_slice(values(mesh.opacities.as_ref()));
        let sections = [
            (layout.corners, corners),
            (layout.normals, normals),
            (layout.colors, colors),
            (layout.opacities, opacities),
        ];
        for (offset, bytes) in sections {
            uploader.write(&range, offset, bytes)?;
        }
        let entry = entry(mesh, &layout, range.address());
        Ok(Self { _memory: range, entry, depth: mesh.bvh.depth })
    }
}

fn entry(mesh: &MeshAsset, layout: &Layout, base: u64) -> GpuMesh {
    let at = |present: bool, offset: u64| if present { base + offset } else { 0 };
    let mut flags = MeshFlags::empty();
    flags.set(MeshFlags::DOUBLE_SIDED, mesh.double_sided);
    flags.set(MeshFlags::LEFT_HANDED, mesh.left_handed);
    flags.set(MeshFlags::HAS_NORMALS, mesh.normals.is_some());
    flags.set(MeshFlags::HAS_COLORS, mesh.colors.is_some());
    flags.set(MeshFlags::HAS_OPACITIES, mesh.opacities.is_some());
    GpuMesh {
        nodes: base,
        triangles: base + layout.triangles,
        corner_indices: at(!mesh.corner_indices.is_empty(), layout.corners),
        normals: at(mesh.normals.is_some(), layout.normals),
        colors: at(mesh.colors.is_some(), layout.colors),
        opacities: at(mesh.opacities.is_some(), layout.opacities),
        flags: flags.with_rates(rate(mesh.normals.as_ref()), rate(mesh.colors.as_ref()), rate(mesh.opacities.as_ref())),
        // Checked against MAX_ITEMS by the caller.
        triangle_count: u32::try_from(mesh.triangles.len()).unwrap_or(u32::MAX),
    }
}

fn rate<T>(attribute: Option<&Attribute<T>>) -> abi::AttributeRate {
    match attribute.map(|attribute| attribute.rate) {
        None | Some(AttributeRate::Constant) => abi::AttributeRate::Constant,
        Some(AttributeRate::Uniform) => abi::AttributeRate::Uniform,
        Some(AttributeRate::Vertex) => abi::AttributeRate::Vertex,
        Some(AttributeRate::FaceVarying) => abi::AttributeRate::FaceVarying,
    }
}

/// Writes `convert(item)` for each item to `out`, which holds exactly that many.
fn encode<T: Sync, G: bytemuck::Pod + Send>(items: &[T], out: &mut [u8], convert: impl Fn(&T) -> G + Sync) {
    let write = |(item, bytes): (&T, &mut [u8])| bytes.copy_from_slice(bytemuck::bytes_of(&convert(item)));
    let stride = size_of::<G>();
    items.par_iter().with_min_len(4096).zip(out.par_chunks_exact_mut(stride)).for_each(write);
}

fn node(node: &BvhNode) -> GpuNode {
    GpuNode { min: node.min, max: node.max, child: node.child, count: node.count }
}

fn triangle(triangle: &Triangle) -> GpuTriangle {
    let [v0, v1, v2] = triangle.vertices;
    GpuTriangle { v0, face: triangle.face, v1, pad1: 0, v2, pad2: 0 }
}
