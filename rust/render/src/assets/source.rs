// SPDX-License-Identifier: Apache-2.0
//! One piece of scene data: the source of its bytes, their number, and their layout on the device.
//!
//! A mesh is one range: nodes, triangles, attributes. An assembly or a chunk is one range: instance records, then the
//! nodes of the tree over them, then values of primvars by record, and keys of moving records. A tile of a texture is
//! one range of texels. Pure; any thread.

use super::values::{ALIGN, ValueLayout};
use crate::textures::TextureImage;
use oocpt_abi::{
    AttributeRate, Bvh4Node, GpuAssembly, GpuAttribute, GpuInstance, GpuMesh, GpuMotionKey, LevelNode, MESH_KEYS_SHIFT,
    MeshFlags,
};
use oocpt_core::mesh::{AttributeSummary, MeshSummary, SceneMesh, level_node_count, likely_level_stack};
use oocpt_core::partition::Chunk;
use oocpt_core::scene::{Assembly, InstanceColumn, InstanceRecord, MotionKey};
use std::ops::Range;
use std::sync::Arc;

/// The heap rounds ranges up to a multiple of this, bytes.
const GRANULE: u64 = 256;
/// Most nodes or triangles of one mesh: the traversal packs indices and counts into 32 bits.
const MAX_MESH_ITEMS: u64 = 1 << 28;
/// Most records of one assembly or chunk.
const MAX_RECORDS: u64 = 1 << 26;

/// The source of an asset's bytes.
#[derive(Clone, Debug)]
pub(crate) enum AssetSource {
    Mesh(Arc<SceneMesh>),
    Assembly(Arc<Assembly>),
    Chunk(Arc<Chunk>),
    /// An image and the number of a tile of it.
    Tile(Arc<TextureImage>, u32),
}

/// The identity of an asset's content: equal keys, equal bytes (up to addresses).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum AssetKey {
    Mesh(u128),
    Assembly(u64),
    Chunk(u64),
    /// Number of the image, and of the tile.
    Tile(u64, u32),
}

/// Byte offsets of a mesh's sections; `bytes` is the end.
#[derive(Clone, Debug)]
pub(crate) struct MeshLayout {
    pub(crate) triangles: u64,
    pub(crate) corners: u64,
    pub(crate) normals: u64,
    pub(crate) colors: u64,
    pub(crate) opacities: u64,
    /// The table of the primvars.
    pub(crate) primvars: u64,
    /// Offsets of the values of each primvar.
    pub(crate) primvar_values: Vec<u64>,
    pub(crate) bytes: u64,
}

/// Bytes of an attribute, none if it is absent.
fn values(attribute: Option<AttributeSummary>) -> u64 {
    attribute.map_or(0, |attribute| attribute.bytes())
}

impl MeshLayout {
    /// The layout of `mesh`.
    pub(crate) fn new(mesh: &MeshSummary) -> Self {
        let mut end = 0_u64;
        let mut section = |bytes: u64| {
            let start = end;
            end = (end + bytes).next_multiple_of(ALIGN);
            start
        };
        section(mesh.nodes * size_of::<Bvh4Node>() as u64);
        let layout = Self {
            triangles: section(mesh.triangle_bytes()),
            corners: section(mesh.corner_indices * size_of::<[u32; 3]>() as u64),
            normals: section(mesh.normal_bytes()),
            colors: section(values(mesh.colors)),
            opacities: section(values(mesh.opacities)),
            primvars: section((mesh.primvars.len() * size_of::<GpuAttribute>()) as u64),
            primvar_values: mesh.primvars.iter().map(|p| section(p.values.bytes())).collect(),
            bytes: 0,
        };
        Self { bytes: end, ..layout }
    }
}

/// Bytes of the records of `count` instances; the nodes follow.
fn record_bytes(count: usize) -> u64 {
    (count * size_of::<GpuInstance>()) as u64
}

fn node_bytes(count: usize) -> u64 {
    (level_node_count(count) * size_of::<LevelNode>()) as u64
}

impl AssetSource {
    /// The content key.
    pub(crate) fn key(&self) -> AssetKey {
        match self {
            Self::Mesh(mesh) => AssetKey::Mesh(mesh.key),
            Self::Assembly(assembly) => AssetKey::Assembly(assembly.key()),
            Self::Chunk(chunk) => AssetKey::Chunk(chunk.key()),
            Self::Tile(image, tile) => AssetKey::Tile(image.id(), *tile),
        }
    }

    /// The shape of the tree over records that have moved.
    pub(crate) fn shape(&self) -> Option<u64> {
        match self {
            Self::Chunk(chunk) if chunk.is_held() => Some(chunk.shape()),
            _ => None,
        }
    }

    /// Returns true for a tile that could not be read.
    pub(crate) fn is_broken(&self) -> bool {
        matches!(self, Self::Tile(image, tile) if image.is_broken(*tile))
    }

    /// The kind of asset, for errors and debuggers.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Mesh(_) => "mesh",
            Self::Assembly(_) => "assembly",
            Self::Chunk(_) => "chunk",
            Self::Tile(..) => "texture tile",
        }
    }

    /// Instance records; 0 for a mesh and a tile.
    pub(crate) fn records(&self) -> usize {
        match self {
            Self::Mesh(_) | Self::Tile(..) => 0,
            Self::Assembly(assembly) => assembly.len(),
            Self::Chunk(chunk) => chunk.len(),
        }
    }

    /// Stack entries that a walk of its own tree most likely needs; of a mesh they are known.
    pub(crate) fn likely_stack(&self) -> u32 {
        match self {
            Self::Mesh(mesh) => mesh.stack,
            Self::Assembly(_) | Self::Chunk(_) => likely_level_stack(self.records()),
            Self::Tile(..) => 0,
        }
    }

    /// Names of the sections of assets.
    pub(crate) const SECTIONS: [&str; 13] = [
        "mesh nodes",
        "mesh triangles",
        "mesh corners",
        "mesh normals",
        "mesh displayColor",
        "mesh displayOpacity",
        "mesh primvars",
        "instance records",
        "instance trees",
        "instance primvars",
        "instance motion",
        "texture tiles, at most",
        "rounding of assets",
    ];
    /// The section of texture tiles, which are loaded on demand.
    pub(crate) const TILES: usize = 11;

    /// The bytes by [`Self::SECTIONS`]; their sum is [`Self::bytes`].
    pub(crate) fn sections(&self) -> [u64; Self::SECTIONS.len()] {
        let mut sections = [0; Self::SECTIONS.len()];
        match self {
            Self::Mesh(mesh) => {
                let layout = MeshLayout::new(mesh);
                let MeshLayout { triangles, corners, normals, colors, opacities, primvars, bytes, .. } = layout;
                let starts = [0, triangles, corners, normals, colors, opacities, primvars, bytes];
                for (section, pair) in sections.iter_mut().zip(starts.windows(2)) {
                    *section = pair[1].saturating_sub(pair[0]);
                }
            }
            Self::Assembly(_) | Self::Chunk(_) => {
                sections[7] = record_bytes(self.records());
                sections[8] = node_bytes(self.records());
                sections[9] = self.keys_at().saturating_sub(self.values_at());
                sections[10] = self.size().saturating_sub(self.keys_at());
            }
            Self::Tile(..) => sections[Self::TILES] = self.size(),
        }
        sections[12] = self.bytes().saturating_sub(self.size());
        sections
    }

    /// Bytes to allocate from the heap.
    pub(crate) fn size(&self) -> u64 {
        match self {
            Self::Mesh(mesh) => MeshLayout::new(mesh).bytes,
            Self::Tile(image, tile) => image.layout().tile_bytes(*tile),
            _ => self.keys_at() + (self.keys_before(self.records()) * size_of::<GpuMotionKey>()) as u64,
        }
    }

    /// Primvars for which the records have values.
    pub(crate) fn columns(&self) -> &[InstanceColumn] {
        match self {
            Self::Mesh(_) | Self::Tile(..) => &[],
            Self::Assembly(assembly) => assembly.columns(),
            Self::Chunk(chunk) => chunk.columns(),
        }
    }

    /// Byte offset of the nodes of the tree.
    pub(crate) fn nodes_at(&self) -> u64 {
        record_bytes(self.records())
    }

    /// Byte offset of the table of values.
    pub(crate) fn values_at(&self) -> u64 {
        record_bytes(self.records()) + node_bytes(self.records())
    }

    /// Byte offset of the keys of moving records.
    pub(crate) fn keys_at(&self) -> u64 {
        self.values_at() + ValueLayout::new(self.columns(), self.records()).bytes
    }

    /// Number of keys of the records before `record`.
    pub(crate) fn keys_before(&self, record: usize) -> usize {
        match self {
            Self::Mesh(_) | Self::Tile(..) => 0,
            Self::Assembly(assembly) => assembly.keys_before(record),
            Self::Chunk(chunk) => chunk.keys_before(record),
        }
    }

    /// Calls `visit` with the keys of each moving record of `range`, in order.
    pub(crate) fn encode_keys(&self, range: Range<usize>, visit: impl FnMut(&[MotionKey])) {
        match self {
            Self::Mesh(_) | Self::Tile(..) => {}
            Self::Assembly(assembly) => assembly.encode_keys(range, visit),
            Self::Chunk(chunk) => chunk.encode_keys(range, visit),
        }
    }

    /// Computes the values of records `range`; nothing for a mesh.
    pub(crate) fn encode_values(&self, column: InstanceColumn, range: Range<usize>, out: &mut [f32]) {
        match self {
            Self::Mesh(_) | Self::Tile(..) => {}
            Self::Assembly(assembly) => assembly.encode_values(column, range, out),
            Self::Chunk(chunk) => chunk.encode_values(column, range, out),
        }
    }

    /// Bytes of device memory while it is resident, as the heap rounds them.
    pub(crate) fn bytes(&self) -> u64 {
        Self::held_bytes(self.size())
    }

    /// Bytes of device memory that a range of `size` bytes takes.
    pub(crate) fn held_bytes(size: u64) -> u64 {
        size.next_multiple_of(GRANULE)
    }

    /// Returns `Err((what, count, limit))` if the asset is larger than the shaders' indices reach.
    pub(crate) fn check(&self) -> Result<(), (&'static str, u64, u64)> {
        if let Self::Mesh(mesh) = self {
            let largest = mesh.posed_triangles().max(mesh.nodes);
            return if largest < MAX_MESH_ITEMS {
                Ok(())
            } else {
                Err(("triangles in one mesh", largest, MAX_MESH_ITEMS - 1))
            };
        }
        let records = self.records() as u64;
        if records <= MAX_RECORDS { Ok(()) } else { Err(("instances in one instancer", records, MAX_RECORDS)) }
    }

    /// Computes records `range` and gives each with its number to `visit`; nothing for a mesh.
    pub(crate) fn encode_each(&self, range: Range<usize>, mut visit: impl FnMut(usize, &InstanceRecord)) {
        match self {
            Self::Mesh(_) | Self::Tile(..) => {}
            Self::Assembly(assembly) => {
                let mut records = vec![InstanceRecord::default(); range.len()];
                assembly.encode(range.clone(), &mut records);
                range.zip(&records).for_each(|(at, record)| visit(at, record));
            }
            Self::Chunk(chunk) => chunk.encode_each(range, visit),
        }
    }

    /// The table entry of a mesh that lies at `base`.
    pub(crate) fn mesh_entry(&self, base: u64) -> Option<GpuMesh> {
        let Self::Mesh(mesh) = self else { return None };
        let layout = MeshLayout::new(mesh);
        let at = |present: bool, offset: u64| if present { base + offset } else { 0 };
        let mut flags = MeshFlags::empty();
        flags.set(MeshFlags::DOUBLE_SIDED, mesh.double_sided);
        flags.set(MeshFlags::LEFT_HANDED, mesh.left_handed);
        flags.set(MeshFlags::HAS_NORMALS, mesh.normals.is_some());
        flags.set(MeshFlags::HAS_COLORS, mesh.colors.is_some());
        flags.set(MeshFlags::HAS_OPACITIES, mesh.opacities.is_some());
        flags.set(MeshFlags::KEY_NORMALS, mesh.key_normals > 0);
        flags.set(MeshFlags::OWN_RADII, mesh.radii > 1);
        // A mesh has at most MAX_KEYS.
        let keys = u32::try_from(mesh.keys).unwrap_or(0) << MESH_KEYS_SHIFT;
        Some(GpuMesh {
            nodes: base,
            triangles: base + layout.triangles,
            reach: mesh.whole.min.iter().chain(&mesh.whole.max).fold(0.0, |reach, x| x.abs().max(reach)),
            corner_indices: at(mesh.corner_indices > 0, layout.corners),
            normals: at(mesh.normals.is_some(), layout.normals),
            colors: at(mesh.colors.is_some(), layout.colors),
            opacities: at(mesh.opacities.is_some(), layout.opacities),
            flags: flags.with_rates(rate(mesh.normals), rate(mesh.colors), rate(mesh.opacities))
                | keys
                | mesh.kind.row().flags(),
            // The count was checked against MAX_MESH_ITEMS.
            triangle_count: u32::try_from(mesh.triangles).unwrap_or(u32::MAX),
            primvars: at(!mesh.primvars.is_empty(), layout.primvars),
            primvar_count: u32::try_from(mesh.primvars.len()).unwrap_or(0),
        })
    }

    /// The table entry of an assembly or chunk that lies at `base`.
    pub(crate) fn level_entry(&self, base: u64) -> GpuAssembly {
        let primvars = if self.columns().is_empty() { 0 } else { base + self.values_at() };
        GpuAssembly { nodes: base + record_bytes(self.records()), instances: base, primvars }
    }
}

fn rate(attribute: Option<AttributeSummary>) -> AttributeRate {
    attribute.map_or(AttributeRate::Constant, |attribute| attribute.rate)
}
