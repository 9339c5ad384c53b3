// SPDX-License-Identifier: Apache-2.0
//! Points that move while the shutter is open: against closed forms, against the mean of still pictures, and the same
//! bits in core and streaming.

use crate::scenes::{constant, deforming, dome, mesh, prim, sphere, square, sun, turning, widening};
use crate::streaming::DEFORMING;
use crate::support::{color_request, images, orthographic, perspective, read, render, request, session, settings};
use glam::{DMat4, DVec3, Vec3};
use oocpt_core::TypedArray;
use oocpt_core::scene::{CurveBasis, CurveWrap, CurvesDesc, MeshDesc, PointsMotion, PrimShape, SceneDb, Subdivision};
use oocpt_core::settings::Settings;
use oocpt_render::AovKind;

const SIZE: [u32; 2] = [48, 16];
/// Units of the picture's height.
const HEIGHT: f64 = 1.5;

/// A square of the plane z = 0, half a unit wide, in its own frame.
fn card() -> MeshDesc {
    let corner = |x: f32, y: f32| [0.25 * x, 0.25 * y, 0.0];
    let points = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    mesh(prim("/card", DMat4::IDENTITY), 1, points, &[vec![0, 1, 2, 3]], 0.5)
}

fn coverage(desc: MeshDesc) -> Vec<f64> {
    let session = session(settings(256, 0));
    session.with_scene(|db| db.upsert_mesh(desc));
    let request = color_request(orthographic(DVec3::Z * 10.0, DVec3::ZERO, HEIGHT, SIZE));
    render(&session, &request);
    read::<[f32; 4]>(&session, &request, AovKind::Color).iter().map(|color| f64::from(color[3])).collect()
}

/// Compares coverage with the share of pixel and shutter in which `covers(x, y, time)`.
fn agree(what: &str, met: &[f64], covers: impl Fn(f64, f64, f64) -> bool) {
    let pixel = HEIGHT / f64::from(SIZE[1]);
    let at = |k: u32, n: u32| (f64::from(k) + 0.5) / f64::from(n);
    let (mut largest, mut sum, mut partly) = (0.0_f64, 0.0, 0);
    for (i, met) in (0..SIZE[0] * SIZE[1]).zip(met) {
        let (x, y) = (i % SIZE[0], i / SIZE[0]);
        let mut covered = 0_u32;
        for (i, j, k) in (0..8).flat_map(|i| (0..8).flat_map(move |j| (0..128).map(move |k| (i, j, k)))) {
            let across = (f64::from(x) - 0.5 * f64::from(SIZE[0]) + at(i, 8)) * pixel;
            let up = (f64::from(y) - 0.5 * f64::from(SIZE[1]) + at(j, 8)) * pixel;
            covered += u32::from(covers(across, up, at(k, 128)));
        }
        let known = f64::from(covered) / (8.0 * 8.0 * 128.0);
        partly += u32::from(known > 0.05 && known < 0.95);
        largest = largest.max((met - known).abs());
        sum += (met - known).abs();
    }
    let mean = sum / f64::from(SIZE[0] * SIZE[1]);
    assert!(partly > 40, "{what}: {partly} pixels are covered for a part of the time");
    // Three times the deviation of so many independent samples.
    assert!(largest < 0.09 && mean < 0.004, "{what}: {largest} at most, {mean} in the mean");
}

#[test]
fn sweeping_edges_match_their_coverage_integral() {
    // The right edge goes to x = 1.75, at rest from the middle of the shutter on; the left one stays.
    let reach = |time: f64| 0.25 + 1.5 * (time / 0.5).min(1.0);
    #[expect(clippy::cast_possible_truncation, reason = "positions")]
    let stretch = |p: Vec3, time: f64| if p.x > 0.0 { Vec3::new(reach(time) as f32, p.y, p.z) } else { p };
    let met = coverage(deforming(card(), &[0.0, 0.5, 1.0], &stretch));
    agree("stretched", &met, |x, y, time| x >= -0.25 && x <= reach(time) && y.abs() <= 0.25);
    // Samples beyond the shutter: half of the way is seen.
    let slide = |p: Vec3, time: f64| p + Vec3::X * if time < 0.0 { -1.0 } else { 1.0 };
    let met = coverage(deforming(card(), &[-0.5, 1.5], &slide));
    agree("sampled outside", &met, |x, y, time| (x + 0.5 - time).abs() <= 0.25 && y.abs() <= 0.25);
    // Opposite corners shear.
    let shear = |p: Vec3, time: f64| if p.y > 0.0 && time > 0.5 { p + Vec3::X } else { p };
    let met = coverage(deforming(card(), &[0.0, 1.0], &shear));
    agree("sheared", &met, |x, y, time| (x - time * (y + 0.25) / 0.5).abs() <= 0.25 && y.abs() <= 0.25);
}

#[test]
fn velocities_move_points_by_their_arrays() {
    let rates = |v: [f32; 3]| Some(TypedArray::of(vec![v; 4]));
    let motion = PointsMotion { velocities: rates([2.0, 0.0, 0.0]), seconds: [-0.5, 0.5], ..PointsMotion::default() };
    let met = coverage(MeshDesc { point_motion: motion.clone(), ..card() });
    agree("velocities", &met, |x, y, time| (x + 1.0 - 2.0 * time).abs() <= 0.25 && y.abs() <= 0.25);
    let faster = PointsMotion { accelerations: rates([6.0, 0.0, 0.0]), ..motion };
    let met = coverage(MeshDesc { point_motion: faster, ..card() });
    // A parabola in four pieces.
    let at = |time: f64| 2.0 * (time - 0.5) + 3.0 * (time - 0.5) * (time - 0.5);
    agree("accelerations", &met, |x, y, time| {
        let (from, part) = ((time * 4.0).floor() / 4.0, (time * 4.0).fract());
        (x - at(from) * (1.0 - part) - at(from + 0.25) * part).abs() <= 0.25 && y.abs() <= 0.25
    });
}

#[test]
fn moving_spheres_leave_a_streak_of_known_coverage() {
    let ball = MeshDesc {
        shape: PrimShape::Points,
        points: TypedArray::of(vec![[0.0_f32; 3]]),
        widths: constant(0.5_f32),
        ..mesh(prim("/ball", DMat4::IDENTITY), 1, Vec::new(), &[], 0.5)
    };
    #[expect(clippy::cast_possible_truncation, reason = "positions")]
    let slide = |p: Vec3, time: f64| p + Vec3::X * (2.0 * time as f32 - 1.0);
    let met = coverage(deforming(ball, &[0.0, 1.0], &slide));
    agree("a ball", &met, |x, y, time| (x + 1.0 - 2.0 * time).hypot(y) <= 0.25);
}

/// A linear curve between two points.
fn line(from: [f32; 3], to: [f32; 3]) -> MeshDesc {
    let curves = CurvesDesc {
        basis: CurveBasis::Linear,
        wrap: CurveWrap::Nonperiodic,
        counts: TypedArray::of(vec![2_i32]),
        indices: None,
    };
    MeshDesc {
        shape: PrimShape::Curves(curves),
        points: TypedArray::of(vec![from, to]),
        ..mesh(prim("/line", DMat4::IDENTITY), 1, Vec::new(), &[], 0.5)
    }
}

#[test]
#[expect(clippy::cast_possible_truncation, reason = "widths and positions")]
fn balls_and_tubes_grow_by_their_widths() {
    let width = |time: f64| 0.2 + 1.0 * time as f32;
    let radius = |time: f64| f64::from(width(time)) / 2.0;
    let ball = MeshDesc {
        shape: PrimShape::Points,
        points: TypedArray::of(vec![[0.0_f32; 3]]),
        ..mesh(prim("/ball", DMat4::IDENTITY), 1, Vec::new(), &[], 0.5)
    };
    let met = coverage(widening(deforming(ball.clone(), &[0.0, 1.0], &|p, _| p), &width));
    agree("a ball at rest", &met, |x, y, time| x.hypot(y) <= radius(time));
    let slide = |p: Vec3, time: f64| p + Vec3::X * (2.0 * time as f32 - 1.0);
    let met = coverage(widening(deforming(ball, &[0.0, 1.0], &slide), &width));
    agree("a ball", &met, |x, y, time| (x + 1.0 - 2.0 * time).hypot(y) <= radius(time));
    let tube = line([-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]);
    let met = coverage(widening(deforming(tube, &[0.0, 1.0], &|p, _| p), &width));
    agree("a tube", &met, |x, y, time| (x.abs() - 0.5).max(0.0).hypot(y) <= radius(time));
}

#[test]
#[expect(clippy::cast_possible_truncation, reason = "widths and positions")]
fn ribbons_slide_widen_and_turn() {
    let blade = || line([0.0, -0.4, 0.0], [0.0, 0.4, 0.0]);
    let slide = |p: Vec3, time: f64| p + Vec3::X * (2.0 * time as f32 - 1.0);
    let front = |_: f64| Vec3::Z;
    let met = coverage(turning(widening(deforming(blade(), &[0.0, 1.0], &slide), &|_| 0.5), &front));
    agree("sliding", &met, |x, y, time| (x + 1.0 - 2.0 * time).abs() <= 0.25 && y.abs() <= 0.4);
    let wider = |time: f64| 0.2 + 2.0 * time as f32;
    let met = coverage(turning(widening(deforming(blade(), &[0.0, 1.0], &|p, _| p), &wider), &front));
    agree("widening", &met, |x, y, time| x.abs() <= 0.1 + time && y.abs() <= 0.4);
    // Its edges go along straight lines from across the view to along it.
    let aside = |time: f64| if time < 0.5 { Vec3::Z } else { Vec3::X };
    let met = coverage(turning(widening(deforming(blade(), &[0.0, 1.0], &|p, _| p), &|_| 3.0), &aside));
    agree("turning", &met, |x, y, time| x.abs() <= 1.5 * (1.0 - time) && y.abs() <= 0.4);
    let motion = PointsMotion {
        velocities: Some(TypedArray::of(vec![[2.0_f32, 0.0, 0.0]; 2])),
        seconds: [-0.5, 0.5],
        ..PointsMotion::default()
    };
    let blown = MeshDesc { widths: constant(0.5_f32), normals: constant([0.0, 0.0, 1.0]), ..blade() };
    let met = coverage(MeshDesc { point_motion: motion, ..blown });
    agree("velocities", &met, |x, y, time| (x + 1.0 - 2.0 * time).abs() <= 0.25 && y.abs() <= 0.4);
}

/// A ball that is squeezed, as a smooth surface or facets, and a floor, lit by a sky and a sun, as they are from
/// `open` to `close`; at one moment where these are the same.
fn squeezed(db: &mut SceneDb, open: f64, close: f64) {
    db.upsert_light(dome([0.4, 0.5, 0.7]));
    db.upsert_light(sun(2.0, 2.0, DMat4::from_rotation_x(-0.8) * DMat4::from_rotation_y(0.5)));
    db.upsert_mesh(square(prim("/floor", DMat4::from_scale(DVec3::splat(5.0))), 1, 0.5));
    let times: Vec<f64> = if open < close { vec![0.0, 0.5, 1.0] } else { vec![0.5] };
    for (i, subdivision) in [Subdivision::None, Subdivision::CatmullClark].into_iter().enumerate() {
        let place = DMat4::from_translation(DVec3::new(1.8 * i as f64 - 0.9, 1.0, 0.0));
        let ball = sphere(prim(&format!("/ball_{i}"), place), 2, 6, 0.6);
        #[expect(clippy::cast_possible_truncation, reason = "positions")]
        let squeeze = |p: Vec3, time: f64| {
            // The still is what is between the keys at its time.
            let time = if open < close { time } else { open } as f32;
            let key = |time: f32| p * Vec3::new(0.8 + 0.4 * time, 1.0 - 0.7 * time * time, 0.8) + Vec3::Y * 0.8 * time;
            let (from, to) = if time < 0.5 { (0.0, 0.5) } else { (0.5, 1.0) };
            key(from).lerp(key(to), (time - from) / 0.5)
        };
        db.upsert_mesh(MeshDesc { subdivision, refine_level: 1, ..deforming(ball, &times, &squeeze) });
    }
}

fn colors(open: f64, close: f64, settings: Settings) -> Vec<f64> {
    let session = session(settings);
    session.with_scene(|db| squeezed(db, open, close));
    let request = color_request(perspective(DVec3::new(0.0, 3.0, 9.0), DVec3::Y, 0.5, [48, 32]));
    render(&session, &request);
    read::<[f32; 4]>(&session, &request, AovKind::Color).iter().map(|c| f64::from(c[0] + c[1] + c[2])).collect()
}

fn rmse(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / a.len() as f64).sqrt()
}

#[test]
fn a_deforming_scene_equals_the_mean_of_static_renders() {
    const STILLS: u32 = 64;
    let still = |k: u32| {
        let time = (f64::from(k) + 0.5) / f64::from(STILLS);
        colors(time, time, Settings { seed: 1000 + k, ..settings(8, 2) })
    };
    let mut mean = vec![0.0; 48 * 32];
    for k in 0..STILLS {
        mean.iter_mut().zip(still(k)).for_each(|(sum, v)| *sum += v / f64::from(STILLS));
    }
    let moving = |seed| colors(0.0, 1.0, Settings { seed, ..settings(512, 2) });
    let (a, b) = (moving(1), moving(2));
    let (noise, off) = (rmse(&a, &b), rmse(&a, &mean));
    assert!(off < 1.5 * noise, "{off} from the mean of the stills; the noise is {noise}");
    let one = colors(0.5, 0.5, settings(256, 2));
    assert!(rmse(&one, &mean) > 5.0 * noise, "something moves");
}

#[test]
fn pixel_centre_aovs_are_taken_at_mid_shutter_when_deforming() {
    let camera = || perspective(DVec3::new(0.0, 3.0, 9.0), DVec3::Y, 0.5, [48, 32]);
    let with = |open, close| images(|db| squeezed(db, open, close), settings(4, 2), &request(camera()));
    let (moving, still) = (with(0.0, 1.0), with(0.5, 0.5));
    let at = AovKind::ALL.iter().position(|kind| *kind == AovKind::CameraDepth).expect("an image");
    let depths = |images: &[Vec<u8>]| bytemuck::cast_slice::<u8, f32>(&images[at]).to_vec();
    let far = depths(&moving).iter().zip(depths(&still)).filter(|(a, b)| (**a - b).abs() > 1e-4 * a.abs()).count();
    assert!(far <= 2, "the depths of the middle of the shutter, but for {far}");
    assert!(moving != still, "the colour is not that of the middle");
}

#[test]
fn deforming_chunks_have_the_same_bits_at_every_budget() {
    crate::streaming::same_bits(&DEFORMING);
}
