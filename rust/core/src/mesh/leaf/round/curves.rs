// SPDX-License-Identifier: Apache-2.0
//! Cuts curves into straight pieces. Pure.
//!
//! A cubic segment with second derivatives of at most `b` leaves its chord by at most `b / (8 k^2)` when it is cut into
//! `k` pieces; the radius, which is cubic too, is taken as a fourth coordinate. `k` is such that this is at most
//! [`TOLERANCE`] of the dicing rate where the curve is nearest. Thick curves, whose bends show in their shading, turn
//! by at most [`THICK_TURN`] from piece to piece.

use glam::{DVec3, DVec4};

use super::basis::{CurveSegment, segments, varying_count};
use super::lines::{LineWidths, usable_widths};
use super::{is_width, point_at};
use crate::array::{ArrayView, ElementType, TypedArray};
use crate::desc::{CurvesDesc, DroppedData, Interpolation, MeshDesc, Primvar};
use crate::mesh::dicing::DicingRate;

/// Largest distance of a piece from its curve, in units of the dicing rate's piece length.
const TOLERANCE: f64 = 0.05;
/// Radius in pixels above which a curve is thick.
const THICK: f64 = 2.0;
/// Largest angle between pieces of thick curves, and of thin ones.
const THICK_TURN: f64 = 0.08;
const THIN_TURN: f64 = 0.8;
/// Number of pieces of a cubic segment if no camera decides it.
const UNSEEN_PIECES: u32 = 8;
/// Largest number of pieces of a segment.
const MAX_PIECES: u32 = 256;
/// Number of pieces of one prim above which its segments are cut into fewer, though always into up to
/// [`ALWAYS_PIECES`].
const MAX_PIECES_OF_PRIM: usize = 1 << 23;
const ALWAYS_PIECES: u32 = 8;

/// A straight piece between two of the cut's points.
#[derive(Clone, Copy, Debug)]
pub(super) struct CurvePiece {
    pub(super) ends: [u32; 2],
    pub(super) curve: u32,
}

/// The control points from which a point of the cut is computed.
#[derive(Clone, Copy, Debug)]
pub(super) struct CurveStencil {
    /// Points of the prim and their weights.
    pub(super) vertex: [(u32, f32); 4],
    /// Indices of the two nearest values of a varying primvar; the weight between them follows.
    pub(super) varying: [u32; 2],
    pub(super) along: f32,
}

/// All curves of a prim.
#[derive(Debug, Default)]
pub(super) struct CutCurves {
    pub(super) curve_count: usize,
    pub(super) pieces: Vec<CurvePiece>,
    pub(super) points: Vec<[f32; 3]>,
    pub(super) radii: Vec<f32>,
    pub(super) stencils: Vec<CurveStencil>,
    /// Unit directions of the curves, for ribbons.
    pub(super) tangents: Vec<DVec3>,
    /// Weights of the stencils' points in these directions, for moving prims.
    pub(super) slopes: Vec<[f64; 4]>,
    moves: bool,
    /// Number of values that a varying primvar must have.
    pub(super) varying_count: usize,
    /// Curve of each point.
    pub(super) curves: Vec<u32>,
    /// Largest number of pieces of a segment; the next field is true if some segment would have more.
    most_pieces: u32,
    is_coarse: bool,
    /// Number of points of all segments, and whether nothing else is wanted.
    point_total: u64,
    counts_only: bool,
}

/// A curve while it is cut.
struct ControlCurve<'a> {
    number: u32,
    /// Points of its vertices.
    vertices: &'a [u32],
    /// First value of a varying primvar on the curve, and the number of its values.
    varying: (usize, usize),
}

/// Radii of curves, at the rate of the authored widths.
pub(super) struct CurveRadii<'a> {
    interpolation: Interpolation,
    view: Result<ArrayView<'a>, LineWidths<'a>>,
}

impl CutCurves {
    /// `moves`: poses will be read too.
    pub(super) fn new(
        desc: &MeshDesc,
        curves: &CurvesDesc,
        dicing: &DicingRate,
        moves: bool,
        dropped: &mut DroppedData,
    ) -> Self {
        Self { moves, ..Self::default() }.read(desc, curves, dicing, dropped)
    }

    /// Number of points of the cut, or somewhat more.
    pub(super) fn count(desc: &MeshDesc, curves: &CurvesDesc, dicing: &DicingRate) -> u64 {
        let counting = Self { counts_only: true, ..Self::default() };
        counting.read(desc, curves, dicing, &mut DroppedData::default()).point_total
    }

    fn read(self, desc: &MeshDesc, curves: &CurvesDesc, dicing: &DicingRate, dropped: &mut DroppedData) -> Self {
        let counts = curves.counts.view();
        let indices = curves.indices.as_ref().map(TypedArray::view).filter(|indices| !indices.is_empty());
        let is_int = |view: &ArrayView<'_>| view.is_empty() || view.element() == ElementType::I32;
        if !is_int(&counts) || !indices.as_ref().is_none_or(is_int) {
            dropped.wrong_array_types += 1;
            return Self::default();
        }
        let points = desc.points.view();
        let available = indices.map_or(points.len(), |indices| indices.len());
        let radii = CurveRadii::of(desc, dicing, dropped);
        let mut cut = Self { curve_count: counts.len(), most_pieces: most_pieces(available), ..self };
        let (mut first, mut vertices) = (0_usize, Vec::new());
        for (at, number) in (0..counts.len()).zip(0_u32..) {
            let Ok(count) = usize::try_from(counts.index(at).unwrap_or(-1)) else {
                dropped.curves += 1;
                continue;
            };
            if count > available - first {
                dropped.curves += (counts.len() - at) as u64;
                break;
            }
            vertices.clear();
            vertices.extend((first..first + count).filter_map(|vertex| {
                let index = match indices {
                    Some(indices) => indices.index(vertex).and_then(|index| u32::try_from(index).ok()),
                    None => u32::try_from(vertex).ok(),
                }?;
                point_at(&points, index as usize).map(|_| index)
            }));
            first += count;
            let segments = segments(curves.basis, curves.wrap, count);
            let varying = varying_count(curves.basis, curves.wrap, segments.len(), count);
            let curve = ControlCurve { number, vertices: &vertices, varying: (cut.varying_count, varying) };
            cut.varying_count += varying;
            if vertices.len() < count || segments.is_empty() {
                dropped.curves += 1;
            } else {
                cut.add(&curve, curves, &segments, &points, &radii, dicing, desc.refine_level);
            }
        }
        dropped.coarse_meshes += u64::from(cut.is_coarse);
        dropped.primvars += u64::from(radii.is_short(counts.len(), points.len(), cut.varying_count));
        if cut.points.iter().flatten().chain(&cut.radii).any(|v| !v.is_finite()) {
            dropped.curves += cut.curve_count as u64;
            return Self { curve_count: cut.curve_count, varying_count: cut.varying_count, ..Self::default() };
        }
        cut
    }

    #[expect(clippy::too_many_arguments, reason = "all of them differ from curve to curve or from prim to prim")]
    fn add(
        &mut self,
        curve: &ControlCurve<'_>,
        desc: &CurvesDesc,
        segments: &[CurveSegment],
        points: &ArrayView<'_>,
        radii: &CurveRadii<'_>,
        dicing: &DicingRate,
        level: u8,
    ) {
        let control = |vertex: usize, varying: f64| {
            let at = curve.vertices.get(vertex).copied().unwrap_or(0);
            let place = points.vec3(at as usize).unwrap_or(DVec3::ZERO);
            place.extend(match &radii.view {
                Ok(_) => radii.at(at as usize, varying, curve),
                Err(lines) => 0.5 * lines.width(place),
            })
        };
        let sum = |segment: &CurveSegment, weights: [f64; 4], varying: f64| -> DVec4 {
            segment.vertices.iter().zip(weights).map(|(&vertex, weight)| control(vertex, varying) * weight).sum()
        };
        let start = self.points.len();
        for (number, segment) in segments.iter().enumerate() {
            let is_new = number == 0 || desc.wrap == crate::desc::CurveWrap::Segmented;
            let wanted = pieces(segment, desc, dicing, level, |weights| sum(segment, weights, number as f64));
            let pieces = wanted.min(self.most_pieces);
            self.is_coarse |= pieces < wanted;
            self.point_total += u64::from(pieces) + 1;
            if self.counts_only {
                continue;
            }
            for piece in u32::from(!is_new)..=pieces {
                let t = f64::from(piece) / f64::from(pieces);
                let along = number as f64 + t;
                let weights = segment.weights(desc.basis, t);
                let place = sum(segment, weights, along);
                let stencil = stencil(segment, weights, number, t, curve);
                let is_last = number + 1 == segments.len() && piece == pieces;
                if is_last && desc.wrap == crate::desc::CurveWrap::Periodic && self.points.len() > start + 1 {
                    self.piece(self.points.len() - 1, start, curve.number);
                    continue;
                }
                let slopes = segment.slopes(desc.basis, t);
                let tangent = sum(segment, slopes, along).truncate();
                self.push(place, tangent, stencil, curve.number);
                if self.moves {
                    self.slopes.push(slopes);
                }
                if piece > 0 {
                    self.piece(self.points.len() - 2, self.points.len() - 1, curve.number);
                }
            }
        }
    }

    fn piece(&mut self, a: usize, b: usize, curve: u32) {
        if let (Ok(a), Ok(b)) = (u32::try_from(a), u32::try_from(b)) {
            self.pieces.push(CurvePiece { ends: [a, b], curve });
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
    fn push(&mut self, place: DVec4, tangent: DVec3, stencil: CurveStencil, curve: u32) {
        self.points.push(place.truncate().as_vec3().to_array());
        // Splines of positive widths may be negative.
        self.radii.push(place.w.max(0.0) as f32);
        self.tangents.push(tangent.normalize_or_zero());
        self.stencils.push(stencil);
        self.curves.push(curve);
    }
}

/// Largest number of pieces of a segment of curves with this many vertices, which have no more segments than that.
fn most_pieces(vertices: usize) -> u32 {
    let share = u32::try_from(MAX_PIECES_OF_PRIM / vertices.max(1)).unwrap_or(MAX_PIECES);
    share.clamp(ALWAYS_PIECES, MAX_PIECES)
}

/// Number of pieces of a segment; `sum` gives position and radius for weights.
fn pieces(
    segment: &CurveSegment,
    curves: &CurvesDesc,
    dicing: &DicingRate,
    level: u8,
    sum: impl Fn([f64; 4]) -> DVec4,
) -> u32 {
    if curves.basis == crate::desc::CurveBasis::Linear {
        return 1;
    }
    let [from, to] = [0.0, 1.0].map(|t| sum(segment.weights(curves.basis, t)));
    let bend = segment.bends(curves.basis).map(&sum).map(DVec4::length);
    let bend = f64::max(bend[0], bend[1]);
    let density = dicing.density_of(from.truncate(), to.truncate());
    if density.is_nan() || density <= 0.0 {
        return UNSEEN_PIECES << level.min(3);
    }
    let for_shape = (bend * density / (8.0 * TOLERANCE * dicing.pixels)).sqrt();
    let turn = if from.w.max(to.w) * density > THICK { THICK_TURN } else { THIN_TURN };
    let speed = from.truncate().distance(to.truncate());
    // The curve turns by about its second derivative over its speed; if it turns back, by half a turn and more.
    let for_turn = f64::min(bend / speed, 2.0 * std::f64::consts::PI) / turn;
    let wanted = for_shape.max(for_turn).ceil().clamp(1.0, f64::from(MAX_PIECES));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 1 and MAX_PIECES; NaN gives 0"
    )]
    let wanted = wanted as u32;
    wanted.clamp(1, MAX_PIECES)
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn stencil(segment: &CurveSegment, weights: [f64; 4], number: usize, t: f64, curve: &ControlCurve<'_>) -> CurveStencil {
    let vertex = |k: usize| {
        let at = segment.vertices.get(k).and_then(|&v| curve.vertices.get(v)).copied().unwrap_or(0);
        (at, weights.get(k).copied().unwrap_or(0.0) as f32)
    };
    let (first, count) = curve.varying;
    let varying = |k: usize| u32::try_from(first + k % count.max(1)).unwrap_or(0);
    CurveStencil { vertex: [0, 1, 2, 3].map(vertex), varying: [varying(number), varying(number + 1)], along: t as f32 }
}

impl<'a> CurveRadii<'a> {
    /// The radii of a prim: those of its widths, or of lines if it has no usable widths.
    fn of(desc: &'a MeshDesc, dicing: &'a DicingRate, dropped: &mut DroppedData) -> Self {
        let usable = usable_widths(desc);
        dropped.primvars += u64::from(desc.widths.as_ref().is_some_and(|w| !w.values.is_empty()) && usable.is_none());
        usable.map_or_else(
            || Self { interpolation: Interpolation::Constant, view: Err(LineWidths::of(desc, dicing)) },
            Self::of_widths,
        )
    }

    /// The radii of widths that can be used.
    pub(super) fn of_widths(primvar: &'a Primvar) -> Self {
        let is_one = primvar.values.len() == 1;
        let interpolation = if is_one { Interpolation::Constant } else { primvar.interpolation };
        Self { interpolation, view: Ok(primvar.values.view()) }
    }

    /// Returns true if there are fewer widths than the interpolation needs.
    fn is_short(&self, curves: usize, points: usize, ends: usize) -> bool {
        let needed = match self.interpolation {
            Interpolation::Constant | Interpolation::Instance => 1,
            Interpolation::Uniform => curves,
            Interpolation::Vertex => points,
            Interpolation::Varying | Interpolation::FaceVarying => ends,
        };
        self.view.as_ref().is_ok_and(|view| view.len() < needed)
    }

    fn width(&self, at: usize) -> f64 {
        let Ok(view) = &self.view else { return 0.0 };
        view.scalar(at).or(view.scalar(0)).filter(|width| is_width(*width)).unwrap_or(0.0)
    }

    /// Radius at a point of the cut; 0 if a spline is negative there.
    pub(super) fn at_stencil(&self, stencil: &CurveStencil, curve: u32) -> f64 {
        let width = match self.interpolation {
            Interpolation::Constant | Interpolation::Instance => self.width(0),
            Interpolation::Uniform => self.width(curve as usize),
            Interpolation::Vertex => {
                stencil.vertex.iter().map(|&(at, weight)| self.width(at as usize) * f64::from(weight)).sum()
            }
            Interpolation::Varying | Interpolation::FaceVarying => {
                let [a, b] = stencil.varying.map(|at| self.width(at as usize));
                a + (b - a) * f64::from(stencil.along)
            }
        };
        (0.5 * width).max(0.0)
    }

    /// Radius at a vertex, or at a number of segments along a curve. A missing width is that of the first vertex; an
    /// unusable width counts as 0.
    fn at(&self, point: usize, along: f64, curve: &ControlCurve<'_>) -> f64 {
        let width = |at: usize| self.width(at);
        0.5 * match self.interpolation {
            Interpolation::Constant | Interpolation::Instance => width(0),
            Interpolation::Uniform => width(curve.number as usize),
            Interpolation::Vertex => width(point),
            Interpolation::Varying | Interpolation::FaceVarying => {
                let (first, count) = curve.varying;
                let whole = along.floor();
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of segments")]
                let at = whole as usize;
                let [a, b] = [at, at + 1].map(|k| width(first + k % count.max(1)));
                a + (b - a) * (along - whole)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::desc::{CurveBasis, CurveWrap};

    #[test]
    fn curve_pieces_of_a_prim_are_capped() {
        assert_eq!([1, 1 << 15, 1 << 17, 1 << 20, 1 << 27].map(most_pieces), [256, 256, 64, 8, 8], "by vertices");
        let count = 1_i32 << 16;
        let points: Vec<[f32; 3]> = (0..count).map(|k| [k as f32, (k * k % 7) as f32, 0.0]).collect();
        let curves = CurvesDesc {
            basis: CurveBasis::BSpline,
            wrap: CurveWrap::Nonperiodic,
            counts: TypedArray::of(vec![5_i32]),
            indices: None,
        };
        let desc = MeshDesc { points: TypedArray::of(points), ..MeshDesc::default() };
        let near = DicingRate { pixels: 2.0, density: 1e12, ..DicingRate::default() };
        let mut dropped = DroppedData::default();
        let cut = CutCurves::new(&desc, &curves, &near, false, &mut dropped);
        assert_eq!((cut.pieces.len(), dropped.coarse_meshes), (2 * 128, 1), "two segments, cut as all would be");
        let mut dropped = DroppedData::default();
        let cut = CutCurves::new(&desc, &curves, &DicingRate { density: 1.0, ..near }, false, &mut dropped);
        assert_eq!(dropped.coarse_meshes, 0, "far away {} pieces are enough", cut.pieces.len());
    }
}
