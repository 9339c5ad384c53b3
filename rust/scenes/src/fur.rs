// SPDX-License-Identifier: Apache-2.0
//! A ball with hair, a cloud of points, a creature as a subdivision surface: what leaves that are no plain triangles
//! cost.

use anyhow::Result;
use glam::DVec3;
use oocpt_core::array::TypedArray;
use oocpt_core::camera::Camera;
use oocpt_core::scene::{
    CurveBasis, CurveWrap, CurvesDesc, Interpolation, LightDesc, MeshDesc, PrimShape, Primvar, SceneDb, Subdivision,
};

use super::forest::{self, grid, prim};
use super::island::Random;

/// What is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Subject {
    /// Cubic B-splines of five points, pinned, on a ball.
    Hair,
    /// Balls in a box.
    Points,
    /// A bumpy surface of quads, cut to the dicing rate.
    Limit,
    /// The same quads, as they are.
    Polygons,
}

impl Subject {
    /// All, in the order of the documentation.
    pub const ALL: [Self; 4] = [Self::Hair, Self::Points, Self::Limit, Self::Polygons];

    /// The name in options and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hair => "hair",
            Self::Points => "points",
            Self::Limit => "limit surface",
            Self::Polygons => "polygons",
        }
    }
}

/// Fills `db` with `count` hairs or points, or a surface of about so many quads, under a dome.
pub fn build(db: &mut SceneDb, subject: Subject, count: u32) -> Result<()> {
    let mut mesh = match subject {
        Subject::Hair => hair(count),
        Subject::Points => points(count),
        Subject::Limit => creature(count, Subdivision::CatmullClark)?,
        Subject::Polygons => creature(count, Subdivision::None)?,
    };
    mesh.prim = prim("/subject", Vec::new());
    mesh.prim_id = 1;
    mesh.double_sided = true;
    db.upsert_mesh(mesh);
    db.upsert_light(LightDesc { prim: prim("/dome", Vec::new()), ..LightDesc::default() });
    Ok(())
}

/// A camera that the subject fills most of the picture of.
pub fn camera(width: u32, height: u32) -> Camera {
    forest::view(DVec3::new(0.0, 0.6, 3.6), DVec3::ZERO, width, height)
}

fn hair(count: u32) -> MeshDesc {
    let mut random = Random::new(&[11]);
    let mut points = Vec::new();
    for _ in 0..count {
        let (root, bend) = (random.direction(), random.direction() * 0.02);
        for k in 0..5 {
            let along = f64::from(k) * 0.06;
            points.push((root * (0.8 + along) + bend * f64::from(k * k) * 0.4).as_vec3().to_array());
        }
    }
    MeshDesc {
        shape: PrimShape::Curves(CurvesDesc {
            basis: CurveBasis::BSpline,
            wrap: CurveWrap::Pinned,
            counts: TypedArray::of((0..count).map(|_| 5).collect::<Vec<i32>>()),
            indices: None,
        }),
        points: TypedArray::of(points),
        widths: width(0.6 / f64::from(count.max(1)).sqrt()),
        ..MeshDesc::default()
    }
}

fn points(count: u32) -> MeshDesc {
    let mut random = Random::new(&[12]);
    let mut coordinate = || random.range(-1.0, 1.0);
    let place = |_| DVec3::new(coordinate(), coordinate(), coordinate()).as_vec3().to_array();
    MeshDesc {
        shape: PrimShape::Points,
        points: TypedArray::of((0..count).map(place).collect::<Vec<[f32; 3]>>()),
        widths: width(1.0 / f64::from(count.max(1)).cbrt()),
        ..MeshDesc::default()
    }
}

#[expect(clippy::cast_possible_truncation, reason = "single precision is enough")]
fn width(width: f64) -> Option<Primvar> {
    let values = TypedArray::of(vec![width as f32]);
    Some(Primvar { interpolation: Interpolation::Constant, values, indices: None })
}

fn creature(count: u32, subdivision: Subdivision) -> Result<MeshDesc> {
    let side = count.max(1).isqrt();
    let place = |u: f64, v: f64| {
        let (a, b) = (u * std::f64::consts::TAU, (v - 0.5) * std::f64::consts::PI);
        let radius = 1.0 + 0.08 * (9.0 * a).sin() * (7.0 * b).cos();
        DVec3::new(a.cos() * b.cos(), b.sin(), a.sin() * b.cos()) * radius
    };
    Ok(MeshDesc { subdivision, ..grid("/subject", side, side, place)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `tests/reference/test_curves.py` has the same numbers: Mitsuba gets the same scenes.
    #[test]
    fn the_scenes_of_other_renderers_are_the_same() -> Result<()> {
        let near = |values: &TypedArray, i: usize, place: [f64; 3]| {
            values.vec3(i).is_some_and(|found| found.distance(DVec3::from_array(place)) < 1e-6)
        };
        let hairs = hair(3).points;
        assert!(near(&hairs, 10, [0.118_389_02, -0.082_475_32, -0.786_881_1]), "root of the third hair");
        assert!(near(&hairs, 14, [0.190_867_66, -0.228_427_77, -1.004_890_3]), "its tip");
        assert!(near(&points(3).points, 2, [-0.640_325_3, 0.156_046_32, -0.220_947_16]), "third ball");
        let mesh = creature(18, Subdivision::None)?;
        assert_eq!(mesh.points.len(), 25, "4 x 4 quads");
        assert!(near(&mesh.points, 13, [0.0, 0.0, -0.92]), "corner 13");
        Ok(())
    }
}
