// SPDX-License-Identifier: Apache-2.0
//! Turns the plain structs that cross the boundary into the core's descriptions.
//!
//! Pure; any thread. A part whose bytes make no sense is left out and named in [`ConversionWarnings`]; the rest of the
//! prim lives.

pub(crate) mod motion;
pub(crate) mod product;
pub(crate) mod request;
mod solid;

use crate::ffi;
use crate::held::typed_array;
use cxx::UniquePtr;
use oocpt_abi::PrimMask;
use oocpt_core::array::{ArrayElement, TypedArray, column_matrix};
use oocpt_core::desc::{
    BoundaryRule, CurveBasis, CurveWrap, CurvesDesc, FaceVaryingLinear, PrimShape, TriangleRule, read_prim_mask,
};
use oocpt_core::scene::{
    AssetRef, InstanceLinks, InstancedBy, InstancerDesc, InstancerPrototype, Interpolation, MeshDesc, NamedPrimvar,
    PrimDesc, Primvar, SceneWarning, Subdivision, SubdivisionTags, SubsetDesc,
};
use std::fmt::Debug;
use std::sync::Arc;

/// The parts of prims that were left out: "part: reason".
#[derive(Debug, Default)]
pub(crate) struct ConversionWarnings(pub(crate) Vec<SceneWarning>);

impl ConversionWarnings {
    pub(crate) fn add(&mut self, path: &str, part: &str, reason: &str) {
        self.0.push(SceneWarning::of_notes(path.into(), vec![format!("{part}: {reason}")]));
    }

    pub(crate) fn optional(&mut self, path: &str, part: &str, held: UniquePtr<ffi::HeldArray>) -> Option<TypedArray> {
        match typed_array(held)? {
            Ok(array) => Some(array),
            Err(reason) => {
                self.add(path, part, &reason);
                None
            }
        }
    }

    /// An array that a prim cannot do without; a missing one becomes an empty one.
    fn required<T: ArrayElement + Debug>(
        &mut self,
        path: &str,
        part: &str,
        held: UniquePtr<ffi::HeldArray>,
    ) -> TypedArray {
        self.optional(path, part, held).unwrap_or_else(|| TypedArray::of(Vec::<T>::new()))
    }

    fn primvar(&mut self, path: &str, part: &str, desc: ffi::PrimvarDesc) -> Option<Primvar> {
        let values = self.optional(path, part, desc.values)?;
        let indexed = !desc.indices.is_null();
        let indices = self.optional(path, part, desc.indices);
        if indexed && indices.is_none() {
            return None;
        }
        let Some(interpolation) = interpolation(desc.interpolation) else {
            self.add(path, part, "unknown interpolation");
            return None;
        };
        Some(Primvar { interpolation, values, indices })
    }

    fn primvars(&mut self, path: &str, descs: Vec<ffi::NamedPrimvarDesc>) -> Vec<NamedPrimvar> {
        let named = |desc: ffi::NamedPrimvarDesc| {
            let primvar = self.primvar(path, &desc.name, desc.primvar)?;
            Some(NamedPrimvar { name: Arc::from(desc.name), primvar })
        };
        descs.into_iter().filter_map(named).collect()
    }

    /// What a prim does without: what its primvars say, and the render pass.
    fn mask(&mut self, path: &str, primvars: &[ffi::RayPrimvarDesc], (hides, is_matte): (bool, bool)) -> PrimMask {
        let texts: Vec<_> = primvars.iter().map(|given| (&*given.name, &*given.value)).collect();
        let (mut mask, problems) = read_prim_mask(&texts);
        for (name, problem) in problems {
            self.add(path, name, &problem);
        }
        mask.set(PrimMask::NO_CAMERA, hides || mask.contains(PrimMask::NO_CAMERA));
        mask.set(PrimMask::MATTE, is_matte || mask.contains(PrimMask::MATTE));
        mask
    }

    fn subdivision_tags(&mut self, path: &str, desc: ffi::SubdivisionDesc) -> SubdivisionTags {
        SubdivisionTags {
            boundary: match desc.boundary {
                0 => BoundaryRule::None,
                1 => BoundaryRule::EdgeOnly,
                _ => BoundaryRule::EdgeAndCorner,
            },
            face_varying: match desc.face_varying {
                0 => FaceVaryingLinear::None,
                1 => FaceVaryingLinear::CornersOnly,
                3 => FaceVaryingLinear::CornersPlus2,
                4 => FaceVaryingLinear::Boundaries,
                5 => FaceVaryingLinear::All,
                _ => FaceVaryingLinear::CornersPlus1,
            },
            triangles: if desc.smooth_triangles { TriangleRule::Smooth } else { TriangleRule::CatmullClark },
            crease_indices: self.optional(path, "creaseIndices", desc.crease_indices),
            crease_lengths: self.optional(path, "creaseLengths", desc.crease_lengths),
            crease_sharpnesses: self.optional(path, "creaseSharpnesses", desc.crease_sharpnesses),
            corner_indices: self.optional(path, "cornerIndices", desc.corner_indices),
            corner_sharpnesses: self.optional(path, "cornerSharpnesses", desc.corner_sharpnesses),
            ..SubdivisionTags::default()
        }
    }

    fn shape(&mut self, path: &str, desc: ffi::ShapeDesc) -> PrimShape {
        match desc.kind {
            1 => PrimShape::Curves(CurvesDesc {
                basis: match desc.basis {
                    0 => CurveBasis::Linear,
                    2 => CurveBasis::BSpline,
                    3 => CurveBasis::CatmullRom,
                    _ => CurveBasis::Bezier,
                },
                wrap: match desc.wrap {
                    1 => CurveWrap::Periodic,
                    2 => CurveWrap::Pinned,
                    3 => CurveWrap::Segmented,
                    _ => CurveWrap::Nonperiodic,
                },
                counts: self.required::<i32>(path, "curveVertexCounts", desc.counts),
                indices: self.optional(path, "curveIndices", desc.indices),
            }),
            2 => PrimShape::Points,
            _ => PrimShape::Mesh,
        }
    }

    fn subsets(&mut self, descs: Vec<ffi::SubsetDesc>) -> Vec<SubsetDesc> {
        let subset = |desc: ffi::SubsetDesc| {
            let faces = self.optional(&desc.path, "indices", desc.faces)?;
            Some(SubsetDesc { path: Arc::from(desc.path), material: optional_text(desc.material), faces })
        };
        descs.into_iter().filter_map(subset).collect()
    }
}

/// The text; `None` if it is empty.
pub(crate) fn optional_text(text: String) -> Option<Arc<str>> {
    (!text.is_empty()).then(|| Arc::from(text))
}

/// A file; `None` if the scene names none.
pub(crate) fn asset(desc: ffi::AssetDesc) -> Option<AssetRef> {
    let is_named = !(desc.authored.is_empty() && desc.resolved.is_empty());
    is_named.then(|| AssetRef { authored: Arc::from(desc.authored), resolved: Arc::from(desc.resolved) })
}

fn interpolation(tag: ffi::InterpolationTag) -> Option<Interpolation> {
    Some(match tag {
        ffi::InterpolationTag::Constant => Interpolation::Constant,
        ffi::InterpolationTag::Uniform => Interpolation::Uniform,
        ffi::InterpolationTag::Varying => Interpolation::Varying,
        ffi::InterpolationTag::Vertex => Interpolation::Vertex,
        ffi::InterpolationTag::FaceVarying => Interpolation::FaceVarying,
        ffi::InterpolationTag::Instance => Interpolation::Instance,
        _ => return None,
    })
}

fn subdivision(scheme: u8) -> Subdivision {
    match scheme {
        1 => Subdivision::Bilinear,
        2 => Subdivision::CatmullClark,
        3 => Subdivision::Loop,
        _ => Subdivision::None,
    }
}

/// The description that every prim has.
pub(crate) fn prim(desc: ffi::PrimDesc) -> PrimDesc {
    PrimDesc {
        path: Arc::from(desc.path),
        transform: column_matrix(&desc.transform),
        motion: motion::transform_samples(&desc.motion),
        visible: desc.visible,
        purpose: Arc::from(desc.purpose),
        instanced_by: desc
            .instanced_by
            .into_iter()
            .map(|by| InstancedBy { instancer: Arc::from(by.instancer), prototype_root: Arc::from(by.prototype_root) })
            .collect(),
    }
}

/// The core's mesh. Missing topology or points become empty arrays, about which the core warns.
pub(crate) fn mesh(desc: ffi::MeshDesc, complaints: &mut ConversionWarnings) -> MeshDesc {
    let prim = prim(desc.prim);
    let path = Arc::clone(&prim.path);
    let solid = complaints.solid(&path, &desc.shape);
    MeshDesc {
        prim,
        prim_id: desc.prim_id,
        double_sided: desc.double_sided,
        left_handed: desc.left_handed,
        subdivision: subdivision(desc.subdivision.scheme),
        refine_level: desc.subdivision.refine_level,
        subdivision_tags: complaints.subdivision_tags(&path, desc.subdivision),
        face_vertex_counts: complaints.required::<i32>(&path, "faceVertexCounts", desc.face_vertex_counts),
        face_vertex_indices: complaints.required::<i32>(&path, "faceVertexIndices", desc.face_vertex_indices),
        hole_indices: complaints.optional(&path, "holeIndices", desc.hole_indices),
        points: complaints.required::<[f32; 3]>(&path, "points", desc.points),
        point_motion: motion::points_motion(desc.point_motion, &path, complaints),
        solid,
        shape: complaints.shape(&path, desc.shape),
        widths: complaints.primvar(&path, "widths", desc.widths),
        normals: complaints.primvar(&path, "normals", desc.normals),
        display_color: complaints.primvar(&path, "displayColor", desc.display_color),
        display_opacity: complaints.primvar(&path, "displayOpacity", desc.display_opacity),
        primvars: complaints.primvars(&path, desc.primvars),
        material: optional_text(desc.material),
        subsets: complaints.subsets(desc.subsets),
        categories: desc.categories.into_iter().map(Arc::from).collect(),
        label: optional_text(desc.label),
        mask: complaints.mask(&path, &desc.ray_primvars, (desc.pass_hides, desc.pass_is_matte)),
    }
}

/// Sets of categories from all their names, set by set. Sizes beyond the names give smaller sets.
fn link_sets(names: Vec<String>, sizes: &[u32]) -> Vec<Vec<Arc<str>>> {
    let mut names = names.into_iter().map(Arc::from);
    sizes.iter().map(|size| names.by_ref().take(*size as usize).collect()).collect()
}

/// The core's instancer. A prototype without usable indices stays, with no instances.
pub(crate) fn instancer(desc: ffi::InstancerDesc, complaints: &mut ConversionWarnings) -> InstancerDesc {
    let prim = prim(desc.prim);
    let path = Arc::clone(&prim.path);
    let prototypes = desc
        .prototypes
        .into_iter()
        .map(|prototype| InstancerPrototype {
            indices: complaints.required::<i32>(&path, "instanceIndices", prototype.indices),
            root: Arc::from(prototype.root),
        })
        .collect();
    InstancerDesc {
        prim,
        prototypes,
        mask: complaints.optional(&path, "mask", desc.mask),
        translations: complaints.optional(&path, "instanceTranslations", desc.translations),
        rotations: complaints.optional(&path, "instanceRotations", desc.rotations),
        scales: complaints.optional(&path, "instanceScales", desc.scales),
        transforms: complaints.optional(&path, "instanceTransforms", desc.transforms),
        motion: motion::instancer_motion(desc.motion, &path, complaints),
        primvars: complaints.primvars(&path, desc.primvars),
        links: Arc::new(InstanceLinks {
            sets: link_sets(desc.link_names, &desc.link_sizes),
            of: Some(desc.links).filter(|links| !links.is_empty()),
        }),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use glam::DVec3;

    fn floats(values: &[f32]) -> UniquePtr<ffi::HeldArray> {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
        ffi::copy_array(ffi::ElementTag::Vec3f, &bytes)
    }

    fn ints(values: &[i32]) -> UniquePtr<ffi::HeldArray> {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
        ffi::copy_array(ffi::ElementTag::I32, &bytes)
    }

    fn no_primvar() -> ffi::PrimvarDesc {
        ffi::PrimvarDesc {
            interpolation: ffi::InterpolationTag::Constant,
            values: UniquePtr::null(),
            indices: UniquePtr::null(),
        }
    }

    pub(super) fn no_shape() -> ffi::ShapeDesc {
        ffi::ShapeDesc {
            kind: 0,
            basis: 0,
            wrap: 0,
            counts: UniquePtr::null(),
            indices: UniquePtr::null(),
            solid: Vec::new(),
        }
    }

    pub(crate) fn prim_desc() -> ffi::PrimDesc {
        let mut transform = [0.0; 16];
        for diagonal in 0..4 {
            transform[5 * diagonal] = 1.0;
        }
        transform[12..15].copy_from_slice(&[10.0, 20.0, 30.0]);
        ffi::PrimDesc {
            path: "/World/mesh".into(),
            transform,
            motion: Vec::new(),
            visible: true,
            purpose: "render".into(),
            instanced_by: vec![ffi::InstancedByDesc { instancer: "/I".into(), prototype_root: "/I/P".into() }],
        }
    }

    pub(super) fn mesh_desc() -> ffi::MeshDesc {
        ffi::MeshDesc {
            prim: prim_desc(),
            prim_id: 7,
            double_sided: true,
            left_handed: false,
            subdivision: ffi::SubdivisionDesc {
                scheme: 3,
                refine_level: 3,
                boundary: 1,
                face_varying: 4,
                smooth_triangles: true,
                crease_indices: ints(&[0, 1]),
                crease_lengths: ints(&[2]),
                crease_sharpnesses: UniquePtr::null(),
                corner_indices: UniquePtr::null(),
                corner_sharpnesses: UniquePtr::null(),
            },
            face_vertex_counts: ints(&[3]),
            face_vertex_indices: ints(&[0, 1, 2]),
            hole_indices: UniquePtr::null(),
            points: floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.5, 0.0]),
            point_motion: ffi::MotionDesc {
                samples: Vec::new(),
                velocities: floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.5, 0.0]),
                accelerations: UniquePtr::null(),
                angular_velocities: UniquePtr::null(),
                seconds: [0.0, 0.5],
            },
            shape: ffi::ShapeDesc { kind: 1, basis: 2, wrap: 2, counts: ints(&[3]), ..no_shape() },
            widths: no_primvar(),
            normals: no_primvar(),
            display_color: no_primvar(),
            display_opacity: no_primvar(),
            primvars: Vec::new(),
            material: String::new(),
            subsets: Vec::new(),
            categories: Vec::new(),
            label: String::new(),
            ray_primvars: Vec::new(),
            pass_hides: false,
            pass_is_matte: false,
        }
    }

    #[test]
    fn a_mesh_is_converted_without_copying_its_points() {
        let desc = mesh_desc();
        let address = desc.points.as_ref().expect("points are there").bytes().as_ptr() as usize;
        let mut complaints = ConversionWarnings::default();
        let mesh = mesh(desc, &mut complaints);
        assert!(complaints.0.is_empty(), "nothing is wrong with this mesh: {:?}", complaints.0);
        assert_eq!(mesh.points.identity().0, address, "the points must be borrowed, not copied");
        assert_eq!(mesh.points.vec3(2), Some(DVec3::new(0.0, 1.5, 0.0)), "the third point");
        assert_eq!(mesh.face_vertex_indices.index(2), Some(2), "the third index");
        assert_eq!((mesh.prim_id, mesh.subdivision), (7, Subdivision::Loop), "plain members");
        let tags = &mesh.subdivision_tags;
        assert_eq!(
            (tags.boundary, tags.face_varying),
            (BoundaryRule::EdgeOnly, FaceVaryingLinear::Boundaries),
            "rules"
        );
        assert_eq!((tags.triangles, mesh.refine_level), (TriangleRule::Smooth, 3), "rule of triangles, level");
        let PrimShape::Curves(curves) = &mesh.shape else { panic!("curves stay curves") };
        assert_eq!((curves.basis, curves.wrap), (CurveBasis::BSpline, CurveWrap::Pinned), "basis and wrap");
        assert!(curves.counts.len() == 1 && curves.indices.is_none() && mesh.widths.is_none(), "arrays of curves");
        let creases = [&tags.crease_indices, &tags.crease_lengths, &tags.crease_sharpnesses].map(Option::is_some);
        assert_eq!(creases, [true, true, false], "null means absent");
        assert_eq!(&*mesh.prim.instanced_by[0].prototype_root, "/I/P", "the prototype root");
        assert!(mesh.hole_indices.is_none() && mesh.normals.is_none(), "null means absent");
    }

    #[test]
    fn category_sets_are_distinguished() {
        let names = || ["a", "b", "c"].map(String::from).to_vec();
        let found = |sizes: &[u32]| -> Vec<usize> { link_sets(names(), sizes).iter().map(Vec::len).collect() };
        assert_eq!(found(&[0, 2, 1]), [0, 2, 1], "as they came");
        assert_eq!(link_sets(names(), &[0, 2, 1])[2], [Arc::from("c")], "in order");
        assert_eq!(found(&[2, 7]), [2, 1], "no more than there are");
    }

    #[test]
    fn a_gf_matrix_becomes_the_column_vector_matrix() {
        let matrix = column_matrix(&prim_desc().transform);
        let moved = matrix.transform_point3(DVec3::new(1.0, 0.0, 0.0));
        assert_eq!(moved, DVec3::new(11.0, 20.0, 30.0), "the translation of a Gf matrix is its last row");
        let transform = prim_desc().transform.map(|v| 2.0 * v);
        let placed = prim(ffi::PrimDesc { transform, ..prim_desc() });
        assert_eq!(placed.transform, matrix, "points are homogeneous");
    }

    #[test]
    fn bytes_that_do_not_divide_into_elements_drop_that_part_only() {
        let mut desc = mesh_desc();
        desc.display_color = ffi::PrimvarDesc {
            interpolation: ffi::InterpolationTag::Vertex,
            values: ffi::copy_array(ffi::ElementTag::Vec3f, &[0; 13]),
            indices: UniquePtr::null(),
        };
        let mut complaints = ConversionWarnings::default();
        let mesh = mesh(desc, &mut complaints);
        assert!(mesh.display_color.is_none(), "13 bytes are not vectors");
        assert_eq!(mesh.points.len(), 3, "the points must survive");
        assert_eq!(complaints.0.len(), 1, "one complaint: {:?}", complaints.0);
        let SceneWarning { path, message, .. } = &complaints.0[0];
        assert!(&**path == "/World/mesh" && message.starts_with("displayColor: "), "{path}: {message}");
    }

    #[test]
    fn an_indexed_primvar_keeps_its_indices_and_falls_with_them() {
        let primvar = |indices| ffi::PrimvarDesc {
            interpolation: ffi::InterpolationTag::FaceVarying,
            values: floats(&[0.0, 0.0, 1.0]),
            indices,
        };
        let mut complaints = ConversionWarnings::default();
        let good = complaints.primvar("/m", "normals", primvar(ints(&[0, 0, 0]))).expect("a good primvar");
        assert_eq!(good.indices.map(|indices| indices.len()), Some(3), "the indices");
        let bad = complaints.primvar("/m", "normals", primvar(ffi::copy_array(ffi::ElementTag::I32, &[1, 2, 3])));
        assert!(bad.is_none(), "values without their indices would be misread");
        assert_eq!(complaints.0.len(), 1, "one complaint: {:?}", complaints.0);
    }

    #[test]
    fn primvars_subsets_and_bindings_arrive_by_name() {
        let mut desc = mesh_desc();
        let primvar = |values| ffi::PrimvarDesc {
            interpolation: ffi::InterpolationTag::FaceVarying,
            values,
            indices: UniquePtr::null(),
        };
        desc.primvars = vec![
            ffi::NamedPrimvarDesc { name: "st".into(), primvar: primvar(floats(&[0.0, 1.0, 2.0])) },
            ffi::NamedPrimvarDesc {
                name: "bad".into(),
                primvar: primvar(ffi::copy_array(ffi::ElementTag::Vec3f, &[0; 13])),
            },
        ];
        desc.material = "/Looks/Red".into();
        desc.subsets = vec![
            ffi::SubsetDesc { path: "/m/a".into(), material: "/Looks/Blue".into(), faces: ints(&[0]) },
            ffi::SubsetDesc { path: "/m/b".into(), material: "/Looks/Blue".into(), faces: UniquePtr::null() },
        ];
        desc.categories = vec!["c".into()];
        desc.label = "skin".into();
        let mut complaints = ConversionWarnings::default();
        let mesh = mesh(desc, &mut complaints);
        let names: Vec<&str> = mesh.primvars.iter().map(|primvar| &*primvar.name).collect();
        assert_eq!(names, ["st"], "what cannot be read is left out");
        assert_eq!(complaints.0.len(), 1, "and named: {:?}", complaints.0);
        assert!(complaints.0[0].message.starts_with("bad: "), "{:?}", complaints.0[0]);
        assert_eq!(mesh.material.as_deref(), Some("/Looks/Red"), "the binding");
        assert_eq!(mesh.subsets.len(), 1, "a subset without faces is none");
        assert_eq!(mesh.subsets[0].faces.index(0), Some(0), "its face");
        assert_eq!(&*mesh.categories[0], "c", "categories");
        assert_eq!(mesh.label.as_deref(), Some("skin"), "the label");
    }
}
