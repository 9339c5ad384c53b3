// SPDX-License-Identifier: Apache-2.0

use super::*;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

fn solid(radii: [f64; 2], height: f64, is_round: bool) -> SolidDesc {
    SolidDesc { size: SolidSize { radii, height }, samples: Vec::new(), axis: 2, is_round }
}

fn formed(solid: &SolidDesc, polygons: bool) -> MeshDesc {
    let mut desc = MeshDesc { solid: Some(solid.clone()), ..MeshDesc::default() };
    assert!(desc.take_form(polygons), "{solid:?} has no form before");
    assert!(!desc.take_form(polygons), "and keeps it");
    desc
}

/// Corners of each face: places and normals.
fn faces(desc: &MeshDesc) -> Vec<Vec<[DVec3; 2]>> {
    let (counts, corners) = (desc.face_vertex_counts.view(), desc.face_vertex_indices.view());
    let normals = desc.normals.as_ref().expect("normals").values.view();
    let mut first = 0;
    let face = |at: usize| {
        let count = counts.index(at).unwrap() as usize;
        let corner = |k: usize| {
            let point = desc.points.view().vec3(corners.index(k).unwrap() as usize);
            [point.expect("a point"), normals.vec3(k).expect("a normal")]
        };
        let all = (first..first + count).map(corner).collect();
        first += count;
        all
    };
    (0..counts.len()).map(face).collect()
}

/// Volume inside, area, and the area of the shadow along y, of a closed mesh; asserts that it is closed and that
/// normals are on the outside.
fn measures(desc: &MeshDesc) -> [f64; 3] {
    let [mut volume, mut area, mut shadow] = [0.0; 3];
    let mut closed = DVec3::ZERO;
    for face in faces(desc) {
        let mut vector = DVec3::ZERO;
        for k in 1..face.len() - 1 {
            let [a, b, c] = [0, k, k + 1].map(|k| face[k][0]);
            vector += 0.5 * (b - a).cross(c - a);
            volume += a.dot(b.cross(c)) / 6.0;
        }
        area += vector.length();
        shadow += 0.5 * vector.y.abs();
        closed += vector;
        for [_, normal] in &face {
            assert!((normal.length() - 1.0).abs() < 1e-6, "a unit normal");
            let turn = normal.dot(vector.normalize());
            assert!(vector.length() < 1e-12 || turn > 0.99, "on the outside: {turn}");
        }
    }
    assert!(closed.length() < 1e-9 * area, "it is closed: {closed}");
    [volume, area, shadow]
}

#[test]
fn polygons_have_the_area_and_volume_of_the_solid() {
    let (r, h) = (0.4, 0.5);
    let slant = f64::hypot(h, r);
    let slant2 = f64::hypot(0.6, 0.2);
    for (what, solid, expected) in [
        ("a cylinder", solid([r, r], h, false), [PI * r * r * h, TAU * r * (r + h), 2.0 * r * h]),
        ("a cone", solid([r, 0.0], h, false), [PI * r * r * h / 3.0, PI * r * (r + slant), r * h]),
        ("a cone upside down", solid([0.0, r], h, false), [PI * r * r * h / 3.0, PI * r * (r + slant), r * h]),
        ("signs do not count", solid([-r, r], -h, false), [PI * r * r * h, TAU * r * (r + h), 2.0 * r * h]),
        ("a sphere", solid([r, r], 0.0, true), [4.0 / 3.0 * PI * r * r * r, 4.0 * PI * r * r, PI * r * r]),
        (
            "a capsule",
            solid([r, r], h, true),
            [PI * r * r * (4.0 / 3.0 * r + h), 2.0 * TAU * r * r + TAU * r * h, PI * r * r + 2.0 * r * h],
        ),
        (
            "a capsule of two radii",
            solid([0.4, 0.2], 0.6, true),
            [
                PI * (2.0 / 3.0 * (0.064 + 0.008) + 0.2 * (0.16 + 0.08 + 0.04)),
                TAU * (0.16 + 0.04) + PI * 0.6 * slant2,
                PI / 2.0 * (0.16 + 0.04) + 0.6 * 0.6,
            ],
        ),
    ] {
        let found = measures(&formed(&solid, true));
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 2e-3, "{what}: {found} is not {expected}");
        }
    }
}

#[test]
fn corners_are_on_the_solid_along_any_axis() {
    for axis in 0..3 {
        let solid = SolidDesc { axis, ..solid([0.3, 0.3], 0.8, false) };
        for [place, normal] in faces(&formed(&solid, true)).into_iter().flatten() {
            let across = DVec3::from_array([0, 1, 2].map(|k| if k == axis { 0.0 } else { place[k] }));
            assert!((place[axis].abs() - 0.4).abs() < 1e-7, "at an end: {place}");
            let is_centre = across.length() < 1e-9;
            assert!(is_centre || (across.length() - 0.3).abs() < 1e-7, "on the rim: {place}");
            let way = if normal[axis].abs() > 0.5 { normal[axis].abs() } else { normal.dot(across) / 0.3 };
            assert!((way - 1.0).abs() < 1e-6, "{normal} at {place}");
        }
    }
}

#[test]
fn spheres_and_even_capsules_are_exact_unless_asked_otherwise() {
    let sphere = formed(&solid([0.5, 0.5], 0.0, true), false);
    assert!(matches!(sphere.shape, PrimShape::Points) && sphere.points.len() == 1, "a point");
    assert_eq!(sphere.widths.as_ref().and_then(|w| w.values.view().scalar(0)), Some(1.0), "its diameter");
    let capsule = formed(&SolidDesc { axis: 0, ..solid([0.5, -0.5], -3.0, true) }, false);
    assert!(matches!(capsule.shape, PrimShape::Curves(_)), "a piece of a curve");
    let ends = [0, 1].map(|at| capsule.points.view().vec3(at).unwrap().as_vec3());
    assert_eq!(ends, [Vec3::new(-1.5, 0.0, 0.0), Vec3::new(1.5, 0.0, 0.0)], "its ends");
    for (radii, height, is_round) in [([0.5, 0.4], 1.0, true), ([0.5, 0.5], 1.0, false)] {
        let desc = formed(&solid(radii, height, is_round), false);
        assert!(matches!(desc.shape, PrimShape::Mesh), "{radii:?} {height} {is_round} are polygons");
    }
    let mut desc = sphere;
    assert!(desc.take_form(true) && matches!(desc.shape, PrimShape::Mesh), "a form can be changed");
    assert!(desc.take_form(false) && desc.normals.is_none() && desc.face_vertex_counts.is_empty(), "and back");
}

#[test]
fn a_solid_of_non_finite_size_has_no_faces() {
    for (radii, height) in [([f64::NAN, 1.0], 1.0), ([1.0, f64::INFINITY], 1.0), ([1.0; 2], f64::NAN)] {
        for is_round in [false, true] {
            let mut desc = MeshDesc { solid: Some(solid(radii, height, is_round)), ..MeshDesc::default() };
            assert!(!desc.take_form(true) && desc.points.is_empty(), "{radii:?} {height}");
            assert!(desc.solid.is_some(), "it stays known");
        }
    }
    assert!(formed(&solid([0.0; 2], 1.0, true), false).points.len() == 2, "a capsule of no width");
    let mut line = MeshDesc { solid: Some(solid([0.0; 2], 1.0, false)), ..MeshDesc::default() };
    line.take_form(false);
    assert!(line.face_vertex_counts.is_empty(), "a cylinder of no width");
    let disc = formed(&solid([0.5; 2], 0.0, false), false);
    assert_eq!(disc.face_vertex_counts.len(), 2 * AROUND as usize, "a cylinder of no height: two discs");
}

#[test]
fn motion_samples_have_the_topology_of_the_frame() {
    let size = |lower: f64, upper: f64, height: f64| SolidSize { radii: [lower, upper], height };
    for is_round in [false, true] {
        let samples = vec![(0.0, size(0.0, 0.0, 0.0)), (1.0, size(0.5, 0.25, 2.0))];
        let solid = SolidDesc { samples, ..solid([0.5, 0.5], 0.0, is_round) };
        let desc = formed(&solid, false);
        assert_eq!(desc.point_motion.samples.len(), 2, "both");
        for sample in &desc.point_motion.samples {
            assert_eq!(sample.points.len(), desc.points.len(), "as many points");
            let count = sample.normals.as_ref().map(TypedArray::len);
            assert_eq!(count, desc.normals.as_ref().map(|n| n.values.len()), "as many normals");
        }
    }
    let samples = vec![(0.0, size(1.0, 1.0, 0.0)), (1.0, size(2.0, 2.0, 0.0))];
    let desc = formed(&SolidDesc { samples, ..solid([1.5, 1.5], 0.0, true) }, false);
    let widths = desc.point_motion.samples.iter().map(|s| s.widths.as_ref().unwrap().view().scalar(0).unwrap());
    assert_eq!(widths.collect::<Vec<_>>(), [2.0, 4.0], "a sphere that grows is exact at all times");
}
