// SPDX-License-Identifier: Apache-2.0
//! Primvars on a control mesh, and on its limit surface. Pure.

use oocpt_subdiv::{FaceVaryingChannel, LimitFacets, PackedValues};

use super::topology::MeshTopology;
use crate::array::{ArrayView, ElementType, TypedArray};
use crate::desc::{DroppedData, Interpolation, MeshDesc, NamedPrimvar, Primvar};

/// Which array of the surface has a value, and where.
#[derive(Clone, Copy)]
enum ValueRate {
    Vertex,
    Varying,
    FaceVarying,
}

/// A primvar that the surface evaluates.
struct EvaluatedPrimvar {
    what: RefinedPrimvar,
    rate: ValueRate,
    /// Floats before it in a value of that rate.
    offset: usize,
    width: usize,
}

/// A primvar of a description.
enum RefinedPrimvar {
    Normals,
    Color,
    Opacity,
    Named(NamedPrimvar),
}

/// Face-varying values.
struct FaceVarying {
    width: usize,
    floats: Vec<f32>,
    corners: Vec<i32>,
}

/// All values of a mesh that its limit surface has to evaluate.
#[derive(Default)]
pub(crate) struct ControlValues {
    evaluated: Vec<EvaluatedPrimvar>,
    /// By point: all vertex primvars, one behind the other.
    vertex: Vec<f32>,
    vertex_width: usize,
    varying: Vec<f32>,
    varying_width: usize,
    face_varying: Vec<FaceVarying>,
    /// Primvars that stay as they are.
    kept: Vec<RefinedPrimvar>,
}

/// Floats of an element, and how to read them.
type ElementReader = fn(&ArrayView<'_>, usize) -> Option<[f64; 4]>;

fn reader(view: &ArrayView<'_>) -> Option<(usize, ElementReader)> {
    if view.vec2(0).is_some() {
        Some((2, |v, i| v.vec2(i).map(|v| [v.x, v.y, 0.0, 0.0])))
    } else if view.vec3(0).is_some() {
        Some((3, |v, i| v.vec3(i).map(|v| [v.x, v.y, v.z, 0.0])))
    } else if view.vec4(0).is_some() {
        Some((4, |v, i| v.vec4(i).map(|v| v.to_array())))
    } else if view.scalar(0).is_some() {
        Some((1, |v, i| v.scalar(i).map(|v| [v, 0.0, 0.0, 0.0])))
    } else {
        None
    }
}

impl ControlValues {
    /// Reads the primvars of `desc` that `reads` tells, and `normals`. `corners` are the authored corners that the
    /// control mesh has.
    pub(crate) fn read(
        desc: &MeshDesc,
        normals: Option<&Primvar>,
        reads: impl Fn(&str) -> bool,
        topology: &MeshTopology,
        corners: &[u32],
        dropped: &mut DroppedData,
    ) -> Self {
        let mut all = Vec::new();
        all.extend(normals.map(|primvar| (RefinedPrimvar::Normals, primvar)));
        all.extend(desc.display_color.as_ref().map(|primvar| (RefinedPrimvar::Color, primvar)));
        all.extend(desc.display_opacity.as_ref().map(|primvar| (RefinedPrimvar::Opacity, primvar)));
        for named in &desc.primvars {
            if reads(&named.name) {
                all.push((RefinedPrimvar::Named(named.clone()), &named.primvar));
            }
        }
        let mut values = Self::default();
        let points = topology.points.len();
        let (mut vertex, mut varying) = (Vec::new(), Vec::new());
        for (what, primvar) in all {
            let list = match primvar.interpolation {
                Interpolation::Vertex => (&mut vertex, ValueRate::Vertex, &mut values.vertex_width),
                Interpolation::Varying => (&mut varying, ValueRate::Varying, &mut values.varying_width),
                Interpolation::FaceVarying => {
                    values.add_face_varying(what, primvar, topology.corners.len(), corners, dropped);
                    continue;
                }
                Interpolation::Constant | Interpolation::Uniform | Interpolation::Instance => {
                    values.kept.push(what);
                    continue;
                }
            };
            match by_point(primvar, points, dropped) {
                Some((width, floats)) => {
                    let (list, rate, total) = list;
                    values.evaluated.push(EvaluatedPrimvar { what, rate, offset: *total, width });
                    *total += width;
                    list.push((width, floats));
                }
                None => dropped.primvars += 1,
            }
        }
        values.vertex = interleaved(&vertex, points);
        values.varying = interleaved(&varying, points);
        values
    }

    fn add_face_varying(
        &mut self,
        what: RefinedPrimvar,
        primvar: &Primvar,
        corner_count: usize,
        corners: &[u32],
        dropped: &mut DroppedData,
    ) {
        let view = primvar.values.view();
        let indices = primvar.indices.as_ref().map(TypedArray::view);
        let count = indices.map_or(view.len(), |indices| indices.len());
        let indexed_by_ints = indices.is_none_or(|i| i.is_empty() || i.element() == ElementType::I32);
        let is_long = count > corner_count;
        let Some((width, read)) = reader(&view).filter(|_| count >= corner_count && indexed_by_ints) else {
            dropped.primvars += 1;
            return;
        };
        dropped.long_primvars += u64::from(is_long);
        let mut floats = Vec::with_capacity((view.len() + 1) * width);
        (0..view.len()).for_each(|at| push(&mut floats, width, read(&view, at), dropped));
        // What has no value of its own has this one.
        let (none, mut unused) = (view.len(), DroppedData::default());
        push(&mut floats, width, None, &mut unused);
        let corner = |&corner: &u32| {
            let at = match indices {
                Some(indices) => indices.index(corner as usize).and_then(|index| usize::try_from(index).ok()),
                None => Some(corner as usize),
            };
            at.filter(|&at| at < none)
        };
        let found: Vec<Option<usize>> = corners.iter().map(corner).collect();
        dropped.primvar_values += found.iter().filter(|at| at.is_none()).count() as u64;
        let numbers = found.into_iter().map(|at| i32::try_from(at.unwrap_or(none)).unwrap_or(0)).collect();
        let offset = self.face_varying.iter().map(|channel| channel.width).sum();
        self.evaluated.push(EvaluatedPrimvar { what, rate: ValueRate::FaceVarying, offset, width });
        self.face_varying.push(FaceVarying { width, floats, corners: numbers });
    }

    /// The topology of face-varying values.
    pub(crate) fn channels(&self) -> Vec<FaceVaryingChannel<'_>> {
        let channel = |c: &'_ FaceVarying| c.floats.len() / c.width;
        self.face_varying.iter().map(|c| FaceVaryingChannel { corners: &c.corners, count: channel(c) }).collect()
    }

    /// Face-varying values.
    pub(crate) fn channel_values(&self) -> Vec<PackedValues<'_>> {
        self.face_varying.iter().map(|c| PackedValues { width: c.width, floats: &c.floats }).collect()
    }

    /// Smooth values by point.
    pub(crate) fn vertex(&self) -> PackedValues<'_> {
        PackedValues { width: self.vertex_width, floats: &self.vertex }
    }

    /// Linear values by point.
    pub(crate) fn varying(&self) -> PackedValues<'_> {
        PackedValues { width: self.varying_width, floats: &self.varying }
    }

    /// `desc` with the values of the limit surface.
    pub(crate) fn replace(self, desc: &MeshDesc, facets: &LimitFacets) -> MeshDesc {
        let mut out = MeshDesc {
            normals: None,
            display_color: None,
            display_opacity: None,
            primvars: Vec::new(),
            ..desc.clone()
        };
        let face_varying_width = self.face_varying.iter().map(|channel| channel.width).sum();
        let kept = self.kept.into_iter().map(|what| (what, None));
        let evaluated = self.evaluated.into_iter().map(|e| {
            let (floats, stride) = match e.rate {
                ValueRate::Vertex => (&facets.vertex, self.vertex_width),
                ValueRate::Varying => (&facets.varying, self.varying_width),
                ValueRate::FaceVarying => (&facets.face_varying, face_varying_width),
            };
            (e.what, Some(column(floats, stride, e.offset, e.width)))
        });
        for (what, values) in kept.chain(evaluated) {
            match (what, values) {
                (RefinedPrimvar::Normals, None) => out.normals.clone_from(&desc.normals),
                (RefinedPrimvar::Color, None) => out.display_color.clone_from(&desc.display_color),
                (RefinedPrimvar::Opacity, None) => out.display_opacity.clone_from(&desc.display_opacity),
                (RefinedPrimvar::Named(named), None) => out.primvars.push(named),
                (RefinedPrimvar::Normals, values) => out.normals = values,
                (RefinedPrimvar::Color, values) => out.display_color = values,
                (RefinedPrimvar::Opacity, values) => out.display_opacity = values,
                (RefinedPrimvar::Named(named), Some(primvar)) => {
                    out.primvars.push(NamedPrimvar { name: named.name, primvar })
                }
            }
        }
        out
    }
}

/// Appends a value; 0 for one that is not finite or not there.
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn push(floats: &mut Vec<f32>, width: usize, value: Option<[f64; 4]>, dropped: &mut DroppedData) {
    let single = value.map(|value| value.map(|v| v as f32)).filter(|value| value.iter().all(|v| v.is_finite()));
    dropped.primvar_values += u64::from(single.is_none());
    floats.extend(single.unwrap_or_default().iter().take(width));
}

/// Width and values of a primvar with a value for each point.
pub(super) fn by_point(primvar: &Primvar, points: usize, dropped: &mut DroppedData) -> Option<(usize, Vec<f32>)> {
    let view = primvar.values.view();
    let indices = primvar.indices.as_ref().map(TypedArray::view);
    let count = indices.map_or(view.len(), |indices| indices.len());
    let indexed_by_ints = indices.is_none_or(|i| i.is_empty() || i.element() == ElementType::I32);
    let (width, read) = reader(&view).filter(|_| count >= points && indexed_by_ints)?;
    dropped.long_primvars += u64::from(count > points);
    let mut floats = Vec::with_capacity(points * width);
    for point in 0..points {
        let at = match indices {
            Some(indices) => indices.index(point).and_then(|index| usize::try_from(index).ok()),
            None => Some(point),
        };
        push(&mut floats, width, at.and_then(|at| read(&view, at)), dropped);
    }
    Some((width, floats))
}

/// Arrays of values by point, point by point.
fn interleaved(arrays: &[(usize, Vec<f32>)], points: usize) -> Vec<f32> {
    let values = |point: usize| arrays.iter().flat_map(move |(width, floats)| &floats[point * width..][..*width]);
    (0..points).flat_map(values).copied().collect()
}

/// One primvar out of many.
fn column(floats: &[f32], stride: usize, offset: usize, width: usize) -> Primvar {
    let values = floats.chunks_exact(stride.max(1)).flat_map(|value| &value[offset..offset + width]);
    primvar_of(width, values.copied().collect())
}

/// A primvar with a value of `width` floats (1 to 4) for each point.
pub(super) fn primvar_of(width: usize, values: Vec<f32>) -> Primvar {
    let element = match width {
        1 => ElementType::F32,
        2 => ElementType::Vec2f,
        3 => ElementType::Vec3f,
        _ => ElementType::Vec4f,
    };
    let values = TypedArray::from_vec(element, values).unwrap_or_else(|_odd| TypedArray::of(Vec::<f32>::new()));
    Primvar { interpolation: Interpolation::Vertex, values, indices: None }
}
