// SPDX-License-Identifier: Apache-2.0
//! Rays at shared edges and vertices of closed meshes, from inside: none gets out. The mesh is black, the dome outside
//! white: a sample is 1 if and only if its ray got out.

use glam::{DMat4, DQuat, DVec3};
use oocpt_core::scene::SceneDb;

use super::transforms::{author_nested, eight_deep, flatten};
use crate::build::{Body, Placed, dome, prim};
use crate::lab::Lab;
use crate::shot::{Stage, Way};
use crate::tracer::camera::Eye;

/// Height of a bundle of rays at an edge or a vertex, radians: a few steps of a float.
const NARROW: f64 = 5e-7;
/// Vertices that are looked at: edge functions that round edge by edge leave gaps at some, and none at others; on an
/// H200, not on lavapipe.
const VERTICES: usize = 24;

struct Vessel {
    name: &'static str,
    body: Body,
    /// World from body.
    place: DMat4,
    chunk_kib: u32,
    nested: bool,
}

fn vessels() -> Vec<Vessel> {
    let turn = DQuat::from_rotation_z(0.4) * DQuat::from_rotation_x(1.1);
    let far = DMat4::from_scale_rotation_translation(DVec3::new(0.03, 700.0, 5.0), turn, DVec3::new(1e7, -3e6, 2e5));
    let near = DMat4::from_scale_rotation_translation(DVec3::new(1.3, 0.9, 1.1), turn, DVec3::new(0.3, -0.2, 0.7));
    let vessel = |name, rings, place, chunk_kib| Vessel {
        name,
        body: Body::sphere(rings, 0.0),
        place,
        chunk_kib,
        nested: false,
    };
    let rings = eight_deep();
    let deep = flatten(&rings, &Body::sphere(6, 0.0)).pop().map_or(DMat4::IDENTITY, |placed| placed.place);
    vec![
        vessel("at rest", 16, DMat4::IDENTITY, 8192),
        vessel("turned", 16, near, 8192),
        vessel("stretched, 1e7 away", 16, far, 8192),
        vessel("split over chunks", 64, near, 16),
        Vessel { name: "8 instancers deep", body: Body::sphere(12, 0.0), place: deep, chunk_kib: 8192, nested: true },
    ]
}

impl Vessel {
    fn author(&self, db: &mut SceneDb) {
        if self.nested {
            author_nested(db, &eight_deep(), &self.body);
        } else {
            let placed = Placed { body: self.body.clone(), place: self.place };
            db.upsert_mesh(placed.body.mesh(prim("/vessel", placed.place), 1));
            // Keeps the world's frame where it is.
            db.upsert_mesh(Body::cube(0.0).mesh(prim("/anchor", DMat4::from_scale(DVec3::splat(1e-3))), 2));
        }
        db.upsert_light(dome(1.0));
    }

    /// A bundle from `eye` to `target`, both in the body's frame. `normal`: of the plane through both in which an edge
    /// is.
    fn bundle(&self, eye: DVec3, target: DVec3, normal: DVec3, line: bool) -> Eye {
        let place = |p: DVec3| self.place.transform_point3(p);
        let up = self.place.inverse().transpose().transform_vector3(normal).normalize();
        let size = if line { [256, 8] } else { [32, 32] };
        let aspect = if line { Some(1.0 / (0.5 * NARROW).tan()) } else { Some(1.0) };
        Eye { up, aspect, ..Eye::at(place(eye), place(target), NARROW, size) }
    }

    fn bundles(&self) -> Vec<Eye> {
        let mut eyes = Vec::new();
        // Edges lie in the plane y = 0 and in those through the poles; the eye is in the plane, off the middle.
        for (eye, to, normal) in [
            (DVec3::new(0.21, 0.0, 0.13), DVec3::X, DVec3::Y),
            (DVec3::new(0.21, 0.0, 0.13), DVec3::NEG_Z, DVec3::Y),
            (DVec3::new(0.17, 0.31, 0.0), DVec3::X, DVec3::Z),
            (DVec3::new(0.0, -0.22, 0.1), DVec3::Y, DVec3::X),
        ] {
            eyes.push(self.bundle(eye, to, normal, true));
        }
        let vertices = self.body.points.len();
        for i in 0..VERTICES {
            let at = if i == 0 { 0 } else { (i * vertices) / VERTICES + i };
            let target = crate::build::wide(self.body.points[at.min(vertices - 1)]);
            eyes.push(self.bundle(DVec3::new(0.11, -0.07, 0.19), target, DVec3::new(0.3, 0.5, 0.8), false));
        }
        eyes
    }
}

pub(crate) fn run(lab: &mut Lab<'_>) {
    for vessel in vessels() {
        lab.case(&format!("watertight/{}", vessel.name), |lab, case| leaks(lab, case, &vessel));
    }
    lab.case("watertight/a hole is noticed", holed);
}

/// Counts rays that get out; gives how many there were.
fn escapes(lab: &mut Lab<'_>, case: &str, stage: &Stage, eyes: &[Eye], way: &Way) -> (f64, f64) {
    let (mut out, mut rays) = (0.0, 0.0);
    for eye in eyes {
        let shot = lab.shoot(case, stage, &eye.camera(), way);
        for color in &shot.color {
            out += (f64::from(color[0]) * f64::from(way.samples)).round();
            rays += f64::from(way.samples);
        }
    }
    (out, rays)
}

fn leaks(lab: &mut Lab<'_>, case: &str, vessel: &Vessel) {
    // 28 bundles of about 1000 to 2000 pixels, 5 vessels.
    let samples = lab.amount(16, 1024);
    let way = Way { samples, chunk_kib: vessel.chunk_kib, ..Way::default() };
    let stage = lab.bench.stage(|db| vessel.author(db));
    let (out, rays) = escapes(lab, case, &stage, &vessel.bundles(), &way);
    lab.count(case, &format!("rays that got out, of {rays:.0}"), out, None);
}

/// The count must see a hole: one triangle at a pole is missing.
fn holed(lab: &mut Lab<'_>, case: &str) {
    let Some(mut vessel) = vessels().into_iter().nth(1) else { return };
    vessel.body.faces.remove(0);
    let stage = lab.bench.stage(|db| vessel.author(db));
    let eyes = vessel.bundles();
    let (out, rays) = escapes(lab, case, &stage, &eyes[4..5], &Way { samples: 4, ..Way::default() });
    let missed = if out > 0.0 { 0.0 } else { 1.0 };
    lab.number(case, &format!("hole seen by {rays:.0} rays at its corner"), 1.0, 1.0 - missed, 0.0);
}
