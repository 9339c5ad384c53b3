// SPDX-License-Identifier: Apache-2.0
//! Limit surfaces against closed forms.
#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

use std::collections::HashMap;

use crate::shapes::{Shape, cube, grid, octahedron};
use oocpt_subdiv::{
    BoundaryRule, ControlMesh, FaceVaryingChannel, FaceVaryingLinear, LimitFacets, LimitSurface, PackedValues,
    SubdivisionRules, SubdivisionScheme, SurfaceData,
};

fn tessellate(shape: &Shape, control: &ControlMesh<'_>, pieces: impl Fn(usize) -> i32) -> LimitFacets {
    let surface = LimitSurface::new(control).unwrap();
    let rates: Vec<i32> = (0..surface.edges().len()).map(pieces).collect();
    surface.tessellate(&rates, &SurfaceData { positions: shape.positions(), ..SurfaceData::default() }).unwrap()
}

fn vec3(floats: &[f32], at: usize) -> [f64; 3] {
    std::array::from_fn(|k| f64::from(floats[3 * at + k]))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

fn normalized(a: [f64; 3]) -> [f64; 3] {
    a.map(|v| v / dot(a, a).sqrt())
}

/// Halstead, Kass and `DeRose` 1993, "Efficient, fair interpolation using Catmull-Clark surfaces": a vertex v with n
/// edges to points e, and faces with centres such that f are the points after one step, goes to (n^2 v + 4 sum e + sum
/// f) / (n (n + 5)), with v, e, f of the first step.
#[test]
fn cube_corners_reach_their_limit_positions() {
    let shape = cube();
    let facets = tessellate(&shape, &shape.control(SubdivisionRules::default()), |_| 1);
    // By symmetry all coordinates have one size. One step takes the corner (1, 1, 1) to 5/9, edge points to
    // (0, 3/4, 3/4), face points to (0, 0, 1); then 9 * 5/9 + 4 * 2 * 3/4 + 1 = 12, over 24.
    let expected = 0.5;
    assert_eq!(facets.positions.len(), 24, "every corner once: the surface is smooth");
    for at in 0..8 {
        let (position, normal) = (vec3(&facets.positions, at), vec3(&facets.normals, at));
        position.iter().for_each(|v| assert!((v.abs() - expected).abs() < 1e-6, "{position:?}"));
        assert!(dot(normalized(position), normal) > 1.0 - 1e-6, "{normal:?} points outwards at {position:?}");
    }
}

#[test]
fn inside_a_grid_the_surface_is_a_bicubic_spline() {
    // Control points off a plane by a polynomial.
    let height = |x: f64, y: f64| 0.3 * x * x * y - 0.2 * y * y + 0.05 * x * y * y * y;
    let shape = grid(7, |x, y| [x, y, height(x, y)]);
    let facets =
        tessellate(&shape, &shape.control(SubdivisionRules::default()), |edge| 1 + i32::try_from(edge % 5).unwrap());
    // The uniform cubic B-spline of values at whole numbers, and its slope.
    let basis = |t: f64| {
        [
            (1.0 - t).powi(3),
            3.0 * t.powi(3) - 6.0 * t * t + 4.0,
            -3.0 * t.powi(3) + 3.0 * t * t + 3.0 * t + 1.0,
            t.powi(3),
        ]
    };
    let slope = |t: f64| [-3.0 * (1.0 - t).powi(2), 9.0 * t * t - 12.0 * t, -9.0 * t * t + 6.0 * t + 3.0, 3.0 * t * t];
    let spline = |wx: [f64; 4], wy: [f64; 4], (i, j): (f64, f64)| -> f64 {
        let terms = (0..4).flat_map(|a| (0..4).map(move |b| (a, b)));
        terms.map(|(a, b)| wx[a] * wy[b] * height(i + a as f64 - 1.0, j + b as f64 - 1.0)).sum::<f64>() / 36.0
    };
    let (mut tested, mut worst) = (0, 0.0_f64);
    for at in 0..facets.positions.len() / 3 {
        let [x, y, z] = vec3(&facets.positions, at);
        // Away from the boundary, where x and y of the surface are those of the control points.
        if !(1.0..5.0).contains(&x) || !(1.0..5.0).contains(&y) {
            continue;
        }
        let (cell, tx, ty) = ((x.floor(), y.floor()), x.fract(), y.fract());
        worst = worst.max((spline(basis(tx), basis(ty), cell) - z).abs());
        let gradient = [spline(slope(tx), basis(ty), cell), spline(basis(tx), slope(ty), cell)];
        let normal = normalized([-gradient[0], -gradient[1], 1.0]);
        worst = worst.max((1.0 - dot(normal, vec3(&facets.normals, at))).abs());
        tested += 1;
    }
    assert!(tested > 100, "{tested} vertices");
    assert!(worst < 2e-5, "off by {worst}");
}

/// The box spline of Loop's scheme takes a regular vertex to (v + mean of its six neighbours) / 2.
#[test]
fn loop_limit_points_match_the_box_spline() {
    let height = |x: f64, y: f64| 0.1 * x * x - 0.3 * x * y + 0.02 * y * y * y;
    let quads = grid(7, |x, y| [x, y, height(x, y)]);
    let shape = quads.split_into_triangles();
    let facets = tessellate(
        &shape,
        &shape.control(SubdivisionRules { scheme: SubdivisionScheme::Loop, ..SubdivisionRules::default() }),
        |_| 1,
    );
    let mut tested = 0;
    for at in 0..facets.positions.len() / 3 {
        let [x, y, z] = vec3(&facets.positions, at);
        if !(0.9..5.1).contains(&x) || !(0.9..5.1).contains(&y) {
            continue;
        }
        let (x, y) = (x.round(), y.round());
        let around = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 1.0), (-1.0, -1.0)];
        let mean = around.iter().map(|(dx, dy)| height(x + dx, y + dy)).sum::<f64>() / 6.0;
        assert!((z - 0.5 * (height(x, y) + mean)).abs() < 1e-6, "at {x}, {y}");
        tested += 1;
    }
    assert_eq!(tested, 25, "all inner points");
}

#[test]
fn edges_that_are_infinitely_sharp_keep_a_cube_a_cube() {
    let shape = cube();
    let pairs = shape.edges();
    let weights = vec![10.0; pairs.len() / 2];
    let control =
        ControlMesh { crease_pairs: &pairs, crease_weights: &weights, ..shape.control(SubdivisionRules::default()) };
    let facets = tessellate(&shape, &control, |_| 3);
    for at in 0..facets.positions.len() / 3 {
        let (position, normal) = (vec3(&facets.positions, at), vec3(&facets.normals, at));
        let face = (0..3).find(|&k| normal[k].abs() > 0.999).expect("normals are those of the faces");
        assert!((position[face] - normal[face].signum()).abs() < 1e-5, "{position:?} lies on its face");
    }
    assert_eq!(facets.positions.len() / 3, 6 * 16, "each face has its own normals, so its own vertices");
    assert_eq!(facets.triangles.len() / 3, 6 * 18, "triangles");
}

#[test]
fn semi_sharp_edges_lie_between() {
    let shape = cube();
    let pairs = shape.edges();
    let reach = |sharpness: f32| {
        let weights = vec![sharpness; pairs.len() / 2];
        let control = ControlMesh {
            crease_pairs: &pairs,
            crease_weights: &weights,
            ..shape.control(SubdivisionRules::default())
        };
        let facets = tessellate(&shape, &control, |_| 1);
        f64::from(facets.positions[0]).abs()
    };
    let reached = [0.0, 1.0, 2.0, 10.0].map(reach);
    assert!(reached.is_sorted_by(|a, b| a < b), "{reached:?}");
}

#[test]
fn boundaries_follow_their_rule() {
    let shape = grid(2, |x, y| [x, y, 0.0]);
    let widest = |boundary| {
        let facets =
            tessellate(&shape, &shape.control(SubdivisionRules { boundary, ..SubdivisionRules::default() }), |_| 1);
        (0..facets.positions.len() / 3).map(|at| vec3(&facets.positions, at)[0]).fold(0.0, f64::max)
    };
    // A corner of a boundary curve that is not sharp goes to (4 v + neighbours) / 6.
    assert!((widest(BoundaryRule::EdgeAndCorner) - 1.0).abs() < 1e-6, "corners stay");
    assert!((widest(BoundaryRule::EdgeOnly) - 5.0 / 6.0).abs() < 1e-6, "corners are round");
    assert!(widest(BoundaryRule::None).abs() < 1e-6, "no surface without all neighbours");
}

/// Every edge of a closed surface has two triangles, by the bits of its positions, whatever the rates.
#[test]
fn neighbours_share_their_edges_bit_for_bit() {
    for (name, shape, scheme) in [
        ("cube", cube(), SubdivisionScheme::CatmullClark),
        ("octahedron, as any face", octahedron(), SubdivisionScheme::CatmullClark),
        ("octahedron", octahedron(), SubdivisionScheme::Loop),
    ] {
        for seed in 0..20_usize {
            let pieces = |edge: usize| 1 + i32::try_from((edge * 7 + seed * 13 + edge * edge * seed) % 9).unwrap();
            let facets =
                tessellate(&shape, &shape.control(SubdivisionRules { scheme, ..SubdivisionRules::default() }), pieces);
            let place = |v: u32| [0, 1, 2].map(|k| facets.positions[3 * v as usize + k].to_bits());
            let mut open: HashMap<_, i32> = HashMap::new();
            for triangle in facets.triangles.chunks(3) {
                for k in 0..3 {
                    let (a, b) = (place(triangle[k]), place(triangle[(k + 1) % 3]));
                    if a != b {
                        *open.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
                    }
                }
            }
            assert!(open.values().all(|&sum| sum == 0), "{name}, seed {seed}: an open edge");
        }
    }
}

#[test]
fn values_by_corner_keep_their_seams() {
    // Two quads beside each other; the value jumps from one to the other.
    let shape = grid(3, |x, y| [x, y, 0.0]);
    let corners: Vec<i32> = (0..16).collect();
    let floats: Vec<f32> = (0..16).map(|corner| if corner < 8 { 1.0 } else { 5.0 }).collect();
    let channels = [FaceVaryingChannel { corners: &corners, count: 16 }];
    let rules = SubdivisionRules { face_varying: FaceVaryingLinear::All, ..SubdivisionRules::default() };
    let control = ControlMesh { channels: &channels, ..shape.control(rules) };
    let surface = LimitSurface::new(&control).unwrap();
    let values = [PackedValues { width: 1, floats: &floats }];
    let smooth: Vec<f32> = shape.points.iter().map(|p| p[0]).collect();
    let by_point = PackedValues { width: 1, floats: &smooth };
    let data = SurfaceData { positions: shape.positions(), vertex: by_point, varying: by_point, channels: &values };
    let facets = surface.tessellate(&vec![2; surface.edges().len()], &data).unwrap();
    for (triangle, &face) in facets.triangles.chunks(3).zip(&facets.faces) {
        for &vertex in triangle {
            let expected = if face < 2 { 1.0 } else { 5.0 };
            assert!((facets.face_varying[vertex as usize] - expected).abs() < 1e-6, "face {face}");
        }
    }
    for at in 0..facets.positions.len() / 3 {
        let x = facets.positions[3 * at];
        assert!((facets.vertex[at] - x).abs() < 1e-5, "smooth values move as positions do");
    }
    let moved = (0..facets.varying.len()).any(|at| (facets.varying[at] - facets.positions[3 * at]).abs() > 0.01);
    assert!(!moved, "in this grid x is linear, and the surface keeps linear functions");
}
