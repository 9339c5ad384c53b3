// SPDX-License-Identifier: Apache-2.0
//! More rays that must not get out of a closed mesh: camera rays of which no two are the same, shadow rays (any hit is
//! enough), and rays that begin on a surface inside.
//!
//! A bundle from a pinhole is so narrow that its rays have few different directions in f32. Through a lens that is in
//! focus on a vertex or an edge each ray has an origin of its own. For the other two kinds a patch stands in a plane in
//! which edges are, and so do eye and lamp: the patch is seen along a line in that plane, and what goes on from there
//! crosses those edges, each ray at another place.

use glam::{DMat4, DVec3};
use oocpt_core::scene::{LightDesc, LightKind, ParamValue, SceneDb};

use crate::build::{Body, dome, material, prim, wide};
use crate::lab::Lab;
use crate::shot::{Stage, Way};
use crate::tracer::camera::Eye;

/// Height of what is looked at, radians: a few steps of a float.
const NARROW: f64 = 5e-7;
/// Radius of the lens.
const LENS: f64 = 0.05;
/// Places that the lens is in focus on.
const PLACES: usize = 24;

/// What goes on from the patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Onward {
    /// Shadow rays to a point light outside.
    Shadow,
    /// Reflected rays, to the sky outside.
    Mirror,
}

/// A closed mesh: rings, and KiB of a chunk.
const VESSELS: [(&str, i32, u32); 2] = [("whole", 16, 8192), ("split over chunks", 64, 16)];

pub(crate) fn run(lab: &mut Lab<'_>) {
    for (name, rings, chunk_kib) in VESSELS {
        let body = Body::sphere(rings, 0.0);
        lab.case(&format!("watertight/through a lens, {name}"), |lab, case| {
            through_a_lens(lab, case, &body, chunk_kib);
        });
        for onward in [Onward::Shadow, Onward::Mirror] {
            let kind = format!("{onward:?}").to_lowercase();
            lab.case(&format!("watertight/{kind} rays, {name}"), |lab, case| {
                for (a, b) in PLANES {
                    let lit = lit(lab, case, &body, (a, b), onward, chunk_kib);
                    lab.count(case, &format!("pixels lit from outside across {a}, of {}", lit.1), lit.0, None);
                }
            });
        }
    }
    lab.case("watertight/holes are noticed", holed);
}

/// Planes with edges: towards the edges, and across.
const PLANES: [(DVec3, DVec3); 3] = [(DVec3::X, DVec3::Z), (DVec3::NEG_Z, DVec3::X), (DVec3::Y, DVec3::X)];

fn way(lab: &Lab<'_>, chunk_kib: u32) -> Way {
    Way { samples: lab.amount(8, 1024), chunk_kib, ..Way::default() }
}

/// Rays that got out, and how many there were.
fn escaped(lab: &mut Lab<'_>, case: &str, body: &Body, places: &[DVec3], way: &Way) -> (f64, f64) {
    let stage = lab.bench.stage(|db| {
        db.upsert_mesh(body.mesh(prim("/vessel", DMat4::IDENTITY), 1));
        db.upsert_light(dome(1.0));
    });
    let (mut out, mut rays) = (0.0, 0.0);
    for &place in places {
        let eye = DVec3::new(0.11, -0.07, 0.19);
        let mut camera = Eye { up: DVec3::new(0.3, 0.5, 0.8), ..Eye::at(eye, place, NARROW, [32, 32]) }.camera();
        (camera.lens_radius, camera.focus_distance) = (LENS, (place - eye).length());
        for color in &lab.shoot(case, &stage, &camera, way).color {
            out += (f64::from(color[0]) * f64::from(way.samples)).round();
            rays += f64::from(way.samples);
        }
    }
    (out, rays)
}

/// Vertices, and points of edges.
fn places(body: &Body) -> Vec<DVec3> {
    let point = |face: &Vec<i32>, k: usize| wide(body.points[usize::try_from(face[k]).unwrap_or(0)]);
    let face = |i: usize| &body.faces[(i * body.faces.len() / PLACES + i) % body.faces.len()];
    let vertices = (0..PLACES).step_by(2).map(|i| point(face(i), 0));
    let edges = (1..PLACES).step_by(2).map(|i| point(face(i), 0).lerp(point(face(i), 1 + i % 2), 0.37));
    vertices.chain(edges).collect()
}

fn through_a_lens(lab: &mut Lab<'_>, case: &str, body: &Body, chunk_kib: u32) {
    let way = way(lab, chunk_kib);
    let (out, rays) = escaped(lab, case, body, &places(body), &way);
    lab.count(case, &format!("rays that got out, of {rays:.0}"), out, None);
}

/// Pixels of the patch that something outside lights, and how many there are.
fn lit(
    lab: &mut Lab<'_>,
    case: &str,
    body: &Body,
    plane: (DVec3, DVec3),
    onward: Onward,
    chunk_kib: u32,
) -> (f64, usize) {
    let (towards, across) = plane;
    let stage: Stage = lab.bench.stage(|db| author(db, body, plane, onward));
    let eye = 0.3 * towards + 0.2 * across;
    let camera = Eye {
        up: towards.cross(across),
        aspect: Some(0.1 / (0.5 * NARROW).tan()),
        ..Eye::at(eye, -0.3 * towards, NARROW, [256, 8])
    };
    let way = Way { bounces: u32::from(onward == Onward::Mirror), ..way(lab, chunk_kib) };
    let shot = lab.shoot(case, &stage, &camera.camera(), &way);
    let lit = shot.color.iter().filter(|color| color[0] > 0.0).count();
    #[expect(clippy::cast_precision_loss, reason = "few")]
    let number = lit as f64;
    (number, shot.color.len())
}

fn author(db: &mut SceneDb, body: &Body, (towards, across): (DVec3, DVec3), onward: Onward) {
    db.upsert_mesh(body.mesh(prim("/vessel", DMat4::IDENTITY), 1));
    let axes = [across, towards, across.cross(towards)].map(|axis| (0.2 * axis).extend(0.0));
    let place = DMat4::from_cols(axes[0], axes[1], axes[2], (-0.3 * towards).extend(1.0));
    let mut patch = Body::square(1.0).mesh(prim("/patch", place), 2);
    if onward == Onward::Mirror {
        let values = [("metallic", 1.0), ("roughness", 0.0)].map(|(name, value)| (name, ParamValue::Float(value)));
        db.upsert_material(material("/mirror", &values));
        patch.material = Some("/mirror".into());
        db.upsert_light(dome(1.0));
    } else {
        let kind = LightKind::Sphere { radius: 0.1, treat_as_point: true };
        let at = DMat4::from_translation(3.0 * towards + 0.4 * across);
        db.upsert_light(LightDesc { prim: prim("/lamp", at), kind, intensity: 100.0, ..LightDesc::default() });
    }
    db.upsert_mesh(patch);
}

/// The counts must see holes: the faces that the rays would cross are missing.
fn holed(lab: &mut Lab<'_>, case: &str) {
    let whole = Body::sphere(16, 0.0);
    let without = |keep: &dyn Fn(DVec3) -> bool| {
        let mut body = whole.clone();
        let points = body.points.clone();
        let at = |i: i32| wide(points[usize::try_from(i).unwrap_or(0)]);
        body.faces.retain(|face| face.iter().all(|&i| keep(at(i))));
        body
    };
    let mut corner = whole.clone();
    corner.faces.remove(0);
    let (out, rays) = escaped(lab, case, &corner, &places(&whole)[..1], &Way { samples: 4, ..Way::default() });
    lab.number(case, "hole seen through a lens", 1.0, f64::from(u8::from(out > 0.0 && out < rays)), 0.0);
    for onward in [Onward::Shadow, Onward::Mirror] {
        for plane in PLANES {
            let (lit, pixels) = lit(lab, case, &without(&|p| p.dot(plane.0) < 0.8), plane, onward, 8192);
            #[expect(clippy::cast_precision_loss, reason = "few")]
            let share = lit / pixels as f64;
            lab.number(
                case,
                &format!("share lit by {onward:?} rays without a side, across {}", plane.0),
                1.0,
                share,
                0.1,
            );
        }
    }
}
