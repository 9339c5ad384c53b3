// SPDX-License-Identifier: Apache-2.0
//! Host memory that the arrays of a scene take. They belong to who lends them, so they can be put nowhere else.

use super::SceneDb;
use crate::array::TypedArray;
use crate::desc::{InstancerDesc, MeshDesc, NamedPrimvar, PrimShape, Primvar};
use rustc_hash::FxHashMap;
use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::collections::hash_map::Entry;
use std::sync::Arc;

/// Bytes of arrays, each counted once however many prims share it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LentBytes {
    /// All of them.
    pub bytes: u64,
    /// Path and bytes of the prim whose arrays take most, shared or not; the first path where several take as much.
    pub largest: Option<(Arc<str>, u64)>,
}

/// Where an array lies, and its bytes.
type ArrayRange = (usize, usize);

/// Counts the arrays of prims that come and go.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct LentArrays {
    /// How many prims have each array.
    users: FxHashMap<ArrayRange, u32>,
    bytes: u64,
    /// What the arrays of each prim take, with its path.
    prims: BTreeSet<(u64, Reverse<Arc<str>>)>,
}

impl LentArrays {
    /// Counts the arrays of a prim.
    pub(super) fn add<'a>(&mut self, path: &Arc<str>, arrays: impl Iterator<Item = &'a TypedArray>) {
        let places = places(arrays);
        for place in &places {
            let users = self.users.entry(*place).or_default();
            if *users == 0 {
                self.bytes += place.1 as u64;
            }
            *users += 1;
        }
        self.prims.insert((sum(&places), Reverse(Arc::clone(path))));
    }

    /// No longer counts the arrays that [`Self::add`] got for a prim.
    pub(super) fn remove<'a>(&mut self, path: &Arc<str>, arrays: impl Iterator<Item = &'a TypedArray>) {
        let places = places(arrays);
        for place in &places {
            if let Entry::Occupied(mut users) = self.users.entry(*place) {
                *users.get_mut() -= 1;
                if *users.get() == 0 {
                    users.remove();
                    self.bytes -= place.1 as u64;
                }
            }
        }
        self.prims.remove(&(sum(&places), Reverse(Arc::clone(path))));
    }

    fn lent(&self) -> LentBytes {
        let largest = self.prims.last().filter(|(bytes, _)| *bytes > 0);
        LentBytes { bytes: self.bytes, largest: largest.map(|(bytes, Reverse(path))| (Arc::clone(path), *bytes)) }
    }
}

/// Where arrays lie, each once.
fn places<'a>(arrays: impl Iterator<Item = &'a TypedArray>) -> Vec<ArrayRange> {
    let bytes = arrays.map(|array| array.view().bytes()).filter(|bytes| !bytes.is_empty());
    let mut places: Vec<ArrayRange> = bytes.map(|bytes| (bytes.as_ptr().addr(), bytes.len())).collect();
    places.sort_unstable();
    places.dedup();
    places
}

fn sum(places: &[ArrayRange]) -> u64 {
    places.iter().map(|place| place.1 as u64).sum()
}

impl SceneDb {
    /// What the arrays of all meshes and instancers take, as they stand. The first call looks at every prim, from then
    /// on edits keep the count.
    #[must_use]
    pub fn lent(&mut self) -> LentBytes {
        if let Some(lending) = &self.lending {
            return lending.lent();
        }
        let lending = self.count_lent();
        let lent = lending.lent();
        self.lending = Some(lending);
        lent
    }

    fn count_lent(&self) -> LentArrays {
        let mut lending = LentArrays::default();
        self.meshes.iter().for_each(|(path, entry)| lending.add(path, of_mesh(&entry.desc)));
        self.instancers.iter().for_each(|(path, entry)| lending.add(path, of_instancer(&entry.desc)));
        lending
    }
}

fn of_primvar(primvar: &Primvar) -> impl Iterator<Item = &TypedArray> {
    [&primvar.values].into_iter().chain(&primvar.indices)
}

fn of_primvars(primvars: &[NamedPrimvar]) -> impl Iterator<Item = &TypedArray> {
    primvars.iter().flat_map(|named| of_primvar(&named.primvar))
}

/// The arrays of a mesh; none of a solid, whose form is made here and changes with what is asked of it.
pub(super) fn of_mesh(desc: &MeshDesc) -> impl Iterator<Item = &TypedArray> {
    let tags = &desc.subdivision_tags;
    let motion = &desc.point_motion;
    let curves = match &desc.shape {
        PrimShape::Curves(curves) => Some([&curves.counts].into_iter().chain(&curves.indices)),
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
        .filter(|_| desc.solid.is_none())
}

pub(super) fn of_instancer(desc: &InstancerDesc) -> impl Iterator<Item = &TypedArray> {
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
        assert_eq!(db.lent(), LentBytes::default());
        let points = TypedArray::of(vec![[0.0_f32; 3]; 4]);
        let square = |path: &str| MeshDesc {
            points: points.clone(),
            face_vertex_counts: TypedArray::of(vec![4]),
            face_vertex_indices: TypedArray::of(vec![0, 1, 2, 3]),
            prim: prim(path),
            ..MeshDesc::default()
        };
        db.upsert_mesh(square("/a"));
        assert_eq!(db.lent(), LentBytes { bytes: 48 + 4 + 16, largest: Some(("/a".into(), 68)) });
        let mut colored = square("/b");
        let values = TypedArray::of(vec![[0.0_f32; 3]; 100]);
        colored.display_color = Some(Primvar { interpolation: Interpolation::Uniform, values, indices: None });
        db.upsert_mesh(colored);
        assert_eq!(
            db.lent(),
            LentBytes { bytes: 68 + 20 + 1200, largest: Some(("/b".into(), 1268)) },
            "points are shared"
        );
        db.upsert_instancer(InstancerDesc {
            prim: prim("/row"),
            prototypes: vec![InstancerPrototype { root: "/a".into(), indices: TypedArray::of(vec![0; 1000]) }],
            translations: Some(TypedArray::of(vec![[0.0_f32; 3]; 1000])),
            ..InstancerDesc::default()
        });
        assert_eq!(db.lent(), LentBytes { bytes: 1288 + 16_000, largest: Some(("/row".into(), 16_000)) });
    }

    /// Numbers that look random.
    fn next(random: &mut u64, below: u64) -> u64 {
        *random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*random >> 33) % below
    }

    #[test]
    fn what_edits_leave_is_what_a_walk_counts() {
        let mut random = 1;
        let arrays: Vec<TypedArray> = (0..12).map(|at| TypedArray::of(vec![[0.5_f32; 3]; at])).collect();
        let mut db = SceneDb::new();
        assert_eq!(db.lent(), LentBytes::default());
        let mut most = 0;
        for step in 0..4000 {
            let path = |random: &mut u64| format!("/g{}/p{}", next(random, 4), next(random, 6));
            let array = |random: &mut u64| arrays[usize::try_from(next(random, 12)).expect("small")].clone();
            let one = prim(&path(&mut random));
            match next(&mut random, 8) {
                0..4 => db.upsert_mesh(MeshDesc { prim: one, points: array(&mut random), ..MeshDesc::default() }),
                4 | 5 => db.upsert_instancer(InstancerDesc {
                    prim: one,
                    translations: Some(array(&mut random)),
                    scales: Some(array(&mut random)),
                    ..InstancerDesc::default()
                }),
                6 => db.remove(&one.path),
                _ if step % 16 == 0 => db.remove(&format!("/g{}", next(&mut random, 4))),
                _ => db.upsert_light(crate::desc::LightDesc { prim: one, ..crate::desc::LightDesc::default() }),
            }
            let lending = db.lending.clone().expect("it is kept");
            assert_eq!(lending, db.count_lent(), "step {step}");
            assert_eq!(db.lent(), lending.lent());
            most = most.max(lending.bytes);
        }
        assert_eq!(most, (1..12).sum::<u64>() * 12, "all arrays were there at some time");
    }
}
