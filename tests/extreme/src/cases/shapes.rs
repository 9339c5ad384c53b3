// SPDX-License-Identifier: Apache-2.0
//! Curves, points, subdivision surfaces and poses that are extreme or make no sense: black, before a white sky, they
//! take their own area of the light; what is left out takes none.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DMat4, DVec3, DVec4};
use oocpt_core::TypedArray;
use oocpt_core::scene::{
    CurveBasis, CurveWrap, CurvesDesc, Interpolation, LightDesc, LightKind, MeshDesc, PointsMotion, PointsSample,
    PrimShape, Primvar, SceneDb, Subdivision, TransformSample,
};

use crate::build::{Body, dome, narrow, prim};
use crate::lab::Lab;
use crate::shot::Way;
use crate::tracer::camera::Eye;

/// A view of four by four units, `scale` times as large.
pub(super) fn eye(scale: f64) -> Eye {
    let eye = Eye::parallel(DVec3::Z * 10.0 * scale, DVec3::ZERO, 4.0 * scale, [32, 32]);
    Eye { planes: [0.1 * scale, 1000.0 * scale], ..eye }
}

fn way() -> Way {
    Way { samples: 256, ..Way::default() }
}

#[expect(clippy::cast_possible_truncation, reason = "a scene file's precision")]
fn width(value: f64) -> Option<Primvar> {
    let values = TypedArray::of(vec![value as f32]);
    Some(Primvar { interpolation: Interpolation::Constant, values, indices: None })
}

pub(super) fn shape(shape: PrimShape, points: &[DVec3], wide: f64) -> MeshDesc {
    let points = TypedArray::of(points.iter().copied().map(narrow).collect::<Vec<_>>());
    let black = Body { points: Vec::new(), faces: Vec::new(), albedo: 0.0 };
    let mesh = black.mesh(prim("/shape", DMat4::IDENTITY), 1);
    MeshDesc { shape, points, widths: width(wide), face_vertex_counts: TypedArray::of(Vec::<i32>::new()), ..mesh }
}

pub(super) fn curve(basis: CurveBasis, points: &[DVec3], wide: f64) -> MeshDesc {
    let counts = TypedArray::of(vec![i32::try_from(points.len()).unwrap_or(0)]);
    shape(PrimShape::Curves(CurvesDesc { basis, wrap: CurveWrap::Nonperiodic, counts, indices: None }), points, wide)
}

/// From one side of the view to beyond the other, `count` points.
pub(super) fn straight(count: u32, scale: f64) -> Vec<DVec3> {
    (0..count).map(|i| DVec3::X * scale * (6.0 * f64::from(i) / f64::from(count - 1) - 3.0)).collect()
}

/// Lines across the view, to and fro, `count` points in all: half of it is covered by lines of width 0.02.
fn winding(count: u32) -> Vec<DVec3> {
    let rows = 100;
    let each = count / rows;
    let at = |i: u32| {
        let (row, along) = (i / each, 6.0 * f64::from(i % each) / f64::from(each - 1) - 3.0);
        DVec3::new(if row % 2 == 0 { along } else { -along }, 0.04 * (f64::from(row) + 0.5) - 2.0, 0.0)
    };
    (0..rows * each).map(at).collect()
}

/// Area in the closed uniform cubic B-spline whose control points are `sides` points of the unit circle.
fn ring_area(sides: i32) -> f64 {
    let at = |k: i32| {
        let angle = TAU * f64::from(k) / f64::from(sides);
        DVec3::new(angle.cos(), angle.sin(), 0.0)
    };
    let point = |k: i32, t: f64| {
        let weights = [
            (1.0 - t).powi(3),
            3.0 * t * t * t - 6.0 * t * t + 4.0,
            -3.0 * t.powi(3) + 3.0 * t * t + 3.0 * t + 1.0,
            t.powi(3),
        ];
        (0..4).zip(weights).map(|(i, w)| at(k + i) * w / 6.0).sum::<DVec3>()
    };
    let steps = 256;
    let piece = |k: i32, i: i32| {
        let (a, b) = (point(k, f64::from(i) / f64::from(steps)), point(k, f64::from(i + 1) / f64::from(steps)));
        0.5 * (a.x * b.y - a.y * b.x)
    };
    (0..sides).flat_map(|k| (0..steps).map(move |i| (k, i))).map(|(k, i)| piece(k, i)).sum()
}

/// A spindle of `sides` quads between two poles of that valence, closed, as round as its limit is.
fn spindle(sides: i32) -> Body {
    let mut points = vec![DVec3::Y, DVec3::NEG_Y];
    for ring in [0.4, -0.4] {
        for k in 0..sides {
            let angle = TAU * f64::from(k) / f64::from(sides);
            points.push(DVec3::new(angle.cos(), ring, -angle.sin()));
        }
    }
    let at = |ring: i32, k: i32| 2 + ring * sides + k % sides;
    let side = |k: i32| {
        [
            vec![0, at(0, k), at(0, k + 1)],
            vec![at(0, k), at(1, k), at(1, k + 1), at(0, k + 1)],
            vec![1, at(1, k + 1), at(1, k)],
        ]
    };
    Body { points: points.into_iter().map(narrow).collect(), faces: (0..sides).flat_map(side).collect(), albedo: 0.0 }
}

fn posed(mesh: MeshDesc, poses: &[(f64, &dyn Fn(DVec3) -> DVec3)]) -> MeshDesc {
    let view = mesh.points.view();
    let own: Vec<DVec3> = (0..view.len()).filter_map(|i| view.vec3(i)).collect();
    let points =
        |place: &dyn Fn(DVec3) -> DVec3| TypedArray::of(own.iter().map(|p| narrow(place(*p))).collect::<Vec<_>>());
    let samples = poses
        .iter()
        .map(|(time, place)| PointsSample { time: *time, points: points(*place), normals: None, widths: None })
        .collect();
    MeshDesc { point_motion: PointsMotion { samples, ..PointsMotion::default() }, ..mesh }
}

/// A square unit that faces the camera.
fn card() -> MeshDesc {
    let turned = DMat4::from_rotation_x(FRAC_PI_2) * DMat4::from_scale(DVec3::splat(0.5));
    Body::square(0.0).mesh(prim("/card", turned), 1)
}

fn driven(velocity: [f32; 3], seconds: [f64; 2]) -> MeshDesc {
    let velocities = Some(TypedArray::of(vec![velocity; 4]));
    MeshDesc { point_motion: PointsMotion { velocities, seconds, ..PointsMotion::default() }, ..card() }
}

/// A shape, what is left of the light, and how far that may be off.
type Case = (&'static str, fn() -> MeshDesc, f64, f64);

/// A shape that makes no sense.
type Bad = (&'static str, fn() -> MeshDesc);

/// Transforms at times.
type Maps = Vec<(f64, DMat4)>;

/// Whether it is a ribbon, widths at times, what is left of the light, and warnings.
type Widening = (&'static str, bool, Vec<(f64, f64)>, f64, f64);

/// The card is one of 16 square units.
const CARD: f64 = 1.0 - 1.0 / 16.0;

pub(crate) fn run(lab: &mut Lab<'_>) {
    let ball = 1.0 - PI / 16.0;
    let clean: [Case; 8] = [
        ("shapes/1e5 control points, linear", || curve(CurveBasis::Linear, &winding(100_000), 0.02), 0.5, 2e-3),
        ("shapes/1e5 control points, bspline", || curve(CurveBasis::BSpline, &winding(100_000), 0.02), 0.5, 2e-3),
        // Back on itself at x = 1, twice in one place: a band from the left to there, and half a disk at its end.
        (
            "shapes/cusp",
            || {
                let turn = [-3.0, 1.0, 1.0, 1.0, 1.0, 1.0, -3.0].map(|x| DVec3::X * x);
                curve(CurveBasis::Bezier, &turn, 0.5)
            },
            1.0 - (0.5 * 3.0 + PI * 0.03125) / 16.0,
            2e-3,
        ),
        (
            "shapes/points that hold each other",
            || shape(PrimShape::Points, &[DVec3::ZERO, DVec3::ZERO, DVec3::ZERO], 2.0),
            ball,
            2e-3,
        ),
        ("shapes/deforming, velocities of 1e9", || driven([1e9, 0.0, 0.0], [0.0, 1.0]), 1.0, 2e-3),
        ("shapes/deforming, velocities of 1e-9", || driven([1e-9, 0.0, 0.0], [0.0, 1.0]), CARD, 2e-3),
        ("shapes/deforming, over in a moment", || posed(card(), &[(0.0, &|p| p * 1e3), (1e-5, &|p| p)]), CARD, 2e-3),
        (
            "shapes/deforming through a point",
            || posed(card(), &[(0.0, &|p| p), (1.0, &|p| -p)]),
            1.0 - 1.0 / 48.0,
            3e-3,
        ),
    ];
    for (name, build, left, bound) in clean {
        lab.case(name, |lab, case| {
            let stage = lab.bench.stage(|db| sky(db, build()));
            let shot = lab.shoot(case, &stage, &eye(1.0).camera(), &way());
            lab.mean(case, "light that is left", left, &shot, bound, None);
        });
    }
    hostile(lab);
    widths(lab);
    scales(lab);
    cages(lab);
    planes(lab);
    lamps(lab);
}

/// Poses that cannot be used leave the card where it is, widths of 0 leave nothing, with a warning each.
fn hostile(lab: &mut Lab<'_>) {
    let bad: [Bad; 5] = [
        ("shapes/deforming, NaN sample", || posed(card(), &[(0.0, &|p| p), (1.0, &|_| DVec3::NAN)])),
        ("shapes/deforming, samples at 1e30", || posed(card(), &[(0.0, &|p| p), (1.0, &|p| p * 1e30)])),
        ("shapes/deforming, shutter of zero", || driven([9.0, 0.0, 0.0], [0.0, 0.0])),
        ("shapes/deforming, closed before it opens", || driven([9.0, 0.0, 0.0], [1.0, 0.0])),
        ("shapes/deforming, NaN velocity", || driven([f32::NAN, 0.0, 0.0], [0.0, 1.0])),
    ];
    for (name, build) in bad {
        lab.case(name, |lab, case| {
            let stage = lab.bench.stage(|db| sky(db, build()));
            let shot = lab.shoot_warned(case, &stage, &eye(1.0).camera(), &way());
            lab.mean(case, "light that is left", CARD, &shot, 2e-3, None);
            warnings(lab, case, &shot.warnings, "/card");
        });
    }
    let nothing: [Bad; 2] = [
        ("shapes/curve of width 0", || curve(CurveBasis::Linear, &straight(9, 1.0), 0.0)),
        ("shapes/point of width 0", || shape(PrimShape::Points, &[DVec3::ZERO], 0.0)),
    ];
    for (name, build) in nothing {
        lab.case(name, |lab, case| {
            let stage = lab.bench.stage(|db| sky(db, build()));
            let shot = lab.shoot_warned(case, &stage, &eye(1.0).camera(), &way());
            lab.mean(case, "light that is left", 1.0, &shot, 0.0, None);
            warnings(lab, case, &shot.warnings, "/shape");
        });
    }
}

/// A ball, or a ribbon across the view, with widths at times.
fn widening(ribbon: bool, all: &[(f64, f64)]) -> MeshDesc {
    let mesh = if ribbon {
        curve(CurveBasis::Linear, &straight(2, 1.0), 1.0)
    } else {
        shape(PrimShape::Points, &[DVec3::ZERO], 1.0)
    };
    let front = Primvar {
        interpolation: Interpolation::Constant,
        values: TypedArray::of(vec![[0.0_f32, 0.0, 1.0]]),
        indices: None,
    };
    let sample = |(time, wide): &(f64, f64)| PointsSample {
        time: *time,
        points: mesh.points.clone(),
        normals: None,
        widths: width(*wide).map(|width| width.values),
    };
    let samples = all.iter().map(sample).collect();
    let normals = ribbon.then_some(front);
    MeshDesc { normals, point_motion: PointsMotion { samples, ..PointsMotion::default() }, ..mesh }
}

/// Widths that change: from nothing, in a moment, and in ways that make no sense, which leaves them as they are.
fn widths(lab: &mut Lab<'_>) {
    let ball = 1.0 - PI / 16.0;
    let cases: [Widening; 7] = [
        // Of the area of a disk whose radius grows evenly from 0 to 1 a third.
        ("ball that grows from nothing", false, vec![(0.0, 0.0), (1.0, 2.0)], 1.0 - PI / 48.0, 0.0),
        ("ribbon that goes to nothing", true, vec![(0.0, 3.0), (1.0, 0.0)], 1.0 - 6.0 / 16.0, 0.0),
        ("ball of 1e9, over in a moment", false, vec![(0.0, 1e9), (1e-5, 2.0)], ball, 0.0),
        ("widths at 1e-30", false, vec![(0.0, 1e-30), (1.0, 2e-30)], 1.0, 0.0),
        ("NaN width", false, vec![(0.0, 2.0), (1.0, f64::NAN)], 1.0 - PI / 64.0, 1.0),
        ("negative width", true, vec![(0.0, 1.0), (1.0, -1.0)], 1.0 - 4.0 / 16.0, 1.0),
        ("infinite width", true, vec![(0.0, f64::INFINITY), (1.0, 1.0)], 1.0 - 4.0 / 16.0, 1.0),
    ];
    for (name, ribbon, all, left, said) in cases {
        lab.case(&format!("shapes/{name}"), |lab, case| {
            let stage = lab.bench.stage(|db| sky(db, widening(ribbon, &all)));
            let shot = lab.shoot_warned(case, &stage, &eye(1.0).camera(), &way());
            lab.mean(case, "light that is left", left, &shot, 3e-3, None);
            #[expect(clippy::cast_precision_loss, reason = "a few")]
            let warned = shot.warnings.iter().filter(|text| text.contains("widths")).count() as f64;
            lab.number(case, "warnings", said, warned, 0.0);
        });
    }
}

fn sky(db: &mut SceneDb, mesh: MeshDesc) {
    db.upsert_light(dome(1.0));
    db.upsert_mesh(mesh);
}

/// There is one, and it names what it is about.
fn warnings(lab: &mut Lab<'_>, case: &str, texts: &[String], about: &str) {
    #[expect(clippy::cast_precision_loss, reason = "a few")]
    let counted = texts.iter().filter(|text| text.contains(about)).count() as f64;
    lab.number(case, "warnings", 1.0, counted, 0.0);
}

/// Curves and points as small and as large as scenes are.
fn scales(lab: &mut Lab<'_>) {
    for scale in [1e-6, 1e9] {
        lab.case(&format!("shapes/curve at scale {scale:e}"), |lab, case| {
            let stage = lab.bench.stage(|db| sky(db, curve(CurveBasis::BSpline, &straight(9, scale), 0.5 * scale)));
            let shot = lab.shoot(case, &stage, &eye(scale).camera(), &way());
            lab.mean(case, "light that is left", 1.0 - 0.5 / 4.0, &shot, 2e-3, None);
        });
        lab.case(&format!("shapes/point at scale {scale:e}"), |lab, case| {
            let stage = lab.bench.stage(|db| sky(db, shape(PrimShape::Points, &[DVec3::ZERO], 2.0 * scale)));
            let shot = lab.shoot(case, &stage, &eye(scale).camera(), &way());
            lab.mean(case, "light that is left", 1.0 - PI / 16.0, &shot, 2e-3, None);
        });
    }
}

/// Cages with poles, and with an edge of three faces, refined: seen along the axis a spindle is the disk of its widest
/// ring, whose limit is known.
fn cages(lab: &mut Lab<'_>) {
    let smooth = |body: &Body| MeshDesc {
        subdivision: Subdivision::CatmullClark,
        refine_level: 3,
        ..body.mesh(prim("/cage", DMat4::from_rotation_x(FRAC_PI_2)), 1)
    };
    for sides in [3, 30] {
        lab.case(&format!("shapes/poles of valence {sides}"), |lab, case| {
            let stage = lab.bench.stage(|db| sky(db, smooth(&spindle(sides))));
            let shot = lab.shoot(case, &stage, &eye(1.0).camera(), &way());
            let plain =
                lab.bench.stage(|db| sky(db, smooth(&spindle(sides).moved(|p| p * DVec3::new(1.0, 1e-3, 1.0)))));
            // Seen along the axis, its height does not matter.
            let flat = lab.shoot(case, &plain, &eye(1.0).camera(), &way());
            lab.mean(case, "light that is left", crate::lab::mean(&flat), &shot, 1e-3, None);
            // The surface is a product of curves but near the poles: of the ring's, and of one from pole to pole, whose
            // middle is at 23/24 of the radius.
            let known = 1.0 - ring_area(sides) * (23.0_f64 / 24.0).powi(2) / 16.0;
            lab.mean(case, "light beside the limit's ring", known, &shot, 6e-3, None);
        });
    }
    lab.case("shapes/edge of three faces", |lab, case| {
        let mut fin = Body::square(0.0);
        // A third face on the edge at x = 1, straight up: the camera sees it from its side.
        fin.points.extend([[1.0, 1.0, 1.0], [1.0, 1.0, -1.0]]);
        fin.faces.push(vec![1, 2, 5, 4]);
        fin.faces.push(vec![1, 4, 5, 2]);
        let stage = lab.bench.stage(|db| sky(db, MeshDesc { subdivision: Subdivision::Bilinear, ..smooth(&fin) }));
        let shot = lab.shoot_warned(case, &stage, &eye(1.0).camera(), &way());
        lab.mean(case, "light that is left", 1.0 - 4.0 / 16.0, &shot, 2e-3, None);
    });
}

/// Clipping planes of a camera that say nothing, and one that does.
fn planes(lab: &mut Lab<'_>) {
    let shown = [
        ("shapes/clipping plane of NaN", DVec4::new(f64::NAN, 0.0, 0.0, 1.0), CARD, 1.0),
        ("shapes/clipping plane at infinity", DVec4::new(1.0, 0.0, 0.0, f64::INFINITY), CARD, 1.0),
        ("shapes/clipping plane without a normal", DVec4::new(0.0, 0.0, 0.0, 1.0), CARD, 0.0),
        ("shapes/clipping plane with a normal of 1e-300", DVec4::new(1e-300, 0.0, 0.0, 0.0), 1.0 - 0.5 / 16.0, 0.0),
    ];
    for (name, plane, left, said) in shown {
        lab.case(name, |lab, case| {
            let stage = lab.bench.stage(|db| sky(db, card()));
            let mut camera = eye(1.0).camera();
            camera.clip_planes = vec![plane];
            let shot = lab.shoot_warned(case, &stage, &camera, &way());
            lab.mean(case, "light that is left", left, &shot, 2e-3, None);
            // A host asks for its picture again and again: that begins nothing anew.
            let again = stage.take(&camera, &way());
            #[expect(clippy::cast_precision_loss, reason = "a few")]
            let warned =
                shot.warnings.iter().chain(&again.warnings).filter(|text| text.contains("planes")).count() as f64;
            lab.number(case, "warnings", said, warned, 0.0);
        });
    }
}

/// Lamps whose motion makes no sense light a white card as if they did not move; one that is far away in a moment
/// lights it no more.
fn lamps(lab: &mut Lab<'_>) {
    let lamp = |maps: &[(f64, DMat4)]| {
        let mut lamp = LightDesc {
            prim: prim("/lamp", DMat4::from_translation(DVec3::Z * 3.0)),
            kind: LightKind::Sphere { radius: 0.5, treat_as_point: false },
            camera_visible: false,
            ..LightDesc::default()
        };
        lamp.prim.motion =
            maps.iter().map(|(time, transform)| TransformSample { time: *time, transform: *transform }).collect();
        lamp
    };
    let own = DMat4::from_translation(DVec3::Z * 3.0);
    let aside = |x: f64| DMat4::from_translation(DVec3::X * x) * own;
    let mirror = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let cases: [(&str, Maps, f64, f64); 5] = [
        ("shapes/lamp, NaN sample", vec![(0.0, own), (1.0, aside(f64::NAN))], 1.0, 1.0),
        ("shapes/lamp, samples in the wrong order", vec![(1.0, aside(9.0)), (0.0, own)], 1.0, 1.0),
        ("shapes/lamp, turned inside out", vec![(0.0, own), (1.0, own * mirror)], 1.0, 1.0),
        ("shapes/lamp, over in a moment", vec![(0.0, aside(-5.0)), (1e-5, own)], 1.0, 0.0),
        ("shapes/lamp, velocities of 1e9", vec![(0.0, own), (1.0, aside(1e9))], 0.0, 0.0),
    ];
    for (name, maps, share, said) in cases {
        lab.case(name, |lab, case| {
            let floor = || Body { albedo: 0.5, ..Body::square(0.0) }.mesh(card().prim, 1);
            let way = Way { samples: 1024, ..way() };
            let camera = eye(0.2).camera();
            let still = lab.bench.stage(|db| {
                db.upsert_mesh(floor());
                db.upsert_light(lamp(&[]))
            });
            let still = lab.shoot(case, &still, &camera, &way);
            let stage = lab.bench.stage(|db| {
                db.upsert_mesh(floor());
                db.upsert_light(lamp(&maps))
            });
            let shot = lab.shoot_warned(case, &stage, &camera, &way);
            let reference = share * crate::lab::mean(&still);
            lab.number(case, "light", reference, crate::lab::mean(&shot), 5e-3 * crate::lab::mean(&still));
            #[expect(clippy::cast_precision_loss, reason = "a few")]
            let warned = shot.warnings.iter().filter(|text| text.contains("/lamp")).count() as f64;
            lab.number(case, "warnings", said, warned, 0.0);
        });
    }
}
