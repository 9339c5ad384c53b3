// SPDX-License-Identifier: Apache-2.0
//! Rays that leave a convex body do not meet it again. The body is lit by the sky through one shadow ray a sample, and
//! not seen where it is not: what it covers less what it reflects is the number of wrong hits.

use glam::{DMat4, DQuat, DVec3};
use oocpt_core::scene::{SceneDb, Subdivision};

use super::scale::onlooker;
use super::transforms::{author_nested, eight_deep, flatten};
use crate::build::{Body, Placed, SunLight, World, dome, prim};
use crate::lab::Lab;
use crate::shot::Way;
use crate::tracer::camera::Eye;

/// How bodies come into the scene.
enum How {
    Placed(DMat4),
    /// Under eight instancers; the last of its 256 places is looked at.
    Nested,
}

/// Counted with the same arithmetic in `NumPy`, 15 600 rays at the 78 edges of the ball's silhouette: within 4e-8
/// radians of one, the triangle behind the edge, seen from its back, is nearer by rounding, and it is dark. That is
/// 3e-8 of the rays that meet the ball, 0.1 of the 3.7 million of a full run. Rays that leave the ball met it in none
/// of 2 100 000 tries, though begun at the rim of the hemisphere and at edges.
const SILHOUETTE: &str = "no ray that leaves it: a camera ray within rounding of a silhouette's edge (4e-8 radians) \
meets the triangle behind it from its back, 3e-8 of all rays (simulated)";

struct Convex {
    name: &'static str,
    body: Body,
    how: How,
    anchored: bool,
}

/// A ball pushed towards a box (the unit ball of a p-norm). Not quite convex: its quads are not flat.
fn displaced(rings: i32) -> Body {
    let p = 4.0;
    Body::sphere(rings, 0.5).moved(|v| v / v.abs().powf(p).element_sum().powf(1.0 / p))
}

fn bodies() -> Vec<Convex> {
    let turn = DQuat::from_rotation_z(0.4) * DQuat::from_rotation_x(1.1);
    let place = |scale: DVec3, at: DVec3| How::Placed(DMat4::from_scale_rotation_translation(scale, turn, at));
    let ball = || Body::sphere(24, 0.5);
    let convex = |name, body, how, anchored| Convex { name, body, how, anchored };
    vec![
        convex("ball", ball(), How::Placed(DMat4::IDENTITY), false),
        convex("ball of 1e-6", ball(), place(DVec3::splat(1e-6), DVec3::splat(1e-3)), false),
        convex("ball of 1e6", ball(), place(DVec3::splat(1e6), DVec3::X), false),
        convex("ellipsoid 1e-2 : 1 : 1e2", ball(), place(DVec3::new(1e-2, 1.0, 1e2), DVec3::ZERO), false),
        convex(
            "displaced ball, 1e5 away, anchored",
            displaced(24),
            place(DVec3::ONE, DVec3::new(1e5, 2e4, -3e4)),
            true,
        ),
        convex("displaced ball in 8 instancers", displaced(12), How::Nested, false),
    ]
}

impl Convex {
    fn author(&self, db: &mut SceneDb) {
        match &self.how {
            How::Placed(place) => db.upsert_mesh(self.body.mesh(prim("/body", *place), 1)),
            How::Nested => author_nested(db, &eight_deep(), &self.body),
        }
        if self.anchored {
            db.upsert_mesh(Body::cube(0.5).mesh(prim("/anchor", DMat4::from_scale(DVec3::splat(1e-3))), 2));
        }
        db.upsert_light(dome(1.0));
    }

    /// A camera close to it, that sees it as a ball of radius 1 under its map.
    fn eye(&self) -> Eye {
        let place = match &self.how {
            How::Placed(place) => *place,
            How::Nested => flatten(&eight_deep(), &self.body).pop().map_or(DMat4::IDENTITY, |placed| placed.place),
        };
        let centre = place.transform_point3(DVec3::ZERO);
        let size = [0, 1, 2].map(|k| place.col(k).truncate().length()).into_iter().fold(0.0, f64::max);
        Eye::at(centre + DVec3::new(1.0, 1.5, 2.0) * size, centre, 0.7, [64, 64])
    }
}

pub(crate) fn run(lab: &mut Lab<'_>) {
    for convex in bodies() {
        lab.case(&format!("self-hits/{}", convex.name), |lab, case| wrong_hits(lab, case, &convex));
    }
    lab.case("self-hits/displaced ball, not convex", bumpy);
    lab.case("terminator/flat", |lab, case| terminator(lab, case, Subdivision::None));
    lab.case("terminator/smooth", |lab, case| terminator(lab, case, Subdivision::CatmullClark));
}

fn wrong_hits(lab: &mut Lab<'_>, case: &str, convex: &Convex) {
    let samples = lab.amount(32, 1024);
    let way = Way { samples, dome_seen: false, ..Way::default() };
    let stage = lab.bench.stage(|db| convex.author(db));
    let shot = lab.shoot(case, &stage, &convex.eye().camera(), &way);
    let (mut rays, mut lit) = (0.0, 0.0);
    for color in &shot.color {
        rays += (f64::from(color[3]) * f64::from(samples)).round();
        lit += (f64::from(color[0]) * 2.0 * f64::from(samples)).round();
    }
    if !convex.name.starts_with("displaced") {
        // Of a closed body's silhouette a ray may meet the back first: see `SILHOUETTE`.
        let known = lab.options.full.then_some((3.0, SILHOUETTE));
        lab.count(case, &format!("wrong hits of {rays:.0} rays"), rays - lit, known.filter(|_| rays > lit));
        return;
    }
    // What is not convex, and the 256 bodies of the nested ones, shadow themselves a little.
    let bodies = match &convex.how {
        How::Placed(place) => vec![Placed { body: convex.body.clone(), place: *place }],
        How::Nested => flatten(&eight_deep(), &convex.body),
    };
    let reference = World { bodies, dome: 1.0, sun: None }.tracer().render(&convex.eye(), 256, 0, false);
    lab.light(case, &reference, &convex.eye(), &shot, &way, None);
}

/// Bumps shadow each other; light against the f64 tracer.
fn bumpy(lab: &mut Lab<'_>, case: &str) {
    let bump = |v: DVec3| v * (1.0 + 0.15 * (7.0 * v.x).sin() * (6.0 * v.y).cos() + 0.05 * (31.0 * v.z).sin());
    let body = Body::sphere(32, 0.5).moved(bump);
    let sun = Some(SunLight { direction: DVec3::new(0.9, 0.3, 0.2), irradiance: 2.0, degrees: 1.0 });
    let world = World { bodies: vec![Placed { body, place: DMat4::from_scale(DVec3::splat(1e3)) }], dome: 0.3, sun };
    let eye = onlooker(700.0, DVec3::ZERO, [64, 48]);
    let way = Way { samples: lab.amount(32, 1024), ..Way::default() };
    let stage = lab.bench.stage(|db| world.author(db));
    let shot = lab.shoot(case, &stage, &eye.camera(), &way);
    let reference = world.tracer().render(&eye, 512, 0, true);
    lab.light(case, &reference, &eye, &shot, &way, None);
}

/// A ball under a sun from the side: what faces it is lit, what does not is dark, triangle by triangle.
fn terminator(lab: &mut Lab<'_>, case: &str, subdivision: Subdivision) {
    let direction = DVec3::new(1.0, 0.35, 0.2).normalize();
    let sun = Some(SunLight { direction, irradiance: 3.0, degrees: 0.0 });
    let placed = Placed { body: Body::sphere(10, 0.5), place: DMat4::IDENTITY };
    let world = World { bodies: vec![placed.clone()], dome: 0.0, sun };
    let stage = lab.bench.stage(|db| {
        world.author(db);
        let mut mesh = placed.body.mesh(prim("/body_0", placed.place), 0);
        mesh.subdivision = subdivision;
        db.upsert_mesh(mesh);
    });
    let eye = Eye::at(DVec3::new(0.0, 0.8, 4.0), DVec3::ZERO, 0.6, [96, 96]);
    let shot = lab.shoot(case, &stage, &eye.camera(), &Way { samples: lab.amount(16, 1024), ..Way::default() });
    let tracer = world.tracer();
    let (mut acne, mut leaks, mut looked) = (0_u32, 0_u32, 0_u32);
    for (pixel, color) in (0_u32..).zip(&shot.color) {
        let (x, y) = (f64::from(pixel % 96), f64::from(pixel / 96));
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.5)];
        let faces: Vec<Option<DVec3>> =
            corners.iter().map(|(dx, dy)| tracer.first(&eye.ray(x + dx, y + dy)).map(|met| met.normal)).collect();
        let Some(normal) = faces[0].filter(|_| faces.iter().all(|face| *face == faces[0])) else { continue };
        let cosine = normal.dot(direction) * normal.dot(eye.eye).signum();
        looked += 1;
        // Of a smooth ball also the shading normal, next to the place itself, has to face the sun.
        let place = tracer.first(&eye.ray(x + 0.5, y + 0.5)).map(|met| eye.ray(x + 0.5, y + 0.5).at(met.t));
        let faces = subdivision == Subdivision::None || place.is_some_and(|p| p.normalize().dot(direction) > 0.1);
        acne += u32::from(cosine > 1e-3 && faces && color[0] <= 0.0);
        leaks += u32::from(cosine < -1e-3 && color[0] > 0.0);
    }
    lab.count(case, &format!("dark pixels that face the sun, of {looked}"), f64::from(acne), None);
    lab.count(case, &format!("lit pixels that face away, of {looked}"), f64::from(leaks), None);
}
