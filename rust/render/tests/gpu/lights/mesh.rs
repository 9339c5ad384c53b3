// SPDX-License-Identifier: Apache-2.0
//! Meshes that emit light, sampled as lights: closed forms, sums over many, and how noisy they are beside lights of the
//! same shape.

use super::shapes::polygon;
use super::{ALBEDO, downwards, expect, irradiances, light, rect};
use crate::materials::{color, plain, reading};
use crate::scenes::{instanced, instancer, mesh, prim, sphere, square};
use crate::support::{color_request, orthographic, read, render, session, settings};
use glam::{DMat4, DQuat, DVec3};
use oocpt_core::scene::{MaterialDesc, MeshDesc, ParamValue, SceneDb, SubsetDesc};
use oocpt_core::{LightDesc, LightKind, TypedArray};
use oocpt_render::AovKind;
use std::f64::consts::PI;

/// A material that emits and reflects nothing.
pub(super) fn glow(path: &str, radiance: [f32; 3]) -> MaterialDesc {
    let [diffuse, specular, workflow] = black();
    plain(path, &[("emissiveColor", color(radiance)), diffuse, specular, workflow])
}

/// Parameters of a surface that reflects nothing.
pub(super) fn black() -> [(&'static str, ParamValue); 3] {
    let dark = color([0.0; 3]);
    [("diffuseColor", dark.clone()), ("specularColor", dark), ("useSpecularWorkflow", ParamValue::Int(1))]
}

pub(super) fn glowing(mut mesh: MeshDesc) -> MeshDesc {
    mesh.material = Some("/glow".into());
    mesh
}

/// A square of half size 1 about the origin, in the plane z = 0.
pub(super) fn quad(path: &str, prim_id: i32, transform: DMat4) -> MeshDesc {
    let points = vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    glowing(mesh(prim(path, transform), prim_id, points, &[vec![0, 1, 2, 3]], 0.5))
}

pub(super) fn corners(transform: DMat4) -> Vec<DVec3> {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    corners.map(|[x, y]| transform.transform_point3(DVec3::new(x, y, 0.0))).to_vec()
}

/// Squares that lie, stand, lean, are stretched, sheared and mirrored; seen from either side.
#[test]
fn a_square_mesh_light_matches_lamberts_formula() {
    let shear = DMat4::from_cols(glam::DVec4::X, glam::DVec4::new(1.5, 1.0, 0.0, 0.0), glam::DVec4::Z, glam::DVec4::W);
    let at = |x: f64, y: f64, z: f64| DMat4::from_translation(DVec3::new(x, y, z));
    let cases = [
        ("above", downwards(DVec3::new(0.0, 1.0, -0.5))),
        ("its back", at(0.0, 1.5, -1.2) * DMat4::from_rotation_x(PI / 2.0)),
        (
            "leaning, stretched",
            at(-0.5, 1.5, -1.0) * DMat4::from_rotation_x(0.6) * DMat4::from_scale(DVec3::new(0.3, 1.4, 5.0)),
        ),
        ("sheared", at(0.5, 2.0, -2.0) * DMat4::from_rotation_y(0.7) * shear),
        ("mirrored, small", at(0.0, 1.0, -1.5) * DMat4::from_scale(DVec3::new(-0.05, 0.05, 1.0))),
    ];
    for (what, transform) in cases {
        expect(what, 2048, polygon(&corners(transform)), 6e-3, &|db| {
            db.upsert_material(glow("/glow", [1.0; 3]));
            db.upsert_mesh(quad("/quad", 2, transform));
        });
    }
}

/// Irradiance at the origin of a convex mesh of triangles and quads.
pub(super) fn convex(desc: &MeshDesc, m: DMat4) -> f64 {
    let points: Vec<DVec3> =
        (0..desc.points.len()).map(|k| m.transform_point3(desc.points.vec3(k).expect("a point"))).collect();
    let middle = m.transform_point3(DVec3::ZERO);
    let mut at = 0;
    let (indices, counts) = (&desc.face_vertex_indices, &desc.face_vertex_counts);
    let mut sum = 0.0;
    for face in 0..counts.len() {
        let count = counts.index(face).and_then(|n| usize::try_from(n).ok()).expect("a count");
        let corners: Vec<DVec3> = (at..at + count)
            .map(|k| points[usize::try_from(indices.index(k).expect("an index")).expect("positive")])
            .collect();
        at += count;
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let outwards = normal * normal.dot(corners[0] - middle).signum();
        if outwards.dot(-corners[0]) > 0.0 {
            sum += polygon(&corners);
        }
    }
    sum
}

/// A closed mesh: its faces' polygons; and the sphere light that it nearly is.
#[test]
fn a_sphere_of_faces_gives_the_sum_of_its_faces() {
    for (what, size) in [("a ball", DVec3::splat(0.4)), ("an egg", DVec3::new(0.2, 0.5, 0.3))] {
        let transform =
            DMat4::from_scale_rotation_translation(size, DQuat::from_rotation_z(0.5), DVec3::new(0.6, 1.3, -0.7));
        let ball = |rings| glowing(sphere(prim("/ball", transform), 2, rings, 0.0));
        let expected = convex(&ball(12), transform);
        expect(what, 2048, expected, 6e-3, &|db| {
            db.upsert_material(glow("/glow", [1.0; 3]));
            db.upsert_mesh(ball(12));
        });
    }
    let at = DVec3::new(0.6, 1.3, -0.7);
    let exact = PI * 0.16 / at.length_squared() * at.y / at.length();
    expect("nearly a sphere", 2048, exact, 6e-3, &|db| {
        db.upsert_material(glow("/glow", [1.0; 3]));
        let place = DMat4::from_translation(at) * DMat4::from_scale(DVec3::splat(0.4));
        db.upsert_mesh(glowing(sphere(prim("/ball", place), 2, 48, 0.0)));
    });
}

/// Two colours on one mesh, a dim light and a mesh whose other faces are dark.
#[test]
fn subsets_emit_their_own_emission() {
    let transform = downwards(DVec3::new(0.0, 1.0, -0.5));
    let points =
        vec![[-1.0, -1.0, 0.0], [0.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    let mut desc = mesh(prim("/board", transform), 2, points, &[vec![0, 1, 4, 3], vec![1, 2, 5, 4]], 0.0);
    desc.material = Some("/glow".into());
    let subset = |material: &str| {
        vec![SubsetDesc { path: "/s".into(), material: Some(material.into()), faces: TypedArray::of(vec![1]) }]
    };
    let halves = [(-1.0, 0.0), (0.0, 1.0)].map(|(low, high)| {
        polygon(
            &[[low, -1.0], [high, -1.0], [high, 1.0], [low, 1.0]]
                .map(|[x, y]| transform.transform_point3(DVec3::new(x, y, 0.0))),
        )
    });
    for (material, second) in [("/other", 0.0625), ("/dark", 0.0)] {
        let mut desc = desc.clone();
        desc.subsets = subset(material);
        let expected = halves[0] + second * halves[1];
        expect(material, 2048, expected, 6e-3, &|db| {
            db.upsert_material(glow("/glow", [1.0; 3]));
            db.upsert_material(glow("/other", [0.0625; 3]));
            db.upsert_material(glow("/dark", [0.0; 3]));
            db.upsert_mesh(desc.clone());
        });
    }
}

/// Numbers between 0 and 1 that only depend on `i`.
fn scattered(i: u32) -> DVec3 {
    let i = f64::from(i);
    DVec3::new(0.754_877_666_246_7 * i, 0.569_840_290_998 * i, 0.381_966_011_250_1 * i).fract()
}

pub(super) fn place(i: u32) -> DVec3 {
    DVec3::new(-8.0, 0.5, -8.0) + scattered(i) * DVec3::new(16.0, 4.0, 16.0)
}

pub(super) fn turn(i: u32) -> DQuat {
    DQuat::from_rotation_x(if i.is_multiple_of(2) { -PI / 2.0 } else { 0.0 })
}

/// Irradiance at the origin of a small square of half size `half`, radiance 1, that shines to both sides.
pub(super) fn small(i: u32, half: f64) -> f64 {
    let (at, normal) = (place(i), turn(i) * DVec3::Z);
    let d = at.length();
    4.0 * half * half * normal.dot(at / d).abs() * at.y / (d * d * d)
}

/// Few as prims of their own with colours and powers of their own, many as instances.
#[test]
fn many_small_mesh_lights_match_their_sum() {
    for count in [1_u32, 100] {
        let power = |i: u32| f32::from(u8::try_from(1 + i % 9).expect("small")).powi(2);
        let sum: f64 = (1..=count).map(|i| f64::from(power(i)) * small(i, 0.03)).sum();
        let build = |db: &mut SceneDb| {
            for i in 1..=count {
                let name = format!("/glow_{i}");
                db.upsert_material(glow(&name, [power(i); 3]));
                let transform = DMat4::from_scale_rotation_translation(DVec3::splat(0.03), turn(i), place(i));
                let mut desc = quad(&format!("/quad_{i}"), 1 + i32::try_from(i).expect("small"), transform);
                desc.material = Some(name.into());
                db.upsert_mesh(desc);
            }
        };
        for given in irradiances(2048, &build) {
            assert!((given[0] / sum - 1.0).abs() < 1e-2, "{count}: {}, not {sum}", given[0]);
        }
    }
}

/// So small that they do not shadow each other.
#[test]
fn a_hundred_thousand_instances_agree_with_their_sum() {
    const COUNT: u32 = 100_000;
    let half = 0.001;
    let sum: f64 = (0..COUNT).map(|i| small(i, half)).sum();
    let build = |db: &mut SceneDb| {
        let places: Vec<_> = (0..COUNT).map(|i| (place(i), turn(i), DVec3::splat(half))).collect();
        db.upsert_material(glow("/glow", [1.0; 3]));
        db.upsert_instancer(instancer(prim("/lamps", DMat4::IDENTITY), "/lamps/lamp", &places));
        let mut lamp = quad("/lamps/lamp", 2, DMat4::IDENTITY);
        lamp.prim = instanced(lamp.prim, "/lamps");
        db.upsert_mesh(lamp);
    };
    for given in irradiances(2048, &build) {
        assert!((given[0] / sum - 1.0).abs() < 1.5e-2, "{}, not {sum}", given[0]);
    }
}

/// With a light of another kind beside it, a sky, and far from the world's origin.
#[test]
fn mesh_lights_and_other_lights_add_up() {
    let quad_at = downwards(DVec3::new(0.0, 1.0, -0.5));
    let rect_at = downwards(DVec3::new(3.0, 2.0, 1.5));
    let rect_corners: Vec<DVec3> = corners(rect_at * DMat4::from_scale(DVec3::new(0.25, 0.5, 1.0)));
    let expected = polygon(&corners(quad_at)) + 3.0 * polygon(&rect_corners);
    expect("both", 4096, expected, 1e-2, &|db| {
        db.upsert_material(glow("/glow", [1.0; 3]));
        db.upsert_mesh(quad("/quad", 2, quad_at));
        db.upsert_light(LightDesc {
            prim: prim("/rect", rect_at),
            intensity: 3.0,
            ..light(rect(0.5, 1.0), DMat4::IDENTITY)
        });
    });
    let sky = |db: &mut SceneDb| {
        db.upsert_material(glow("/glow", [2.0; 3]));
        db.upsert_mesh(quad("/quad", 2, quad_at));
        db.upsert_light(LightDesc { camera_visible: false, ..crate::scenes::dome([0.5; 3]) });
    };
    let share = polygon(&corners(quad_at));
    expect("under a sky", 4096, 0.5 * (PI - share) + 2.0 * share, 1e-2, &sky);
}

/// Mean square error of the pixels of the floor, over the square of their mean, at `samples`, with both strategies.
pub(super) fn noise(samples: u32, expected: f64, build: &dyn Fn(&mut SceneDb)) -> f64 {
    let session = session(settings(samples, 1));
    session.with_scene(|db| {
        db.upsert_mesh(square(prim("/floor", DMat4::IDENTITY), 1, ALBEDO));
        build(db);
    });
    let request = color_request(orthographic(DVec3::new(0.0, 5.0, 3.0), DVec3::ZERO, 0.01, [32, 32]));
    render(&session, &request);
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let scale = PI / f64::from(ALBEDO) / expected;
    let sum: f64 = colors.iter().map(|color| (scale * f64::from(color[0]) - 1.0).powi(2)).sum();
    sum / f64::from(u32::try_from(colors.len()).expect("small"))
}

/// At equal samples: as good as the rectangle and the sphere light of the same shape, and far better than by chance.
#[test]
fn a_small_mesh_is_no_noisier_than_a_light_of_its_shape() {
    let half = 0.1;
    let transform = downwards(DVec3::new(0.0, 1.0, -0.5)) * DMat4::from_scale(DVec3::splat(half));
    let expected = polygon(&corners(transform));
    let mesh = noise(16, expected, &|db| {
        db.upsert_material(glow("/glow", [1.0; 3]));
        db.upsert_mesh(quad("/quad", 2, transform));
    });
    let rectangle = noise(16, expected, &|db| {
        db.upsert_light(light(rect(0.2, 0.2), downwards(DVec3::new(0.0, 1.0, -0.5))));
    });
    // Two meshes of one id are met by BSDF rays only; the other one is below the floor.
    let chance = noise(16, expected, &|db| {
        db.upsert_material(glow("/glow", [1.0; 3]));
        db.upsert_mesh(quad("/quad", 2, transform));
        db.upsert_mesh(quad("/twin", 2, DMat4::from_translation(DVec3::new(0.0, -50.0, 0.0)) * transform));
    });
    println!("relative MSE at 16 samples: square mesh {mesh:.3e}, rectangle {rectangle:.3e}, by chance {chance:.3e}");
    assert!(mesh < 1.5 * rectangle, "a mesh: {mesh}, a rectangle: {rectangle}");
    assert!(chance > 20.0 * mesh, "by chance: {chance}, a mesh: {mesh}");

    let at = DVec3::new(0.6, 1.3, -0.7);
    let exact = PI * 0.04 / at.length_squared() * at.y / at.length();
    let ball = noise(16, exact, &|db| {
        db.upsert_material(glow("/glow", [1.0; 3]));
        let place = DMat4::from_translation(at) * DMat4::from_scale(DVec3::splat(0.2));
        db.upsert_mesh(glowing(sphere(prim("/ball", place), 2, 32, 0.0)));
    });
    let round = noise(16, exact, &|db| {
        let kind = LightKind::Sphere { radius: 0.2, treat_as_point: false };
        db.upsert_light(light(kind, DMat4::from_translation(at)));
    });
    println!("relative MSE at 16 samples: ball mesh {ball:.3e}, sphere {round:.3e}");
    // Faces are chosen by bounds of their contributions, which a cone around the whole does not give: measured 36 times
    // the sphere's, 2.5e-2.
    assert!(ball < 0.04, "a ball mesh: {ball}, a sphere: {round}");
}

/// A scene without emission has none of the features.
#[test]
fn scenes_without_emission_leave_it_out() {
    let left_out = |material: MaterialDesc| {
        let session = session(settings(1, 1));
        session.with_scene(|db| {
            db.upsert_material(material);
            db.upsert_mesh(quad("/quad", 2, DMat4::IDENTITY));
        });
        let request = color_request(orthographic(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 1.0, [8, 8]));
        render(&session, &request);
        session.stats().features_left_out.iter().any(|part| part.contains("emissive meshes"))
    };
    assert!(!left_out(glow("/glow", [1.0; 3])), "an emissive mesh is sampled");
    assert!(left_out(glow("/glow", [0.0; 3])), "a black one is not");
    assert!(left_out(reading("/glow", "emissiveColor", "float3", "glow", &[])), "nor a primvar that nothing has");
}

/// Rays and shadow rays end where traversal finds the mesh: far from the origin and deep in nested frames.
#[test]
fn far_away_emitters_do_not_shadow_themselves() {
    let far = DVec3::new(3.0e3, 2.0e3, -1.0e3);
    let transform =
        DMat4::from_translation(far) * downwards(DVec3::new(0.0, 1.0, -0.5)) * DMat4::from_scale(DVec3::splat(0.2));
    let local = DMat4::from_translation(-far) * transform;
    let expected = polygon(&corners(local));
    for bounces in [0, 1] {
        let session = session(settings(1024, bounces));
        session.with_scene(|db| {
            db.upsert_mesh(square(prim("/floor", DMat4::from_translation(far)), 1, ALBEDO));
            db.upsert_material(glow("/glow", [1.0; 3]));
            db.upsert_mesh(quad("/quad", 2, transform));
            // Another mesh stands at the other end of the world.
            db.upsert_mesh(square(prim("/other", DMat4::IDENTITY), 3, ALBEDO));
        });
        let request = color_request(orthographic(far + DVec3::new(0.0, 5.0, 3.0), far, 0.01, [8, 8]));
        render(&session, &request);
        let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
        let mean = colors.iter().map(|color| f64::from(color[0])).sum::<f64>() / 64.0;
        let given = mean * PI / f64::from(ALBEDO);
        assert!((given / expected - 1.0).abs() < 1e-2, "{bounces} bounces: {given}, not {expected}");
    }
}
