// SPDX-License-Identifier: Apache-2.0
//! Host memory that the arrays of a scene take. They belong to who lends them, so they can be put nowhere else.

use super::SceneDb;
use crate::array::TypedArray;
use crate::desc::{InstancerDesc, MeshDesc, NamedPrimvar, Primvar, Shape};
use rustc_hash::FxHashSet;
use std::sync::Arc;

/// Bytes of arrays, each counted once however many prims share it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lent {
    /// All of them.
    pub bytes: u64,
    /// Path and bytes of the prim that has most, of those that it does not share with prims before it.
    pub largest: Option<(Arc<str>, u64)>,
}

/// Counts the arrays of one prim after the other.
#[derive(Default)]
struct Count {
    seen: FxHashSet<(usize, usize)>,
    lent: Lent,
}

impl Count {
    fn prim<'a>(&mut self, path: &Arc<str>, arrays: impl Iterator<Item = &'a TypedArray>) {
        let mut own = 0;
        for array in arrays {
            let bytes = array.view().bytes();
            if self.seen.insert((bytes.as_ptr().addr(), bytes.len())) {
                own += bytes.len() as u64;
            }
        }
        self.lent.bytes += own;
        if own > self.lent.largest.as_ref().map_or(0, |(_, most)| *most) {
            self.lent.largest = Some((Arc::clone(path), own));
        }
    }
}

impl SceneDb {
    /// What the arrays of all meshes and instancers take, as they stand. Looks at every prim.
    #[must_use]
    pub fn lent(&self) -> Lent {
        let mut count = Count::default();
        for (path, entry) in &self.meshes {
            count.prim(path, of_mesh(&entry.desc));
        }
        for (path, entry) in &self.instancers {
            count.prim(path, of_instancer(&entry.desc));
        }
        count.lent
    }
}

fn of_primvar(primvar: &Primvar) -> impl Iterator<Item = &TypedArray> {
    [&primvar.values].into_iter().chain(&primvar.indices)
}

fn of_primvars(primvars: &[NamedPrimvar]) -> impl Iterator<Item = &TypedArray> {
    primvars.iter().flat_map(|named| of_primvar(&named.primvar))
}

fn of_mesh(desc: &MeshDesc) -> impl Iterator<Item = &TypedArray> {
    let tags = &desc.subdivision_tags;
    let motion = &desc.point_motion;
    let curves = match &desc.shape {
        Shape::Curves(curves) => Some([&curves.counts].into_iter().chain(&curves.indices)),
        _ => None,
    };
    let samples = motion.samples.iter().flat_map(|s| [&s.points].into_iter().chain(&s.normals).chain(&s.widths));
    let tags = [&tags.crease_indices, &tags.crease_lengths, &tags.crease_sharpnesses, &tags.corner_indices]
        .into_iter()
        .chain([&tags.corner_sharpnesses])
        .flatten();
    let shading = [&desc.widths, &desc.normals, &desc.display_color, &desc.display_opacity];
    [&desc.face_vertex_counts, &desc.face_vertex_indices, &desc.points]
        .into_iter()
        .chain(&desc.hole_indices)
        .chain(samples)
        .chain(&motion.velocities)
        .chain(&motion.accelerations)
        .chain(tags)
        .chain(curves.into_iter().flatten())
        .chain(shading.into_iter().flatten().flat_map(of_primvar))
        .chain(of_primvars(&desc.primvars))
        .chain(desc.subsets.iter().map(|subset| &subset.faces))
}

fn of_instancer(desc: &InstancerDesc) -> impl Iterator<Item = &TypedArray> {
    let motion = &desc.motion;
    let samples = motion.samples.iter();
    let samples = samples.flat_map(|s| [&s.translations, &s.rotations, &s.scales, &s.transforms].into_iter().flatten());
    let placed = [&desc.mask, &desc.translations, &desc.rotations, &desc.scales, &desc.transforms];
    let moving = [&motion.velocities, &motion.accelerations, &motion.angular_velocities];
    desc.prototypes
        .iter()
        .map(|prototype| &prototype.indices)
        .chain(placed.into_iter().chain(moving).flatten())
        .chain(samples)
        .chain(of_primvars(&desc.primvars))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::desc::{InstancerPrototype, Interpolation, PrimDesc};

    fn prim(path: &str) -> PrimDesc {
        PrimDesc { path: path.into(), ..PrimDesc::default() }
    }

    #[test]
    fn shared_lent_arrays_are_counted_once() {
        let mut db = SceneDb::new();
        assert_eq!(db.lent(), Lent::default());
        let points = TypedArray::of(vec![[0.0_f32; 3]; 4]);
        let square = |path: &str| MeshDesc {
            points: points.clone(),
            face_vertex_counts: TypedArray::of(vec![4]),
            face_vertex_indices: TypedArray::of(vec![0, 1, 2, 3]),
            prim: prim(path),
            ..MeshDesc::default()
        };
        db.upsert_mesh(square("/a"));
        assert_eq!(db.lent(), Lent { bytes: 48 + 4 + 16, largest: Some(("/a".into(), 68)) });
        let mut colored = square("/b");
        let values = TypedArray::of(vec![[0.0_f32; 3]; 100]);
        colored.display_color = Some(Primvar { interpolation: Interpolation::Uniform, values, indices: None });
        db.upsert_mesh(colored);
        assert_eq!(db.lent(), Lent { bytes: 68 + 20 + 1200, largest: Some(("/b".into(), 1220)) }, "points are shared");
        db.upsert_instancer(InstancerDesc {
            prim: prim("/row"),
            prototypes: vec![InstancerPrototype { root: "/a".into(), indices: TypedArray::of(vec![0; 1000]) }],
            translations: Some(TypedArray::of(vec![[0.0_f32; 3]; 1000])),
            ..InstancerDesc::default()
        });
        assert_eq!(db.lent(), Lent { bytes: 1288 + 16_000, largest: Some(("/row".into(), 16_000)) });
    }
}
