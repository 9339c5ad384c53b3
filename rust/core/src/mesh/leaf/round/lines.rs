// SPDX-License-Identifier: Apache-2.0
//! Curves and points without widths: lines and dots of a pixel, as Hydra draws them. Pure.
//!
//! A width is that of a pixel where the prim is nearest to the camera, as [`DicingRate`] knows it: from the nearest
//! placements, in steps of half a power of two, at most a pixel wide and at least 0.7. So a line is as wide as the
//! picture needs it at each of its points, and small steps of the camera change nothing. Where no camera says how large
//! a pixel is (a dicing rate of 0), it is a thousandth of the prim's size.

use glam::DVec3;

use crate::desc::{Interpolation, MeshDesc, PrimShape, Primvar};
use crate::mesh::dicing::DicingRate;

/// Width where nobody knows how large a pixel is, in diagonals of the box of the points.
const UNSEEN_WIDTH: f64 = 1e-3;

/// How wide lines are.
pub(super) struct LineWidths<'a> {
    dicing: &'a DicingRate,
    unseen: f64,
}

impl<'a> LineWidths<'a> {
    pub(super) fn of(desc: &MeshDesc, dicing: &'a DicingRate) -> Self {
        let points = desc.points.view();
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for point in (0..points.len()).filter_map(|at| points.vec3(at)).filter(|point| point.is_finite()) {
            (min, max) = (min.min(point), max.max(point));
        }
        let size = min.distance(max);
        let size = if size.is_finite() && size > 0.0 { size } else { 1.0 };
        Self { dicing, unseen: UNSEEN_WIDTH * size }
    }

    /// The width at a place, in object space.
    pub(super) fn width(&self, place: DVec3) -> f64 {
        let width = 1.0 / self.dicing.density_of(place, place);
        if width.is_finite() { width } else { self.unseen }
    }
}

/// The widths of curves or points, if they can be used.
pub(super) fn usable_widths(desc: &MeshDesc) -> Option<&Primvar> {
    let widths = desc.widths.as_ref()?;
    let view = widths.values.view();
    let is_one = matches!(widths.interpolation, Interpolation::Constant | Interpolation::Uniform) || view.len() == 1;
    let fits = match desc.shape {
        PrimShape::Points => is_one || (view.len() >= desc.points.len() && widths.indices.is_none()),
        _ => widths.indices.is_none(),
    };
    (view.scalar(0).is_some() && fits).then_some(widths)
}

/// Whether a prim is drawn as lines or dots of a pixel.
pub(in crate::mesh) fn is_of_lines(desc: &MeshDesc) -> bool {
    matches!(desc.shape, PrimShape::Curves(_) | PrimShape::Points) && usable_widths(desc).is_none()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::TypedArray;
    use crate::desc::{CurveBasis, CurveWrap, CurvesDesc, DroppedData};
    use crate::mesh::CameraEye;
    use crate::mesh::leaf::read_items;

    const ENDS: [[f32; 3]; 2] = [[0.0; 3], [0.0, 0.0, -30.0]];

    fn curves() -> MeshDesc {
        let counts = TypedArray::of(vec![2_i32]);
        let shape = PrimShape::Curves(CurvesDesc {
            basis: CurveBasis::Linear,
            wrap: CurveWrap::Nonperiodic,
            counts,
            indices: None,
        });
        MeshDesc { shape, points: TypedArray::of(ENDS.to_vec()), ..MeshDesc::default() }
    }

    fn radii(desc: &MeshDesc, dicing: &DicingRate) -> (Vec<f32>, DroppedData) {
        let mut dropped = DroppedData::default();
        let items = read_items(desc, &[], dicing, &[], &mut dropped).expect("items");
        (items.radii, dropped)
    }

    #[test]
    fn a_line_is_a_pixel_wide_at_each_end() {
        let dots = MeshDesc { shape: PrimShape::Points, ..curves() };
        let empty =
            Primvar { interpolation: Interpolation::Vertex, values: TypedArray::of(Vec::<f32>::new()), indices: None };
        let parallel = DicingRate { pixels: 2.0, density: 16.0, ..DicingRate::default() };
        let eyes = vec![CameraEye { position: DVec3::new(0.0, 0.0, 10.0), nearest: 0.01 }];
        let perspective = DicingRate { pixels: 2.0, focal: 200.0, eyes, ..DicingRate::default() };
        for desc in [curves(), dots.clone(), MeshDesc { widths: Some(empty), ..dots }] {
            assert!(is_of_lines(&desc), "it has no width");
            assert_eq!(radii(&desc, &parallel).0, [1.0 / 32.0; 2], "16 pixels a unit");
            // 200 pixels a unit at distance 1.
            assert_eq!(radii(&desc, &perspective).0, [0.5 * 10.0 / 200.0, 0.5 * 40.0 / 200.0], "by distance");
            let (unseen, dropped) = radii(&desc, &DicingRate::default());
            assert_eq!(unseen, [0.5 * 0.03; 2], "a thousandth of its size");
            assert_eq!(dropped, DroppedData::default(), "no bad data");
        }
    }

    #[test]
    fn authored_widths_are_kept_and_bad_ones_are_reported() {
        let dicing = DicingRate { pixels: 2.0, density: 16.0, ..DicingRate::default() };
        let width = |interpolation, values: TypedArray| Some(Primvar { interpolation, values, indices: None });
        let widths = width(Interpolation::Constant, TypedArray::of(vec![3.0_f32]));
        for desc in
            [MeshDesc { widths: widths.clone(), ..curves() }, MeshDesc { shape: PrimShape::Points, widths, ..curves() }]
        {
            assert!(!is_of_lines(&desc), "it has a width");
            assert_eq!(radii(&desc, &dicing).0, [1.5; 2], "of its own");
        }
        let wrong = width(Interpolation::Vertex, TypedArray::of(vec![[1.0_f32; 3]; 2]));
        let short = width(Interpolation::Vertex, TypedArray::of(Vec::<f32>::from([1.0; 3])));
        let points = TypedArray::of(vec![[0.0_f32; 3]; 4]);
        for desc in [
            MeshDesc { widths: wrong, ..curves() },
            MeshDesc { shape: PrimShape::Points, points, widths: short, ..curves() },
        ] {
            assert!(is_of_lines(&desc), "no width that can be used");
            let (radii, dropped) = radii(&desc, &dicing);
            assert!(radii.iter().all(|radius| *radius == 1.0 / 32.0) && dropped.primvars == 1, "a line, and told");
        }
    }
}
