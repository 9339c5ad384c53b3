// SPDX-License-Identifier: Apache-2.0
//! Authored primvars to attributes, triangle by triangle: length checks, indices, replacement of unusable values. Pure.

use super::ptex::FaceCenter;
use super::{AnyAttribute, Attribute, MeshPrimvar, WantedPrimvar};
use crate::array::{ArrayView, ElementType};
use crate::desc::{DroppedData, Interpolation, MeshDesc, Primvar};
use oocpt_abi::{AttributeRate, NAME_PTEX};

/// Where a triangle came from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriangleSource {
    /// Authored face.
    pub(crate) face: u32,
    /// Corners: positions in `face_vertex_indices`, or behind them the points of [`PrimvarLayout::centers`].
    pub(crate) corners: [u32; 3],
}

/// What primvars are spread over.
#[derive(Clone, Copy)]
pub(crate) struct PrimvarLayout<'a> {
    /// Authored faces.
    pub(crate) face_count: usize,
    /// Authored points.
    pub(crate) point_count: usize,
    /// Authored corners.
    pub(crate) corner_count: usize,
    /// Point of each authored corner.
    pub(crate) corners: &'a [u32],
    /// Triangles in the order in which attributes list them.
    pub(crate) sources: &'a [TriangleSource],
    /// Points that are not authored, with the mean of a face's values: corners and points behind the authored ones.
    pub(crate) centers: &'a [FaceCenter],
}

impl PrimvarLayout<'_> {
    /// The point of a corner.
    pub(crate) fn point(&self, corner: u32) -> u32 {
        match (corner as usize).checked_sub(self.corner_count) {
            None => self.corners.get(corner as usize).copied().unwrap_or(0),
            Some(center) => u32::try_from(self.point_count + center).unwrap_or(0),
        }
    }

    /// The authored corners that a corner is the mean of.
    fn parents(&self, corner: u32) -> std::ops::Range<u32> {
        let center = (corner as usize).checked_sub(self.corner_count).and_then(|center| self.centers.get(center));
        center.map_or(corner..corner + 1, |center| center.first..center.first + center.count)
    }
}

/// Values by point with those of [`PrimvarLayout::centers`] behind them.
pub(crate) fn extend_points<T: AttributeValue>(layout: PrimvarLayout<'_>, mut values: Vec<T>) -> Vec<T> {
    values.reserve_exact(layout.centers.len());
    for center in layout.centers {
        let corners = layout.corners.get(center.first as usize..(center.first + center.count) as usize);
        let of_corner = |&point: &u32| values.get(point as usize).copied();
        let mean = T::mean(corners.unwrap_or_default().iter().filter_map(of_corner));
        values.push(mean);
    }
    values
}

/// Where a value of an attribute belongs, for replacements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ValueSlot {
    /// The whole mesh.
    Mesh,
    /// A triangle, in the order of [`PrimvarLayout::sources`].
    Triangle(usize),
    /// A point.
    Point(usize),
}

/// Elements of a primvar, looked up through its indices.
struct PrimvarElements<'a> {
    values: ArrayView<'a>,
    indices: Option<ArrayView<'a>>,
}

impl PrimvarElements<'_> {
    fn len(&self) -> usize {
        self.indices.map_or(self.values.len(), |i| i.len())
    }

    /// Position of element `k` in the values; `None` when its index is unusable.
    fn position(&self, k: usize) -> Option<usize> {
        match self.indices {
            Some(indices) => indices.index(k).and_then(|i| usize::try_from(i).ok()),
            None => Some(k),
        }
    }
}

/// Attribute values and the arrays they can be read from.
pub(crate) trait AttributeValue: Copy {
    /// True when the elements of a (not empty) array have a fitting type.
    fn has_type(values: &ArrayView<'_>) -> bool;
    /// The mean of some values; 0 of none.
    fn mean(values: impl Iterator<Item = Self>) -> Self;
}

impl AttributeValue for f32 {
    fn has_type(values: &ArrayView<'_>) -> bool {
        values.scalar(0).is_some()
    }

    fn mean(values: impl Iterator<Item = Self>) -> Self {
        let [mean] = mean(values.map(|value| [value]));
        mean
    }
}

impl AttributeValue for [f32; 3] {
    fn has_type(values: &ArrayView<'_>) -> bool {
        values.vec3(0).is_some()
    }

    fn mean(values: impl Iterator<Item = Self>) -> Self {
        mean(values)
    }
}

impl AttributeValue for [f32; 2] {
    fn has_type(values: &ArrayView<'_>) -> bool {
        values.vec2(0).is_some()
    }

    fn mean(values: impl Iterator<Item = Self>) -> Self {
        mean(values)
    }
}

impl AttributeValue for [f32; 4] {
    fn has_type(values: &ArrayView<'_>) -> bool {
        values.vec4(0).is_some()
    }

    fn mean(values: impl Iterator<Item = Self>) -> Self {
        mean(values)
    }
}

/// In double precision: the mean of finite numbers is finite.
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn mean<const N: usize>(values: impl Iterator<Item = [f32; N]>) -> [f32; N] {
    let (mut sum, mut count) = ([0.0_f64; N], 0.0_f64);
    for value in values {
        count += 1.0;
        sum.iter_mut().zip(value).for_each(|(sum, value)| *sum += f64::from(value));
    }
    sum.map(|sum| (sum / count.max(1.0)) as f32)
}

/// The primvars `wanted` of `desc` that can be used, whatever their widths; unusable values become 0.
pub(crate) fn convert_wanted(
    desc: &MeshDesc,
    wanted: &[WantedPrimvar],
    layout: PrimvarLayout<'_>,
    dropped: &mut DroppedData,
) -> Vec<MeshPrimvar> {
    let mut out = Vec::new();
    for WantedPrimvar { name, id } in wanted.iter().filter(|wanted| wanted.id != NAME_PTEX) {
        let Some(primvar) = desc.authored_primvar(name) else { continue };
        let view = primvar.values.view();
        let values = if view.vec2(0).is_some() {
            convert(primvar, layout, dropped, |v, i| usable(v.vec2(i)?.to_array()), |_| Some([0.0; 2]))
                .map(AnyAttribute::Two)
        } else if view.vec3(0).is_some() {
            convert(primvar, layout, dropped, |v, i| usable(v.vec3(i)?.to_array()), |_| Some([0.0; 3]))
                .map(AnyAttribute::Three)
        } else if view.vec4(0).is_some() {
            convert(primvar, layout, dropped, |v, i| usable(v.vec4(i)?.to_array()), |_| Some([0.0; 4]))
                .map(AnyAttribute::Four)
        } else {
            let read = |v: &ArrayView<'_>, i: usize| usable([v.scalar(i)?]).map(|[v]| v);
            convert(primvar, layout, dropped, read, |_| Some(0.0)).map(AnyAttribute::One)
        };
        out.extend(values.map(|values| MeshPrimvar { id: *id, values }));
    }
    out
}

/// In single precision, if that is finite.
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn usable<const N: usize>(value: [f64; N]) -> Option<[f32; N]> {
    let value = value.map(|v| v as f32);
    value.iter().all(|v| v.is_finite()).then_some(value)
}

/// Subset number of each triangle of `sources`. Empty without subsets.
pub(crate) fn subset_numbers(desc: &MeshDesc, layout: PrimvarLayout<'_>, dropped: &mut DroppedData) -> Vec<u16> {
    let of_face = subsets_of_faces(desc, layout.face_count, dropped);
    if of_face.is_empty() {
        return Vec::new();
    }
    layout.sources.iter().map(|source| of_face.get(source.face as usize).copied().unwrap_or(0)).collect()
}

/// Subset number of each authored face: 0, or that of the first subset that names it, counted from 1. Empty without
/// subsets.
pub(crate) fn subsets_of_faces(desc: &MeshDesc, face_count: usize, dropped: &mut DroppedData) -> Vec<u16> {
    if desc.subsets.is_empty() {
        return Vec::new();
    }
    let mut of_face = vec![0_u16; face_count];
    for (index, subset) in desc.subsets.iter().enumerate() {
        let view = subset.faces.view();
        let Ok(number) = u16::try_from(index + 1) else {
            dropped.subset_faces += view.len() as u64;
            continue;
        };
        if !view.is_empty() && view.element() != ElementType::I32 {
            dropped.wrong_array_types += 1;
            continue;
        }
        for k in 0..view.len() {
            match view.index(k).and_then(|face| usize::try_from(face).ok()).and_then(|face| of_face.get_mut(face)) {
                Some(slot) if *slot == 0 => *slot = number,
                Some(_) => {}
                None => dropped.subset_faces += 1,
            }
        }
    }
    of_face
}

/// Converts one primvar.
///
/// `read` gives the usable value at a position or `None`; `replacement` gives the value of a slot whose own is
/// unusable, `None` meaning that the whole attribute must go. `None` is returned (and counted) for primvars that cannot
/// be used.
pub(crate) fn convert<T: AttributeValue>(
    primvar: &Primvar,
    layout: PrimvarLayout<'_>,
    dropped: &mut DroppedData,
    read: impl Fn(&ArrayView<'_>, usize) -> Option<T>,
    replacement: impl Fn(ValueSlot) -> Option<T>,
) -> Option<Attribute<T>> {
    let elements =
        PrimvarElements { values: primvar.values.view(), indices: primvar.indices.as_ref().map(|i| i.view()) };
    let (rate, wanted) = match primvar.interpolation {
        Interpolation::Constant => (AttributeRate::Constant, 1),
        Interpolation::Uniform => (AttributeRate::Uniform, layout.face_count),
        Interpolation::Varying | Interpolation::Vertex => (AttributeRate::Vertex, layout.point_count),
        Interpolation::FaceVarying => (AttributeRate::FaceVarying, layout.corner_count),
        Interpolation::Instance => (AttributeRate::Constant, usize::MAX),
    };
    let indexed_by_ints = elements.indices.is_none_or(|i| i.is_empty() || i.element() == ElementType::I32);
    let has_type = elements.values.is_empty() || T::has_type(&elements.values);
    if elements.len() < wanted || !indexed_by_ints || !has_type {
        dropped.primvars += 1;
        return None;
    }
    if elements.len() > wanted && rate != AttributeRate::Constant {
        dropped.long_primvars += 1;
    }
    let mut bad = 0_u64;
    let mut get = |k: usize, slot: ValueSlot| {
        elements.position(k).and_then(|p| read(&elements.values, p)).or_else(|| {
            bad += 1;
            replacement(slot)
        })
    };
    let triangles = || layout.sources.iter().enumerate();
    let values: Option<Vec<T>> = match rate {
        AttributeRate::Constant => get(0, ValueSlot::Mesh).map(|v| vec![v]),
        AttributeRate::Uniform => triangles().map(|(t, s)| get(s.face as usize, ValueSlot::Triangle(t))).collect(),
        AttributeRate::Vertex => {
            let values: Option<Vec<T>> = (0..wanted).map(|p| get(p, ValueSlot::Point(p))).collect();
            values.map(|values| extend_points(layout, values))
        }
        AttributeRate::FaceVarying => triangles()
            .flat_map(|(t, s)| s.corners.map(|c| (t, c)))
            .map(|(t, c)| {
                let parents = layout.parents(c);
                if parents.len() == 1 {
                    return get(parents.start as usize, ValueSlot::Triangle(t));
                }
                let values: Option<Vec<T>> = parents.map(|c| get(c as usize, ValueSlot::Triangle(t))).collect();
                values.map(|values| T::mean(values.into_iter()))
            })
            .collect(),
    };
    dropped.primvar_values += bad;
    if values.is_none() {
        dropped.primvars += 1;
    }
    Some(Attribute { rate, values: values? })
}
