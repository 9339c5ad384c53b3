// SPDX-License-Identifier: Apache-2.0
//! Primvars of meshes and of instances: `geometry/attribute.glsl`, `surface_material.glsl`, `instance_primvars.glsl`.
//! Any thread.

use crate::scene::TraversalScene;
use crate::walk::RayTraversal;
use oocpt_abi::{AttributeRate, Features, GpuAttribute, GpuInstance, NO_NAME, NO_ROW, NO_VALUE, TARGET_ASSEMBLY};
use oocpt_gpu::HostBytes;

/// As the shaders keep all of them, however wide.
pub(crate) type PrimvarValue = [f32; 4];

/// Which three values a triangle has; all the same for a rate without corners.
pub(crate) fn indices(corners: HostBytes<'_>, rate: u32, triangle: u32) -> Option<[u32; 3]> {
    let first = triangle.wrapping_mul(3);
    match rate {
        rate if rate == AttributeRate::Constant as u32 => Some([0; 3]),
        rate if rate == AttributeRate::Uniform as u32 => Some([triangle; 3]),
        rate if rate == AttributeRate::FaceVarying as u32 => {
            Some([first, first.wrapping_add(1), first.wrapping_add(2)])
        }
        _ => corners.get(triangle as usize),
    }
}

/// `primvar_at`: value `index`, of `width` floats.
fn value_at(values: HostBytes<'_>, index: u32, width: u32) -> Option<PrimvarValue> {
    let at = (index as usize).checked_mul(width as usize)?.checked_mul(size_of::<f32>())?;
    match width {
        1 => values.at_byte(at).map(|v: f32| [v; 4]),
        2 => values.at_byte(at).map(|[x, y]: [f32; 2]| [x, y, 0.0, 1.0]),
        3 => values.at_byte(at).map(|[x, y, z]: [f32; 3]| [x, y, z, 1.0]),
        _ => values.at_byte(at),
    }
}

/// The values of a primvar at the corners of a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriangleCorners([PrimvarValue; 3]);

impl TriangleCorners {
    /// `primvar_value`.
    pub(crate) fn at(&self, [u, v]: [f32; 2]) -> PrimvarValue {
        let Self([a, b, c]) = *self;
        if a == b && b == c {
            return a;
        }
        [0, 1, 2, 3].map(|k| a[k] * (1.0 - u - v) + b[k] * u + c[k] * v)
    }

    /// The first two numbers of the mean, by weight even where all corners are the same.
    pub(crate) fn mixed(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let Self([a, b, c]) = *self;
        [0, 1].map(|k| a[k] * (1.0 - u - v) + b[k] * u + c[k] * v)
    }

    /// By how much its first two numbers grow from the first corner to the others.
    pub(crate) fn growth(&self) -> [[f32; 2]; 2] {
        let Self([a, b, c]) = *self;
        [[b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]]
    }
}

impl TraversalScene<'_> {
    /// `take_value`: the value that `row` of a table of instance values has for a primvar, if it has one.
    fn row_value(&self, table: u64, row: u32, name: u32) -> Option<PrimvarValue> {
        let attributes = self.view.bytes(table);
        let mut value = None;
        for index in 0_usize.. {
            let attribute: GpuAttribute = attributes.get(index)?;
            if attribute.name == NO_NAME {
                break;
            }
            if attribute.name != name {
                continue;
            }
            let width = attribute.rate_and_width >> 8;
            let values = self.view.bytes(table.wrapping_add(attribute.values));
            let bits = values.get::<u32>((row as usize).wrapping_mul(width as usize)).unwrap_or(NO_VALUE);
            if bits != NO_VALUE {
                value = value_at(values, row, width);
            }
        }
        value
    }
}

impl<const ANY_HIT: bool> RayTraversal<'_, '_, ANY_HIT> {
    /// The values of the mesh's own primvar of this name (`find_primvar`, `primvar_corners`).
    pub(crate) fn mesh_primvar(&self, name: u32, triangle: u32) -> Option<TriangleCorners> {
        if name == NO_NAME {
            return None;
        }
        let table = self.scene.view.bytes(self.mesh.primvars);
        let mut entries = (0..self.mesh.primvar_count).map_while(|entry| table.get::<GpuAttribute>(entry as usize));
        let attribute = entries.find(|attribute| attribute.name == name)?;
        let values = self.scene.view.bytes(self.mesh.primvars.wrapping_add(attribute.values));
        let corners = self.scene.view.bytes(self.mesh.corner_indices);
        let [i, j, k] = indices(corners, attribute.rate_and_width & 3, triangle).unwrap_or_default();
        let at = |index| value_at(values, index, attribute.rate_and_width >> 8).unwrap_or_default();
        let a = at(i);
        Some(TriangleCorners(if i == j && j == k { [a; 3] } else { [a, at(j), at(k)] }))
    }

    /// `instance_primvar`: that of the innermost level that has one.
    pub(crate) fn instance_primvar(&self, name: u32) -> Option<PrimvarValue> {
        let scene = self.scene;
        if !scene.has(Features::INSTANCE_PRIMVARS) || name == NO_NAME {
            return None;
        }
        let outer = scene.chunk_instance(self.chunk_instance)?;
        let placed =
            if outer.row == NO_ROW { None } else { scene.row_value(scene.frame.placed_values, outer.row, name) };
        let mut value = placed;
        let chunk = scene.chunk(outer.chunk)?;
        let (mut table, mut instances) = (chunk.primvars, chunk.instances);
        for &record in &self.chain[..scene.special.levels()] {
            value = scene.row_value(table, record, name).or(value);
            let target = scene.view.bytes(instances).get::<GpuInstance>(record as usize)?.target;
            if !scene.has(Features::INSTANCING) || target & TARGET_ASSEMBLY == 0 {
                break;
            }
            let assembly = scene.assembly(scene.target_number(target))?;
            (table, instances) = (assembly.primvars, assembly.instances);
        }
        value
    }
}
