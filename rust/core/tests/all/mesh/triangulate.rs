// SPDX-License-Identifier: Apache-2.0
//! Triangulation and unusable topology.

use glam::{DMat3, DQuat, DVec3, Vec3};
use oocpt_core::mesh::{BuiltMesh, build_mesh};
use oocpt_core::{DroppedData, MeshDesc, Subdivision, TypedArray};
use proptest::prelude::*;

use crate::support::{area, area_vector, grid, polygons, triangle};

fn build(desc: &MeshDesc) -> BuiltMesh {
    build_mesh(desc, 1)
}

/// Flat polygon in the xy plane.
fn polygon(outline: &[[f32; 2]]) -> MeshDesc {
    let n = i32::try_from(outline.len()).unwrap();
    let points: Vec<[f32; 3]> = outline.iter().map(|&[x, y]| [x, y, 0.0]).collect();
    polygons("/p", &[n], &(0..n).collect::<Vec<_>>(), &points)
}

fn shoelace(outline: &[[f32; 2]]) -> f64 {
    let n = outline.len();
    let p = |k: usize| outline[k % n].map(f64::from);
    (0..n).map(|k| 0.5 * (p(k)[0] * p(k + 1)[1] - p(k + 1)[0] * p(k)[1])).sum()
}

/// Checks that all triangles face the way of the polygon, that their areas sum up to its area (so that none overlap),
/// that there are at most n - 2 of them (fewer where corners lie on straight edges), and that nothing counts as lost.
fn assert_covers(outline: &[[f32; 2]]) {
    let built = build(&polygon(outline));
    let asset = built.asset.unwrap();
    let expected = shoelace(outline);
    assert!((area(&asset) - expected.abs()).abs() < 1e-5 * expected.abs(), "{} of {expected}", area(&asset));
    assert!((area_vector(&asset).z - expected).abs() < 1e-5 * expected.abs(), "{} of {expected}", area_vector(&asset));
    assert!(asset.triangles.len() <= outline.len() - 2, "{} triangles", asset.triangles.len());
    assert_eq!(built.dropped, DroppedData::default());
}

#[test]
fn concave_polygons_are_covered_once() {
    let arrow = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.5], [0.0, 2.0]];
    let comb: Vec<[f32; 2]> = (0..40_u8)
        .map(|k| [f32::from(k), if k % 2 == 0 { 5.0 } else { 1.0 }])
        .chain([[39.0, 0.0], [0.0, 0.0]])
        .collect();
    let mut reversed = comb.clone();
    reversed.reverse();
    let spiral: Vec<[f32; 2]> = (0..60_u8)
        .map(|k| (f32::from(k) * 0.2, 1.0 + f32::from(k) * 0.1))
        .chain((0..60_u8).rev().map(|k| (f32::from(k) * 0.2, 0.6 + f32::from(k) * 0.1)))
        .map(|(angle, radius)| [radius * angle.cos(), radius * angle.sin()])
        .collect();
    for outline in [&arrow[..], &comb, &reversed, &spiral] {
        assert_covers(outline);
    }
}

#[test]
fn corners_on_straight_edges_stay_in_use() {
    // A square with a corner in the middle of each edge, and an L: a T-vertex left out would open a crack.
    let square = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0], [0.0, 2.0], [0.0, 1.0]];
    let ell = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0], [0.0, 1.0]];
    for outline in [square, ell] {
        let built = build(&polygon(&outline));
        assert_covers(&outline);
        assert_eq!(built.dropped, DroppedData::default());
    }
}

#[test]
fn large_concave_faces_are_triangulated_exactly() {
    let star: Vec<[f32; 2]> = (0..3000_u16)
        .map(|k| (f32::from(k) * std::f32::consts::TAU / 3000.0, if k % 2 == 0 { 2.0 } else { 1.0 }))
        .map(|(angle, radius)| [radius * angle.cos(), radius * angle.sin()])
        .collect();
    assert_covers(&star);
}

#[test]
fn concave_quads_split_at_the_reflex_corner() {
    for first in 0..4 {
        let dart = [[0.0, 0.0], [2.0, -1.0], [0.5, 0.0], [2.0, 1.0_f32]];
        let outline: Vec<[f32; 2]> = (0..4).map(|k| dart[(k + first) % 4]).collect();
        assert_covers(&outline);
    }
}

proptest! {
    #[test]
    fn star_shaped_polygons_in_any_plane_keep_their_area(
        radii in prop::collection::vec(0.2_f32..3.0, 3..40),
        axis in prop::array::uniform3(-1.0_f64..1.0),
        angle in 0.0_f64..6.0,
        flip: bool,
    ) {
        let n = i32::try_from(radii.len()).unwrap();
        let Some(axis) = DVec3::from(axis).try_normalize() else { return Ok(()) };
        let turn = DMat3::from_quat(DQuat::from_axis_angle(axis, angle));
        let mut points: Vec<DVec3> = (0..n).zip(&radii).map(|(k, &r)| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(n);
            turn * DVec3::new(angle.cos(), angle.sin(), 0.0) * f64::from(r) + DVec3::new(1.0, 2.0, 3.0)
        }).collect();
        if flip { points.reverse(); }
        let newell: DVec3 = (0..points.len())
            .map(|k| 0.5 * (points[k] - points[0]).cross(points[(k + 1) % points.len()] - points[0])).sum();
        let points: Vec<[f32; 3]> = points.iter().map(|p| p.as_vec3().to_array()).collect();
        let asset = build(&polygons("/p", &[n], &(0..n).collect::<Vec<_>>(), &points)).asset.unwrap();
        // Equal area and equal area vector: no overlap, no fold.
        prop_assert!((area(&asset) - newell.length()).abs() < 1e-4 * newell.length());
        prop_assert!((area_vector(&asset) - newell).length() < 1e-4 * newell.length());
        prop_assert_eq!(asset.bvh.validate(&asset.triangles, asset.kind), Ok(()));
    }

    #[test]
    fn random_topology_never_panics_and_gives_valid_meshes(
        counts in prop::collection::vec(-2_i32..9, 0..12),
        indices in prop::collection::vec(-2_i32..9, 0..40),
        points in prop::collection::vec(prop::array::uniform3(prop_oneof![
            4 => -2.0_f32..2.0, 1 => Just(f32::NAN), 1 => Just(f32::INFINITY), 1 => Just(1e38_f32), 1 => Just(0.0_f32),
            1 => Just(1e-30_f32),
        ]), 0..9),
        holes in prop::collection::vec(-2_i32..12, 0..4),
        smooth: bool,
    ) {
        let mut desc = polygons("/garbage", &counts, &indices, &points);
        desc.hole_indices = Some(TypedArray::of(holes));
        desc.subdivision = if smooth { Subdivision::CatmullClark } else { Subdivision::None };
        let mut db = oocpt_core::SceneDb::new();
        db.upsert_mesh(desc.clone());
        let commit = db.commit();
        prop_assert_eq!(commit.snapshot.validate(), Ok(()));
        let none_left = build(&desc).asset.is_none();
        prop_assert_eq!(none_left, commit.snapshot.meshes.is_empty());
        prop_assert!(!none_left || commit.snapshot.dropped.empty_meshes == 1);
    }
}

#[test]
fn each_kind_of_bad_face_is_dropped_alone_and_counted() {
    let mut points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f32::NAN, 0.0, 0.0], [2.0, 0.0, 0.0]];
    points.extend([[0.0, f32::INFINITY, 0.0], [0.0, 0.0, 3e18]]);
    let good = [0, 1, 2];
    let counts = [3, 3, 3, 3, 3, 3, -3, 2, 3, 3, 5];
    let mut indices: Vec<i32> = Vec::new();
    for face in [good, [0, 1, 3], [0, 1, 5], [0, 1, 6], [0, 1, 7], [0, 1, -1]] {
        indices.extend(face);
    }
    indices.extend([0, 1]);
    indices.extend([0, 1, 4]); // a triangle without area
    indices.extend([2, 1, 0]);
    indices.extend([0, 1]); // the last face wants five
    let built = build(&polygons("/bad", &counts, &indices, &points));
    let expected = DroppedData {
        non_finite_points: 3,
        point_indices: 2,
        negative_counts: 1,
        small_faces: 1,
        zero_area_triangles: 1,
        faces_past_end: 1,
        ..DroppedData::default()
    };
    assert_eq!(built.dropped, expected);
    let asset = built.asset.unwrap();
    let mut faces: Vec<u32> = asset.triangles.iter().map(|t| t.face).collect();
    faces.sort_unstable();
    assert_eq!(faces, [0, 9], "authored face numbers stay");
}

/// Implicit cones and spheres close their strips with quads that have two corners in one place.
#[test]
fn a_quad_that_closes_to_a_point_is_a_triangle_and_nothing_is_lost() {
    let built = build(&polygon(&[[0.0, 0.0], [1.0, 0.0], [0.5, 1.0], [0.5, 1.0]]));
    assert_eq!(built.dropped, DroppedData::default());
    assert_eq!(built.asset.unwrap().triangles.len(), 1);
    let flat = build(&polygon(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]));
    assert_eq!(flat.dropped, DroppedData { zero_area_triangles: 2, empty_meshes: 1, ..DroppedData::default() });
}

/// A mesh with area keeps it in any unit of length, from a galaxy's to an atom's.
#[test]
fn small_and_large_meshes_keep_their_triangles() {
    let scaled = |desc: &MeshDesc, scale: f64| {
        let mut desc = desc.clone();
        let view = desc.points.view();
        let points: Vec<[f64; 3]> = (0..view.len()).map(|i| (view.vec3(i).unwrap() * scale).to_array()).collect();
        desc.points = TypedArray::of(points);
        desc
    };
    let comb: Vec<[f32; 2]> = (0..400_u16)
        .map(|k| [f32::from(k), if k % 2 == 0 { 5.0 } else { 1.0 }])
        .chain([[399.0, 0.0], [0.0, 0.0]])
        .collect();
    let mut smooth = grid("/g", 30);
    smooth.subdivision = Subdivision::CatmullClark;
    for desc in [smooth, polygon(&comb[..40]), polygon(&comb)] {
        let whole = build(&desc).asset.unwrap();
        for scale in [1e-9, 1e-14, 1e-6, 1e6, 1e14] {
            let built = build(&scaled(&desc, scale));
            assert_eq!(built.dropped, DroppedData::default(), "scale {scale}: nothing is lost");
            let asset = built.asset.unwrap();
            assert_eq!(asset.triangles.len(), whole.triangles.len(), "scale {scale}: triangles");
            let wanted = area(&whole) * scale * scale;
            assert!((area(&asset) - wanted).abs() < 1e-5 * wanted, "scale {scale}: {} of {wanted}", area(&asset));
            assert_eq!(asset.bvh.validate(&asset.triangles, asset.kind), Ok(()), "scale {scale}: the hierarchy");
            let normals = asset.normals.iter().flat_map(|a| &a.values);
            let lengths = normals.map(|n| Vec3::from(*n).length());
            assert!(lengths.into_iter().all(|l| (l - 1.0).abs() < 1e-5), "scale {scale}: unit normals");
        }
    }
}

/// The middle corner is off the line by far less than the rounding of double precision, or the triangle is smaller than
/// single precision can compute with.
#[test]
fn slivers_beyond_precision_have_no_area_at_any_scale() {
    for scale in [1e-9_f32, 1e-3, 1.0, 1e9] {
        let sliver = [[0.0, 0.0], [scale, 0.0], [2.0 * scale, 1e-16 * scale]];
        let built = build(&polygon(&sliver));
        let expected = DroppedData { zero_area_triangles: 1, empty_meshes: 1, ..DroppedData::default() };
        assert_eq!(built.dropped, expected, "scale {scale}");
    }
    let atom = [[0.0, 0.0], [1e-19, 0.0], [0.0, 1e-19]];
    assert!(build(&polygon(&atom)).asset.is_none(), "too small for the device");
}

#[test]
fn surplus_indices_are_counted_and_the_rest_is_kept() {
    let built = build(&polygons("/p", &[3], &[0, 1, 2, 0], &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]));
    assert_eq!(built.dropped, DroppedData { surplus_indices: 1, ..DroppedData::default() });
    assert_eq!(built.asset.unwrap().triangles.len(), 1);
}

#[test]
fn a_mesh_without_valid_faces_gives_no_asset() {
    let cases = [
        polygons("/empty", &[], &[], &[]),
        polygons("/no_faces", &[], &[], &[[0.0; 3]]),
        polygons("/flat", &[3], &[0, 1, 2], &[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]),
        polygons("/far", &[i32::MAX], &[0, 1, 2], &[[0.0; 3]]),
    ];
    for desc in cases {
        let built = build(&desc);
        assert!(built.asset.is_none(), "{}", desc.prim.path);
        assert_eq!(built.dropped.empty_meshes, 1, "{}", desc.prim.path);
    }
    let mut wrong = triangle("/wrong", 0.0);
    wrong.face_vertex_indices = TypedArray::of(vec![0.0_f32, 1.0, 2.0]);
    assert_eq!(build(&wrong).dropped, DroppedData { wrong_array_types: 1, ..DroppedData::default() });
}

#[test]
fn holes_are_left_out_and_bad_holes_counted() {
    let mut desc = grid("/g", 3);
    desc.hole_indices = Some(TypedArray::of(vec![4, 4, 9, -1, 0]));
    let built = build(&desc);
    assert_eq!(built.dropped, DroppedData { hole_indices: 2, ..DroppedData::default() });
    let asset = built.asset.unwrap();
    assert_eq!(asset.triangles.len(), 14);
    assert!(asset.triangles.iter().all(|t| t.face != 4 && t.face != 0));
}

#[test]
fn double_precision_points_are_read() {
    let mut desc = triangle("/t", 0.0);
    desc.points = TypedArray::of(vec![[0.0_f64, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
    assert!((area(&build(&desc).asset.unwrap()) - 1.0).abs() < 1e-12);
}
