// SPDX-License-Identifier: Apache-2.0
//! Solids of revolution (`UsdGeomSphere`, `UsdGeomCapsule`, `UsdGeomCylinder`, `UsdGeomCone`), and what is built of
//! them. Pure.
//!
//! A solid has one of two forms:
//! - *exact*: a sphere is a point, a capsule whose ends have the same radius a piece of a curve;
//! - *polygons* with the normals of the solid. All others have it, and whatever is displaced or emits: only polygons
//!   are moved, and sampled as lights.
//!
//! Corners of polygons lie on the solid. With [`AROUND`] of them in a circle its area is 0.07 % too small, and its
//! outline is off by 5.4e-4 radii at most.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::{
    CurveBasis, CurveWrap, CurvesDesc, Interpolation, MeshDesc, PointsSample, PrimShape, Primvar, Subdivision,
};
use crate::array::TypedArray;

/// Corners of a circle.
pub const AROUND: u32 = 96;
/// Rows of faces from the equator of a ball to its pole.
const ROWS: u32 = AROUND / 4;

/// A solid at a time. Lengths in object space; signs do not count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolidSize {
    /// Radii at the lower and the upper end of the axis.
    pub radii: [f64; 2],
    /// From one end of the axis to the other one, which is not where a capsule ends.
    pub height: f64,
}

/// A solid of revolution around the origin.
#[derive(Clone, Debug, PartialEq)]
pub struct SolidDesc {
    /// At the frame's own time.
    pub size: SolidSize,
    /// Parts of the shutter, in the order of time; fewer than two where it keeps its size.
    pub samples: Vec<(f64, SolidSize)>,
    /// Its axis: x, y or z.
    pub axis: usize,
    /// Half balls end it, not discs.
    pub is_round: bool,
}

/// Which parts a solid has at some time: so its faces are the same at all times.
#[derive(Clone, Copy, Debug)]
struct SolidParts {
    /// The ends of a flat solid that are points.
    closes: [bool; 2],
    /// There is a distance between the ends.
    has_body: bool,
}

/// Points of a profile from the lower pole to the upper one.
#[derive(Clone, Copy, Debug)]
struct ProfileStation {
    along: f64,
    radius: f64,
}

/// Rows of faces between stations, with the normals of the surface at its two ends.
#[derive(Clone, Copy, Debug)]
struct ProfileBand {
    from: usize,
    /// Along the axis, and away from it.
    normals: [[f64; 2]; 2],
}

/// Stations and what is between them.
#[derive(Debug, Default)]
struct SolidProfile {
    stations: Vec<ProfileStation>,
    bands: Vec<ProfileBand>,
}

impl SolidProfile {
    fn to(&mut self, along: f64, radius: f64, normals: [[f64; 2]; 2]) {
        self.bands.push(ProfileBand { from: self.stations.len() - 1, normals });
        self.stations.push(ProfileStation { along, radius });
    }

    /// A quarter of a circle around the end of the axis at `along`, to the pole or from there.
    fn quarter(&mut self, along: f64, radius: f64, from: f64) {
        let normal = |k: u32| {
            let (sine, cosine) = (from + FRAC_PI_2 * f64::from(k) / f64::from(ROWS)).sin_cos();
            [sine, cosine]
        };
        for k in 1..=ROWS {
            let normals = [normal(k - 1), normal(k)];
            let [sine, cosine] = normals[1];
            let is_pole = from >= 0.0 && k == ROWS;
            self.to(along + radius * sine, if is_pole { 0.0 } else { radius * cosine }, normals);
        }
    }
}

impl SolidSize {
    /// Whether there is such a solid.
    fn is_usable(self) -> bool {
        self.height.is_finite() && self.radii.iter().all(|radius| radius.is_finite())
    }

    fn unsigned(self) -> Self {
        Self { radii: self.radii.map(f64::abs), height: self.height.abs() }
    }

    /// Along the surface between the ends.
    fn length(self) -> f64 {
        let Self { radii: [lower, upper], height } = self.unsigned();
        height.hypot(lower - upper)
    }

    fn profile(self, is_round: bool, parts: SolidParts) -> SolidProfile {
        let Self { radii: [lower, upper], height } = self.unsigned();
        let half = 0.5 * height;
        let pole = if is_round { -half - lower } else { -half };
        let mut profile =
            SolidProfile { stations: vec![ProfileStation { along: pole, radius: 0.0 }], ..SolidProfile::default() };
        let length = self.length();
        let slant = if length > 0.0 { [(lower - upper) / length, height / length] } else { [0.0, 1.0] };
        if is_round {
            profile.quarter(-half, lower, -FRAC_PI_2);
        } else if !parts.closes[0] {
            profile.to(-half, lower, [[-1.0, 0.0]; 2]);
        }
        if parts.has_body {
            profile.to(half, upper, [slant; 2]);
        }
        if is_round {
            profile.quarter(half, upper, 0.0);
        } else if !parts.closes[1] {
            profile.to(half, 0.0, [[1.0, 0.0]; 2]);
        }
        profile
    }
}

/// A mesh.
#[derive(Debug, Default)]
struct PolygonMesh {
    counts: Vec<i32>,
    corners: Vec<i32>,
    points: Vec<[f32; 3]>,
    /// By corner.
    normals: Vec<[f32; 3]>,
}

impl SolidDesc {
    /// True where the size is a number at all times.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.sizes().all(SolidSize::is_usable)
    }

    /// True for a sphere, and for a capsule whose ends have the same radius: they have an exact form.
    #[must_use]
    pub fn has_exact_form(&self) -> bool {
        let is_even = |size: SolidSize| {
            let [lower, upper] = size.radii.map(f64::abs);
            lower.to_bits() == upper.to_bits()
        };
        self.is_round && self.sizes().all(is_even)
    }

    fn sizes(&self) -> impl Iterator<Item = SolidSize> {
        std::iter::once(self.size).chain(self.samples.iter().map(|(_, size)| *size))
    }

    /// A place or a direction, given along the axis, and across it.
    #[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
    fn turned(&self, along: f64, across: [f64; 2]) -> [f32; 3] {
        let mut out = [0.0; 3];
        for (k, value) in [along, across[0], across[1]].into_iter().enumerate() {
            out[(self.axis + k) % 3] = value as f32;
        }
        out
    }

    /// Centres of balls, of which the hull is the solid.
    fn centers(&self, size: SolidSize) -> Vec<[f32; 3]> {
        let half = 0.5 * size.height.abs();
        let ends: &[f64] = if self.is_ball() { &[0.0] } else { &[-half, half] };
        ends.iter().map(|along| self.turned(*along, [0.0; 2])).collect()
    }

    fn is_ball(&self) -> bool {
        self.sizes().all(|size| size.height.abs() <= 0.0)
    }

    #[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
    fn widths(&self, size: SolidSize) -> Vec<f32> {
        vec![(2.0 * size.radii[0].abs()) as f32; if self.is_ball() { 1 } else { 2 }]
    }

    fn polygons(&self, size: SolidSize) -> PolygonMesh {
        let closes = [0, 1].map(|end| self.sizes().all(|size| size.radii[end].abs() <= 0.0));
        if closes == [true; 2] {
            return PolygonMesh::default();
        }
        let has_body = self.sizes().any(|size| size.length() > 0.0);
        let profile = size.profile(self.is_round, SolidParts { closes, has_body });
        let direction = |place: f64| {
            let (sine, cosine) = (TAU * place / f64::from(AROUND)).sin_cos();
            [cosine, sine]
        };
        let directions: Vec<[f64; 2]> = (0..AROUND).map(|at| direction(f64::from(at))).collect();
        let last = profile.stations.len() - 1;
        let is_pole = |station: usize| station == 0 || station == last;
        let mut out = PolygonMesh::default();
        let mut first = Vec::new();
        for (number, station) in profile.stations.iter().enumerate() {
            first.push(i32::try_from(out.points.len()).unwrap_or(0));
            let ring = if is_pole(number) { &directions[..1] } else { &directions[..] };
            let radius = if is_pole(number) { 0.0 } else { station.radius };
            out.points.extend(ring.iter().map(|[x, y]| self.turned(station.along, [radius * x, radius * y])));
        }
        for band in &profile.bands {
            for (at, next) in (0..AROUND).zip((1..AROUND).chain([0])) {
                let ends = [(0, at), (0, next), (1, next), (1, at)];
                let mut count = 0;
                for (k, (end, column)) in ends.into_iter().enumerate() {
                    let station = band.from + end;
                    if is_pole(station) && k % 2 == 1 {
                        // A pole is one corner.
                        continue;
                    }
                    let column = column.cast_signed();
                    out.corners.push(first[station] + if is_pole(station) { 0 } else { column });
                    let [along, away] = band.normals[end];
                    // The tip of a cone has none: that of the middle of the face.
                    let place = if is_pole(station) { f64::from(at) + 0.5 } else { f64::from(column) };
                    let [x, y] = direction(place);
                    out.normals.push(self.turned(along, [away * x, away * y]));
                    count += 1;
                }
                out.counts.push(count);
            }
        }
        out
    }
}

impl MeshDesc {
    /// Gives the prim's solid, if it is one, the form in which it is built: polygons where `polygons` asks for them or
    /// it has no exact form. True where that changed anything. What has no usable size stays a mesh without a face.
    pub fn take_form(&mut self, polygons: bool) -> bool {
        let Some(solid) = self.solid.take_if(|solid| solid.is_usable()) else { return false };
        let polygons = polygons || !solid.has_exact_form();
        let is_formed = !self.points.is_empty() && polygons == matches!(self.shape, PrimShape::Mesh);
        if !is_formed {
            self.form(&solid, polygons);
        }
        self.solid = Some(solid);
        !is_formed
    }

    /// Takes over the arrays of an earlier description of the same solid, so that it is seen to be the same.
    pub(crate) fn keep_form(&mut self, old: &Self) {
        if self.solid.is_some() && self.solid == old.solid {
            self.shape = old.shape.clone();
            self.face_vertex_counts = old.face_vertex_counts.clone();
            self.face_vertex_indices = old.face_vertex_indices.clone();
            self.points = old.points.clone();
            self.widths.clone_from(&old.widths);
            self.normals.clone_from(&old.normals);
            self.point_motion.samples.clone_from(&old.point_motion.samples);
        }
    }

    fn form(&mut self, solid: &SolidDesc, polygons: bool) {
        self.subdivision = Subdivision::None;
        self.left_handed = false;
        (self.widths, self.normals) = (None, None);
        self.face_vertex_counts = TypedArray::of(Vec::<i32>::new());
        self.face_vertex_indices = TypedArray::of(Vec::<i32>::new());
        self.shape = if polygons { PrimShape::Mesh } else { PrimShape::Points };
        let primvar = |interpolation, values| Some(Primvar { interpolation, values, indices: None });
        let samples = if solid.samples.len() > 1 { &solid.samples[..] } else { &[] };
        if polygons {
            let PolygonMesh { counts, corners, points, normals } = solid.polygons(solid.size);
            self.face_vertex_counts = TypedArray::of(counts);
            self.face_vertex_indices = TypedArray::of(corners);
            self.points = TypedArray::of(points);
            self.normals = primvar(Interpolation::FaceVarying, TypedArray::of(normals));
            let sample = |(time, size): &(f64, SolidSize)| {
                let PolygonMesh { points, normals, .. } = solid.polygons(*size);
                let (points, normals) = (TypedArray::of(points), Some(TypedArray::of(normals)));
                PointsSample { time: *time, points, normals, widths: None }
            };
            self.point_motion.samples = samples.iter().map(sample).collect();
            return;
        }
        let centers = solid.centers(solid.size);
        if let &[_, _] = &centers[..] {
            self.shape = PrimShape::Curves(CurvesDesc {
                basis: CurveBasis::Linear,
                wrap: CurveWrap::Nonperiodic,
                counts: TypedArray::of(vec![2_i32]),
                indices: None,
            });
        }
        self.points = TypedArray::of(centers);
        self.widths = primvar(Interpolation::Vertex, TypedArray::of(solid.widths(solid.size)));
        let sample = |(time, size): &(f64, SolidSize)| PointsSample {
            time: *time,
            points: TypedArray::of(solid.centers(*size)),
            normals: None,
            widths: Some(TypedArray::of(solid.widths(*size))),
        };
        self.point_motion.samples = samples.iter().map(sample).collect();
    }
}

#[cfg(test)]
mod tests;
