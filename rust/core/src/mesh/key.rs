// SPDX-License-Identifier: Apache-2.0
//! Content hash of a mesh description: equal hashes mean equal assets (128 bits, xxh3). Pure.

use xxhash_rust::xxh3::Xxh3;

use super::BuildDemand;
use crate::array::TypedArray;
use crate::desc::{MeshDesc, PointsMotion, PointsSample, PrimShape, Primvar};

/// Hashes everything of `desc` that its asset depends on: arrays, orientation, sidedness, subdivision. Not the path,
/// the transform, the prim id or the visibility.
#[must_use]
pub fn mesh_key(desc: &MeshDesc) -> u128 {
    mesh_key_with(desc, &BuildDemand::default())
}

/// [`mesh_key`] of a mesh that is built for a demand. Which faces are in which subset counts, their materials only by
/// how they displace and by what they cut out.
pub(crate) fn mesh_key_with(desc: &MeshDesc, demand: &BuildDemand<'_>) -> u128 {
    let wanted = demand.wanted;
    let mut hasher = Xxh3::new();
    hasher.update(&[u8::from(desc.double_sided), u8::from(desc.left_handed), desc.subdivision as u8]);
    add_array(&mut hasher, Some(&desc.face_vertex_counts));
    add_array(&mut hasher, Some(&desc.face_vertex_indices));
    add_array(&mut hasher, desc.hole_indices.as_ref());
    add_array(&mut hasher, Some(&desc.points));
    for primvar in [&desc.normals, &desc.display_color, &desc.display_opacity] {
        add_primvar(&mut hasher, primvar.as_ref());
    }
    if let PrimShape::Curves(curves) = &desc.shape {
        hasher.update(&[curves.basis as u8, curves.wrap as u8]);
        add_array(&mut hasher, Some(&curves.counts));
        add_array(&mut hasher, curves.indices.as_ref());
    }
    if let Some(number) = desc.shape.number() {
        hasher.update(&[number]);
        add_primvar(&mut hasher, desc.widths.as_ref());
    }
    add_motion(&mut hasher, &desc.point_motion);
    if demand.refines(desc) {
        hasher.update(&desc.subdivision_tags.rules());
        hasher.update(&[desc.refine_level]);
        desc.subdivision_tags.arrays().into_iter().for_each(|array| add_array(&mut hasher, array));
        demand.hash(desc, &mut hasher);
        // What only the displacement reads.
        let read = |name: &str| demand.reads(name) && !wanted.iter().any(|wanted| &*wanted.name == name);
        for named in desc.primvars.iter().filter(|named| read(&named.name)) {
            hasher.update(named.name.as_bytes());
            add_primvar(&mut hasher, Some(&named.primvar));
        }
    }
    // Tells subsets from primvars; absent for most.
    if !(desc.subsets.is_empty() && wanted.is_empty()) {
        hasher.update(&(desc.subsets.len() as u64).to_le_bytes());
    }
    for subset in &desc.subsets {
        add_array(&mut hasher, Some(&subset.faces));
    }
    for primvar in wanted {
        hasher.update(&primvar.id.to_le_bytes());
        hasher.update(&(primvar.name.len() as u64).to_le_bytes());
        hasher.update(primvar.name.as_bytes());
        add_primvar(&mut hasher, desc.authored_primvar(&primvar.name));
    }
    demand.hash_covers(&mut hasher);
    hasher.digest128()
}

/// Nothing of what does not move.
fn add_motion(hasher: &mut Xxh3, motion: &PointsMotion) {
    if !motion.is_given() {
        return;
    }
    add_array(hasher, motion.velocities.as_ref());
    add_array(hasher, motion.accelerations.as_ref());
    motion.seconds.into_iter().for_each(|second| hasher.update(&second.to_le_bytes()));
    hasher.update(&(motion.samples.len() as u64).to_le_bytes());
    for sample in &motion.samples {
        hasher.update(&sample.time.to_le_bytes());
        add_array(hasher, Some(&sample.points));
        add_array(hasher, sample.normals.as_ref());
        add_array(hasher, sample.widths.as_ref());
    }
}

fn add_primvar(hasher: &mut Xxh3, primvar: Option<&Primvar>) {
    hasher.update(&[primvar.map_or(u8::MAX, |p| p.interpolation as u8)]);
    add_array(hasher, primvar.map(|p| &p.values));
    add_array(hasher, primvar.and_then(|p| p.indices.as_ref()));
}

/// Type and length go first, so that no two sequences of arrays give the same bytes.
fn add_array(hasher: &mut Xxh3, array: Option<&TypedArray>) {
    let Some(array) = array else {
        return hasher.update(&[u8::MAX]);
    };
    hasher.update(&[array.element() as u8]);
    hasher.update(&(array.len() as u64).to_le_bytes());
    hasher.update(array.view().bytes());
}

/// True when both descriptions give the same asset for a demand, told from array identities alone: cheap, may say no
/// wrongly.
pub(crate) fn is_same_mesh(a: &MeshDesc, b: &MeshDesc, demand: &BuildDemand<'_>) -> bool {
    let array = |a: &TypedArray, b: &TypedArray| a.element() == b.element() && a.identity() == b.identity();
    let optional = |a: &Option<TypedArray>, b: &Option<TypedArray>| match (a, b) {
        (None, None) => true,
        (Some(a), Some(b)) => array(a, b),
        _ => false,
    };
    let primvar = |a: Option<&Primvar>, b: Option<&Primvar>| match (a, b) {
        (None, None) => true,
        (Some(a), Some(b)) => {
            a.interpolation == b.interpolation && array(&a.values, &b.values) && optional(&a.indices, &b.indices)
        }
        _ => false,
    };
    let plain =
        |m: &MeshDesc| (m.double_sided, m.left_handed, m.subdivision, m.refine_level, m.subdivision_tags.rules());
    let mut tags = a.subdivision_tags.arrays().into_iter().zip(b.subdivision_tags.arrays());
    plain(a) == plain(b)
        && tags.all(|(a, b)| optional(&a.cloned(), &b.cloned()))
        && same_shape(a, b, array, optional)
        && primvar(a.widths.as_ref(), b.widths.as_ref())
        && array(&a.face_vertex_counts, &b.face_vertex_counts)
        && array(&a.face_vertex_indices, &b.face_vertex_indices)
        && optional(&a.hole_indices, &b.hole_indices)
        && array(&a.points, &b.points)
        && same_motion(&a.point_motion, &b.point_motion, &array, &optional)
        && primvar(a.normals.as_ref(), b.normals.as_ref())
        && primvar(a.display_color.as_ref(), b.display_color.as_ref())
        && primvar(a.display_opacity.as_ref(), b.display_opacity.as_ref())
        && a.subsets.len() == b.subsets.len()
        && a.subsets.iter().zip(&b.subsets).all(|(a, b)| array(&a.faces, &b.faces))
        && [a, b]
            .into_iter()
            .flat_map(|mesh| &mesh.primvars)
            .filter(|named| demand.reads(&named.name))
            .all(|named| primvar(a.authored_primvar(&named.name), b.authored_primvar(&named.name)))
}

fn same_motion(
    a: &PointsMotion,
    b: &PointsMotion,
    array: &impl Fn(&TypedArray, &TypedArray) -> bool,
    optional: &impl Fn(&Option<TypedArray>, &Option<TypedArray>) -> bool,
) -> bool {
    let same = |(a, b): (&PointsSample, &PointsSample)| {
        a.time.to_bits() == b.time.to_bits()
            && array(&a.points, &b.points)
            && optional(&a.normals, &b.normals)
            && optional(&a.widths, &b.widths)
    };
    optional(&a.velocities, &b.velocities)
        && optional(&a.accelerations, &b.accelerations)
        && a.seconds.map(f64::to_bits) == b.seconds.map(f64::to_bits)
        && a.samples.len() == b.samples.len()
        && a.samples.iter().zip(&b.samples).all(same)
}

fn same_shape(
    a: &MeshDesc,
    b: &MeshDesc,
    array: impl Fn(&TypedArray, &TypedArray) -> bool,
    optional: impl Fn(&Option<TypedArray>, &Option<TypedArray>) -> bool,
) -> bool {
    match (&a.shape, &b.shape) {
        (PrimShape::Curves(a), PrimShape::Curves(b)) => {
            (a.basis, a.wrap) == (b.basis, b.wrap) && array(&a.counts, &b.counts) && optional(&a.indices, &b.indices)
        }
        (a, b) => a.number() == b.number(),
    }
}
