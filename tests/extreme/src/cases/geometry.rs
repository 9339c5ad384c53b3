// SPDX-License-Identifier: Apache-2.0
//! Triangles at the limits: slivers, without area, repeated, coincident, huge, a million in a pixel, seen edge on, with
//! the eye on them.

use glam::{DMat4, DVec3};

use crate::build::{Body, Placed, World};
use crate::lab::{Lab, ULP};
use crate::shot::Way;
use crate::tracer::camera::Eye;

pub(crate) fn run(lab: &mut Lab<'_>) {
    lab.case("geometry/slivers of aspect 1e7", slivers);
    lab.case("geometry/zero area and repeated", degenerate);
    lab.case("geometry/coincident surfaces", coincident);
    lab.case("geometry/triangle of 1e6 chunks", huge);
    lab.case("geometry/a million triangles in a pixel", million);
    lab.case("geometry/rays in the plane", edge_on);
    lab.case("geometry/origin on a surface", on_surface);
}

fn planes() -> Way {
    Way { samples: 16, bounces: 1, planes: true, ..Way::default() }
}

/// A strip of 512 slivers, 1 long and 1e-7 wide.
fn strip(albedo: f32) -> Body {
    let count = 512_i16;
    let width = 1e-7;
    let mut points = Vec::new();
    for i in 0..=count {
        let x = width * f64::from(i - count / 2);
        points.push(crate::build::narrow(DVec3::new(x, 0.0, 0.5)));
        points.push(crate::build::narrow(DVec3::new(x, 0.0, -0.5)));
    }
    let mut faces = Vec::new();
    for i in 0..i32::from(count) {
        let (a, b, c, d) = (2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1);
        faces.push(vec![a, b, c]);
        faces.push(vec![a, c, d]);
    }
    Body { points, faces, albedo }
}

fn slivers(lab: &mut Lab<'_>, case: &str) {
    let place = DMat4::from_rotation_z(0.3) * DMat4::from_rotation_x(0.2);
    let world = World { bodies: vec![Placed { body: strip(0.5), place }], dome: 1.0, sun: None };
    let stage = lab.bench.stage(|db| world.author(db));
    let up = place.transform_vector3(DVec3::NEG_Z);
    let from = place.transform_vector3(DVec3::new(0.2, 1.0, 0.1)).normalize();
    // 40 of the slivers across, and all of the strip's length but its ends.
    let eye = Eye { up, aspect: Some(4e-6), ..Eye::parallel(from, DVec3::ZERO, 0.9, [64, 32]) };
    let shot = lab.shoot(case, &stage, &eye.camera(), &planes());
    lab.distances(case, &world.tracer(), &eye, &shot, 8.0, None);
    let lost = shot.color.iter().filter(|c| (c[0] - 0.5).abs() > 1e-6).count();
    lab.count(case, "pixels that are not albedo x sky", count(lost), None);
}

#[expect(clippy::cast_precision_loss, reason = "counts of pixels")]
fn count(n: usize) -> f64 {
    n as f64
}

/// Faces without area are left out, repeated ones change nothing.
fn degenerate(lab: &mut Lab<'_>, case: &str) {
    let eye = Eye::at(DVec3::new(1.5, 2.0, 5.0), DVec3::ZERO, 0.6, [48, 32]);
    let clean = Body::sphere(10, 0.7);
    let mut dirty = clean.clone();
    for face in clean.faces.iter().take(40) {
        let (a, b) = (face[0], face[1]);
        dirty.faces.extend([face.clone(), vec![a, a, b], vec![a, b, a], vec![b, b, b]]);
    }
    let mut shots = Vec::new();
    for body in [&clean, &dirty] {
        let world = World { bodies: vec![Placed { body: body.clone(), place: DMat4::IDENTITY }], dome: 1.0, sun: None };
        let stage = lab.bench.stage(|db| world.author(db));
        shots.push(lab.shoot_warned(case, &stage, &eye.camera(), &planes()));
    }
    let [clean_shot, dirty_shot] = &shots[..] else { return };
    let pairs = || clean_shot.color.iter().zip(&dirty_shot.color);
    let differ = pairs().filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits)).count();
    lab.count(case, "pixels with other bits", count(differ), None);
    let distances = clean_shot.distance.iter().zip(&dirty_shot.distance);
    let differ = distances.filter(|(a, b)| a.to_bits() != b.to_bits()).count();
    lab.count(case, "distances with other bits", count(differ), None);
}

/// Two squares in one place: each sample sees one of them, wholly, and always the same one.
fn coincident(lab: &mut Lab<'_>, case: &str) {
    let place = DMat4::from_rotation_z(0.3) * DMat4::from_rotation_x(0.7);
    let square = |albedo| Placed { body: Body::square(albedo), place };
    let world = World { bodies: vec![square(0.25), square(0.75)], dome: 1.0, sun: None };
    let stage = lab.bench.stage(|db| world.author(db));
    let normal = place.transform_vector3(DVec3::Y);
    let eye = Eye::at(normal * 3.0 + DVec3::X * 0.4, DVec3::ZERO, 0.3, [48, 32]);
    let way = Way { samples: 64, bounces: 0, planes: true, ..Way::default() };
    let shot = lab.shoot(case, &stage, &eye.camera(), &way);
    let is = |c: &[f32; 4], albedo: f32| (c[0] - albedo).abs() < 1e-6;
    let mixed = shot.color.iter().filter(|c| !is(c, 0.25) && !is(c, 0.75)).count();
    lab.count(case, "pixels that show neither", count(mixed), None);
    let lower = shot.color.iter().filter(|c| is(c, 0.25)).count();
    let changes = lower.min(shot.color.len() - lower);
    lab.count(case, "pixels that show the other one", count(changes), None);
    let ids = shot.prim.iter().filter(|id| **id != shot.prim[0]).count();
    lab.count(case, "ids that are the other one's", count(ids), None);
}

/// A triangle that is a million times as large as the chunks around it, which stand on it.
fn huge(lab: &mut Lab<'_>, case: &str) {
    let size = 1e6;
    let ground = Body {
        points: vec![[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.1, 0.0, -1.0]],
        faces: vec![vec![0, 1, 2]],
        albedo: 0.5,
    };
    let mut bodies = vec![Placed { body: ground, place: DMat4::from_scale(DVec3::splat(size)) }];
    for i in 0..24 {
        let at = DVec3::new(f64::from(i % 6) - 2.5, 0.4, f64::from(i / 6) - 2.0);
        let place = DMat4::from_translation(at) * DMat4::from_scale(DVec3::splat(0.4));
        // Different meshes: none is shared, so that they come into chunks of their own.
        bodies.push(Placed { body: Body::sphere(10 + i % 5, 0.3 + 0.02 * narrow(i)), place });
    }
    let world = World { bodies, dome: 1.0, sun: None };
    let eye = Eye::at(DVec3::new(3.0, 3.0, 6.0), DVec3::new(0.0, 0.4, 0.0), 0.8, [48, 32]);
    let stage = lab.bench.stage(|db| world.author(db));
    let way = Way { chunk_kib: 16, ..planes() };
    let shot = lab.shoot(case, &stage, &eye.camera(), &way);
    let tracer = world.tracer();
    lab.distances(case, &tracer, &eye, &shot, 32.0, None);
    let reference = tracer.render(&eye, 256, 1, true);
    lab.light(case, &reference, &eye, &shot, &way, None);
}

#[expect(clippy::cast_precision_loss, reason = "small numbers")]
fn narrow(i: i32) -> f32 {
    i as f32
}

/// A ball of a million triangles that fills a part of one pixel.
fn million(lab: &mut Lab<'_>, case: &str) {
    let body = Body::sphere(500, 0.5);
    let triangles = body.faces.len();
    let place = DMat4::from_scale(DVec3::splat(0.3));
    let world = World { bodies: vec![Placed { body, place }], dome: 1.0, sun: None };
    let stage = lab.bench.stage(|db| world.author(db));
    let eye = Eye::parallel(DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO, 1.0, [1, 1]);
    let samples = lab.amount(1 << 12, 1 << 16);
    let shot = lab.shoot(case, &stage, &eye.camera(), &Way { samples, dome_seen: false, ..planes() });
    let cover = shot.color.first().map_or(0.0, |c| f64::from(c[3]));
    // Sobol points: their discrepancy, not chance.
    let area = std::f64::consts::PI * 0.09;
    lab.number(
        case,
        &format!("part that a ball of {triangles} triangles covers"),
        area,
        cover,
        30.0 / f64::from(samples).powf(0.75) * 0.05,
    );
    let light = shot.color.first().map_or(0.0, |c| f64::from(c[0])) / cover;
    lab.number(case, "its radiance, albedo x sky", 0.5, light, 1e-4);
}

/// A square exactly in the plane of the rays is not there, or seen where it is; what is behind it is seen right.
fn edge_on(lab: &mut Lab<'_>, case: &str) {
    let back =
        DMat4::from_translation(DVec3::Z * -3.0) * DMat4::from_rotation_x(1.2) * DMat4::from_scale(DVec3::splat(4.0));
    for (name, turn) in [("", DMat4::IDENTITY), (" turned", DMat4::from_rotation_z(0.5) * DMat4::from_rotation_y(0.7))]
    {
        let square = Placed { body: Body::square(0.2), place: turn };
        let wall = Placed { body: Body::square(0.8), place: turn * back };
        let world = World { bodies: vec![square, wall.clone()], dome: 1.0, sun: None };
        let behind = World { bodies: vec![wall], dome: 1.0, sun: None }.tracer();
        let tracer = world.tracer();
        let stage = lab.bench.stage(|db| world.author(db));
        let place = |p: DVec3| turn.transform_point3(p);
        let up = place(DVec3::Y);
        // An odd number of rows: the rays of the middle one are in the plane.
        let eye = Eye { up, ..Eye::at(place(DVec3::Z * 4.0), place(DVec3::ZERO), 0.5, [33, 33]) };
        let shot = lab.shoot(case, &stage, &eye.camera(), &planes());
        let mut wrong = 0;
        for (x, distance) in (0_u32..).zip(&shot.distance[33 * 16..33 * 17]) {
            let ray = eye.ray(f64::from(x) + 0.5, 16.5);
            let near = |t: f64| (f64::from(*distance) / t - 1.0).abs() < 64.0 * ULP;
            // In the square, from its edge at 3 to the far one at 5, or on the wall.
            let on_square = *distance > 2.99 && *distance < 5.01;
            wrong += usize::from(!(on_square || behind.first(&ray).is_some_and(|met| near(met.t))));
        }
        lab.count(case, &format!("pixels of the plane that see something else{name}"), count(wrong), None);
        let rows = |from: usize, to: usize| shot.distance[33 * from..33 * to].iter();
        let off = rows(0, 16).chain(rows(17, 33)).zip((0..16).chain(17..33).flat_map(|y| (0..33).map(move |x| (x, y))));
        let off = off.filter(|(d, (x, y))| {
            let ray = eye.ray(f64::from(*x) + 0.5, f64::from(*y) + 0.5);
            tracer.first(&ray).is_none_or(|met| (f64::from(**d) / met.t - 1.0).abs() * met.cosine > 8.0 * ULP)
        });
        lab.count(case, &format!("pixels beside the plane that are off by 8 ulps{name}"), count(off.count()), None);
    }
}

/// An eye on a floor looks up and sees the sky, and along it sees no floor.
fn on_surface(lab: &mut Lab<'_>, case: &str) {
    let world = World {
        bodies: vec![Placed { body: Body::square(0.5), place: DMat4::from_scale(DVec3::splat(5.0)) }],
        dome: 1.0,
        sun: None,
    };
    let stage = lab.bench.stage(|db| world.author(db));
    let eye = DVec3::new(0.3, 0.0, 0.7);
    for (name, to, height) in [("up", DVec3::new(0.2, 1.0, 0.1), 0.8), ("half up", DVec3::new(1.0, 0.6, 0.2), 0.8)] {
        let eye = Eye::at(eye, eye + to, height, [32, 32]);
        let shot = lab.shoot(case, &stage, &eye.camera(), &planes());
        let seen = shot.prim.iter().filter(|id| **id >= 0).count() + shot.color.iter().filter(|c| c[0] < 1.0).count();
        lab.count(case, &format!("pixels that see the floor, looking {name}"), count(seen), None);
    }
}
