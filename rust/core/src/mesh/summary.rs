// SPDX-License-Identifier: Apache-2.0
//! The facts about an asset that are known without its arrays: enough to place it, plan its memory and lay it out on
//! the device.

use oocpt_abi::{AttributeRate, Bvh4Node};
use serde::{Deserialize, Serialize};

use super::{Aabb, Attribute, LeafKind, MeshAsset, POINT_BYTES, PRIMVAR_BYTES, SECTION_ALIGN, TRIANGLE_BYTES};

/// The shape of an attribute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AttributeSummary {
    /// The rate, which tells how a value is found from a hit.
    pub rate: AttributeRate,
    /// Number of floats of a value.
    pub width: u32,
    /// Number of values.
    pub values: u64,
}

/// The shape of a primvar.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PrimvarSummary {
    /// Number of its name.
    pub id: u32,
    /// Shape of its values.
    pub values: AttributeSummary,
}

/// The fields of a [`MeshAsset`], with the lengths of arrays in place of their contents.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshSummary {
    /// Content hash.
    pub key: u128,
    /// Box of the parts of the triangles that rays can meet.
    pub bounds: Aabb,
    /// Box of all triangles.
    pub whole: Aabb,
    /// True if the boxes of triangles enclose only the parts that cutouts keep.
    pub is_clipped: bool,
    /// Kind of the items in `triangles`.
    pub kind: LeafKind,
    /// True if it is seen from both sides, false if from the front only.
    pub double_sided: bool,
    /// True if the geometric normal is minus the right-handed one.
    pub left_handed: bool,
    /// Number of nodes of the hierarchy.
    pub nodes: u64,
    /// Number of stack entries that suffice to walk the hierarchy.
    pub stack: u32,
    /// Number of triangles.
    pub triangles: u64,
    /// Number of triangles with point indices: all or none.
    pub corner_indices: u64,
    /// Shape of the shading normals.
    pub normals: Option<AttributeSummary>,
    /// Shape of `displayColor`.
    pub colors: Option<AttributeSummary>,
    /// Shape of `displayOpacity`.
    pub opacities: Option<AttributeSummary>,
    /// Shapes of the primvars.
    pub primvars: Vec<PrimvarSummary>,
    /// Number of triangles with the number of a subset: all or none.
    pub subsets: u64,
    /// Number of triangles with a place in a Ptex file: all or none.
    pub ptex: u64,
    /// Number of keys of a moving mesh, two or more; else 0.
    pub keys: u64,
    /// Number of triangles that have normals for each of the later keys: all or none.
    pub key_normals: u64,
    /// Number of radii of points: 1 if all have the same radius at all times, else one for each at each key; 0 for
    /// other kinds.
    pub radii: u64,
}

impl AttributeSummary {
    /// Bytes of the values.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.values.saturating_mul(u64::from(self.width)).saturating_mul(size_of::<f32>() as u64)
    }
}

fn attribute<T>(attribute: Option<&Attribute<T>>) -> Option<AttributeSummary> {
    let width = u32::try_from(size_of::<T>() / size_of::<f32>()).unwrap_or(1);
    attribute.map(|a| AttributeSummary { rate: a.rate, width, values: a.values.len() as u64 })
}

/// Number of radii, as [`MeshSummary::radii`].
fn radii(mesh: &MeshAsset) -> u64 {
    if mesh.kind != LeafKind::Points {
        return 0;
    }
    let all = mesh.triangles.iter().map(|item| &item.vertices).chain(&mesh.keys.vertices);
    let mut radii = all.map(|&[_, _, [radius, ..]]| radius.to_bits());
    let first = radii.next();
    let is_one = radii.all(|radius| Some(radius) == first);
    if is_one { 1 } else { (mesh.triangles.len() * mesh.keys.times.len().max(1)) as u64 }
}

impl MeshSummary {
    /// The summary of an asset.
    #[must_use]
    pub fn of(mesh: &MeshAsset) -> Self {
        let primvar = |primvar: &super::MeshPrimvar| {
            let (rate, width) = (primvar.values.rate(), primvar.values.width());
            let values = primvar.values.floats().len() as u64 / u64::from(width);
            PrimvarSummary { id: primvar.id, values: AttributeSummary { rate, width, values } }
        };
        Self {
            key: mesh.key,
            bounds: mesh.bounds,
            whole: mesh.whole,
            is_clipped: mesh.is_clipped,
            kind: mesh.kind,
            double_sided: mesh.double_sided,
            left_handed: mesh.left_handed,
            nodes: mesh.bvh.nodes.len() as u64,
            stack: mesh.bvh.stack,
            triangles: mesh.triangles.len() as u64,
            corner_indices: mesh.corner_indices.len() as u64,
            normals: attribute(mesh.normals.as_ref()),
            colors: attribute(mesh.colors.as_ref()),
            opacities: attribute(mesh.opacities.as_ref()),
            primvars: mesh.primvars.iter().map(primvar).collect(),
            subsets: mesh.subsets.len() as u64,
            ptex: mesh.ptex.len() as u64,
            keys: mesh.keys.times.len() as u64,
            radii: radii(mesh),
            key_normals: if mesh.keys.normals.is_empty() { 0 } else { mesh.triangles.len() as u64 },
        }
    }

    /// Number of triangles of all keys.
    #[must_use]
    pub fn posed_triangles(&self) -> u64 {
        self.triangles.saturating_mul(self.keys.max(1))
    }

    /// Bytes of an item on the device.
    #[must_use]
    pub fn item_bytes(&self) -> u64 {
        if self.kind == LeafKind::Points { POINT_BYTES } else { TRIANGLE_BYTES }
    }

    /// Bytes of the triangles of all keys, followed by the keys' times and the radii of points.
    #[must_use]
    pub fn triangle_bytes(&self) -> u64 {
        let behind = self.keys.saturating_add(self.radii).saturating_mul(4);
        self.posed_triangles().saturating_mul(self.item_bytes()).saturating_add(behind)
    }

    /// Bytes of the normals of all keys.
    #[must_use]
    pub fn normal_bytes(&self) -> u64 {
        let later = self.key_normals.saturating_mul(self.keys.saturating_sub(1)).saturating_mul(36);
        self.normals.map_or(0, |normals| normals.bytes()).saturating_add(later)
    }

    /// Bytes of device memory that the asset takes: nodes, triangles ([`Self::item_bytes`] there), corner indices,
    /// normals, colors, opacities, a table of primvars, primvars, each section rounded up to 16.
    #[must_use]
    pub fn device_bytes(&self) -> u64 {
        let attribute = |a: Option<AttributeSummary>| a.map_or(0, |a| a.bytes());
        let sections = [
            self.nodes * size_of::<Bvh4Node>() as u64,
            self.triangle_bytes(),
            self.corner_indices * size_of::<[u32; 3]>() as u64,
            self.normal_bytes(),
            attribute(self.colors),
            attribute(self.opacities),
        ];
        let rest = self.primvars.iter().map(|p| p.values.bytes());
        let table = self.primvars.len() as u64 * PRIMVAR_BYTES;
        sections.into_iter().chain(rest).chain([table]).map(|bytes| bytes.next_multiple_of(SECTION_ALIGN)).sum()
    }
}
