// SPDX-License-Identifier: Apache-2.0
//! Curves and points on the device against a solver in f64 that knows nothing of cones: a hull of two balls is met
//! where the first of all balls between them is met.

use crate::scenes::{constant, dome, prim};
use crate::support::{orthographic, perspective, read, render, request, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::TypedArray;
use oocpt_core::camera::Camera;
use oocpt_core::scene::{CurveBasis, CurveWrap, CurvesDesc, Interpolation, MeshDesc, PrimShape, Primvar, SceneDb};
use oocpt_render::{AovKind, Session};

const SIZE: [u32; 2] = [96, 64];

/// Numbers between -1 and 1 that only depend on `i`.
fn scattered(i: u32) -> DVec3 {
    let i = f64::from(i + 1);
    2.0 * DVec3::new(0.754_877_666_246_7 * i, 0.569_840_290_998 * i, 0.381_966_011_250_1 * i).fract() - 1.0
}

/// Centres and radii of a piece.
type Piece = [(DVec3, f64); 2];

#[expect(clippy::cast_possible_truncation, reason = "single precision is what a scene has")]
fn width(radius: f64) -> f32 {
    2.0 * radius as f32
}

/// Linear curves through the points of `pieces`, two points each.
fn lines(path: &str, id: i32, pieces: &[Piece]) -> MeshDesc {
    let points: Vec<[f32; 3]> = pieces.iter().flatten().map(|(at, _)| at.as_vec3().to_array()).collect();
    let widths: Vec<f32> = pieces.iter().flatten().map(|(_, radius)| width(*radius)).collect();
    MeshDesc {
        prim: prim(path, DMat4::IDENTITY),
        prim_id: id,
        shape: PrimShape::Curves(CurvesDesc {
            basis: CurveBasis::Linear,
            wrap: CurveWrap::Nonperiodic,
            counts: TypedArray::of(vec![2_i32; pieces.len()]),
            indices: None,
        }),
        points: TypedArray::of(points),
        widths: Some(Primvar { interpolation: Interpolation::Vertex, values: TypedArray::of(widths), indices: None }),
        display_color: constant([1.0_f32; 3]),
        ..MeshDesc::default()
    }
}

/// Points with the widths of the first ends of `pieces`.
fn points(path: &str, id: i32, pieces: &[Piece]) -> MeshDesc {
    let widths: Vec<f32> = pieces.iter().map(|piece| width(piece[0].1)).collect();
    let places: Vec<[f32; 3]> = pieces.iter().map(|piece| piece[0].0.as_vec3().to_array()).collect();
    MeshDesc {
        shape: PrimShape::Points,
        points: TypedArray::of(places),
        widths: Some(Primvar { interpolation: Interpolation::Vertex, values: TypedArray::of(widths), indices: None }),
        ..lines(path, id, &[])
    }
}

/// Where the ray first meets a ball.
fn ball(center: DVec3, radius: f64, o: DVec3, d: DVec3) -> Option<f64> {
    let (along, squared) = ((center - o).dot(d), d.length_squared());
    let across = (center - o) - d * (along / squared);
    let rest = radius * radius - across.length_squared();
    (rest >= 0.0).then(|| (along - (rest * squared).sqrt()) / squared)
}

/// Where a convex function on an interval is least, by thirds.
fn least(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..70 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if f(a) < f(b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}

/// Where the ray first meets the balls between both ends, and the number of that ball. How far a ball is from the line
/// is convex along the piece, and so is where the line enters those that it meets: the hull is convex.
fn hull(piece: &Piece, o: DVec3, d: DVec3) -> Option<(f64, f64)> {
    let [(p0, r0), (p1, r1)] = *piece;
    let center = |u: f64| p0 + (p1 - p0) * u;
    let radius = |u: f64| r0 + (r1 - r0) * u;
    let across = |p: DVec3| ((p - o) - d * ((p - o).dot(d) / d.length_squared())).length();
    if across(center(0.5)) > 0.5 * p0.distance(p1) + r0.max(r1) {
        return None;
    }
    let beside = |u: f64| across(center(u)) - radius(u);
    let deepest = least(0.0, 1.0, beside);
    if beside(deepest) > 0.0 {
        return None;
    }
    let edge = |mut outside: f64, mut inside: f64| {
        if beside(outside) <= 0.0 {
            return outside;
        }
        for _ in 0..60 {
            let middle = 0.5 * (outside + inside);
            if beside(middle) <= 0.0 { inside = middle } else { outside = middle }
        }
        inside
    };
    let at = |u: f64| ball(center(u), radius(u), o, d).unwrap_or(f64::INFINITY);
    let u = least(edge(0.0, deepest), edge(1.0, deepest), at);
    let ends = [0.0, 1.0, u, deepest].map(|u| (at(u), u));
    ends.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(t, _)| t.is_finite())
}

/// Origin and direction of the ray through a pixel's centre; the direction is one unit along the view.
fn ray(camera: &Camera, x: u32, y: u32) -> (DVec3, DVec3) {
    let ndc = [(x, SIZE[0]), (y, SIZE[1])].map(|(k, size)| (f64::from(k) + 0.5) / f64::from(size) * 2.0 - 1.0);
    let p = camera.projection;
    let is_perspective = p.z_axis.w != 0.0;
    let across = DVec3::new(ndc[0] / p.x_axis.x, ndc[1] / p.y_axis.y, 0.0);
    let (o, d) = if is_perspective { (DVec3::ZERO, across - DVec3::Z) } else { (across, -DVec3::Z) };
    (camera.world_from_view.transform_point3(o), camera.world_from_view.transform_vector3(d))
}

struct Seen {
    depth: Vec<f32>,
    normals: Vec<[f32; 3]>,
    ids: Vec<i32>,
}

fn see(session: &Session, camera: &Camera) -> Seen {
    let request = request(camera.clone());
    render(session, &request);
    Seen {
        depth: read(session, &request, AovKind::CameraDepth),
        normals: read(session, &request, AovKind::Normal),
        ids: read(session, &request, AovKind::PrimId),
    }
}

/// Compares all pixels with the nearest of `pieces`. `allowed`: largest error of a depth.
fn compare(name: &str, seen: &Seen, camera: &Camera, pieces: &[Piece], allowed: f64) {
    let (mut hits, mut doubtful) = (0, 0);
    for (pixel, id) in seen.ids.iter().enumerate() {
        let pixel_u32 = u32::try_from(pixel).expect("small");
        let (o, d) = ray(camera, pixel_u32 % SIZE[0], pixel_u32 / SIZE[0]);
        let nearest = pieces.iter().filter_map(|piece| Some((hull(piece, o, d)?, piece)));
        let nearest = nearest.filter(|((t, _), _)| *t > 0.0).min_by(|a, b| a.0.0.total_cmp(&b.0.0));
        // At the outline rounding decides.
        let grow = |piece: &Piece, by: f64| piece.map(|(at, radius)| (at, (radius + by).max(0.0)));
        let misses = |by: f64| pieces.iter().all(|piece| hull(&grow(piece, by), o, d).is_none());
        let Some(((t, u), piece)) = nearest else {
            assert!(*id < 0 || !misses(allowed), "{name}: pixel {pixel} shows something where there is nothing");
            continue;
        };
        if *id < 0 {
            assert!(misses(-allowed), "{name}: pixel {pixel} misses what it should see");
            doubtful += 1;
            continue;
        }
        let center = piece[0].0 + (piece[1].0 - piece[0].0) * u;
        let normal = (o + d * t - center).normalize();
        let facing = -normal.dot(d.normalize());
        let depth = f64::from(seen.depth[pixel]);
        // Depth moves by more where the surface is seen from the side.
        if facing < 0.05 {
            doubtful += 1;
            continue;
        }
        assert!(
            (depth - t).abs() <= allowed / facing,
            "{name}: pixel {pixel}: depth {depth}, not {t}, facing {facing}"
        );
        let shown = DVec3::from(seen.normals[pixel].map(f64::from));
        let cosine = shown.dot(normal);
        assert!(cosine > 1.0 - 1e-3, "{name}: pixel {pixel}: normal {shown}, not {normal}");
        hits += 1;
    }
    assert!(hits > 300, "{name}: only {hits} pixels see anything");
    assert!(doubtful * 10 < hits, "{name}: {doubtful} of {hits} pixels are in doubt");
}

fn cameras() -> [(&'static str, Camera); 2] {
    let eye = DVec3::new(0.4, 0.7, 5.0);
    [
        ("perspective", perspective(eye, DVec3::ZERO, 0.6, SIZE)),
        ("orthographic", orthographic(eye, DVec3::ZERO, 2.6, SIZE)),
    ]
}

fn check(name: &str, pieces: &[Piece], build: impl Fn(&[Piece]) -> MeshDesc, scale: f64) {
    let session = session(settings(1, 0));
    session.with_scene(|db: &mut SceneDb| {
        db.upsert_mesh(build(pieces));
        db.upsert_light(dome([1.0; 3]));
    });
    for (view, camera) in cameras() {
        compare(&format!("{name}, {view}"), &see(&session, &camera), &camera, pieces, 4e-6 * scale);
    }
}

#[test]
fn tapered_curve_hits_match_the_hull_of_spheres() {
    let pieces: Vec<Piece> = (0..40)
        .map(|i| {
            let (from, to) = (scattered(2 * i), scattered(2 * i + 1));
            [(from, 0.02 + 0.1 * scattered(i + 500).x.abs()), (to, 0.02 + 0.15 * scattered(i + 700).x.abs())]
        })
        .collect();
    check("tapered", &pieces, |pieces| lines("/lines", 3, pieces), 5.0);
}

#[test]
fn long_thin_curve_pieces_keep_their_radius() {
    let pieces: Vec<Piece> = (0..12)
        .map(|i| {
            let (from, to) = (30.0 * scattered(2 * i), 30.0 * scattered(2 * i + 1));
            [(from, 0.1), (to, 0.1)]
        })
        .chain([[(DVec3::new(-200.0, 0.1, 0.0), 0.3), (DVec3::new(300.0, -0.2, 0.1), 0.3)]])
        .collect();
    check("long", &pieces, |pieces| lines("/lines", 3, pieces), 300.0);
}

#[test]
fn nested_spheres_are_hit_exactly() {
    let pieces: Vec<Piece> = (0..60)
        .map(|i| {
            let at = (scattered(i), 0.04 + 0.15 * scattered(i + 300).x.abs());
            [at, at]
        })
        .collect();
    check("points", &pieces, |pieces| points("/points", 3, pieces), 5.0);
    // The ball at one end has the other one inside: the hull is that ball alone.
    let inside: Vec<Piece> =
        (0..30).map(|i| [(scattered(i), 0.25), (scattered(i) + 0.1 * scattered(i + 90), 0.05)]).collect();
    check("balls in balls", &inside, |pieces| lines("/lines", 3, pieces), 5.0);
}

/// A thick curve of pieces that turn from one to the next: nothing shines through its joints.
#[test]
fn curve_joints_leave_no_gap() {
    let count = 400_u32;
    let place = |k: u32| {
        let t = 0.11 * f64::from(k);
        DVec3::new(0.9 * (1.3 * t).sin(), 0.02 * f64::from(k) / 4.0 - 1.0, 0.9 * t.cos()) + 0.05 * scattered(k)
    };
    let points: Vec<[f32; 3]> = (0..count).map(|k| place(k).as_vec3().to_array()).collect();
    let pieces: Vec<Piece> = (1..count).map(|k| [(place(k - 1), 0.06), (place(k), 0.06)]).collect();
    let chain = move |_: &[Piece]| MeshDesc {
        shape: PrimShape::Curves(CurvesDesc {
            basis: CurveBasis::Linear,
            wrap: CurveWrap::Nonperiodic,
            counts: TypedArray::of(vec![i32::try_from(count).unwrap()]),
            indices: None,
        }),
        points: TypedArray::of(points.clone()),
        widths: constant(0.12_f32),
        ..lines("/chain", 3, &[])
    };
    check("chain", &pieces, chain, 5.0);
}

/// A white ball, and a white capsule, in a white dome disappear: no ray that leaves them meets them again.
#[test]
fn white_curves_and_points_in_a_white_furnace_disappear() {
    let far = DVec3::new(1000.0, -500.0, 2000.0);
    for (name, at, pieces) in [
        ("a ball", DVec3::ZERO, vec![[(DVec3::ZERO, 1.0), (DVec3::ZERO, 1.0)]]),
        ("a capsule", DVec3::ZERO, vec![[(DVec3::X, 0.6), (-DVec3::X, 0.3)]]),
        ("a capsule far away", far, vec![[(far + DVec3::X, 0.6), (far - DVec3::X, 0.3)]]),
    ] {
        let session = session(settings(64, 100));
        session.with_scene(|db: &mut SceneDb| {
            let (balls, tubes) = (points("/points", 1, &pieces), lines("/lines", 1, &pieces));
            db.upsert_mesh(if pieces[0][0] == pieces[0][1] { balls } else { tubes });
            db.upsert_light(dome([1.0; 3]));
        });
        let request = request(perspective(at + DVec3::new(0.5, 1.0, 5.0), at, 0.7, [24, 16]));
        render(&session, &request);
        let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
        let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
        assert!(ids.contains(&1) && ids.contains(&-1), "{name} covers a part of the image");
        let worst = colors.iter().map(|color| (color[0] - 1.0).abs()).fold(0.0, f32::max);
        assert!(worst < 0.1, "{name}: a pixel is off by {worst}");
        let mean = colors.iter().map(|color| f64::from(color[0])).sum::<f64>() / colors.len() as f64;
        assert!((mean - 1.0).abs() < 1e-3, "{name}: mean radiance {mean}");
    }
}
