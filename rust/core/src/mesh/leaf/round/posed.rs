// SPDX-License-Identifier: Apache-2.0
//! Cut curves as ribbons, and at poses of what moves. A curve is the same sum of its control points at any time, so are
//! its direction and its width. Pure.

use glam::{DVec3, Vec3};

use super::curves::{CurveRadii, CurveStencil, CutCurves};
use super::values::on_points;
use crate::array::TypedArray;
use crate::desc::{DroppedData, Interpolation, MeshDesc, Primvar};
use crate::mesh::deform::PointsPose;

/// The points of ribbons, two for each point of the cut, and their normals.
pub(super) struct RibbonPoints {
    pub(super) points: Vec<[f32; 3]>,
    pub(super) normals: Primvar,
}

/// What a ribbon is made of, by point of the cut.
#[derive(Clone, Copy)]
struct RibbonSource<'a> {
    points: &'a [[f32; 3]],
    radii: &'a [f32],
    /// Of unit length, or 0.
    tangents: &'a [DVec3],
    normals: &'a [[f32; 3]],
}

impl RibbonSource<'_> {
    /// The points on both sides and the normals there.
    fn sides(self) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let (mut points, mut out) = (Vec::new(), Vec::new());
        let ends = self.points.iter().zip(self.radii).zip(self.tangents).zip(self.normals);
        for (((point, radius), tangent), normal) in ends {
            let normal = DVec3::from(normal.map(f64::from));
            let side = tangent.cross(normal).normalize_or_zero() * f64::from(*radius);
            let center = DVec3::from(point.map(f64::from));
            points.extend([center - side, center + side].map(|p| p.as_vec3().to_array()));
            // What is seen is perpendicular to the ribbon.
            let across = side.cross(*tangent).normalize_or(normal.normalize_or(DVec3::Z));
            out.extend([across.as_vec3().to_array(); 2]);
        }
        (points, out)
    }
}

impl CutCurves {
    /// The cut as ribbons, if the prim has normals that can be used.
    pub(super) fn ribbon(&self, desc: &MeshDesc, dropped: &mut DroppedData) -> Option<RibbonPoints> {
        let normals = self.normals(desc.normals.as_ref()?, desc, dropped)?;
        let (points, normals) =
            RibbonSource { points: &self.points, radii: &self.radii, tangents: &self.tangents, normals: &normals }
                .sides();
        let normals = Primvar { interpolation: Interpolation::Vertex, values: TypedArray::of(normals), indices: None };
        Some(RibbonPoints { points, normals })
    }

    fn normals(&self, primvar: &Primvar, desc: &MeshDesc, dropped: &mut DroppedData) -> Option<Vec<[f32; 3]>> {
        let (width, floats) = on_points(primvar, desc, self, dropped)?;
        let (normals, _) = floats.as_chunks::<3>();
        if width != 3 || normals.len() != self.points.len() {
            dropped.primvars += 1;
            return None;
        }
        Some(normals.to_vec())
    }

    /// The points of the cut at a pose of the prim's, with their radii where widths change.
    pub(super) fn posed(&self, desc: &MeshDesc, pose: &PointsPose) -> PointsPose {
        let place = |stencil: &CurveStencil| {
            let weights = stencil.vertex.map(|(_, weight)| f64::from(weight));
            sum(stencil, weights, &pose.points).as_vec3().to_array()
        };
        let points = self.stencils.iter().map(place).collect();
        PointsPose { radii: self.radii_at(desc, pose), ..PointsPose::at(pose.time, points) }
    }

    #[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
    fn radii_at(&self, desc: &MeshDesc, pose: &PointsPose) -> Option<Vec<f32>> {
        let primvar = Primvar { values: pose.widths.clone()?, ..desc.widths.clone()? };
        let radii = CurveRadii::of_widths(&primvar);
        let radius = |(stencil, &curve)| radii.at_stencil(stencil, curve) as f32;
        Some(self.stencils.iter().zip(&self.curves).map(radius).collect())
    }

    /// The ribbon at a pose of the prim's; none where the prim has no normals that can be used.
    pub(super) fn ribbon_at(&self, desc: &MeshDesc, pose: &PointsPose) -> Option<PointsPose> {
        let own = desc.normals.as_ref()?;
        let values = pose.normals.clone().unwrap_or_else(|| own.values.clone());
        // What cannot be used is counted where the frame's own are read.
        let normals = self.normals(&Primvar { values, ..own.clone() }, desc, &mut DroppedData::default())?;
        let slope =
            |(stencil, weights): (&CurveStencil, &[f64; 4])| sum(stencil, *weights, &pose.points).normalize_or_zero();
        let tangents: Vec<DVec3> = self.stencils.iter().zip(&self.slopes).map(slope).collect();
        let along = self.posed(desc, pose);
        let radii = along.radii.as_deref().unwrap_or(&self.radii);
        let (points, normals) =
            RibbonSource { points: &along.points, radii, tangents: &tangents, normals: &normals }.sides();
        Some(PointsPose { normals: Some(TypedArray::of(normals)), ..PointsPose::at(pose.time, points) })
    }
}

/// A sum of points of the prim. A weight of 0 takes nothing from a point that is no number.
fn sum(stencil: &CurveStencil, weights: [f64; 4], points: &[[f32; 3]]) -> DVec3 {
    let point = |((at, _), weight): (&(u32, f32), f64)| {
        let point = points.get(*at as usize).copied().unwrap_or_default();
        if weight == 0.0 { DVec3::ZERO } else { Vec3::from(point).as_dvec3() * weight }
    };
    stencil.vertex.iter().zip(weights).map(point).sum()
}
