// SPDX-License-Identifier: Apache-2.0
//! Curves and points: round things ([`LeafKind::Rounds`], [`LeafKind::Points`]), or ribbons of triangles. Pure.
//!
//! [`basis`] says how control points make a curve, [`curves`] cuts curves into pieces, [`values`] brings primvars
//! along, [`posed`] says where they are at other times. A piece of a tube is the hull of the balls at its ends, so
//! pieces fit without a gap, and linear curves are exact. A piece of a cubic curve is straight: [`curves`] says how far
//! it is from the curve. A point is a ball, a piece of no length. What has no widths is [`lines`].

mod basis;
mod curves;
mod lines;
mod posed;
mod values;

use glam::Vec3;

use super::{ItemVertices, LeafItems, LeafKind, point};
use crate::array::ArrayView;
use crate::desc::{CurvesDesc, DroppedData, Interpolation, MeshDesc, NamedPrimvar, Primvar};
use crate::material::ACROSS_NAME;
use crate::mesh::deform::PointsPose;
use crate::mesh::dicing::DicingRate;
use crate::mesh::refine_values::primvar_of;
use crate::mesh::topology::{MAX_COORDINATE, MAX_CORNERS, MeshFace, MeshTopology};
use crate::mesh::{Aabb, WantedPrimvar};
use curves::CutCurves;
pub(in crate::mesh) use lines::is_of_lines;
use lines::{LineWidths, usable_widths};
use posed::RibbonPoints;

pub(in crate::mesh) fn bounds(&[first, second, [from, to, _]]: &ItemVertices) -> Aabb {
    ball_box(first, from).union(&ball_box(second, to))
}

/// The box around a ball, rounded outwards.
fn ball_box(center: [f32; 3], radius: f32) -> Aabb {
    Aabb { min: center.map(|v| (v - radius).next_down()), max: center.map(|v| (v + radius).next_up()) }
}

pub(in crate::mesh) fn vertices([first, second, _]: ItemVertices, [from, to, _]: [f32; 3]) -> ItemVertices {
    [first, second, [from, to, 0.0]]
}

/// The points of `desc`, unless they cannot be used.
fn usable_points<'a>(desc: &'a MeshDesc, dropped: &mut DroppedData) -> Option<ArrayView<'a>> {
    let view = desc.points.view();
    let is_usable = view.is_empty() || view.vec3(0).is_some();
    dropped.wrong_array_types += u64::from(!is_usable);
    dropped.oversized_meshes += u64::from(view.len() > MAX_CORNERS / 4);
    (is_usable && view.len() <= MAX_CORNERS / 4).then_some(view)
}

/// Points that curves are cut at, or somewhat more.
pub(in crate::mesh) fn curve_points(desc: &MeshDesc, curves: &CurvesDesc, dicing: &DicingRate) -> u64 {
    usable_points(desc, &mut DroppedData::default()).map_or(0, |_| CutCurves::count(desc, curves, dicing))
}

/// An item for each piece, or two of a ribbon, with the number of its curve.
pub(super) fn read_curves(
    desc: &MeshDesc,
    curves: &CurvesDesc,
    wanted: &[WantedPrimvar],
    dicing: &DicingRate,
    poses: &[PointsPose],
    dropped: &mut DroppedData,
) -> LeafItems {
    if usable_points(desc, dropped).is_none() {
        return nothing(desc);
    }
    let cut = CutCurves::new(desc, curves, dicing, !poses.is_empty(), dropped);
    match cut.ribbon(desc, dropped) {
        Some(ribbon) => {
            let poses = poses.iter().filter_map(|pose| cut.ribbon_at(desc, pose)).collect();
            LeafItems { poses, ..as_ribbons(desc, wanted, &cut, &ribbon, dropped) }
        }
        None => as_tubes(desc, wanted, cut, poses, dropped),
    }
}

fn nothing(desc: &MeshDesc) -> LeafItems {
    LeafItems {
        topology: MeshTopology::default(),
        desc: desc.clone(),
        kind: LeafKind::Rounds,
        radii: Vec::new(),
        poses: Vec::new(),
    }
}

/// A usable width.
pub(in crate::mesh) fn is_width(width: f64) -> bool {
    (0.0..=MAX_COORDINATE).contains(&width)
}

/// Balls, an item for each point.
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
pub(super) fn read_points(
    desc: &MeshDesc,
    dicing: &DicingRate,
    poses: &[PointsPose],
    dropped: &mut DroppedData,
) -> LeafItems {
    let Some(view) = usable_points(desc, dropped) else { return nothing(desc) };
    let widths = PointWidths::of_points(desc, dicing, dropped);
    let poses: Vec<PointsPose> = poses.iter().map(|pose| widened(desc, pose, view.len())).collect();
    let (mut topology, mut radii) = (MeshTopology { face_count: view.len(), ..MeshTopology::default() }, Vec::new());
    for (at, index) in (0..view.len()).zip(0_u32..) {
        let place = point(&view, at);
        let width = widths.at(at, place.unwrap_or_default());
        radii.push((0.5 * width) as f32);
        topology.points.push(place.unwrap_or_default());
        if place.is_none() || !is_width(width) {
            dropped.points += 1;
        } else if width > 0.0 || poses.iter().any(|pose| has_width(pose, at)) {
            let first = u32::try_from(topology.corners.len()).unwrap_or(u32::MAX);
            topology.faces.push(MeshFace { index, first, count: 3, is_hole: false });
            topology.corners.extend([index; 3]);
        }
    }
    // "Uniform" is one value for all points.
    let constant = |primvar: &Option<Primvar>| {
        primvar.clone().map(|primvar| match primvar.interpolation {
            Interpolation::Uniform => Primvar { interpolation: Interpolation::Constant, ..primvar },
            _ => primvar,
        })
    };
    let mut desc = MeshDesc { normals: None, ..desc.clone() };
    desc.display_color = constant(&desc.display_color);
    desc.display_opacity = constant(&desc.display_opacity);
    for named in &mut desc.primvars {
        if named.primvar.interpolation == Interpolation::Uniform {
            named.primvar.interpolation = Interpolation::Constant;
        }
    }
    LeafItems { topology, desc, kind: LeafKind::Points, radii, poses }
}

/// A pose of points, with their radii at it where widths change.
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn widened(desc: &MeshDesc, pose: &PointsPose, count: usize) -> PointsPose {
    let radii = pose.widths.as_ref().zip(desc.widths.as_ref()).map(|(values, own)| {
        let primvar = Primvar { values: values.clone(), ..own.clone() };
        let widths = PointWidths::of_widths(&primvar);
        (0..count).map(|at| (0.5 * widths.at(at, [0.0; 3])) as f32).collect()
    });
    PointsPose { radii, ..pose.clone() }
}

/// Whether a point can be seen at a pose that has widths of its own.
fn has_width(pose: &PointsPose, at: usize) -> bool {
    pose.radii.as_ref().and_then(|radii| radii.get(at)).is_some_and(|&radius| radius > 0.0)
}

/// Widths by point.
enum PointWidths<'a> {
    Constant(f64),
    ByPoint(ArrayView<'a>),
    Lines(LineWidths<'a>),
}

impl<'a> PointWidths<'a> {
    fn of_points(desc: &'a MeshDesc, dicing: &'a DicingRate, dropped: &mut DroppedData) -> Self {
        let usable = usable_widths(desc);
        dropped.primvars += u64::from(desc.widths.as_ref().is_some_and(|w| !w.values.is_empty()) && usable.is_none());
        usable.map_or_else(|| Self::Lines(LineWidths::of(desc, dicing)), Self::of_widths)
    }

    fn of_widths(primvar: &'a Primvar) -> Self {
        let view = primvar.values.view();
        let is_one = matches!(primvar.interpolation, Interpolation::Constant | Interpolation::Uniform);
        if is_one || view.len() == 1 {
            return Self::Constant(view.scalar(0).unwrap_or(f64::NAN));
        }
        Self::ByPoint(view)
    }

    fn at(&self, point: usize, place: [f32; 3]) -> f64 {
        match self {
            Self::Constant(width) => *width,
            Self::ByPoint(view) => view.scalar(point).unwrap_or(f64::NAN),
            Self::Lines(lines) => lines.width(Vec3::from(place).as_dvec3()),
        }
    }
}

/// Pieces as hulls of balls.
fn as_tubes(
    desc: &MeshDesc,
    wanted: &[WantedPrimvar],
    cut: CutCurves,
    poses: &[PointsPose],
    dropped: &mut DroppedData,
) -> LeafItems {
    let poses: Vec<PointsPose> = poses.iter().map(|pose| cut.posed(desc, pose)).collect();
    let mut topology = MeshTopology { face_count: cut.curve_count, ..MeshTopology::default() };
    for piece in &cut.pieces {
        let [a, b] = piece.ends;
        let is_seen = piece.ends.iter().any(|&end| {
            let own = cut.radii.get(end as usize).is_some_and(|&radius| radius > 0.0);
            own || poses.iter().any(|pose| has_width(pose, end as usize))
        });
        if let (true, Ok(first)) = (is_seen, u32::try_from(topology.corners.len())) {
            topology.faces.push(MeshFace { index: piece.curve, first, count: 3, is_hole: false });
            topology.corners.extend([a, b, a]);
        }
    }
    let desc = values::on_curves(desc, wanted, &cut, 1, dropped);
    topology.points = cut.points;
    LeafItems { topology, desc, kind: LeafKind::Rounds, radii: cut.radii, poses }
}

/// Pieces as two triangles each, across the normals. The two points of an end have the values of the end.
fn as_ribbons(
    desc: &MeshDesc,
    wanted: &[WantedPrimvar],
    cut: &CutCurves,
    ribbon: &RibbonPoints,
    dropped: &mut DroppedData,
) -> LeafItems {
    let mut topology =
        MeshTopology { face_count: cut.curve_count, points: ribbon.points.clone(), ..MeshTopology::default() };
    for piece in &cut.pieces {
        let [a, b] = piece.ends.map(|end| 2 * end);
        // Right-handed around the normals.
        for corners in [[a, b + 1, b], [a, a + 1, b + 1]] {
            let Ok(first) = u32::try_from(topology.corners.len()) else { continue };
            topology.faces.push(MeshFace { index: piece.curve, first, count: 3, is_hole: false });
            topology.corners.extend(corners);
        }
    }
    let mut desc = values::on_curves(desc, wanted, cut, 2, dropped);
    desc.normals = Some(ribbon.normals.clone());
    if wanted.iter().any(|wanted| &*wanted.name == ACROSS_NAME) {
        desc.primvars.retain(|named| &*named.name != ACROSS_NAME);
        let across = ribbon.points.chunks(2).flat_map(|_| [1.0, -1.0]).collect();
        desc.primvars.push(NamedPrimvar { name: ACROSS_NAME.into(), primvar: primvar_of(1, across) });
    }
    LeafItems { topology, desc, kind: LeafKind::Triangles, radii: Vec::new(), poses: Vec::new() }
}
