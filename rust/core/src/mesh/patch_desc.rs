// SPDX-License-Identifier: Apache-2.0
//! Takes a patch and its rings out of a description: a small mesh with numbers of its own. Pure.

use rustc_hash::FxHashSet;

use super::creases::CreaseSharpness;
use super::demand::BuildDemand;
use super::patches::MeshPatches;
use crate::array::TypedArray;
use crate::desc::{DroppedData, Interpolation, MeshDesc, NamedPrimvar, Primvar, SubdivisionTags, SubsetDesc};

/// A patch with its rings, as a mesh.
pub(super) struct PatchDesc {
    pub(super) desc: MeshDesc,
    /// Authored number of each face.
    pub(super) faces: Vec<u32>,
    /// The ring of each face; 0 for the patch's own.
    pub(super) rings: Vec<u8>,
}

/// Numbers of the elements of a patch in the whole mesh.
struct PatchElements<'a> {
    faces: &'a [u32],
    corners: Vec<u32>,
    /// Ascending.
    points: Vec<u32>,
}

impl PatchElements<'_> {
    fn point(&self, authored: u32) -> Option<i32> {
        self.points.binary_search(&authored).ok().and_then(|at| i32::try_from(at).ok())
    }

    fn places(&self, interpolation: Interpolation) -> Option<&[u32]> {
        match interpolation {
            Interpolation::Uniform => Some(self.faces),
            Interpolation::Vertex | Interpolation::Varying => Some(&self.points),
            Interpolation::FaceVarying => Some(&self.corners),
            Interpolation::Constant | Interpolation::Instance => None,
        }
    }

    fn primvar(&self, primvar: &Primvar) -> Option<Primvar> {
        let Some(places) = self.places(primvar.interpolation) else { return Some(primvar.clone()) };
        let Some(indices) = primvar.indices.as_ref().filter(|indices| !indices.is_empty()) else {
            return Some(Primvar { values: gathered(&primvar.values, places)?, indices: None, ..primvar.clone() });
        };
        let authored = |place: &u32| indices.index(*place as usize).and_then(|index| u32::try_from(index).ok());
        let authored: Vec<u32> = places.iter().map(authored).collect::<Option<_>>()?;
        let mut used = authored.clone();
        used.sort_unstable();
        used.dedup();
        let own = |index: &u32| used.binary_search(index).ok().and_then(|at| i32::try_from(at).ok());
        let own: Vec<i32> = authored.iter().map(own).collect::<Option<_>>()?;
        let values = gathered(&primvar.values, &used)?;
        Some(Primvar { values, indices: Some(TypedArray::of(own)), ..primvar.clone() })
    }

    fn optional(&self, primvar: Option<&Primvar>) -> Option<Option<Primvar>> {
        match primvar {
            Some(primvar) => Some(Some(self.primvar(primvar)?)),
            None => Some(None),
        }
    }

    /// Creases and corners between the patch's points.
    fn tags(&self, tags: &SubdivisionTags, point_count: usize) -> SubdivisionTags {
        let all = CreaseSharpness::read(tags, point_count, &mut DroppedData::default());
        let point = |authored: i32| u32::try_from(authored).ok().and_then(|authored| self.point(authored));
        let (mut pairs, mut pair_weights) = (Vec::new(), Vec::new());
        for ([a, b], weight) in all.crease_pairs.as_chunks::<2>().0.iter().zip(&all.crease_weights) {
            if let (Some(a), Some(b)) = (point(*a), point(*b)) {
                pairs.extend([a, b]);
                pair_weights.push(*weight);
            }
        }
        let (mut corners, mut corner_weights) = (Vec::new(), Vec::new());
        for (corner, weight) in all.corner_points.iter().zip(&all.corner_weights) {
            if let Some(corner) = point(*corner) {
                corners.push(corner);
                corner_weights.push(*weight);
            }
        }
        SubdivisionTags {
            crease_lengths: Some(TypedArray::of(vec![2_i32; pair_weights.len()])),
            crease_indices: Some(TypedArray::of(pairs)),
            crease_sharpnesses: Some(TypedArray::of(pair_weights)),
            corner_indices: Some(TypedArray::of(corners)),
            corner_sharpnesses: Some(TypedArray::of(corner_weights)),
            ..tags.clone()
        }
    }
}

impl PatchDesc {
    /// Patch `number` of `desc`. Faces farther away than `ring` become holes: they only shape the surface of others.
    /// `None` if the arrays are not those that the patches were made for.
    pub(super) fn take(
        desc: &MeshDesc,
        demand: &BuildDemand<'_>,
        all: &MeshPatches,
        number: usize,
        ring: u8,
    ) -> Option<Self> {
        let patch = all.patches.get(number)?;
        let chosen = patch.faces.iter().zip(&patch.rings).filter(|(_, at)| **at <= ring + 1);
        let (faces, rings): (Vec<u32>, Vec<u8>) = chosen.unzip();
        let corners: Vec<u32> =
            faces.iter().flat_map(|face| all.corners(*face).0).map(u32::try_from).collect::<Result<_, _>>().ok()?;
        let indices = desc.face_vertex_indices.view();
        let authored = |corner: &u32| indices.index(*corner as usize).map(i32::cast_unsigned);
        let authored: Vec<u32> = corners.iter().map(authored).collect::<Option<_>>()?;
        let mut points = authored.clone();
        points.sort_unstable();
        points.dedup();
        let elements = PatchElements { faces: &faces, corners, points };
        let own: Vec<i32> = authored.iter().map(|point| elements.point(*point)).collect::<Option<_>>()?;
        let named = |named: &NamedPrimvar| {
            let primvar = elements.primvar(&named.primvar)?;
            Some(NamedPrimvar { name: named.name.clone(), primvar })
        };
        let read = desc.primvars.iter().filter(|named| demand.reads(&named.name));
        let out = MeshDesc {
            face_vertex_counts: gathered(&desc.face_vertex_counts, &faces)?,
            face_vertex_indices: TypedArray::of(own),
            hole_indices: Some(TypedArray::of(holes(desc, &faces, &rings, ring))),
            points: gathered(&desc.points, &elements.points)?,
            subdivision_tags: elements.tags(&desc.subdivision_tags, desc.points.len()),
            normals: elements.optional(desc.normals.as_ref())?,
            display_color: elements.optional(desc.display_color.as_ref())?,
            display_opacity: elements.optional(desc.display_opacity.as_ref())?,
            primvars: read.map(named).collect::<Option<_>>()?,
            subsets: desc.subsets.iter().map(|subset| subset_of(subset, &faces)).collect(),
            ..desc.clone()
        };
        Some(Self { desc: out, faces, rings })
    }
}

/// The holes of a patch, as its own numbers: authored ones, and faces beyond a ring.
fn holes(desc: &MeshDesc, faces: &[u32], rings: &[u8], ring: u8) -> Vec<i32> {
    let authored: FxHashSet<i32> = desc
        .hole_indices
        .as_ref()
        .map(|holes| (0..holes.len()).filter_map(|at| holes.index(at)).collect())
        .unwrap_or_default();
    let is_hole = |(face, at): (&u32, &u8)| *at > ring || authored.contains(&face.cast_signed());
    let found = (0..).zip(faces.iter().zip(rings)).filter(|(_, face)| is_hole(*face));
    found.map(|(number, _)| number).collect()
}

fn subset_of(subset: &SubsetDesc, faces: &[u32]) -> SubsetDesc {
    let own = |at: usize| {
        let face = subset.faces.index(at).and_then(|face| u32::try_from(face).ok())?;
        faces.binary_search(&face).ok().and_then(|at| i32::try_from(at).ok())
    };
    let faces: Vec<i32> = (0..subset.faces.len()).filter_map(own).collect();
    SubsetDesc { faces: TypedArray::of(faces), ..subset.clone() }
}

/// The elements of an array at some places; `None` if there is none at one of them.
fn gathered(array: &TypedArray, places: &[u32]) -> Option<TypedArray> {
    let (size, view) = (array.element().size(), array.view());
    let mut bytes: Vec<u8> = Vec::with_capacity(places.len() * size);
    for place in places {
        let start = *place as usize * size;
        bytes.extend_from_slice(view.bytes().get(start..start + size)?);
    }
    TypedArray::from_vec(array.element(), bytes).ok()
}
