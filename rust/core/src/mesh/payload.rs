// SPDX-License-Identifier: Apache-2.0
//! The arrays of an asset as bytes and back: what a summary tells the lengths of, one array after the other in native
//! byte order. Pure.

use bytemuck::Zeroable;
use oocpt_abi::Bvh4Node;

use super::store::{PayloadError, PayloadSource};
use super::summary::{AttributeSummary, MeshSummary};
use super::{AnyAttribute, Attribute, Bvh4, MeshAsset, MeshKeys, MeshPrimvar, PtexTriangle, Triangle};

/// Bytes of three vectors.
const CORNERS: u64 = size_of::<[[f32; 3]; 3]>() as u64;

/// The Ptex numbers of an asset as they are stored: face and part, sides.
pub(super) fn ptex_words(mesh: &MeshAsset) -> Vec<[u32; 2]> {
    mesh.ptex.iter().map(|place| [place.word(), u32::from(place.sides)]).collect()
}

/// The arrays of an asset; `ptex` are its [`ptex_words`].
pub(super) fn parts<'a>(mesh: &'a MeshAsset, ptex: &'a [[u32; 2]]) -> Vec<&'a [u8]> {
    fn values<T: bytemuck::Pod>(attribute: Option<&Attribute<T>>) -> &[u8] {
        attribute.map_or(&[], |attribute| bytemuck::cast_slice(&attribute.values))
    }
    let arrays = [
        bytemuck::cast_slice(&mesh.bvh.nodes),
        bytemuck::cast_slice(&mesh.triangles),
        bytemuck::cast_slice(&mesh.corner_indices),
        values(mesh.normals.as_ref()),
        values(mesh.colors.as_ref()),
        values(mesh.opacities.as_ref()),
        bytemuck::cast_slice(&mesh.subsets),
        bytemuck::cast_slice(ptex),
        bytemuck::cast_slice(&mesh.keys.times),
        bytemuck::cast_slice(&mesh.keys.vertices),
        bytemuck::cast_slice(&mesh.keys.normals),
    ];
    let primvars = mesh.primvars.iter().map(|primvar| bytemuck::cast_slice(primvar.values.floats()));
    arrays.into_iter().chain(primvars).collect()
}

/// Bytes of all parts; `None` where they do not fit a number.
pub(super) fn payload_bytes(mesh: &MeshSummary) -> Option<u64> {
    let attribute = |a: Option<AttributeSummary>| a.map_or(Some(0), bytes_of);
    let arrays = [
        mesh.nodes.checked_mul(size_of::<Bvh4Node>() as u64),
        mesh.triangles.checked_mul(size_of::<Triangle>() as u64),
        mesh.corner_indices.checked_mul(size_of::<[u32; 3]>() as u64),
        attribute(mesh.normals),
        attribute(mesh.colors),
        attribute(mesh.opacities),
        mesh.subsets.checked_mul(size_of::<u16>() as u64),
        mesh.ptex.checked_mul(size_of::<[u32; 2]>() as u64),
        mesh.keys.checked_mul(size_of::<f32>() as u64),
        later(mesh).checked_mul(mesh.triangles).and_then(|count| count.checked_mul(CORNERS)),
        later(mesh).checked_mul(mesh.key_normals).and_then(|count| count.checked_mul(CORNERS)),
    ];
    let primvars = mesh.primvars.iter().map(|primvar| bytes_of(primvar.values));
    arrays.into_iter().chain(primvars).try_fold(0, |sum: u64, bytes| sum.checked_add(bytes?))
}

/// Keys behind the first.
fn later(mesh: &MeshSummary) -> u64 {
    mesh.keys.saturating_sub(1)
}

fn bytes_of(attribute: AttributeSummary) -> Option<u64> {
    attribute.values.checked_mul(u64::from(attribute.width))?.checked_mul(size_of::<f32>() as u64)
}

/// `count` zeros. What is asked for is checked to be no more than the payload before.
fn zeros<T: Zeroable>(count: u64) -> Result<Vec<T>, PayloadError> {
    let count = usize::try_from(count).ok().ok_or(PayloadError::Damaged)?;
    let mut values = Vec::new();
    values.try_reserve_exact(count).map_err(|error| PayloadError::Read(error.to_string()))?;
    values.resize_with(count, T::zeroed);
    Ok(values)
}

fn attribute<T: Zeroable>(summary: Option<AttributeSummary>) -> Result<Option<Attribute<T>>, PayloadError> {
    let Some(AttributeSummary { rate, width, values }) = summary else { return Ok(None) };
    if width as usize * size_of::<f32>() != size_of::<T>() {
        return Err(PayloadError::Damaged);
    }
    Ok(Some(Attribute { rate, values: zeros(values)? }))
}

fn primvar(summary: AttributeSummary) -> Result<AnyAttribute, PayloadError> {
    let some = Some(summary);
    let values = match summary.width {
        1 => attribute(some)?.map(AnyAttribute::One),
        2 => attribute(some)?.map(AnyAttribute::Two),
        3 => attribute(some)?.map(AnyAttribute::Three),
        4 => attribute(some)?.map(AnyAttribute::Four),
        _ => None,
    };
    values.ok_or(PayloadError::Damaged)
}

/// Reads the asset that `summary` is of.
pub(super) fn read(summary: &MeshSummary, payload: &dyn PayloadSource) -> Result<MeshAsset, PayloadError> {
    if payload_bytes(summary) != Some(payload.size()) {
        return Err(PayloadError::Damaged);
    }
    let mut mesh = MeshAsset {
        key: summary.key,
        bounds: summary.bounds,
        whole: summary.whole,
        is_clipped: summary.is_clipped,
        bvh: Bvh4 { nodes: zeros(summary.nodes)?, stack: summary.stack },
        kind: summary.kind,
        triangles: zeros(summary.triangles)?,
        corner_indices: zeros(summary.corner_indices)?,
        normals: attribute(summary.normals)?,
        colors: attribute(summary.colors)?,
        opacities: attribute(summary.opacities)?,
        primvars: Vec::new(),
        subsets: zeros(summary.subsets)?,
        ptex: Vec::new(),
        keys: MeshKeys {
            times: zeros(summary.keys)?,
            vertices: zeros(later(summary).saturating_mul(summary.triangles))?,
            normals: zeros(later(summary).saturating_mul(summary.key_normals))?,
        },
        double_sided: summary.double_sided,
        left_handed: summary.left_handed,
    };
    for wanted in &summary.primvars {
        mesh.primvars.push(MeshPrimvar { id: wanted.id, values: primvar(wanted.values)? });
    }
    let mut ptex: Vec<[u32; 2]> = zeros(summary.ptex)?;
    let mut parts: Vec<&mut [u8]> = vec![
        bytemuck::cast_slice_mut(&mut mesh.bvh.nodes),
        bytemuck::cast_slice_mut(&mut mesh.triangles),
        bytemuck::cast_slice_mut(&mut mesh.corner_indices),
    ];
    parts.extend(mesh.normals.iter_mut().map(|a| bytemuck::cast_slice_mut(&mut a.values)));
    parts.extend(mesh.colors.iter_mut().map(|a| bytemuck::cast_slice_mut(&mut a.values)));
    parts.extend(mesh.opacities.iter_mut().map(|a| bytemuck::cast_slice_mut(&mut a.values)));
    parts.push(bytemuck::cast_slice_mut(&mut mesh.subsets));
    parts.push(bytemuck::cast_slice_mut(&mut ptex));
    parts.push(bytemuck::cast_slice_mut(&mut mesh.keys.times));
    parts.push(bytemuck::cast_slice_mut(&mut mesh.keys.vertices));
    parts.push(bytemuck::cast_slice_mut(&mut mesh.keys.normals));
    parts.extend(mesh.primvars.iter_mut().map(|primvar| primvar.values.bytes_mut()));
    payload.read(&mut parts)?;
    let place = |[word, sides]: [u32; 2]| PtexTriangle::from_word(word, u16::try_from(sides).unwrap_or(0));
    mesh.ptex = ptex.into_iter().map(place).collect();
    Ok(mesh)
}
